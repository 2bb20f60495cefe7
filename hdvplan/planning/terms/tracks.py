"""What a plan sweeps: the tracks of the few points that trace the envelope of a moving body, and each place's furthest reach.

The envelope of a moving body is traced by few of its points: its corners, and the points of its edges beside its axle, because the
axle does not slide and the body turns about a point of the axle's line; where it begins to turn the other way, also by its edges.
Each place's left and right reach thus belong to one point of one stage each.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hdvplan.jit import Records, compiled, inner
from hdvplan.road.path import Curve, project
from hdvplan.vehicle.kinematics import POSE, body_point
from hdvplan.vehicle.model import Vehicle

_TIE_M = 1e-4  # a point takes a place over from another one when it reaches this much further
_SWING = 1e-4  # change of a body's turning per stage from which its edges are looked at where it turns back [rad]
_EDGE_M = 1.0  # length of the straight pieces of such an edge
_NOWHERE_M = 1e9  # beyond the end of any road: the first point of an edge has no piece behind it
_FOOTLESS = 0.95  # curvature times offset from which on a point counts as without a foot

TRACING_POINT = np.dtype([("ahead", float), ("left", float), ("start", np.int64)])  # of its axle, of its axis [m]; see ``tracing_points``
TRACK = np.dtype([("foot", float), ("offset", float)])  # of one point at one stage [m]; the foot is NaN where there is none
# What reaches furthest at one place of the road to one side.
REACH = np.dtype(
    [
        ("reach", float),  # outwards [m]
        ("slope", float),  # of the track or edge that reaches furthest, outwards over s
        ("ahead", float),  # how far ahead of its unit's axle the point lies that reaches furthest [m]
        ("stage", np.int64),  # station of its stage; -1: driven
        ("unit", np.int64),
    ]
)


class Bodies(NamedTuple):
    """What is traced, and along which road."""

    units: Records
    points: Records  # (units, 6) of ``TRACING_POINT``
    curve: Curve
    stations: Records  # of the whole drive
    step: float  # [m]


class Tracks(NamedTuple):
    """Where one plan puts the bodies and their points."""

    poses: Records  # (N+1, units) of ``POSE``
    points: Records  # (N+1, units, 6) of ``TRACK``


def tracing_points(vehicle: Vehicle, behind: np.ndarray[tuple[int], np.dtype[np.float64]], step: float) -> Records:
    """Return the points of every body that trace its envelope, shape (units, 6): front, axle and rear, left and right of each.

    ``start`` is how many places a point lies ahead of the lead rear axle on a straight, every axle ``behind`` it by so much [m].
    """
    table = np.zeros((len(vehicle.units), 6), TRACING_POINT)
    for row, unit in zip(table, vehicle.units, strict=True):
        row["ahead"] = np.repeat([unit.front, 0.0, -unit.rear_overhang], 2)
        row["left"] = np.tile([0.5 * unit.width, -0.5 * unit.width], 3)
    table["start"] = np.round((table["ahead"] - behind[:, None]) / step)
    return table


def empty_tracks(vehicle: Vehicle, stages: int) -> Tracks:
    """Return the memory for horizons of ``stages`` intervals."""
    units = len(vehicle.units)
    return Tracks(np.zeros((stages + 1, units), POSE), np.zeros((stages + 1, units, 6), TRACK))


@inner
def trace(bodies: Bodies, poses: Records, first: int, end: int, tracks: Tracks) -> None:
    """Write the tracks of stages 0 <= i < end, which begin at station ``first``, from their poses.

    Feet are those on the road's circle of curvature at the station nearest to the axis.
    """
    stations, step, last = bodies.stations, bodies.step, bodies.stations.size - 1
    for i in range(end):
        for unit in range(bodies.units.size):
            pose = tracks.poses[i, unit]
            own = poses[i, unit]
            pose.x, pose.y, pose.cos, pose.sin, pose.coupling_x, pose.coupling_y = (
                own.x, own.y, own.cos, own.sin, own.coupling_x, own.coupling_y,
            )  # fmt: skip
            for point in range(0, bodies.points.shape[1], 2):
                half = bodies.points[unit, point].left
                px, py = body_point(pose, bodies.points[unit, point].ahead, 0.0)
                near = first + i + bodies.points[unit, point].start
                ahead = beside = cos = sin = k = 0.0
                for _ in range(4):
                    near = min(max(near, 0), last)
                    at = stations[near]
                    dx, dy, cos, sin, k = px - at.x, py - at.y, at.cos, at.sin, at.curvature
                    ahead, beside = dx * cos + dy * sin, dy * cos - dx * sin
                    if not k * beside < _FOOTLESS or abs(ahead) <= 0.75 * step * (1.0 - k * beside):
                        break
                    near += int(np.floor(ahead / (step * (1.0 - k * beside)) + 0.5))
                askew, along = half * (cos * pose.sin - sin * pose.cos), half * (cos * pose.cos + sin * pose.sin)
                for side in range(2):
                    track = tracks.points[i, unit, point + side]
                    offset = beside + (along if side == 0 else -along)
                    inside = 1.0 - k * offset
                    moved = (ahead + (-askew if side == 0 else askew)) / inside
                    turn = k * moved
                    track.foot = near * step + moved if k * offset < _FOOTLESS else np.nan
                    track.offset = offset - 0.5 * turn * moved * inside


@compiled
def cover(bodies: Bodies, tracks: Tracks, first: int, end: int, reached: Records) -> None:
    """Widen ``reached`` (2, places) by what is swept up to stage end - 1; note for each place the point that reaches furthest."""
    step, per_metre, last = bodies.step, 1.0 / bodies.step, reached.shape[1] - 1
    for i in range(1, end):
        for unit in range(bodies.units.size):
            for point in range(bodies.points.shape[1]):
                side = point & 1
                sign = 1.0 - 2.0 * side
                before, now = tracks.points[i - 1, unit, point], tracks.points[i, unit, point]
                s_from, s_to = before.foot, now.foot
                if not s_to > s_from:  # NaN, or a point that swings backwards
                    continue
                e_from, e_to = sign * before.offset, sign * now.offset
                low, high = max(0, int(np.ceil(s_from * per_metre))), min(last, int(np.floor(s_to * per_metre)))
                if low > high:
                    continue
                rise = (e_to - e_from) / (s_to - s_from)
                for m in range(low, high + 1):
                    e, place = e_from + rise * (m * step - s_from), reached[side, m]
                    if e > place.reach + _TIE_M:
                        place.reach, place.slope, place.ahead = e, rise, bodies.points[unit, point].ahead
                        place.stage, place.unit = first + (i if 2.0 * m * step > s_from + s_to else i - 1), unit
    for unit in range(bodies.units.size):
        turned = 0.0
        for i in range(1, end):
            pose, ahead = tracks.poses[i - 1, unit], tracks.poses[i, unit]
            former, turned = turned, pose.cos * ahead.sin - pose.sin * ahead.cos
            if former * turned < 0.0 and abs(turned - former) > _SWING:
                _cover_edges(bodies, tracks, i - 1, unit, former > 0.0, first, reached)


@inner
def _cover_edges(bodies: Bodies, tracks: Tracks, i: int, unit: int, left: bool, first: int, reached: Records) -> None:
    """Widen ``reached`` by a body's edges at stage i, where it has turned left if ``left`` and turns right from there on, or vice versa.

    Ahead of the axle that is the edge it has turned to, behind the axle the other one.
    """
    own, step = bodies.units[unit], bodies.step
    for side in range(2):
        sign = 1.0 - 2.0 * side
        begin, length = (0.0, own.front) if left == (side == 0) else (-own.rear_overhang, own.rear_overhang)
        pieces = int(np.ceil(length / _EDGE_M))
        s_from, e_from, near = _NOWHERE_M, np.nan, tracks.points[i, unit, 2].foot + begin  # point 2 lies beside the axle
        for piece in range(pieces + 1):
            u = begin + length * piece / max(pieces, 1)
            x, y = body_point(tracks.poses[i, unit], u, sign * own.half_width)
            near, e, _, _, _ = project(bodies.curve, x, y, near)
            if np.isnan(e):
                return
            rise = (sign * e - e_from) / (near - s_from) if near > s_from else np.nan
            low, high = max(0, int(np.ceil(s_from / step))), min(reached.shape[1] - 1, int(np.floor(near / step)))
            for m in range(low, high + 1):
                highest, place = e_from + rise * (m * step - s_from), reached[side, m]
                if highest > place.reach + _TIE_M:
                    place.reach, place.slope, place.ahead = highest, rise, u - (near - m * step)
                    place.stage, place.unit = first + i, unit
            s_from, e_from = near, sign * e
