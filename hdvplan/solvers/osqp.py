"""OSQP: operator splitting, native workspace, warm-started.

Guards against what OSQP 1.x does silently: ``update`` drops the C return codes and unknown names, keeps old bounds when
new ones cross (the program is checked before), rebinds the caller's matrix values (it gets a private matrix), and fills an
infeasible iterate with a number (residuals are recomputed by the caller). Step-size adaptation is by iterations, never by
the clock, so that runs repeat.
"""

from __future__ import annotations

import numpy as np
import osqp
import scipy.sparse as sp

from hdvplan.errors import SolverError
from hdvplan.qp.program import StageShape, StageSolution
from hdvplan.qp.workspace import Status
from hdvplan.solvers.sparse import Answer, SparseWorkspace, stack

_STATUS = {
    osqp.SolverStatus.OSQP_SOLVED: Status.SOLVED,
    osqp.SolverStatus.OSQP_SOLVED_INACCURATE: Status.INACCURATE,
    osqp.SolverStatus.OSQP_PRIMAL_INFEASIBLE: Status.INFEASIBLE,
    osqp.SolverStatus.OSQP_PRIMAL_INFEASIBLE_INACCURATE: Status.INFEASIBLE,
    osqp.SolverStatus.OSQP_DUAL_INFEASIBLE: Status.INFEASIBLE,
    osqp.SolverStatus.OSQP_DUAL_INFEASIBLE_INACCURATE: Status.INFEASIBLE,
    osqp.SolverStatus.OSQP_MAX_ITER_REACHED: Status.ITERATION_LIMIT,
    osqp.SolverStatus.OSQP_TIME_LIMIT_REACHED: Status.ITERATION_LIMIT,
    osqp.SolverStatus.OSQP_NON_CVX: Status.NUMERICAL,
}
TOLERANCE = 1e-5  # absolute, on primal and dual residual alike
_INFINITY = 1e30  # OSQP's own
_ADAPTED = 50  # iterations between two changes of rho


class OsqpWorkspace(SparseWorkspace):
    """OSQP over [dynamics; rows; bounds], two-sided."""

    name = "osqp"
    starts_warm = True
    settings = f"eps_rel 0, rho adapted every {_ADAPTED} iterations, warm start"

    def __init__(self, shape: StageShape, *, elastic: bool, tolerance: float = TOLERANCE, iterations: int = 10_000) -> None:
        super().__init__(shape, tolerance, elastic=elastic)
        self._bounded = np.flatnonzero(np.isfinite(self._form.low) | np.isfinite(self._form.high))
        bounds = sp.eye_array(len(self._form.q), format="csr")[self._bounded]
        self._matrix, self._places = stack(self._form.E, self._form.G, bounds)
        self._iterations = iterations

    def _update(self, guess: StageSolution | None) -> None:
        form = self._form
        values = np.concatenate([form.E.data, form.G.data, np.ones(len(self._bounded))])[self._places]
        low = np.concatenate([form.b, np.full(len(form.h), -_INFINITY), np.maximum(form.low[self._bounded], -_INFINITY)])
        high = np.concatenate([form.b, form.h, np.minimum(form.high[self._bounded], _INFINITY)])
        if self._solver is None:
            self._matrix.data[:] = values
            self._solver = osqp.OSQP(algebra="builtin")
            try:
                self._solver.setup(
                    form.P.copy(), form.q.copy(), self._matrix.copy(), low, high, verbose=False, eps_abs=self._tolerance, eps_rel=0.0,
                    max_iter=self._iterations, adaptive_rho=1, adaptive_rho_interval=_ADAPTED, polishing=False, check_termination=25,
                )  # fmt: skip
            except osqp.OSQPException as error:
                msg = f"OSQP refused the program: {error}"
                raise SolverError(msg, status="setup") from error
        else:
            self._solver.update(q=form.q.copy(), l=low, u=high, Px=form.P.data.copy(), Ax=values)
        if guess is not None:
            v, equality, rows, bounds = form.flatten(guess)
            self._solver.warm_start(x=v, y=np.concatenate([equality, rows, bounds[self._bounded]]))

    def _run(self) -> Answer:
        form, result = self._form, self._solver.solve(raise_error=False)
        status = _STATUS.get(osqp.SolverStatus(result.info.status_val), Status.FAILED)
        equality, rows, dual = np.split(np.array(result.y), np.cumsum([len(form.b), len(form.h)]))
        bounds = np.zeros(len(form.q))
        bounds[self._bounded] = dual
        return Answer(status, int(result.info.iter), np.array(result.x), equality, rows, bounds)
