"""Write one planning step's QP: dynamics, centring objective and body limits, linearised at a given motion.

Variables of the QP are deviations from that motion: x_i = (dz_i, d kappa_{i-1}), u_i = change of kappa_i - kappa_{i-1}.
Offsets of body points are exact projections on the road; their derivative is n . dP, and because the foot moves along
the road by t . dP / (1 - k e), limits that vary along s enter with their slope.
"""

from __future__ import annotations

import numpy as np

from hdvplan.jit import FloatArray, compiled
from hdvplan.road.path import project
from hdvplan.vehicle.kinematics import derivative, jacobian, place, point_gradient

CLEAR_M = 0.25  # a body that stays this far inside the limits by a safe bound needs no rows of its own
_BULGING = 0.5  # curvature times reach up to which a body is screened
ROWS_PER_EDGE = 2  # the tightest points of each edge that enter the QP; all points are checked after the solve


@compiled
def advance(
    units: FloatArray, k: float, k_between: float, step: float, midpoint: bool, z: FloatArray, kappa: float, out: FloatArray,
    work: FloatArray,
) -> None:  # fmt: skip
    """Write the state one station ahead into ``out`` (n,): explicit midpoint rule, or Euler as in [GEO].

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

    They say dz_{i+1} = A dz_i + B d kappa_i + defect, with kappa_i = kappa_{i-1} + u_i as the last state.
    """
    n = z.shape[1]
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
def limit_at(limits: FloatArray, s_first: float, spacing: float, row: int, s: float) -> tuple[float, float]:
    """Return a limit and its slope along s: linear between the table's entries, constant beyond them."""
    place_ = (s - s_first) / spacing
    index = min(max(int(place_), 0), limits.shape[1] - 2)
    low, high = limits[row, index], limits[row, index + 1]
    part = place_ - index
    if part <= 0.0:
        return low, 0.0 if part < 0.0 else (high - low) / spacing
    if part > 1.0:
        return high, 0.0
    return low + part * (high - low), (high - low) / spacing


@compiled
def _highest(e: float, slope: float, bend: float, x: float) -> float:
    """Return the maximum of e + slope t + bend t^2 / 2 over t between 0 and x."""
    highest = max(e, e + x * (slope + 0.5 * bend * x))
    if bend < 0.0 and 0.0 < -slope / bend * np.sign(x) < abs(x):
        highest = e - 0.5 * slope * slope / bend
    return highest


@compiled
def _clear_by_state(units: FloatArray, around: FloatArray, i: int, z: FloatArray) -> float:
    """Return a lower bound of all bodies' clearance from the state alone, or -inf where the bound says nothing.

    Along a body's axis the offset e and the heading error phi obey e' = sin(phi), phi' = -cos(phi) k / (1 - k e). From bounds
    of k around the vehicle follow bounds of e'' and of phi', from coupling to coupling. No point needs to be projected.
    """
    room_left, room_right, k_low, k_high = around[0, i], around[1, i], around[2, i], around[3, i]
    reach, k_most = max(room_left, room_right), max(abs(k_low), abs(k_high))
    if k_most * reach > _BULGING:
        return -np.inf
    most, least = 1.0 / (1.0 - k_most * reach), 1.0 / (1.0 + k_most * reach)
    e_low = e_high = z[0]
    phi_low = phi_high = z[1]
    clearance = np.inf
    for unit in range(units.shape[0]):
        behind = units[unit, 0] if unit > 0 else 0.0  # of the axle behind the point whose offset is known
        rear, front, coupling = -behind - units[unit, 3], units[unit, 2] - behind, -behind - units[unit, 1]
        steep = max(abs(phi_low), abs(phi_high)) + max(front, -rear, -coupling) * k_most * most
        if steep > 1.0 or e_high > reach or e_low < -reach:
            return -np.inf
        cos = np.cos(steep)
        upper = -k_low * (cos * cos * least if k_low > 0.0 else most)  # bounds of e'' and of phi'
        lower = -k_high * (most if k_high > 0.0 else cos * cos * least)
        slope_low, slope_high = np.sin(phi_low), np.sin(phi_high)
        high = max(_highest(e_high, slope_low, upper, rear), _highest(e_high, slope_high, upper, front))
        low = -max(_highest(-e_low, -slope_high, -lower, rear), _highest(-e_low, -slope_low, -lower, front))
        clearance = min(clearance, room_left - high - units[unit, 4], room_right + low - units[unit, 4])
        if not clearance > CLEAR_M:
            return -np.inf
        if unit + 1 < units.shape[0]:
            x, ahead = coupling, coupling > 0.0
            e_high += x * (slope_high if ahead else slope_low) + 0.5 * x * x * upper
            e_low += x * (slope_low if ahead else slope_high) + 0.5 * x * x * lower
            phi_high += max(x * upper, x * lower) - z[2 + unit]
            phi_low += min(x * upper, x * lower) - z[2 + unit]
    return clearance


