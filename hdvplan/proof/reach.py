"""Everything that a rigid vehicle can reach along a road: headings in cells, and for each cell intervals of the lateral offset.

A station is a normal of the road. Of the vehicle it is known that its rear axle crosses every normal, moving forward along its heading
theta, and that theta turns by at most ``kappa`` per metre. Between two stations the axle travels a chord in the direction delta. Where
theta is alpha at the first and beta at the second, and L is the length travelled, theta lies below both alpha + kappa l and
beta + kappa (L - l), so that its mean lies below

    (alpha + beta) / 2 + kappa L / 4 (1 - ((beta - alpha) / (kappa L))^2),

and above the mirror image; delta differs from the mean by less than the range's cube. The offset at the second normal follows exactly
from offset and delta, and rises with both: intervals go to intervals. Cells do not move with the road, so that a vehicle that does not
steer stays in its cell: no rounding lets the set turn or creep sideways but for what is said above.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hdvplan.jit import FloatArray, IntArray, compiled, inlined
from hdvplan.proof.around import around_at, unknown
from hdvplan.proof.intervals import joined
from hdvplan.proof.poses import Loose, Outline, trim
from hdvplan.proof.space import MOST, Beside, Frame

_ITERATIONS, _CONVERGED = 40, 1e-6  # [rad]
_STEEPEST = 1.5  # where chords get that long, cells reach to WIDEST, and the station counts as unbounded [rad]
_MARGIN = 0.05  # from there on what is left counts as unbounded [rad]
WIDEST = 1.35  # a heading off the road's beyond which nothing is bounded [rad]


class Grid(NamedTuple):
    """Cells of the heading: cell j holds ``first`` + j ``size`` <= theta < ``first`` + (j + 1) ``size`` [rad]."""

    first: float
    size: float
    cells: int


class Span(NamedTuple):
    """Cells from ``begin`` to before ``end`` that may hold anything, of those from ``lowest`` to before ``highest`` that are followed."""

    begin: int
    end: int
    lowest: int
    highest: int


class Cells(NamedTuple):
    """What cells hold: how many intervals of the offset (cells,), and these (cells, MOST, 2) [m]."""

    number: IntArray
    pieces: FloatArray


class Reached(NamedTuple):
    """What was reached at every station: ``empty`` is the first station with nothing, or -1; ``open`` the last that bounds nothing, or -1.

    ``low`` and ``high`` (stations,) bound the offset [m], ``right`` and ``left`` the heading off the road's [rad], ``filled`` is the
    number of cells.
    """

    empty: int
    open: int
    low: FloatArray
    high: FloatArray
    right: FloatArray
    left: FloatArray
    filled: IntArray


@compiled
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
        around = around_at(beside, frame, i, reach, two_regions, memory)
        near = around.near
        fresh = i == 0 or opened == i - 1
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


@inlined
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


@compiled
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
