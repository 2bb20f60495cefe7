"""Our own solver: Riccati recursion with screening, a warm active set, then an interior-point method around it. It is in the core.

A planning QP is a linear-quadratic control problem with few states. Without inequalities one backward and one forward
pass solve it; if that point breaks no inequality it *is* the optimum and nothing more is needed. Otherwise Mehrotra's
predictor-corrector method runs, with one Riccati factorisation an iteration (``core/interior.c``). A guess from the last plan is tried
before (``core/active_set.c``): where it holds, the interior point is not needed.

Screening goes further than the first pass. Only inequalities near the screened point enter the iteration; all others are
looked at after every step and join as soon as they come near. And the horizon behind the last of them is left out: the first
pass's cost-to-go replaces it exactly.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np

from hdvplan import core
from hdvplan.errors import QpDataError
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import ENDINGS, QpResult

TOLERANCE = 1e-8  # of products or slacks, and of broken inequalities [m]

_solver_in = core.function("hdv_solver_in", core.POINTER, core.POINTER, core.REAL, core.INT, core.INT, returns=core.INT)
_solve = core.function("hdv_solve", core.POINTER, core.POINTER, core.POINTER, core.POINTER, core.POINTER)
_adjoint = core.function("hdv_adjoint", core.POINTER, core.POINTER, returns=core.REAL)


class RiccatiWorkspace:
    """Our own structure-exploiting solver; the program is used where it stands, nothing is copied or converted."""

    name = "riccati"
    starts_warm = True
    settings = "screening, warm active set, interior point"
    screens = True  # leaves inequalities out that are far away, and all of them where none is broken

    def __init__(self, shape: StageShape, *, tolerance: float = TOLERANCE) -> None:
        sizes, self._shape = shape.sizes, shape
        self._point, self._solved = StageSolution.empty(shape), np.zeros(3, np.int64)
        own = (core.address(sizes), tolerance, self.screens, self.starts_warm)
        self._memory = np.zeros(_solver_in(None, *own), np.uint8)
        self.address = core.address(self._memory)  #: of the core's solver
        #: the same, where the core may call it without this class: not where a class below solves otherwise
        self.core_solver = self.address if type(self).solve is RiccatiWorkspace.solve else 0
        self._to = self.address, self._point.address_for(shape), core.address(self._solved)
        _solver_in(self.address, *own)

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve ``qp``; see ``QpWorkspace``. Of ``guess`` only multipliers and elastic variables matter."""
        started = perf_counter()
        if qp.shape is not self._shape and not np.array_equal(qp.shape.sizes, self._shape.sizes):
            msg = f"a workspace was given a program of another shape: {qp.shape} instead of {self._shape}"
            raise QpDataError(msg)
        qp.check()
        checked = perf_counter()
        solver, point, solved = self._to
        _solve(solver, qp.address, None if guess is None else guess.address_for(qp.shape), point, solved)
        ending, factorisations, binding = self._solved.tolist()
        return QpResult(
            ENDINGS[ending], self._point, factorisations, checked - started, perf_counter() - checked, leaves_guess=bool(binding)
        )


class InteriorWorkspace(RiccatiWorkspace):
    """The interior point alone: every inequality takes part from the start, and no guess is used.

    What other interior-point solvers do, and so what ours is compared with where the method is meant and not the screening.
    """

    name = "riccati-ipm"
    starts_warm = False
    settings = "interior point over all inequalities: no screening, no active set"
    screens = False


class WarmWorkspace(RiccatiWorkspace):
    """The last active set, else the interior point over all inequalities: what a warm start is worth without the screening."""

    name = "riccati-warm"
    settings = "warm active set, interior point over all inequalities: no screening"
    screens = False


def adjoint(qp: StageQp, point: StageSolution) -> float:
    """Write the multipliers of the dynamics that make the Lagrangian stationary in every state.

    Returns the largest entry of its gradient by the inputs, relative to the largest multiplier, or to 1.
    """
    return float(_adjoint(qp.address, point.address_for(qp.shape)))
