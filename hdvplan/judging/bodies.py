"""Where the bodies and wheels of a driven vehicle were, and which part of a body reaches furthest at a place of the road."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray, IntArray, Records
from hdvplan.driving.drive import Drive
from hdvplan.road.path import evaluate_many
from hdvplan.vehicle.kinematics import WheelTrack, axles_behind, corners_at, place_many, points_on, tracks_at
from hdvplan.vehicle.model import Unit

_GRID_M = 1e-6
_ROUNDING_M = 1e-6  # of arclengths


def placed(drive: Drive, numbers: IntArray) -> Records:
    """Return where all bodies are at the simulated poses of the given ``numbers``, shape (poses, units) of ``POSE``."""
    points = evaluate_many(drive.stations.path, drive.poses_s[numbers])
    return place_many(drive.vehicle.table(), points, drive.poses_z[numbers])


def corners(drive: Drive, numbers: IntArray, *, axles_only: bool = False) -> FloatArray:
    """Return the corners of every body at the simulated poses of the given ``numbers``, shape (poses, units, 4, 2), x, y [m].

    ``axles_only`` leaves the overhangs out.
    """
    return corners_at(drive.vehicle, placed(drive, numbers), axles_only=axles_only)


def outlines_of(drive: Drive) -> NDArray[np.object_]:
    """Return the outlines of all bodies at all simulated poses as polygons; number i is body ``i % units`` at pose ``i // units``."""
    return np.asarray(shapely.polygons(corners(drive, np.arange(len(drive.poses_s))).reshape(-1, 4, 2)))


def swept_pieces(outlines: FloatArray) -> NDArray[np.object_]:
    """Return areas that together are what bodies sweep [m]: their outlines (poses, ..., 4, 2), and what edges sweep to the next pose."""
    ends = np.roll(outlines, -1, axis=-2)
    moved = np.stack([outlines[:-1], ends[:-1], ends[1:], outlines[1:]], axis=-2)
    edges = shapely.make_valid(np.asarray(shapely.polygons(moved)))  # one that turns about a point of its own sweeps two triangles
    return np.concatenate([np.asarray(shapely.polygons(outlines)).ravel(), edges.ravel()])


def united(areas: Sequence[BaseGeometry] | NDArray[np.object_]) -> BaseGeometry:
    """Return the union of areas; where rounding defeats the exact one, as of edges that nearly coincide, on a grid of a micrometre."""
    try:
        return shapely.union_all(areas)
    except shapely.errors.GEOSException:
        return shapely.union_all(areas, grid_size=_GRID_M)


def pose_at(drive: Drive, s: float) -> int:
    """Return the number of the simulated pose nearest to arclength ``s`` [m]."""
    return int(np.argmin(np.abs(drive.poses_s - s)))


TRACK_NOTE = "outer faces of the outer tyres, which are taken to be as far apart as the body is wide"


def wheel_tracks(drive: Drive) -> tuple[WheelTrack, ...]:
    """Return the track of every outer wheel as far as it is judged, a point at most every 0.25 m, in the order of ``wheels_of``."""
    tracks = tracks_at(drive.vehicle, placed(drive, np.arange(len(drive.poses_s))))
    behind, last = axles_behind(drive.vehicle), judged_to(drive)
    ends = [last + max(0.0, float(behind[track.wheel.unit]) - track.wheel.ahead) for track in tracks]
    return tuple(replace(track, points=track.points[drive.poses_s <= end]) for track, end in zip(tracks, ends, strict=True))


def judged_to(drive: Drive) -> float:
    """Return where the lead axle leaves an open road [m], beyond which only what is still on it is judged; endless on a closed road."""
    return np.inf if drive.road.path.closed else float(drive.stations.s[len(drive.kappa)]) + _ROUNDING_M


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
    x, y = np.moveaxis(points_on(poses, ahead, across), -1, 0)
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
