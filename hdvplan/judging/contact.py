"""Which part of a body reaches furthest at a place of the road: what a driver must watch there."""

from __future__ import annotations

import numpy as np

from hdvplan.driving.drive import Drive
from hdvplan.jit import FloatArray
from hdvplan.vehicle.body import axles_behind
from hdvplan.vehicle.kinematics import POSE, place

_SPACING_M = 0.1  # of the places on an edge that are looked at
_NEAR_M = 0.2  # a place this near to a corner or an axle bears its name
_ROOM_M = 3.0  # a body askew reaches a place from poses this much further off than its length


def contact(drive: Drive, unit: int, side: str, s: float, *, axles_only: bool) -> str:
    """Return the part of body ``unit`` that reaches furthest to ``side`` at arclength ``s`` [m], as executed.

    One of "front corner", "front overhang", "front axle", "side between the axles", "rear axle", "rear overhang", "rear corner". The front
    "axle" of a trailer is its coupling. ``axles_only`` looks at the part between them.
    """
    body, path, units = drive.vehicle.units[unit], drive.stations.path, drive.vehicle.table()
    front, rear = (min(body.wheelbase, body.front), 0.0) if axles_only else (body.front, -body.rear_overhang)
    ahead = np.linspace(rear, front, int(np.ceil((front - rear) / _SPACING_M)) + 1)
    across = 0.5 * body.width * (1.0 if side == "left" else -1.0)
    behind = float(axles_behind(drive.vehicle)[unit])
    first, last = np.searchsorted(drive.poses_s, [s + behind - front - _ROOM_M, s + behind - rear + _ROOM_M])
    furthest, where = -np.inf, 0.0
    poses = np.empty(len(units), POSE)
    for pose in range(first, min(int(last) + 1, len(drive.poses_s))):
        at = float(drive.poses_s[pose])
        road = path.at(at)
        place(units, float(road.x), float(road.y), float(np.cos(road.heading)), float(np.sin(road.heading)), drive.poses_z[pose], poses)
        x, y, cos, sin = (float(poses[unit][name]) for name in ("x", "y", "cos", "sin"))
        foot, offset = path.project(x + ahead * cos - across * sin, y + ahead * sin + across * cos, at - behind + ahead)
        reach: FloatArray = np.where(np.abs(foot - s) <= _SPACING_M, np.sign(across) * offset, -np.inf)
        best = int(np.argmax(reach))
        if reach[best] > furthest:
            furthest, where = float(reach[best]), float(ahead[best])
    return _name(where, body.front, body.wheelbase, -body.rear_overhang)


def _name(ahead: float, front: float, wheelbase: float, rear: float) -> str:
    for place_, name in ((wheelbase, "front axle"), (0.0, "rear axle"), (front, "front corner"), (rear, "rear corner")):
        if abs(ahead - place_) < _NEAR_M:
            return name
    if ahead > wheelbase:
        return "front overhang"
    return "rear overhang" if ahead < 0.0 else "side between the axles"
