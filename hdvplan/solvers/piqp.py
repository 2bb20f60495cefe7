"""PIQP: a proximal interior-point method, native workspace.

Guards against what PIQP 0.6 does silently: a failed update leaves its data half-scaled (we validate before, and the
pattern cannot change), and its results are live views (we copy). It has no warm start. A preconditioner of
another program, which it can keep, ends some programs whose limits cannot be kept in the iteration limit.
"""

from __future__ import annotations

import numpy as np
import piqp

from hdvplan.qp.program import StageShape, StageSolution
from hdvplan.qp.workspace import Status
from hdvplan.solvers.sparse import Answer, SparseWorkspace

_STATUS = {
    piqp.PIQP_SOLVED: Status.SOLVED,
    piqp.PIQP_MAX_ITER_REACHED: Status.ITERATION_LIMIT,
    piqp.PIQP_PRIMAL_INFEASIBLE: Status.INFEASIBLE,
    piqp.PIQP_DUAL_INFEASIBLE: Status.INFEASIBLE,
    piqp.PIQP_NUMERICS: Status.NUMERICAL,
}
TOLERANCE = 1e-8  # absolute, of residuals and of the duality gap
_ITERATIONS = 400  # nearly three times what the hardest feasible program took, with 200 rows broken by up to 0.28 m


class PiqpWorkspace(SparseWorkspace):
    """PIQP with its fully condensed sparse factorisation, the fastest of its back ends on these programs."""

    name = "piqp"
    settings = "sparse_ldlt_cond, no relative tolerances"

    def __init__(self, shape: StageShape, *, elastic: bool, tolerance: float = TOLERANCE) -> None:
        super().__init__(shape, tolerance, elastic=elastic)

    def _update(self, guess: StageSolution | None) -> None:  # noqa: ARG002 - PIQP cannot start warm
        form, first = self._form, self._solver is None
        if first:
            self._solver = piqp.SparseSolver()
            self._solver.settings.eps_abs = self._solver.settings.eps_duality_gap_abs = self._tolerance
            self._solver.settings.eps_rel = 0.0
            self._solver.settings.eps_duality_gap_rel = 0.0  # relative to an elastic program's cost it means nothing
            self._solver.settings.max_iter = _ITERATIONS
            self._solver.settings.kkt_solver = piqp.KKTSolver.sparse_ldlt_cond
        hand_over = self._solver.setup if first else self._solver.update
        hand_over(P=form.P, c=form.q, A=form.E, b=form.b, G=form.G, h_u=form.h, x_l=form.low, x_u=form.high)

    def _run(self) -> Answer:
        status = _STATUS.get(self._solver.solve(), Status.FAILED)
        result = self._solver.result
        bounds = np.array(result.z_bu) - np.array(result.z_bl)
        return Answer(status, int(result.info.iter), np.array(result.x), np.array(result.y), np.array(result.z_u), bounds)
