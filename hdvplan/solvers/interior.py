"""The inequalities of a stage QP in a primal-dual interior-point method: slacks, multipliers, and their share of a Newton step.

Only chosen inequalities take part, each a row value <= limit of one interval, with a slack and a multiplier (s, mu) and, for
elastic rows, a second pair (sigma, nu) that is eliminated by hand:

    W = w v / (w + v),   w = mu / s,   v = nu / sigma + quadratic,

which stays exact however large the weights grow. The Newton system that is left is a linear-quadratic control problem.
"""

from __future__ import annotations

import numpy as np

from hdvplan.jit import BoolArray, FloatArray, IntArray, compiled
from hdvplan.solvers.recursion import sweep_ahead, sweep_back

NEAR_ROWS = 0.3  # rows closer than this are chosen [m]
NEAR_BOUNDS = 0.3  # bounds closer than this share of their range are
START_SLACK = 0.1  # least slack at the start, for rows [m] and as a share of a bound's range
LEAST_PRICE = 0.1  # least multiplier of an elastic variable at the start

# What an inequality is: a row's G x, or a bound's +-x or +-u.
ROW, X_HIGH, X_LOW, U_HIGH, U_LOW = range(5)
# What is kept of every chosen one: both pairs and the data; then reciprocals and parts of the Newton step.
S, MU, SIGMA, NU, LIMIT, LINEAR, QUADRATIC = range(7)
RESIDUAL, W, V, PER_S, PER_SIGMA, PER_BOTH, UNDER, FIRST, SECOND, D_S, D_MU, D_SIGMA, D_NU = range(7, 20)
FIELDS = 20


@compiled
def worst(
    G: FloatArray, h: FloatArray, bounded: IntArray, x_low: FloatArray, x_high: FloatArray, u_low: FloatArray, u_high: FloatArray,
    x: FloatArray, u: FloatArray,
) -> float:  # fmt: skip
    """Return how far the point breaks its tightest inequality; negative or zero when it keeps all.

    What an inequality's left-hand side is stands in every loop anew: numba calls a function of arrays in 50 ns.
    """
    deepest = -np.inf
    for i in range(u.shape[0]):
        for row in range(G.shape[1]):
            over = -h[i, row]
            for j in range(x.shape[1]):
                over += G[i, row, j] * x[i + 1, j]
            deepest = max(deepest, over)
        for b in range(bounded.size):
            v = x[i + 1, bounded[b]]
            deepest = max(deepest, v - x_high[i, b], x_low[i, b] - v)
        for j in range(u.shape[1]):
            deepest = max(deepest, u[i, j] - u_high[i, j], u_low[i, j] - u[i, j])
    return deepest


@compiled
def join(
    G: FloatArray, h: FloatArray, linear: FloatArray, quadratic: FloatArray, bounded: IntArray, x_low: FloatArray, x_high: FloatArray,
    u_low: FloatArray, u_high: FloatArray, x: FloatArray, u: FloatArray, product: float, member: BoolArray, chosen: IntArray,
    pairs: FloatArray, count: int,
) -> tuple[int, int]:  # fmt: skip
    """Choose the inequalities that have come near the point, in addition to ``count`` chosen ones.

    Each starts with complementarity ``product``. An elastic row starts where it stands, its elastic variable taking up what
    it lacks; a broken bound starts with a slack as large as the breach. Both keep the first steps long. Returns the new
    count and the last interval with an inequality that joined, or -1.
    """
    last, p, nb = -1, G.shape[1], bounded.size
    for i in range(u.shape[0]):
        before = count
        for row in range(p):
            gap = h[i, row]
            for j in range(x.shape[1]):
                gap -= G[i, row, j] * x[i + 1, j]
            if gap <= NEAR_ROWS and not member[i, row]:
                member[i, row] = True
                s, penalty = max(gap, START_SLACK), linear[i, row]
                mu = min(product / s, 0.5 * penalty) if penalty > 0.0 else product / s
                nu = max(penalty - mu, LEAST_PRICE)
                pairs[S, count], pairs[MU, count], pairs[LIMIT, count] = s, mu, h[i, row]
                pairs[SIGMA, count], pairs[NU, count] = max(product / nu, s - gap), nu
                pairs[LINEAR, count], pairs[QUADRATIC, count] = penalty, quadratic[i, row]
                chosen[0, count], chosen[1, count], chosen[2, count] = ROW, i, row
                count += 1
        for bound in range(nb + u.shape[1]):
            if bound < nb:
                v, low, high = x[i + 1, bounded[bound]], x_low[i, bound], x_high[i, bound]
            else:
                v, low, high = u[i, bound - nb], u_low[i, bound - nb], u_high[i, bound - nb]
            width = min(high - low, 1.0)
            for side in range(2):
                gap = high - v if side == 0 else v - low
                if gap <= NEAR_BOUNDS * width and not member[i, p + 2 * bound + side]:
                    member[i, p + 2 * bound + side] = True
                    s = max(abs(gap), START_SLACK * width, 1e-6)
                    pairs[S, count], pairs[MU, count], pairs[LIMIT, count] = s, product / s, high if side == 0 else -low
                    chosen[0, count] = side + (X_HIGH if bound < nb else U_HIGH)
                    chosen[1, count], chosen[2, count] = i, bound if bound < nb else bound - nb
                    count += 1
        if count > before:
            last = i
    return count, last


