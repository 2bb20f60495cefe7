"""How tightly a vehicle turns, from the sizes of its tightest turn that data sheets give."""

from __future__ import annotations

import numpy as np

from hdvplan.errors import VehicleError
from hdvplan.vehicle.model import MOST_CURVATURE, Unit

_LARGEST_RADIUS_M = 1e6


def tightest(way: str, size: float, unit: Unit, where: str) -> float:
    """Return the largest curvature [1/m] of a lead unit from ``size`` [m], its ``turning_radius`` or ``turning_circle``.

    The one is the least radius of the front axle's middle, the other the diameter of the circle between walls.

    Raises:
        VehicleError: no vehicle of these dimensions turns so, in words that begin with ``where``.

    """
    if unit.steering_ratio > 0.0:
        return _steered(way, size, unit, where)
    if way == "turning_circle":
        return _between_walls(size, unit, where)
    least = float(np.hypot(unit.wheelbase, 1.0 / MOST_CURVATURE))
    if not least < size <= _LARGEST_RADIUS_M:
        limit = f"larger than {least:.2f} m for this wheelbase" if size <= least else f"at most {_LARGEST_RADIUS_M:g} m"
        msg = f"{where}: turning_radius = {size:g} m must be {limit}"
        raise VehicleError(msg, field="turning_radius", hint="it is the least radius of the middle of the front axle")
    return float(1.0 / (size**2 - unit.wheelbase**2) ** 0.5)


def _between_walls(diameter: float, unit: Unit, where: str) -> float:
    """Return the largest curvature of the rear axle's path from the diameter of the circle that the outer front corner draws."""
    front = unit.wheelbase + unit.front_overhang
    inner = max(0.5 * unit.width, 1.0 / MOST_CURVATURE)  # at least: then the rear axle turns about its inner end
    least = 2.0 * float(np.hypot(front, 0.5 * unit.width + inner))
    if not least < diameter <= 2.0 * _LARGEST_RADIUS_M:
        limit = f"larger than {least:.2f} m for these dimensions" if diameter <= least else f"at most {2.0 * _LARGEST_RADIUS_M:g} m"
        msg = f"{where}: turning_circle = {diameter:g} m must be {limit}"
        raise VehicleError(msg, field="turning_circle", hint="it is the diameter of the turning circle between walls")
    return float(1.0 / (((0.5 * diameter) ** 2 - front**2) ** 0.5 - 0.5 * unit.width))


def _steered(way: str, size: float, unit: Unit, where: str) -> float:
    """Return the largest curvature of a unit whose rear axle is steered as well, from either size of its tightest turn [m].

    The unit turns about a point ahead of its rear axle, so that the corner furthest out may be a rear one.
    """

    def turned(kappa: float) -> float:
        front = unit.wheelbase * kappa  # tangents of both axles' angles
        rear = float(np.tan(min(unit.steering_ratio * np.arctan(front), unit.max_steering_angle)))
        aside = unit.wheelbase / (front + rear)
        ahead, out = aside * rear, aside + 0.5 * unit.width
        if way == "turning_radius":
            return float(np.hypot(unit.wheelbase - ahead, aside))
        return 2.0 * float(np.hypot(max(unit.wheelbase + unit.front_overhang - ahead, unit.rear_overhang + ahead), out))

    least, straightest = turned(MOST_CURVATURE), 1.0 / _LARGEST_RADIUS_M
    if not least < size < turned(straightest):
        msg = f"{where}: {way} = {size:g} m must be larger than {least:.2f} m for these axles, and below {_LARGEST_RADIUS_M:g} m"
        raise VehicleError(msg, field=way, hint="of a steered rear axle max_curvature is tan(front wheels' angle) / wheelbase [1/m]")
    from scipy.optimize import brentq  # noqa: PLC0415 - few vehicles need it, and all commands load one

    return float(brentq(lambda kappa: turned(kappa) - size, straightest, MOST_CURVATURE))
