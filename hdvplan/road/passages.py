"""Obstacles and sweepable areas in the plane: the faces of them that a vehicle drives along, for either side on which it passes them.

A face is a kerb: that of an obstacle bounds bodies, that of a sweepable area bounds wheels.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy  # its subpackages load when they are first used
import shapely

from hdvplan.arrays import BoolArray, FloatArray, IntArray
from hdvplan.road.drawn import densely, rising, within_lap
from hdvplan.road.path import PathPoint, ReferencePath
from hdvplan.road.pieces import Kerb
from hdvplan.road.regions import OPEN_M, Kind, Region, Side
from hdvplan.road.street import BEYOND_M, Street

_SAMPLES_M = 1.0  # of the line: a point's foot is looked for between two of them
_LINE_M = 0.25  # of the line, where a polygon may meet it
_APART_M = 10.0  # along the line: feet of one polygon further from each other are on two arms of the road
_TIE_M = 0.01  # of a polygon's first points: the one furthest from where it is passed begins its face
_FAR_M = 1000.0  # beyond a road's ends, where a polygon around it is cut in two
_CUT_M = 1e-3  # half the width of such a cut
_BEHIND_M = 3.0  # as far beyond a polygon as a vehicle is wide: what is behind its face is no street
_WALL_M = 0.1  # of a wall where the kerb is nearer than the polygon
_FOLD = 0.9  # of the radius of curvature: normals must not reach the centre, where they meet


@dataclass(frozen=True)
class Passage:
    """A polygon over a stretch of road, and its face on either side: a kerb, in two parts where a closed road begins again.

    Offsets from the line in metres, left positive. ``usual`` is the side on which it is passed when nothing else is known: its own, or
    the one with more room.
    """

    region: int  # index of the polygon among the road's regions
    kind: Kind
    s_from: float  # [m]; beyond the road's length for what lies over the start of a closed road
    s_to: float
    low: float  # rightmost offset
    high: float  # leftmost
    on_line: bool  # the line meets it
    around: bool  # it lies on both sides of a line that it leaves free: no side to choose
    usual: Side
    faces: Mapping[Side, tuple[Kerb, ...]]
    rooms: Mapping[Side, float]  # the least distance to the kerb on either side; infinite without one [m]


@dataclass(frozen=True)
class Feet:
    """Where points have their feet on a line: the points' numbers, arclengths and offsets, (n,) each [m]."""

    point: IntArray
    s: FloatArray
    offset: FloatArray

    def of(self, chosen: BoolArray | IntArray) -> Feet:
        """Return some of them."""
        return Feet(self.point[chosen], self.s[chosen], self.offset[chosen])


