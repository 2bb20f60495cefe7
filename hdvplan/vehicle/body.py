"""Points of bodies: those that planning constrains, corners, and wheels with their tracks.

A vehicle's model has one axle for every group of axles, and no track width: an axle's tyres count as far out as its body is wide,
so that a track is that of the outer face of the outer tyre. Wheels further in, and those of a group's other axles, run inside
of what the body sweeps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.errors import OptionError
from hdvplan.vehicle.model import Vehicle

POINTS_PER_EDGE = core.number("HDV_POINTS_PER_EDGE")
_SAME_M = 1e-6
_AROUND = np.array([1.0, -1.0, -1.0, 1.0])  # the sides of the corners of a body, from the front left one
# Ahead of the unit's axle [m]; 1 where it belongs to an overhang.
EDGE_POINT = core.record("hdv_edge_point")


def axles_behind(vehicle: Vehicle) -> FloatArray:
    """Return every axle's distance behind the lead rear axle on a straight, shape (units,) [m]."""
    return np.array(vehicle.behind)


def auxiliary_ahead(vehicle: Vehicle, axle: int) -> float:
    """Return how far the auxiliary axle lies ahead of the lead rear axle on a straight [m].

    ``axle`` is the number of its unit (from 0, or -1 for the last); of the lead unit it is the front axle.

    Raises:
        OptionError: the vehicle has no such unit.

    """
    units = range(len(vehicle.units))
    if axle != -1 and axle not in units:
        msg = f"axle {axle}: the vehicle has unit{'s' if units[1:] else ''} {' and '.join(map(str, units))}"
        raise OptionError(msg, hint="-1 is the last")
    return vehicle.lead.wheelbase if units[axle] == 0 else -float(axles_behind(vehicle)[axle])


def edge_points(vehicle: Vehicle) -> Records:
    """Return the sampled points of both long edges of every body, records of ``EDGE_POINT``, shape (units, POINTS_PER_EDGE).

    Corners, axle and front axle (or coupling) always belong; the rest splits the longest gaps. The axle is where a
    body's inner edge comes closest to the inside of a turn, the corners are its furthest points outside ([BUS], sec. IV).
    """
    table = np.empty((len(vehicle.units), POINTS_PER_EDGE), EDGE_POINT)
    for row, unit in zip(table, vehicle.units, strict=True):
        ahead = np.unique([-unit.rear_overhang, 0.0, min(unit.wheelbase, unit.front), unit.front])
        ahead = ahead[np.concatenate([[True], np.diff(ahead) > _SAME_M])]
        while len(ahead) < POINTS_PER_EDGE:
            gap = int(np.argmax(np.diff(ahead)))
            ahead = np.insert(ahead, gap + 1, 0.5 * (ahead[gap] + ahead[gap + 1]))
        row["ahead"] = ahead
        row["overhang"] = (ahead < -_SAME_M) | (ahead > unit.wheelbase + _SAME_M)
    return table


def axle_points(vehicle: Vehicle) -> Records:
    """Return the axles that objectives centre, laid out as ``edge_points``.

    A single unit's rear and front axle; in a chain every unit's own.
    """
    table = np.zeros((len(vehicle.units), 2 if len(vehicle.units) == 1 else 1), EDGE_POINT)
    if len(vehicle.units) == 1:
        table["ahead"][0, 1] = vehicle.lead.wheelbase
    return table


def points_on(poses: Records, ahead: FloatArray | float, left: FloatArray | float) -> FloatArray:
    """Return points ``ahead`` of axles and ``left`` of axes [m] of bodies at ``poses``, shape (..., 2), x, y [m]; all broadcast."""
    x = poses["x"] + ahead * poses["cos"] - left * poses["sin"]
    return np.stack([x, poses["y"] + ahead * poses["sin"] + left * poses["cos"]], axis=-1)


def corners_at(vehicle: Vehicle, poses: Records, *, axles_only: bool = False) -> FloatArray:
    """Return the corners of every body at ``poses`` (n, units), shape (n, units, 4, 2), x, y [m]; ``axles_only`` leaves overhangs out."""
    units = vehicle.table()
    front = np.minimum(units["wheelbase"], units["front"]) if axles_only else units["front"]
    rear = np.zeros(len(units)) if axles_only else -units["rear_overhang"]
    return points_on(poses[..., None], np.stack([front, front, rear, rear], axis=1), units["half_width"][:, None] * _AROUND)


@dataclass(frozen=True)
class Wheel:
    """A wheel on its body: ``ahead`` of the body's axle and ``left`` of its axis [m]."""

    unit: int
    axle: str  # "front" or "rear" of the lead unit, "axle" of a trailer
    side: str  # "left" or "right"
    ahead: float
    left: float


@dataclass(frozen=True)
class WheelTrack:
    """The way of a wheel, shape (n, 2), x, y [m]: one point a pose."""

    wheel: Wheel
    points: FloatArray


def wheels_of(vehicle: Vehicle) -> tuple[Wheel, ...]:
    """Return the outer wheels of all axles, from the front, left before right."""
    found = []
    for number, unit in enumerate(vehicle.units):
        axles = {"front": unit.wheelbase, "rear": 0.0} if number == 0 else {"axle": 0.0}
        for axle, ahead in axles.items():
            found += [Wheel(number, axle, side, ahead, half) for side, half in (("left", 0.5 * unit.width), ("right", -0.5 * unit.width))]
    return tuple(found)


def tracks_at(vehicle: Vehicle, poses: Records) -> tuple[WheelTrack, ...]:
    """Return the track of every outer wheel at ``poses`` (n, units), in the order of ``wheels_of``."""
    return tuple(WheelTrack(wheel, points_on(poses[:, wheel.unit], wheel.ahead, wheel.left)) for wheel in wheels_of(vehicle))
