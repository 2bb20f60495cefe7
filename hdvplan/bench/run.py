"""Measure: one drive of one cell, and all drives of a benchmark in an order that lets drift hit all cells alike."""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from hdvplan.bench.samples import FAILED, NUMBERS, OK, OVER_BUDGET, Judgement, Measurement, numbers_of, part_file, write_part
from hdvplan.bench.suite import Suite, visits
from hdvplan.case import Case
from hdvplan.driving.drive import Drive, drive, warm_up
from hdvplan.errors import HdvplanError
from hdvplan.judging.balance import balance_of
from hdvplan.judging.envelope import envelope_of
from hdvplan.planning.objectives import objective_named
from hdvplan.planning.planner import Plan
from hdvplan.qp.program import StageShape
from hdvplan.qp.workspace import QpWorkspace, WorkspaceMaker
from hdvplan.solvers.sparse import SparseQp


class _OverBudgetError(Exception):
    """The drive's planning time is used up."""


def run(
    suite: Suite,
    cases: Sequence[Case],
    makers: Mapping[str, WorkspaceMaker],
    directory: Path,
    on_progress: Callable[[float], None],
) -> None:
    """Measure every cell and round whose part is not yet in ``directory``; ``on_progress`` receives the done share.

    ``cases`` as ``cases_of(suite)`` returns them, ``makers`` by the solvers' names. A cell that cannot be planned is
    measured as far as it goes and noted as such; it does not end the run.

    Raises:
        OSError: a part cannot be written.

    """
    courses = len(suite.courses())
    order = [
        (part, index, round_ == 0)
        for round_, index in visits(courses, len(cases) // courses, suite.rounds)
        if not (part := part_file(directory, index, round_)).exists()
    ]
    lengths = np.array([cases[index].road.path.length for _, index, _ in order])
    warm = set()
    gc.freeze()  # what the imports left is not garbage: looking at it before every drive takes longer than a short drive
    try:
        for number, (part, index, judged) in enumerate(order):
            case = cases[index]
            make = makers[case.solver_name]
            limited = case.road.limits is not None
            if (case.vehicle, case.solver, limited) not in warm:
                warm_up(case.vehicle, objective_named(case.objective), make, case.settings, limited=limited)
                warm.add((case.vehicle, case.solver, limited))
            write_part(part, measure(case, make, budget=suite.budget, judged=judged))
            on_progress(float(np.sum(lengths[: number + 1]) / np.sum(lengths)))
    finally:
        gc.unfreeze()


def remaining(suite: Suite, directory: Path) -> int:
    """Return how many drives are still to be measured."""
    return sum(not part_file(directory, cell, round_).exists() for cell in range(len(suite.cells())) for round_ in range(suite.rounds))


def measure(case: Case, make_workspace: WorkspaceMaker, *, budget: float, judged: bool) -> Measurement:
    """Drive a case once with the solver of ``make_workspace`` and return every planning step; what was swept only if ``judged``.

    The first plan sets the solver up and iterates to convergence, which warms the processor's caches for the others. A
    drive ends early when its planning time exceeds ``budget`` [s] or it fails; its steps so far are kept.
    """
    shapes: list[StageShape] = []

    def make(shape: StageShape) -> QpWorkspace:
        shapes.append(shape)
        return make_workspace(shape)

    steps, statuses, spent = [], [], 0.0

    def keep(plan: Plan) -> None:
        nonlocal spent
        steps.append(numbers_of(plan))
        statuses.append(str(plan.status))
        spent += plan.times.total
        if spent > budget:
            raise _OverBudgetError

    outcome, message, judgement = OK, "", None
    gc.collect()
    gc.disable()
    try:
        driven = drive(case.road, case.vehicle, objective_named(case.objective), make, case.settings, bias=case.bias, on_plan=keep)
        gc.enable()
        judgement = judge(driven) if judged else None
    except _OverBudgetError:
        outcome, message = OVER_BUDGET, f"stopped after {spent:.1f} s of planning"
    except HdvplanError as error:
        outcome, message = FAILED, str(error)
    finally:
        gc.enable()
    numbers = np.array(steps) if steps else np.empty((0, len(NUMBERS)))
    return Measurement(numbers, tuple(statuses), outcome, message, _nonzeros(shapes), judgement)


def _nonzeros(shapes: Sequence[StageShape]) -> int:
    """Return the non-zeros of the program that a drive asked its solver for; 0 where it ended before."""
    if not shapes:
        return 0
    form = SparseQp.of(shapes[0], elastic=False)
    return int(form.P.nnz + form.E.nnz + form.G.nnz)


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
