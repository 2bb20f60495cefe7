"""Write the rows of one planning step's QP that keep every body within the limits, linearised at a given motion.

Bodies far from their limits are screened out by bounds that need no projection, or few. Of every other edge the tightest places
enter: sampled points, and where limits change or the road bends, the tightest place between them.
"""

from __future__ import annotations

import numpy as np

from hdvplan.jit import FloatArray, compiled
from hdvplan.road.path import project
from hdvplan.vehicle.body import POINTS_PER_EDGE
from hdvplan.vehicle.kinematics import place, point_gradient

CLEAR_M = 0.25  # a body that stays this far inside the limits by a safe bound needs no rows of its own
_BULGING = 0.5  # curvature times reach up to which a body is screened
WALL = 1.0  # slope of a limit from which on it is a wall: turning away from one must not look better than passing it
ROWS_PER_EDGE = 2  # the tightest points of each edge that enter the QP; all points are checked after the solve


@compiled
def limit_at(limits: FloatArray, s_first: float, spacing: float, row: int, s: float) -> tuple[float, float]:
    """Return a limit and its slope along s: linear between the table's entries, constant beyond them."""
    place_ = (s - s_first) / spacing
    index = min(max(int(place_), 0), limits.shape[1] - 2)
    low, high = limits[row, index], limits[row, index + 1]
    part = place_ - index
    if part <= 0.0:
        return low, 0.0 if part < 0.0 else (high - low) / spacing
    if part > 1.0:
        return high, 0.0
    return low + part * (high - low), (high - low) / spacing


@compiled
def _highest(e: float, slope: float, bend: float, x: float) -> float:
    """Return the maximum of e + slope t + bend t^2 / 2 over t between 0 and x."""
    highest = max(e, e + x * (slope + 0.5 * bend * x))
    if bend < 0.0 and 0.0 < -slope / bend * np.sign(x) < abs(x):
        highest = e - 0.5 * slope * slope / bend
    return highest


@compiled
def _clear_by_state(units: FloatArray, around: FloatArray, i: int, z: FloatArray) -> float:
    """Return a lower bound of all bodies' clearance from the state alone, or -inf where the bound says nothing.

    Along a body's axis the offset e and the heading error phi obey e' = sin(phi), phi' = -cos(phi) k / (1 - k e). From bounds
    of k around the vehicle follow bounds of e'' and of phi', from coupling to coupling. No point needs to be projected.
    """
    room_left, room_right, k_low, k_high = around[0, i], around[1, i], around[2, i], around[3, i]
    reach, k_most = max(room_left, room_right), max(abs(k_low), abs(k_high))
    if k_most * reach > _BULGING:
        return -np.inf
    most, least = 1.0 / (1.0 - k_most * reach), 1.0 / (1.0 + k_most * reach)
    e_low = e_high = z[0]
    phi_low = phi_high = z[1]
    clearance = np.inf
    for unit in range(units.shape[0]):
        behind = units[unit, 0] if unit > 0 else 0.0  # of the axle behind the point whose offset is known
        rear, front, coupling = -behind - units[unit, 3], units[unit, 2] - behind, -behind - units[unit, 1]
        steep = max(abs(phi_low), abs(phi_high)) + max(front, -rear, -coupling) * k_most * most
        if steep > 1.0 or e_high > reach or e_low < -reach:
            return -np.inf
        cos = np.cos(steep)
        upper = -k_low * (cos * cos * least if k_low > 0.0 else most)  # bounds of e'' and of phi'
        lower = -k_high * (most if k_high > 0.0 else cos * cos * least)
        slope_low, slope_high = np.sin(phi_low), np.sin(phi_high)
        high = max(_highest(e_high, slope_low, upper, rear), _highest(e_high, slope_high, upper, front))
        low = -max(_highest(-e_low, -slope_high, -lower, rear), _highest(-e_low, -slope_low, -lower, front))
        clearance = min(clearance, room_left - high - units[unit, 4], room_right + low - units[unit, 4])
        if not clearance > CLEAR_M:
            return -np.inf
        if unit + 1 < units.shape[0]:
            x, ahead = coupling, coupling > 0.0
            e_high += x * (slope_high if ahead else slope_low) + 0.5 * x * x * upper
            e_low += x * (slope_low if ahead else slope_high) + 0.5 * x * x * lower
            phi_high += max(x * upper, x * lower) - z[2 + unit]
            phi_low += min(x * upper, x * lower) - z[2 + unit]
    return clearance


