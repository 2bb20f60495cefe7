"""Balance the swept envelope itself: at every place of the road its left and right reach, over the whole manoeuvre.

The envelope of a moving body is traced by few of its points: its corners, and the points of its edges beside its axle, because the
axle does not slide and the body turns about a point of the axle's line; where it begins to turn the other way, also by its edges.
Each place's left and right reach thus belong to one point of one stage each. A step of Gauss and Newton that moves each of the two by
half of the imbalance keeps the program's stages apart: with
a + b the change of the imbalance I, (I + a + b)^2 <= 2 (I/2 + a)^2 + 2 (I/2 + b)^2, with equality at a = b. ``docs/balanced.md``
has the derivation, why it converges, and what was measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.jit import FloatArray, IntArray, compiled
from hdvplan.planning.merit import residual_squared
from hdvplan.planning.motion import axles_behind
from hdvplan.planning.objectives import Balanced
from hdvplan.planning.stations import Stations
from hdvplan.road.path import ReferencePath, project
from hdvplan.vehicle.kinematics import place, point_gradient
from hdvplan.vehicle.model import Vehicle

_TIE_M = 1e-4  # a point takes a place over from another one when it reaches this much further
_SWING = 1e-4  # change of a body's turning per stage from which its edges are looked at where it turns back [rad]
_EDGE_M = 1.0  # length of the straight pieces of such an edge
_NOWHERE_M = 1e9  # beyond the end of any road: the first point of an edge has no piece behind it
_FOOTLESS = 0.95  # curvature times offset from which on a point counts as without a foot
_ROOM = 2  # places and stages beyond the vehicle's length, for bodies that stand askew


def tracing_points(vehicle: Vehicle) -> FloatArray:
    """Return the points of every body that trace its envelope, shape (units, 6, 2): ahead of the axle, left of the axis [m]."""
    return np.array(
        [
            [[ahead, side * 0.5 * unit.width] for ahead in (unit.front, 0.0, -unit.rear_overhang) for side in (1.0, -1.0)]
            for unit in vehicle.units
        ]
    )


@dataclass(frozen=True)
class Balancing:
    """The memory of balancing one drive: what the last plan swept, and what was swept by driving."""

    points: FloatArray  # (units, 6, 2)
    units: FloatArray
    path: ReferencePath
    road: FloatArray  # (5, places), stations of the whole drive
    wanted: Balanced
    step: float  # [m]
    stages: int  # last stage whose objective is the balance
    places: int  # last place, counted from the first stage, that the plan sweeps from end to end
    before: int  # places behind the first stage that the vehicle can still sweep
    start: FloatArray  # (units, 6), places that the points lie ahead of the lead rear axle's on a straight
    poses: FloatArray  # (N+1, units, 6)
    tracks: FloatArray  # (N+1, units, 6, 2), foot and offset [m]
    driven: FloatArray  # (2, places), furthest reach left and right of what has been driven, both outwards [m]
    since: IntArray  # (1,), station of the plan that was last measured, which has been driven from there on; -1: none
    reach: FloatArray  # (2, places), with the plan
    slope: FloatArray  # (2, places), of the track or edge that reaches furthest, outwards over s
    made_at: FloatArray  # (2, places), how far ahead of its unit's axle the point lies that reaches furthest [m]
    made_by: IntArray  # (2, places, 2), its stage and unit; stage -1: driven
    value: FloatArray  # (1,), the objective of the stages that were last written

    @classmethod
    def of(cls, vehicle: Vehicle, stations: Stations, wanted: Balanced, stages: int) -> Balancing:
        """Return the memory for horizons of ``stages`` intervals."""
        units, places = vehicle.table(), len(stations.s)
        points = tracing_points(vehicle)
        before = int(np.ceil(vehicle.reach_behind / stations.step)) + _ROOM
        after = int(np.ceil(vehicle.reach_ahead / stations.step)) + _ROOM
        swept = min(stages - before, int(min(wanted.ahead / stations.step, stages)) + after)
        return cls(
            points,
            units,
            stations.path,
            stations.road,
            wanted,
            stations.step,
            swept - after,
            swept,
            before,
            np.round((points[:, :, 0] - axles_behind(vehicle)[:, None]) / stations.step),
            np.zeros((stages + 1, len(units), 6)),
            np.zeros((stages + 1, *points.shape[:2], 2)),
            np.full((2, places), -np.inf),
            np.full(1, -1),
            np.full((2, places), -np.inf),
            np.zeros((2, places)),
            np.zeros((2, places)),
            np.full((2, places, 2), -1),
            np.zeros(1),
        )

    def begin(self) -> None:
        """Forget what was driven: the next plan is a drive's first."""
        self.driven[:], self.since[0] = -np.inf, -1

    def write(self, first: int, fixed: int, z: FloatArray, Q: FloatArray, q: FloatArray) -> None:
        """Replace the objective of all stages that can be balanced, for a plan ``z`` from station ``first``.

        Stages up to ``fixed`` will not change any more: what they sweep is left to the other side to match.
        """
        wanted, path = self.wanted, self.path
        if self.stages > 0:
            _balance(
                self.units, self.points, path.coefficients, path.s_first, path.spacing, self.road, wanted.aim, wanted.share,
                wanted.rounding, wanted.relaxation, self.step, z, first, fixed, self.stages, self.places, self.before, self.start,
                self.poses, self.tracks, self.driven, self.since, self.reach, self.slope, self.made_at, self.made_by, self.value, Q, q,
            )  # fmt: skip


