"""The free space beside a road, for a body whose axle is on one of the road's normals.

In the frame of the road's point at an arclength (u ahead, v to the left), the axle lies at (0, e). A body that keeps its heading and
is moved along the normal moves in v alone: all its points keep their u. So the free space is wanted as the free intervals of v at every
u, and then each point of the body says in O(1) which e it allows.

The road is a row of quadrilaterals between neighbouring normals, cut off at the limits; their union, less the obstacles, is free. Every
rounding goes outwards: what is called occupied is occupied. Over a bin of u a free interval lies between two straight lines, which are
moved outwards until they hold every quadrilateral of the bin. Quadrilaterals that are near in the plane, but are not connected with
the axle's place through free space, such as the other leg of a hairpin, are left out: a body is connected.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from hdvplan.jit import FloatArray, IntArray, compiled
from hdvplan.proof.intervals import joined
from hdvplan.road.path import PathPoint, ReferencePath
from hdvplan.road.regions import OPEN_M, Kind
from hdvplan.road.road import Road

STRIP_M = 0.25  # of road per quadrilateral: limits are judged at these arclengths
BIN_M = 0.1  # of u
MOST = 6  # free intervals that are stored for one u; of more, the outermost are joined
_OUTSIDE_M = 60.0  # free beyond the ends of what is looked at: as far as any body reaches
_ARC_M = 1e-3  # a limit between two normals against its chord, at a curvature of 0.1 1/m; and rounding
_JUMP = 0.2  # slope of a limit from which it counts as a jump, which is judged at the arclengths around it alone
_FOLD = 0.999  # of the radius: nothing that is judged lies further inside a bend
ROUNDING = 1e-9  # of coordinates [m]
SLIVER_M = 1e-6  # what is less wide between two triangles of an obstacle is rounding


class Beside(NamedTuple):
    """What lies beside a stretch of road in the plane; quadrilaterals in order of s, the first and last reach beyond the stretch.

    ``quads`` (2, n, 4, 2) [m]: for wheels, and for whole bodies; corners right and left at one normal, left and right at the next.
    ``s`` (n + 1,): arclengths of the normals [m]. ``blocked`` (m, 3, 2): triangles of obstacles, ``corners`` (k, 2): their corners.
    """

    quads: FloatArray
    s: FloatArray
    blocked: FloatArray
    corners: FloatArray


class Frame(NamedTuple):
    """The road's points at the stations of a proof: arclength [m], position [m], unwrapped heading [rad], shape (stations,) each."""

    s: FloatArray
    x: FloatArray
    y: FloatArray
    heading: FloatArray


def frame_of(path: ReferencePath, s: FloatArray) -> Frame:
    """Return the road's points at arclengths ``s`` [m]."""
    point = path.at(s)
    return Frame(s, point.x, point.y, np.unwrap(point.heading))


def beside(road: Road, s_from: float, s_to: float, *, room: float) -> Beside | None:
    """Return the free space from ``s_from`` to ``s_to`` [m], as far as limits and obstacles count there; None where nothing limits it.

    ``room`` is by how much all limits and obstacles give way [m]; negative: room to keep from them.
    """
    obstacles = [region.polygon for region in road.regions if region.kind is Kind.OBSTACLE]
    limits = road.limits if road.edges is None else road.edges
    if limits is None and not obstacles:
        return None
    length = road.path.length
    first, last = max(0.0, s_from), min(length, s_to)
    s = STRIP_M * np.arange(np.ceil(first / STRIP_M - 1e-9), np.floor(last / STRIP_M + 1e-9) + 1.0)
    table = np.array([OPEN_M, -OPEN_M, OPEN_M, -OPEN_M])[:, None] * np.ones(len(s)) if limits is None else limits.table(s)
    point = road.path.at(s)
    inside = _FOLD / np.maximum(np.abs(point.curvature), 1e-9)
    quads = np.stack([_quads(point, inside, table[2 * region], table[2 * region + 1], room) for region in (0, 1)])
    return Beside(quads, np.concatenate([[s[0] - _OUTSIDE_M], s, [s[-1] + _OUTSIDE_M]]), *_blocked(obstacles, room))


def _quads(point: PathPoint, inside: FloatArray, left: FloatArray, right: FloatArray, room: float) -> FloatArray:
    """Return the quadrilaterals between neighbouring normals, and the two beyond the ends, (n + 1, 4, 2)."""
    tangent = np.stack([np.cos(point.heading), np.sin(point.heading)], axis=1)
    normal, centre = tangent[:, ::-1] * np.array([-1.0, 1.0]), np.stack([point.x, point.y], axis=1)
    corners: list[FloatArray] = []  # of the quadrilaterals' left and right sides, each at both normals
    for value, outwards in ((outwards_of * side, outwards_of) for side, outwards_of in ((left, 1.0), (right, -1.0))):
        jumps = np.abs(np.diff(value)) > _JUMP * STRIP_M
        wide = np.maximum(value[:-1], value[1:])
        folds = np.where(outwards * point.curvature > 0.0, inside, np.inf)
        for at in (slice(None, -1), slice(1, None)):
            reach = np.minimum(np.where(jumps, wide, value[at]) + room + _ARC_M, folds[at])
            corners.append(centre[at] + outwards * reach[:, None] * normal[at])
    strips = np.stack([corners[2], corners[0], corners[1], corners[3]], axis=1)
    aside, ahead = _OUTSIDE_M * normal, _OUTSIDE_M * tangent
    first = [centre[0] - aside[0] - ahead[0], centre[0] + aside[0] - ahead[0], centre[0] + aside[0], centre[0] - aside[0]]
    last = [centre[-1] - aside[-1], centre[-1] + aside[-1], centre[-1] + aside[-1] + ahead[-1], centre[-1] - aside[-1] + ahead[-1]]
    return np.ascontiguousarray(np.concatenate([np.stack(first)[None], strips, np.stack(last)[None]]))


