"""Which part of a body reaches furthest at a place of the road: what a driver must watch there."""

from __future__ import annotations

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.driving.drive import Drive
from hdvplan.judging.bodies import placed
from hdvplan.vehicle.body import axles_behind
from hdvplan.vehicle.model import Unit

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
