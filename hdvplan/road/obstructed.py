"""What obstacles and kerbs leave of a road: limits along s, for any choice of the sides on which obstacles are passed.

A limit holds in all of a cell, so that a limit which jumps at an obstacle's end jumps one cell too early, never too late. The limits that
kerbs make hold ``TABLE_M`` further, for everything that a table of that spacing can interpolate from them. Where an edge is oblique,
this caution costs that distance times the edge's slope.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # its subpackages load when they are first used

from hdvplan.arrays import FloatArray, IntArray
from hdvplan.road.cells import Cells, Stay, cells_of, open_band, stays_of, widened
from hdvplan.road.path import ReferencePath
from hdvplan.road.regions import TABLE_M, Kind, Region, Side


@dataclass(frozen=True)
class Passage:
    """An obstacle over a stretch of road, and what passing it on either side leaves.

    Offsets in metres, left positive. ``usual`` is the side on which it is passed when nothing else is known: its own, or the one with
    more room.
    """

    region: int  # index of the obstacle among the road's regions
    s_from: float  # [m]; beyond the road's length for what lies over the start of a closed road
    s_to: float
    low: float  # rightmost offset
    high: float  # leftmost
    on_line: bool  # the centre line meets it
    around: bool  # it lies on both sides of a line that it leaves free: no side to choose
    usual: Side
    nodes: IntArray  # the normals that ``cuts`` are for
    cuts: dict[Side, FloatArray]  # signed limits left and right, (2, len(nodes)), infinite where free


@dataclass(frozen=True)
class Obstructed:
    """A band with the regions beside it; ``edges`` is the band as kerbs alone change it. At the cells' normals ``s``, shape (4, n)."""

    given: tuple[FloatArray, FloatArray]  # arclengths and limits of the band, (m,) and (4, m)
    s: FloatArray
    band: FloatArray
    edges: FloatArray
    passages: tuple[Passage, ...]  # in order of s

    @property
    def usual(self) -> dict[int, Side]:
        """The sides on which obstacles are passed when nothing else is known, by the passages' numbers."""
        return {number: passage.usual for number, passage in enumerate(self.passages)}

    @cached_property
    def spans(self) -> FloatArray:
        """Where the passages begin and end, shape (2, passages) [m]."""
        return np.array([[passage.s_from, passage.s_to] for passage in self.passages]).reshape(-1, 2).T

    @cached_property
    def ends(self) -> IntArray:
        """The first and the last normal of the passages, shape (2, passages)."""
        return np.array([[np.min(passage.nodes), np.max(passage.nodes)] for passage in self.passages], np.intp).reshape(-1, 2).T

    def limits(self, sides: Mapping[int, Side], s_from: float = -np.inf, s_to: float = np.inf) -> tuple[FloatArray, FloatArray]:
        """Return arclengths from ``s_from`` to ``s_to`` [m], and a little beyond, and the limits there, shape (4, n).

        ``sides`` are those of the passages, by their numbers; obstacles without one are left out. A limit left of which nothing is free
        can end up right of its opposite: there the road is blocked.
        """
        first = max(int(np.searchsorted(self.s, s_from)) - 2, 0)
        last = min(int(np.searchsorted(self.s, s_to)) + 2, len(self.s))
        return self._merged(self.s[first:last], self.band[:, first:last], self._cut(sides, first, last))

    def room(self, number: int, side: Side, others: Mapping[int, Side]) -> float:
        """Return the least distance [m] between a passage's obstacle and what lies on that side of it: the edge, or one of ``others``.

        Negative where the two overlap.
        """
        passage = self.passages[number]
        first, last = (int(end) for end in self.ends[:, number])
        values = self._cut(others, first, last + 1)
        left, right = values[:2, passage.nodes - first]
        return float(np.min(left - passage.cuts[side][1]) if side is Side.LEFT else np.min(passage.cuts[side][0] - right))

    def _cut(self, sides: Mapping[int, Side], first: int, last: int) -> FloatArray:
        """Return the limits at some of the cells' normals."""
        values = self.edges[:, first:last].copy()
        for number in np.flatnonzero((self.ends[0] < last) & (self.ends[1] >= first)):
            if int(number) not in sides:
                continue
            passage = self.passages[number]
            inside = (passage.nodes >= first) & (passage.nodes < last)
            nodes, (left, right) = passage.nodes[inside] - first, passage.cuts[sides[int(number)]][:, inside]
            values[::2, nodes] = np.minimum(values[::2, nodes], left)
            values[1::2, nodes] = np.maximum(values[1::2, nodes], right)
        return values

    def _merged(self, at: FloatArray, band: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the limits where regions changed them, between those that were given there, and one further on either side."""
        s, table = self.given
        here = slice(max(int(np.searchsorted(s, at[0])) - 1, 0), int(np.searchsorted(s, at[-1], side="right")) + 1)
        s, table = s[here], table[:, here]
        changed = np.any(values != band, axis=0)
        keep = scipy.ndimage.maximum_filter1d(changed, 3)  # and its neighbours, where the given limits hold again
        cell = np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(keep) - 2)
        own = (s < at[keep].min(initial=np.inf)) | (s > at[keep].max(initial=-np.inf)) | ~(keep[cell] & keep[cell + 1])
        nodes, first = np.unique(np.concatenate([s[own], at[keep]]), return_index=True)
        return nodes, np.concatenate([table[:, own], values[:, keep]], axis=1)[:, first]


def obstructed(path: ReferencePath, regions: tuple[Region, ...], given: tuple[FloatArray, FloatArray] | None) -> Obstructed | None:
    """Return a band with what ``regions`` can do to it; None where there is neither band nor an obstacle near enough to count.

    The band has limits (4, m) at arclengths (m,): rows left, right, left_sweep, right_sweep, signed [m]. Obstacles narrow all four.
    Sweepable polygons keep wheels off, and widen the overhangs' limits where they join the band. Without a band the road is open to
    ``OPEN_M``, or 0.8 of the radius inside a bend.
    """
    if given is None and not any(region.kind is Kind.OBSTACLE for region in regions):
        return None
    cells = cells_of(path)
    stays = stays_of(cells, regions)
    if given is None:
        if not any(regions[stay.region].kind is Kind.OBSTACLE for stay in stays):
            return None
        given = open_band(path)
    band = np.stack([np.interp(cells.s, given[0], row) for row in given[1]])
    usual = _usual(stays, regions, _in_cells(band))
    edges = _edges(cells, band, regions, stays, usual)
    passages = [_passage(cells, stay, side) for stay, side in zip(stays, usual, strict=True) if regions[stay.region].kind is Kind.OBSTACLE]
    return Obstructed(given, cells.s, band, edges, tuple(sorted(passages, key=lambda passage: passage.s_from)))


def _in_cells(band: FloatArray) -> FloatArray:
    """Return the narrowest limits of wheels in each cell, rows left and right, from those at the normals."""
    return np.stack([np.minimum(band[0, 1:], band[0, :-1]), np.maximum(band[1, 1:], band[1, :-1])])


def _usual(stays: list[Stay], regions: tuple[Region, ...], band: FloatArray) -> list[Side]:
    """Return the side on which each polygon is passed: its own, or the one on which its centre line lies, or the one with more room.

    First those beside the centre line, which leave no choice; then the others in order of s, each beside what is left.
    """
    left, right = band.copy()
    sides = [Side.RIGHT] * len(stays)
    for number in sorted(range(len(stays)), key=lambda one: (bool(np.any(stays[one].on_centre)), int(stays[one].cells[0]))):
        stay, at = stays[number], stays[number].cells
        side = regions[stay.region].side
        if side is None and np.any(stay.on_centre):
            room_left, room_right = np.min(left[at] - stay.high), np.min(stay.low - right[at])
            side = Side.RIGHT if room_right >= room_left else Side.LEFT
        elif side is None:
            side = Side.RIGHT if np.any(np.isfinite(stay.left)) else Side.LEFT
        sides[number] = side
        cut = _cut(stay, side)
        left[at], right[at] = np.minimum(left[at], cut[0]), np.maximum(right[at], cut[1])
    return sides


def _cut(stay: Stay, side: Side) -> FloatArray:
    """Return the limits, rows left and right, that a polygon leaves in its cells when it is passed on ``side``; infinite where free."""
    if stay.around:
        return np.stack([stay.left, stay.right])
    split = np.isfinite(stay.left) & np.isfinite(stay.right) & ~stay.on_centre  # the centre is free between two of its parts
    if side is Side.RIGHT:
        return np.stack([np.where(split, stay.left, stay.low), np.where(split, stay.right, -np.inf)])
    return np.stack([np.where(split, stay.left, np.inf), np.where(split, stay.right, stay.high)])


def _edges(cells: Cells, band: FloatArray, regions: tuple[Region, ...], stays: list[Stay], usual: list[Side]) -> FloatArray:
    """Return the limits at the normals after the sweepable polygons have changed them."""
    wheels = np.repeat(np.array([[np.inf], [-np.inf]]), len(cells.left), axis=1)
    for stay, side in zip(stays, usual, strict=True):
        if regions[stay.region].kind is Kind.SWEEPABLE:
            cut, at = _cut(stay, side), stay.cells
            wheels[0, at], wheels[1, at] = np.minimum(wheels[0, at], cut[0]), np.maximum(wheels[1, at], cut[1])
    wider, values = widened(cells, band, regions, stays), band.copy()
    for row, sign in ((0, 1.0), (1, -1.0)):
        sweep = np.maximum(sign * band[2 + row], _cautious(wider[row], cells))
        drive = np.minimum(sign * band[row], _cautious(sign * wheels[row], cells))
        values[row], values[2 + row] = sign * np.minimum(drive, sweep), sign * sweep
    return values


def _passage(cells: Cells, stay: Stay, side: Side) -> Passage:
    at, count, length = stay.cells, len(cells.left), cells.path.length
    over = at[0] > at[-1]  # the start of a closed road
    nodes = np.append(at, at[-1] + 1)
    cuts = {way: _at_normals(_cut(stay, way)) for way in Side}
    if over:  # the normal at the start is also the one at the end
        cut = int(np.argmax(nodes == 0))
        nodes = np.insert(nodes, cut, count)
        cuts = {way: np.insert(cut_, cut, cut_[:, cut], axis=1) for way, cut_ in cuts.items()}
    s_from, s_to = float(cells.s[at[0]]), float(cells.s[at[-1] + 1]) + (length if over else 0.0)
    return Passage(
        stay.region, s_from, s_to, float(np.min(stay.low)), float(np.max(stay.high)), bool(np.any(stay.on_centre)), stay.around,
        side, nodes, cuts,
    )  # fmt: skip


def _at_normals(cut: FloatArray) -> FloatArray:
    """Return limits of cells, rows left and right, at the normals at their ends: what holds in both cells."""
    free = np.array([[np.inf], [-np.inf]])
    before, after = np.concatenate([free, cut], axis=1), np.concatenate([cut, free], axis=1)
    return np.stack([np.minimum(before[0], after[0]), np.maximum(before[1], after[1])])


def _cautious(reach: FloatArray, cells: Cells) -> FloatArray:
    """Return at the cells' normals what holds in all cells that a table may interpolate over; positive reaches [m]."""
    count = int(np.ceil((cells.length + TABLE_M) / cells.length))
    around = np.pad(reach, count, mode="wrap" if cells.path.closed else "edge")
    least: FloatArray = scipy.ndimage.minimum_filter1d(around, 2 * count)  # even: from i - count to i + count - 1
    return least[count : count + len(reach) + 1]