@compiled
def _clearances(
    units: FloatArray, axis: FloatArray, coefficients: FloatArray, s_first: float, spacing: float, around: FloatArray, poses: FloatArray,
    unit: int, i: int, feet: FloatArray,
) -> tuple[float, float]:  # fmt: skip
    """Return lower bounds of a body's clearance left and right at stage i; NaN where a point of its axis has no foot.

    Along a straight line the offset e obeys e'' = -cos^2 k / (1 - k e): between points of the body's axis it lies within
    k l^2 / 8 (1 - k e) of their chord, to the left in a left bend and to the right in a right one.
    """
    high, low, longest = -np.inf, np.inf, 0.0
    for point in range(axis.shape[1]):
        ahead = axis[unit, point]
        x, y = poses[unit, 0] + ahead * poses[unit, 2], poses[unit, 1] + ahead * poses[unit, 3]
        feet[i, unit, point], e, _, _, _ = project(coefficients, s_first, spacing, x, y, feet[i, unit, point])
        if np.isnan(e):
            return e, e
        high, low = max(high, e), min(low, e)
        if point > 0:
            longest = max(longest, ahead - axis[unit, point - 1])
    half, reach = units[unit, 4], max(high, -low) + 2.0 * units[unit, 4]
    left, right = max(around[3, i], 0.0), max(-around[2, i], 0.0)
    if max(left, right) * reach > _BULGING:  # too close to the centre of curvature for the bound to be worth anything
        return -np.inf, -np.inf
    bulge_left = 0.125 * longest * longest * left / (1.0 - left * reach)
    bulge_right = 0.125 * longest * longest * right / (1.0 - right * reach)
    return around[0, i] - high - half - bulge_left, around[1, i] + low - half - bulge_right


# What is kept of a place on an edge while its rows are chosen: where it is on the body, in the plane and on the road, and its limit.
AHEAD, X, Y, FOOT, OFFSET, COS, SIN, CURVATURE, SLOPE, GAP = range(10)
PLACES = POINTS_PER_EDGE + 1  # the sampled points, and one place between them


@compiled
def _look(
    coefficients: FloatArray, s_first: float, spacing: float, limits: FloatArray, limit_first: float, limit_spacing: float,
    poses: FloatArray, unit: int, ahead: float, across: float, row: int, near: float, seen: FloatArray, at: int,
) -> bool:  # fmt: skip
    """Write into ``seen[at]`` all about the place of an edge ``ahead`` of the axle and ``across`` its axis; False where it has no foot.

    Arrays come whole, with an index: a slice costs as much as half a projection.
    """
    cos_u, sin_u = poses[unit, 2], poses[unit, 3]
    x, y = poses[unit, 0] + ahead * cos_u - across * sin_u, poses[unit, 1] + ahead * sin_u + across * cos_u
    s, e, cos, sin, k = project(coefficients, s_first, spacing, x, y, near)
    limit, slope = limit_at(limits, limit_first, limit_spacing, row, s)
    seen[at, AHEAD], seen[at, X], seen[at, Y], seen[at, FOOT], seen[at, OFFSET], seen[at, COS], seen[at, SIN] = ahead, x, y, s, e, cos, sin
    seen[at, CURVATURE], seen[at, SLOPE], seen[at, GAP] = k, slope if abs(slope) < WALL else 0.0, limit - e if across > 0.0 else e - limit
    return not np.isnan(e)