@compiled
def _trace(
    units: FloatArray, points: FloatArray, road: FloatArray, step: float, z: FloatArray, first: int, end: int, start: FloatArray,
    poses: FloatArray, tracks: FloatArray,
) -> None:  # fmt: skip
    """Write poses and tracks of stages 0 <= i < end; a foot is NaN where there is none.

    Feet are those on the road's circle of curvature at the station nearest to the axis.
    """
    last = road.shape[1] - 1
    for i in range(end):
        at = first + i
        place(units, road[0, at], road[1, at], road[2, at], road[3, at], z[i], poses[i])
        for unit in range(units.shape[0]):
            x, y, cos_u, sin_u = poses[i, unit, 0], poses[i, unit, 1], poses[i, unit, 2], poses[i, unit, 3]
            for point in range(0, points.shape[1], 2):
                u, half = points[unit, point, 0], points[unit, point, 1]
                px, py = x + u * cos_u, y + u * sin_u
                near = at + int(start[unit, point])
                ahead = beside = cos = sin = k = 0.0
                for _ in range(4):
                    near = min(max(near, 0), last)
                    dx, dy, cos, sin, k = px - road[0, near], py - road[1, near], road[2, near], road[3, near], road[4, near]
                    ahead, beside = dx * cos + dy * sin, dy * cos - dx * sin
                    if not k * beside < _FOOTLESS or abs(ahead) <= 0.75 * step * (1.0 - k * beside):
                        break
                    near += int(np.floor(ahead / (step * (1.0 - k * beside)) + 0.5))
                askew, along = half * (cos * sin_u - sin * cos_u), half * (cos * cos_u + sin * sin_u)
                for side in range(2):
                    offset = beside + (along if side == 0 else -along)
                    inside = 1.0 - k * offset
                    moved = (ahead + (-askew if side == 0 else askew)) / inside
                    turn = k * moved
                    tracks[i, unit, point + side, 0] = near * step + moved if k * offset < _FOOTLESS else np.nan
                    tracks[i, unit, point + side, 1] = offset - 0.5 * turn * moved * inside


@compiled
def _cover(
    units: FloatArray, points: FloatArray, coefficients: FloatArray, s_first: float, spacing: float, poses: FloatArray, tracks: FloatArray,
    end: int, step: float, first: int, reach: FloatArray, slope: FloatArray, made_at: FloatArray, made_by: IntArray,
) -> None:  # fmt: skip
    """Widen ``reach`` by what is swept up to stage end - 1; note for each place the point that reaches furthest and the nearest stage."""
    per_metre, last = 1.0 / step, reach.shape[1] - 1
    for i in range(1, end):
        for unit in range(tracks.shape[1]):
            for point in range(tracks.shape[2]):
                side = point & 1
                sign = 1.0 - 2.0 * side
                s_from, s_to = tracks[i - 1, unit, point, 0], tracks[i, unit, point, 0]
                if not s_to > s_from:  # NaN, or a point that swings backwards
                    continue
                e_from, e_to = sign * tracks[i - 1, unit, point, 1], sign * tracks[i, unit, point, 1]
                low, high = max(0, int(np.ceil(s_from * per_metre))), min(last, int(np.floor(s_to * per_metre)))
                if low > high:
                    continue
                rise = (e_to - e_from) / (s_to - s_from)
                for m in range(low, high + 1):
                    e = e_from + rise * (m * step - s_from)
                    if e > reach[side, m] + _TIE_M:
                        reach[side, m], slope[side, m], made_at[side, m] = e, rise, points[unit, point, 0]
                        nearest = i if 2.0 * m * step > s_from + s_to else i - 1
                        made_by[side, m, 0], made_by[side, m, 1] = first + nearest, unit
    for unit in range(tracks.shape[1]):
        turned = 0.0
        for i in range(1, end):
            before, turned = turned, poses[i - 1, unit, 2] * poses[i, unit, 3] - poses[i - 1, unit, 3] * poses[i, unit, 2]
            if before * turned < 0.0 and abs(turned - before) > _SWING:
                _cover_edges(
                    units, coefficients, s_first, spacing, poses, tracks, i - 1, unit, before > 0.0, step, first, reach, slope, made_at,
                    made_by,
                )  # fmt: skip


