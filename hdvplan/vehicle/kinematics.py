"""The road-aligned kinematics of a lead unit with any number of trailers, with exact derivatives.

State z = (e_y, e_psi, beta_1, ...): lateral and heading error of the lead unit's rear axle, then the articulation angle
at every coupling (heading ahead minus heading behind). Input: the curvature kappa of the lead rear axle's path.
``units`` is ``Vehicle.table()``. Source: [GEO] eqs. 2 and 6; the recursion over couplings is the standard n-trailer.
"""

from __future__ import annotations

import numpy as np

from hdvplan.jit import FloatArray, compiled


@compiled
def derivative(units: FloatArray, road_curvature: float, z: FloatArray, kappa: float, f: FloatArray) -> None:
    """Write dz/ds into ``f`` (states,)."""
    inside = 1.0 - z[0] * road_curvature
    cos = np.cos(z[1])
    travelled = inside / cos  # metres that the lead rear axle rolls per metre of road
    f[0] = inside * np.sin(z[1]) / cos
    f[1] = travelled * kappa - road_curvature
    speed, turn = 1.0, kappa  # of the unit ahead, per metre that the lead rear axle rolls
    for i in range(1, units.shape[0]):
        beta, hitch, length = z[1 + i], units[i - 1, 1], units[i, 0]
        cos_b, sin_b = np.cos(beta), np.sin(beta)
        turn_behind = (speed * sin_b - hitch * turn * cos_b) / length
        f[1 + i] = travelled * (turn - turn_behind)
        speed = speed * cos_b + hitch * turn * sin_b
        turn = turn_behind


@compiled
def jacobian(
    units: FloatArray, road_curvature: float, z: FloatArray, kappa: float, f: FloatArray, a: FloatArray, b: FloatArray, scratch: FloatArray
) -> None:
    """Write dz/ds into ``f`` (n,), its derivatives by z into ``a`` (n, n) and by kappa into ``b`` (n,).

    ``scratch`` has shape (2, n + 1): gradients of speed and turn rate of the unit ahead by z and kappa.
    """
    n = z.size
    inside = 1.0 - z[0] * road_curvature
    cos, sin = np.cos(z[1]), np.sin(z[1])
    travelled = inside / cos
    by_e_y, by_e_psi = -road_curvature / cos, inside * sin / (cos * cos)  # derivatives of ``travelled``
    for row in range(n):  # loops: numba takes seconds to compile each slice assignment
        for column in range(n):
            a[row, column] = 0.0
    f[0] = inside * sin / cos
    a[0, 0] = -road_curvature * sin / cos
    a[0, 1] = inside / (cos * cos)
    b[0] = 0.0
    f[1] = travelled * kappa - road_curvature
    a[1, 0] = by_e_y * kappa
    a[1, 1] = by_e_psi * kappa
    b[1] = travelled
    speed, turn = 1.0, kappa
    for column in range(n):
        scratch[0, column] = scratch[1, column] = 0.0
    scratch[0, n] = 0.0
    scratch[1, n] = 1.0
    for i in range(1, units.shape[0]):
        j, hitch, length = 1 + i, units[i - 1, 1], units[i, 0]
        cos_b, sin_b = np.cos(z[j]), np.sin(z[j])
        speed_behind = speed * cos_b + hitch * turn * sin_b
        turn_behind = (speed * sin_b - hitch * turn * cos_b) / length
        f[j] = travelled * (turn - turn_behind)
        a[j, 0] = by_e_y * (turn - turn_behind)
        a[j, 1] = by_e_psi * (turn - turn_behind)
        for column in range(2, n + 1):
            d_speed, d_turn = scratch[0, column], scratch[1, column]
            d_speed_behind = d_speed * cos_b + hitch * d_turn * sin_b
            d_turn_behind = (d_speed * sin_b - hitch * d_turn * cos_b) / length
            if column == j:
                d_speed_behind += length * -turn_behind
                d_turn_behind += speed_behind / length
            if column < n:
                a[j, column] = travelled * (d_turn - d_turn_behind)
            else:
                b[j] = travelled * (d_turn - d_turn_behind)
            scratch[0, column], scratch[1, column] = d_speed_behind, d_turn_behind
        speed, turn = speed_behind, turn_behind


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