@compiled
def _clearances(
    units: FloatArray, axis: FloatArray, coefficients: FloatArray, s_first: float, spacing: float, around: FloatArray, poses: FloatArray,
    unit: int, i: int, feet: FloatArray,
) -> tuple[float, float]:  # fmt: skip
    """Return lower bounds of a body's clearance left and right at stage i; NaN where a point of its axis has no foot.

    Along a straight line the offset e obeys e'' = -cos^2 k / (1 - k e): between points of the body's axis it lies within
    k l^2 / 8 (1 - k e) of their chord, to the left in a left bend and to the right in a right one.
    """
    high, low, longest = -np.inf, np.inf, 0.0
    for point in range(axis.shape[1]):
        ahead = axis[unit, point]
        x, y = poses[unit, 0] + ahead * poses[unit, 2], poses[unit, 1] + ahead * poses[unit, 3]
        feet[i, unit, point], e, _, _, _ = project(coefficients, s_first, spacing, x, y, feet[i, unit, point])
        if np.isnan(e):
            return e, e
        high, low = max(high, e), min(low, e)
        if point > 0:
            longest = max(longest, ahead - axis[unit, point - 1])
    half, reach = units[unit, 4], max(high, -low) + 2.0 * units[unit, 4]
    left, right = max(around[3, i], 0.0), max(-around[2, i], 0.0)
    if max(left, right) * reach > _BULGING:  # too close to the centre of curvature for the bound to be worth anything
        return -np.inf, -np.inf
    bulge_left = 0.125 * longest * longest * left / (1.0 - left * reach)
    bulge_right = 0.125 * longest * longest * right / (1.0 - right * reach)
    return around[0, i] - high - half - bulge_left, around[1, i] + low - half - bulge_right


