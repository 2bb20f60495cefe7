"""Balance the swept envelope itself: at every place of the road its left and right reach, over the whole manoeuvre.

The envelope of a moving body is traced by few of its points: its corners, and the points of its edges beside its axle, because the
axle does not slide and the body turns about a point of the axle's line. Each place's left and right reach thus belong to one point of
one stage each. A step of Gauss and Newton that moves each of the two by half of the imbalance keeps the program's stages apart: with
a + b the change of the imbalance I, (I + a + b)^2 <= 2 (I/2 + a)^2 + 2 (I/2 + b)^2, with equality at a = b. ``docs/balanced.md``
has the derivation, why it converges, and what was measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.jit import FloatArray, IntArray, compiled
from hdvplan.planning.motion import axles_behind
from hdvplan.planning.objectives import Balanced
from hdvplan.planning.stations import Stations
from hdvplan.vehicle.kinematics import place, point_gradient
from hdvplan.vehicle.model import Vehicle

_TIE_M = 1e-4  # a point takes a place over from another one when it reaches this much further
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
    reach: FloatArray  # (2, places), with the plan
    slope: FloatArray  # (2, places), of the track that reaches furthest, outwards over s
    made_by: IntArray  # (2, places, 3), its stage, unit and point; stage -1: driven

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
            np.full((2, places), -np.inf),
            np.zeros((2, places)),
            np.full((2, places, 3), -1),
        )

    def begin(self) -> None:
        """Forget what was driven: the next plan is a drive's first."""
        self.driven[:] = -np.inf

    def keep(self, last: int, by: int) -> None:
        """Count the first ``by`` stages of the last plan, from station ``last``, as driven."""
        if self.stages > 0:
            _cover(self.tracks, 1, min(by, self.places) + 1, self.step, last, self.driven, self.slope, self.made_by)

    def write(self, first: int, fixed: int, z: FloatArray, Q: FloatArray, q: FloatArray) -> None:
        """Replace the objective of all stages that can be balanced, for a plan ``z`` from station ``first``.

        Stages up to ``fixed`` will not change any more: what they sweep is left to the other side to match.
        """
        wanted = self.wanted
        if self.stages > 0:
            _balance(
                self.units, self.points, self.road, wanted.aim, wanted.share, wanted.rounding, wanted.relaxation, self.step, z, first,
                fixed, self.stages, self.places, self.before, self.start, self.poses, self.tracks, self.driven, self.reach, self.slope,
                self.made_by, Q, q,
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
    tracks: FloatArray, begin: int, end: int, step: float, first: int, reach: FloatArray, slope: FloatArray, made_by: IntArray
) -> None:
    """Widen ``reach`` by the tracks between stages begin - 1 and end - 1; note the stage, unit and point nearest to each place."""
    per_metre, last = 1.0 / step, reach.shape[1] - 1
    for i in range(begin, end):
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
                        reach[side, m], slope[side, m] = e, rise
                        nearest = i if 2.0 * m * step > s_from + s_to else i - 1
                        made_by[side, m, 0], made_by[side, m, 1], made_by[side, m, 2] = first + nearest, unit, point


@compiled
def _balance(
    units: FloatArray, points: FloatArray, road: FloatArray, aim: FloatArray, beside: float, rounding: float, relaxation: float,
    step: float, z: FloatArray, first: int, fixed: int, stages: int, places: int, before: int, start: FloatArray, poses: FloatArray,
    tracks: FloatArray, driven: FloatArray, reach: FloatArray, slope: FloatArray, made_by: IntArray, Q: FloatArray, q: FloatArray,
) -> None:  # fmt: skip
    """Measure a plan's envelope and write Q, q of the imbalance at stages 1 <= i <= stages, on top of a share of what they hold."""
    n, end, lowest = z.shape[1], places + before + 1, max(first - before, 0)
    gradient = np.empty(n)
    _trace(units, points, road, step, z, first, end, start, poses, tracks)
    for m in range(lowest, min(first + end, reach.shape[1])):
        for side in range(2):
            reach[side, m], made_by[side, m, 0] = driven[side, m], -1
    _cover(tracks, 1, end, step, first, reach, slope, made_by)
    for i in range(1, stages + 1):
        for j in range(n):
            q[i, j] *= beside
            for k in range(n):
                Q[i, j, k] *= beside
    for m in range(lowest, min(first + places, reach.shape[1])):
        wrong = reach[0, m] - reach[1, m] - 2.0 * aim[m]
        if not np.isfinite(wrong):
            continue
        weight = 1.0 / np.sqrt(1.0 + (wrong / rounding) ** 2)
        for side in range(2):
            i, unit, point = made_by[side, m, 0] - first, made_by[side, m, 1], made_by[side, m, 2]
            if i < 1 or i > stages:
                continue
            share = 0.5 if made_by[1 - side, m, 0] - first > fixed else 1.0
            u, v = points[unit, point, 0], points[unit, point, 1]
            x = poses[i, unit, 0] + u * poses[i, unit, 2] - v * poses[i, unit, 3]
            y = poses[i, unit, 1] + u * poses[i, unit, 3] + v * poses[i, unit, 2]
            s = tracks[i, unit, point, 0]
            near = int(s / step + 0.5)
            k = road[4, near]
            turn = k * (s - near * step)
            cos, sin = road[2, near] - turn * road[3, near], road[3, near] + turn * road[2, near]  # the road's heading at the foot
            # The place is fixed while the point's foot moves: by the track's slope that changes the reach there.
            rise = (1.0 - 2.0 * side) * slope[side, m] / (1.0 - k * tracks[i, unit, point, 1])
            at = first + i
            point_gradient(poses[i], unit, x, y, road[2, at], road[3, at], -sin - rise * cos, cos - rise * sin, gradient)
            for j in range(n):
                q[i, j] += 2.0 * weight * wrong * gradient[j]
                for k in range(n):
                    Q[i, j, k] += 2.0 / relaxation * weight / share * gradient[j] * gradient[k]
