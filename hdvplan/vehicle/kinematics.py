"""The road-aligned kinematics of a lead unit with any number of trailers, with exact derivatives.

State z = (e_y, e_psi, beta_1, ..., delta_1, ...): lateral error of the lead unit's rear axle, heading error of its body, then the
articulation angle at every coupling (heading ahead minus heading behind), then, of every axle that the plan steers, the angle of its
wheels off its body (left positive); how fast that turns is the plan's to choose, and zero here. Input: kappa = tan(front angle) /
wheelbase, which is the curvature of the lead rear axle's path unless that axle is steered. ``units`` is ``Vehicle.table()``.

Every axle moves along its wheels, at an angle delta off its body: a state, or delta = -ratio * (front angle or beta), held at
+-max_steering_angle. With velocities per metre that the lead body moves forward at its axle, a unit's axle moves (forward,
forward tan(delta)) in the body's axes, and the coupling behind it (forward, forward tan(delta) - hitch turn). Turned by beta
these are the velocities at the coupling of the next unit, whose wheels then decide how fast that turns.
Sources: [GEO] eqs. 2 and 6; without steered axles the recursion over couplings is the standard n-trailer.
"""

from __future__ import annotations

import numpy as np

from hdvplan.jit import FloatArray, compiled


@compiled
def wheels(units: FloatArray, unit: int, angle: float) -> tuple[float, float]:
    """Return tan(delta) of a unit's axle and its derivative by the ``angle`` [rad] that steers it."""
    ratio, most = units[unit, 5], units[unit, 6]
    if ratio == 0.0:
        return 0.0, 0.0
    if abs(ratio * angle) >= most:
        return -np.copysign(np.tan(most), angle), 0.0
    tan = -np.tan(ratio * angle)
    return tan, -ratio * (1.0 + tan * tan)


@compiled
def rear_wheels(units: FloatArray, kappa: float) -> tuple[float, float]:
    """Return tan(delta) of the lead rear axle and its derivative by ``kappa`` [1/m]."""
    if units[0, 5] == 0.0:
        return 0.0, 0.0
    tan_front = units[0, 0] * kappa
    tan, slope = wheels(units, 0, np.arctan(tan_front))
    return tan, slope * units[0, 0] / (1.0 + tan_front * tan_front)


@compiled
def derivative(units: FloatArray, road_curvature: float, z: FloatArray, kappa: float, f: FloatArray) -> None:
    """Write dz/ds into ``f`` (states,)."""
    sideways, _ = rear_wheels(units, kappa)  # of the unit ahead's axle, as ``forward`` and ``turn``
    cos, sin = np.cos(z[1]), np.sin(z[1])
    travelled = (1.0 - z[0] * road_curvature) / (cos - sin * sideways)  # metres that the lead body moves forward per metre of road
    forward, turn = 1.0, kappa - sideways / units[0, 0]
    f[0] = travelled * (sin + cos * sideways)
    f[1] = travelled * turn - road_curvature
    for i in range(1, units.shape[0]):
        beta, length = z[1 + i], units[i, 0]
        cos_b, sin_b = np.cos(beta), np.sin(beta)
        across = sideways - units[i - 1, 1] * turn  # of the coupling, in the axes of the body ahead
        tan, _ = wheels(units, i, z[int(units[i, 7])])
        forward_behind = forward * cos_b - across * sin_b
        turn_behind = (forward * sin_b + across * cos_b - forward_behind * tan) / length
        f[1 + i] = travelled * (turn - turn_behind)
        forward, sideways, turn = forward_behind, forward_behind * tan, turn_behind
    for i in range(1 + units.shape[0], z.size):
        f[i] = 0.0


