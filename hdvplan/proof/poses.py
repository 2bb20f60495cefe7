"""Which poses of one body fit: for a heading within a cell, the intervals of the lateral offset of its axle that the free space allows."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hdvplan.jit import FloatArray, IntArray, compiled
from hdvplan.proof.around import Around, around_at, unknown
from hdvplan.proof.intervals import joined, kept
from hdvplan.proof.space import BIN_M, MOST, Beside, Frame
from hdvplan.vehicle.model import Unit

_SAME_M = 1e-9
SMALL = 1e-9  # sine of a body that lies along the road
_CELL = 2e-3  # of heading, for a body alone [rad]
POINTS_M = 0.4  # between the points of an outline that are looked at: a bend of 8 m of radius reaches 2.5 mm in between


class Outline(NamedTuple):
    """Points of one body that must lie in free space: ahead of its axle and left of its middle (n, 2) [m], and by which region (n,)."""

    points: FloatArray
    region: IntArray  # 0: the drivable one, 1: the one for overhangs
    rear: float  # of the body, ahead of the point of reference [m]
    front: float
    half: float  # width [m]
    reach: float  # of the furthest point [m]


class Loose(NamedTuple):
    """A body's poses in the road's frame but for e.

    Its heading is ``turned`` off the road's within ``spread`` [rad], its point of reference lies at (``u``, e + ``v``) within ``give`` [m].
    """

    turned: float
    spread: float
    u: float
    v: float
    give: float


def outline_of(unit: Unit, *, two_regions: bool) -> Outline:
    """Return a body's outline; between its axles it keeps to the drivable region where overhangs have a separate one."""
    ends = np.unique([-unit.rear_overhang, 0.0, min(unit.wheelbase, unit.front), unit.front])
    pieces = [np.linspace(a, b, int(np.ceil((b - a) / POINTS_M)) + 1) for a, b in pairwise(ends)]
    ahead = np.unique(np.concatenate(pieces)) if pieces else ends
    half = 0.5 * unit.width
    overhang = (ahead < -_SAME_M) | (ahead > unit.wheelbase + _SAME_M)
    across = np.linspace(-half, half, int(np.ceil(unit.width / POINTS_M)) + 1)[1:-1]
    points = [np.column_stack([ahead, np.full(len(ahead), side)]) for side in (half, -half)]
    points += [np.column_stack([np.full(len(across), end), across]) for end in (ends[-1], ends[0])]
    whole = np.concatenate([overhang, overhang, np.full(2 * len(across), True)])
    # Corners first: they rule out most poses at once.
    order = np.argsort(-np.abs(np.concatenate(points)[:, 0] - 0.5 * (ends[0] + ends[-1])), kind="stable")
    region = np.where(whole, 1, 0) if two_regions else np.ones(len(whole))
    return _outline(np.concatenate(points)[order], region[order])


def seen_from(outline: Outline, ahead: float) -> Outline:
    """Return an outline whose point of reference lies ``ahead`` of the old one [m]."""
    return _outline(outline.points - np.array([ahead, 0.0]), outline.region)


def _outline(points: FloatArray, region: NDArray[np.generic]) -> Outline:
    reach = float(np.max(np.hypot(points[:, 0], points[:, 1])))
    ends = float(np.min(points[:, 0])), float(np.max(points[:, 0])), float(np.max(points[:, 1]))
    return Outline(np.ascontiguousarray(points), np.ascontiguousarray(region.astype(np.int64)), *ends, reach)


