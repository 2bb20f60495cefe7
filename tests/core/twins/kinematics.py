"""The motion of a chain and where it is, see ``core/kinematics.h``."""

import numpy as np

from hdvplan.arrays import FloatArray, Records


def wheels(unit: np.void, angle: float) -> float:
    """Return tan(delta) of a unit's axle that is steered by ``angle``."""
    return float(-np.tan(np.clip(unit["steering_ratio"] * angle, -unit["max_steering_angle"], unit["max_steering_angle"])))


def rear_wheels(units: Records, kappa: float) -> float:
    """Return tan(delta) of the lead rear axle."""
    return wheels(units[0], float(np.arctan(units[0]["wheelbase"] * kappa)))


def rates(units: Records, k: float, z: FloatArray, kappa: float) -> FloatArray:
    """Return dz/ds, [GEO] eqs. 2 and 6 for any chain."""
    rear = rear_wheels(units, kappa)
    travelled = (1.0 - z[0] * k) / (np.cos(z[1]) - np.sin(z[1]) * rear)
    velocity, turn = np.array([1.0, rear]), kappa - rear / units[0]["wheelbase"]
    f = np.zeros(len(z))
    f[:2] = travelled * (np.sin(z[1]) + np.cos(z[1]) * rear), travelled * turn - k
    for i in range(1, len(units)):
        cos, sin = np.cos(z[1 + i]), np.sin(z[1 + i])
        coupling = np.array([[cos, -sin], [sin, cos]]) @ (velocity - [0.0, units[i - 1]["hitch_offset"] * turn])
        velocity = coupling[0] * np.array([1.0, wheels(units[i], z[units[i]["steered_by"]])])
        behind = (coupling[1] - velocity[1]) / units[i]["wheelbase"]
        f[1 + i], turn = travelled * (turn - behind), behind
    return f


def places(units: Records, point: FloatArray, z: FloatArray) -> FloatArray:
    """Return x, y of the axle, cosine and sine of the heading of every unit, shape (units, 4); ``point`` is the road's x, y, cos, sin."""
    heading = np.arctan2(point[3], point[2])
    axle, found = point[:2] + z[0] * np.array([-np.sin(heading), np.cos(heading)]), []
    heading += z[1]
    for i, unit in enumerate(units):
        if i > 0:
            axle = axle - units[i - 1]["hitch_offset"] * np.array([np.cos(heading), np.sin(heading)])
            heading -= z[1 + i]
            axle = axle - unit["wheelbase"] * np.array([np.cos(heading), np.sin(heading)])
        found.append([*axle, np.cos(heading), np.sin(heading)])
    return np.array(found)


def couplings(units: Records, axles: FloatArray) -> FloatArray:
    """Return x, y of every unit's coupling to the unit ahead, of the lead unit its axle; ``axles`` as ``places`` returns them."""
    ahead = np.where(np.arange(len(units)) > 0, units["wheelbase"], 0.0)
    found: FloatArray = axles[:, :2] + ahead[:, None] * axles[:, 2:]
    return found


def body_point(axle: FloatArray, ahead: float, left: float) -> FloatArray:
    """Return x, y of the point of a body so far ahead of its axle and left of its axis."""
    cos, sin = axle[2:]
    return np.array([axle[0] + ahead * cos - left * sin, axle[1] + ahead * sin + left * cos])


def gradient(units: Records, axles: FloatArray, unit: int, at: FloatArray, normal: FloatArray, along: FloatArray, n: int) -> FloatArray:
    """Return the derivative by z (n,) of the motion of a point of ``unit`` along a direction; ``normal`` is the road's at the lead axle."""
    found, about = np.zeros(n), couplings(units, axles)[: unit + 1]
    turned = (at - about)[:, ::-1] * [-1.0, 1.0] @ along
    found[0], found[1], found[2 : 2 + unit] = normal @ along, turned[0], -turned[1:]
    return found
