"""The quadratic programs of a drive as they came to the solver, with its guesses and its solutions."""

from __future__ import annotations

import gc
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hdvplan.arrays import FloatArray, IntArray
from hdvplan.bench.measuring.referee import Asked, Watch, copied_steps, given_away, memory_fault, proves, scale_of
from hdvplan.bench.measuring.samples import DISTANCES, NUMBERS, OK, OVER_BUDGET, UNFAIR, Measurement, ended, outcome_of
from hdvplan.case import Case
from hdvplan.driving.drive import Drive, drive
from hdvplan.errors import HdvplanError
from hdvplan.planning.objectives import objective_named
from hdvplan.planning.planner import Plan
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import USABLE_RESIDUAL, Moment, QpResult, QpWorkspace, WorkspaceMaker, residuals
from hdvplan.solvers.registry import is_foreign, solver_named
from hdvplan.solvers.sparse import SparseQp

LIMITS = ("off", "inactive", "binding", "unkeepable")  # the roles of limits in a program
ACTIVE = 1e-6  # a multiplier beyond this belongs to an active inequality
_BROKEN_M = 1e-6  # an elastic variable beyond this means that its row cannot be kept


@dataclass(frozen=True)
class Recorded:
    """One program of a drive: what the solver was given and what it returned, copied."""

    qp: StageQp
    guess: StageSolution | None  # what the planner knew of the solution: the last one, shifted; None at a start, and where nothing bound
    point: StageSolution
    first: int  # the station at which its plan begins
    number: int  # of the program within its plan, from 0
    limited: bool = True  # whether the road has limits; without any, no row can bind

    @property
    def limits(self) -> str:
        """Which role limits play, one of ``LIMITS``."""
        if not self.limited:
            return "off"
        if np.any(self.point.sigma > _BROKEN_M):
            return "unkeepable"
        return "binding" if np.any(self.point.rows > ACTIVE) else "inactive"


class Recording(NamedTuple):
    """The programs of a drive in their order, and why it ended early; None where it did not."""

    programs: list[Recorded]
    ended: str | None


def record(case: Case, most: int | None = None) -> Recording:
    """Return the programs of a case's drive, at most the first ``most``.

    Raises:
        OptionError: no such objective.
        SolverError: no such solver, or not installed.

    """

    def wanted(_step: int, _number: int) -> bool:
        if most is not None and len(recorder.found) >= most:
            raise _EnoughError
        return True

    def note(plan: Plan) -> None:
        recorder.next(plan.first + case.settings.executed)

    objective_named(case.objective)  # one that nobody knows is no end of a drive
    recorder = _Recorder(solver_named(case.solver), wanted, limited=case.road.street is not None)
    ended = None
    try:
        driven_by(recorder, case, note)
    except _EnoughError:
        pass
    except HdvplanError as error:
        ended = str(error)
    return Recording(recorder.found, ended)


class _EnoughError(Exception):
    """All programs that are wanted are recorded."""


class _Recorder:
    """Makes a workspace that copies those programs which are ``wanted``, by the step of the drive and their number within it.

    With ``helps`` every point is called a help for the next solve: others' warm starts need it even where the solver's own do not.
    """

    def __init__(self, make: WorkspaceMaker, wanted: Callable[[int, int], bool], *, limited: bool, helps: bool = False) -> None:
        self.found: list[Recorded] = []
        self.step = 0
        self._first, self._number = 0, 0
        self._make, self._wanted, self._limited, self._helps = make, wanted, limited, helps
        self._own: QpWorkspace

    def __call__(self, shape: StageShape) -> QpWorkspace:
        """Return itself, around a workspace for ``shape``; a drive that first comes along a way records that way too."""
        self._own = self._make(shape)
        self.name, self.starts_warm = self._own.name, self._own.starts_warm
        return self

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        wanted = self._wanted(self.step, self._number)
        cold = guess is None or not any(np.any(part) for part in guess.numbers)  # the planner's memory before its first plan
        known = None if guess is None or cold or not wanted else guess.copy()
        asked = qp.copy() if wanted else qp
        result = self._own.solve(qp, guess)
        if wanted:
            self.found.append(Recorded(asked, known, result.point.copy(), self._first, self._number, self._limited))
        self._number += 1
        return result._replace(leaves_guess=True) if self._helps else result

    def next(self, first: int) -> None:
        """Begin the next step of the drive, whose plan begins at a station."""
        self.step, self._first, self._number = self.step + 1, first, 0


