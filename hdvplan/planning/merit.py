"""What a motion is worth: the measure by which a QP's step is taken whole or shortened.

The l1 merit function of sequential quadratic programming (Han 1977; Nocedal, Wright 2006, sec. 18.4): the objective, what broken
limits cost, and every gap between a predicted state and the dynamics at a price no smaller than its multiplier. A step that
does not lower it is halved: where limits cannot be kept, full steps swing from side to side.
"""

from __future__ import annotations

from hdvplan.jit import FloatArray, compiled

_BINDING = 1e-6  # multiplier from which on a row counts as binding; solvers leave less on the others


@compiled
def defect_prices(dynamics: FloatArray, rows: FloatArray, prices: FloatArray) -> bool:
    """Write the largest multiplier of each state's dynamics into ``prices`` (n,); return whether any row has a multiplier.

    ``dynamics`` (N+1, >= n) and ``rows`` (N, rows) are multipliers of a QP's solution.
    """
    for j in range(prices.size):
        prices[j] = 0.0
        for i in range(1, dynamics.shape[0]):
            prices[j] = max(prices[j], abs(dynamics[i, j]))
    for i in range(rows.shape[0]):
        for row in range(rows.shape[1]):
            if rows[i, row] > _BINDING:
                return True
    return False


@compiled
def residual_squared(Q: FloatArray, q: FloatArray, n: int) -> float:
    """Return r^2 of a stage whose objective is linearised as q = 2 r g, Q = 2 g g' in its first ``n`` states."""
    squares, trace = 0.0, 0.0
    for j in range(n):
        squares += q[j] * q[j]
        trace += Q[j, j]
    return 0.5 * squares / trace if trace > 0.0 else 0.0


@compiled
def merit(
    Q: FloatArray, q: FloatArray, c: FloatArray, h: FloatArray, linear: FloatArray, quadratic: FloatArray, limit_rows: int,
    kappa: FloatArray, kappa_before: float, smoothness: float, prices: FloatArray, measured: float, stages: int,
) -> float:  # fmt: skip
    """Return the merit of the motion at which a QP's values were linearised.

    ``prices`` (n,) are those of the states that say where the bodies are, which come first; no other's dynamics are ever broken.
    The objective of the first ``stages`` stages is ``measured``, with what else there is at any stage; that of another stage is the
    square of one residual, see ``residual_squared``. Rows from number ``limit_rows`` on are those of the largest reach t, whose cost
    is N t^2.
    """
    n, total, before, reach = prices.size, measured, kappa_before, 0.0
    for i in range(kappa.size):
        total += smoothness * (kappa[i] - before) ** 2
        before = kappa[i]
        for j in range(n):
            total += prices[j] * abs(c[i, j])
        if i >= stages:
            total += residual_squared(Q[i + 1], q[i + 1], n)
        for row in range(h.shape[1]):
            over = max(0.0, -h[i, row])
            if row < limit_rows:
                total += (linear[i, row] + 0.5 * quadratic[i, row] * over) * over
            else:
                reach = max(reach, over)
    return total + kappa.size * reach * reach
