"""How far a primal-dual point is from optimal, recomputed from the program: the judge of every solver alike."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hdvplan.jit import FloatArray, IntArray, Records, compiled
from hdvplan.qp.program import StageQp, StageSolution


class Residuals(NamedTuple):
    """How far a point is from optimal, recomputed from the program and never taken from a solver."""

    primal: float  # largest violation of dynamics, rows and bounds [m, rad, 1/m]
    dual: float  # largest entry of the Lagrangian's gradient
    gap: float  # |complementarity| summed over all inequalities


def residuals(qp: StageQp, point: StageSolution) -> Residuals:
    """Return the residuals of ``point``; NaN where anything in it is not finite. They judge every solver alike."""
    return Residuals(*_residuals(qp.stages, qp.rows, qp.x_first, qp.bounded, point.stages, point.row_points))


@compiled
def _residuals(
    stages: Records, rows: Records, x_first: FloatArray, bounded: IntArray, points: Records, row_points: Records
) -> tuple[float, float, float]:
    last, n, m = stages.size - 1, stages[0].c.size, stages[0].r.size
    primal, dual, gap, total = 0.0, 0.0, 0.0, 0.0  # max() would drop a NaN, ``total`` keeps it
    for j in range(n):
        primal = max(primal, abs(points[0].x[j] - x_first[j]))
    for i in range(last + 1):
        stage, point = stages[i], points[i]
        x = point.x
        for j in range(n):
            slope = stage.q[j] + point.dynamics[j]
            for k in range(n):
                slope += stage.Q[j, k] * x[k]
            if i < last:
                dynamics = points[i + 1].dynamics
                for k in range(n):
                    slope -= stage.A[k, j] * dynamics[k]
            if i > 0:
                for b in range(bounded.size):
                    if bounded[b] == j:
                        slope += point.x_bounds[b]
                if stage.live > 0.0:
                    for row in range(rows.shape[1]):
                        slope += rows[i, row].g[j] * row_points[i, row].multiplier
            dual = max(dual, abs(slope))
            total += slope
        if i > 0:
            for row in range(rows.shape[1]):
                own, of_row = rows[i, row], row_points[i, row]
                sigma, multiplier = of_row.sigma, of_row.multiplier
                value = -own.h - sigma
                if stage.live > 0.0:
                    for k in range(n):
                        value += own.g[k] * x[k]
                primal = max(primal, value, -sigma)
                of_sigma = own.linear + own.quadratic * sigma - multiplier  # multiplier of sigma >= 0
                dual = max(dual, -multiplier, -of_sigma)
                gap += abs(max(multiplier, 0.0) * value) + abs(max(of_sigma, 0.0) * sigma)
                total += value + of_sigma
            for b in range(bounded.size):
                over, under = x[bounded[b]] - stage.x_high[b], stage.x_low[b] - x[bounded[b]]
                primal = max(primal, over, under)
                gap += abs(max(point.x_bounds[b], 0.0) * over) + abs(max(-point.x_bounds[b], 0.0) * under)
        if i < last:
            dynamics, u = points[i + 1].dynamics, point.u
            for j in range(n):
                ahead = stage.c[j] - points[i + 1].x[j]
                for k in range(n):
                    ahead += stage.A[j, k] * x[k]
                for k in range(m):
                    ahead += stage.B[j, k] * u[k]
                primal = max(primal, abs(ahead))
                total += ahead
            for j in range(m):
                slope = stage.r[j] + point.u_bounds[j]
                for k in range(m):
                    slope += stage.R[j, k] * u[k]
                for k in range(n):
                    slope -= stage.B[k, j] * dynamics[k]
                dual = max(dual, abs(slope))
                total += slope
                over, under = u[j] - stage.u_high[j], stage.u_low[j] - u[j]
                primal = max(primal, over, under)
                gap += abs(max(point.u_bounds[j], 0.0) * over) + abs(max(-point.u_bounds[j], 0.0) * under)
    return (primal, dual, gap) if abs(total) < np.inf else (np.nan, np.nan, np.nan)