def _blocked(obstacles: list[shapely.Polygon], room: float) -> tuple[FloatArray, FloatArray]:
    """Return triangles and corners of all obstacles, each smaller by ``room`` or, where that is negative, larger; rounded inwards."""
    found, corners = [np.empty((0, 3, 2))], [np.empty((0, 2))]
    for obstacle in obstacles:
        # A chord of an arc lies inside a larger obstacle; corners of a smaller one stay corners.
        moved = obstacle.buffer(-room, quad_segs=16, join_style="mitre" if room > 0.0 else "round")
        triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(moved))
        found += [np.asarray(part.exterior.coords)[None, :3] for part in triangles]
        corners.append(shapely.get_coordinates(moved))
    return np.ascontiguousarray(np.concatenate(found)), np.ascontiguousarray(np.concatenate(corners))


@compiled
def free_space(
    beside: Beside, region: int, window: IntArray, x: float, y: float, heading: float, near: FloatArray, bins: int, count: IntArray,
    lines: FloatArray,
) -> None:  # fmt: skip
    """Write the free intervals of v for every bin of u in the frame (x, y, heading).

    Bin n holds u from (n - bins // 2) ``BIN_M``. ``count`` (bins,) intervals, in ``lines`` (bins, MOST, 4): low and high v at the bin's
    first u and their slopes. ``window`` are the first and the last quadrilateral looked at, ``near`` (2,) the v of the axle's own normal.
    """
    first, last = window[0], window[1]
    cos, sin = np.cos(heading), np.sin(heading)
    n = last - first
    corners = np.empty((n, 4, 2))
    extent = np.empty((n, 2))
    for k in range(n):
        low, high = np.inf, -np.inf
        for c in range(4):
            px, py = beside.quads[region, first + k, c, 0] - x, beside.quads[region, first + k, c, 1] - y
            u = px * cos + py * sin
            corners[k, c, 0], corners[k, c, 1] = u, py * cos - px * sin
            low, high = min(low, u), max(high, u)
        extent[k, 0], extent[k, 1] = low, high
    tri, tri_extent = np.empty_like(beside.blocked), np.empty((beside.blocked.shape[0], 2))
    far = BIN_M * bins
    m = 0  # triangles near by
    for k in range(beside.blocked.shape[0]):
        low, high = np.inf, -np.inf
        v_low, v_high = np.inf, -np.inf
        for c in range(3):
            px, py = beside.blocked[k, c, 0] - x, beside.blocked[k, c, 1] - y
            u = px * cos + py * sin
            v = py * cos - px * sin
            tri[m, c, 0], tri[m, c, 1] = u, v
            low, high, v_low, v_high = min(low, u), max(high, u), min(v_low, v), max(v_high, v)
        if high >= -far and low <= far and v_high >= -far and v_low <= far:
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
                for c in range(4):
                    ua, va = corners[k, c, 0], corners[k, c, 1]
                    ub, vb = corners[k, (c + 1) % 4, 0], corners[k, (c + 1) % 4, 1]
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
        pieces = np.empty((MOST, 2))
        total = 0
        for f in range(found):
            total = joined(pieces, total, spans[f, 0] - ROUNDING, spans[f, 1] + ROUNDING)
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
                    for c in range(4):
                        u, v = corners[met[f], c, 0], corners[met[f], c, 1]
                        if u0 <= u <= u1:
                            c_high, c_low = max(c_high, v - of_high * (u - u0)), min(c_low, v - of_low * (u - u0))
            if kept < MOST:
                lines[b, kept, 0], lines[b, kept, 1], lines[b, kept, 2], lines[b, kept, 3] = c_low, c_high, of_low, of_high
                kept += 1
            else:  # too many to tell apart: the last one takes this one in
                _take_in(lines[b, kept - 1], c_low, c_high, of_low, of_high)
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


@compiled
def _take_in(line: FloatArray, low: float, high: float, of_low: float, of_high: float) -> None:
    """Widen one free interval until it holds another."""
    line[0] = min(line[0], low, line[0] + BIN_M * line[2], low + BIN_M * of_low)
    line[1] = max(line[1], high, line[1] + BIN_M * line[3], high + BIN_M * of_high)
    line[2] = line[3] = 0.0


@compiled
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


def bins_for(reach: float) -> int:
    """Return how many bins of u hold all points within ``reach`` [m] of the axle."""
    return 2 * int(np.ceil((reach + 3.0 * BIN_M) / BIN_M)) + 2
