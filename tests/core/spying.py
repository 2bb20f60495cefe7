"""A workspace maker that keeps a copy of every program on its way to the solver, and can answer in the solver's place."""

from collections.abc import Callable

from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, QpWorkspace, Status

Answer = Callable[[StageQp], StageSolution | None]


class Spy:
    """Call it to make its workspace. ``answer`` may return a point of its own, or None to let the solver solve."""

    def __init__(self, make: Callable[[StageShape], QpWorkspace], answer: Answer | None = None) -> None:
        """Stand between planning and the workspaces that ``make`` makes."""
        self.programs: list[StageQp] = []
        self.guessed: list[bool] = []  # whether a guess came with each
        self.answer = answer
        self._make = make
        self._workspace: QpWorkspace | None = None

    def __call__(self, shape: StageShape) -> "Spy":
        """Make the workspace."""
        self._workspace = self._make(shape)
        return self

    @property
    def name(self) -> str:
        """Return a name that no solver has."""
        return "spy"

    @property
    def starts_warm(self) -> bool:
        """Return what the made workspace says."""
        return self._workspace is not None and self._workspace.starts_warm

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Keep a copy of ``qp`` and have it solved."""
        self.programs.append(StageQp(qp.shape, qp.buffer.copy()))
        self.guessed.append(guess is not None)
        point = None if self.answer is None else self.answer(qp)
        if point is not None:
            return QpResult(Status.SOLVED, point, 1, 0.0, 0.0)
        assert self._workspace is not None
        return self._workspace.solve(qp, guess)
