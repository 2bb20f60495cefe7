"""Riccati recursion for the equality part of a stage QP: factorise once, then one backward and one forward sweep a solve.

The cost-to-go of stage i is 1/2 x'P_i x + p_i'x, the optimal input u = -K_i x - k_i. What the recursion keeps of a stage is one record:
P, p, K, k and L, which holds the factors L D L' of the inputs' Hessian: L below the diagonal, the inverse of D on it. The weights
Q, q, R, r are those of any records with these columns: the program's own, or with what inequalities add. Memory that fits into the
processor's first cache is what makes this fast.
"""

from __future__ import annotations

import numpy as np

from hdvplan.jit import IntArray, Records, compiled
from hdvplan.qp.program import StageShape

_ROUNDING = 1e-14  # share of an input's curvature below which what the inputs before it leave is rounding


def recursion_of(shape: StageShape) -> Records:
    """Return the memory of a recursion, (N+1,) records."""
    n, m = shape.states, shape.inputs
    sizes = {"P": (n, n), "p": (n,), "K": (m, n), "k": (m,), "L": (m, m)}
    return np.zeros(shape.stages + 1, np.dtype([(name, float, size) for name, size in sizes.items()]))


def weights_of(shape: StageShape) -> Records:
    """Return memory for weights, (N+1,) records."""
    n, m = shape.states, shape.inputs
    sizes = {"Q": (n, n), "q": (n,), "R": (m, m), "r": (m,)}
    return np.zeros(shape.stages + 1, np.dtype([(name, float, size) for name, size in sizes.items()]))


@compiled
def load_weights(stages: Records, weights: Records) -> None:
    """Copy the program's own weights."""
    for i in range(stages.size):
        stage, own = stages[i], weights[i]
        for j in range(own.q.size):
            own.q[j] = stage.q[j]
            for k in range(own.q.size):
                own.Q[j, k] = stage.Q[j, k]
        for j in range(own.r.size):
            own.r[j] = stage.r[j]
            for k in range(own.r.size):
                own.R[j, k] = stage.R[j, k]


@compiled
def end_at(weights: Records, work: Records, end: int) -> None:
    """Let the cost-to-go of stage ``end`` be its own weights, whose lower triangle counts."""
    weight, own = weights[end], work[end]
    for j in range(own.p.size):
        own.p[j] = weight.q[j]
        for k in range(j + 1):
            own.P[j, k] = own.P[k, j] = weight.Q[j, k]


@compiled
def factorise(stages: Records, weights: Records, work: Records, end: int) -> bool:
    """Run the Riccati recursion from stage ``end`` down, whose P is given; return False where an input has no curvature.

    Of Q and R the lower triangles count.
    """
    n, m = work[0].p.size, work[0].k.size
    VA, BVA, D = np.empty((n, n)), np.empty((m, n)), np.empty(m)
    for i in range(end - 1, -1, -1):
        stage, weight, own, P = stages[i], weights[i], work[i], work[i + 1].P
        A, B, L, K = stage.A, stage.B, own.L, own.K
        for j in range(n):
            for k in range(n):
                total = 0.0
                for t in range(n):
                    total += P[j, t] * A[t, k]
                VA[j, k] = total
        for j in range(m):
            for k in range(n):
                total = 0.0
                for t in range(n):
                    total += B[t, j] * VA[t, k]
                BVA[j, k] = total
            for k in range(j + 1):
                total = weight.R[j, k]
                for t in range(n):
                    pb = 0.0
                    for w in range(n):
                        pb += P[t, w] * B[w, k]
                    total += B[t, j] * pb
                whole = total
                for t in range(k):
                    total -= L[j, t] * D[t] * L[k, t]
                if j == k:
                    if not whole > 0.0:
                        return False
                    D[j] = max(total, _ROUNDING * whole)
                    L[j, j] = 1.0 / D[j]
                else:
                    L[j, k] = total * L[k, k]
        for k in range(n):  # K = (L D L')^-1 B'P A
            for j in range(m):
                total = BVA[j, k]
                for t in range(j):
                    total -= L[j, t] * K[t, k]
                K[j, k] = total
            for j in range(m - 1, -1, -1):
                total = K[j, k] * L[j, j]
                for t in range(j + 1, m):
                    total -= L[t, j] * K[t, k]
                K[j, k] = total
        for j in range(n):
            for k in range(j + 1):
                total = weight.Q[j, k]
                for t in range(n):
                    total += A[t, j] * VA[t, k]
                for t in range(m):
                    total -= BVA[t, j] * K[t, k]
                own.P[j, k] = own.P[k, j] = total
    return True