@dataclass(frozen=True)
class Line:
    """A road's line, an open one's with what lies beyond its ends, in samples."""

    path: ReferencePath
    longer: ReferencePath
    samples: FloatArray  # s, x, y, cos, sin, shape (5, n)
    tree: scipy.spatial.KDTree

    @classmethod
    def of(cls, path: ReferencePath) -> Line:
        """Return a road's line."""
        longer = path.extended(BEYOND_M, BEYOND_M)
        first, last = (0.0, path.length) if path.closed else (-BEYOND_M, path.length + BEYOND_M)
        s = np.linspace(first, last, int(np.ceil((last - first) / _SAMPLES_M)) + 1)
        here = longer.at(s)
        samples = np.stack([s, here.x, here.y, np.cos(here.heading), np.sin(here.heading)])
        return cls(path, longer, samples, scipy.spatial.KDTree(samples[1:3].T))

    @cached_property
    def own(self) -> shapely.LineString:
        """The line itself."""
        return self.between(0.0, self.path.length)

    @cached_property
    def endless(self) -> shapely.LineString:
        """An open line with what lies beyond its ends."""
        centre = shapely.get_coordinates(self.between(self.samples[0, 0], self.samples[0, -1]))
        ends = centre[[0, -1]] + _FAR_M * self.samples[3:, [0, -1]].T * np.array([[-1.0], [1.0]])
        return shapely.LineString(np.concatenate([ends[:1], centre, ends[1:]]))

    def feet(self, points: FloatArray) -> Feet:
        """Return all feet of points (n, 2) within ``OPEN_M``, on every arm of the road, nearer than the centre of its bend."""
        near = scipy.spatial.KDTree(points).sparse_distance_matrix(self.tree, OPEN_M + _SAMPLES_M, output_type="ndarray")
        owner, at = near["i"], near["j"]
        owner, at = owner[at < self.samples.shape[1] - 1], at[at < self.samples.shape[1] - 1]
        (ahead, across), (beyond, across_beyond) = (self._seen(points[owner], at + step) for step in (0, 1))
        met = (ahead >= 0.0) & (beyond < 0.0)
        owner, at, part = owner[met], at[met], ahead[met] / (ahead[met] - beyond[met])
        offset = across[met] + part * (across_beyond[met] - across[met])
        s = self.samples[0, at] + part * (self.samples[0, at + 1] - self.samples[0, at])
        return Feet(owner, s, offset).of(np.abs(offset) <= OPEN_M)

    def _seen(self, points: FloatArray, at: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return how far points lie ahead of samples and left of them [m]."""
        _, x, y, cos, sin = self.samples[:, at]
        u, v = points[:, 0] - x, points[:, 1] - y
        return u * cos + v * sin, v * cos - u * sin

    def arms(self, polygon: shapely.Polygon) -> Iterator[Feet]:
        """Yield the feet of a polygon's outline on each arm of the road, one of each point."""
        yield from _arms(self.feet(_ring_beside(self, polygon)), self.path)

    def beside(self, points: FloatArray, s_from: float, s_to: float) -> FloatArray:
        """Return the arclengths of points (n, 2) on a stretch of the line, which never fall: see ``_filled`` [m]."""
        feet = self.feet(points)
        s = feet.s + (self.path.length * np.ceil((s_from - feet.s) / self.path.length) if self.path.closed else 0.0)
        feet = replace(feet, s=s).of((s >= s_from) & (s <= s_to))
        return _filled(len(points), _nearest(feet))

    def between(self, s_from: float, s_to: float) -> shapely.LineString:
        """Return the line's part between two arclengths, which may lie in a closed one's next lap [m]."""
        s = np.linspace(s_from, s_to, max(int(np.ceil((s_to - s_from) / _LINE_M)), 1) + 1)
        s = np.mod(s, self.path.length) if self.path.closed else np.clip(s, self.longer.s_first, self.longer.s_last)
        return shapely.LineString(np.stack(self.longer.to_plane(s, 0.0), axis=1))


def passages_of(line: Line, regions: tuple[Region, ...], street: Street | None) -> tuple[Passage, ...]:
    """Return where a road passes the polygons beside it, in order of s; ``street`` are its kerbs."""
    found = [passage for number, region in enumerate(regions) for passage in _passages(line, number, region, street)]
    return tuple(sorted(found, key=lambda passage: passage.s_from))


def _passages(line: Line, number: int, region: Region, street: Street | None) -> Iterator[Passage]:
    """Yield a polygon's passages: one on every arm of the road that it lies beside."""
    for polygon in _sided(line, region.polygon):
        outline = _ring_beside(line, polygon)
        for feet in _arms(line.feet(outline), line.path):
            s_from, s_to = float(np.min(feet.s)), float(np.max(feet.s))
            low, high = float(np.min(feet.offset)), float(np.max(feet.offset))
            centre = line.between(s_from, s_to)
            on_line, around = bool(shapely.intersects(polygon, centre)), polygon is not region.polygon
            rooms = {side: _room(polygon, centre, street, side, (s_from, s_to)) for side in Side}
            usual = _usual(low, high, rooms, on_line=on_line)
            usual = usual if around or region.side is None else region.side
            faces = {side: _face(line, outline, feet, usual if around else side, street) for side in Side}
            if region.kind is Kind.SWEEPABLE:
                faces = {side: tuple(replace(kerb, wheels=True) for kerb in kerbs) for side, kerbs in faces.items()}
            yield Passage(number, region.kind, s_from, s_to, low, high, on_line, around, usual, faces, rooms)


def _sided(line: Line, polygon: shapely.Polygon) -> list[shapely.Polygon]:
    """Return a polygon in parts where it lies around a line that it leaves free, each on one side of it."""
    if line.path.closed or shapely.intersects(line.own, polygon) or not shapely.intersects(line.endless, polygon):
        return [polygon]
    parts = list(shapely.get_parts(shapely.difference(polygon, shapely.buffer(line.endless, _CUT_M))))
    beside = shapely.intersects(parts, shapely.buffer(line.own, OPEN_M, cap_style="flat"))
    return parts if np.count_nonzero(beside) > 1 else [polygon]  # one beyond the line's end is passed on either side


def _ring_beside(line: Line, polygon: shapely.Polygon) -> FloatArray:
    """Return the outline of a polygon that a line lies beside: that of a hole, if it lies in one; the area is on the left of it."""
    start = shapely.Point(line.samples[1:3, 0])
    polygon = shapely.geometry.polygon.orient(polygon)
    hole = next((ring for ring in polygon.interiors if shapely.Polygon(ring).contains(start)), polygon.exterior)
    return np.asarray(densely(np.asarray(hole.coords))[0][:-1])


def _arms(feet: Feet, path: ReferencePath) -> Iterator[Feet]:
    """Yield the feet on each arm of the road; over the start of a closed one arclengths go on beyond its length."""
    order = np.argsort(feet.s, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(feet.s[order]) > _APART_M) + 1)
    if path.closed and len(parts) > 1 and feet.s[parts[0][0]] + path.length - feet.s[parts[-1][-1]] <= _APART_M:
        lap = np.zeros(len(order))
        lap[parts[0]] = path.length
        feet = replace(feet, s=feet.s + lap)
        parts = [*parts[1:-1], np.concatenate([parts[-1], parts[0]])]
    yield from (_nearest(feet.of(part)) for part in parts if len(part))


