"""A time limit for each program that a solver is asked, which ends a whole test: a thread that is late cannot be stopped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hdvplan.qp.program import StageQp, StageSolution
from hdvplan.qp.workspace import LateError, QpResult, QpWorkspace, WorkspaceMaker, in_time
from hdvplan.solvers import registry


@dataclass
class Watch:
    """How many programs of a rule are solved, which ``on_solved`` receives, and whether one was late."""

    on_solved: Callable[[int], None]
    solved: int = 0
    late: str = ""

    def over(self, make: WorkspaceMaker) -> WorkspaceMaker:
        """Return what makes workspaces that it watches."""
        return lambda shape: Watched(make(shape), self)


class Watched:
    """A workspace with a time limit for each program."""

    def __init__(self, own: QpWorkspace, watch: Watch) -> None:
        self._own, self._watch = own, watch
        self.name, self.starts_warm = own.name, own.starts_warm

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve ``qp``; see ``QpWorkspace``.

        Raises:
            LateError: it takes longer than ``registry.LIMIT_S``, or another has.

        """
        watch = self._watch
        if watch.late:
            raise LateError(watch.late)
        try:
            result = in_time(registry.LIMIT_S, lambda: self._own.solve(qp, guess))
        except LateError as error:
            watch.late = f"{error} after {watch.solved} programs"
            raise LateError(watch.late) from None
        watch.solved += 1
        watch.on_solved(watch.solved)
        return result
