"""A second solver for what the first one fails at: if a solver raises, hangs or returns a wrong point, the drive continues.

A solver fails where it raises, where it does not answer within a time limit, and where its point, judged by residuals that are recomputed
here, breaks the program or is far from its optimum. The same program is then solved by the second solver, and the result says so. Where
that fails too, the result is ``failed``: planning then drives the last plan on, as far as it reaches.

Benchmarks use solvers alone: there a failure is a row.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from queue import Empty, SimpleQueue
from time import perf_counter

import numpy as np

from hdvplan.errors import HdvplanError
from hdvplan.plugins import said
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.residuals import residuals
from hdvplan.qp.workspace import QpResult, QpWorkspace, Status, WorkspaceMaker
from hdvplan.solvers.registry import DEFAULT, SolverClass, home_of, solver_named

LIMIT_S = 10.0  # for one program: a thousand times what the slowest known solver needs
BROKEN = 1e-3  # primal residual from which a point is refused, as in planning [m]
WRONG = 1e-2  # residual of the Lagrangian beside the largest multiplier: honest solvers stay below 6e-4, other optima are at 1 and above

_Attempt = tuple[QpResult | None, str]  # a result, and why it is refused: nothing where it is not


def dependable(solver: str | SolverClass) -> WorkspaceMaker:
    """Return the maker of a solver's workspaces that has another solver solve what it fails at; with a time limit where it is not ours.

    Raises:
        SolverError: unknown, not installed, or cannot be loaded.

    """
    maker = solver_named(solver)
    ours = isinstance(maker.solver, str) and home_of(maker.solver) is not None
    alike = isinstance(maker.solver, str) and maker.solver.startswith(DEFAULT)
    return backed(maker, solver_named("piqp" if alike else DEFAULT), limit_s=None if ours else LIMIT_S)


def backed(make: WorkspaceMaker, second: WorkspaceMaker, *, limit_s: float | None = None) -> WorkspaceMaker:
    """Return the maker of workspaces that have ``second`` solve what the first one fails at.

    ``limit_s`` bounds one solve [s]. It takes a thread, and is meant for solvers that are not known to end. One that has not answered is
    never asked again: its thread cannot be stopped.
    """
    return lambda shape: _Backed(make(shape), second, shape, limit_s)


class _Backed:
    """A workspace with another one behind it, which is made when it is first needed."""

    def __init__(self, first: QpWorkspace, second: WorkspaceMaker, shape: StageShape, limit_s: float | None) -> None:
        self._first, self._make, self._shape, self._limit = first, second, shape, limit_s
        self._second: QpWorkspace | None = None
        self._hangs = ""
        self.name, self.starts_warm = first.name, first.starts_warm

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve ``qp``; see ``QpWorkspace``. Only the time of the solver that answers counts as solving."""
        began = perf_counter()
        result, why = self._asked(qp, guess)
        if result is not None and not why:
            return result
        second = self._second = self._make(self._shape) if self._second is None else self._second
        lost = perf_counter() - began
        rescued, again = _attempt(lambda: second.solve(qp, None), qp)
        if rescued is None or again:
            point = StageSolution.empty(self._shape)
            point.x[:] = np.nan
            return QpResult(Status.FAILED, point, 0, lost, 0.0, reason=f"{why}; {second.name}: {again}")
        return rescued._replace(loading_time=rescued.loading_time + lost, instead=f"{why}; solved by {second.name}")

    def _asked(self, qp: StageQp, guess: StageSolution | None) -> _Attempt:
        """Return the first solver's result, and why it is refused."""
        if self._hangs:
            return None, self._hangs
        if self._limit is None:
            return _attempt(lambda: self._first.solve(qp, guess), qp)
        own = StageQp(qp.shape, qp.buffer.copy())  # one that is late must not see the next program's values
        ended = _within(self._limit, lambda: _attempt(lambda: self._first.solve(own, guess), own))
        if ended is None:
            self._hangs = f"no answer within {self._limit:g} s"
            return None, self._hangs
        return ended


def _attempt(solve: Callable[[], QpResult], qp: StageQp) -> _Attempt:
    """Return a solver's result, and why it is refused."""
    try:
        result = solve()
        judged = residuals(qp, result.point)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 - compiled solvers panic with what is no Exception, others leave by sys.exit
        return None, str(error) if isinstance(error, HdvplanError) else said(error)
    own = f": {result.reason}" if result.reason else ""
    if not judged.primal <= BROKEN:  # NaN too
        return result, f"it says {result.status}{own}, with a primal residual of {judged.primal:.2g}"
    if judged.dual > WRONG and judged.dual > WRONG * largest_multiplier(result.point):
        return result, f"it says {result.status}{own}, far from the optimum: dual residual {judged.dual:.2g}"
    return result, ""


def largest_multiplier(point: StageSolution) -> float:
    """Return a point's largest multiplier."""
    parts = (point.dynamics, point.rows, point.x_bounds, point.u_bounds)
    return max([float(np.max(np.abs(part))) for part in parts if part.size])


def _within(limit_s: float, call: Callable[[], _Attempt]) -> _Attempt | None:
    """Return what ``call`` returns, from a separate thread; None if it has not returned within ``limit_s``."""
    answers: SimpleQueue[_Attempt] = SimpleQueue()
    threading.Thread(target=lambda: answers.put(call()), daemon=True, name="a solver with a time limit").start()
    try:
        return answers.get(timeout=limit_s)
    except Empty:
        return None
