"""PIQP: a proximal interior-point method, native workspace.

Guards against what PIQP 0.6 does silently: a failed update leaves its data half-scaled (we validate before, and the
pattern cannot change), and its results are live views (we copy). It has no warm start. A preconditioner of
another program, which it can keep, ends some programs whose limits cannot be kept in the iteration limit.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np
import piqp

from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, Status
from hdvplan.solvers.sparse import SparseQp

_STATUS = {
    piqp.PIQP_SOLVED: Status.SOLVED,
    piqp.PIQP_MAX_ITER_REACHED: Status.ITERATION_LIMIT,
    piqp.PIQP_PRIMAL_INFEASIBLE: Status.INFEASIBLE,
    piqp.PIQP_DUAL_INFEASIBLE: Status.INFEASIBLE,
    piqp.PIQP_NUMERICS: Status.NUMERICAL,
}
TOLERANCE = 1e-8  # absolute, of residuals and of the duality gap
_ITERATIONS = 400  # nearly three times what the hardest feasible program took, with 200 rows broken by up to 0.28 m


class PiqpWorkspace:
    """PIQP with its fully condensed sparse factorisation, the fastest of its back ends on these programs."""

    name = "piqp"
    starts_warm = False
    settings = "sparse_ldlt_cond, no relative tolerances"

    def __init__(self, shape: StageShape, *, elastic: bool, tolerance: float = TOLERANCE) -> None:
        """Lay out the pattern; the first solve sets the solver up."""
        self._sparse = SparseQp.of(shape, elastic=elastic)
        self._point = StageSolution.empty(shape)
        self._tolerance = tolerance
        self._solver: piqp.SparseSolver | None = None

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:  # noqa: ARG002 - PIQP cannot start warm
        """Solve ``qp``; see ``QpWorkspace``."""
        started = perf_counter()
        qp.check()
        form = self._sparse
        form.load(qp)
        if self._solver is None:
            self._solver = piqp.SparseSolver()
            self._solver.settings.eps_abs = self._solver.settings.eps_duality_gap_abs = self._tolerance
            self._solver.settings.eps_rel = 0.0
            self._solver.settings.eps_duality_gap_rel = 0.0  # relative to an elastic program's cost it means nothing
            self._solver.settings.max_iter = _ITERATIONS
            self._solver.settings.kkt_solver = piqp.KKTSolver.sparse_ldlt_cond
            self._solver.setup(form.P, form.q, A=form.E, b=form.b, G=form.G, h_u=form.h, x_l=form.low, x_u=form.high)
        else:
            self._solver.update(P=form.P, c=form.q, A=form.E, b=form.b, G=form.G, h_u=form.h, x_l=form.low, x_u=form.high)
        updated = perf_counter()
        status = _STATUS.get(self._solver.solve(), Status.FAILED)
        result = self._solver.result
        iterations = int(result.info.iter)
        form.point(np.array(result.x), np.array(result.y), np.array(result.z_u), np.array(result.z_bu) - np.array(result.z_bl), self._point)
        if status is not Status.SOLVED:
            self._solver = None  # whatever state it is in, the next solve starts clean
        return QpResult(status, self._point, iterations, updated - started, perf_counter() - updated)