_TOTAL, _COLD = NUMBERS.index("total_s"), NUMBERS.index("cold_s")


@dataclass(frozen=True)
class Program:
    """The first program of one planning step, its warm start and its optimum."""

    s_m: float  # where its step begins
    binding: bool
    qp: StageQp
    guess: StageSolution
    optimum: StageSolution
    scale: float  # of multipliers; NaN where the reference has no proof


def chosen_steps(binding: FloatArray, count: int) -> IntArray:
    """Return which of a drive's steps make a sample of ``count``: spread evenly, half of them where limits bind as far as there are any.

    ``binding`` says of every step but the first whether limits bind; steps count from 1.
    """
    held, free = np.flatnonzero(binding) + 1, np.flatnonzero(np.logical_not(binding)) + 1
    of_held = min(len(held), max(count // 2, count - len(free)))
    return np.sort(np.concatenate([_spread(held, of_held), _spread(free, min(len(free), count - of_held))]))


def _spread(steps: IntArray, count: int) -> IntArray:
    return steps[np.round(np.linspace(0, len(steps) - 1, count)).astype(np.int64)] if count else steps[:0]


def sampled(case: Case, reference: WorkspaceMaker, count: int) -> list[Program]:
    """Return a sample of the programs of a drive by the reference, shuffled, so that the first few are a sample too.

    Raises:
        HdvplanError: the reference cannot drive the case.

    """
    binding: list[bool] = []
    driven_by(reference, case, lambda plan: binding.append(plan.merit is not None))
    wanted = set(chosen_steps(np.array(binding[1:]), count).tolist())
    recorder = _Recorder(reference, lambda step, number: step in wanted and number == 0, limited=case.road.street is not None, helps=True)
    kept: list[Program] = []

    def keep(plan: Plan) -> None:
        if recorder.step in wanted:
            kept.append(_program(recorder.found.pop(), plan.first * case.settings.step, binding=plan.merit is not None))
        recorder.next(plan.first + case.settings.executed)

    driven_by(recorder, case, keep)
    return [kept[place] for place in np.random.default_rng(0).permutation(len(kept))]


def _program(one: Recorded, s_m: float, *, binding: bool) -> Program:
    scale = scale_of(one.point)
    proof = scale if proves(residuals(one.qp, one.point), scale) else np.nan
    return Program(s_m, binding, one.qp, one.guess or StageSolution.empty(one.qp.shape), one.point, proof)


def replay(
    recorded: list[Program], make: WorkspaceMaker, *, budget: float, judged: bool, alive: Callable[[int], None] = lambda _: None
) -> Measurement:
    """Have a solver solve recorded programs, warm and then cold, and return each as a step; ends early as a drive does.

    A first solve that takes all of the budget [s] is the only step, with what setting the solver up took.
    """
    steps: list[list[float]] = []
    statuses: list[str] = []
    distances: list[tuple[float, float, float]] = []
    outcome, message, spent = OK, "", 0.0
    alive(0)
    gc.collect()
    gc.disable()
    watch = Watch()
    try:
        workspace = make(recorded[0].qp.shape)
        setting_up = _solved(workspace, recorded[0], hurried=True)  # sets up; counts only where it takes the budget
        slow = setting_up[0][_TOTAL] > budget
        for number, one in enumerate(recorded):
            numbers, status, reason, distance = setting_up if slow else _solved(workspace, one, hurried=spent > budget)
            message = message or reason
            steps.append(numbers)
            statuses.append(status)
            distances.append(distance)
            spent += float(np.nansum([numbers[_TOTAL], numbers[_COLD]]))
            alive(number + 1)
            if spent > budget and number + 1 < len(recorded):
                outcome, message = OVER_BUDGET, f"{number + 1} of {len(recorded)} programs in {spent:.1f} s"
                break
    except Exception as error:  # noqa: BLE001 - a solver may raise anything; its row says what
        outcome, message = outcome_of(error)
    finally:
        gc.enable()
    if outcome in {OK, OVER_BUDGET} and (fault := watch.fault(len(steps))):
        return ended(UNFAIR, fault)
    if judged and outcome in {OK, OVER_BUDGET} and is_foreign(make):
        few = copied_steps(len(steps))
        asked = {step: [Asked(recorded[step].qp, recorded[step].guess if workspace.starts_warm else None)] for step in few}
        timed = {step: steps[step][NUMBERS.index("update_s")] + steps[step][NUMBERS.index("solve_s")] for step in few}
        if fault := memory_fault(make, asked, timed, lambda: alive(len(steps))):
            return ended(UNFAIR, fault)
    table = np.array(steps).reshape(-1, len(NUMBERS))
    rows = np.array(distances).reshape(-1, len(DISTANCES)) if judged else np.empty((0, len(DISTANCES)))
    return Measurement(table, tuple(statuses), outcome, message, nonzeros_of(recorded[0].qp.shape), None, rows, first_step=1)


def nonzeros_of(shape: StageShape) -> int:
    """Return the non-zeros of a program's Hessian (upper triangle), dynamics and rows."""
    form = SparseQp.of(shape, elastic=False)
    return int(form.P.nnz + form.E.nnz + form.G.nnz)


def _solved(workspace: QpWorkspace, one: Program, *, hurried: bool) -> tuple[list[float], str, str, tuple[float, float, float]]:
    """Solve one program warm and, unless ``hurried``, cold; return numbers, status, reason, and the distance from the optimum."""
    gave = given_away()
    result, wall, cpu = _timed(workspace, one.qp, one.guess if workspace.starts_warm else None)
    waits = given_away() - gave
    judged, x, u = residuals(one.qp, result.point), result.point.x, result.point.u
    distance = float(np.max(np.abs(x[:, 0] - one.optimum.x[:, 0]))), float(np.max(np.abs(u - one.optimum.u))), one.scale
    numbers = {
        "linearise_s": 0.0, "update_s": wall - result.solve_time, "solve_s": result.solve_time, "check_s": 0.0, "total_s": wall,
        "qp_count": 1.0, "iterations": float(result.iterations), "usable": float(judged.primal <= USABLE_RESIDUAL), **judged._asdict(),
        "violation_m": np.nan, "aside_s": result.time_aside, "cpu_s": cpu, "binding": float(one.binding), "s_m": one.s_m,
        "outer_s": wall, "waits": waits,
    }  # fmt: skip
    words = str(result.status), result.reason  # the next solve writes over the point
    nothing = StageSolution.empty(one.qp.shape) if workspace.starts_warm else None  # else it would go on from its last solution
    numbers["cold_s"] = np.nan if hurried else _timed(workspace, one.qp, nothing)[1]
    return [numbers[name] for name in NUMBERS], *words, distance


def _timed(workspace: QpWorkspace, qp: StageQp, guess: StageSolution | None) -> tuple[QpResult, float, float]:
    """Return a result, its time by the clock and its processor time [s], both without what is aside."""
    began = Moment.now()
    result = workspace.solve(qp, guess)
    took = began.passed()
    return result, took.clock - result.time_aside, took.cpu - result.cpu_aside


def driven_by(make: WorkspaceMaker, case: Case, on_plan: Callable[[Plan], None]) -> Drive:
    """Return the drive of a case by the solver of ``make``; see ``drive``."""
    return drive(case.road, case.vehicle, objective_named(case.objective), make, case.settings, bias=case.bias, on_plan=on_plan)
