"""How far a primal-dual point is from optimal, recomputed from the program: the judge of every solver alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.jit import FloatArray, IntArray, compiled
from hdvplan.qp.program import StageQp, StageSolution


@dataclass(frozen=True)
class Residuals:
    """How far a point is from optimal, recomputed from the program and never taken from a solver."""

    primal: float  # largest violation of dynamics, rows and bounds [m, rad, 1/m]
    dual: float  # largest entry of the Lagrangian's gradient
    gap: float  # |complementarity| summed over all inequalities


def residuals(qp: StageQp, point: StageSolution) -> Residuals:
    """Return the residuals of ``point``; NaN where anything in it is not finite. They judge every solver alike."""
    primal, dual, gap = _residuals(
        qp.A, qp.B, qp.c, qp.x_first, qp.Q, qp.q, qp.R, qp.r, qp.G, qp.h, qp.linear, qp.quadratic,
        np.asarray(qp.shape.bounded_states, np.int64), qp.x_low, qp.x_high, qp.u_low, qp.u_high,
        point.x, point.u, point.sigma, point.dynamics, point.rows, point.x_bounds, point.u_bounds,
    )  # fmt: skip
    return Residuals(primal, dual, gap)


@compiled
def _residuals(
    A: FloatArray, B: FloatArray, c: FloatArray, x_first: FloatArray, Q: FloatArray, q: FloatArray, R: FloatArray, r: FloatArray,
    G: FloatArray, h: FloatArray, linear: FloatArray, quadratic: FloatArray, bounded: IntArray, x_low: FloatArray, x_high: FloatArray,
    u_low: FloatArray, u_high: FloatArray, x: FloatArray, u: FloatArray, sigma: FloatArray, dynamics: FloatArray, rows: FloatArray,
    x_bounds: FloatArray, u_bounds: FloatArray,
) -> tuple[float, float, float]:  # fmt: skip
    stages, n, m = B.shape
    primal, dual, gap, finite = 0.0, 0.0, 0.0, True  # max() would drop a NaN
    for j in range(n):
        primal = max(primal, abs(x[0, j] - x_first[j]))
    for i in range(stages + 1):
        for j in range(n):
            slope = q[i, j] + dynamics[i, j]
            for k in range(n):
                slope += Q[i, j, k] * x[i, k]
                if i < stages:
                    slope -= A[i, k, j] * dynamics[i + 1, k]
            if i > 0:
                for row in range(G.shape[1]):
                    slope += G[i - 1, row, j] * rows[i - 1, row]
                for b in range(bounded.size):
                    if bounded[b] == j:
                        slope += x_bounds[i - 1, b]
            dual, finite = max(dual, abs(slope)), finite and abs(slope) < np.inf
    for i in range(stages):
        for j in range(n):
            ahead = c[i, j] - x[i + 1, j]
            for k in range(n):
                ahead += A[i, j, k] * x[i, k]
            for k in range(m):
                ahead += B[i, j, k] * u[i, k]
            primal, finite = max(primal, abs(ahead)), finite and abs(ahead) < np.inf
        for j in range(m):
            slope = r[i, j] + u_bounds[i, j]
            for k in range(m):
                slope += R[i, j, k] * u[i, k]
            for k in range(n):
                slope -= B[i, k, j] * dynamics[i + 1, k]
            dual, finite = max(dual, abs(slope)), finite and abs(slope) < np.inf
            over, under = u[i, j] - u_high[i, j], u_low[i, j] - u[i, j]
            primal = max(primal, over, under)
            gap += abs(max(u_bounds[i, j], 0.0) * over) + abs(max(-u_bounds[i, j], 0.0) * under)
        for row in range(G.shape[1]):
            value = -h[i, row] - sigma[i, row]
            for k in range(n):
                value += G[i, row, k] * x[i + 1, k]
            primal, finite = max(primal, value, -sigma[i, row]), finite and abs(value) < np.inf
            slack_price = linear[i, row] + quadratic[i, row] * sigma[i, row] - rows[i, row]  # multiplier of sigma >= 0
            dual = max(dual, -rows[i, row], -slack_price)
            gap += abs(max(rows[i, row], 0.0) * value) + abs(max(slack_price, 0.0) * sigma[i, row])
        for b in range(bounded.size):
            over, under = x[i + 1, bounded[b]] - x_high[i, b], x_low[i, b] - x[i + 1, bounded[b]]
            primal = max(primal, over, under)
            gap += abs(max(x_bounds[i, b], 0.0) * over) + abs(max(-x_bounds[i, b], 0.0) * under)
    return (primal, dual, gap) if finite else (np.nan, np.nan, np.nan)
