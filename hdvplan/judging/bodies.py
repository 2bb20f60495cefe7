"""Where the bodies and wheels of a driven vehicle were, and which part of a body reaches furthest at a place of the road.

A vehicle's model has one axle for every group of axles, and no track width: an axle's tyres count as far out as its body is wide,
so that a track is that of the outer face of the outer tyre. Wheels further in, and those of a group's other axles, run inside
of what the body sweeps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.arrays import FloatArray, IntArray, Records
from hdvplan.driving.drive import Drive
from hdvplan.road.path import evaluate_many
from hdvplan.vehicle.body import axles_behind
from hdvplan.vehicle.kinematics import place_many
from hdvplan.vehicle.model import Unit, Vehicle


def placed(drive: Drive, numbers: IntArray) -> Records:
    """Return where all bodies are at the simulated poses of the given ``numbers``, shape (poses, units) of ``POSE``."""
    points = evaluate_many(drive.stations.path, drive.poses_s[numbers])
    return place_many(drive.vehicle.table(), points, drive.poses_z[numbers])


def corners(drive: Drive, numbers: IntArray, *, axles_only: bool = False) -> FloatArray:
    """Return the corners of every body at the simulated poses of the given ``numbers``, shape (poses, units, 4, 2), x, y [m].

    ``axles_only`` leaves the overhangs out.
    """
    units, poses = drive.vehicle.table(), placed(drive, numbers)[..., None]
    front = np.minimum(units["wheelbase"], units["front"]) if axles_only else units["front"]
    rear = np.zeros(len(units)) if axles_only else -units["rear_overhang"]
    along = np.stack([front, front, rear, rear], axis=1)
    across = units["half_width"][:, None] * np.array([1.0, -1.0, -1.0, 1.0])
    x = poses["x"] + along * poses["cos"] - across * poses["sin"]
    return np.stack([x, poses["y"] + along * poses["sin"] + across * poses["cos"]], axis=-1)


def pose_at(drive: Drive, s: float) -> int:
    """Return the number of the simulated pose nearest to arclength ``s`` [m]."""
    return int(np.argmin(np.abs(drive.poses_s - s)))


TRACK_NOTE = "outer faces of the outer tyres, which are taken to be as far apart as the body is wide"


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
    """The way of a wheel, shape (n, 2), x, y [m]: one point a simulated pose, at most 0.25 m apart."""

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


def wheel_tracks(drive: Drive) -> tuple[WheelTrack, ...]:
    """Return the track of every outer wheel over the whole drive, in the order of ``wheels_of``."""
    poses = placed(drive, np.arange(len(drive.poses_s)))
    tracks = []
    for wheel in wheels_of(drive.vehicle):
        body = poses[:, wheel.unit]
        x = body["x"] + wheel.ahead * body["cos"] - wheel.left * body["sin"]
        y = body["y"] + wheel.ahead * body["sin"] + wheel.left * body["cos"]
        tracks.append(WheelTrack(wheel, np.column_stack([x, y])))
    return tuple(tracks)


_SPACING_M = 0.1  # of the places on an edge that are looked at
_NEAR_M = 0.2  # a place this near to a corner or an axle bears its name
_ROOM_M = 3.0  # a body askew reaches a place from poses this much further off than its length


def contact(drive: Drive, unit: int, side: str, s: float) -> str:
    """Return the part of body ``unit`` that reaches furthest to ``side`` at arclength ``s`` [m], as executed.

    One of "front corner", "front overhang", "front axle", "side between the axles", "rear axle", "rear overhang", "rear corner". The front
    "axle" of a trailer is its coupling.
    """
    body = drive.vehicle.units[unit]
    front, rear = body.front, -body.rear_overhang
    ahead = np.linspace(rear, front, int(np.ceil((front - rear) / _SPACING_M)) + 1)
    across = 0.5 * body.width * (1.0 if side == "left" else -1.0)
    lap = drive.road.path.length
    laps = (-lap, 0.0, lap) if drive.road.path.closed else (0.0,)  # what lies beyond either end of a closed road is beside the other
    _, furthest = max(_furthest(drive, unit, ahead, across, s + lap) for lap in laps)
    return part_named(body, furthest)


def _furthest(drive: Drive, unit: int, ahead: FloatArray, across: float, s: float) -> tuple[float, float]:
    """Return how far the side ``across`` of a body's axis reaches outwards at arclength ``s``, and with what ``ahead`` of its axle [m]."""
    behind = float(axles_behind(drive.vehicle)[unit])
    first, last = np.searchsorted(drive.poses_s, [s + behind - ahead[-1] - _ROOM_M, s + behind - ahead[0] + _ROOM_M])
    near = np.arange(first, min(int(last) + 1, len(drive.poses_s)))
    if not len(near):
        return -np.inf, float(ahead[0])
    poses = placed(drive, near)[:, unit, None]
    x, y = poses["x"] + ahead * poses["cos"] - across * poses["sin"], poses["y"] + ahead * poses["sin"] + across * poses["cos"]
    foot, offset = drive.stations.path.project(x, y, drive.poses_s[near, None] - behind + ahead)
    reach: FloatArray = np.where(np.abs(foot - s) <= _SPACING_M, np.sign(across) * offset, -np.inf)
    at = int(np.argmax(reach))
    return float(reach.flat[at]), float(ahead[at % len(ahead)])


def part_named(body: Unit, ahead: float) -> str:
    """Return the name of the part of a body that lies ``ahead`` of its axle [m]; see ``contact``."""
    places = {"front axle": body.wheelbase, "rear axle": 0.0, "front corner": body.front, "rear corner": -body.rear_overhang}
    for name, place_ in places.items():
        if abs(ahead - place_) < _NEAR_M:
            return name
    if ahead > body.wheelbase:
        return "front overhang"
    return "rear overhang" if ahead < 0.0 else "side between the axles"
