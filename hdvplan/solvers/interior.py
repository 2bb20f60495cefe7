"""The inequalities of a stage QP in a primal-dual interior-point method: slacks, multipliers, and their share of a Newton step.

Only chosen inequalities take part, each a row value <= limit of one interval, with a slack and a multiplier (s, mu) and, for
elastic rows, a second pair (sigma, nu) that is eliminated by hand:

    W = w v / (w + v),   w = mu / s,   v = nu / sigma + quadratic,

which stays exact however large the weights grow. The Newton system that is left is a linear-quadratic control problem.
"""

from __future__ import annotations

import numpy as np

from hdvplan.jit import IntArray, Records, compiled, inner
from hdvplan.qp.program import StageShape
from hdvplan.solvers.pairs import ROW, U_HIGH, U_LOW, X_HIGH, X_LOW
from hdvplan.solvers.recursion import sweep_ahead, sweep_back


def steps_of(shape: StageShape) -> Records:
    """Return the memory for Newton steps x, u and the objective's gradients, (N+1,) records."""
    n, m = (shape.states,), (shape.inputs,)
    return np.zeros(shape.stages + 1, np.dtype([("x", float, n), ("u", float, m), ("gradient_x", float, n), ("gradient_u", float, m)]))


@inner
def objective(stages: Records, points: Records, weights: Records, steps: Records, end: int) -> None:
    """Write the objective's derivatives at the stages before ``end``."""
    for i in range(end):  # element by element: numba takes seconds to compile a slice assignment
        stage, own, step, x, u = stages[i], weights[i], steps[i], points[i].x, points[i].u
        for j in range(x.size):
            total = stage.q[j]
            for k in range(x.size):
                own.Q[j, k] = stage.Q[j, k]
                total += stage.Q[j, k] * x[k]
            step.gradient_x[j] = total
        for j in range(u.size):
            total = stage.r[j]
            for k in range(u.size):
                own.R[j, k] = stage.R[j, k]
                total += stage.R[j, k] * u[k]
            step.gradient_u[j] = total


@inner
def weigh(rows: Records, bounded: IntArray, points: Records, pairs: Records, weights: Records) -> tuple[float, float]:
    """Add the weights of the chosen inequalities ``pairs`` to the lower triangles of the Hessians.

    Returns the mean product and the largest error. A pair's error is its product or, where its multiplier is large, its slack: both
    vanish at the optimum.
    """
    products, total, largest = 0, 0.0, 0.0
    for item in range(pairs.size):
        pair = pairs[item]
        x, own = points[pair.stage].x, weights[pair.stage]
        s, mu = pair.s, pair.mu
        residual = s - pair.limit
        products += 1
        total += mu * s
        largest = max(largest, min(mu, 1.0) * s)
        per_s = 1.0 / s
        weight = mu * per_s
        pair.per_s, pair.w = per_s, weight
        if pair.kind == ROW:
            sigma, nu, g = pair.sigma, pair.nu, rows[pair.stage, pair.index].g
            residual -= sigma
            for j in range(x.size):
                residual += g[j] * x[j]
            products += 1
            total += nu * sigma
            largest = max(largest, min(nu, 1.0) * sigma)
            per_sigma = 1.0 / sigma
            v = nu * per_sigma + pair.quadratic
            per_both = 1.0 / (weight + v)
            pair.v, pair.per_sigma, pair.per_both = v, per_sigma, per_both
            weight *= v * per_both
            for j in range(x.size):
                for k in range(j + 1):
                    own.Q[j, k] += weight * g[j] * g[k]
        elif pair.kind <= X_LOW:
            state = bounded[pair.index]
            residual += x[state] if pair.kind == X_HIGH else -x[state]
            own.Q[state, state] += weight
        else:
            u = points[pair.stage].u[pair.index]
            residual += u if pair.kind == U_HIGH else -u
            own.R[pair.index, pair.index] += weight
        pair.residual = residual
        largest = max(largest, abs(residual))
    return total / products, largest


@inner
def _aim(
    rows: Records, bounded: IntArray, pairs: Records, target: float, second_order: bool, weights: Records, steps: Records, end: int
) -> None:
    """Write the linear terms of the Newton step towards complementarity ``target``."""
    for i in range(end + 1):
        own, step = weights[i], steps[i]
        for j in range(own.q.size):
            own.q[j] = step.gradient_x[j]
        if i < end:
            for j in range(own.r.size):
                own.r[j] = step.gradient_u[j]
    for item in range(pairs.size):
        pair = pairs[item]
        own, mu = weights[pair.stage], pair.mu
        over = mu * pair.s - target
        if second_order:
            over += pair.d_mu * pair.d_s
        first = pair.w * pair.residual - over * pair.per_s
        if pair.kind == ROW:
            sigma, nu, g = pair.sigma, pair.nu, rows[pair.stage, pair.index].g
            under = nu * sigma - target
            if second_order:
                under += pair.d_nu * pair.d_sigma
            second = mu + nu - pair.linear - pair.quadratic * sigma - under * pair.per_sigma
            pair.under, pair.second = under, second
            pushed = mu + (pair.v * first - pair.w * second) * pair.per_both
            for j in range(own.q.size):
                own.q[j] += g[j] * pushed
        else:
            pushed = -(mu + first) if pair.kind in (X_LOW, U_LOW) else mu + first
            if pair.kind <= X_LOW:
                own.q[bounded[pair.index]] += pushed
            else:
                own.r[pair.index] += pushed
        pair.first = first


