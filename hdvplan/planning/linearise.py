"""Write one planning step's QP: dynamics and centring objective, linearised at a given motion; with ``limits``, all of it.

Variables of the QP are deviations from that motion: x_i = (dz_i, d kappa_{i-1}), u_i = change of kappa_i - kappa_{i-1}.
Offsets of body points are exact projections on the road; their derivative is n . dP, and because the foot moves along
the road by t . dP / (1 - k e), limits that vary along s enter with their slope.
"""

from __future__ import annotations

import numpy as np

from hdvplan.jit import FloatArray, compiled
from hdvplan.planning.limits import linearise_limits
from hdvplan.road.path import project
from hdvplan.vehicle.kinematics import derivative, jacobian, place, point_gradient


@compiled
def advance(
    units: FloatArray, k: float, k_between: float, step: float, midpoint: bool, z: FloatArray, kappa: float, out: FloatArray,
    work: FloatArray,
) -> None:  # fmt: skip
    """Write the state one station ahead into ``out`` (n,), active wheels held: explicit midpoint rule, or Euler as in [GEO].

    ``work`` has shape (2, n).
    """
    n = z.size
    derivative(units, k, z, kappa, work[0])
    if midpoint:
        for j in range(n):
            work[1, j] = z[j] + 0.5 * step * work[0, j]
        derivative(units, k_between, work[1], kappa, work[0])
    for j in range(n):
        out[j] = z[j] + step * work[0, j]


@compiled
def linearise_dynamics(
    units: FloatArray, road: FloatArray, k_between: FloatArray, step: float, midpoint: bool, z: FloatArray, kappa: FloatArray,
    begin: int, A: FloatArray, B: FloatArray, c: FloatArray,
) -> None:  # fmt: skip
    """Write A, B, c of the first interval and of those from ``begin`` on.

    They say dz_{i+1} = A dz_i + B d kappa_i + defect, with kappa_i = kappa_{i-1} + u_i as the last state. An active axle's wheels turn
    evenly between stations, by the motion's change of their angle and an input of their own.
    """
    n, rigid = z.shape[1], 1 + units.shape[0]
    f, a, b = np.empty(n), np.empty((n, n)), np.empty(n)
    a_first, b_first, middle = np.empty((n, n)), np.empty(n), np.empty(n)
    scratch = np.empty((3, n + 1))
    for i in range(kappa.size):
        if 0 < i < begin:
            continue
        jacobian(units, road[4, i], z[i], kappa[i], f, a, b, scratch)
        if midpoint:
            for j in range(n):
                middle[j] = z[i, j] + 0.5 * step * f[j]
            for j in range(rigid, n):
                middle[j] = 0.5 * (z[i, j] + z[i + 1, j])
            for j in range(n):  # loops: numba takes seconds to compile each slice assignment
                b_first[j] = b[j]
                for k in range(n):
                    a_first[j, k] = a[j, k]
            jacobian(units, k_between[i], middle, kappa[i], f, a, b, scratch)
        for j in range(n):
            b_total = b[j]
            for k in range(n):
                a_total = a[j, k]
                if midpoint:
                    for m in range(n):
                        a_total += 0.5 * step * a[j, m] * a_first[m, k]
                    b_total += 0.5 * step * a[j, k] * b_first[k]
                A[i, j, k] = step * a_total
            A[i, j, j] += 1.0
            A[i, j, n] = step * b_total
            B[i, j, 0] = step * b_total
            c[i, j] = z[i, j] + step * f[j] - z[i + 1, j]
        for wheel in range(rigid, n):
            for j in range(rigid):
                B[i, j, 1 + wheel - rigid] = 0.5 * step * a[j, wheel] if midpoint else 0.0
            c[i, wheel] = 0.0


