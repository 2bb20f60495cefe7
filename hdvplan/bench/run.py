"""Measure: one drive of one cell, and all drives of a benchmark in an order that lets drift hit all cells alike."""

from __future__ import annotations

import gc
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hdvplan.bench.courses import Course, courses_of
from hdvplan.bench.samples import FAILED, NUMBERS, OK, OVER_BUDGET, Judgement, Measurement, numbers_of, part_file, write_part
from hdvplan.bench.suite import Suite, visits
from hdvplan.drive import Drive, drive, warm_up
from hdvplan.errors import HdvplanError
from hdvplan.evaluation.balance import balance_of
from hdvplan.evaluation.envelope import envelope_of
from hdvplan.planning.objectives import geometric
from hdvplan.planning.planner import Plan, qp_shape
from hdvplan.planning.settings import PlannerSettings
from hdvplan.solvers.registry import WorkspaceMaker, solver_named
from hdvplan.solvers.sparse import SparseQp


class _OverBudgetError(Exception):
    """The drive's planning time is used up."""


def run(suite: Suite, directory: Path, on_progress: Callable[[float], None]) -> None:
    """Measure every cell and round whose part is not yet in ``directory``; ``on_progress`` receives the done share.

    A cell that cannot be planned is measured as far as it goes and noted as such; it does not end the run.

    Raises:
        HdvplanError: a road, vehicle or solver of the suite cannot be loaded.
        OSError: a part cannot be written.

    """
    courses, cells = courses_of(suite), suite.cells()
    makers = {name: solver_named(name) for name in suite.solvers}
    entrants = len(cells) // len(courses)
    order = visits(len(courses), entrants, suite.rounds)
    lengths = np.array([courses[cell // entrants].road.path.length for _, cell in order])
    done = np.cumsum(lengths) / np.sum(lengths)
    for (round_, index), share in zip(order, done, strict=True):
        part = part_file(directory, index, round_)
        if not part.exists():
            course, cell = courses[index // entrants], cells[index]
            measured = measure(course, suite.settings(cell.scheme), makers[cell.solver], budget=suite.budget, judged=round_ == 0)
            write_part(part, measured)
        on_progress(float(share))


def remaining(suite: Suite, directory: Path) -> int:
    """Return how many drives are still to be measured."""
    return sum(not part_file(directory, cell, round_).exists() for cell in range(len(suite.cells())) for round_ in range(suite.rounds))


def measure(course: Course, settings: PlannerSettings, make_workspace: WorkspaceMaker, *, budget: float, judged: bool) -> Measurement:
    """Drive a course once and return every planning step; what was swept only if it is to be ``judged``.

    A drive ends early when its planning time exceeds ``budget`` [s] or it fails; its steps so far are kept.
    """
    road, vehicle = course.road, course.vehicle
    form = SparseQp.of(qp_shape(vehicle, settings, limited=road.limits is not None), elastic=False)
    nonzeros = int(form.P.nnz + form.E.nnz + form.G.nnz)
    steps, statuses, spent = [], [], 0.0

    def keep(plan: Plan) -> None:
        nonlocal spent
        steps.append(numbers_of(plan))
        statuses.append(str(plan.status))
        spent += plan.times.total
        if spent > budget:
            raise _OverBudgetError

    warm_up(vehicle, geometric, make_workspace, settings)
    outcome, message, judgement = OK, "", None
    gc.collect()
    gc.disable()
    try:
        driven = drive(road, vehicle, geometric, make_workspace, settings, on_plan=keep)
        gc.enable()
        judgement = judge(driven) if judged else None
    except _OverBudgetError:
        outcome, message = OVER_BUDGET, f"stopped after {spent:.1f} s of planning"
    except HdvplanError as error:
        outcome, message = FAILED, str(error)
    finally:
        gc.enable()
    numbers = np.array(steps) if steps else np.empty((0, len(NUMBERS)))
    return Measurement(numbers, tuple(statuses), outcome, message, nonzeros, judgement)


def judge(driven: Drive) -> Judgement:
    """Return what an executed drive swept.

    Raises:
        PlanError: a body reached beyond the road's centre of curvature.

    """
    envelope = envelope_of(driven)
    balance = balance_of(driven, envelope)
    return Judgement(
        balance.max_left,
        balance.max_right,
        balance.mean_abs_imbalance,
        balance.expected_half_width,
        np.nan if balance.min_clearance is None else balance.min_clearance,
        balance.violation,
        driven.z[:, 0],
        envelope.reach_left,
        envelope.reach_right,
    )
