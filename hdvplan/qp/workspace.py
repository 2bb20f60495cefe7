"""The protocol of QP solvers: a persistent workspace, common statuses, and the judge of every result.

A solver fails where it raises, where it does not answer within a time limit, and where its point, judged by residuals that are recomputed
here, breaks the program or is far from its optimum. The same program is then solved by the second solver, and the result says so. Where
that fails too, the result is ``failed``: planning then drives the last plan on, as far as it reaches.

Benchmarks use solvers alone: there a failure is a row.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from enum import StrEnum
from functools import partial
from queue import Empty, SimpleQueue
from time import perf_counter, process_time
from typing import NamedTuple, Protocol

import numpy as np

from hdvplan import core
from hdvplan.errors import HdvplanError, SolverError
from hdvplan.plugins import error_text
from hdvplan.qp.program import StageQp, StageShape, StageSolution


class Status(StrEnum):
    """What a solver claims about its result. Recomputed residuals decide."""

    SOLVED = "solved"
    INACCURATE = "inaccurate"
    INFEASIBLE = "infeasible"
    ITERATION_LIMIT = "iteration limit"
    NUMERICAL = "numerical trouble"
    FAILED = "failed"


_OURS = (Status.SOLVED, Status.ITERATION_LIMIT, Status.NUMERICAL, Status.INACCURATE)
ENDINGS = {core.number(f"HDV_{status.name}"): status for status in _OURS}  # as the core's solver says it


class Moment(NamedTuple):
    """A reading of the clock and of the process's time on all processors [s], or the difference of two."""

    clock: float
    cpu: float

    @classmethod
    def now(cls) -> Moment:
        """Return both."""
        return cls(perf_counter(), process_time())

    def passed(self) -> Moment:
        """Return what has passed since."""
        return Moment(perf_counter() - self.clock, process_time() - self.cpu)


class QpResult(NamedTuple):
    """The outcome of one solve. ``point`` is the workspace's own memory: valid until its next solve."""

    status: Status
    point: StageSolution
    iterations: int
    update_time: float  #: time to hand over the values [s]
    solve_time: float  #: time of the solver's call and of reading the result [s]
    time_aside: float = 0.0  #: time that is no part of a planning step: copying for a foreign solver [s]
    cpu_aside: float = 0.0  #: processor time of the same [s]
    leaves_guess: bool = True  #: False: no inequality has a multiplier, and the point is no help for the next solve
    reason: str = ""  #: the solver's reason for a failure
    instead: str = ""  #: why another solver than the requested one answered

    def beside(self, aside: Moment) -> QpResult:
        """Return the same with more that is no part of a planning step."""
        return self._replace(time_aside=self.time_aside + aside.clock, cpu_aside=self.cpu_aside + aside.cpu)


