"""The free space that proofs look at: the street between its kerbs as a row of areas, in triangles, and the obstacles in it.

Every rounding goes outwards: what is called occupied is occupied. What of it a body at one station can use: hdvplan/core/free_space.c.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from hdvplan import core
from hdvplan.arrays import FloatArray, IntArray, Records
from hdvplan.road.path import ReferencePath
from hdvplan.road.pieces import Kerb, Pieces, pieces_of
from hdvplan.road.regions import Kind
from hdvplan.road.road import Road

STRETCH_M = 10.0  # of line per area: it does not come round to itself within that
BIN_M = core.constant("HDV_BIN_M")  # of u, ahead of the axle
MOST = core.number("HDV_FREE_INTERVALS")  # that are stored for one u; of more, the outermost are joined
_SHARP = 0.1  # sine of a turn of a kerb; less sharp corners reach under 1 cm between points of an outline
_BESIDE = core.record("hdv_beside")
_FRAME = core.record("hdv_frame")
_AROUND = core.record("hdv_around", near=np.dtype((float, 2)))
_PAIR, _TRIPLE = np.dtype((float, 2)), np.dtype((float, 3))
_SHAPE_NEAR = core.record("hdv_shape_near", u=_TRIPLE, v=_TRIPLE, extent=_PAIR, whole=_PAIR, first=_PAIR, last=_PAIR)


class Beside(NamedTuple):
    """The street along a stretch of road in the plane, for wheels and for whole bodies, as a row of areas from cap to cap.

    ``s`` (n + 1,): the line's arclengths at the caps, ``STRETCH_M`` apart [m]. ``areas`` (m, 3, 2): triangles of all areas [m]; those of
    area k, for wheels and then for bodies, are ``begin[k]`` to ``begin[k + 1]``. ``caps`` (2, n + 1, 2, 2): where these end on the left and
    on the right kerb [m]. ``kerbs``: those of bodies. ``blocked`` (m, 3, 2): triangles of obstacles; ``corners`` (k, 2): of obstacles, and
    those of kerbs that protrude into the street [m].
    """

    s: FloatArray
    areas: FloatArray
    begin: IntArray
    caps: FloatArray
    kerbs: Pieces
    blocked: FloatArray
    corners: FloatArray


class Frame(NamedTuple):
    """The road's points at the stations of a proof: arclength [m], position [m], unwrapped heading [rad], shape (stations,) each."""

    s: FloatArray
    x: FloatArray
    y: FloatArray
    heading: FloatArray


class Around(NamedTuple):
    """What lies around one station after the other, as far as bodies can touch it: memory that the core fills."""

    record: Records  # (1,) of ``_AROUND``
    kept: tuple[object, ...]  # what it points to


def around(space: Beside, reach: float, *, two_regions: bool) -> Around:
    """Return memory for what bodies within ``reach`` [m] of the axle can touch; ``two_regions``: wheels have less room than bodies."""
    bins = 2 * int(np.ceil((reach + 3.0 * BIN_M) / BIN_M)) + 2  # of u: they hold all points within reach
    rows = map(core.address, (space.areas, space.begin, space.caps, space.kerbs.record, space.blocked, space.corners))
    sizes = (len(space.s) - 1, len(space.blocked), len(space.corners))
    beside_ = np.array([(*rows, space.s[0], STRETCH_M, *sizes)], _BESIDE)
    free, lines = np.zeros((2, bins), np.int64), np.empty((2, bins, MOST, 4))
    corners, areas, triangles = (
        np.empty_like(space.corners), np.empty(len(space.areas), _SHAPE_NEAR), np.empty(len(space.blocked), _SHAPE_NEAR)
    )  # fmt: skip
    met = np.empty(len(space.areas), core.ADDRESS)
    kept = (beside_, *space, free, lines, corners, areas, triangles, met)
    of_bins, of_shapes = map(core.address, (free, lines, corners)), map(core.address, (areas, triangles, met))
    record = np.array([(core.address(beside_), reach, two_regions, bins, *of_bins, 0, (0.0, 0.0), *of_shapes)], _AROUND)
    return Around(record, kept)


def frame_record(frame: Frame) -> Records:
    """Return a frame as the core takes it; its arrays must outlive the record."""
    return np.array([(*map(core.address, frame), len(frame.s))], _FRAME)


def frame_of(path: ReferencePath, s: FloatArray) -> Frame:
    """Return the road's points at arclengths ``s`` [m]."""
    point = path.at(s)
    return Frame(s, *map(np.ascontiguousarray, (point.x, point.y, np.unwrap(point.heading))))


