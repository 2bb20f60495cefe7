"""A warm start for stage QPs: which inequalities the last plan held tells nearly always which ones this plan holds.

A primal-dual active set method (Hintermüller, Ito, Kunisch 2003): held inequalities are equalities, kept by a stiff quadratic whose
centre moves by their multipliers (augmented Lagrangian), so that a Riccati pass solves for everything at once; then every inequality
is looked at, and those on the wrong side change sides. Elastic rows have a third side, broken, where their penalty is a plain
quadratic. With the right guess one or two passes do what an interior point method needs twenty for. With a wrong one the method may
chatter: it is given a few passes, and where it has not settled by then it says so.
"""

from __future__ import annotations

from hdvplan.jit import FloatArray, IntArray, compiled
from hdvplan.solvers.recursion import adjoint, factorise, imbalance, sweep_ahead, sweep_back

FREE, HELD, BROKEN = range(3)  # the sides of an inequality
STIFF = 1e9  # of a held inequality [1/m^2]: an error of its multiplier by 100 leaves 1e-7 m
PASSES = 5
KEPT = 1e-7  # of a held or free inequality [m, 1/m]
_BALANCED = 1e-6  # of the Lagrangian's gradient by the inputs, relative: stiff quadratics turn rounding into multipliers
CARRIED = 1e-4  # a guess's multiplier beyond this means that its inequality was held


@compiled
def sides_of(
    linear: FloatArray, rows: FloatArray, sigma: FloatArray, x_bounds: FloatArray, u_bounds: FloatArray, side: IntArray, prices: FloatArray
) -> bool:
    """Write the guessed side and multiplier of every inequality, shape (N, rows + 2 bounded + 2 inputs); return whether any is not free.

    A row without a linear price is never held: it costs nothing to begin with. Bounds are upper, then lower.
    """
    any_held, p, nb = False, rows.shape[1], x_bounds.shape[1]
    for i in range(rows.shape[0]):
        for row in range(p):
            side[i, row], prices[i, row] = FREE, 0.0
            if rows[i, row] > CARRIED:
                broken = sigma[i, row] > KEPT or not linear[i, row] > 0.0
                side[i, row], prices[i, row], any_held = BROKEN if broken else HELD, rows[i, row], True
        for bound in range(nb + u_bounds.shape[1]):
            price = x_bounds[i, bound] if bound < nb else u_bounds[i, bound - nb]
            for lower in range(2):
                place, one = p + 2 * bound + lower, -price if lower else price
                side[i, place], prices[i, place] = FREE, 0.0
                if one > CARRIED:
                    side[i, place], prices[i, place], any_held = HELD, one, True
    return any_held


@compiled
def _weigh(
    Q: FloatArray, q: FloatArray, R: FloatArray, r: FloatArray, G: FloatArray, h: FloatArray, linear: FloatArray, quadratic: FloatArray,
    bounded: IntArray, x_low: FloatArray, x_high: FloatArray, u_low: FloatArray, u_high: FloatArray, side: IntArray, prices: FloatArray,
    hessian_x: FloatArray, hessian_u: FloatArray, slope_x: FloatArray, slope_u: FloatArray,
) -> None:  # fmt: skip
    """Write the objective with the quadratics of all inequalities that are not free; Hessians in their lower triangles."""
    n, m, p, nb = Q.shape[1], R.shape[1], G.shape[1], bounded.size
    for i in range(Q.shape[0]):
        for j in range(n):
            slope_x[i, j] = q[i, j]
            for k in range(j + 1):
                hessian_x[i, j, k] = Q[i, j, k]
    for i in range(R.shape[0]):
        for j in range(m):
            slope_u[i, j] = r[i, j]
            for k in range(j + 1):
                hessian_u[i, j, k] = R[i, j, k]
        for row in range(p):
            if side[i, row] == FREE:
                continue
            weight, price = (STIFF, prices[i, row]) if side[i, row] == HELD else (quadratic[i, row], linear[i, row])
            for j in range(n):
                slope_x[i + 1, j] += (price - weight * h[i, row]) * G[i, row, j]
                for k in range(j + 1):
                    hessian_x[i + 1, j, k] += weight * G[i, row, j] * G[i, row, k]
        for bound in range(nb + m):
            for lower in range(2):
                place = p + 2 * bound + lower
                if side[i, place] == FREE:
                    continue
                sign = -1.0 if lower else 1.0
                if bound < nb:
                    limit = x_low[i, bound] if lower else x_high[i, bound]
                    slope_x[i + 1, bounded[bound]] += sign * prices[i, place] - STIFF * limit
                    hessian_x[i + 1, bounded[bound], bounded[bound]] += STIFF
                else:
                    limit = u_low[i, bound - nb] if lower else u_high[i, bound - nb]
                    slope_u[i, bound - nb] += sign * prices[i, place] - STIFF * limit
                    hessian_u[i, bound - nb, bound - nb] += STIFF