@compiled
def newton_step(
    stages: Records, rows: Records, bounded: IntArray, pairs: Records, weights: Records, work: Records, steps: Records, end: int,
    target: float, second_order: bool,
) -> float:  # fmt: skip
    """Write the Newton step towards complementarity ``target`` in the intervals before ``end``; return how far it may go.

    With ``second_order`` the last step's products are made up for.
    """
    _aim(rows, bounded, pairs, target, second_order, weights, steps, end)
    for j in range(work[0].p.size):
        work[end].p[j], steps[0].x[j] = weights[end].q[j], 0.0
    sweep_back(stages, weights, work, end, False)
    sweep_ahead(stages, work, steps, 0, end, False)

    length = 1.0  # divisions only where it shrinks
    for item in range(pairs.size):
        pair = pairs[item]
        own, along = steps[pair.stage], 0.0
        if pair.kind == ROW:
            g = rows[pair.stage, pair.index].g
            for j in range(own.x.size):
                along += g[j] * own.x[j]
        elif pair.kind <= X_LOW:
            along = own.x[bounded[pair.index]] if pair.kind == X_HIGH else -own.x[bounded[pair.index]]
        else:
            along = own.u[pair.index] if pair.kind == U_HIGH else -own.u[pair.index]
        d_s = -pair.residual - along
        d_mu = pair.w * along + pair.first
        if pair.kind == ROW:
            d_sigma = (d_mu + pair.second) * pair.per_both
            d_s += d_sigma
            d_mu = (pair.v * d_mu - pair.w * pair.second) * pair.per_both
            d_nu = -(pair.under + pair.nu * d_sigma) * pair.per_sigma
            if pair.sigma + length * d_sigma < 0.0:
                length = -pair.sigma / d_sigma
            if pair.nu + length * d_nu < 0.0:
                length = -pair.nu / d_nu
            pair.d_sigma, pair.d_nu = d_sigma, d_nu
        if pair.s + length * d_s < 0.0:
            length = -pair.s / d_s
        if pair.mu + length * d_mu < 0.0:
            length = -pair.mu / d_mu
        pair.d_s, pair.d_mu = d_s, d_mu
    return length


@inner
def mean_after(pairs: Records, length: float) -> float:
    """Return the mean product that ``length`` of the step would leave."""
    products, total = 0, 0.0
    for item in range(pairs.size):
        pair = pairs[item]
        products += 1
        total += (pair.s + length * pair.d_s) * (pair.mu + length * pair.d_mu)
        if pair.kind == ROW:
            products += 1
            total += (pair.sigma + length * pair.d_sigma) * (pair.nu + length * pair.d_nu)
    return total / products


@inner
def move(pairs: Records, length: float) -> None:
    """Take ``length`` of the step in all pairs."""
    for item in range(pairs.size):
        pair = pairs[item]
        pair.s += length * pair.d_s
        pair.mu += length * pair.d_mu
        if pair.kind == ROW:
            pair.sigma += length * pair.d_sigma
            pair.nu += length * pair.d_nu


@inner
def clear(points: Records, row_points: Records) -> None:
    """Write zeros for elastic variables and multipliers of inequalities."""
    for i in range(points.size):
        for row in range(row_points.shape[1]):
            row_points[i, row].sigma = row_points[i, row].multiplier = 0.0
        for b in range(points[i].x_bounds.size):
            points[i].x_bounds[b] = 0.0
        for j in range(points[i].u_bounds.size):
            points[i].u_bounds[j] = 0.0


@compiled
def publish(pairs: Records, points: Records, row_points: Records) -> None:
    """Write elastic variables and multipliers to where the program has them; what was never chosen is zero."""
    clear(points, row_points)
    for item in range(pairs.size):
        pair = pairs[item]
        mu, index = pair.mu, pair.index
        if pair.kind == ROW:
            row_points[pair.stage, index].sigma, row_points[pair.stage, index].multiplier = pair.sigma, mu
        elif pair.kind <= X_LOW:
            points[pair.stage].x_bounds[index] += mu if pair.kind == X_HIGH else -mu
        else:
            points[pair.stage].u_bounds[index] += mu if pair.kind == U_HIGH else -mu
