"""What planning asks of a QP solver: one persistent workspace, one status vocabulary, a point that others can judge."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from typing import NamedTuple, Protocol

from hdvplan.qp.program import StageQp, StageShape, StageSolution


class Status(StrEnum):
    """A solver's own word on its result, in one vocabulary. It is a claim: residuals decide."""

    SOLVED = "solved"
    INACCURATE = "inaccurate"
    INFEASIBLE = "infeasible"
    ITERATION_LIMIT = "iteration limit"
    NUMERICAL = "numerical trouble"
    FAILED = "failed"


class QpResult(NamedTuple):
    """The outcome of one solve. ``point`` is the workspace's own memory: valid until its next solve."""

    status: Status
    point: StageSolution
    iterations: int
    update_time: float  # handing the values over [s]
    solve_time: float  # the solver's call and reading the result [s]
    loading_time: float = 0.0  # compiling or loading code, once in a process: no part of a planning step [s]
    leaves_guess: bool = True  # False: no inequality has a multiplier, and the next solve profits from nothing in the point
    reason: str = ""  # of a failure, in the solver's own words
    instead: str = ""  # why another solver than the one that was asked for has answered


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
