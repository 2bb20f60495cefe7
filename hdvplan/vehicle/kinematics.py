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

from hdvplan.jit import FloatArray, Record, Records, compiled, inlined, inner

# Where a unit is in the plane: its axle, its heading, and its coupling to the unit ahead [m]. The lead unit turns about its own axle,
# so its "coupling" is that axle. And how it stands to what is ahead: to the road, or by its articulation angle.
POSE = np.dtype([(name, float) for name in ("x", "y", "cos", "sin", "coupling_x", "coupling_y", "turned_cos", "turned_sin")])


@inner
def wheels(unit: Record, angle: float) -> tuple[float, float]:
    """Return tan(delta) of a unit's axle and its derivative by the ``angle`` [rad] that steers it."""
    ratio, most = unit.steering_ratio, unit.max_steering_angle
    if ratio == 0.0:
        return 0.0, 0.0
    if abs(ratio * angle) >= most:
        return -np.copysign(np.tan(most), angle), 0.0
    tan = -np.tan(ratio * angle)
    return tan, -ratio * (1.0 + tan * tan)


@inlined
def rear_wheels(units: Records, kappa: float) -> tuple[float, float]:
    """Return tan(delta) of the lead rear axle and its derivative by ``kappa`` [1/m]."""
    lead = units[0]
    if lead.steering_ratio == 0.0:
        return 0.0, 0.0
    tan_front = lead.wheelbase * kappa
    tan, slope = wheels(lead, np.arctan(tan_front))
    return tan, slope * lead.wheelbase / (1.0 + tan_front * tan_front)


@compiled
def derivative(units: Records, road_curvature: float, z: FloatArray, kappa: float, f: FloatArray) -> None:
    """Write dz/ds into ``f`` (states,)."""
    sideways, _ = rear_wheels(units, kappa)  # of the unit ahead's axle, as ``forward`` and ``turn``
    cos, sin = np.cos(z[1]), np.sin(z[1])
    travelled = (1.0 - z[0] * road_curvature) / (cos - sin * sideways)  # metres that the lead body moves forward per metre of road
    forward, turn = 1.0, kappa - sideways / units[0].wheelbase
    f[0] = travelled * (sin + cos * sideways)
    f[1] = travelled * turn - road_curvature
    for i in range(1, units.size):
        unit, beta = units[i], z[1 + i]
        cos_b, sin_b = np.cos(beta), np.sin(beta)
        across = sideways - units[i - 1].hitch_offset * turn  # of the coupling, in the axes of the body ahead
        tan, _ = wheels(unit, z[unit.steered_by])
        forward_behind = forward * cos_b - across * sin_b
        turn_behind = (forward * sin_b + across * cos_b - forward_behind * tan) / unit.wheelbase
        f[1 + i] = travelled * (turn - turn_behind)
        forward, sideways, turn = forward_behind, forward_behind * tan, turn_behind
    for i in range(1 + units.size, z.size):
        f[i] = 0.0


@inlined
def jacobian(
    units: Records, road_curvature: float, z: FloatArray, kappa: float, poses: Records, f: FloatArray, a: FloatArray, b: FloatArray,
    chain: FloatArray,
) -> None:  # fmt: skip
    """Write dz/ds into ``f`` (n,), its derivatives by z into ``a`` (n, n) and by kappa into ``b`` (n,).

    ``poses`` hold the sines and cosines of z, see ``turn``: they cost as much as the rest. ``chain`` (3, n + 1) is memory: gradients of
    forward and sideways velocity and turn rate of the unit ahead by z and kappa.
    """
    n = z.size
    inside = 1.0 - z[0] * road_curvature
    cos, sin = poses[0].turned_cos, poses[0].turned_sin
    sideways, by_kappa = rear_wheels(units, kappa)
    along, off = cos - sin * sideways, sin + cos * sideways  # the lead rear axle's velocity along and across the road
    travelled = inside / along
    by_e_y, by_e_psi = -road_curvature / along, inside * off / (along * along)  # derivatives of ``travelled``
    by_wheels = inside * sin / (along * along) * by_kappa
    for row in range(n):  # loops: numba takes seconds to compile each slice assignment
        for column in range(n):
            a[row, column] = 0.0
    forward, turn, d_kappa = 1.0, kappa - sideways / units[0].wheelbase, 1.0 - by_kappa / units[0].wheelbase
    f[0] = travelled * off
    a[0, 0] = by_e_y * off
    a[0, 1] = travelled * along + by_e_psi * off
    b[0] = travelled / along * by_kappa
    f[1] = travelled * turn - road_curvature
    a[1, 0] = by_e_y * turn
    a[1, 1] = by_e_psi * turn
    b[1] = travelled * d_kappa + by_wheels * turn
    for column in range(n):
        chain[0, column] = chain[1, column] = chain[2, column] = 0.0
    chain[0, n], chain[1, n], chain[2, n] = 0.0, by_kappa, d_kappa
    for i in range(1, units.size):
        j, unit, hitch = 1 + i, units[i], units[i - 1].hitch_offset
        cos_b, sin_b = poses[i].turned_cos, poses[i].turned_sin
        across = sideways - hitch * turn
        forward_behind, across_behind = forward * cos_b - across * sin_b, forward * sin_b + across * cos_b
        tan, by_angle = wheels(unit, z[unit.steered_by])
        turn_behind = (across_behind - forward_behind * tan) / unit.wheelbase
        f[j] = travelled * (turn - turn_behind)
        a[j, 0] = by_e_y * (turn - turn_behind)
        a[j, 1] = by_e_psi * (turn - turn_behind)
        for column in range(2, n + 1):
            if j < column <= units.size:  # the couplings behind
                continue
            d_forward, d_across, d_turn = chain[0, column], chain[1, column] - hitch * chain[2, column], chain[2, column]
            d_forward_behind, d_across_behind = d_forward * cos_b - d_across * sin_b, d_forward * sin_b + d_across * cos_b
            d_tan = 0.0
            if column == j:
                d_forward_behind -= across_behind
                d_across_behind += forward_behind
            if column == unit.steered_by:
                d_tan = by_angle
            d_sideways = d_forward_behind * tan + forward_behind * d_tan
            d_turn_behind = (d_across_behind - d_sideways) / unit.wheelbase
            if column < n:
                a[j, column] = travelled * (d_turn - d_turn_behind)
            else:
                b[j] = travelled * (d_turn - d_turn_behind) + by_wheels * (turn - turn_behind)
            chain[0, column], chain[1, column], chain[2, column] = d_forward_behind, d_sideways, d_turn_behind
        forward, sideways, turn = forward_behind, forward_behind * tan, turn_behind
    for i in range(1 + units.size, n):
        f[i] = b[i] = 0.0


