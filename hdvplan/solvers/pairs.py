"""Which inequalities of a stage QP take part in the interior-point method, and where each of them starts.

Only those that come near a point are chosen, a record each; all are looked at after every step.
"""

from __future__ import annotations

import numpy as np

from hdvplan.jit import BoolArray, IntArray, Record, Records, inner

NEAR_ROWS = 0.3  # rows closer than this are chosen [m]
NEAR_BOUNDS = 0.3  # bounds closer than this share of their range are
START_SLACK = 0.1  # least slack at the start, for rows [m] and as a share of a bound's range
LEAST_PRICE = 0.1  # least multiplier of an elastic variable at the start

# What an inequality is: a row's G x, or a bound's +-x or +-u.
ROW, X_HIGH, X_LOW, U_HIGH, U_LOW = range(5)
PAIR = np.dtype(
    [
        ("kind", np.int64),
        ("stage", np.int64),
        ("index", np.int64),  # of the row, the bounded state or the input
        *((name, float) for name in ("s", "mu", "sigma", "nu", "limit", "linear", "quadratic")),
        *((name, float) for name in ("residual", "w", "v", "per_s", "per_sigma", "per_both")),  # of the iterate
        *((name, float) for name in ("under", "first", "second", "d_s", "d_mu", "d_sigma", "d_nu")),  # of the Newton step
    ]
)


@inner
def worst(stages: Records, rows: Records, bounded: IntArray, points: Records) -> float:
    """Return how far the point breaks its tightest inequality; negative or zero when it keeps all.

    What an inequality's left-hand side is, is written out in every loop: numba calls a function of arrays in 50 ns.
    """
    deepest, last = -np.inf, stages.size - 1
    for i in range(last + 1):
        stage, x, u = stages[i], points[i].x, points[i].u
        if i > 0:
            if stage.live > 0.0:
                for row in range(rows.shape[1]):
                    one = rows[i, row]
                    over = -one.h
                    for j in range(x.size):
                        over += one.g[j] * x[j]
                    deepest = max(deepest, over)
            for b in range(bounded.size):
                deepest = max(deepest, x[bounded[b]] - stage.x_high[b], stage.x_low[b] - x[bounded[b]])
        if i < last:
            for j in range(u.size):
                deepest = max(deepest, u[j] - stage.u_high[j], stage.u_low[j] - u[j])
    return deepest


@inner
def _join_bound(v: float, low: float, high: float, lower: bool, product: float, pair: Record, everything: bool) -> bool:
    """Write the pair of a bound's upper or lower side; return whether ``v`` has come near it, or need not."""
    width = min(high - low, 1.0)
    gap = v - low if lower else high - v
    if gap > NEAR_BOUNDS * width and not (everything and gap < np.inf):
        return False
    pair.s = max(abs(gap), START_SLACK * width, 1e-6)
    pair.mu, pair.limit = product / pair.s, -low if lower else high
    return True


@inner
def join(
    stages: Records, rows: Records, bounded: IntArray, points: Records, product: float, member: BoolArray, pairs: Records, count: int,
    everything: bool,
) -> tuple[int, int]:  # fmt: skip
    """Choose the inequalities that have come near the point, or ``everything``, in addition to ``count`` chosen ones.

    Each starts with complementarity ``product``. An elastic row starts where it is, its elastic variable taking up what
    it lacks; a broken bound starts with a slack as large as the breach. Both keep the first steps long. Returns the new
    count and the last stage whose state has an inequality that joined, or whose input is followed by such a state; or 0.
    """
    end, p, nb, last = 0, rows.shape[1], bounded.size, stages.size - 1
    for i in range(last + 1):
        stage, x, u = stages[i], points[i].x, points[i].u
        before = count
        if i > 0:
            for row in range(p if stage.live > 0.0 or everything else 0):
                one = rows[i, row]
                gap = one.h
                for j in range(x.size):
                    gap -= one.g[j] * x[j]
                if (gap <= NEAR_ROWS or everything) and not member[i, row]:
                    member[i, row], pair = True, pairs[count]
                    s, penalty = max(gap, START_SLACK), one.linear
                    mu = min(product / s, 0.5 * penalty) if penalty > 0.0 else product / s
                    nu = max(penalty - mu, LEAST_PRICE)
                    pair.s, pair.mu, pair.limit = s, mu, one.h
                    pair.sigma, pair.nu = max(product / nu, s - gap), nu
                    pair.linear, pair.quadratic = penalty, one.quadratic
                    pair.kind, pair.stage, pair.index = ROW, i, row
                    count += 1
            for b in range(nb):
                v, low, high = x[bounded[b]], stage.x_low[b], stage.x_high[b]
                for lower in range(2):
                    at = p + 2 * b + lower
                    if not member[i, at] and _join_bound(v, low, high, lower == 1, product, pairs[count], everything):
                        pairs[count].kind, pairs[count].stage, pairs[count].index = X_LOW if lower else X_HIGH, i, b
                        member[i, at], count = True, count + 1
            if count > before:
                end = i
        before = count
        if i < last:
            for j in range(u.size):
                v, low, high = u[j], stage.u_low[j], stage.u_high[j]
                for lower in range(2):
                    at = p + 2 * (nb + j) + lower
                    if not member[i, at] and _join_bound(v, low, high, lower == 1, product, pairs[count], everything):
                        pairs[count].kind, pairs[count].stage, pairs[count].index = U_LOW if lower else U_HIGH, i, j
                        member[i, at], count = True, count + 1
            if count > before:
                end = i + 1
    return count, end
