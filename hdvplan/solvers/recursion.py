"""Riccati recursion for the equality part of a stage QP: factorise once, then one backward and one forward sweep a solve.

The cost-to-go of stage i is 1/2 x'P_i x + p_i'x, the optimal input u = -K_i x - k_i. Everything a solve needs of a stage lies in one
record of ``work_dtype``: its own weights Q, q, R, r (the program's, or with what inequalities add), the recursion's P, p, K, k and L (the
Cholesky factor of the input's Hessian), the step x, u that it leads to, and memory.
"""

from __future__ import annotations

import numpy as np

from hdvplan.jit import IntArray, Records, compiled
from hdvplan.qp.program import StageShape

_ROUNDING = 1e-14  # share of an input's curvature below which what the inputs before it leave is rounding


def workspace(shape: StageShape) -> Records:
    """Return the memory of a solve, (N+1,) records."""
    n, m = shape.states, shape.inputs
    square, vector, inputs = ("Q", "P", "VA"), ("q", "p", "x", "gradient_x", "carried"), ("r", "k", "u", "gradient_u", "by_u")
    sizes = dict.fromkeys(square, (n, n)) | dict.fromkeys(vector, (n,)) | dict.fromkeys(inputs, (m,))
    sizes |= {"R": (m, m), "L": (m, m), "K": (m, n), "BVA": (m, n)}
    return np.zeros(shape.stages + 1, np.dtype([(name, float, size) for name, size in sizes.items()]))


@compiled
def load_weights(stages: Records, work: Records) -> None:
    """Write the program's own weights into the memory of a solve."""
    for i in range(stages.size):
        stage, own = stages[i], work[i]
        for j in range(own.q.size):
            own.q[j] = stage.q[j]
            for k in range(own.q.size):
                own.Q[j, k] = stage.Q[j, k]
        for j in range(own.r.size):
            own.r[j] = stage.r[j]
            for k in range(own.r.size):
                own.R[j, k] = stage.R[j, k]


@compiled
def end_at(work: Records, end: int) -> None:
    """Let the cost-to-go of stage ``end`` be its own weights, whose lower triangle counts."""
    own = work[end]
    for j in range(own.q.size):
        own.p[j] = own.q[j]
        for k in range(j + 1):
            own.P[j, k] = own.P[k, j] = own.Q[j, k]


@compiled
def factorise(stages: Records, work: Records, end: int) -> bool:
    """Run the Riccati recursion from stage ``end`` down, whose P is given; return False where an input has no curvature.

    Of Q and R the lower triangles count.
    """
    n, m = work[0].q.size, work[0].r.size
    for i in range(end - 1, -1, -1):
        stage, own, P = stages[i], work[i], work[i + 1].P
        A, B, VA, BVA, L, K = stage.A, stage.B, own.VA, own.BVA, own.L, own.K
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
                total = own.R[j, k]
                for t in range(n):
                    pb = 0.0
                    for w in range(n):
                        pb += P[t, w] * B[w, k]
                    total += B[t, j] * pb
                whole = total
                for t in range(k):
                    total -= L[j, t] * L[k, t]
                if j == k:
                    if not whole > 0.0:
                        return False
                    L[j, j] = np.sqrt(max(total, _ROUNDING * whole))
                else:
                    L[j, k] = total / L[k, k]
        for k in range(n):  # K = (L L')^-1 B'P A
            for j in range(m):
                total = BVA[j, k]
                for t in range(j):
                    total -= L[j, t] * K[t, k]
                K[j, k] = total / L[j, j]
            for j in range(m - 1, -1, -1):
                total = K[j, k]
                for t in range(j + 1, m):
                    total -= L[t, j] * K[t, k]
                K[j, k] = total / L[j, j]
        for j in range(n):
            for k in range(j + 1):
                total = own.Q[j, k]
                for t in range(n):
                    total += A[t, j] * VA[t, k]
                for t in range(m):
                    total -= BVA[t, j] * K[t, k]
                own.P[j, k] = own.P[k, j] = total
    return True


@compiled
def sweep_back(stages: Records, work: Records, end: int, affine: bool) -> None:
    """Write p and k from stage ``end`` down, whose p is given. Without ``affine`` the dynamics are homogeneous."""
    n, m = work[0].q.size, work[0].r.size
    for i in range(end - 1, -1, -1):
        stage, own, behind = stages[i], work[i], work[i + 1]
        carried, by_u, L, k = own.carried, own.by_u, own.L, own.k
        for j in range(n):
            total = behind.p[j]
            if affine:
                for t in range(n):
                    total += behind.P[j, t] * stage.c[t]
            carried[j] = total
        for j in range(m):
            total = own.r[j]
            for t in range(n):
                total += stage.B[t, j] * carried[t]
            by_u[j] = total
            for t in range(j):
                total -= L[j, t] * k[t]
            k[j] = total / L[j, j]
        for j in range(m - 1, -1, -1):
            total = k[j]
            for t in range(j + 1, m):
                total -= L[t, j] * k[t]
            k[j] = total / L[j, j]
        for j in range(n):
            total = own.q[j]
            for t in range(n):
                total += stage.A[t, j] * carried[t]
            for t in range(m):
                total -= own.K[t, j] * by_u[t]
            own.p[j] = total


@compiled
def sweep_ahead(stages: Records, work: Records, points: Records, begin: int, end: int, affine: bool) -> None:
    """Roll the feedback out over the intervals begin <= i < end.

    With ``affine`` it writes x and u of ``points`` from its x at ``begin``; else the step x, u of ``work`` under homogeneous dynamics.
    """
    n, m = work[0].q.size, work[0].r.size
    for i in range(begin, end):
        stage, own = stages[i], work[i]
        x, u, ahead = (points[i].x, points[i].u, points[i + 1].x) if affine else (own.x, own.u, work[i + 1].x)
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