@inner
def turn(units: Records, z: FloatArray, poses: Records) -> None:
    """Write the sine and cosine of e_psi, and of every articulation angle, into ``poses`` (units,)."""
    for i in range(units.size):
        pose, angle = poses[i], z[1 + i]
        pose.turned_cos, pose.turned_sin = np.cos(angle), np.sin(angle)


@inlined
def place(units: Records, x: float, y: float, heading_cos: float, heading_sin: float, z: FloatArray, poses: Records) -> None:
    """Write every unit's pose into ``poses`` (units,), records of ``POSE``.

    (x, y) and (cos, sin) belong to the road's point at the lead rear axle's s.
    """
    turn(units, z, poses)
    cos = heading_cos * poses[0].turned_cos - heading_sin * poses[0].turned_sin
    sin = heading_sin * poses[0].turned_cos + heading_cos * poses[0].turned_sin
    axle_x, axle_y = x - z[0] * heading_sin, y + z[0] * heading_cos
    hitch_x, hitch_y = axle_x, axle_y
    for i in range(units.size):
        if i > 0:
            hitch_x, hitch_y = axle_x - units[i - 1].hitch_offset * cos, axle_y - units[i - 1].hitch_offset * sin
            cos_b, sin_b = poses[i].turned_cos, poses[i].turned_sin
            cos, sin = cos * cos_b + sin * sin_b, sin * cos_b - cos * sin_b
            axle_x, axle_y = hitch_x - units[i].wheelbase * cos, hitch_y - units[i].wheelbase * sin
        pose = poses[i]
        pose.x, pose.y, pose.cos, pose.sin, pose.coupling_x, pose.coupling_y = axle_x, axle_y, cos, sin, hitch_x, hitch_y


@inlined
def body_point(pose: Record, ahead: float, left: float) -> tuple[float, float]:
    """Return x, y [m] of the point of a body that lies ``ahead`` of its axle and ``left`` of its axis [m]."""
    return pose.x + ahead * pose.cos - left * pose.sin, pose.y + ahead * pose.sin + left * pose.cos


@inlined
def point_gradient(
    poses: Records, unit: int, x: float, y: float, road: Record, along_x: float, along_y: float, gradient: FloatArray
) -> None:
    """Write the derivative by z of the motion of body point (x, y) of ``unit`` in direction (along_x, along_y).

    ``road`` has the heading (cos, sin) of the road at the lead rear axle's s: e_y moves every point along that normal. ``gradient``
    may be longer than z: all but the entries of e_y, e_psi and the couplings ahead of the point are zero.
    """
    for j in range(gradient.size):
        gradient[j] = 0.0
    gradient[0] = -road.sin * along_x + road.cos * along_y
    gradient[1] = -(y - poses[0].y) * along_x + (x - poses[0].x) * along_y
    for i in range(1, unit + 1):
        gradient[1 + i] = (y - poses[i].coupling_y) * along_x - (x - poses[i].coupling_x) * along_y
