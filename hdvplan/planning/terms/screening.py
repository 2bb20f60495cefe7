"""Bounds by which a body is clear of all limits without looking at its edges: from the state alone, or from a few points of its axis."""

from __future__ import annotations

import numpy as np

from hdvplan.jit import FloatArray, Record, Records, inner
from hdvplan.road.path import PLANNING_STEP_M, Curve, project
from hdvplan.vehicle.kinematics import body_point

CLEAR_M = 0.25  # a body that stays this far inside the limits by a safe bound needs no rows
_BULGING = 0.5  # curvature times reach up to which a body is screened


@inner
def _highest(e: float, slope: float, bend: float, x: float) -> float:
    """Return the maximum of e + slope t + bend t^2 / 2 over t between 0 and x."""
    highest = max(e, e + x * (slope + 0.5 * bend * x))
    if bend < 0.0 and 0.0 < -slope / bend * np.sign(x) < abs(x):
        highest = e - 0.5 * slope * slope / bend
    return highest


@inner
def clear_by_state(units: Records, at: Record, z: FloatArray) -> float:
    """Return a lower bound of all bodies' clearance from the state alone, or -inf where the bound says nothing.

    ``at`` is the station. Along a body's axis the offset e and the heading error phi obey e' = sin(phi), phi' = -cos(phi) k / (1 - k e).
    From bounds of k around the vehicle follow bounds of e'' and of phi', from coupling to coupling. No point needs to be projected.
    """
    reach, k_most = max(at.room_left, at.room_right), max(abs(at.k_low), abs(at.k_high))
    if k_most * reach > _BULGING:
        return -np.inf
    most, least = 1.0 / (1.0 - k_most * reach), 1.0 / (1.0 + k_most * reach)
    e_low = e_high = z[0]
    phi_low = phi_high = z[1]
    clearance, last = np.inf, units.size - 1
    for number in range(last + 1):
        unit = units[number]
        behind = unit.wheelbase if number > 0 else 0.0  # of the axle behind the point whose offset is known
        rear, front, coupling = -behind - unit.rear_overhang, unit.front - behind, -behind - unit.hitch_offset
        steep = max(abs(phi_low), abs(phi_high)) + max(front, -rear, -coupling) * k_most * most
        if steep > 1.0 or e_high > reach or e_low < -reach:
            return -np.inf
        cos = np.cos(steep)
        upper = -at.k_low * (cos * cos * least if at.k_low > 0.0 else most)  # bounds of e'' and of phi'
        lower = -at.k_high * (most if at.k_high > 0.0 else cos * cos * least)
        slope_low, slope_high = np.sin(phi_low), np.sin(phi_high)
        high = max(_highest(e_high, slope_low, upper, rear), _highest(e_high, slope_high, upper, front))
        low = -max(_highest(-e_low, -slope_high, -lower, rear), _highest(-e_low, -slope_low, -lower, front))
        clearance = min(clearance, at.room_left - high - unit.half_width, at.room_right + low - unit.half_width)
        if not clearance > CLEAR_M:
            return -np.inf
        if number < last:
            x, ahead = coupling, coupling > 0.0
            e_high += x * (slope_high if ahead else slope_low) + 0.5 * x * x * upper
            e_low += x * (slope_low if ahead else slope_high) + 0.5 * x * x * lower
            phi_high += max(x * upper, x * lower) - z[2 + number]
            phi_low += min(x * upper, x * lower) - z[2 + number]
    return clearance


@inner
def clear_by_axis(unit: Record, axis: FloatArray, curve: Curve, at: Record, pose: Record, feet: FloatArray) -> tuple[float, float]:
    """Return lower bounds of a body's clearance left and right; NaN where a point of its axis has no foot.

    Along a straight line the offset e obeys e'' = -cos^2 k / (1 - k e): between points of the body's ``axis`` it lies within
    k l^2 / 8 (1 - k e) of their chord, to the left in a left bend and to the right in a right one.
    """
    high, low, longest = -np.inf, np.inf, 0.0
    for point in range(axis.size):
        x, y = body_point(pose, axis[point], 0.0)
        feet[point], e, _, _, _ = project(curve, x, y, feet[point], PLANNING_STEP_M)
        if np.isnan(e):
            return e, e
        high, low = max(high, e), min(low, e)
        if point > 0:
            longest = max(longest, axis[point] - axis[point - 1])
    half, reach = unit.half_width, max(high, -low) + 2.0 * unit.half_width
    left, right = max(at.k_high, 0.0), max(-at.k_low, 0.0)
    if max(left, right) * reach > _BULGING:  # too close to the centre of curvature for the bound to be worth anything
        return -np.inf, -np.inf
    bulge_left = 0.125 * longest * longest * left / (1.0 - left * reach)
    bulge_right = 0.125 * longest * longest * right / (1.0 - right * reach)
    return at.room_left - high - half - bulge_left, at.room_right + low - half - bulge_right