@compiled
def _look(
    G: FloatArray, h: FloatArray, linear: FloatArray, bounded: IntArray, x_low: FloatArray, x_high: FloatArray, u_low: FloatArray,
    u_high: FloatArray, x: FloatArray, u: FloatArray, side: IntArray, prices: FloatArray,
) -> bool:  # fmt: skip
    """Move multipliers by what held inequalities lack, change wrong sides; return whether all were right and are kept."""
    settled, p, nb = True, G.shape[1], bounded.size
    for i in range(u.shape[0]):
        for row in range(p):
            over, priced = -h[i, row], linear[i, row] > 0.0
            for j in range(x.shape[1]):
                over += G[i, row, j] * x[i + 1, j]
            if side[i, row] == FREE:
                if over > KEPT:
                    side[i, row], prices[i, row], settled = HELD if priced else BROKEN, 0.0, False
            elif side[i, row] == HELD:
                settled = settled and abs(over) <= KEPT
                prices[i, row] += STIFF * over
                if prices[i, row] < 0.0:
                    side[i, row], prices[i, row], settled = FREE, 0.0, False
                elif prices[i, row] > linear[i, row]:
                    side[i, row], settled = BROKEN, False
            elif over < 0.0:
                side[i, row], prices[i, row], settled = HELD if priced else FREE, linear[i, row], False
        for bound in range(nb + u.shape[1]):
            for lower in range(2):
                if bound < nb:
                    v = x[i + 1, bounded[bound]]
                    over = x_low[i, bound] - v if lower else v - x_high[i, bound]
                else:
                    v = u[i, bound - nb]
                    over = u_low[i, bound - nb] - v if lower else v - u_high[i, bound - nb]
                place = p + 2 * bound + lower
                if side[i, place] == FREE:
                    if over > KEPT:
                        side[i, place], prices[i, place], settled = HELD, 0.0, False
                else:
                    settled = settled and abs(over) <= KEPT
                    prices[i, place] += STIFF * over
                    if prices[i, place] < 0.0:
                        side[i, place], prices[i, place], settled = FREE, 0.0, False
    return settled


@compiled
def _publish(
    G: FloatArray, h: FloatArray, linear: FloatArray, quadratic: FloatArray, x: FloatArray, side: IntArray, prices: FloatArray,
    sigma: FloatArray, rows: FloatArray, x_bounds: FloatArray, u_bounds: FloatArray,
) -> None:  # fmt: skip
    """Write elastic variables and multipliers to where the program has them."""
    p, nb = G.shape[1], x_bounds.shape[1]
    for i in range(rows.shape[0]):
        for row in range(p):
            sigma[i, row], rows[i, row] = 0.0, prices[i, row]
            if side[i, row] == BROKEN:
                over = -h[i, row]
                for j in range(x.shape[1]):
                    over += G[i, row, j] * x[i + 1, j]
                sigma[i, row], rows[i, row] = over, linear[i, row] + quadratic[i, row] * over
        for bound in range(nb + u_bounds.shape[1]):
            price = prices[i, p + 2 * bound] - prices[i, p + 2 * bound + 1]
            if bound < nb:
                x_bounds[i, bound] = price
            else:
                u_bounds[i, bound - nb] = price


@compiled
def settle(
    A: FloatArray, B: FloatArray, c: FloatArray, Q: FloatArray, q: FloatArray, R: FloatArray, r: FloatArray, G: FloatArray, h: FloatArray,
    linear: FloatArray, quadratic: FloatArray, bounded: IntArray, x_low: FloatArray, x_high: FloatArray, u_low: FloatArray,
    u_high: FloatArray, x: FloatArray, u: FloatArray, sigma: FloatArray, dynamics: FloatArray, rows: FloatArray, x_bounds: FloatArray,
    u_bounds: FloatArray, gain: FloatArray, root: FloatArray, value: FloatArray, slope: FloatArray, feed: FloatArray,
    hessian_x: FloatArray, hessian_u: FloatArray, slope_x: FloatArray, slope_u: FloatArray, side: IntArray, prices: FloatArray,
) -> tuple[bool, int]:  # fmt: skip
    """Solve a program from guessed sides and multipliers; return whether they settled, and the number of factorisations.

    Only then are multipliers and elastic variables written.
    """
    stages, n = B.shape[0], B.shape[1]
    for iteration in range(PASSES):
        _weigh(
            Q, q, R, r, G, h, linear, quadratic, bounded, x_low, x_high, u_low, u_high, side, prices, hessian_x, hessian_u, slope_x, slope_u
        )
        for j in range(n):
            slope[stages, j] = slope_x[stages, j]
            for k in range(j + 1):
                value[stages, j, k] = value[stages, k, j] = hessian_x[stages, j, k]
        if not factorise(A, B, stages, hessian_x, hessian_u, gain, root, value):
            return False, iteration + 1
        sweep_back(A, B, c, True, stages, gain, root, value, slope_x, slope_u, slope, feed)
        sweep_ahead(A, B, c, True, 0, stages, gain, feed, x, u)
        if _look(G, h, linear, bounded, x_low, x_high, u_low, u_high, x, u, side, prices):
            _publish(G, h, linear, quadratic, x, side, prices, sigma, rows, x_bounds, u_bounds)
            adjoint(A, Q, q, G, bounded, x, rows, x_bounds, dynamics)
            return bool(imbalance(B, R, r, u, u_bounds, dynamics) < _BALANCED), iteration + 1
    return False, PASSES