@compiled
def objective(
    Q: FloatArray, q: FloatArray, R: FloatArray, r: FloatArray, x: FloatArray, u: FloatArray, end: int, hessian_x: FloatArray,
    hessian_u: FloatArray, gradient_x: FloatArray, gradient_u: FloatArray,
) -> None:  # fmt: skip
    """Write the objective's derivatives at the stages before ``end``."""
    n, m = x.shape[1], u.shape[1]
    for i in range(end):  # element by element: numba takes seconds to compile a slice assignment
        for j in range(n):
            total = q[i, j]
            for k in range(n):
                hessian_x[i, j, k] = Q[i, j, k]
                total += Q[i, j, k] * x[i, k]
            gradient_x[i, j] = total
        for j in range(m):
            total = r[i, j]
            for k in range(m):
                hessian_u[i, j, k] = R[i, j, k]
                total += R[i, j, k] * u[i, k]
            gradient_u[i, j] = total


@compiled
def weigh(
    G: FloatArray, bounded: IntArray, x: FloatArray, u: FloatArray, chosen: IntArray, pairs: FloatArray, count: int, hessian_x: FloatArray,
    hessian_u: FloatArray,
) -> tuple[float, float]:  # fmt: skip
    """Add the inequalities' weights to the lower triangles of the Hessians; return the mean product and the largest error.

    A pair's error is its product or, where its multiplier is large, its slack: both vanish at the optimum.
    """
    products, total, largest = 0, 0.0, 0.0
    for item in range(count):
        kind, i, index = chosen[0, item], chosen[1, item], chosen[2, item]
        s, mu = pairs[S, item], pairs[MU, item]
        residual = s - pairs[LIMIT, item]
        products += 1
        total += mu * s
        largest = max(largest, min(mu, 1.0) * s)
        per_s = 1.0 / s
        weight = mu * per_s
        pairs[PER_S, item], pairs[W, item] = per_s, weight
        if kind == ROW:
            sigma, nu = pairs[SIGMA, item], pairs[NU, item]
            residual -= sigma
            for j in range(x.shape[1]):
                residual += G[i, index, j] * x[i + 1, j]
            products += 1
            total += nu * sigma
            largest = max(largest, min(nu, 1.0) * sigma)
            per_sigma = 1.0 / sigma
            v = nu * per_sigma + pairs[QUADRATIC, item]
            per_both = 1.0 / (weight + v)
            pairs[V, item], pairs[PER_SIGMA, item], pairs[PER_BOTH, item] = v, per_sigma, per_both
            weight *= v * per_both
            for j in range(x.shape[1]):
                for k in range(j + 1):
                    hessian_x[i + 1, j, k] += weight * G[i, index, j] * G[i, index, k]
        elif kind <= X_LOW:
            state = bounded[index]
            residual += x[i + 1, state] if kind == X_HIGH else -x[i + 1, state]
            hessian_x[i + 1, state, state] += weight
        else:
            residual += u[i, index] if kind == U_HIGH else -u[i, index]
            hessian_u[i, index, index] += weight
        pairs[RESIDUAL, item] = residual
        largest = max(largest, abs(residual))
    return total / products, largest


