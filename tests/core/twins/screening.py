"""Bounds by which bodies are clear of all limits, see ``core/screening.c``."""

import numpy as np

from hdvplan.arrays import FloatArray, Records
from hdvplan.road.path import ReferencePath
from tests.core.twins.kinematics import body_point
from tests.core.twins.path import PLANNING_STEP_M, Record, project

CLEAR, BULGING = 0.25, 0.5  # m of room, curvature times reach


def highest(e: float, slope: float, bend: float, x: float) -> float:
    """Return the maximum of e + slope t + bend t^2 / 2 over t between 0 and x."""
    places = [0.0, x]
    if bend < 0.0 and 0.0 < -slope / bend * np.sign(x) < abs(x):
        places.append(-slope / bend)
    return max(e + slope * t + 0.5 * bend * t * t for t in places)


def clear_by_state(units: Records, at: Record, z: FloatArray) -> float:
    """Return a bound of the clearance of all bodies from the state alone; minus infinity where it says nothing."""
    reach, k_most = max(at["room_left"], at["room_right"]), max(abs(at["k_low"]), abs(at["k_high"]))
    if k_most * reach > BULGING:
        return -np.inf
    most, least = 1.0 / (1.0 - k_most * reach), 1.0 / (1.0 + k_most * reach)
    e, phi, clearance = np.array([z[0], z[0]]), np.array([z[1], z[1]]), np.inf  # lower and upper bounds
    for number, unit in enumerate(units):
        behind = unit["wheelbase"] if number > 0 else 0.0
        rear, front, coupling = -behind - unit["rear_overhang"], unit["front"] - behind, -behind - unit["hitch_offset"]
        steep = max(abs(phi)) + max(front, -rear, -coupling) * k_most * most
        if steep > 1.0 or e[1] > reach or e[0] < -reach:
            return -np.inf
        flat = np.cos(steep) ** 2 * least
        bend = np.array([-at["k_high"] * (most if at["k_high"] > 0.0 else flat), -at["k_low"] * (flat if at["k_low"] > 0.0 else most)])
        slope = np.sin(phi)
        high = max(highest(e[1], slope[0], bend[1], rear), highest(e[1], slope[1], bend[1], front))
        low = -max(highest(-e[0], -slope[1], -bend[0], rear), highest(-e[0], -slope[0], -bend[0], front))
        clearance = min(clearance, at["room_left"] - high - unit["half_width"], at["room_right"] + low - unit["half_width"])
        if clearance <= CLEAR:
            return -np.inf
        if number + 1 < len(units):
            e = e + coupling * (slope if coupling > 0.0 else slope[::-1]) + 0.5 * coupling**2 * bend
            phi = phi + np.sort(coupling * bend) - z[2 + number]
    return float(clearance)


def clear_by_axis(
    unit: Record, axis: FloatArray, path: ReferencePath, at: Record, axle: FloatArray, feet: FloatArray
) -> tuple[float, float]:
    """Return bounds of a body's clearance left and right from points of its axis; ``feet`` is warm start and result."""
    offsets = np.empty(len(axis))
    for point, ahead in enumerate(axis):
        x, y = body_point(axle, ahead, 0.0)
        feet[point], offsets[point] = project(path, x, y, feet[point], PLANNING_STEP_M)[:2]
    longest, half = max(np.diff(axis)), unit["half_width"]
    high, low = max(offsets), min(offsets)
    reach = max(high, -low) + 2.0 * half
    bends = np.array([max(at["k_high"], 0.0), max(-at["k_low"], 0.0)])
    if max(bends) * reach > BULGING:
        return -np.inf, -np.inf
    bulge = longest**2 / 8.0 * bends / (1.0 - bends * reach)
    return at["room_left"] - high - half - bulge[0], at["room_right"] + low - half - bulge[1]
