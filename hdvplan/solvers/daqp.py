"""DAQP: a dual active-set method for dense programs, native workspace. The states are eliminated, rows are its own soft constraints.

Elimination makes a program in the inputs alone, x_i = M_i u + d_i, which is the form that an active-set method wants. It is computed here,
and counts as handing the values over.
"""

from __future__ import annotations

from time import perf_counter

import daqp
import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, Status
from hdvplan.solvers.riccati import adjoint

TOLERANCE = 1e-9  # of broken inequalities and of multipliers' signs
_STATUS = {
    1: Status.SOLVED,
    2: Status.SOLVED,
    -1: Status.INFEASIBLE,
    -2: Status.NUMERICAL,
    -3: Status.INFEASIBLE,
    -4: Status.ITERATION_LIMIT,
}
_ITERATIONS = 10_000
_SOFT = 8  # sense of a constraint that may be broken at a price
_LEAST = 1e-3  # price of a squared slack where the program has none: DAQP divides by it


class DaqpWorkspace:
    """DAQP over the inputs: their bounds, the states' bounds, then the rows, softened at the program's prices."""

    name = "daqp"
    starts_warm = False
    settings = f"states eliminated in NumPy, soft rows of its own, iter_limit {_ITERATIONS}, cold"

    def __init__(self, shape: StageShape, *, tolerance: float = TOLERANCE) -> None:
        self._shape, self._tolerance = shape, tolerance
        stages, n, m = shape.stages, shape.states, shape.inputs
        self._point = StageSolution.empty(shape)
        self._M, self._d = np.zeros((stages + 1, n, stages * m)), np.zeros((stages + 1, n))
        hard = stages * (m + len(shape.bounded_states))
        self._sense = np.concatenate([np.zeros(hard, np.int32), np.full(stages * shape.rows, _SOFT, np.int32)])

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:  # noqa: ARG002 - the rows' order decides where it starts
        """Solve ``qp``; see ``QpWorkspace``."""
        started = perf_counter()
        qp.check()
        H, f, A, low, high = self._eliminated(qp)
        model = daqp.Model()  # an update keeps the last active set, in another order than the next program's
        model.settings = {"primal_tol": self._tolerance, "dual_tol": self._tolerance, "iter_limit": _ITERATIONS}
        flag, _ = model.setup(H, f, A, high, low, self._sense)
        hard, soft = len(high) - qp.h.size, qp.h.size
        if soft and flag >= 0:
            none = np.zeros(hard)
            price, growth = (
                np.concatenate([none, qp.linear.ravel()]),
                np.concatenate([none, 1.0 / np.maximum(qp.quadratic.ravel(), _LEAST)]),
            )
            model.soft_weights(growth, growth, price, price)
        updated = perf_counter()
        if flag < 0:
            self._point.x[:] = np.nan
            return QpResult(_STATUS.get(flag, Status.FAILED), self._point, 0, updated - started, 0.0)
        u, _, flag, info = model.solve()
        self._publish(qp, u, info["lam"])
        return QpResult(_STATUS.get(flag, Status.FAILED), self._point, int(info["iterations"]), updated - started, perf_counter() - updated)

    def _eliminated(self, qp: StageQp) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        M, d, m, size = self._M, self._d, self._shape.inputs, self._M.shape[2]
        d[0] = qp.x_first
        for i in range(self._shape.stages):
            known = i * m
            np.matmul(qp.A[i], M[i, :, :known], out=M[i + 1, :, :known])
            M[i + 1, :, known : known + m] = qp.B[i]
            d[i + 1] = qp.A[i] @ d[i] + qp.c[i]
        flat = M.reshape(-1, size)
        H = flat.T @ (qp.Q @ M).reshape(-1, size)
        for i in range(self._shape.stages):
            H[i * m : (i + 1) * m, i * m : (i + 1) * m] += qp.R[i]
        f = flat.T @ (np.einsum("ijk,ik->ij", qp.Q, d) + qp.q).ravel() + qp.r.ravel()
        bounded = list(self._shape.bounded_states)
        A = np.concatenate([M[1:, bounded].reshape(-1, size), (qp.G @ M[1:]).reshape(-1, size)])
        at, rows = d[1:, bounded], qp.h - np.einsum("ijk,ik->ij", qp.G, d[1:])
        low = np.concatenate([qp.u_low.ravel(), (qp.x_low - at).ravel(), np.full(rows.size, -np.inf)])
        high = np.concatenate([qp.u_high.ravel(), (qp.x_high - at).ravel(), rows.ravel()])
        return H, f, A, low, high

    def _publish(self, qp: StageQp, u: FloatArray, multipliers: FloatArray) -> None:
        point, stages = self._point, self._shape.stages
        point.u[:] = np.asarray(u).reshape(stages, -1)
        point.x[:] = self._M @ np.asarray(u) + self._d
        inputs, states, rows = np.split(np.asarray(multipliers), np.cumsum([qp.u_low.size, qp.x_low.size]))
        point.u_bounds[:], point.x_bounds[:] = inputs.reshape(stages, -1), states.reshape(point.x_bounds.shape)
        point.rows[:] = rows.reshape(point.rows.shape)
        broken = np.einsum("ijk,ik->ij", qp.G, point.x[1:]) - qp.h
        point.sigma[:] = np.maximum(broken, 0.0)
        adjoint(qp, point)
