"""The places of a body's edges that come nearest to a limit, and the rows that keep them from it.

Of every edge the sampled points are looked at and, where limits change or the road bends, the tightest place between them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hdvplan.jit import FloatArray, Record, Records, inlined, inner
from hdvplan.planning.stations import LimitTable
from hdvplan.planning.terms.screening import CLEAR_M
from hdvplan.road.path import PLANNING_STEP_M, Curve, project
from hdvplan.vehicle.body import POINTS_PER_EDGE
from hdvplan.vehicle.kinematics import body_point, point_gradient

ROWS_PER_EDGE = 2  # the tightest points of each edge that enter the QP; all points are checked after the solve
WALL = 1.0  # slope of a limit from which on it is a wall: turning away from one must not look better than passing it
# What is kept of a place on an edge while its rows are chosen: where it is on the body [m], in the plane and on the road, and its limit.
PLACE = np.dtype([(name, float) for name in ("ahead", "x", "y", "foot", "offset", "cos", "sin", "curvature", "slope", "gap")])


class Bodies(NamedTuple):
    """What the rows of a drive are about."""

    units: Records
    points: Records  # (units, points) of ``EDGE_POINT``
    axis: FloatArray  # (units, 4), see ``axis_points`` [m]
    behind: FloatArray  # (units,), of every axle behind the lead rear axle on a straight [m]
    reach: float  # furthest from the lead axle that any point of a body can be [m]
    curve: Curve
    table: LimitTable
    clearance: float  # to keep from every limit, beyond what sampling needs [m]


@inlined
def limit_at(table: LimitTable, row: int, s: float) -> tuple[float, float]:
    """Return a limit and its slope along s: linear between the table's entries, constant beyond them."""
    place = (s - table.s_first) / table.spacing
    index = min(max(int(place), 0), table.values.shape[1] - 2)
    low, high = table.values[row, index], table.values[row, index + 1]
    part = place - index
    if part <= 0.0:
        return low, 0.0 if part < 0.0 else (high - low) / table.spacing
    if part > 1.0:
        return high, 0.0
    return low + part * (high - low), (high - low) / table.spacing


@inner
def look(curve: Curve, table: LimitTable, pose: Record, ahead: float, left: float, row: int, near: float, place: Record) -> bool:
    """Write all about the place of an edge ``ahead`` of the axle and ``left`` of its axis; False where it has no foot."""
    x, y = body_point(pose, ahead, left)
    s, e, cos, sin, k = project(curve, x, y, near, PLANNING_STEP_M)
    limit, slope = limit_at(table, row, s)
    place.ahead, place.x, place.y, place.foot, place.offset, place.cos, place.sin = ahead, x, y, s, e, cos, sin
    place.curvature, place.slope, place.gap = k, slope if abs(slope) < WALL else 0.0, limit - e if left > 0.0 else e - limit
    return not np.isnan(e)


@inner
def tightest_between(table: LimitTable, points: Records, side: int, steady: bool, seen: Records) -> tuple[int, float, int]:
    """Return the sampled point behind an edge's tightest place between two of them, how far ahead of the axle that lies, and its entry.

    Between two points a straight edge runs along their chord and, by the road's curvature, beside it. ``steady`` limits leave the
    middle of that bow to look at, which belongs to no entry of the table: -1. Other limits are tightest at one of their entries. The
    point is -1 where no place between is tighter than both its neighbours.
    """
    sign = 1.0 - 2.0 * side
    found, ahead, nearest, tightest = -1, 0.0, -1, np.inf
    for number in range(points.size - 1):
        point, ahead_of_it, own, following = points[number], points[number + 1], seen[number], seen[number + 1]
        along, rise, length = following.foot - own.foot, following.offset - own.offset, ahead_of_it.ahead - point.ahead
        k = 0.5 * (own.curvature + following.curvature)
        bow = 0.5 * k / (1.0 - k * own.offset) * length * length
        ends = min(own.gap, following.gap)
        row = side + 2 * max(point.overhang, ahead_of_it.overhang)
        if steady:
            if sign * bow > abs(rise):  # the bow's summit lies between the points
                part = 0.5 + 0.5 * rise / bow
                gap = own.gap - sign * (part * rise + part * (1.0 - part) * bow)
                if gap < min(tightest, ends):
                    found, ahead, tightest = number, point.ahead + part * length, gap
            continue
        first = int(np.ceil((own.foot - table.s_first) / table.spacing))
        last = int(np.floor((following.foot - table.s_first) / table.spacing))
        for entry in range(max(first, 0), min(last, table.values.shape[1] - 1) + 1):
            part = (table.s_first + entry * table.spacing - own.foot) / along
            gap = sign * (table.values[row, entry] - own.offset - part * rise - part * (1.0 - part) * bow)
            if gap < min(tightest, ends):
                found, ahead, nearest, tightest = number, point.ahead + part * length, entry, gap
    return found, ahead, nearest


