"""Obstacles and kerbs: polygons in the plane become limits along s ([BUS]'s drivable, sweepable and obstacle regions).

The road is cut into cells between neighbouring normals, and each polygon into its pieces in the cells: no corner of a
polygon falls between two samples. A limit at s then holds for everything that a table of ``TABLE_M`` can interpolate from
it, so that a limit which jumps at an obstacle's end jumps ``TABLE_M`` and one cell too early, never too late. Where an edge
is oblique, the same caution costs that distance times the edge's slope.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
import scipy  # its subpackages load when they are first used
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hdvplan.jit import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:  # files that name regions are read without kernels
    from hdvplan.road.path import ReferencePath

Shapes = NDArray[np.object_]

OPEN_M = 20.0  # room to either side of a road that has obstacles but no widths; polygons further away do not count
TABLE_M = 0.25  # limits are used in tables of at most this spacing, linear between their entries
GAP_M = 0.1  # a sweepable polygon this close to the drivable band joins it: drawn edges are chords of a bend
_CELL_M = 0.05
_CLIPPED = 200  # cells that share one clipped polygon
_STRIDE = 10  # cells from station to station of those that find the polygons
_OPEN_SPACING_M = 0.5
_FOLD = 0.9  # of the radius of curvature: cells must not reach the centre, where normals meet
_OPEN_FOLD = 0.8  # of a road without widths; within what the cells see
_ROOM_M = 2.0  # beyond the ends, for the feet of corners on the last normal


class Kind(StrEnum):
    """What a region means to a vehicle."""

    OBSTACLE = "obstacle"  # nothing may enter
    SWEEPABLE = "sweepable"  # overhangs may pass over it, wheels may not


@dataclass(frozen=True)
class Region:
    """A polygon in the road's plane [m]."""

    kind: Kind
    polygon: shapely.Polygon
    label: str = ""


@dataclass(frozen=True)
class _Cells:
    """Cells of equal length along the road, with how far left and right (negative) they reach [m]; shape (n,)."""

    path: ReferencePath  # extended
    s: FloatArray  # of the normals, (n + 1,)
    left: FloatArray
    right: FloatArray
    stations: shapely.STRtree  # points of the centre line, every ``_STRIDE`` cells

    def quads(self, at: IntArray, right: FloatArray, left: FloatArray) -> Shapes:
        """Return the polygons between the normals of cells ``at`` and offsets (k, 2) at their first and last normal."""
        ring = ((0, right), (1, right), (1, left), (0, left))
        corners = [np.stack(self.path.to_plane(self.s[at + end], offset[:, end]), axis=1) for end, offset in ring]
        return np.asarray(shapely.polygons(np.stack(corners, axis=1)))

    def whole(self, at: IntArray) -> Shapes:
        """Return cells ``at`` over their full width."""
        return self.quads(at, np.repeat(self.right[at, None], 2, axis=1), np.repeat(self.left[at, None], 2, axis=1))

    def offsets(self, shapes: Shapes, at: IntArray) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return which shapes have an area, and their least and greatest offsets; shape i lies in cell ``at[i]``."""
        points, owner = shapely.get_coordinates(shapes, return_index=True)
        if not len(owner):
            return owner, np.empty(0), np.empty(0)
        middle = 0.5 * (self.s[at[owner]] + self.s[at[owner] + 1])
        _, offset = self.path.project(points[:, 0], points[:, 1], middle)
        owners, first = np.unique(owner, return_index=True)
        return owners, np.minimum.reduceat(offset, first), np.maximum.reduceat(offset, first)


@dataclass(frozen=True)
class _Stay:
    """One polygon over a run of neighbouring cells: its hull there, and the parts that leave the centre free."""

    kind: Kind
    cells: IntArray
    low: FloatArray
    high: FloatArray
    left: FloatArray  # least offset of what lies left of the centre, inf without
    right: FloatArray  # greatest offset of what lies right of the centre, -inf without
    on_centre: BoolArray


def region_limits(
    path: ReferencePath, regions: tuple[Region, ...], s: FloatArray | None, table: FloatArray | None
) -> tuple[FloatArray, FloatArray] | None:
    """Return arclengths and the limits there, shape (4, n), after ``regions`` have cut or widened a band.

    The band has limits ``table`` (4, m) at ``s``: rows left, right, left_sweep, right_sweep, signed [m]. Obstacles narrow
    all four, on the side where they lie; one that lies on the centre line is passed, over its whole length, on the side
    where it leaves more room. Sweepable polygons keep wheels off, and widen the overhangs' limits where they join the
    band. A limit left of which nothing is free can end up right of its opposite: there the road is blocked.

    Without a band the road is open to ``OPEN_M``, or 0.8 of the radius inside a bend. None: neither band nor obstacle.
    """
    if s is None or table is None:
        if not any(region.kind is Kind.OBSTACLE for region in regions):
            return None
        s, table = _open_band(path)
    cells = _cells_of(path)
    band = np.stack([np.interp(cells.s, s, row) for row in table])
    in_cells = np.stack([np.minimum(row[1:], row[:-1]) if left else np.maximum(row[1:], row[:-1]) for row, left in _sided(band)])
    stays = [stay for region in regions for stay in _stays(cells, region)]
    wheels, bodies = _cuts(stays, in_cells)
    wider = _widened(cells, band, regions, stays)
    values = band.copy()
    for side in (0, 1):
        sign = 1.0 - 2.0 * side
        sweep = np.maximum(sign * band[2 + side], _cautious(wider[side], cells))
        sweep = np.minimum(sweep, _cautious(sign * bodies[side], cells))
        drive = np.minimum(sign * band[side], _cautious(sign * wheels[side], cells))
        values[side], values[2 + side] = sign * np.minimum(drive, sweep), sign * sweep
    changed = np.any(values != band, axis=0)
    keep = scipy.ndimage.maximum_filter1d(changed, 3)  # and its neighbours, where the given limits hold again
    cell = np.clip(np.searchsorted(cells.s, s, side="right") - 1, 0, len(keep) - 2)
    own = (s < cells.s[keep].min(initial=np.inf)) | (s > cells.s[keep].max(initial=-np.inf)) | ~(keep[cell] & keep[cell + 1])
    nodes, first = np.unique(np.concatenate([s[own], cells.s[keep]]), return_index=True)
    return nodes, np.concatenate([table[:, own], values[:, keep]], axis=1)[:, first]


def distances(path: ReferencePath, regions: tuple[Region, ...]) -> FloatArray:
    """Return how far each region lies from the road's centre line [m]; those beyond ``OPEN_M`` do not count."""
    s = np.linspace(0.0, path.length, int(np.ceil(path.length / _OPEN_SPACING_M)) + 1)
    centre = shapely.LineString(np.stack(path.to_plane(s, 0.0), axis=1))
    return np.array([shapely.distance(centre, region.polygon) for region in regions])


