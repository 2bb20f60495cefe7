"""Measure one drive of one cell: every planning step with its times, then the same drive again beside the reference, untimed."""

from __future__ import annotations

import gc
from collections.abc import Callable, Container, Mapping, Sequence
from time import perf_counter

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.bench.measuring.recording import Program, driven_by, nonzeros_of, replay, sampled
from hdvplan.bench.measuring.referee import ReferenceCheck, Watch, copied_steps, given_away, memory_fault
from hdvplan.bench.measuring.samples import (
    DISTANCES,
    FAILED,
    NUMBERS,
    OK,
    OVER_BUDGET,
    UNFAIR,
    UNRECORDED,
    Judgement,
    Measurement,
    ended,
    numbers_of,
    outcome_of,
)
from hdvplan.bench.suite import Suite, tuning_key
from hdvplan.case import Case
from hdvplan.driving.drive import Drive
from hdvplan.errors import HdvplanError
from hdvplan.judging.balance import balance_of
from hdvplan.planning.planner import Plan
from hdvplan.qp.program import StageShape
from hdvplan.qp.workspace import QpWorkspace, WorkspaceMaker
from hdvplan.solvers.registry import is_foreign
from hdvplan.solvers.riccati import RiccatiWorkspace

REFERENCE: WorkspaceMaker = RiccatiWorkspace  # that every solution is compared with, at its own strict tolerance
Alive = Callable[[int], None]  # receives the steps done, after each


_UPDATE, _SOLVE = NUMBERS.index("update_s"), NUMBERS.index("solve_s")
_COURSES = 100  # whose recorded programs are kept at a time: a third of a megabyte each


class _OverBudgetError(Exception):
    """The drive's planning time is used up."""


class Bench:
    """Measures the cells of a suite; call it with a case's index."""

    def __init__(self, suite: Suite, cases: Sequence[Case], makers: Mapping[str, WorkspaceMaker], alive: Alive) -> None:
        """Take over the cases; what the imports left is not garbage: looking at it before every drive takes longer than a short one."""
        self._suite, self._cases, self._makers, self._alive = suite, cases, makers, alive
        self._recorded: dict[int, list[Program]] = {}
        gc.freeze()

    def __call__(self, index: int, *, judged: bool, solver: str | None = None) -> Measurement:
        """Return the measurement of a case by its own ``solver`` or another; sweep and distances only if ``judged``."""
        case = self._cases[index]
        make = self._makers[maker_name(self._makers, case, self._suite.cells()[index].limits, solver)]
        if self._suite.sample:
            try:
                programs = self._programs(index)
            except HdvplanError as error:
                return ended(UNRECORDED, f"nothing was recorded: {outcome_of(error)[1]}")
            if not programs:
                return ended(UNRECORDED, "nothing was recorded: the drive has only one step")
            return replay(programs, make, budget=self._suite.budget, judged=judged, alive=self._alive)
        self._alive(0)
        return measure(case, make, budget=self._suite.budget, judged=judged, alive=self._alive)

    def _programs(self, index: int) -> list[Program]:
        course = index // len(self._suite.solvers)
        if course not in self._recorded:
            if len(self._recorded) >= _COURSES:
                self._recorded.clear()
            self._recorded[course] = sampled(self._cases[index], REFERENCE, self._suite.sample)
        return self._recorded[course]


def maker_name(makers: Container[str], case: Case, limits: str, solver: str | None) -> str:
    """Return the name of the maker by which a case is measured: that of ``solver``, or its own, tuned where there is such."""
    wanted = solver or tuning_key(case.solver_name, limits)
    return wanted if wanted in makers else case.solver_name


def measure(case: Case, make_workspace: WorkspaceMaker, *, budget: float, judged: bool, alive: Alive = lambda _: None) -> Measurement:
    """Drive a case once with the solver of ``make_workspace`` and return every planning step; what was swept only if ``judged``.

    The first plan sets the solver up and iterates to convergence, which warms the processor's caches for the others. A
    drive ends early when its planning time exceeds ``budget`` [s] or it fails, whatever the solver raises; its steps so far are kept.
    A judged drive is driven a second time, with the reference beside the solver: so no timed step has another solver's work between
    its own.
    """
    shapes: list[StageShape] = []

    def make(shape: StageShape) -> QpWorkspace:
        shapes.append(shape)
        return make_workspace(shape)

    alive(0)
    steps, statuses, reasons, spent, mark, gave = [], [], [""], 0.0, 0.0, 0

    def keep(plan: Plan) -> None:
        nonlocal spent, mark, gave
        outside = perf_counter() - mark - plan.times.aside
        steps.append(numbers_of(plan, plan.first * case.settings.step, outside, given_away() - gave))
        statuses.append(str(plan.status))
        reasons.append(plan.reason)
        alive(len(steps))
        spent += plan.times.total
        if spent > budget:
            raise _OverBudgetError
        mark, gave = perf_counter(), given_away()

    outcome, message, judgement, distances = OK, "", None, np.empty((0, len(DISTANCES)))
    gc.collect()
    gc.disable()
    watch = Watch()
    mark, gave = perf_counter(), given_away()
    try:
        driven = driven_by(make, case, keep)
        gc.enable()
        judgement = judge(driven) if judged else None
    except _OverBudgetError:
        outcome, message = OVER_BUDGET, f"stopped after {spent:.1f} s of planning"
    except Exception as error:  # noqa: BLE001 - a solver may raise anything; its row says what
        outcome, message = outcome_of(error)
    finally:
        gc.enable()
    if outcome in {OK, OVER_BUDGET} and (fault := watch.fault(len(steps))):
        return ended(UNFAIR, fault)
    if judged and steps:
        check = ReferenceCheck(make_workspace, REFERENCE, copied_steps(len(steps)) if is_foreign(make_workspace) else set())
        distances, why = checked_drive(case, check, len(steps), alive)
        if outcome == OK and len(distances) < len(steps):
            outcome, message = FAILED, f"driven again beside the reference it ends after {len(distances)} of {len(steps)} steps: {why}"
        elif outcome in {OK, OVER_BUDGET}:
            timed = {step: steps[step][_UPDATE] + steps[step][_SOLVE] for step in check.asked}
            if fault := memory_fault(make_workspace, check.asked, timed, lambda: alive(len(steps))):
                return ended(UNFAIR, fault)
    message = message or next(filter(None, reasons), "")
    numbers = np.array(steps) if steps else np.empty((0, len(NUMBERS)))
    return Measurement(numbers, tuple(statuses), outcome, message, nonzeros_of(shapes[0]) if shapes else 0, judgement, distances)


def checked_drive(case: Case, check: ReferenceCheck, count: int, alive: Alive) -> tuple[FloatArray, str]:
    """Return of up to ``count`` planning steps how far they lie from the reference's, (steps, len(DISTANCES)), from a drive of its own.

    With it comes why that drive ended early; nothing where it did not.
    """
    why = ""
    found: list[tuple[float, float, float]] = []

    def keep(_: Plan) -> None:
        found.append(check.take())
        alive(len(found))
        if len(found) == count:
            raise _OverBudgetError

    try:
        driven_by(check, case, keep)
    except _OverBudgetError:
        pass
    except Exception as error:  # noqa: BLE001 - a solver may raise anything
        why = outcome_of(error)[1]
    return np.array(found).reshape(-1, len(DISTANCES)), why


def judge(driven: Drive) -> Judgement:
    """Return what an executed drive swept."""
    balance = balance_of(driven)
    envelope = balance.envelope
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
