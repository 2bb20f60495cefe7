"""The swept envelope: how far left and right of the road's centre every body reaches at each arclength, as executed.

Outlines of the simulated poses are projected point by point on the road; between neighbouring outline points, and along
each point's track from pose to pose, the offset is interpolated at the envelope's stations. With poses and outline points
at most 0.25 m apart the envelope of a curve of radius 10 m is short by less than 2 mm (chord against arc, twice h^2 / 8R).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.driving.drive import Drive
from hdvplan.errors import PlanError
from hdvplan.jit import FloatArray, Record, Records, compiled, inlined
from hdvplan.road.path import LAST_STEP_M, Curve, evaluate, project
from hdvplan.vehicle.kinematics import POSE, body_point, place

SPACING_M = 0.25  # of outline points and of the envelope's stations
_WITHIN = 0.9  # curvature times offset up to which a few such steps can be trusted
_ROUNDING = 1e-6  # of feet, as a part of the stations' spacing: a body without rear overhang begins at s = 0

# The foot of an outline's point on the road: at this pose, and where it was at the two before [m].
_FOOT = np.dtype([(name, float) for name in ("s", "offset", "s_before", "offset_before", "s_earlier")])


@dataclass(frozen=True)
class Envelope:
    """Signed reach of every unit at arclengths ``s`` [m]: left positive; shape (units, n), NaN where a unit never was."""

    s: FloatArray
    left: FloatArray
    right: FloatArray

    @property
    def reach_left(self) -> FloatArray:
        """Furthest left reach of any body, shape (n,) [m]."""
        reach: FloatArray = np.fmax.reduce(self.left, axis=0)
        return reach

    @property
    def reach_right(self) -> FloatArray:
        """Furthest right reach of any body, signed (negative), shape (n,) [m]."""
        reach: FloatArray = np.fmin.reduce(self.right, axis=0)
        return reach


def envelope_of(drive: Drive, *, axles_only: bool = False) -> Envelope:
    """Measure the envelope of an executed drive over 0 <= s <= the road's length, where a closed road has what lies beyond either end.

    ``axles_only`` measures the part between each unit's first and last axle, which must stay on the drivable region.

    Raises:
        PlanError: a body reached beyond the road's centre of curvature.

    """
    path, units = drive.stations.path, drive.vehicle.table()
    length, closed = drive.road.path.length, drive.road.path.closed
    count = int(np.floor(length / SPACING_M + 1e-9)) + 1
    behind, ahead = drive.vehicle.reach_behind, drive.vehicle.reach_ahead
    before, beyond = (int(np.ceil(reach / SPACING_M)) if closed else 0 for reach in (behind, ahead + behind))
    stations = SPACING_M * np.arange(-before, count + beyond, dtype=np.float64)
    low, high, lost = _sweep(
        units, _outlines(units, axles_only=axles_only), path.curve,
        drive.poses_s, np.ascontiguousarray(drive.poses_z), stations,
    )  # fmt: skip
    if lost >= 0:
        s = float(drive.poses_s[lost])
        msg = f"at s = {s:.1f} m a body reaches beyond the road's centre of curvature"
        raise PlanError(msg, s_m=s)
    left, right = np.where(np.isfinite(high), high, np.nan), np.where(np.isfinite(low), low, np.nan)
    own = slice(before, before + count)
    for reach, pick in ((left, np.fmax), (right, np.fmin)):
        for of_unit in reach:
            laps = [np.interp(stations[own] + lap, stations, of_unit, np.nan, np.nan) for lap in (-length, length)] if closed else []
            of_unit[own] = pick.reduce([of_unit[own], *laps])
    return Envelope(stations[own], left[:, own], right[:, own])


def _outlines(units: Records, *, axles_only: bool) -> FloatArray:
    """Return closed outlines in body axes, shape (units, points, 2); every body gets as many points as the longest needs."""
    rear = np.zeros(len(units)) if axles_only else units["rear_overhang"]
    front = np.minimum(units["wheelbase"], units["front"]) if axles_only else units["front"]
    along = int(np.ceil(np.max(front + rear) / SPACING_M)) + 1
    across = int(np.ceil(2.0 * np.max(units["half_width"]) / SPACING_M)) + 1
    outlines = []
    for behind, ahead, half in zip(rear, front, units["half_width"], strict=True):
        x, y = np.linspace(-behind, ahead, along), np.linspace(half, -half, across)
        left, end = np.column_stack([x, np.full(along, half)]), np.column_stack([np.full(across, ahead), y])
        right, back = np.column_stack([x[::-1], np.full(along, -half)]), np.column_stack([np.full(across, -behind), y[::-1]])
        outlines.append(np.concatenate([left, end[1:], right[1:], back[1:]]))
    return np.stack(outlines)


@compiled
def _sweep(
    units: Records, outlines: FloatArray, curve: Curve, poses_s: FloatArray,
    poses_z: FloatArray, stations: FloatArray,
) -> tuple[FloatArray, FloatArray, int]:  # fmt: skip
    """Return lowest and highest offset per unit and station (infinite where never), and a pose without foot or -1."""
    low = np.full((units.size, stations.size), np.inf)
    high = np.full((units.size, stations.size), -np.inf)
    poses, feet = np.empty(units.size, POSE), np.zeros(outlines.shape[:2], _FOOT)
    spacing = stations[1] - stations[0]
    for i in range(poses_s.size):
        x, y, cos, sin, _ = evaluate(curve, poses_s[i])
        place(units, x, y, cos, sin, poses_z[i], poses)
        behind = 0.0
        for unit in range(units.size):
            if unit > 0:
                behind += units[unit - 1].hitch_offset + units[unit].wheelbase
            first = poses_s[i] - behind + outlines[unit, 0, 0]
            _follow(curve, poses[unit], outlines[unit], feet[unit], i > 1)
            if not _search(curve, poses[unit], outlines[unit], feet[unit], first):
                return low, high, i
            for point in range(outlines.shape[1]):
                foot = feet[unit, point]
                if point > 0:
                    last = feet[unit, point - 1]
                    _cover(last.s, last.offset, foot.s, foot.offset, stations, spacing, unit, low, high)
                if i > 0:
                    _cover(foot.s_before, foot.offset_before, foot.s, foot.offset, stations, spacing, unit, low, high)
    return low, high, -1


@compiled
def _follow(curve: Curve, pose: Record, outline: FloatArray, feet: Records, known: bool) -> None:
    """Move the feet of an outline's points to their next pose, from where their last two places lead; offset NaN where that is too far off.

    Two Newton steps do but for sudden turns, and until two places are ``known``. Separate from ``_search``, this loop takes half the time.
    """
    for point in range(feet.size):
        foot = feet[point]
        foot.s_earlier, foot.s_before, foot.offset_before = foot.s_before, foot.s, foot.offset
        x, y = body_point(pose, outline[point, 0], outline[point, 1])
        s, step, turned = 2.0 * foot.s_before - foot.s_earlier, 0.0, 0.0
        for _ in range(2):
            px, py, cos, sin, curvature = evaluate(curve, s)
            ahead, offset = (x - px) * cos + (y - py) * sin, (y - py) * cos - (x - px) * sin
            turned = curvature * offset
            step = ahead / (1.0 - turned)
            s += step
            if abs(step) < LAST_STEP_M:
                break
        near = known and abs(step) < LAST_STEP_M and turned < _WITHIN
        foot.s, foot.offset = s, offset - 0.5 * ahead * curvature * step if near else np.nan


@compiled
def _search(curve: Curve, pose: Record, outline: FloatArray, feet: Records, first: float) -> bool:
    """Find the feet that are still missing, each from its neighbour, the first from arclength ``first``; return whether all have one."""
    near = first
    for point in range(feet.size):
        foot = feet[point]
        if np.isnan(foot.offset):
            x, y = body_point(pose, outline[point, 0], outline[point, 1])
            foot.s, foot.offset, _, _, _ = project(curve, x, y, near)
            if np.isnan(foot.offset):
                return False
        near = foot.s
    return True


@inlined
def _cover(
    s_from: float, e_from: float, s_to: float, e_to: float, stations: FloatArray, spacing: float,
    unit: int, low: FloatArray, high: FloatArray,
) -> None:  # fmt: skip
    """Widen the envelope of ``unit`` by a straight piece in the (s, offset) plane."""
    if s_to < s_from or (s_to == s_from and e_to < e_from):
        s_from, e_from, s_to, e_to = s_to, e_to, s_from, e_from
    begin = max(0, int(np.ceil((s_from - stations[0]) / spacing - _ROUNDING)))
    end = min(stations.size - 1, int(np.floor((s_to - stations[0]) / spacing + _ROUNDING)))
    for j in range(begin, end + 1):
        part = min(max((stations[j] - s_from) / (s_to - s_from), 0.0), 1.0) if s_to > s_from else 0.0
        offset = e_from + part * (e_to - e_from)
        low[unit, j], high[unit, j] = min(low[unit, j], offset), max(high[unit, j], e_to if s_to == s_from else offset)