def _sided(rows: FloatArray) -> list[tuple[FloatArray, bool]]:
    """Return the rows of a limit table with whether each is a left one."""
    return [(row, number % 2 == 0) for number, row in enumerate(rows)]


def _open_band(path: ReferencePath) -> tuple[FloatArray, FloatArray]:
    s = np.linspace(0.0, path.length, int(np.ceil(path.length / _OPEN_SPACING_M)) + 1)
    k = path.at(s).curvature
    k_left, k_right = (scipy.ndimage.maximum_filter1d(np.maximum(sign * k, 1e-9), 5) for sign in (1.0, -1.0))  # a metre around
    left, right = (np.minimum(OPEN_M, _OPEN_FOLD / bend) for bend in (k_left, k_right))
    return s, np.stack([left, -right, left, -right])


def _cells_of(path: ReferencePath) -> _Cells:
    s = np.linspace(0.0, path.length, int(np.ceil(path.length / _CELL_M)) + 1)
    k = path.at(s).curvature
    low, high = np.minimum(k[1:], k[:-1]), np.maximum(k[1:], k[:-1])
    left = np.minimum(OPEN_M, _FOLD / np.maximum(high, 1e-9))
    right = -np.minimum(OPEN_M, _FOLD / np.maximum(-low, 1e-9))
    stations = np.asarray(shapely.points(np.stack(path.to_plane(s[:-1:_STRIDE], 0.0), axis=1)))
    return _Cells(path.extended(_ROOM_M, _ROOM_M), s, left, right, shapely.STRtree(stations))


def _near(cells: _Cells, polygon: shapely.Polygon) -> IntArray:
    """Return the cells that are near enough to meet ``polygon``, in order."""
    stations = np.sort(cells.stations.query(polygon, predicate="dwithin", distance=OPEN_M + 2.0 * _STRIDE * _CELL_M))
    near: IntArray = (stations[:, None] * _STRIDE + np.arange(_STRIDE)).ravel()
    return near[near < len(cells.left)]


def _stays(cells: _Cells, region: Region) -> list[_Stay]:
    """Return the runs of cells that meet a polygon."""
    near = _near(cells, region.polygon)
    quads = cells.whole(near)
    pieces = shapely.intersection(quads, _about(quads, region.polygon))
    parts, piece = shapely.get_parts(pieces, return_index=True)
    solid = shapely.area(parts) > 0.0
    parts, at = parts[solid], near[piece[solid]]
    _, low, high = cells.offsets(parts, at)
    met, row = np.unique(at, return_inverse=True)
    if not len(met):
        return []
    count = len(met)
    least, most, left, right = np.full(count, np.inf), np.full(count, -np.inf), np.full(count, np.inf), np.full(count, -np.inf)
    on_centre = np.zeros(count, dtype=bool)
    np.minimum.at(least, row, low)
    np.maximum.at(most, row, high)
    np.minimum.at(left, row, np.where(low >= 0.0, low, np.inf))
    np.maximum.at(right, row, np.where(high <= 0.0, high, -np.inf))
    np.logical_or.at(on_centre, row, (low < 0.0) & (high > 0.0))
    runs = np.split(np.arange(count), np.flatnonzero(np.diff(met) > 1) + 1)
    if cells.path.closed and len(runs) > 1 and met[0] == 0 and met[-1] == len(cells.left) - 1:
        runs = [np.concatenate([runs[-1], runs[0]]), *runs[1:-1]]  # one obstacle across the start of a closed road
    return [_Stay(region.kind, met[run], least[run], most[run], left[run], right[run], on_centre[run]) for run in runs]


