"""Riccati recursion for the equality part of a stage QP: factorise once, then one backward and one forward sweep a solve.

Notation of ``StageQp``. The cost-to-go of stage i is 1/2 x'V_i x + v_i'x, the optimal input u = -K_i x - k_i.
"""

from __future__ import annotations

import numpy as np

from hdvplan.jit import FloatArray, IntArray, compiled

_ROUNDING = 1e-14  # share of an input's curvature below which what the inputs before it leave is rounding


@compiled
def factorise(
    A: FloatArray, B: FloatArray, stages: int, hessian_x: FloatArray, hessian_u: FloatArray, gain: FloatArray, root: FloatArray,
    value: FloatArray,
) -> bool:  # fmt: skip
    """Run the Riccati recursion from ``stages`` down, whose cost-to-go Hessian ``value[stages]`` is given.

    Writes cost-to-go Hessians and feedback gains; returns False where an input has no curvature.

    ``root`` receives the Cholesky factors of the inputs' Hessians.
    """
    n, m = B.shape[1], B.shape[2]
    carried, by_u = np.empty((n, n)), np.empty((m, n))
    for i in range(stages - 1, -1, -1):
        for j in range(n):  # carried = V A
            for k in range(n):
                total = 0.0
                for t in range(n):
                    total += value[i + 1, j, t] * A[i, t, k]
                carried[j, k] = total
        for j in range(m):
            for k in range(n):
                total = 0.0
                for t in range(n):
                    total += B[i, t, j] * carried[t, k]
                by_u[j, k] = total
            for k in range(j + 1):
                total = hessian_u[i, j, k]
                for t in range(n):
                    vb = 0.0
                    for w in range(n):
                        vb += value[i + 1, t, w] * B[i, w, k]
                    total += B[i, t, j] * vb
                whole = total
                for t in range(k):
                    total -= root[i, j, t] * root[i, k, t]
                if j == k:
                    if not whole > 0.0:
                        return False
                    root[i, j, j] = np.sqrt(max(total, _ROUNDING * whole))
                else:
                    root[i, j, k] = total / root[i, k, k]
        for k in range(n):  # gain = (L L')^-1 by_u
            for j in range(m):
                total = by_u[j, k]
                for t in range(j):
                    total -= root[i, j, t] * gain[i, t, k]
                gain[i, j, k] = total / root[i, j, j]
            for j in range(m - 1, -1, -1):
                total = gain[i, j, k]
                for t in range(j + 1, m):
                    total -= root[i, t, j] * gain[i, t, k]
                gain[i, j, k] = total / root[i, j, j]
        for j in range(n):
            for k in range(j + 1):
                total = hessian_x[i, j, k]
                for t in range(n):
                    total += A[i, t, j] * carried[t, k]
                for t in range(m):
                    total -= by_u[t, j] * gain[i, t, k]
                value[i, j, k] = value[i, k, j] = total
    return True


@compiled
def sweep_back(
    A: FloatArray, B: FloatArray, c: FloatArray, affine: bool, stages: int, gain: FloatArray, root: FloatArray, value: FloatArray,
    slope_x: FloatArray, slope_u: FloatArray, slope: FloatArray, feed: FloatArray,
) -> None:  # fmt: skip
    """Write the cost-to-go's ``slope`` and the feed-forward from ``stages`` down, where ``slope[stages]`` is given.

    ``slope_x`` and ``slope_u`` are the stage costs' linear terms. Without ``affine`` the dynamics are homogeneous.
    """
    n, m = B.shape[1], B.shape[2]
    carried, by_u = np.empty(n), np.empty(m)
    for i in range(stages - 1, -1, -1):
        for j in range(n):
            total = slope[i + 1, j]
            if affine:
                for t in range(n):
                    total += value[i + 1, j, t] * c[i, t]
            carried[j] = total
        for j in range(m):
            total = slope_u[i, j]
            for t in range(n):
                total += B[i, t, j] * carried[t]
            by_u[j] = total
            for t in range(j):
                total -= root[i, j, t] * feed[i, t]
            feed[i, j] = total / root[i, j, j]
        for j in range(m - 1, -1, -1):
            total = feed[i, j]
            for t in range(j + 1, m):
                total -= root[i, t, j] * feed[i, t]
            feed[i, j] = total / root[i, j, j]
        for j in range(n):
            total = slope_x[i, j]
            for t in range(n):
                total += A[i, t, j] * carried[t]
            for t in range(m):
                total -= gain[i, t, j] * by_u[t]
            slope[i, j] = total


@compiled
def sweep_ahead(
    A: FloatArray, B: FloatArray, c: FloatArray, affine: bool, begin: int, end: int, gain: FloatArray, feed: FloatArray, x: FloatArray,
    u: FloatArray,
) -> None:  # fmt: skip
    """Roll the feedback out over the intervals begin <= i < end, from ``x[begin]``."""
    n, m = B.shape[1], B.shape[2]
    for i in range(begin, end):
        for j in range(m):
            total = -feed[i, j]
            for t in range(n):
                total -= gain[i, j, t] * x[i, t]
            u[i, j] = total
        for j in range(n):
            total = c[i, j] if affine else 0.0
            for t in range(n):
                total += A[i, j, t] * x[i, t]
            for t in range(m):
                total += B[i, j, t] * u[i, t]
            x[i + 1, j] = total


@compiled
def adjoint(
    A: FloatArray, Q: FloatArray, q: FloatArray, G: FloatArray, bounded: IntArray, x: FloatArray, rows: FloatArray, x_bounds: FloatArray,
    dynamics: FloatArray,
) -> None:  # fmt: skip
    """Write the multipliers of the dynamics that make the Lagrangian stationary in every state."""
    stages, n = A.shape[0], A.shape[1]
    for i in range(stages, -1, -1):
        for j in range(n):
            total = q[i, j]
            for t in range(n):
                total += Q[i, j, t] * x[i, t]
                if i < stages:
                    total -= A[i, t, j] * dynamics[i + 1, t]
            if i > 0:
                for row in range(G.shape[1]):
                    total += G[i - 1, row, j] * rows[i - 1, row]
                for b in range(bounded.size):
                    if bounded[b] == j:
                        total += x_bounds[i - 1, b]
            dynamics[i, j] = -total


@compiled
def imbalance(B: FloatArray, R: FloatArray, r: FloatArray, u: FloatArray, u_bounds: FloatArray, dynamics: FloatArray) -> float:
    """Return the largest entry of the Lagrangian's gradient by the inputs, relative to the largest multiplier, or to 1."""
    n, m = B.shape[1], B.shape[2]
    largest, scale = 0.0, 1.0
    for i in range(u.shape[0]):
        for j in range(n):
            scale = max(scale, abs(dynamics[i + 1, j]))
        for j in range(m):
            total = r[i, j] + u_bounds[i, j]
            for t in range(m):
                total += R[i, j, t] * u[i, t]
            for t in range(n):
                total -= B[i, t, j] * dynamics[i + 1, t]
            largest, scale = max(largest, abs(total)), max(scale, abs(u_bounds[i, j]))
    return largest / scale
