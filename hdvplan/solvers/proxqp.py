"""ProxQP: a proximal augmented-Lagrangian method on its sparse backend, warm-started.

Only the pattern is kept: after ``update`` its sparse solver (0.8.0) calls points solved that are a metre off, so that every program is set
up, which counts as handing the values over. Where limits cannot be kept its inner loop may take seconds.
"""

from __future__ import annotations

import numpy as np
import proxsuite
import scipy.sparse as sp

from hdvplan.qp.program import StageShape, StageSolution
from hdvplan.qp.workspace import Status
from hdvplan.solvers.sparse import Answer, SparseWorkspace, stack

_PROXQP = proxsuite.proxqp
_STATUS = {
    _PROXQP.PROXQP_SOLVED: Status.SOLVED,
    _PROXQP.PROXQP_MAX_ITER_REACHED: Status.ITERATION_LIMIT,
    _PROXQP.PROXQP_PRIMAL_INFEASIBLE: Status.INFEASIBLE,
    _PROXQP.PROXQP_DUAL_INFEASIBLE: Status.INFEASIBLE,
}
TOLERANCE = 1e-6  # absolute
_ITERATIONS = 100  # of the outer loop; programs that it solves at all take at most half of them
_INFINITY = 1e20  # ProxQP's own


class ProxqpWorkspace(SparseWorkspace):
    """ProxQP over [rows; bounds], two-sided, on its sparse backend."""

    name = "proxqp"
    starts_warm = True
    settings = f"sparse backend, eps_rel 0, max_iter {_ITERATIONS}, warm start, set up for every program"

    def __init__(self, shape: StageShape, *, elastic: bool, tolerance: float = TOLERANCE) -> None:
        super().__init__(shape, tolerance, elastic=elastic)
        self._bounded = np.flatnonzero(np.isfinite(self._form.low) | np.isfinite(self._form.high))
        bounds = sp.eye_array(len(self._form.q), format="csr")[self._bounded]
        self._matrix, self._places = stack(self._form.G, bounds)

    def _update(self, guess: StageSolution | None) -> None:
        form = self._form
        self._matrix.data[:] = np.concatenate([form.G.data, np.ones(len(self._bounded))])[self._places]
        low = np.concatenate([np.full(len(form.h), -_INFINITY), np.maximum(form.low[self._bounded], -_INFINITY)])
        high = np.concatenate([form.h, np.minimum(form.high[self._bounded], _INFINITY)])
        cost = (form.P + sp.triu(form.P, 1).T).tocsc()
        self._solver = _PROXQP.sparse.QP(len(form.q), len(form.b), len(high))
        settings = self._solver.settings
        settings.eps_abs, settings.eps_rel, settings.max_iter = self._tolerance, 0.0, _ITERATIONS
        settings.initial_guess = _PROXQP.InitialGuess.WARM_START
        self._solver.init(H=cost, g=form.q, A=form.E, b=form.b, C=self._matrix, l=low, u=high)
        if guess is None:
            self._start = np.zeros(len(form.q)), np.zeros(len(form.b)), np.zeros(len(high))
        else:
            v, equality, rows, bounds = form.flatten(guess)
            self._start = v, equality, np.concatenate([rows, bounds[self._bounded]])

    def _run(self) -> Answer:
        self._solver.solve(*self._start)
        found, rows = self._solver.results, len(self._form.h)
        bounds, multipliers = np.zeros(len(self._form.q)), np.array(found.z)
        bounds[self._bounded] = multipliers[rows:]
        status = _STATUS.get(found.info.status, Status.FAILED)
        return Answer(status, int(found.info.iter), np.array(found.x), np.array(found.y), multipliers[:rows], bounds)
