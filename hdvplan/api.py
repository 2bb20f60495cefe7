"""The whole way from a case to a judged plan, in one call; the drive alone; and plans made again, for less lacking or more room."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from math import ceil, inf, log

import numpy as np

from hdvplan.case import Case
from hdvplan.driving.drive import Drive, driven, ready
from hdvplan.driving.followed import Followed, followed
from hdvplan.driving.given import DENSE_M, GivenPath
from hdvplan.errors import HdvplanError, PlanError, RoadError
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.clearance import rooms_beside
from hdvplan.judging.result import Attempt, Result, result_of
from hdvplan.judging.verdict import verdict_of
from hdvplan.passing.sides import choose_sides
from hdvplan.planning.bias import CENTRE, bias_named
from hdvplan.planning.objectives import Objective, objective_named
from hdvplan.planning.planner import Plan
from hdvplan.planning.settings import MOST_STAGES, SHORTEST_STEP_M, PlannerSettings
from hdvplan.proof.answer import proved
from hdvplan.settings import of_kind
from hdvplan.solvers.registry import SolverClass, SolverMaker, dependable, solver_named

_GAP_M = 15.0  # between points of a path that turns there; of a recorded track one is kept every 5 to 10 m
_CASE = "hdvplan.Case(road, vehicle) is one, of loaded roads and vehicles"
_DEEP = 0.1  # of the deepest that a plan lacks, above which limits give way there
_GAIN, _GAINS = 0.05, 0.3  # metres per metre between stations that limits give less way to a finer plan; lacking most that it is tried
_SHARE = 0.25  # of what was to be gained that a plan may miss and counts as found: what gives way is kept to some centimetres only
_REPAIRS = 3  # times as many as of a first plan: with as many, a long vehicle may lack 3 cm where 1.5 do
_DIVISORS = (2, 5)  # of the distance of stations: whole numbers, so that horizon and replanning distance remain multiples of it
_FIRST_M, _MOST = 0.2, 20  # clearance that is tried beyond the room of a plan, then twice that, and so on; plans at most
NEAR_M = 0.05  # room to spare below which people ask whether more can be had
LONG_M = 1000.0  # a road on which the plans that tell how much take longer than people wait for it
_WORTH = 0.1  # metres lacking at best per metre between stations beyond which a finer plan is not tried: that much is hardly ever gained


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


def replanned(result: Result, *, on_progress: Callable[[float], None] | None = None) -> Result:
    """Return the plan that lacks the least room, of one that breaks its limits and of others of its case; other plans as they are.

    Each lists in ``attempts`` what was tried. The others are planned with limits that give way: a plan that cannot keep its street makes
    the sum of its breaches least, not the deepest one; with limits that give way by some metres it lacks no more than these anywhere.
    Halving finds the fewest. Where some centimetres are lacking, limits give way by a little less to a plan with stations half as far
    apart: from one to the next a plan holds its curvature. Then, unless a proof says that nothing fits, stations lie nearer together
    until one fits or too much is lacking for that. All are judged by the limits as they are. ``on_progress`` receives the share of the
    attempts that are made, 0 to 1.
    """
    if verdict_of(result).fits is not False:
        return result
    best, attempts = result, [_attempt(result)]
    most = ceil(log(attempts[0].lacking / KEPT_M, 2.0 / (1.0 + _SHARE))) + len(_DIVISORS)
    with suppress(HdvplanError):  # what cannot be planned so is no better answer
        for found in _others(result, attempts[0].lacking):
            least = min(attempt.lacking for attempt in attempts)
            attempts.append(_attempt(found))
            best = found if attempts[-1].lacking < least else best
            if on_progress is not None:
                on_progress(min(1.0, (len(attempts) - 1) / most))
    return result if len(attempts) == 1 else replace(best, proof=result.proof, attempts=tuple(attempts))


def _others(result: Result, least: float) -> Iterator[Result]:
    """Make other plans of a case whose first plan lacks ``least`` [m]."""
    settings, none = result.case.settings, 0.0  # none: no plan is known that lacks only that much
    where = _given_up(result)
    while least > max(KEPT_M, none + KEPT_M):
        give_way = 0.5 * (none + least)
        giving = replace(settings, give_way=give_way, give_way_on=where, rti_repairs=_REPAIRS * settings.rti_repairs)
        found = plan(replace(result.case, settings=giving))
        yield found
        lacking = _attempt(found).lacking
        missed = lacking > give_way + _SHARE * (least - give_way)
        least, none = min(least, lacking), give_way if missed else none
    finer = _divided(settings, _DIVISORS[0])
    if finer is not None and _WORTH * settings.step < least <= _GAINS * settings.step:
        giving = replace(finer, give_way=least - _GAIN * settings.step, give_way_on=where, rti_repairs=_REPAIRS * settings.rti_repairs)
        found = plan(replace(result.case, settings=giving))
        yield found
        least = min(least, _attempt(found).lacking)
    for divisor in () if result.proof else _DIVISORS:
        finer = _divided(settings, divisor)
        if finer is None or not 0.0 < least <= _WORTH * settings.step:
            return
        found = plan(replace(result.case, settings=finer))
        yield found
        least = min(least, _attempt(found).lacking)


def _given_up(result: Result) -> tuple[tuple[float, float, float], ...]:
    """Return where limits give way, and by how much at most: near where the first plan lacks room, or a length from there, by as much.

    It makes the sum of what is lacking least: no more than the deepest is needed there. Shallow places do not count: where nothing can
    fit, the plan has not settled elsewhere either.
    """
    vehicle, wanted = result.case.vehicle, result.case.settings.clearance
    ahead, behind = 2.0 * vehicle.reach_ahead + vehicle.reach_behind, vehicle.reach_ahead + 2.0 * vehicle.reach_behind
    places = [(near.s, wanted - near.distance) for near in result.approaches]
    for touches in result.balance.touches.values():
        places += [(float(s), wanted - float(gap)) for s, gap in zip(touches["s"].flat, touches["gap"].flat, strict=True)]
    rooms = rooms_beside(result.drive, result.envelope.s)
    places += [(float(s), wanted - float(room)) for s, room in zip(result.envelope.s, rooms, strict=True)]
    given: list[tuple[float, float, float]] = []
    counts = max(KEPT_M, _DEEP * max((lacking for _, lacking in places), default=0.0))
    for s, lacking in sorted(place for place in places if place[1] > counts):
        begin, end, most = s - ahead, s + behind, lacking
        if given and begin < given[-1][1]:  # what is gained at one place is lost at the other
            before = given.pop()
            begin, end, most = before[0], max(before[1], end), max(before[2], most)
        given.append((begin, end, most))
    return tuple(given)


def _attempt(result: Result) -> Attempt:
    verdict, settings = verdict_of(result), result.case.settings
    return Attempt(settings.step, settings.give_way, 0.0 if verdict.fits else -(verdict.spare or 0.0))


def _divided(settings: PlannerSettings, divisor: int) -> PlannerSettings | None:
    """Return settings with stations so many times as near; None where that is finer than a plan may be."""
    step = settings.step / divisor
    if step < SHORTEST_STEP_M or settings.stages * divisor > MOST_STAGES:
        return None
    return replace(settings, step=step, give_way=0.5 * KEPT_M)  # half of what counts as kept


def is_near(result: Result) -> bool:
    """Tell whether a plan fits and comes nearer to its limits than people like, for its objective does not ask for room."""
    verdict = verdict_of(result)
    return bool(verdict.fits) and verdict.spare is not None and verdict.clearance_wanted + verdict.spare < NEAR_M


def clearest(result: Result, *, on_progress: Callable[[float], None] | None = None) -> Result:
    """Return the plan that was asked for the largest clearance and keeps it, to 1 cm, of one that fits and others of its case.

    A plan that fits comes as near to limits as its objective likes; more clearance leaves its driver more room. Plans that do not fit, and
    those on roads without limits, are returned as they are. The clearance is that of the returned case's
    settings. ``on_progress`` receives the share of the plans that are made at most, 0 to 1.
    """
    if not verdict_of(result).fits or result.balance.min_clearance is None:
        return result
    best, kept, missed, step = result, result.case.settings.clearance, inf, result.balance.min_clearance + _FIRST_M
    for number in range(_MOST):
        if missed - kept <= KEPT_M:
            break
        wanted, step = (kept + step, 2.0 * step) if missed == inf else (0.5 * (kept + missed), step)
        found = result
        with suppress(HdvplanError):  # what cannot be planned so is too much
            found = plan(replace(result.case, settings=replace(result.case.settings, clearance=wanted)))
        if found is not result and verdict_of(found).fits:
            best, kept = found, wanted
        else:
            missed = wanted
        if on_progress is not None:
            on_progress((number + 1) / _MOST)
    return best