@compiled
def _tightest_between(
    limits: FloatArray, limit_first: float, limit_spacing: float, points: FloatArray, unit: int, side: int, steady: bool, seen: FloatArray
) -> tuple[int, float, int]:
    """Return the sampled point behind an edge's tightest place between two of them, how far ahead of the axle that lies, and its entry.

    Between two points a straight edge runs along their chord and, by the road's curvature, beside it. ``steady`` limits leave the
    middle of that bow to look at, which belongs to no entry of the table: -1. Other limits are tightest at one of their entries. The
    point is -1 where no place between is tighter than both its neighbours.
    """
    sign = 1.0 - 2.0 * side
    found, ahead, nearest, tightest = -1, 0.0, -1, np.inf
    for point in range(points.shape[1] - 1):
        s, e = seen[point, FOOT], seen[point, OFFSET]
        along, rise, length = seen[point + 1, FOOT] - s, seen[point + 1, OFFSET] - e, points[unit, point + 1, 0] - points[unit, point, 0]
        k = 0.5 * (seen[point, CURVATURE] + seen[point + 1, CURVATURE])
        bow = 0.5 * k / (1.0 - k * e) * length * length
        ends = min(seen[point, GAP], seen[point + 1, GAP])
        row = side + 2 * int(max(points[unit, point, 1], points[unit, point + 1, 1]))
        if steady:
            if sign * bow > abs(rise):  # the bow's summit lies between the points
                part = 0.5 + 0.5 * rise / bow
                gap = seen[point, GAP] - sign * (part * rise + part * (1.0 - part) * bow)
                if gap < min(tightest, ends):
                    found, ahead, tightest = point, points[unit, point, 0] + part * length, gap
            continue
        first, last = int(np.ceil((s - limit_first) / limit_spacing)), int(np.floor((s + along - limit_first) / limit_spacing))
        for entry in range(max(first, 0), min(last, limits.shape[1] - 1) + 1):
            part = (limit_first + entry * limit_spacing - s) / along
            gap = sign * (limits[row, entry] - e - part * rise - part * (1.0 - part) * bow)
            if gap < min(tightest, ends):
                found, ahead, nearest, tightest = point, points[unit, point, 0] + part * length, entry, gap
    return found, ahead, nearest


@compiled
def _write_row(
    poses: FloatArray, unit: int, sign: float, road_cos: float, road_sin: float, seen: FloatArray, at: int, slope: float, gap: float,
    along_n: FloatArray, along_t: FloatArray, G: FloatArray, h: FloatArray, stage: int, row: int,
) -> None:  # fmt: skip
    """Write the row that keeps the offset of place ``seen[at]`` at least ``gap`` inside its limit, which has ``slope`` along s there."""
    x, y, cos, sin = seen[at, X], seen[at, Y], seen[at, COS], seen[at, SIN]
    point_gradient(poses, unit, x, y, road_cos, road_sin, -sin, cos, along_n)
    point_gradient(poses, unit, x, y, road_cos, road_sin, cos, sin, along_t)
    per_t = slope / (1.0 - seen[at, CURVATURE] * seen[at, OFFSET])
    for j in range(along_n.size):
        G[stage, row, j] = sign * (along_n[j] - per_t * along_t[j])
    h[stage, row] = gap


@compiled
def _never(G: FloatArray, h: FloatArray, stage: int, begin: int, end: int, states: int, clear: float) -> None:
    """Write rows that never bind."""
    for row in range(begin, end):
        for j in range(states):
            G[stage, row, j] = 0.0
        h[stage, row] = clear