@compiled
def trim(outline: Outline, pose: Loose, around: Around, pieces: FloatArray, number: int, room: FloatArray) -> int:
    """Cut ``pieces`` (MOST, 2), rising intervals of the axle's offset e, down to where a body may fit; return how many are left.

    ``room`` is memory like ``pieces``, twice as long. What is cut off fits nowhere in ``pose``.
    """
    count, lines = around.free, around.lines
    cos, sin = np.cos(pose.turned), np.sin(pose.turned)
    bins = count.shape[1]
    middle = bins // 2
    for p in range(outline.region.size):
        region = outline.region[p]
        ahead, left = outline.points[p, 0], outline.points[p, 1]
        u, v = ahead * cos - left * sin, ahead * sin + left * cos
        du, dv = abs(v) * pose.spread + pose.give, abs(u) * pose.spread + pose.give  # the second order is below 30 um
        u, v = u + pose.u, v + pose.v
        low_bin = min(max(int(np.floor((u - du) / BIN_M)) + middle, 0), bins - 1)
        high_bin = min(max(int(np.floor((u + du) / BIN_M)) + middle, 0), bins - 1)
        if number == 1 and low_bin == high_bin and count[region, low_bin] == 1:  # nearly always
            line, over = lines[region, low_bin, 0], u - (low_bin - middle) * BIN_M
            low = line[0] + line[2] * over - abs(line[2]) * du - dv - v
            high = line[1] + line[3] * over + abs(line[3]) * du + dv - v
            pieces[0, 0], pieces[0, 1] = max(pieces[0, 0], low), min(pieces[0, 1], high)
            if pieces[0, 0] > pieces[0, 1]:
                return 0
            continue
        left_over = 0
        for b in range(low_bin, high_bin + 1):
            over = u - (b - middle) * BIN_M
            for c in range(count[region, b]):
                of_low, of_high = lines[region, b, c, 2], lines[region, b, c, 3]
                low = lines[region, b, c, 0] + of_low * over - abs(of_low) * du - dv - v
                high = lines[region, b, c, 1] + of_high * over + abs(of_high) * du + dv - v
                for k in range(number):
                    left_over = joined(room, left_over, max(low, pieces[k, 0]), min(high, pieces[k, 1]))
        number = kept(room, left_over, pieces)
        if number == 0:
            return 0
    if around.corners.shape[0] > 0:
        number = _off_corners(outline, pose, around.corners, pieces, number, room)
    return number


@compiled
def _off_corners(outline: Outline, pose: Loose, corners: FloatArray, pieces: FloatArray, number: int, room: FloatArray) -> int:
    """Cut off where a corner of an obstacle would lie inside the body, however that is turned and placed within ``pose``."""
    cos, sin = np.cos(pose.turned), np.sin(pose.turned)
    give = pose.give + outline.reach * pose.spread
    rear, front, half = outline.rear + give, outline.front - give, outline.half - give
    if rear >= front or half <= 0.0:
        return number
    for n in range(corners.shape[0]):
        u = corners[n, 0] - pose.u  # the body meets the line of this u between two points, at these distances left of its axis
        low, high = -half, half
        if abs(sin) > SMALL:
            a, b = (rear * cos - u) / sin, (front * cos - u) / sin
            low, high = max(low, min(a, b)), min(high, max(a, b))
        elif not rear < u < front:
            continue
        if low >= high:
            continue
        middle = corners[n, 1] - pose.v - u * sin / cos
        below, above = middle - high / cos, middle - low / cos  # e in between has the corner inside
        left_over = 0
        for k in range(number):
            left_over = joined(room, left_over, pieces[k, 0], min(pieces[k, 1], below))
            left_over = joined(room, left_over, max(pieces[k, 0], above), pieces[k, 1])
        number = kept(room, left_over, pieces)
        if number == 0:
            return 0
    return number


@compiled
def fits(outline: Outline, beside: Beside, two_regions: bool, frame: Frame, reach: float, bins: int) -> int:
    """Return the first station at which the body fits in no pose, its axle on the normal there; -1 if there is none."""
    pieces, room = np.empty((MOST, 2)), np.empty((2 * MOST, 2))
    memory = unknown(beside, bins)
    cells = int(0.5 * np.pi / _CELL) + 1
    for i in range(frame.s.size):
        around = around_at(beside, frame, i, reach, two_regions, memory)
        found = False
        for cell in range(2 * cells):  # the headings along the road first
            turned = (cell // 2 + 0.5) * _CELL * (1.0 if cell % 2 == 0 else -1.0)
            pieces[0, 0], pieces[0, 1] = around.near[0], around.near[1]
            if trim(outline, Loose(turned, 0.5 * _CELL, 0.0, 0.0, 0.0), around, pieces, 1, room) > 0:
                found = True
                break
        if not found:
            return i
    return -1