@compiled
def linearise_objective(
    units: FloatArray, axle: int, coefficients: FloatArray, s_first: float, spacing: float, road: FloatArray, z: FloatArray,
    lead: FloatArray, aux: FloatArray, target: FloatArray, feet: FloatArray,
    begin: int, end: int, Q: FloatArray, q: FloatArray,
) -> int:  # fmt: skip
    """Write Q, q of (lead e_y + aux e_aux - target)^2 at stages begin <= i < end; return -1, or the stage whose point has no foot.

    ``axle`` as in ``Residual``. ``feet`` (N+1,) holds the last feet of the auxiliary axle and is updated.
    """
    unit, n = axle if axle >= 0 else units.shape[0] - 1, z.shape[1]
    ahead = units[0, 0] if unit == 0 else 0.0  # front axle of the lead unit, own axle of a trailer
    poses, gradient = np.empty((units.shape[0], 6)), np.empty(n)
    for i in range(begin, end):
        place(units, road[0, i], road[1, i], road[2, i], road[3, i], z[i], poses)
        x, y = poses[unit, 0] + ahead * poses[unit, 2], poses[unit, 1] + ahead * poses[unit, 3]
        feet[i], offset, cos, sin, _ = project(coefficients, s_first, spacing, x, y, feet[i])
        if np.isnan(offset):
            return i
        point_gradient(poses, unit, x, y, road[2, i], road[3, i], -sin, cos, gradient)
        for j in range(n):
            gradient[j] *= aux[i]
        gradient[0] += lead[i]
        residual = lead[i] * z[i, 0] + aux[i] * offset - target[i]
        for j in range(n):
            q[i, j] = 2.0 * gradient[j] * residual
            for k in range(n):
                Q[i, j, k] = 2.0 * gradient[j] * gradient[k]
    return -1


@compiled
def linearise(
    units: FloatArray, axle: int,
    points: FloatArray, axis: FloatArray, coefficients: FloatArray, s_first: float, spacing: float, road: FloatArray,
    k_between: FloatArray, around: FloatArray, step: float, midpoint: bool, lead: FloatArray, aux: FloatArray, target: FloatArray,
    limits: FloatArray, limit_first: float, limit_spacing: float, margin: FloatArray, z: FloatArray, kappa: FloatArray,
    aux_feet: FloatArray, axis_feet: FloatArray, feet: FloatArray, gaps: FloatArray, begin: int, A: FloatArray, B: FloatArray,
    c: FloatArray, Q: FloatArray, q: FloatArray, G: FloatArray, h: FloatArray,
) -> int:  # fmt: skip
    """Linearise everything from stage ``begin`` >= 1 on, and the interval that leads away from the given first state.

    Returns -1, or a stage with a point that has no foot. One kernel, because each call from Python costs as much as 100 stages.
    """
    linearise_dynamics(units, road, k_between, step, midpoint, z, kappa, begin - 1, A, B, c)
    lost = linearise_objective(units, axle, coefficients, s_first, spacing, road, z, lead, aux, target, aux_feet, begin, z.shape[0], Q, q)
    if lost < 0 and limits.size > 0:
        lost = linearise_limits(
            units, points, axis, coefficients, s_first, spacing, road, limits, limit_first, limit_spacing, around, margin, z, axis_feet,
            feet, gaps, begin, z.shape[0], G, h,
        )  # fmt: skip
    return lost


@compiled
def write_inputs(
    kappa: FloatArray, kappa_before: float, max_curvature: float, max_change: float, smoothness: float, R: FloatArray, r: FloatArray,
    x_low: FloatArray, x_high: FloatArray, u_low: FloatArray, u_high: FloatArray,
) -> None:  # fmt: skip
    """Write the smoothness cost w (kappa_i - kappa_{i-1})^2 and the limits of curvature and its change."""
    before = kappa_before
    for i in range(kappa.size):
        change = kappa[i] - before
        R[i, 0, 0], r[i, 0] = 2.0 * smoothness, 2.0 * smoothness * change
        u_low[i, 0], u_high[i, 0] = -max_change - change, max_change - change
        x_low[i, 0], x_high[i, 0] = -max_curvature - kappa[i], max_curvature - kappa[i]
        before = kappa[i]