def _about(shapes: Shapes, area: BaseGeometry) -> Shapes:
    """Return for every shape the part of ``area`` around it: a kerb along the whole road has too many corners for every cell."""
    parts = np.empty(len(shapes), dtype=object)
    for first in range(0, len(shapes), _CLIPPED):
        group = slice(first, first + _CLIPPED)
        clipped = shapely.intersection(area, shapely.box(*(shapely.total_bounds(shapes[group]) + np.array([-1.0, -1.0, 1.0, 1.0]))))
        solid = [part for part in shapely.get_parts(clipped) if isinstance(part, shapely.Polygon)]
        parts[group] = solid[0] if len(solid) == 1 else shapely.MultiPolygon(solid)
    return parts


def _cuts(stays: list[_Stay], band: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return limits, rows left and right, that the polygons leave to wheels and to bodies in every cell; infinite where free.

    First those beside the centre line, which leave no choice; then the others in order of s, each beside what is left.
    """
    free = np.repeat(np.array([[np.inf], [-np.inf]]), band.shape[1], axis=1)
    wheels, bodies = free, free.copy()
    for stay in sorted(stays, key=lambda stay: (bool(np.any(stay.on_centre)), int(stay.cells[0]))):
        at, left, right = stay.cells, stay.left, stay.right
        if np.any(stay.on_centre):
            room_left = np.min(np.minimum(band[0, at], wheels[0, at]) - stay.high)
            room_right = np.min(stay.low - np.maximum(band[1, at], wheels[1, at]))
            split = np.isfinite(left) & np.isfinite(right) & ~stay.on_centre  # the centre is free between two of its parts
            if room_right >= room_left:
                left, right = np.where(split, left, stay.low), np.where(split, right, -np.inf)
            else:
                left, right = np.where(split, left, np.inf), np.where(split, right, stay.high)
        for cut in (wheels, bodies) if stay.kind is Kind.OBSTACLE else (wheels,):
            cut[0, at], cut[1, at] = np.minimum(cut[0, at], left), np.maximum(cut[1, at], right)
    return wheels, bodies


def _widened(cells: _Cells, band: FloatArray, regions: tuple[Region, ...], stays: list[_Stay]) -> FloatArray:
    """Return how far sweepable polygons that join the band reach, positive, left and right; -inf where none does."""
    reach = np.full((2, len(cells.left)), -np.inf)
    met = [stay.cells for stay in stays if stay.kind is Kind.SWEEPABLE]
    if not met:
        return reach
    area = shapely.union_all([region.polygon for region in regions if region.kind is Kind.SWEEPABLE])
    area = shapely.buffer(shapely.buffer(area, 0.5 * GAP_M, join_style="mitre"), -0.5 * GAP_M, join_style="mitre")
    for side, outer in ((0, cells.left), (1, cells.right)):
        sign = 1.0 - 2.0 * side
        at = np.unique(np.concatenate(met))
        inner = np.stack([band[2 + side, at], band[2 + side, at + 1]], axis=1) + sign * GAP_M
        beyond = np.all(sign * inner < sign * outer[at, None], axis=1)
        at, inner = at[beyond], inner[beyond]
        ends = (inner, np.repeat(outer[at, None], 2, axis=1))
        strips = cells.quads(at, *(ends if side == 0 else ends[::-1]))
        rest = shapely.difference(strips, _about(strips, area))  # what overhangs must not enter
        seen, low, high = cells.offsets(rest, at)
        nearest = sign * outer[at]
        nearest[seen] = low if side == 0 else -high
        joined = nearest > np.max(sign * inner, axis=1) + _CELL_M
        reach[side, at[joined]] = nearest[joined]
    return reach


def _cautious(reach: FloatArray, cells: _Cells) -> FloatArray:
    """Return at the cells' normals what holds in all cells that a table may interpolate over; positive reaches [m]."""
    length = cells.s[1] - cells.s[0]
    count = int(np.ceil((length + TABLE_M) / length))
    around = np.pad(reach, count, mode="wrap" if cells.path.closed else "edge")
    least: FloatArray = scipy.ndimage.minimum_filter1d(around, 2 * count)  # even: from i - count to i + count - 1
    return least[count : count + len(reach) + 1]
