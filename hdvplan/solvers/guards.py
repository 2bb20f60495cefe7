"""Workspaces around workspaces: hard rows before elastic ones, solvers from outside hdvplan, and a time limit for each program.

What is judged belongs to us: another's solver gets copies of the program and of the guess, which are compared with ours after every
solve, which is no part of a planning step. Its answer is read and copied once, which is. Nor does it say how long it took, or for what:
all of its call is solving.

A column for every elastic row doubles a program, and its large price slows general solvers tenfold (OSQP: a hundredfold).
The program with hard rows has the same solution wherever its rows can be kept at multipliers no larger than their price, by the
optimality conditions of both; only where that is not so is the elastic one solved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import NoReturn

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import HdvplanError, QpDataError, SolverError
from hdvplan.plugins import error_text
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import LateError, Moment, QpResult, QpWorkspace, Status, WorkspaceMaker, in_time, residuals

LIMIT_S = 10.0  # for one program: a thousand times what the slowest known solver needs
_KEPT = 1e-3  # primal residual up to which a solution of the hard program is believed [m]


def hard_first(make: Callable[[StageShape, bool], QpWorkspace]) -> WorkspaceMaker:
    """Return the maker of workspaces that try hard rows first; ``make`` takes a shape and whether rows are elastic."""
    return lambda shape: _HardFirst(shape, make)


class _HardFirst:
    """Two workspaces of one solver; the elastic one is made when it is first needed."""

    def __init__(self, shape: StageShape, make: Callable[[StageShape, bool], QpWorkspace]) -> None:
        self._shape, self._make = shape, make
        self._hard = make(shape, False)
        self._elastic: QpWorkspace | None = None
        self.name, self.starts_warm = self._hard.name, self._hard.starts_warm

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve ``qp``; see ``QpWorkspace``. Times and iterations of both attempts count."""
        if self._shape.rows and not np.all(qp.linear > 0.0):  # a row that costs nothing at first is meant to be broken
            return self._with_columns().solve(qp, guess)
        first = self._hard.solve(qp, guess)
        believed = first.status in {Status.SOLVED, Status.INACCURATE} and residuals(qp, first.point).primal <= _KEPT
        if not self._shape.rows or (believed and np.all(first.point.rows <= qp.linear)):
            return first
        second = self._with_columns().solve(qp, None)
        return second._replace(
            iterations=first.iterations + second.iterations,
            update_time=first.update_time + second.update_time,
            solve_time=first.solve_time + second.solve_time,
        ).beside(Moment(first.time_aside, first.cpu_aside))

    def _with_columns(self) -> QpWorkspace:
        if self._elastic is None:
            self._elastic = self._make(self._shape, True)
        return self._elastic


class ForeignWorkspace:
    """Another's workspace under the name by which users ask for it."""

    def __init__(self, name: str, make: Callable[[], QpWorkspace], shape: StageShape) -> None:
        """Make it, and see that it has what ``QpWorkspace`` asks for.

        Raises:
            SolverError: it cannot be made, or lacks something.

        """
        self.name = name
        self._lent, self._known, self._point = StageQp.empty(shape), StageSolution.empty(shape), StageSolution.empty(shape)
        try:
            self._own = make()
            self.starts_warm = bool(self._own.starts_warm)
            if not callable(self._own.solve):
                _refuse(f"solver {name!r}: solve is no method")
        except HdvplanError:
            raise
        except AttributeError as error:
            _refuse(f"solver {name!r} is no QpWorkspace: {error_text(error)}", error)
        except Exception as error:  # noqa: BLE001 - an author's constructor may raise anything
            _refuse(f"solver {name!r} cannot be made: {error_text(error)}", error)

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve ``qp``; see ``QpWorkspace``.

        Raises:
            SolverError: the solver raises, writes into what it is given, or returns no result; ``status`` is ``raised``.

        """
        began = Moment.now()
        self._lent.buffer[:] = qp.buffer
        known = None
        if guess is not None:
            known = self._known
            known.copy_from(guess)
        lent, asked = began.passed(), perf_counter()
        try:
            result = self._taken(self._own.solve(self._lent, known), qp.shape)
        except (HdvplanError, KeyboardInterrupt):
            raise
        except BaseException as error:  # compiled solvers panic with what is no Exception, others leave by sys.exit
            msg = f"solver {self.name!r} raises {error_text(error)}"
            raise SolverError(msg, status="raised") from error
        took, answered = perf_counter() - asked, Moment.now()
        if not (_same(self._lent.buffer, qp.buffer) and (guess is None or all(map(_same, self._known.numbers, guess.numbers)))):
            msg = f"solver {self.name!r} writes into the {'program' if guess is None else 'program or the guess'} that it is given"
            raise SolverError(msg, status="raised", hint="a solver must work on a copy")
        return result._replace(solve_time=took).beside(lent).beside(answered.passed())

    def _taken(self, result: object, shape: StageShape) -> QpResult:
        """Return an answer as plain values and our own arrays; one that is computed when it is read costs its solver the time."""
        if not isinstance(result, QpResult):
            msg = f"solver {self.name!r} returns something of type {type(result).__name__}, not a QpResult"
            raise SolverError(msg, status="raised")
        try:
            point = StageSolution(np.asarray(result.point.stages), np.asarray(result.point.row_points))
            point.check(shape)
        except (AttributeError, QpDataError) as error:
            msg = f"solver {self.name!r} returns a point of another shape"
            raise SolverError(msg, status="raised") from error
        self._point.copy_from(point)
        try:
            status, iterations = Status(result.status), int(result.iterations)
        except (TypeError, ValueError, OverflowError) as error:
            msg = f"solver {self.name!r} returns a status or iterations that are none: {error_text(error)}"
            raise SolverError(msg, status="raised") from error
        return QpResult(status, self._point, iterations, 0.0, 0.0, leaves_guess=bool(result.leaves_guess), reason=str(result.reason))


@dataclass
class Watch:
    """How many programs of a test are solved, which ``on_solved`` receives, and whether one was late: that ends all of it."""

    on_solved: Callable[[int], None]
    solved: int = 0
    late: str = ""

    def over(self, make: WorkspaceMaker) -> WorkspaceMaker:
        """Return what makes workspaces that it watches."""
        return lambda shape: Watched(make(shape), self)


class Watched:
    """A workspace with a time limit for each program; a thread that is late cannot be stopped."""

    def __init__(self, own: QpWorkspace, watch: Watch) -> None:
        self._own, self._watch = own, watch
        self.name, self.starts_warm = own.name, own.starts_warm

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve ``qp``; see ``QpWorkspace``.

        Raises:
            LateError: it takes longer than ``LIMIT_S``, or another has.

        """
        watch = self._watch
        if watch.late:
            raise LateError(watch.late)
        try:
            result = in_time(LIMIT_S, lambda: self._own.solve(qp, guess))
        except LateError as error:
            watch.late = f"{error} after {watch.solved} programs"
            raise LateError(watch.late) from None
        watch.solved += 1
        watch.on_solved(watch.solved)
        return result


def _same(one: FloatArray, other: FloatArray) -> bool:
    """Tell whether two arrays have the same bits: NaN is NaN here."""
    return np.array_equal(one.view(np.uint64), other.view(np.uint64))


def _refuse(message: str, error: Exception | None = None) -> NoReturn:
    raise SolverError(message, hint="docs/extending.md says what a solver's class must have") from error
