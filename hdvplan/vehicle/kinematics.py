"""The road-aligned kinematics of a lead unit with any number of trailers, with exact derivatives, and points of its bodies.

State z = (e_y, e_psi, beta_1, ..., delta_1, ...): lateral error of the lead unit's rear axle, heading error of its body, then the
articulation angle at every coupling (heading ahead minus heading behind), then, of every axle that the plan steers, the angle of its
wheels off its body (left positive); how fast that turns is the plan's to choose, and zero here. Input: kappa = tan(front angle) /
wheelbase, which is the curvature of the lead rear axle's path unless that axle is steered. ``units`` is ``Vehicle.table()``.

Every axle moves along its wheels, at an angle delta off its body: a state, or delta = -ratio * (front angle or beta), held at
+-max_steering_angle. With velocities per metre that the lead body moves forward at its axle, a unit's axle moves (forward,
forward tan(delta)) in the body's axes, and the coupling behind it (forward, forward tan(delta) - hitch turn). Turned by beta
these are the velocities at the coupling of the next unit, whose wheels then decide how fast that turns.
Sources: [GEO] eqs. 2 and 6; without steered axles the recursion over couplings is the standard n-trailer.

The model has one axle for every group of axles, and no track width: an axle's tyres count as far out as its body is wide, so that a track
is that of the outer face of the outer tyre. Wheels further in, and those of a group's other axles, run inside of what the body sweeps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.errors import OptionError
from hdvplan.vehicle.model import Vehicle

# Where a unit is in the plane: its axle, its heading, and its coupling to the unit ahead [m]. The lead unit turns about its own axle,
# so its "coupling" is that axle. And how it stands to what is ahead: to the road, or by its articulation angle.
POSE = core.record("hdv_pose")

_place_many = core.function("hdv_place_many", core.POINTER, core.INT, core.INT, core.POINTER, core.INT, core.POINTER, core.POINTER)
_derivative = core.function("hdv_derivative", core.POINTER, core.INT, core.REAL, core.INT, core.POINTER, core.REAL, core.POINTER)


def place_many(units: Records, points: FloatArray, z: FloatArray) -> Records:
    """Return every unit's pose in states ``z`` (k, states), records of ``POSE`` (k, units).

    ``points`` (5, k) are the road's where the lead rear axle is, as ``road.path.evaluate_many`` returns them.
    """
    points, z = np.ascontiguousarray(points.T), np.ascontiguousarray(z)
    poses = np.empty((len(z), len(units)), POSE)
    _place_many(core.address(units), len(units), len(z), core.address(points), z.shape[1], core.address(z), core.address(poses))
    return poses


def rates(units: Records, road_curvature: float, z: FloatArray, kappa: float) -> FloatArray:
    """Return dz/ds, shape (states,), wheels that the plan steers held."""
    z, f = np.ascontiguousarray(z), np.empty(len(z))
    _derivative(core.address(units), len(units), road_curvature, len(z), core.address(z), kappa, core.address(f))
    return f


def critical_angles(vehicle: Vehicle) -> FloatArray:
    """Return the critical articulation of every coupling, (units - 1,) [rad]; infinite where the steering alone folds no trailer.

    It is the one that stays as it is in a circle at full lock: sin(beta) - hitch_offset kappa cos(beta) = kappa wheelbase, with the
    curvature kappa of the path of the axle ahead. Beyond it an angle grows whatever is steered. A trailer's own path then bends by
    kappa / (cos(beta) + hitch_offset kappa sin(beta)), which the next coupling meets. Trailers' axles are taken as not steered.
    """
    kappa, found = vehicle.max_curvature, np.full(len(vehicle.units) - 1, np.inf)
    for number, (ahead, unit) in enumerate(zip(vehicle.units, vehicle.units[1:], strict=False)):
        lever = ahead.hitch_offset * kappa
        sine = kappa * unit.wheelbase / np.hypot(1.0, lever)
        if sine >= 1.0:
            break
        beta = np.arctan(lever) + np.arcsin(sine)
        found[number], kappa = beta, kappa / (np.cos(beta) + lever * np.sin(beta))
        if kappa <= 0.0:  # the trailer's axle no longer rolls forward
            break
    return found


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
