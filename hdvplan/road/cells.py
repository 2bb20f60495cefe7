"""Polygons beside a road, cut where its normals stand: how far from the centre line they lie, place by place.

The road is cut into cells between neighbouring normals, and each polygon into its pieces in the cells: no corner of a polygon falls
between two samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy  # its subpackages load when they are first used
import shapely
from numpy.typing import NDArray

from hdvplan.arrays import BoolArray, FloatArray, IntArray
from hdvplan.road.regions import OPEN_M, OPEN_SPACING_M, Kind, Region

if TYPE_CHECKING:
    from hdvplan.road.path import ReferencePath

Shapes = NDArray[np.object_]

GAP_M = 0.1  # a sweepable polygon this close to the drivable band joins it: drawn edges are chords of a bend
_CELL_M = 0.05
_CLIPPED = 200  # cells that share one clipped polygon
_TOGETHER_M = 5000.0  # of road beside polygons that are cut together: more takes more memory, less more time
_STRIDE = 10  # cells from station to station of those that find the polygons
_FOLD = 0.9  # of the radius of curvature: cells must not reach the centre, where normals meet
_OPEN_FOLD = 0.8  # of a road without widths; within what the cells see
_ROOM_M = 2.0  # beyond the ends, for the feet of corners on the last normal


@dataclass(frozen=True)
class Cells:
    """Cells of equal length along the road, with how far left and right (negative) they reach [m]; shape (n,)."""

    path: ReferencePath  # extended
    s: FloatArray  # of the normals, (n + 1,)
    left: FloatArray
    right: FloatArray
    stations: shapely.STRtree  # points of the centre line, every ``_STRIDE`` cells
    normals: FloatArray  # where the normals stand, and the directions they are normal to: x, y [m], cos, sin; shape (4, n + 1)

    @property
    def length(self) -> float:
        """The length of one cell [m]."""
        return float(self.s[1] - self.s[0])

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
class Stay:
    """One polygon over a run of neighbouring cells: its hull there, and the parts that leave the centre free."""

    region: int  # index of the polygon
    cells: IntArray
    low: FloatArray
    high: FloatArray
    left: FloatArray  # least offset of what lies left of the centre, inf without
    right: FloatArray  # greatest offset of what lies right of the centre, -inf without
    on_centre: BoolArray

    @property
    def around(self) -> bool:
        """Whether it lies on both sides of a centre line that it leaves free: then there are no sides to pass it on."""
        both = bool(np.any(np.isfinite(self.left)) and np.any(np.isfinite(self.right)))
        return both and not bool(np.any(self.on_centre))


def cells_of(path: ReferencePath) -> Cells:
    """Cut a road into cells."""
    s = np.linspace(0.0, path.length, int(np.ceil(path.length / _CELL_M)) + 1)
    here = path.at(s)
    k = here.curvature
    low, high = np.minimum(k[1:], k[:-1]), np.maximum(k[1:], k[:-1])
    left = np.minimum(OPEN_M, _FOLD / np.maximum(high, 1e-9))
    right = -np.minimum(OPEN_M, _FOLD / np.maximum(-low, 1e-9))
    stations = np.asarray(shapely.points(here.x[:-1:_STRIDE], here.y[:-1:_STRIDE]))
    normals = np.stack([here.x, here.y, np.cos(here.heading), np.sin(here.heading)])
    return Cells(path.extended(_ROOM_M, _ROOM_M), s, left, right, shapely.STRtree(stations), normals)


def open_band(path: ReferencePath) -> tuple[FloatArray, FloatArray]:
    """Return arclengths and limits (4, n) of a road without any: as far as its cells see obstacles."""
    s = np.linspace(0.0, path.length, int(np.ceil(path.length / OPEN_SPACING_M)) + 1)
    k = path.at(s).curvature
    k_left, k_right = (scipy.ndimage.maximum_filter1d(np.maximum(sign * k, 1e-9), 5) for sign in (1.0, -1.0))  # a metre around
    left, right = (np.minimum(OPEN_M, _OPEN_FOLD / bend) for bend in (k_left, k_right))
    return s, np.stack([left, -right, left, -right])


def stays_of(cells: Cells, regions: tuple[Region, ...]) -> list[Stay]:
    """Return the runs of cells that meet each polygon."""
    polygons = np.array([region.polygon for region in regions], dtype=object)
    x_min, y_min, x_max, y_max = shapely.bounds(polygons).T
    size = np.cumsum(2.0 * OPEN_M + np.hypot(x_max - x_min, y_max - y_min))
    groups = np.split(np.arange(len(regions)), np.flatnonzero(np.diff(size // _TOGETHER_M)) + 1)
    return [stay for group in groups for stay in _stays(cells, group, polygons[group])]


def _near(cells: Cells, polygons: Shapes) -> tuple[IntArray, IntArray]:
    """Return the cells that are near enough to meet each polygon, in order: it lies neither behind nor beyond all of them.

    First the polygons' numbers, then their cells.
    """
    owner, station = cells.stations.query(polygons, predicate="dwithin", distance=OPEN_M + 2.0 * _STRIDE * _CELL_M)
    order = np.lexsort((station, owner))
    owner, near = np.repeat(owner[order], _STRIDE), (station[order, None] * _STRIDE + np.arange(_STRIDE)).ravel()
    owner, near = owner[near < len(cells.left)], near[near < len(cells.left)]
    x_min, y_min, x_max, y_max = shapely.bounds(polygons)[owner].T
    corners = np.array([[x_min, x_min, x_max, x_max], [y_min, y_max, y_min, y_max]]).swapaxes(1, 2)

    def ahead(normals: IntArray) -> FloatArray:
        x, y, cos, sin = cells.normals[:, normals, None]
        along: FloatArray = (corners[0] - x) * cos + (corners[1] - y) * sin
        return along

    met = (np.max(ahead(near), axis=1) >= 0.0) & (np.min(ahead(near + 1), axis=1) <= 0.0)
    return owner[met], near[met]


def _stays(cells: Cells, numbers: IntArray, polygons: Shapes) -> list[Stay]:
    """Return the runs of cells that meet the polygons of these numbers."""
    owner, near = _near(cells, polygons)
    quads = cells.whole(near)
    pieces = shapely.intersection(quads, _about(quads, polygons, owner))
    parts, piece = shapely.get_parts(pieces, return_index=True)
    solid = shapely.area(parts) > 0.0
    parts, piece = parts[solid], piece[solid]
    _, low, high = cells.offsets(parts, near[piece])
    pairs, row = np.unique(piece, return_inverse=True)
    if not len(pairs):
        return []
    count = len(pairs)
    least, most, left, right = np.full(count, np.inf), np.full(count, -np.inf), np.full(count, np.inf), np.full(count, -np.inf)
    on_centre = np.zeros(count, dtype=bool)
    np.minimum.at(least, row, low)
    np.maximum.at(most, row, high)
    np.minimum.at(left, row, np.where(low >= 0.0, low, np.inf))
    np.maximum.at(right, row, np.where(high <= 0.0, high, -np.inf))
    np.logical_or.at(on_centre, row, (low < 0.0) & (high > 0.0))
    met, owner = near[pairs], owner[pairs]
    return [
        Stay(int(numbers[owner[run[0]]]), met[run], least[run], most[run], left[run], right[run], on_centre[run])
        for own in np.split(np.arange(count), np.flatnonzero(np.diff(owner)) + 1)
        for run in _runs(cells, met, own)
    ]


def _runs(cells: Cells, met: IntArray, own: IntArray) -> list[IntArray]:
    """Return the rows ``own`` of one polygon, whose cells are ``met[own]``, split where cells are missing between them."""
    runs = np.split(own, np.flatnonzero(np.diff(met[own]) > 1) + 1)
    if cells.path.closed and len(runs) > 1 and met[own[0]] == 0 and met[own[-1]] == len(cells.left) - 1:
        runs = [np.concatenate([runs[-1], runs[0]]), *runs[1:-1]]  # one obstacle across the start of a closed road
    return runs


def _about(shapes: Shapes, areas: Shapes, owner: IntArray) -> Shapes:
    """Return for every shape the part around it of the area that it belongs to: one of all the road has too many corners for every cell.

    ``owner`` are the areas' numbers, in order, shape (len(shapes),).
    """
    number = (np.arange(len(shapes)) - np.searchsorted(owner, owner)) // _CLIPPED
    begin = np.flatnonzero((np.diff(owner, prepend=-1) != 0) | (np.diff(number, prepend=-1) != 0))
    if not len(begin):
        return np.empty(0, dtype=object)
    bounds = shapely.bounds(shapes)
    least, most = np.minimum.reduceat(bounds[:, :2], begin) - 1.0, np.maximum.reduceat(bounds[:, 2:], begin) + 1.0
    parts, group = shapely.get_parts(shapely.intersection(areas[owner[begin]], shapely.box(*least.T, *most.T)), return_index=True)
    solid = shapely.get_type_id(parts) == shapely.GeometryType.POLYGON
    parts, group = parts[solid], group[solid]
    clipped = np.array([shapely.MultiPolygon()] * len(begin), dtype=object)
    clipped[group] = parts
    for several in np.flatnonzero(np.bincount(group, minlength=len(begin)) > 1):
        clipped[several] = shapely.MultiPolygon(list(parts[group == several]))
    return np.repeat(clipped, np.diff(np.append(begin, len(shapes))))


def widened(cells: Cells, band: FloatArray, regions: tuple[Region, ...], stays: list[Stay]) -> FloatArray:
    """Return how far sweepable polygons that join the band reach, positive, left and right, shape (2, cells); -inf where none does.

    ``band`` are the limits at the cells' normals, shape (4, cells + 1); ``stays`` are those of all regions.
    """
    reach = np.full((2, len(cells.left)), -np.inf)
    met = [stay.cells for stay in stays if regions[stay.region].kind is Kind.SWEEPABLE]
    if not met:
        return reach
    area = shapely.union_all([region.polygon for region in regions if region.kind is Kind.SWEEPABLE])
    area = shapely.buffer(shapely.buffer(area, 0.5 * GAP_M, join_style="mitre"), -0.5 * GAP_M, join_style="mitre")
    areas = np.array([area], dtype=object)
    for side, outer in ((0, cells.left), (1, cells.right)):
        sign = 1.0 - 2.0 * side
        at = np.unique(np.concatenate(met))
        inner = np.stack([band[2 + side, at], band[2 + side, at + 1]], axis=1) + sign * GAP_M
        beyond = np.all(sign * inner < sign * outer[at, None], axis=1)
        at, inner = at[beyond], inner[beyond]
        ends = (inner, np.repeat(outer[at, None], 2, axis=1))
        strips = cells.quads(at, *(ends if side == 0 else ends[::-1]))
        rest = shapely.difference(strips, _about(strips, areas, np.zeros(len(strips), np.intp)))  # what overhangs must not enter
        seen, low, high = cells.offsets(rest, at)
        nearest = sign * outer[at]
        nearest[seen] = low if side == 0 else -high
        joined = nearest > np.max(sign * inner, axis=1) + _CELL_M
        reach[side, at[joined]] = nearest[joined]
    return reach