@compiled
def linearise_limits(
    units: FloatArray, points: FloatArray, axis: FloatArray, coefficients: FloatArray, s_first: float, spacing: float, road: FloatArray,
    limits: FloatArray, limit_first: float, limit_spacing: float, around: FloatArray, margin: float, z: FloatArray,
    axis_feet: FloatArray, feet: FloatArray, gaps: FloatArray,
    begin: int, end: int, G: FloatArray, h: FloatArray,
) -> int:  # fmt: skip
    """Write the rows G dz <= h of the tightest points of every edge at stages 1 <= begin <= i < end.

    Returns -1, or a stage with a point that has no foot. The first stage is given: rows there would be constants.

    ``feet`` (N+1, units, points, 2) is warm start and result; ``gaps``, same shape, receives every point's clearance [m]
    (left edge, right edge). Bodies that are clear by a bound get that bound as clearance and rows that never bind. Row order
    within a stage: unit, left then right edge, tightest first.
    """
    n, count = z.shape[1], points.shape[1]
    poses, along_n, along_t = np.empty((units.shape[0], 6)), np.empty(n), np.empty(n)
    seen = np.empty((count, 7))  # of every point of one edge: x, y, offset, cos, sin, curvature at the foot, slope of the limit
    picked = np.empty(ROWS_PER_EDGE, np.int64)
    for i in range(begin, end):
        clear = _clear_by_state(units, around, i, z[i]) - margin
        if clear > CLEAR_M:
            for unit in range(units.shape[0]):
                for point in range(count):
                    gaps[i, unit, point, 0] = gaps[i, unit, point, 1] = clear + margin
            for row in range(G.shape[1]):
                h[i - 1, row] = clear
                for j in range(n):
                    G[i - 1, row, j] = 0.0
            continue
        place(units, road[0, i], road[1, i], road[2, i], road[3, i], z[i], poses)
        row = 0
        for unit in range(units.shape[0]):
            x, y, cos_u, sin_u = poses[unit, 0], poses[unit, 1], poses[unit, 2], poses[unit, 3]
            clear_left, clear_right = _clearances(units, axis, coefficients, s_first, spacing, around, poses, unit, i, axis_feet)
            for side in range(2):
                clear = (clear_left if side == 0 else clear_right) - margin
                if clear > CLEAR_M:
                    for point in range(count):
                        gaps[i, unit, point, side] = clear + margin
                    for _ in range(ROWS_PER_EDGE):
                        for j in range(n):
                            G[i - 1, row, j] = 0.0
                        h[i - 1, row] = clear
                        row += 1
                    continue
                sign = 1.0 - 2.0 * side
                across = sign * units[unit, 4]
                picked[0] = picked[1] = -1
                for point in range(count):
                    ahead = points[unit, point, 0]
                    px, py = x + ahead * cos_u - across * sin_u, y + ahead * sin_u + across * cos_u
                    s, e, cos, sin, k = project(coefficients, s_first, spacing, px, py, feet[i, unit, point, side])
                    if np.isnan(e):
                        return i
                    limit, slope = limit_at(limits, limit_first, limit_spacing, side + 2 * int(points[unit, point, 1]), s)
                    gap = sign * (limit - e)
                    feet[i, unit, point, side], gaps[i, unit, point, side] = s, gap
                    seen[point, 0], seen[point, 1], seen[point, 2], seen[point, 3] = px, py, e, cos
                    seen[point, 4], seen[point, 5], seen[point, 6] = sin, k, slope
                    if picked[0] < 0 or gap < gaps[i, unit, picked[0], side]:
                        picked[1] = picked[0]
                        picked[0] = point
                    elif picked[1] < 0 or gap < gaps[i, unit, picked[1], side]:
                        picked[1] = point
                for pick in range(ROWS_PER_EDGE):
                    point = picked[pick]
                    px, py, e, cos = seen[point, 0], seen[point, 1], seen[point, 2], seen[point, 3]
                    sin, k, slope = seen[point, 4], seen[point, 5], seen[point, 6]
                    point_gradient(poses, unit, px, py, road[2, i], road[3, i], -sin, cos, along_n)
                    point_gradient(poses, unit, px, py, road[2, i], road[3, i], cos, sin, along_t)
                    for j in range(n):
                        G[i - 1, row, j] = sign * (along_n[j] - slope * along_t[j] / (1.0 - k * e))
                    h[i - 1, row] = gaps[i, unit, point, side] - margin
                    row += 1
    return -1


@compiled
def linearise(
    units: FloatArray, axle: int,
    points: FloatArray, axis: FloatArray, coefficients: FloatArray, s_first: float, spacing: float, road: FloatArray,
    k_between: FloatArray, around: FloatArray, step: float, midpoint: bool, lead: FloatArray, aux: FloatArray, target: FloatArray,
    limits: FloatArray, limit_first: float, limit_spacing: float, margin: float, z: FloatArray, kappa: FloatArray, aux_feet: FloatArray,
    axis_feet: FloatArray, feet: FloatArray, gaps: FloatArray, begin: int, A: FloatArray, B: FloatArray, c: FloatArray, Q: FloatArray,
    q: FloatArray, G: FloatArray, h: FloatArray,
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
