"""Everything that a vehicle with one trailer can reach along a road: for each cell of the leading unit's heading a polygon.

The polygon holds the offset e of the leading axle and the trailer's W, see ``coupling``, as ``SCALE`` W. Its edges have ``SIDES`` fixed
directions; what is kept are the supports h: all points q of the polygon have d . q <= h for every direction d. Between two stations e and
W follow an affine map, but for errors that are added to the supports; the polygons that lead to a cell are joined by the largest of their
supports. Stations, cells, and what is known of the heading in between are those of a rigid vehicle, see ``reach``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hdvplan.jit import BoolArray, FloatArray, compiled
from hdvplan.proof.around import Around, around_at, unknown
from hdvplan.proof.coupling import Coupling
from hdvplan.proof.polygons import ROUNDING, SIDES, box, support, tight
from hdvplan.proof.poses import Loose, Outline, trim
from hdvplan.proof.reach import Grid, Reached, Span, most_turned
from hdvplan.proof.space import MOST, Beside, Frame

SCALE = 8.0  # of W: about the length over which a trailer turns [m]
LEADING = 0.04  # cells of the leading heading in which the room that a trailer leaves is tabulated [rad]
SIDEWAYS = 1.3  # off the road's heading: no leading unit is said to stand across the road by more than 74 degrees [rad]
STRIPS = 24  # of W looked at one by one: a polygon that is wide is far from empty


class Pair(NamedTuple):
    """A leading unit and its trailer, whose outline is seen from the coupling."""

    lead: Outline
    trailer: Outline
    coupling: Coupling


class Polygons(NamedTuple):
    """What cells hold: whether anything (cells,), and the supports of its polygon (cells, SIDES) [m]."""

    full: BoolArray
    h: FloatArray


@compiled
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
    begin, end = 0, 0
    for i in range(stations):
        around = around_at(beside, frame, i, reach, two_regions, memory)
        near = around.near
        lowest = max(0, int(np.ceil((frame.heading[i] - SIDEWAYS - grid.first) / grid.size)) - 1)
        highest = min(grid.cells, int(np.floor((frame.heading[i] + SIDEWAYS - grid.first) / grid.size)) + 1)
        if i == 0:
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
            return Reached(i, -1, low, high, right, left, filled)
        begin, end = first, last
        right[i] = grid.first + begin * grid.size - frame.heading[i]
        left[i] = grid.first + end * grid.size - frame.heading[i]
    return Reached(-1, -1, low, high, right, left, filled)


@compiled
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


@compiled
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


@compiled
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


@compiled
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