def beside(road: Road, s_from: float, s_to: float, *, room: float) -> Beside | None:
    """Return the free space from ``s_from`` to ``s_to`` [m], or as far as it is known on both sides; None where nothing limits it.

    ``room`` is by how much all kerbs and obstacles give way [m]; negative: room to keep from them.
    """
    obstacles = [region.polygon for region in road.regions if region.kind is Kind.OBSTACLE]
    street = road.kerbs
    if street is None:
        return None
    kerbs = street.unrolled(s_from, s_to)
    if {kerb.left for kerb in kerbs} != {True, False}:  # a street wider than its turn has none inside
        return None
    regions = _sides(kerbs, s_from, s_to)
    first = max(s_from, *(float(kerb.s[0]) for sides in regions for kerb in sides))
    last = min(s_to, *(float(kerb.s[-1]) for sides in regions for kerb in sides))
    if last - first < STRETCH_M:
        return None
    s = first + STRETCH_M * np.arange(int((last - first) / STRETCH_M) + 1, dtype=np.float64)
    rows = [(_parts(left, s), _parts(right, s)) for left, right in (regions if street.two_regions else regions[1:])]
    areas = [area for left, right in rows for area in _areas(left, right, room)]
    triangles, of = _triangles(areas)
    none = np.zeros((2 - len(rows)) * (len(s) - 1), np.int64)  # of wheels alone, where they have no kerbs of their own
    caps = np.array([[[part[0] for part in side] + [side[-1][-1]] for side in row] for row in rows])
    blocked, corners = _blocked(obstacles, room)
    return Beside(
        s,
        triangles,
        np.concatenate([none, np.searchsorted(of, np.arange(len(areas) + 1))]),
        np.ascontiguousarray(np.swapaxes(caps[[0, -1]], 1, 2)),
        pieces_of(regions[1]),
        blocked,
        np.concatenate([corners, _protruding(areas[1 - len(s) :])]),
    )


def _sides(kerbs: Sequence[Kerb], s_from: float, s_to: float) -> tuple[tuple[Kerb, Kerb], tuple[Kerb, Kerb]]:
    """Return the left and the right kerb of wheels, and of bodies; of several beside each other the one that goes on for longest."""

    def side(left: bool, wheels: bool) -> Kerb:  # noqa: FBT001 - a kerb's own fields
        own = [kerb for kerb in kerbs if kerb.left is left]
        own = [kerb for kerb in own if kerb.wheels is wheels] or own
        return max(own, key=lambda kerb: min(kerb.s[-1], s_to) - max(kerb.s[0], s_from))

    return (side(True, True), side(False, True)), (side(True, False), side(False, False))


def _parts(kerb: Kerb, cuts: FloatArray) -> list[FloatArray]:
    """Return a kerb's parts between neighbouring arclengths ``cuts``, (n, 2) each; points beside one place of the line stay in order."""
    s = np.maximum.accumulate(kerb.s)
    after = np.clip(np.searchsorted(s, cuts, side="right"), 1, len(s) - 1)
    whole = s[after] - s[after - 1]
    share = np.where(whole > 0.0, (cuts - s[after - 1]) / np.where(whole > 0.0, whole, 1.0), 1.0)
    ends = kerb.points[after - 1] + share[:, None] * (kerb.points[after] - kerb.points[after - 1])
    return [np.concatenate([ends[k : k + 1], kerb.points[after[k] : after[k + 1]], ends[k + 1 : k + 2]]) for k in range(len(cuts) - 1)]


def _areas(left: Sequence[FloatArray], right: Sequence[FloatArray], room: float) -> Sequence[shapely.Geometry]:
    """Return what two kerbs' parts and the caps between them enclose, and ``room`` beyond; where it is negative, less what is nearer."""
    areas = [_enclosed(np.concatenate([one, other[::-1], one[:1]])) for one, other in zip(left, right, strict=True)]
    if room > 0.0:
        return list(shapely.buffer(areas, room, join_style="mitre"))
    kerbs = [shapely.MultiLineString(pair) for pair in zip(left, right, strict=True)]
    near = [shapely.union_all(kerbs[max(k - 1, 0) : k + 2]) for k in range(len(kerbs))]
    return list(shapely.difference(areas, shapely.buffer(near, -room, quad_segs=16)))  # an arc's chord leaves more


def _enclosed(ring: FloatArray) -> shapely.Geometry:
    """Return all that a closed line goes round, however often, and in whichever direction."""
    area = shapely.Polygon(ring)
    if area.is_valid:
        return area
    return shapely.union_all(shapely.get_parts(shapely.polygonize([shapely.node(shapely.LineString(ring))])))


def _triangles(areas: Sequence[shapely.Geometry]) -> tuple[FloatArray, IntArray]:
    """Return the corners of triangles that make up areas, (n, 3, 2), and the number of the area of each, rising."""
    parts, of = shapely.get_parts(shapely.constrained_delaunay_triangles(areas), return_index=True)
    return np.ascontiguousarray(shapely.get_coordinates(parts).reshape(-1, 4, 2)[:, :3]), of


def _protruding(areas: Sequence[shapely.Geometry]) -> FloatArray:
    """Return the sharp corners at which what is not street protrudes into it, (n, 2)."""
    found = [np.empty((0, 2))]
    for polygon in shapely.get_parts(shapely.union_all(areas)):
        for ring in shapely.get_rings(shapely.orient_polygons(polygon)):
            points = shapely.get_coordinates(ring)[:-1]
            ahead = np.roll(points, -1, axis=0) - points
            ahead /= np.hypot(*ahead.T)[:, None]
            back = np.roll(ahead, 1, axis=0)
            found.append(points[back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0] < -_SHARP])
    return np.concatenate(found)


def _blocked(obstacles: Sequence[shapely.Polygon], room: float) -> tuple[FloatArray, FloatArray]:
    """Return triangles and corners of all obstacles, each smaller by ``room`` or, where that is negative, larger; rounded inwards."""
    # A chord of an arc lies inside a larger obstacle; corners of a smaller one stay corners.
    moved = list(shapely.buffer(obstacles, -room, quad_segs=16, join_style="mitre" if room > 0.0 else "round"))
    return _triangles(moved)[0], shapely.get_coordinates(moved)
