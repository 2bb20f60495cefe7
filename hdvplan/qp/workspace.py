"""The protocol of QP solvers: a persistent workspace, common statuses, a point that residuals can check."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from typing import NamedTuple, Protocol

import numpy as np

from hdvplan import core
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


class QpResult(NamedTuple):
    """The outcome of one solve. ``point`` is the workspace's own memory: valid until its next solve."""

    status: Status
    point: StageSolution
    iterations: int
    update_time: float  #: time to hand over the values [s]
    solve_time: float  #: time of the solver's call and of reading the result [s]
    time_aside: float = 0.0  #: time that is no part of a planning step: a reference's solve, another solver's failed attempt [s]
    leaves_guess: bool = True  #: False: no inequality has a multiplier, and the point is no help for the next solve
    reason: str = ""  #: the solver's reason for a failure
    instead: str = ""  #: why another solver than the requested one answered


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