class QpWorkspace(Protocol):
    """A solver set up for one ``StageShape``: pattern and memory are kept, values are replaced at every solve.

    A workspace belongs to one thread.
    """

    @property
    def name(self) -> str:
        """The name by which users ask for this solver."""

    @property
    def starts_warm(self) -> bool:
        """Whether a guess changes anything."""

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve ``qp``, from ``guess`` where the solver can start warm.

        Raises:
            QpDataError: the program's values are not finite or its bounds cross.

        """


WorkspaceMaker = Callable[[StageShape], QpWorkspace]


_residuals = core.function("hdv_residuals", core.POINTER, core.POINTER, core.POINTER)


class Residuals(NamedTuple):
    """How far a point is from optimal, recomputed from the program and never taken from a solver."""

    primal: float  # largest violation of dynamics, rows and bounds [m, rad, 1/m]
    dual: float  # largest entry of the Lagrangian's gradient
    gap: float  # |complementarity| summed over all inequalities


def residuals(qp: StageQp, point: StageSolution) -> Residuals:
    """Return the residuals of ``point``; NaN where anything in it is not finite. They judge every solver alike.

    Raises:
        QpDataError: the point is of another shape than the program.

    """
    found = np.empty(3)
    _residuals(qp.address, point.address_for(qp.shape), core.address(found))
    return Residuals(*found.tolist())


USABLE_RESIDUAL, WRONG = core.constant("HDV_USABLE_RESIDUAL"), core.constant("HDV_WRONG")

Judging = Callable[[StageSolution], Residuals]


def backed(make: WorkspaceMaker, second: WorkspaceMaker, *, limit_s: float | None = None) -> WorkspaceMaker:
    """Return the maker of workspaces that have ``second`` solve what the first one fails at.

    ``limit_s`` bounds one solve [s]. It takes a thread, and is meant for solvers that are not known to end. One that has not answered is
    never asked again: its thread cannot be stopped.
    """
    return lambda shape: Judge(make(shape), second, limit_s)


class Judge:
    """A workspace whose results are judged, with another one behind it, if any, which is made when it is first needed."""

    def __init__(self, first: QpWorkspace, second: WorkspaceMaker | None = None, limit_s: float | None = None) -> None:
        self._first, self._make, self._limit = first, second, limit_s
        self._second: QpWorkspace | None = None
        self._hangs = ""
        self.name, self.starts_warm = first.name, first.starts_warm
        self.core_solver: int = getattr(first, "core_solver", 0)  #: where the core's solver is, if that is the one

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve ``qp``; see ``QpWorkspace``."""
        return self.judged(qp, guess, partial(residuals, qp))

    def judged(self, qp: StageQp, guess: StageSolution | None, judge: Judging) -> QpResult:
        """Solve ``qp``, and let another solver do it where ``judge`` refuses the point. The time of both counts: the caller waits for both.

        Raises:
            Exception: without a second solver, whatever the first one raises.

        """
        if self._make is None:
            result = self._first.solve(qp, guess)
            judge(result.point)
            return result
        began = Moment.now()
        found, why = self._asked(qp, guess, judge)
        return found if found is not None and not why else self.instead(qp, why, judge, began)

    def instead(self, qp: StageQp, why: str, judge: Judging, began: Moment) -> QpResult:
        """Return the second solver's result for a program that the first one failed at since ``began``, and say ``why``."""
        if self._make is None:
            msg = f"{self.name}: {why}"
            raise SolverError(msg)
        second = self._second = self._make(qp.shape) if self._second is None else self._second
        lost = began.passed()
        rescued, again = _attempt(partial(second.solve, qp, None), judge)
        if rescued is None or again:
            point = StageSolution.empty(qp.shape)
            point.x[:] = np.nan
            judge(point)
            return QpResult(Status.FAILED, point, 0, lost.clock, 0.0, reason=f"{why}; {second.name}: {again}")
        return rescued._replace(update_time=rescued.update_time + lost.clock, instead=f"{why}; solved by {second.name}")

    def _asked(self, qp: StageQp, guess: StageSolution | None, judge: Judging) -> tuple[QpResult | None, str]:
        """Return the first solver's result, and why it is refused: nothing where it is not."""
        if self._hangs:
            return None, self._hangs
        solve = self._first.solve if self._limit is None else partial(self._in_time, self._limit)
        return _attempt(partial(solve, qp, guess), judge)

    def _in_time(self, limit_s: float, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Have a separate thread solve a copy: one that is late must not see the next program's values."""
        try:
            return in_time(limit_s, partial(self._first.solve, qp.copy(), guess))
        except LateError as error:
            self._hangs = str(error)
            raise


class LateError(SolverError):
    """A solver has not answered in time."""


def in_time(limit_s: float, solve: Callable[[], QpResult]) -> QpResult:
    """Return what ``solve`` does in a separate thread, which goes on if it is late.

    Raises:
        LateError: it has not answered in time.
        BaseException: whatever it raises.

    """
    answers: SimpleQueue[QpResult | BaseException] = SimpleQueue()

    def answer() -> None:
        try:
            answers.put(solve())
        except BaseException as error:  # noqa: BLE001 - raised again by who waits
            answers.put(error)

    threading.Thread(target=answer, daemon=True, name="a solver with a time limit").start()
    try:
        found = answers.get(timeout=limit_s)
    except Empty:
        msg = f"no answer within {limit_s:g} s"
        raise LateError(msg) from None
    if isinstance(found, BaseException):
        raise found
    return found


def _attempt(solve: Callable[[], QpResult], judge: Judging) -> tuple[QpResult | None, str]:
    try:
        result = solve()
        judged = judge(result.point)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 - compiled solvers panic with what is no Exception, others leave by sys.exit
        return None, str(error) if isinstance(error, HdvplanError) else error_text(error)
    return result, refusal(result, judged)


def refusal(result: QpResult, judged: Residuals) -> str:
    """Return why a result is refused, nothing where it is not."""
    own = f": {result.reason}" if result.reason else ""
    if not judged.primal <= USABLE_RESIDUAL:  # NaN too
        return f"it says {result.status}{own}, with a primal residual of {judged.primal:.2g}"
    if judged.dual > WRONG and judged.dual > WRONG * largest_multiplier(result.point):
        return f"it says {result.status}{own}, far from the optimum: dual residual {judged.dual:.2g}"
    return ""


def largest_multiplier(point: StageSolution) -> float:
    """Return a point's largest multiplier."""
    parts = (point.dynamics, point.rows, point.x_bounds, point.u_bounds)
    return max([float(np.max(np.abs(part))) for part in parts if part.size])