@compiled
def sweep_back(stages: Records, weights: Records, work: Records, end: int, affine: bool) -> None:
    """Write p and k from stage ``end`` down, whose p is given. Without ``affine`` the dynamics are homogeneous."""
    n, m = work[0].p.size, work[0].k.size
    carried, by_u = np.empty(n), np.empty(m)
    for i in range(end - 1, -1, -1):
        stage, weight, own, behind = stages[i], weights[i], work[i], work[i + 1]
        L, k = own.L, own.k
        for j in range(n):
            total = behind.p[j]
            if affine:
                for t in range(n):
                    total += behind.P[j, t] * stage.c[t]
            carried[j] = total
        for j in range(m):
            total = weight.r[j]
            for t in range(n):
                total += stage.B[t, j] * carried[t]
            by_u[j] = total
            for t in range(j):
                total -= L[j, t] * k[t]
            k[j] = total
        for j in range(m - 1, -1, -1):
            total = k[j] * L[j, j]
            for t in range(j + 1, m):
                total -= L[t, j] * k[t]
            k[j] = total
        for j in range(n):
            total = weight.q[j]
            for t in range(n):
                total += stage.A[t, j] * carried[t]
            for t in range(m):
                total -= own.K[t, j] * by_u[t]
            own.p[j] = total


@compiled
def sweep_ahead(stages: Records, work: Records, points: Records, begin: int, end: int, affine: bool) -> None:
    """Roll the feedback out over the intervals begin <= i < end: write x and u of ``points`` from its x at ``begin``.

    Without ``affine`` the dynamics are homogeneous. ``points`` are records with the columns x and u.
    """
    n, m = work[0].p.size, work[0].k.size
    for i in range(begin, end):
        stage, own = stages[i], work[i]
        x, u, ahead = points[i].x, points[i].u, points[i + 1].x
        for j in range(m):
            total = -own.k[j]
            for t in range(n):
                total -= own.K[j, t] * x[t]
            u[j] = total
        for j in range(n):
            total = stage.c[j] if affine else 0.0
            for t in range(n):
                total += stage.A[j, t] * x[t]
            for t in range(m):
                total += stage.B[j, t] * u[t]
            ahead[j] = total


@compiled
def adjoint(stages: Records, rows: Records, bounded: IntArray, points: Records, row_points: Records) -> None:
    """Write the multipliers of the dynamics that make the Lagrangian stationary in every state."""
    last, n = stages.size - 1, stages[0].c.size
    for i in range(last, -1, -1):
        stage, point = stages[i], points[i]
        for j in range(n):
            total = stage.q[j]
            for t in range(n):
                total += stage.Q[j, t] * point.x[t]
            if i < last:
                for t in range(n):
                    total -= stage.A[t, j] * points[i + 1].dynamics[t]
            if i > 0:
                if stage.live > 0.0:
                    for row in range(rows.shape[1]):
                        total += rows[i, row].g[j] * row_points[i, row].multiplier
                for b in range(bounded.size):
                    if bounded[b] == j:
                        total += point.x_bounds[b]
            point.dynamics[j] = -total


@compiled
def imbalance(stages: Records, points: Records) -> float:
    """Return the largest entry of the Lagrangian's gradient by the inputs, relative to the largest multiplier, or to 1."""
    n, m = stages[0].c.size, stages[0].r.size
    largest, scale = 0.0, 1.0
    for i in range(stages.size - 1):
        stage, point, dynamics = stages[i], points[i], points[i + 1].dynamics
        for j in range(n):
            scale = max(scale, abs(dynamics[j]))
        for j in range(m):
            total = stage.r[j] + point.u_bounds[j]
            for t in range(m):
                total += stage.R[j, t] * point.u[t]
            for t in range(n):
                total -= stage.B[t, j] * dynamics[t]
            largest, scale = max(largest, abs(total)), max(scale, abs(point.u_bounds[j]))
    return largest / scale
