"""The whole way from a case to a judged plan, in one call; and the first half of it, the drive alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hdvplan.case import Case
from hdvplan.driving.drive import Drive, driven, ready
from hdvplan.driving.followed import Followed, followed
from hdvplan.driving.given import DENSE_M, GivenPath
from hdvplan.errors import PlanError, RoadError
from hdvplan.judging.result import Result, result_of
from hdvplan.passing.sides import choose_sides
from hdvplan.planning.bias import CENTRE, bias_named
from hdvplan.planning.objectives import Objective, objective_named
from hdvplan.planning.planner import Plan
from hdvplan.proof.answer import proved
from hdvplan.settings import of_kind
from hdvplan.solvers.registry import SolverClass, SolverMaker, dependable, solver_named

_GAP_M = 15.0  # between points of a path that turns there; of a recorded track one is kept every 5 to 10 m
_CASE = "hdvplan.Case(road, vehicle) is one, of loaded roads and vehicles"


def plan(case: Case, *, on_progress: Callable[[float], None] | None = None, on_plan: Callable[[Plan], None] | None = None) -> Result:
    """Plan ``case.vehicle`` along the whole of ``case.road`` in receding horizon, and judge the plan by an exact simulation.

    Where this breaks the limits, the command goes on to ``prove`` and ``replanned``, which may find a plan that keeps them.
    For every obstacle that can be passed on either side, both are tried. ``on_progress`` receives the driven share, 0 to 1, ``on_plan``
    every plan before it is executed; an error that it raises ends the drive.

    Raises:
        OptionError: it is no ``Case``, no such objective, or a bias that the road or the objective has no room for.
        SolverError: no such solver, not installed, or neither it nor a second solver found a plan.
        RoadError: the road is shorter than the vehicle, or an obstacle has no room on the side on which it must be passed.
        PlanError: the vehicle cannot be planned along the road's line, even without limits.

    """
    of_kind("case", case, Case, _CASE)
    road, passed = choose_sides(case)
    own = replace(case, road=road)
    try:
        executed = drive_case(own, on_progress=on_progress, on_plan=on_plan)
    except PlanError:
        if road.street is None:
            raise
        # Limits led to where motion along the line has no model. What a plan without them lacks is an answer, an error would be none.
        free = replace(own, settings=case.settings.unlimited)
        executed = replace(drive_case(free, on_progress=on_progress), settings=case.settings)
    return result_of(executed, solver=case.solver, objective=case.objective, passed=passed)


def follow(case: Case, path: GivenPath) -> Followed:
    """Return the drive along a path of one's own without judging it; see ``judge`` for the errors."""
    of_kind("case", case, Case, _CASE)
    of_kind("path", path, GivenPath, "hdvplan.GivenPath(points) is one, of an array (n, 2)")
    return followed(case.road, case.vehicle, case.settings, path, objective_named(case.objective))


def judge(case: Case, path: GivenPath) -> Result:
    """Judge a path of one's own for the lead unit as ``plan`` judges its own: nothing is planned, the trailers follow.

    The result is about the part of the road that the path covers. Its case has an objective and a solver that were not asked.

    Raises:
        OptionError: it is no ``GivenPath``.
        RoadError: points that are no path, or that do not run along the road.
        PlanError: a curvature that the vehicle cannot steer, or a motion that leaves the model's domain.

    """
    return given_result(case, path, follow(case, path))


def given_result(case: Case, path: GivenPath, along: Followed) -> Result:
    """Return the judged drive along a path of one's own, which knows the path's file, and what hangs on the curve between its points."""
    apart = float(np.max(path.spacing))
    result = replace(result_of(along.drive, solver=case.solver, objective=case.objective), path=path.name)
    if apart <= DENSE_M:
        return result
    if np.max(path.unfilled(), initial=0.0) > _GAP_M:
        return replace(result, between=(apart, np.inf))
    try:
        other = result_of(follow(case, path.otherwise).drive, solver=case.solver, objective=case.objective)
    except (PlanError, RoadError):  # too tight, often by little where the curve between the points is right
        return replace(result, between=(apart, np.nan))
    rooms = np.array([[own.max_left, own.max_right, own.min_clearance] for own in (result.balance, other.balance)], dtype=float)
    return replace(result, between=(apart, float(np.max(np.ptp(np.nan_to_num(rooms, posinf=0.0), axis=0)))))  # of no limits, or none near


def biased(case: Case, text: str) -> Case:
    """Return the case with the bias that users call ``text``: metres, a file with columns s,bias, or ``centre`` of the limits.

    That is between the limits of the sides on which the obstacles are passed.

    Raises:
        OptionError: as for ``bias_named``.
        RoadError: an obstacle has no room on the side on which it must be passed.

    """
    road = choose_sides(case)[0] if text == CENTRE else case.road
    return replace(case, bias=bias_named(text, road.passable))


def prove(result: Result, *, on_progress: Callable[[float], None] | None = None) -> Result:
    """Return a judged plan, with a proof that nothing keeps the limits if the plan breaks them and a proof is found.

    ``plan`` does not look for proofs, because each takes seconds. The verdict has the result as ``proved`` and ``proof``. ``on_progress``
    receives the share of the tight stretches that are examined, 0 to 1.
    """
    return proved(result, on_progress=on_progress)


def solver(name: str | SolverClass, tolerance: float | None = None) -> SolverMaker:
    """Return a factory for workspaces of a solver: for ``Case(solver=...)``, or to call with a ``StageShape``.

    ``name`` and ``tolerance`` are those of ``hdvplan.solvers.registry.solver_named``.

    Raises:
        SolverError: unknown, not installed, cannot be loaded, or without a tolerance to set.

    """
    return solver_named(name, tolerance)


def drive_case(
    case: Case,
    objective: Objective | None = None,
    *,
    after: Drive | None = None,
    on_progress: Callable[[float], None] | None = None,
    on_plan: Callable[[Plan], None] | None = None,
) -> Drive:
    """Plan and execute a case without judging it; see ``drive``, and ``plan`` for the errors.

    ``objective`` replaces ``case.objective`` if that is not a public name. The drive goes on ``after`` one on the road before, if given.
    """
    wanted, solving = objective or objective_named(case.objective), dependable(case.solver)
    begun = ready(case.road, case.vehicle, wanted, solving, case.settings, case.bias, after=after)
    return driven(begun, on_progress, on_plan)