@compiled
def jacobian(
    units: FloatArray, road_curvature: float, z: FloatArray, kappa: float, f: FloatArray, a: FloatArray, b: FloatArray, scratch: FloatArray
) -> None:
    """Write dz/ds into ``f`` (n,), its derivatives by z into ``a`` (n, n) and by kappa into ``b`` (n,).

    ``scratch`` has shape (3, n + 1): gradients of forward and sideways velocity and turn rate of the unit ahead by z and kappa.
    """
    n = z.size
    inside = 1.0 - z[0] * road_curvature
    cos, sin = np.cos(z[1]), np.sin(z[1])
    sideways, by_kappa = rear_wheels(units, kappa)
    along, off = cos - sin * sideways, sin + cos * sideways  # the lead rear axle's velocity along and across the road
    travelled = inside / along
    by_e_y, by_e_psi = -road_curvature / along, inside * off / (along * along)  # derivatives of ``travelled``
    by_wheels = inside * sin / (along * along) * by_kappa
    for row in range(n):  # loops: numba takes seconds to compile each slice assignment
        for column in range(n):
            a[row, column] = 0.0
    forward, turn, d_kappa = 1.0, kappa - sideways / units[0, 0], 1.0 - by_kappa / units[0, 0]
    f[0] = travelled * off
    a[0, 0] = by_e_y * off
    a[0, 1] = travelled * along + by_e_psi * off
    b[0] = travelled / along * by_kappa
    f[1] = travelled * turn - road_curvature
    a[1, 0] = by_e_y * turn
    a[1, 1] = by_e_psi * turn
    b[1] = travelled * d_kappa + by_wheels * turn
    for column in range(n):
        scratch[0, column] = scratch[1, column] = scratch[2, column] = 0.0
    scratch[0, n], scratch[1, n], scratch[2, n] = 0.0, by_kappa, d_kappa
    for i in range(1, units.shape[0]):
        j, hitch, length = 1 + i, units[i - 1, 1], units[i, 0]
        cos_b, sin_b = np.cos(z[j]), np.sin(z[j])
        across = sideways - hitch * turn
        forward_behind, across_behind = forward * cos_b - across * sin_b, forward * sin_b + across * cos_b
        steers = int(units[i, 7])
        tan, by_angle = wheels(units, i, z[steers])
        turn_behind = (across_behind - forward_behind * tan) / length
        f[j] = travelled * (turn - turn_behind)
        a[j, 0] = by_e_y * (turn - turn_behind)
        a[j, 1] = by_e_psi * (turn - turn_behind)
        for column in range(2, n + 1):
            if j < column <= units.shape[0]:  # the couplings behind
                continue
            d_forward, d_across, d_turn = scratch[0, column], scratch[1, column] - hitch * scratch[2, column], scratch[2, column]
            d_forward_behind, d_across_behind = d_forward * cos_b - d_across * sin_b, d_forward * sin_b + d_across * cos_b
            d_tan = 0.0
            if column == j:
                d_forward_behind -= across_behind
                d_across_behind += forward_behind
            if column == steers:
                d_tan = by_angle
            d_sideways = d_forward_behind * tan + forward_behind * d_tan
            d_turn_behind = (d_across_behind - d_sideways) / length
            if column < n:
                a[j, column] = travelled * (d_turn - d_turn_behind)
            else:
                b[j] = travelled * (d_turn - d_turn_behind) + by_wheels * (turn - turn_behind)
            scratch[0, column], scratch[1, column], scratch[2, column] = d_forward_behind, d_sideways, d_turn_behind
        forward, sideways, turn = forward_behind, forward_behind * tan, turn_behind
    for i in range(1 + units.shape[0], n):
        f[i] = b[i] = 0.0


@compiled
def place(units: FloatArray, x: float, y: float, heading_cos: float, heading_sin: float, z: FloatArray, poses: FloatArray) -> None:
    """Write every unit's pose into ``poses`` (units, 6): axle x, y, heading cos, sin, coupling ahead x, y [m].

    (x, y) and (cos, sin) belong to the road's point at the lead rear axle's s. The lead unit turns about its own axle,
    so its "coupling" is that axle.
    """
    cos_e, sin_e = np.cos(z[1]), np.sin(z[1])
    cos = heading_cos * cos_e - heading_sin * sin_e
    sin = heading_sin * cos_e + heading_cos * sin_e
    axle_x, axle_y = x - z[0] * heading_sin, y + z[0] * heading_cos
    poses[0, 0], poses[0, 1], poses[0, 2], poses[0, 3], poses[0, 4], poses[0, 5] = axle_x, axle_y, cos, sin, axle_x, axle_y
    for i in range(1, units.shape[0]):
        hitch_x, hitch_y = axle_x - units[i - 1, 1] * cos, axle_y - units[i - 1, 1] * sin
        cos_b, sin_b = np.cos(z[1 + i]), np.sin(z[1 + i])
        cos, sin = cos * cos_b + sin * sin_b, sin * cos_b - cos * sin_b
        axle_x, axle_y = hitch_x - units[i, 0] * cos, hitch_y - units[i, 0] * sin
        poses[i, 0], poses[i, 1], poses[i, 2], poses[i, 3], poses[i, 4], poses[i, 5] = axle_x, axle_y, cos, sin, hitch_x, hitch_y


@compiled
def point_gradient(
    poses: FloatArray, unit: int, x: float, y: float, road_cos: float, road_sin: float, along_x: float, along_y: float, gradient: FloatArray
) -> None:
    """Write the derivative by z of the motion of body point (x, y) of ``unit`` in direction (along_x, along_y).

    (road_cos, road_sin) is the road's heading at the lead rear axle's s: e_y moves every point along that normal.
    """
    for j in range(gradient.size):
        gradient[j] = 0.0
    gradient[0] = -road_sin * along_x + road_cos * along_y
    gradient[1] = -(y - poses[0, 1]) * along_x + (x - poses[0, 0]) * along_y
    for i in range(1, unit + 1):
        gradient[1 + i] = (y - poses[i, 5]) * along_x - (x - poses[i, 4]) * along_y
