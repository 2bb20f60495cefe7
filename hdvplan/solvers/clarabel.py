"""Clarabel: a homogeneous interior-point method, native workspace, updated in place. It has no warm start.

Guards against what Clarabel 0.11 does: updates are refused while presolve is active (switched off, and asked for once),
and absent bounds must be absent rows (infinite right-hand sides break it).
"""

from __future__ import annotations

import clarabel
import numpy as np
import scipy.sparse as sp

from hdvplan.arrays import FloatArray
from hdvplan.errors import SolverError
from hdvplan.qp.program import StageShape, StageSolution
from hdvplan.qp.workspace import Status
from hdvplan.solvers.sparse import Answer, SparseWorkspace, stack

_STATUS = {
    "Solved": Status.SOLVED,
    "AlmostSolved": Status.INACCURATE,
    "PrimalInfeasible": Status.INFEASIBLE,
    "AlmostPrimalInfeasible": Status.INFEASIBLE,
    "DualInfeasible": Status.INFEASIBLE,
    "AlmostDualInfeasible": Status.INFEASIBLE,
    "MaxIterations": Status.ITERATION_LIMIT,
    "MaxTime": Status.ITERATION_LIMIT,
    "NumericalError": Status.NUMERICAL,
    "InsufficientProgress": Status.NUMERICAL,
}
TOLERANCE = 1e-8  # of feasibility and of the duality gap
_RELATIVE = 1e-4  # of the tolerance, for the gap relative to an elastic program's cost, which is of the order of 1e4


class ClarabelWorkspace(SparseWorkspace):
    """Clarabel over [dynamics; rows; upper bounds; lower bounds]."""

    name = "clarabel"
    settings = f"no presolve, gap relative to cost {_RELATIVE:g} of it"

    def __init__(self, shape: StageShape, *, elastic: bool, tolerance: float = TOLERANCE) -> None:
        super().__init__(shape, tolerance, elastic=elastic)
        self._above, self._below = np.flatnonzero(np.isfinite(self._form.high)), np.flatnonzero(np.isfinite(self._form.low))
        eye = sp.eye_array(len(self._form.q), format="csr")
        self._matrix, self._places = stack(self._form.E, self._form.G, eye[self._above], -eye[self._below])
        self._bound_values = np.concatenate([np.ones(len(self._above)), -np.ones(len(self._below))])

    def _update(self, guess: StageSolution | None) -> None:  # noqa: ARG002 - Clarabel cannot start warm
        form = self._form
        values = np.concatenate([form.E.data, form.G.data, self._bound_values])[self._places]
        right = np.concatenate([form.b, form.h, form.high[self._above], -form.low[self._below]])
        if self._solver is None:
            self._matrix.data[:] = values
            self._solver = self._set_up(right)
        else:
            self._solver.update(P=form.P.data, q=form.q, A=values, b=right)

    def _run(self) -> Answer:
        form, result = self._form, self._solver.solve()
        cuts = np.cumsum([len(form.b), len(form.h), len(self._above)])
        equality, rows, above, below = np.split(np.array(result.z), cuts)
        bounds = np.zeros(len(form.q))
        bounds[self._above] += above
        bounds[self._below] -= below
        status = _STATUS.get(str(result.status), Status.FAILED)
        return Answer(status, int(result.iterations), np.array(result.x), equality, rows, bounds)

    def _set_up(self, right: FloatArray) -> clarabel.DefaultSolver:
        form, settings = self._form, clarabel.DefaultSettings()
        settings.verbose = False
        settings.presolve_enable = False
        settings.max_threads = 1
        settings.tol_gap_abs = settings.tol_feas = self._tolerance
        settings.tol_gap_rel = _RELATIVE * self._tolerance
        cones = [clarabel.ZeroConeT(len(form.b)), clarabel.NonnegativeConeT(len(right) - len(form.b))]
        solver = clarabel.DefaultSolver(form.P, form.q, self._matrix, right, cones, settings)
        if not solver.is_data_update_allowed():
            msg = "Clarabel does not allow this program to be updated in place"
            raise SolverError(msg, status="setup")
        return solver