@compiled
def newton_step(
    A: FloatArray, B: FloatArray, c: FloatArray, G: FloatArray, bounded: IntArray, end: int, gain: FloatArray, root: FloatArray,
    value: FloatArray, gradient_x: FloatArray, gradient_u: FloatArray, slope: FloatArray, feed: FloatArray, step_x: FloatArray,
    step_u: FloatArray, slope_x: FloatArray, slope_u: FloatArray, chosen: IntArray, pairs: FloatArray, count: int, target: float,
    second_order: bool,
) -> float:  # fmt: skip
    """Write the Newton step towards complementarity ``target`` in the intervals before ``end``; return how far it may go.

    ``gradient_x`` and ``gradient_u`` are the objective's. With ``second_order`` the last step's products are made up for.
    """
    n, m = step_x.shape[1], step_u.shape[1]
    for i in range(end + 1):
        for j in range(n):
            slope_x[i, j] = gradient_x[i, j]
        if i < end:
            for j in range(m):
                slope_u[i, j] = gradient_u[i, j]
    for item in range(count):
        kind, i, index = chosen[0, item], chosen[1, item], chosen[2, item]
        mu = pairs[MU, item]
        over = mu * pairs[S, item] - target
        if second_order:
            over += pairs[D_MU, item] * pairs[D_S, item]
        first = pairs[W, item] * pairs[RESIDUAL, item] - over * pairs[PER_S, item]
        if kind == ROW:
            sigma, nu = pairs[SIGMA, item], pairs[NU, item]
            under = nu * sigma - target
            if second_order:
                under += pairs[D_NU, item] * pairs[D_SIGMA, item]
            second = mu + nu - pairs[LINEAR, item] - pairs[QUADRATIC, item] * sigma - under * pairs[PER_SIGMA, item]
            pairs[UNDER, item], pairs[SECOND, item] = under, second
            move = mu + (pairs[V, item] * first - pairs[W, item] * second) * pairs[PER_BOTH, item]
            for j in range(n):
                slope_x[i + 1, j] += G[i, index, j] * move
        else:
            move = -(mu + first) if kind in (X_LOW, U_LOW) else mu + first
            if kind <= X_LOW:
                slope_x[i + 1, bounded[index]] += move
            else:
                slope_u[i, index] += move
        pairs[FIRST, item] = first
    for j in range(n):
        slope[end, j], step_x[0, j] = slope_x[end, j], 0.0
    sweep_back(A, B, c, False, end, gain, root, value, slope_x, slope_u, slope, feed)
    sweep_ahead(A, B, c, False, 0, end, gain, feed, step_x, step_u)

    length = 1.0  # divisions only where it shrinks
    for item in range(count):
        kind, i, index = chosen[0, item], chosen[1, item], chosen[2, item]
        along = 0.0
        if kind == ROW:
            for j in range(n):
                along += G[i, index, j] * step_x[i + 1, j]
        elif kind <= X_LOW:
            along = step_x[i + 1, bounded[index]] if kind == X_HIGH else -step_x[i + 1, bounded[index]]
        else:
            along = step_u[i, index] if kind == U_HIGH else -step_u[i, index]
        d_s = -pairs[RESIDUAL, item] - along
        d_mu = pairs[W, item] * along + pairs[FIRST, item]
        if kind == ROW:
            d_sigma = (d_mu + pairs[SECOND, item]) * pairs[PER_BOTH, item]
            d_s += d_sigma
            d_mu = (pairs[V, item] * d_mu - pairs[W, item] * pairs[SECOND, item]) * pairs[PER_BOTH, item]
            d_nu = -(pairs[UNDER, item] + pairs[NU, item] * d_sigma) * pairs[PER_SIGMA, item]
            if pairs[SIGMA, item] + length * d_sigma < 0.0:
                length = -pairs[SIGMA, item] / d_sigma
            if pairs[NU, item] + length * d_nu < 0.0:
                length = -pairs[NU, item] / d_nu
            pairs[D_SIGMA, item], pairs[D_NU, item] = d_sigma, d_nu
        if pairs[S, item] + length * d_s < 0.0:
            length = -pairs[S, item] / d_s
        if pairs[MU, item] + length * d_mu < 0.0:
            length = -pairs[MU, item] / d_mu
        pairs[D_S, item], pairs[D_MU, item] = d_s, d_mu
    return length


@compiled
def mean_after(chosen: IntArray, pairs: FloatArray, count: int, length: float) -> float:
    """Return the mean product that ``length`` of the step would leave."""
    products, total = 0, 0.0
    for item in range(count):
        products += 1
        total += (pairs[S, item] + length * pairs[D_S, item]) * (pairs[MU, item] + length * pairs[D_MU, item])
        if chosen[0, item] == ROW:
            products += 1
            total += (pairs[SIGMA, item] + length * pairs[D_SIGMA, item]) * (pairs[NU, item] + length * pairs[D_NU, item])
    return total / products


@compiled
def move(chosen: IntArray, pairs: FloatArray, count: int, length: float) -> None:
    """Take ``length`` of the step in all pairs."""
    for item in range(count):
        pairs[S, item] += length * pairs[D_S, item]
        pairs[MU, item] += length * pairs[D_MU, item]
        if chosen[0, item] == ROW:
            pairs[SIGMA, item] += length * pairs[D_SIGMA, item]
            pairs[NU, item] += length * pairs[D_NU, item]


@compiled
def publish(
    chosen: IntArray, pairs: FloatArray, count: int, sigma: FloatArray, rows: FloatArray, x_bounds: FloatArray, u_bounds: FloatArray
) -> None:
    """Write elastic variables and multipliers to where the program has them; what was never chosen stays as it is."""
    for item in range(count):
        kind, i, index = chosen[0, item], chosen[1, item], chosen[2, item]
        if kind == ROW:
            sigma[i, index], rows[i, index] = pairs[SIGMA, item], pairs[MU, item]
        elif kind <= X_LOW:
            x_bounds[i, index] = 0.0
        else:
            u_bounds[i, index] = 0.0
    for item in range(count):
        kind, i, index, mu = chosen[0, item], chosen[1, item], chosen[2, item], pairs[MU, item]
        if X_HIGH <= kind <= X_LOW:
            x_bounds[i, index] += mu if kind == X_HIGH else -mu
        elif kind >= U_HIGH:
            u_bounds[i, index] += mu if kind == U_HIGH else -mu