@compiled
def _cover_edges(
    units: FloatArray, coefficients: FloatArray, s_first: float, spacing: float, poses: FloatArray, tracks: FloatArray, i: int, unit: int,
    left: bool, step: float, first: int, reach: FloatArray, slope: FloatArray, made_at: FloatArray, made_by: IntArray,
) -> None:  # fmt: skip
    """Widen ``reach`` by a body's edges at stage i, where it has turned left if ``left`` and turns right from there on, or vice versa.

    Ahead of the axle that is the edge it has turned to, behind the axle the other one.
    """
    for side in range(2):
        sign = 1.0 - 2.0 * side
        begin, length = (0.0, units[unit, 2]) if left == (side == 0) else (-units[unit, 3], units[unit, 3])
        pieces = int(np.ceil(length / _EDGE_M))
        s_from, e_from, near = _NOWHERE_M, np.nan, tracks[i, unit, 2, 0] + begin  # point 2 lies beside the axle
        for piece in range(pieces + 1):
            u, v = begin + length * piece / max(pieces, 1), sign * units[unit, 4]
            x = poses[i, unit, 0] + u * poses[i, unit, 2] - v * poses[i, unit, 3]
            y = poses[i, unit, 1] + u * poses[i, unit, 3] + v * poses[i, unit, 2]
            near, e, _, _, _ = project(coefficients, s_first, spacing, x, y, near)
            if np.isnan(e):
                return
            rise = (sign * e - e_from) / (near - s_from) if near > s_from else np.nan
            low, high = max(0, int(np.ceil(s_from / step))), min(reach.shape[1] - 1, int(np.floor(near / step)))
            for m in range(low, high + 1):
                highest = e_from + rise * (m * step - s_from)
                if highest > reach[side, m] + _TIE_M:
                    reach[side, m], slope[side, m], made_at[side, m] = highest, rise, u - (near - m * step)
                    made_by[side, m, 0], made_by[side, m, 1] = first + i, unit
            s_from, e_from = near, sign * e


@compiled
def _balance(
    units: FloatArray, points: FloatArray, coefficients: FloatArray, s_first: float, spacing: float, road: FloatArray, aim: FloatArray,
    beside: float, rounding: float, relaxation: float, step: float, z: FloatArray, first: int, fixed: int, stages: int, places: int,
    before: int, start: FloatArray, poses: FloatArray, tracks: FloatArray, driven: FloatArray, since: IntArray, reach: FloatArray,
    slope: FloatArray, made_at: FloatArray, made_by: IntArray, value: FloatArray, Q: FloatArray, q: FloatArray,
) -> None:  # fmt: skip
    """Measure a plan's envelope and write Q, q of the imbalance at stages 1 <= i <= stages, on top of a share of what they hold."""
    n, end, lowest = z.shape[1], places + before + 1, max(first - before, 0)
    gradient = np.empty(n)
    driven_to = min(first - since[0], places) + 1
    if since[0] >= 0 and driven_to > 1:  # the tracks are still those of the last plan
        _cover(
            units, points, coefficients, s_first, spacing, poses, tracks, driven_to, step, since[0], driven, slope, made_at, made_by
        )  # fmt: skip
    since[0] = first
    _trace(units, points, road, step, z, first, end, start, poses, tracks)
    for m in range(lowest, min(first + end, reach.shape[1])):
        for side in range(2):
            reach[side, m], made_by[side, m, 0] = driven[side, m], -1
    _cover(units, points, coefficients, s_first, spacing, poses, tracks, end, step, first, reach, slope, made_at, made_by)
    value[0] = 0.0
    for i in range(1, stages + 1):
        value[0] += beside * residual_squared(Q[i], q[i], n)
        for j in range(n):
            q[i, j] *= beside
            for k in range(n):
                Q[i, j, k] *= beside
    for m in range(lowest, min(first + places, reach.shape[1])):
        wrong = reach[0, m] - reach[1, m] - 2.0 * aim[m]
        if not np.isfinite(wrong):
            continue
        weight = 1.0 / np.sqrt(1.0 + (wrong / rounding) ** 2)
        value[0] += 2.0 * rounding**2 * (1.0 / weight - 1.0)  # its derivative is 2 weight wrong
        for side in range(2):
            i, unit = made_by[side, m, 0] - first, made_by[side, m, 1]
            if i < 1 or i > stages:
                continue
            share = 0.5 if made_by[1 - side, m, 0] - first > fixed else 1.0
            u, v = made_at[side, m], (1.0 - 2.0 * side) * units[unit, 4]
            x = poses[i, unit, 0] + u * poses[i, unit, 2] - v * poses[i, unit, 3]
            y = poses[i, unit, 1] + u * poses[i, unit, 3] + v * poses[i, unit, 2]
            # The place is fixed while the point's foot moves: by the track's slope that changes the reach there.
            sign, at, cos, sin = 1.0 - 2.0 * side, first + i, road[2, m], road[3, m]
            rise = sign * slope[side, m] / (1.0 - sign * reach[side, m] * road[4, m])
            point_gradient(poses[i], unit, x, y, road[2, at], road[3, at], -sin - rise * cos, cos - rise * sin, gradient)
            for j in range(n):
                q[i, j] += 2.0 * weight * wrong * gradient[j]
                for k in range(n):
                    Q[i, j, k] += 2.0 / relaxation * weight / share * gradient[j] * gradient[k]