@compiled
def linearise_limits(
    units: FloatArray, points: FloatArray, axis: FloatArray, coefficients: FloatArray, s_first: float, spacing: float, road: FloatArray,
    limits: FloatArray, limit_first: float, limit_spacing: float, around: FloatArray, margin: FloatArray, z: FloatArray,
    axis_feet: FloatArray, feet: FloatArray, gaps: FloatArray,
    begin: int, end: int, G: FloatArray, h: FloatArray,
) -> int:  # fmt: skip
    """Write the rows G dz <= h of the tightest places of every edge at stages 1 <= begin <= i < end.

    Returns -1, or a stage with a point that has no foot. The first stage is given: rows there would be constants.

    ``feet`` (N+1, units, points, 2) is warm start and result; ``gaps``, same shape, receives the clearance of every point and of
    the edge from there to the next one [m] (left edge, right edge). ``margin`` (N+1,) is kept from every limit. Bodies that are
    clear by a bound get that bound as clearance and rows that never bind. Row order within a stage: unit, left then right edge;
    then the tightest place of the edge's rear half and of its front half; then, where there are rows for them, what its rear and
    its front corner reach beyond the wheels' limit, if they belong to overhangs.
    """
    n, count, each = z.shape[1], points.shape[1], G.shape[1] // (2 * units.shape[0])
    poses, along_n, along_t = np.empty((units.shape[0], 6)), np.empty(n), np.empty(n)
    seen = np.empty((PLACES, 10))
    for i in range(begin, end):
        clear = _clear_by_state(units, around, i, z[i]) - margin[i]
        if clear > CLEAR_M:
            for unit in range(units.shape[0]):
                for point in range(count):
                    gaps[i, unit, point, 0] = gaps[i, unit, point, 1] = clear + margin[i]
            _never(G, h, i - 1, 0, G.shape[1], n, clear)
            continue
        place(units, road[0, i], road[1, i], road[2, i], road[3, i], z[i], poses)
        row = 0
        for unit in range(units.shape[0]):
            clear_left, clear_right = _clearances(units, axis, coefficients, s_first, spacing, around, poses, unit, i, axis_feet)
            for side in range(2):
                clear = (clear_left if side == 0 else clear_right) - margin[i]
                if clear > CLEAR_M:
                    for point in range(count):
                        gaps[i, unit, point, side] = clear + margin[i]
                    _never(G, h, i - 1, row, row + each, n, clear)
                    row += each
                    continue
                sign = 1.0 - 2.0 * side
                across = sign * units[unit, 4]
                for point in range(count):
                    if not _look(
                        coefficients, s_first, spacing, limits, limit_first, limit_spacing, poses, unit, points[unit, point, 0], across,
                        side + 2 * int(points[unit, point, 1]), feet[i, unit, point, side], seen, point,
                    ):  # fmt: skip
                        return i
                    feet[i, unit, point, side], gaps[i, unit, point, side] = seen[point, FOOT], seen[point, GAP]
                behind, ahead, entry = _tightest_between(limits, limit_first, limit_spacing, points, unit, side, around[4, i] == 0.0, seen)
                places = count
                if behind >= 0:
                    region = int(max(points[unit, behind, 1], points[unit, behind + 1, 1]))
                    if not _look(
                        coefficients, s_first, spacing, limits, limit_first, limit_spacing, poses, unit, ahead, across,
                        side + 2 * region, seen[behind, FOOT], seen, count,
                    ):  # fmt: skip
                        return i
                    # At the tightest place between ends edge and limit run alike, or the limit has a corner there that slides
                    # along the edge: either way the clearance changes as if the limit had the edge's direction.
                    across_road = poses[unit, 3] * seen[count, COS] - poses[unit, 2] * seen[count, SIN]
                    along_road = poses[unit, 2] * seen[count, COS] + poses[unit, 3] * seen[count, SIN]
                    slope = (1.0 - seen[count, CURVATURE] * seen[count, OFFSET]) * across_road / along_road
                    seen[count, SLOPE] = slope
                    if entry >= 0:  # the place was found by a parabola: its foot is centimetres off the entry, on a steep limit
                        beyond = limit_first + entry * limit_spacing - seen[count, FOOT]
                        seen[count, GAP] = sign * (limits[side + 2 * region, entry] - seen[count, OFFSET] - slope * beyond)
                    gaps[i, unit, behind, side] = min(gaps[i, unit, behind, side], seen[count, GAP])
                    places += 1
                middle = 0.5 * (points[unit, 0, 0] + points[unit, count - 1, 0])
                for half in range(ROWS_PER_EDGE):
                    pick = half * (count - 1)
                    for other in range(places):
                        if (seen[other, AHEAD] > middle) == (half == 1) and seen[other, GAP] < seen[pick, GAP]:
                            pick = other
                    _write_row(
                        poses, unit, sign, road[2, i], road[3, i], seen, pick, seen[pick, SLOPE], seen[pick, GAP] - margin[i],
                        along_n, along_t, G, h, i - 1, row,
                    )  # fmt: skip
                    row += 1
                if each > ROWS_PER_EDGE:
                    for corner in (0, count - 1):
                        if points[unit, corner, 1] == 0.0:
                            _never(G, h, i - 1, row, row + 1, n, CLEAR_M)
                        else:
                            limit, slope = limit_at(limits, limit_first, limit_spacing, side, seen[corner, FOOT])
                            _write_row(
                                poses, unit, sign, road[2, i], road[3, i], seen, corner, slope, sign * (limit - seen[corner, OFFSET]),
                                along_n, along_t, G, h, i - 1, row,
                            )  # fmt: skip
                        row += 1
    return -1
