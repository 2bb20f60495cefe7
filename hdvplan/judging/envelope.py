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
from hdvplan.jit import FloatArray, Records, compiled
from hdvplan.road.path import Curve, evaluate, project
from hdvplan.vehicle.kinematics import POSE, body_point, place

SPACING_M = 0.25  # of outline points and of the envelope's stations


@dataclass(frozen=True)
class Envelope:
    """Signed reach of every unit at arclengths ``s`` [m]: left positive; shape (units, n), NaN where a unit never was."""

    s: FloatArray
    left: FloatArray
    right: FloatArray

    @property
    def reach_left(self) -> FloatArray:
        """Furthest left reach of any body, shape (n,) [m]."""
        reach: FloatArray = np.nanmax(self.left, axis=0)
        return reach

    @property
    def reach_right(self) -> FloatArray:
        """Furthest right reach of any body, signed (negative), shape (n,) [m]."""
        reach: FloatArray = np.nanmin(self.right, axis=0)
        return reach


def envelope_of(drive: Drive, *, axles_only: bool = False) -> Envelope:
    """Measure the envelope of an executed drive over 0 <= s <= the road's length.

    ``axles_only`` measures the part between each unit's first and last axle, which must stay on the drivable region.

    Raises:
        PlanError: a body reached beyond the road's centre of curvature.

    """
    path, units = drive.stations.path, drive.vehicle.table()
    stations = SPACING_M * np.arange(int(np.floor(drive.road.path.length / SPACING_M + 1e-9)) + 1, dtype=np.float64)
    low, high, lost = _sweep(
        units, _outlines(units, axles_only=axles_only), path.curve,
        drive.poses_s, np.ascontiguousarray(drive.poses_z), stations,
    )  # fmt: skip
    if lost >= 0:
        s = float(drive.poses_s[lost])
        msg = f"at s = {s:.1f} m a body reaches beyond the road's centre of curvature"
        raise PlanError(msg, s_m=s)
    return Envelope(stations, np.where(np.isfinite(high), high, np.nan), np.where(np.isfinite(low), low, np.nan))


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
    poses = np.empty(units.size, POSE)
    before = np.empty((units.size, outlines.shape[1], 2))  # (s, offset) of the outline at the previous pose
    for i in range(poses_s.size):
        x, y, cos, sin, _ = evaluate(curve, poses_s[i])
        place(units, x, y, cos, sin, poses_z[i], poses)
        behind = 0.0
        for unit in range(units.size):
            if unit > 0:
                behind += units[unit - 1].hitch_offset + units[unit].wheelbase
            near = poses_s[i] - behind + outlines[unit, 0, 0]
            last_s, last_e = 0.0, 0.0
            for point in range(outlines.shape[1]):
                px, py = body_point(poses[unit], outlines[unit, point, 0], outlines[unit, point, 1])
                s, e, _, _, _ = project(curve, px, py, near)
                if np.isnan(e):
                    return low, high, i
                near = s
                if point > 0:
                    _cover(last_s, last_e, s, e, stations, low[unit], high[unit])
                if i > 0:
                    _cover(before[unit, point, 0], before[unit, point, 1], s, e, stations, low[unit], high[unit])
                last_s, last_e = s, e
                before[unit, point, 0], before[unit, point, 1] = s, e
    return low, high, -1


@compiled
def _cover(s_from: float, e_from: float, s_to: float, e_to: float, stations: FloatArray, low: FloatArray, high: FloatArray) -> None:
    """Widen the envelope by a straight piece in the (s, offset) plane."""
    if s_to < s_from or (s_to == s_from and e_to < e_from):
        s_from, e_from, s_to, e_to = s_to, e_to, s_from, e_from
    pitch = stations[1] - stations[0]
    begin = max(0, int(np.ceil((s_from - stations[0]) / pitch)))
    end = min(stations.size - 1, int(np.floor((s_to - stations[0]) / pitch)))
    for j in range(begin, end + 1):
        part = (stations[j] - s_from) / (s_to - s_from) if s_to > s_from else 0.0
        offset = e_from + part * (e_to - e_from)
        low[j], high[j] = min(low[j], offset), max(high[j], e_to if s_to == s_from else offset)