def _nearest(feet: Feet) -> Feet:
    """Return of each point the foot that it is nearest to."""
    order = np.lexsort((np.abs(feet.offset), feet.point))
    return feet.of(order[np.unique(feet.point[order], return_index=True)[1]])


def _filled(count: int, feet: Feet) -> FloatArray:
    """Return the arclengths of ``count`` points in a row, which never fall: those without a foot lie between their neighbours [m]."""
    offset = np.full(count, OPEN_M)
    offset[feet.point] = feet.offset
    return rising(np.interp(np.arange(count), feet.point, feet.s), offset)


def face_of(line: Line, polygon: shapely.Polygon, side: Side, street: Street) -> Iterator[Kerb]:
    """Yield the faces of a polygon that a vehicle drives along which passes it on ``side``, on every arm of the road."""
    outline = _ring_beside(line, polygon)
    for feet in _arms(line.feet(outline), line.path):
        yield from _face(line, outline, feet, side, street)


def _face(line: Line, outline: FloatArray, feet: Feet, side: Side, street: Street | None) -> tuple[Kerb, ...]:
    """Return what of an outline, counterclockwise (n, 2), a vehicle sees that passes it on ``side``.

    From its first point along the line to its last one: clockwise where it is passed on the left. Walls across the line, which close
    what is behind it, are its first and its last piece.
    """
    path, sign = line.path, 1.0 if side is Side.LEFT else -1.0
    turned = outline[::-1] if side is Side.LEFT else outline
    number = len(outline) - 1 - feet.point if side is Side.LEFT else feet.point
    first = int(np.argmin(feet.s + _TIE_M * sign * feet.offset))
    last = int(np.argmax(feet.s - _TIE_M * sign * feet.offset))
    count = (number[last] - number[first]) % len(outline) or len(outline)  # a sliver across the line begins and ends in one place
    around = path.closed and bool(np.ptp(feet.s) > path.length - _APART_M)
    if around:
        count, last = len(outline), first
    at = (number[first] + np.arange(count + 1)) % len(outline)
    place = (number - number[first]) % len(outline)
    own = place <= count
    s = _filled(count + 1, _nearest(replace(feet, point=place).of(own)))
    points = turned[at]
    if around:  # nothing is behind it
        s[-1] = s[0] + path.length
    else:
        walls = _walls(line, feet, points[[0, -1]], s[[0, -1]], feet.offset[[first, last]], side, street)
        points, s = np.concatenate([walls[:1], points, walls[1:]]), np.concatenate([s[:1], s, s[-1:]])
    kerb = Kerb(points, s, side is Side.RIGHT, goes_on=around)
    return tuple(within_lap(kerb, path))