@inner
def write_row(
    poses: Records, unit: int, sign: float, at: Record, place: Record, slope: float, gap: float, gradients: FloatArray, row: Record
) -> None:
    """Write the row that keeps the offset of a place at least ``gap`` inside its limit, which has ``slope`` along s there.

    ``gradients`` (2, n) is memory.
    """
    across, along = gradients[0], gradients[1]
    point_gradient(poses, unit, place.x, place.y, at, -place.sin, place.cos, across)
    point_gradient(poses, unit, place.x, place.y, at, place.cos, place.sin, along)
    per_t = slope / (1.0 - place.curvature * place.offset)
    for j in range(across.size):
        row.g[j] = sign * (across[j] - per_t * along[j])
    row.h = gap


@inner
def never(rows: Records, begin: int, end: int, clear: float) -> None:
    """Write rows that never bind."""
    for number in range(begin, end):
        row = rows[number]
        for j in range(row.g.size):
            row.g[j] = 0.0
        row.h = clear


@inner
def write_edge(
    bodies: Bodies, at: Record, poses: Records, number: int, side: int, edge: Record, feet: FloatArray, rows: Records, places: Records,
    gradients: FloatArray,
) -> None:  # fmt: skip
    """Write the rows of one edge, and its clearances; these are NaN where a point has no foot."""
    curve, table, points, pose = bodies.curve, bodies.table, bodies.points[number], poses[number]
    sign, count, tightest = 1.0 - 2.0 * side, POINTS_PER_EDGE, np.inf
    edge.gap = edge.clear = np.nan
    left, margin = sign * bodies.units[number].half_width, at.margin + bodies.clearance
    for point in range(count):
        place, own = places[point], points[point]
        if not look(curve, table, pose, own.ahead, left, side + 2 * own.overhang, feet[point, side], place):
            return
        feet[point, side] = place.foot
        tightest = min(tightest, place.gap)
    looked = count
    behind, ahead, entry = tightest_between(table, points, side, at.varies == 0.0, places)
    if behind >= 0:
        place, region = places[count], max(points[behind].overhang, points[behind + 1].overhang)
        if not look(curve, table, pose, ahead, left, side + 2 * region, places[behind].foot, place):
            return
        # At the tightest place between ends edge and limit run alike, or the limit has a corner there that slides
        # along the edge: either way the clearance changes as if the limit had the edge's direction.
        across_road = pose.sin * place.cos - pose.cos * place.sin
        along_road = pose.cos * place.cos + pose.sin * place.sin
        place.slope = (1.0 - place.curvature * place.offset) * across_road / along_road
        if entry >= 0:  # the place was found by a parabola: its foot is centimetres off the entry, on a steep limit
            beyond = table.s_first + entry * table.spacing - place.foot
            place.gap = sign * (table.values[side + 2 * region, entry] - place.offset - place.slope * beyond)
        tightest = min(tightest, place.gap)
        looked += 1
    middle = 0.5 * (points[0].ahead + points[count - 1].ahead)
    for half in range(ROWS_PER_EDGE):
        pick = half * (count - 1)
        for other in range(looked):
            if (places[other].ahead > middle) == (half == 1) and places[other].gap < places[pick].gap:
                pick = other
        place = places[pick]
        write_row(poses, number, sign, at, place, place.slope, place.gap - margin, gradients, rows[half])
    clear = tightest
    if rows.size > ROWS_PER_EDGE:
        for end in range(2):
            corner, row = end * (count - 1), ROWS_PER_EDGE + end
            if points[corner].overhang == 0:
                never(rows, row, row + 1, CLEAR_M)
            else:
                place = places[corner]
                limit, slope = limit_at(table, side, place.foot)
                room = sign * (limit - place.offset)
                clear = min(clear, room)
                write_row(poses, number, sign, at, place, slope, room, gradients, rows[row])
    edge.gap, edge.clear = tightest, clear
