"""Plain twins of the proofs' C functions, as they were before they were C: slow, and what the core is compared with."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely

from hdvplan.arrays import BoolArray, FloatArray, IntArray
from hdvplan.proof.articulated import Pair
from hdvplan.proof.coupling import Coupling
from hdvplan.proof.poses import Outline
from hdvplan.proof.reach import Cells, Grid, Reached, Span
from hdvplan.proof.space import BIN_M, MOST, STRETCH_M, Beside, Frame

SMALL = 1e-9  # sine of a body that lies along the road
_BESIDE_M = 20.0  # kerbs that belong to the line so far before and beyond a normal can bound the street on it
_CELL = 2e-3  # of heading, for a body alone [rad]
SLIVER_M = 1e-6  # what is less wide between two triangles of an obstacle is rounding


def joined(pieces: FloatArray, total: int, low: float, high: float) -> int:
    """Add the interval [low, high] to disjoint, rising ``pieces`` and return how many there are; of too many, the closest are joined."""
    if low > high:
        return total
    first = 0
    while first < total and pieces[first, 1] < low:
        first += 1
    last = first
    while last < total and pieces[last, 0] <= high:
        low, high = min(low, pieces[last, 0]), max(high, pieces[last, 1])
        last += 1
    if last == first:
        if total == pieces.shape[0]:
            return _squeezed(pieces, total, low, high)
        for p in range(total, first, -1):
            pieces[p, 0], pieces[p, 1] = pieces[p - 1, 0], pieces[p - 1, 1]
        total += 1
    elif last > first + 1:
        for p in range(last, total):
            pieces[p - (last - first) + 1, 0], pieces[p - (last - first) + 1, 1] = pieces[p, 0], pieces[p, 1]
        total -= last - first - 1
    pieces[first, 0], pieces[first, 1] = low, high
    return total


def _squeezed(pieces: FloatArray, total: int, low: float, high: float) -> int:
    """Add an interval where there is no room for one more: the nearest one grows until it holds it."""
    nearest, least = 0, np.inf
    for p in range(total):
        distance = max(low - pieces[p, 1], pieces[p, 0] - high)
        if distance < least:
            nearest, least = p, distance
    pieces[nearest, 0], pieces[nearest, 1] = min(low, pieces[nearest, 0]), max(high, pieces[nearest, 1])
    return total


def kept_of(found: FloatArray, number: int, pieces: FloatArray) -> int:
    """Copy intervals to where there is room for fewer, the last of which are joined; return how many there are."""
    while number > pieces.shape[0]:
        found[number - 2, 1] = found[number - 1, 1]
        number -= 1
    for k in range(number):
        pieces[k, 0], pieces[k, 1] = found[k, 0], found[k, 1]
    return number


SIDES = 16
ROUNDING = 1e-9


def box(directions: FloatArray, e_low: float, e_high: float, w_low: float, w_high: float, h: FloatArray) -> None:
    """Write the supports of a rectangle."""
    for d in range(SIDES):
        x, y = directions[d, 0], directions[d, 1]
        h[d] = max(x * e_low, x * e_high) + max(y * w_low, y * w_high)


def support(directions: FloatArray, h: FloatArray, x: float, y: float) -> float:
    """Return a bound of (x, y) . q over a polygon: from the supports of the two directions between which (x, y) lies."""
    turn = np.arctan2(y, x) * SIDES / (2.0 * np.pi)
    a = int(np.floor(turn))
    share_a, share_b = a % SIDES, (a + 1) % SIDES
    ax, ay, bx, by = directions[share_a, 0], directions[share_a, 1], directions[share_b, 0], directions[share_b, 1]
    cross = ax * by - ay * bx
    of_a, of_b = max((x * by - y * bx) / cross, 0.0), max((ax * y - ay * x) / cross, 0.0)
    return float(of_a * h[share_a] + of_b * h[share_b])


def tight(directions: FloatArray, h: FloatArray) -> bool:
    """Bring every support down to what the others leave of the polygon; return False where nothing is left."""
    half, quarter = SIDES // 2, SIDES // 4
    corners, other = np.empty((2 * SIDES + 4, 2)), np.empty((2 * SIDES + 4, 2))
    if h[0] < -h[half] or h[quarter] < -h[half + quarter]:
        return False
    corners[0, 0], corners[0, 1] = h[0], h[quarter]
    corners[1, 0], corners[1, 1] = -h[half], h[quarter]
    corners[2, 0], corners[2, 1] = -h[half], -h[half + quarter]
    corners[3, 0], corners[3, 1] = h[0], -h[half + quarter]
    number = 4
    for d in range(SIDES):
        if d % quarter == 0:
            continue
        kept = 0
        x, y = directions[d, 0], directions[d, 1]
        former = x * corners[number - 1, 0] + y * corners[number - 1, 1] - h[d]
        for c in range(number):
            now = x * corners[c, 0] + y * corners[c, 1] - h[d]
            if (former > 0.0) != (now > 0.0):
                p = c - 1 if c > 0 else number - 1
                share = former / (former - now)
                other[kept, 0] = corners[p, 0] + share * (corners[c, 0] - corners[p, 0])
                other[kept, 1] = corners[p, 1] + share * (corners[c, 1] - corners[p, 1])
                kept += 1
            if now <= 0.0:
                other[kept, 0], other[kept, 1] = corners[c, 0], corners[c, 1]
                kept += 1
            former = now
        if kept == 0:
            return False
        corners, other, number = other, corners, kept
    for d in range(SIDES):
        most = -np.inf
        for c in range(number):
            most = max(most, directions[d, 0] * corners[c, 0] + directions[d, 1] * corners[c, 1])
        h[d] = min(h[d], most + ROUNDING)
    return True


def free_space(
    beside: Beside, region: int, row: tuple[int, int], x: float, y: float, heading: float, near: FloatArray, bins: int, count: IntArray,
    lines: FloatArray,
) -> None:  # fmt: skip
    """Write the free intervals of v for every bin of u in the frame (x, y, heading).

    Bin n holds u from (n - bins // 2) ``BIN_M``. ``count`` (bins,) intervals, in ``lines`` (bins, MOST, 4): low and high v at the bin's
    first u and their slopes. ``row`` are the areas looked at, ``near`` (2,) the v between which the axle crosses its normal.
    """
    stretches = beside.s.size - 1
    first, last = beside.begin[region * stretches + row[0]], beside.begin[region * stretches + row[1]]
    cos, sin = np.cos(heading), np.sin(heading)
    n = last - first
    corners = np.empty((n, 3, 2))
    extent = np.empty((n, 2))
    for k in range(n):
        low, high = np.inf, -np.inf
        for c in range(3):
            px, py = beside.areas[first + k, c, 0] - x, beside.areas[first + k, c, 1] - y
            u = px * cos + py * sin
            corners[k, c, 0], corners[k, c, 1] = u, py * cos - px * sin
            low, high = min(low, u), max(high, u)
        extent[k, 0], extent[k, 1] = low, high
    tri, tri_extent = np.empty_like(beside.blocked), np.empty((beside.blocked.shape[0], 2))
    far = 0.5 * BIN_M * bins
    m = 0  # triangles near by
    for k in range(beside.blocked.shape[0]):
        low, high = np.inf, -np.inf
        for c in range(3):
            px, py = beside.blocked[k, c, 0] - x, beside.blocked[k, c, 1] - y
            u = px * cos + py * sin
            v = py * cos - px * sin
            tri[m, c, 0], tri[m, c, 1] = u, v
            low, high = min(low, u), max(high, u)
        if high >= -far and low <= far:
            tri_extent[m, 0], tri_extent[m, 1] = low, high
            m += 1
    middle = bins // 2
    met = np.empty(n, np.int64)
    spans = np.empty((n, 2))
    ends = np.empty((n, 4))  # low, high at the bin's first line; at its last; NaN where the quadrilateral does not meet the line
    for away in range(bins):
        # from the axle outwards: middle, middle - 1, middle + 1, ...; every bin's neighbour nearer to the axle is known
        b = middle + away // 2 if away % 2 == 0 else middle - 1 - away // 2
        if not 0 <= b < bins:
            continue
        u0 = (b - middle) * BIN_M
        u1 = u0 + BIN_M
        found = 0
        for k in range(n):
            if extent[k, 0] <= u1 and extent[k, 1] >= u0:
                low, high = np.inf, -np.inf
                low0, high0, low1, high1 = np.inf, -np.inf, np.inf, -np.inf
                for c in range(3):
                    ua, va = corners[k, c, 0], corners[k, c, 1]
                    ub, vb = corners[k, (c + 1) % 3, 0], corners[k, (c + 1) % 3, 1]
                    if u0 <= ua <= u1:
                        low, high = min(low, va), max(high, va)
                    if (ua - u0) * (ub - u0) <= 0.0 and ua != ub:
                        v = va + (u0 - ua) / (ub - ua) * (vb - va)
                        low0, high0 = min(low0, v), max(high0, v)
                    if (ua - u1) * (ub - u1) <= 0.0 and ua != ub:
                        v = va + (u1 - ua) / (ub - ua) * (vb - va)
                        low1, high1 = min(low1, v), max(high1, v)
                met[found] = k
                spans[found, 0], spans[found, 1] = min(low, low0, low1), max(high, high0, high1)
                ends[found, 0], ends[found, 1], ends[found, 2], ends[found, 3] = low0, high0, low1, high1
                found += 1
        many, pieces = np.empty((8 * MOST, 2)), np.empty((MOST, 2))
        total = 0
        for f in range(found):
            total = joined(many, total, spans[f, 0] - ROUNDING, spans[f, 1] + ROUNDING)
        total = kept_of(many, total, pieces)
        kept = 0
        for p in range(total):
            low, high = pieces[p, 0], pieces[p, 1]
            low0, high0, low1, high1 = np.inf, -np.inf, np.inf, -np.inf
            for f in range(found):
                if spans[f, 0] <= high and spans[f, 1] >= low:
                    low0, high0 = min(low0, ends[f, 0]), max(high0, ends[f, 1])
                    low1, high1 = min(low1, ends[f, 2]), max(high1, ends[f, 3])
            of_high = (high1 - high0) / BIN_M if abs(high0) < np.inf and abs(high1) < np.inf else 0.0
            of_low = (low1 - low0) / BIN_M if abs(low0) < np.inf and abs(low1) < np.inf else 0.0
            c_high, c_low = max(high0, high1 - of_high * BIN_M), min(low0, low1 - of_low * BIN_M)
            for f in range(found):
                if spans[f, 0] <= high and spans[f, 1] >= low:
                    for c in range(3):
                        u, v = corners[met[f], c, 0], corners[met[f], c, 1]
                        if u0 <= u <= u1:
                            c_high, c_low = max(c_high, v - of_high * (u - u0)), min(c_low, v - of_low * (u - u0))
            lines[b, kept, 0], lines[b, kept, 1], lines[b, kept, 2], lines[b, kept, 3] = c_low, c_high, of_low, of_high
            kept += 1
        for k in range(m):
            if tri_extent[k, 0] <= u0 and tri_extent[k, 1] >= u1:
                kept = _without(lines[b], kept, tri[k], u0, u1)
        # only what is connected with the axle's place
        connected = 0
        for p in range(kept):
            low = min(lines[b, p, 0], lines[b, p, 0] + BIN_M * lines[b, p, 2])
            high = max(lines[b, p, 1], lines[b, p, 1] + BIN_M * lines[b, p, 3])
            inside = False
            if b == middle or b == middle - 1:
                inside = low <= near[1] and high >= near[0]
            if b != middle and not inside:
                inner = b + 1 if b < middle else b - 1
                for q in range(count[inner]):
                    inner_low = min(lines[inner, q, 0], lines[inner, q, 0] + BIN_M * lines[inner, q, 2])
                    inner_high = max(lines[inner, q, 1], lines[inner, q, 1] + BIN_M * lines[inner, q, 3])
                    inside = inside or (low <= inner_high and high >= inner_low)
            if inside:
                for c in range(4):
                    lines[b, connected, c] = lines[b, p, c]
                connected += 1
        count[b] = connected


def _take_in(line: FloatArray, low: float, high: float, of_low: float, of_high: float) -> None:
    """Widen one free interval until it holds another."""
    line[0] = min(line[0], low, line[0] + BIN_M * line[2], low + BIN_M * of_low)
    line[1] = max(line[1], high, line[1] + BIN_M * line[3], high + BIN_M * of_high)
    line[2] = line[3] = 0.0


def _without(lines: FloatArray, kept: int, tri: FloatArray, u0: float, u1: float) -> int:
    """Cut a triangle, which reaches over all of a bin, out of the bin's free intervals; return how many are left."""
    low0, high0, low1, high1 = np.inf, -np.inf, np.inf, -np.inf
    for c in range(3):
        ua, va, ub, vb = tri[c, 0], tri[c, 1], tri[(c + 1) % 3, 0], tri[(c + 1) % 3, 1]
        if ua == ub:
            if ua == u0:
                low0, high0 = min(low0, va, vb), max(high0, va, vb)
            if ua == u1:
                low1, high1 = min(low1, va, vb), max(high1, va, vb)
            continue
        if (ua - u0) * (ub - u0) <= 0.0:
            v = va + (u0 - ua) / (ub - ua) * (vb - va)
            low0, high0 = min(low0, v), max(high0, v)
        if (ua - u1) * (ub - u1) <= 0.0:
            v = va + (u1 - ua) / (ub - ua) * (vb - va)
            low1, high1 = min(low1, v), max(high1, v)
    out = np.empty((2 * lines.shape[0], 4))
    number = 0
    for p in range(kept):
        low, high, of_low, of_high = lines[p, 0], lines[p, 1], lines[p, 2], lines[p, 3]
        free_low1, free_high1 = low + BIN_M * of_low, high + BIN_M * of_high
        if (high0 <= low and high1 <= free_low1) or (low0 >= high and low1 >= free_high1):
            out[number, 0], out[number, 1], out[number, 2], out[number, 3] = low, high, of_low, of_high
            number += 1
            continue
        below = max(low0 - low, low1 - free_low1) > SLIVER_M
        above = max(high - high0, free_high1 - high1) > SLIVER_M
        if below:  # what is free right of the obstacle; where the lines cross, all that was free stays
            crosses = low0 > high or low1 > free_high1
            out[number, 0], out[number, 2] = low, of_low
            out[number, 1], out[number, 3] = (high, of_high) if crosses else (low0, (low1 - low0) / BIN_M)
            number += 1
        if above:
            crosses = high0 < low or high1 < free_low1
            out[number, 1], out[number, 3] = high, of_high
            out[number, 0], out[number, 2] = (low, of_low) if crosses else (high0, (high1 - high0) / BIN_M)
            number += 1
    while number > lines.shape[0]:  # the last two become one
        _take_in(out[number - 2], out[number - 1, 0], out[number - 1, 1], out[number - 1, 2], out[number - 1, 3])
        number -= 1
    for p in range(number):
        for c in range(4):
            lines[p, c] = out[p, c]
    return number


class Around(NamedTuple):
    """What lies around the axle at one station, in the road's frame there.

    ``corners`` (n, 2) of obstacles, ``free`` and ``lines`` (2, bins, ...): counts and lines of ``free_space``, by regions; ``near`` (2,):
    lowest and highest offset on the axle's own normal.
    """

    corners: FloatArray
    free: IntArray
    lines: FloatArray
    near: FloatArray


def unknown(beside: Beside, bins: int) -> Around:
    """Return memory for what is around one station after the other."""
    return Around(np.empty_like(beside.corners), np.zeros((2, bins), np.int64), np.empty((2, bins, MOST, 4)), np.empty(2))


def around_at(beside: Beside, frame: Frame, i: int, reach: float, two_regions: bool, memory: Around) -> Around:
    """Return what lies around station ``i``, as far as bodies within ``reach`` [m] of the axle can touch it; valid until the next call."""
    bins = memory.free.shape[1]
    row = _row(beside, frame, i, reach, two_regions, memory.near)
    for region in range(0 if two_regions else 1, 2):
        if row[0] < row[1]:
            free_space(
                beside, region, row, frame.x[i], frame.y[i], frame.heading[i], memory.near, bins, memory.free[region], memory.lines[region]
            )
    return Around(memory.corners[: _corners_near(beside, frame, i, reach, memory.corners)], memory.free, memory.lines, memory.near)


def _row(beside: Beside, frame: Frame, i: int, reach: float, two_regions: bool, near: FloatArray) -> tuple[int, int]:
    """Return which areas a body can touch whose axle is on the normal, and write between which offsets it crosses that, or nothing."""
    near[0], near[1] = np.inf, -np.inf
    normal = np.array([-np.sin(frame.heading[i]), np.cos(frame.heading[i])])
    origin = np.array([frame.x[i], frame.y[i]])
    crossings = []
    for piece in beside.kerbs.pieces:
        begin, way = np.array([piece["x"], piece["y"]]), piece["length"] * np.array([piece["cos"], piece["sin"]])
        ahead = np.array([begin - origin, begin + way - origin]) @ np.array([normal[1], -normal[0]])
        if piece["s_low"] <= frame.s[i] + _BESIDE_M and piece["s_high"] >= frame.s[i] - _BESIDE_M and (ahead[0] < 0.0) != (ahead[1] < 0.0):
            share = ahead[0] / (ahead[0] - ahead[1])
            s = piece["s_begin"] + share * (piece["s_end"] - piece["s_begin"])
            rises = ahead[1] > ahead[0]
            crossings.append(
                (float((begin + share * way - origin) @ normal), float(s), rises and not piece["left"], not rises and piece["left"])
            )
    crossings.sort()
    gates = [(one, other) for one, other in pairwise(crossings) if one[2] and other[3]]
    if not gates:
        return 0, 0
    one, other = min(gates, key=lambda gate: max(0.0, gate[0][0], -gate[1][0]))
    gate = shapely.LineString([origin + one[0] * normal, origin + other[0] * normal])
    row = [int(np.floor((s - beside.s[0]) / STRETCH_M)) for s in (min(one[1], other[1]), max(one[1], other[1]))]
    row[1] += 1
    for end, step in ((0, -1), (1, 1)):
        regions = (0, 1) if two_regions else (1,)
        while 0 <= row[end] < beside.s.size and min(gate.distance(shapely.LineString(beside.caps[r, row[end]])) for r in regions) <= reach:
            row[end] += step
    if row[0] < 0 or row[1] >= beside.s.size:
        return 0, 0
    near[0], near[1] = one[0], other[0]
    return row[0], row[1]


def _follows(frame: Frame, i: int, former: FloatArray, near: FloatArray) -> bool:
    """Return whether what was reached on the last normal can be followed to the next: the two do not cross in between."""
    if i == 0 or former[0] > min(former[1], near[1]) or near[0] > min(former[1], near[1]):
        return False
    on_last = np.stack([frame.x[i - 1] - former * np.sin(frame.heading[i - 1]), frame.y[i - 1] + former * np.cos(frame.heading[i - 1])])
    ahead = (frame.x[i] - on_last[0]) * np.cos(frame.heading[i]) + (frame.y[i] - on_last[1]) * np.sin(frame.heading[i])
    return bool(np.all(ahead > 0.0))


def _corners_near(beside: Beside, frame: Frame, i: int, reach: float, corners: FloatArray) -> int:
    """Write those corners of obstacles that a body can touch into ``corners``, in the road's frame, and return how many they are."""
    cos, sin = np.cos(frame.heading[i]), np.sin(frame.heading[i])
    number = 0
    for n in range(beside.corners.shape[0]):
        x, y = beside.corners[n, 0] - frame.x[i], beside.corners[n, 1] - frame.y[i]
        u = x * cos + y * sin
        if abs(u) <= reach:
            corners[number, 0], corners[number, 1] = u, y * cos - x * sin
            number += 1
    return number


class Loose(NamedTuple):
    """A body's poses in the road's frame but for e.

    Its heading is ``turned`` off the road's within ``spread`` [rad], its point of reference lies at (``u``, e + ``v``) within ``give`` [m].
    """

    turned: float
    spread: float
    u: float
    v: float
    give: float


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
        number = kept_of(room, left_over, pieces)
        if number == 0:
            return 0
    if around.corners.shape[0] > 0:
        number = _off_corners(outline, pose, around.corners, pieces, number, room)
    return number


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
        number = kept_of(room, left_over, pieces)
        if number == 0:
            return 0
    return number


def fits(outline: Outline, beside: Beside, two_regions: bool, frame: Frame, reach: float, bins: int) -> int:
    """Return the first station at which the body fits in no pose, its axle on the normal there; -1 if there is none."""
    pieces, room = np.empty((MOST, 2)), np.empty((2 * MOST, 2))
    memory = unknown(beside, bins)
    cells = int(0.5 * np.pi / _CELL) + 1
    for i in range(frame.s.size):
        around = around_at(beside, frame, i, reach, two_regions, memory)
        found = around.near[0] > around.near[1]  # nothing is known
        for cell in range(0 if found else 2 * cells):  # the headings along the road first
            turned = (cell // 2 + 0.5) * _CELL * (1.0 if cell % 2 == 0 else -1.0)
            pieces[0, 0], pieces[0, 1] = around.near[0], around.near[1]
            if trim(outline, Loose(turned, 0.5 * _CELL, 0.0, 0.0, 0.0), around, pieces, 1, room) > 0:
                found = True
                break
        if not found:
            return i
    return -1


_ITERATIONS, _CONVERGED = 40, 1e-6  # [rad]
_STEEPEST = 1.5  # where chords get that long, cells reach to WIDEST, and the station counts as unbounded [rad]
_MARGIN = 0.05  # from there on what is left counts as unbounded [rad]
WIDEST = 1.35  # a heading off the road's beyond which nothing is bounded [rad]


def reachable(
    outline: Outline, kappa: float, beside: Beside, two_regions: bool, frame: Frame, grid: Grid, reach: float, bins: int, keep: IntArray,
    kept: FloatArray,
) -> Reached:  # fmt: skip
    """Follow everything that a body can reach from any pose at the first station, until nothing is left.

    ``kappa`` is the largest curvature [1/m], ``reach`` how far the outline lies from the axle [m]. ``keep`` (stations, cells) and ``kept``
    (stations, cells, MOST, 2) take the sets; empty arrays keep nothing.
    """
    stations = frame.s.size
    memory = unknown(beside, bins)
    number, pieces = np.zeros(grid.cells, np.int64), np.empty((grid.cells, MOST, 2))
    before, former = np.zeros(grid.cells, np.int64), np.empty((grid.cells, MOST, 2))
    room, slopes = np.empty((2 * MOST, 2)), np.empty((2 * grid.cells, 2))
    low, high, right, left = np.full(stations, np.nan), np.full(stations, np.nan), np.full(stations, np.nan), np.full(stations, np.nan)
    filled = np.zeros(stations, np.int64)
    opened = -1
    begin, end, cells = 0, 0, 0  # the cells that hold anything, and how many a step has reached over
    for i in range(stations):
        last_near = memory.near.copy()
        around = around_at(beside, frame, i, reach, two_regions, memory)
        near = around.near
        if near[0] > near[1]:
            opened = i
            continue
        fresh = opened == i - 1 or not _follows(frame, i, last_near, near)
        widest = 0.5 * np.pi if fresh else WIDEST
        lowest = max(0, int(np.floor((frame.heading[i] - widest - grid.first) / grid.size)))
        highest = min(grid.cells, int(np.ceil((frame.heading[i] + widest - grid.first) / grid.size)))
        wide = int((WIDEST - _MARGIN) / grid.size)
        middle = int((frame.heading[i] - grid.first) / grid.size)
        if fresh:
            for j in range(grid.cells):
                number[j] = 0
            for j in range(lowest, highest):
                number[j], pieces[j, 0, 0], pieces[j, 0, 1] = 1, near[0], near[1]
            begin, end = lowest, highest
        else:
            number, before = before, number
            pieces, former = former, pieces
            span = Span(begin, end, lowest, highest)
            begin, end, cells = step(kappa, frame, grid, i, Cells(before, former), span, Cells(number, pieces), slopes)
        first, last = end, begin
        for j in range(begin, end):
            if number[j] > 0:
                turned = grid.first + (j + 0.5) * grid.size - frame.heading[i]
                number[j] = trim(outline, Loose(turned, 0.5 * grid.size, 0.0, 0.0, 0.0), around, pieces[j], number[j], room)
                if number[j] > 0:
                    first, last = min(first, j), max(last, j + 1)
                    filled[i] += 1
                    low[i] = min(pieces[j, 0, 0], low[i]) if filled[i] > 1 else pieces[j, 0, 0]
                    high[i] = max(pieces[j, number[j] - 1, 1], high[i]) if filled[i] > 1 else pieces[j, number[j] - 1, 1]
        if filled[i] == 0:
            return Reached(i, opened, low, high, right, left, filled)
        begin, end = first, last
        right[i] = grid.first + begin * grid.size - frame.heading[i]
        left[i] = grid.first + end * grid.size - frame.heading[i]
        if begin < middle - wide + cells or end > middle + wide - cells:
            opened = i  # it may stand across the road: this station bounds nothing
        if keep.size > 0:
            for j in range(grid.cells):
                keep[i, j] = number[j] if begin <= j < end else 0
                for k in range(keep[i, j]):
                    kept[i, j, k, 0], kept[i, j, k, 1] = pieces[j, k, 0], pieces[j, k, 1]
    return Reached(-1, opened, low, high, right, left, filled)


def most_turned(kappa: float, furthest: float, off: float, steepest: float) -> float:
    """Return by how much the heading can turn between two stations [rad]: the chord is longer, the steeper, and turns the more, the longer.

    ``furthest`` is the chord's largest length along the new normal's direction [m], ``off`` the largest heading off it at the first
    station, ``steepest`` the one that is never passed [rad].
    """
    turned = 0.0
    for _ in range(_ITERATIONS):
        before, steep = turned, min(off + turned, steepest)
        turned = kappa * furthest / np.cos(steep) / np.cos(min(turned, 0.5))
        if turned - before < _CONVERGED:
            break
    return 1.001 * turned


def step(
    kappa: float, frame: Frame, grid: Grid, i: int, last_cells: Cells, span: Span, cells_now: Cells, slopes: FloatArray
) -> tuple[int, int, int]:
    """Write what station ``i`` can be reached with, from what was reached at the last one.

    Return the cells that may hold anything, and how many cells a heading may have changed by. ``slopes`` (2 cells, 2) is memory.
    """
    before, former, number, pieces = last_cells.number, last_cells.pieces, cells_now.number, cells_now.pieces
    begin, end, lowest, highest = span.begin, span.end, span.lowest, span.highest
    x, y = frame.x[i] - frame.x[i - 1], frame.y[i] - frame.y[i - 1]
    turn = frame.heading[i] - frame.heading[i - 1]
    cos, sin = np.cos(frame.heading[i]), np.sin(frame.heading[i])
    ahead, across = x * cos + y * sin, y * cos - x * sin  # of the new point seen from the old one, along the new axes
    cos, sin = np.cos(turn), np.sin(turn)
    for j in range(grid.cells):
        number[j] = 0
    most = 2.0 * kappa * ahead + grid.size  # more than any heading changes by while the axle stays on this side of the road's centre
    for p in range(2 * lowest, 2 * highest):  # tan of the middle between two cells' right edges, and a bound of its slope around there
        middle = grid.first + 0.5 * p * grid.size - frame.heading[i]
        tan, steepest = np.tan(middle), np.tan(min(abs(middle) + most + grid.size, 1.55))
        slopes[p, 0], slopes[p, 1] = tan, 1.0 + steepest * steepest
    first, last, furthest_cell = grid.cells, 0, 0
    for j in range(begin, end):
        if before[j] == 0:
            continue
        theta = grid.first + j * grid.size - frame.heading[i]  # of the cell's right edge, off the new normal's direction
        furthest = max(ahead - former[j, 0, 0] * sin, ahead - former[j, before[j] - 1, 1] * sin)
        if furthest <= 0.0:
            continue  # the normals cross here: beyond the centre of curvature
        turned = most_turned(kappa, furthest, max(abs(theta), abs(theta + grid.size)), _STEEPEST)
        cells = int(np.ceil(turned / grid.size))
        furthest_cell = max(furthest_cell, cells)
        cubed = (turned + grid.size) ** 3 / 6.0
        for k in range(max(lowest, j - cells), min(highest, j + cells + 1)):
            ratio = (k - j) * grid.size / turned
            bulge = 0.25 * turned * max(0.0, 1.0 - ratio * ratio) + cubed
            tan, slope = slopes[j + k, 0], slopes[j + k, 1]
            if bulge > most:
                slope = 2000.0
            tan_low, tan_high = tan - slope * bulge, tan + slope * (grid.size + bulge)
            for p in range(before[j]):
                low, high = former[j, p, 0], former[j, p, 1]
                low = max(ahead - low * sin, 0.0) * tan_low + low * cos - across
                high = max(ahead - high * sin, 0.0) * tan_high + high * cos - across
                if number[k] == 1 and low <= pieces[k, 0, 1] and high >= pieces[k, 0, 0]:  # nearly always one interval grows
                    pieces[k, 0, 0], pieces[k, 0, 1] = min(low, pieces[k, 0, 0]), max(high, pieces[k, 0, 1])
                    continue
                number[k] = joined(pieces[k], number[k], low, high)
        first, last = min(first, max(lowest, j - cells)), max(last, min(highest, j + cells + 1))
    return first, last, furthest_cell


SCALE = 8.0  # of W: about the length over which a trailer turns [m]
LEADING = 0.04  # cells of the leading heading in which the room that a trailer leaves is tabulated [rad]
SIDEWAYS = 1.3  # off the road's heading: no leading unit is said to stand across the road by more than 74 degrees [rad]
STRIPS = 24  # of W looked at one by one: a polygon that is wide is far from empty


class Polygons(NamedTuple):
    """What cells hold: whether anything (cells,), and the supports of its polygon (cells, SIDES) [m]."""

    full: BoolArray
    h: FloatArray


def reachable_with_trailer(
    pair: Pair, kappa: float, beside: Beside, two_regions: bool, frame: Frame, grid: Grid, reach: float, bins: int
) -> Reached:
    """Follow everything that a vehicle can reach from any pose at the first station, until nothing is left.

    ``reach`` is how far any point lies from the leading axle [m]. The trailer's heading is looked at in cells like the leading one's. See
    ``reachable``; the offsets and headings are those of the leading unit.
    """
    coupling = pair.coupling
    stations = frame.s.size
    memory = unknown(beside, bins)
    full, h = np.zeros(grid.cells, np.bool_), np.empty((grid.cells, SIDES))
    before, former = np.zeros(grid.cells, np.bool_), np.empty((grid.cells, SIDES))
    directions = np.empty((SIDES, 2))
    for d in range(SIDES):
        directions[d, 0], directions[d, 1] = np.cos(2.0 * np.pi * d / SIDES), np.sin(2.0 * np.pi * d / SIDES)
    low, high, right, left = np.full(stations, np.nan), np.full(stations, np.nan), np.full(stations, np.nan), np.full(stations, np.nan)
    filled = np.zeros(stations, np.int64)
    widest_x = min(-coupling.first, coupling.first + coupling.step * (coupling.rate.size - 1)) + grid.size
    allowed = np.zeros((int(np.pi / LEADING) + 2, int(2.0 * np.pi / grid.size) + 2, 3))
    begin, end, opened = 0, 0, -1
    for i in range(stations):
        last_near = memory.near.copy()
        around = around_at(beside, frame, i, reach, two_regions, memory)
        near = around.near
        if near[0] > near[1]:
            opened = i
            continue
        lowest = max(0, int(np.ceil((frame.heading[i] - SIDEWAYS - grid.first) / grid.size)) - 1)
        highest = min(grid.cells, int(np.floor((frame.heading[i] + SIDEWAYS - grid.first) / grid.size)) + 1)
        if not _follows(frame, i, last_near, near):
            for j in range(lowest, highest):
                full[j] = True
                theta = grid.first + (j + 0.5) * grid.size
                box(directions, near[0], near[1], SCALE * (theta - widest_x), SCALE * (theta + widest_x), h[j])
            begin, end = lowest, highest
        else:
            full, before = before, full
            h, former = former, h
            span = Span(begin, end, lowest, highest)
            begin, end = _step(coupling, kappa, frame, grid, directions, i, Polygons(before, former), span, Polygons(full, h))
        first, last = end, begin
        for j in range(begin, end):
            if full[j]:
                theta = grid.first + (j + 0.5) * grid.size
                h[j, SIDES // 4] = min(h[j, SIDES // 4], SCALE * (theta + widest_x))
                h[j, 3 * SIDES // 4] = min(h[j, 3 * SIDES // 4], SCALE * (widest_x - theta))
                full[j] = _trimmed(pair, frame, grid, directions, i, j, around, allowed, h[j])
                if full[j]:
                    first, last = min(first, j), max(last, j + 1)
                    filled[i] += 1
                    low[i] = min(-h[j, SIDES // 2], low[i]) if filled[i] > 1 else -h[j, SIDES // 2]
                    high[i] = max(h[j, 0], high[i]) if filled[i] > 1 else h[j, 0]
        if filled[i] == 0:
            return Reached(i, opened, low, high, right, left, filled)
        begin, end = first, last
        right[i] = grid.first + begin * grid.size - frame.heading[i]
        left[i] = grid.first + end * grid.size - frame.heading[i]
    return Reached(-1, opened, low, high, right, left, filled)


def _step(
    coupling: Coupling, kappa: float, frame: Frame, grid: Grid, directions: FloatArray, i: int, last: Polygons, span: Span, now: Polygons
) -> tuple[int, int]:
    """Write what station ``i`` can be reached with, from what was reached at the last one; see ``reach`` for heading and offset."""
    before, former, full, h = last.full, last.h, now.full, now.h
    begin, end, lowest, highest = span.begin, span.end, span.lowest, span.highest
    x, y = frame.x[i] - frame.x[i - 1], frame.y[i] - frame.y[i - 1]
    turn = frame.heading[i] - frame.heading[i - 1]
    cos, sin = np.cos(frame.heading[i]), np.sin(frame.heading[i])
    ahead, across = x * cos + y * sin, y * cos - x * sin
    cos, sin = np.cos(turn), np.sin(turn)
    for j in range(grid.cells):
        full[j] = False
    base = np.empty(SIDES)
    lowest_met, highest_met = grid.cells, 0
    half, quarter = SIDES // 2, SIDES // 4
    for j in range(begin, end):
        if not before[j]:
            continue
        theta = grid.first + j * grid.size - frame.heading[i]  # of the cell's right edge, off the new normal's direction
        e_low, e_high = -former[j, half], former[j, 0]
        w_low, w_high = -former[j, half + quarter] / SCALE, former[j, quarter] / SCALE
        e, e_half = 0.5 * (e_low + e_high), 0.5 * (e_high - e_low)
        w, w_half = 0.5 * (w_low + w_high), 0.5 * (w_high - w_low)
        furthest = max(ahead - e_low * sin, ahead - e_high * sin)
        if furthest <= 0.0:
            continue  # the normals cross here: beyond the centre of curvature
        turned = most_turned(kappa, furthest, max(abs(theta), abs(theta + grid.size)), SIDEWAYS + abs(turn) + grid.size)
        cells = int(np.ceil(turned / grid.size))
        cubed = (turned + grid.size) ** 3 / 6.0
        # The rate of W over all x that are met, as middle + slope x within rough.
        absolute = grid.first + j * grid.size
        slope, constant, rough = _straight(coupling, absolute - turned - w_high, absolute + grid.size + turned - w_low)
        advance = ahead - e * sin  # of the middle, along the new normal's direction
        centre = theta + 0.5 * grid.size
        tan_0, sec_0 = np.tan(centre), 1.0 / np.cos(centre)
        length_0 = advance * sec_0
        short_0 = length_0 - 0.5 * slope * length_0 * length_0
        rate_0 = constant + slope * (absolute + 0.5 * grid.size - w)
        # (e, W) - (middle) -> linear part of the map, the same for all targets
        of_e, w_of_e, w_of_w = cos - sin * tan_0, -sin * sec_0 * rate_0, 1.0 - short_0 * slope
        for d in range(SIDES):
            dx, dy = of_e * directions[d, 0] + SCALE * w_of_e * directions[d, 1], w_of_w * directions[d, 1]
            base[d] = support(directions, former[j], dx, dy) - dx * e - dy * SCALE * w
        longest = furthest * sec_0 * 1.1
        for k in range(max(lowest, j - cells), min(highest, j + cells + 1)):
            ratio = (k - j) * grid.size / turned
            bulge = 0.25 * turned * max(0.0, 1.0 - ratio * ratio) + cubed
            off = theta + 0.5 * (k - j) * grid.size
            tan_low, tan_high = np.tan(off - bulge), np.tan(off + grid.size + bulge)
            tan, tan_half = 0.5 * (tan_low + tan_high), 0.5 * (tan_high - tan_low)
            steepest, flattest = max(abs(tan_low), abs(tan_high)), 0.0 if tan_low <= 0.0 <= tan_high else min(abs(tan_low), abs(tan_high))
            sec_low = np.sqrt(1.0 + flattest * flattest)
            sec_high = np.sqrt(1.0 + steepest * steepest) * (1.0 + turned * turned)
            sec, sec_half = 0.5 * (sec_low + sec_high), 0.5 * (sec_high - sec_low)
            length = advance * sec
            short = length - 0.5 * slope * length * length
            mean = absolute + 0.5 * (k - j) * grid.size + 0.5 * grid.size
            rate = constant + slope * (mean - w)
            fastest = abs(rate) + abs(slope) * (w_half + bulge + 0.5 * grid.size) + rough
            new_e = advance * tan + e * cos - across
            new_w = w + short * rate
            err_e = furthest * tan_half + abs(sin) * abs(tan - tan_0) * e_half
            err_w = (
                longest * (abs(slope) * (0.5 * grid.size + bulge) + rough)
                + furthest * sec_half * fastest
                + abs(sin) * e_half * (abs(sec * rate - sec_0 * rate_0) + sec * abs(slope) * w_half + abs(slope) * longest * fastest)
                + abs(short - short_0) * abs(slope) * w_half
                + (slope * longest) ** 2 * (turned + grid.size + longest * fastest)
            )
            for d in range(SIDES):
                dx, dy = directions[d, 0], directions[d, 1] * SCALE
                value = base[d] + dx * new_e + dy * new_w + abs(dx) * err_e + abs(dy) * err_w + ROUNDING
                h[k, d] = max(h[k, d], value) if full[k] else value
            full[k] = True
        lowest_met, highest_met = min(lowest_met, max(lowest, j - cells)), max(highest_met, min(highest, j + cells + 1))
    return lowest_met, highest_met


def _straight(coupling: Coupling, x_low: float, x_high: float) -> tuple[float, float, float]:
    """Return slope, constant and largest error of a straight line through the rate of W between two x."""
    most = coupling.rate.size - 1
    a = min(max(int((x_low - coupling.first) / coupling.step), 0), most - 1)
    b = min(max(int((x_high - coupling.first) / coupling.step) + 1, a + 1), most)
    slope = (coupling.rate[b] - coupling.rate[a]) / ((b - a) * coupling.step)
    low, high = np.inf, -np.inf
    for n in range(a, b + 1):
        over = coupling.rate[n] - slope * (coupling.first + n * coupling.step)
        low, high = min(low, over), max(high, over)
    return slope, 0.5 * (low + high), 0.5 * (high - low) + 1e-7  # between the table's entries


def _trimmed(
    pair: Pair, frame: Frame, grid: Grid, directions: FloatArray, i: int, j: int, around: Around, allowed: FloatArray, h: FloatArray
) -> bool:
    """Cut a polygon down to where both bodies may fit; return whether anything is left. ``allowed``: see ``_trailer_room``."""
    coupling = pair.coupling
    half, quarter = SIDES // 2, SIDES // 4
    turned = grid.first + (j + 0.5) * grid.size - frame.heading[i]
    pieces, room = np.empty((MOST, 2)), np.empty((2 * MOST, 2))
    pieces[0, 0], pieces[0, 1] = -h[half], h[0]
    number = trim(pair.lead, Loose(turned, 0.5 * grid.size, 0.0, 0.0, 0.0), around, pieces, 1, room)
    if number == 0:
        return False
    h[half], h[0] = -pieces[0, 0], pieces[number - 1, 1]
    if not tight(directions, h):
        return False
    aside = coupling.hitch_offset * np.sin(turned)  # of the axle from the coupling
    give = 0.5 * abs(coupling.hitch_offset) * grid.size
    w_low, w_high = -h[half + quarter] / SCALE, h[quarter] / SCALE
    strips = min(max(1, int(np.ceil((w_high - w_low) / grid.size))), STRIPS)
    width = (w_high - w_low) / strips
    spread = 0.5 * (width * (1.0 + coupling.offset_share) + coupling.offset_share * grid.size) + 1e-6
    theta = frame.heading[i] + turned
    new = np.full(SIDES, -np.inf)
    anything = False
    for n in range(strips):
        a, b = SCALE * (w_low + n * width), SCALE * (w_low + (n + 1) * width)
        low, high = -np.inf, np.inf  # of the polygon within the strip
        for d in range(SIDES):
            x, y = directions[d, 0], directions[d, 1]
            if x > ROUNDING:
                high = min(high, max((h[d] - y * a) / x, (h[d] - y * b) / x))
            elif x < -ROUNDING:
                low = max(low, min((h[d] - y * a) / x, (h[d] - y * b) / x))
        if low > high:
            continue
        at = (theta - 0.5 * (a + b) / SCALE - coupling.first) / coupling.step
        entry = min(max(int(at), 0), coupling.angle.size - 2)
        over = min(max(at - entry, 0.0), 1.0)
        gamma = coupling.angle[entry] + over * (coupling.angle[entry + 1] - coupling.angle[entry])
        free_low, free_high = _trailer_room(pair, turned, turned - gamma, spread, grid.size, i + 1, around, allowed)
        low, high = max(low, free_low + aside - give), min(high, free_high + aside + give)
        if low > high:
            continue
        anything = True
        for d in range(SIDES):
            x, y = directions[d, 0], directions[d, 1]
            new[d] = max(new[d], max(x * low, x * high) + max(y * a, y * b))
    if not anything:
        return False
    for d in range(SIDES):
        h[d] = min(h[d], new[d])
    return tight(directions, h)


def _trailer_room(
    pair: Pair, turned: float, heading: float, spread: float, strip: float, station: int, around: Around, allowed: FloatArray
) -> tuple[float, float]:
    """Return between which offsets the coupling can lie, when the trailer's heading is within ``spread`` of ``heading`` off the road's.

    It depends on the leading unit's heading ``turned`` only by how far the coupling lies ahead. So ``allowed`` (leading headings in steps
    of ``LEADING``, trailer headings in steps of ``strip``, 3) keeps what was found, and at which ``station``.
    """
    coupling, near = pair.coupling, around.near
    leading = int((turned + 0.5 * np.pi) / LEADING)
    middle = (leading + 0.5) * LEADING - 0.5 * np.pi
    u = -coupling.hitch_offset * np.cos(middle)
    give = abs(coupling.hitch_offset) * (abs(np.sin(middle)) + 0.5 * LEADING) * 0.5 * LEADING
    first = max(int((heading - spread + np.pi) / strip), 0)
    last = min(int((heading + spread + np.pi) / strip), allowed.shape[1] - 1)
    low, high = np.inf, -np.inf
    reach = abs(coupling.hitch_offset)
    pieces, room = np.empty((MOST, 2)), np.empty((2 * MOST, 2))
    for c in range(first, last + 1):
        if allowed[leading, c, 2] != station:
            pieces[0, 0], pieces[0, 1] = near[0] - reach, near[1] + reach
            pose = Loose((c + 0.5) * strip - np.pi, 0.5 * strip, u, 0.0, give)
            number = trim(pair.trailer, pose, around, pieces, 1, room)
            allowed[leading, c, 0] = pieces[0, 0] if number > 0 else np.inf
            allowed[leading, c, 1] = pieces[number - 1, 1] if number > 0 else -np.inf
            allowed[leading, c, 2] = station
        low, high = min(low, allowed[leading, c, 0]), max(high, allowed[leading, c, 1])
    return low, high