def _walls(line: Line, feet: Feet, points: FloatArray, s: FloatArray, ends: FloatArray, side: Side, street: Street | None) -> FloatArray:
    """Return how far across the line the walls go that begin at the ends of a face, ``points`` (2, 2) at s (2,) and offsets: (2, 2) [m].

    They end at the kerb, or where all of the polygon is before them, and before the normals meet: a face that ends beyond that has none.
    """
    sign = 1.0 if side is Side.LEFT else -1.0
    offset = np.full(2, float(np.min(sign * feet.offset)) - _BEHIND_M)
    for kerb in () if street is None else street.beside(float(s[0]) - _SAMPLES_M, float(s[1]) + _SAMPLES_M):
        if kerb.left is (side is Side.RIGHT) and not kerb.wheels:
            offset = np.fmax(offset, sign * offsets_of(line.longer, kerb, s))
    offset = sign * np.minimum(offset, sign * ends - _WALL_M)
    reach = _FOLD / np.maximum(np.sign(offset) * line.longer.at(s).curvature, 1e-9)
    across = np.stack(line.longer.to_plane(s, np.sign(offset) * np.minimum(np.abs(offset), reach)), axis=1)
    return np.where((reach > np.abs(ends))[:, None], across, points)


def without_walls(face: Kerb) -> Kerb:
    """Return a polygon's face without the walls that close what is behind it."""
    if face.goes_on:
        return face
    seen = slice(int(face.s[0] == face.s[1]), len(face.s) - int(face.s[-2] == face.s[-1]))
    return replace(face, points=face.points[seen], s=face.s[seen])


def _room(polygon: shapely.Polygon, line: shapely.LineString, street: Street | None, side: Side, stretch: tuple[float, float]) -> float:
    """Return the distance from a polygon to the kerbs on one side of it, 0 where it meets one or lies beyond it [m]."""
    way = shapely.shortest_line(line, polygon)
    reach = way.length + _SAMPLES_M  # a kerb inside a corner lies beside other stretches, too
    kerbs = street.beside(stretch[0] - reach, stretch[1] + reach) if street else ()
    lines = [shapely.LineString(kerb.points) for kerb in kerbs if kerb.left is (side is Side.LEFT) and not kerb.wheels]
    return 0.0 if np.any(shapely.intersects(way, lines)) else float(np.min(shapely.distance(polygon, lines), initial=np.inf))


def _usual(low: float, high: float, rooms: Mapping[Side, float], *, on_line: bool) -> Side:
    """Return the side on which a polygon is passed: that on which the line lies, or the one with more room, or the shorter way."""
    if on_line and rooms[Side.LEFT] != rooms[Side.RIGHT]:
        return max(rooms, key=lambda side: rooms[side])
    return Side.RIGHT if high > -low else Side.LEFT


def offsets_of(path: ReferencePath, face: Kerb, s: FloatArray) -> FloatArray:
    """Return where the normals at arclengths ``s`` meet a face first, from the side that is driven on; NaN where they do not [m]."""
    here = path.at(s)
    centre, normal = normals(here)
    left, right = furthest(here.curvature), furthest(-here.curvature)
    ends = np.stack([centre + left[:, None] * normal, centre - right[:, None] * normal], axis=1)
    points, owner = shapely.get_coordinates(
        shapely.intersection(np.asarray(shapely.linestrings(ends)), shapely.LineString(face.points)), return_index=True
    )
    offset = np.sum((points - centre[owner]) * normal[owner], axis=1)
    found = np.full(len(s), np.nan)
    (np.fmin if face.left else np.fmax).at(found, owner, offset)
    return found


def normals(here: PathPoint) -> tuple[FloatArray, FloatArray]:
    """Return where normals stand, and their directions to the left, shape (n, 2) each."""
    return np.stack([here.x, here.y], axis=1), np.stack([-np.sin(here.heading), np.cos(here.heading)], axis=1)


def furthest(curvature: FloatArray) -> FloatArray:
    """Return how far normals may go towards the side that a line bends to, before they meet [m]."""
    return np.minimum(OPEN_M, _FOLD / np.maximum(curvature, 1e-9))
