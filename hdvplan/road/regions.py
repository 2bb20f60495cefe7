"""Obstacles and kerbs: polygons in the plane of a road ([BUS]'s drivable, sweepable and obstacle regions)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.ops import substring

from hdvplan.arrays import BoolArray, FloatArray, turns_of
from hdvplan.errors import RoadError
from hdvplan.road.crs import ELSEWHERE_HINT
from hdvplan.road.path import ReferencePath
from hdvplan.road.pieces import BACK
from hdvplan.road.street import BEYOND_M

OPEN_M = 20.0  # room to either side of a road that has obstacles but no widths; polygons further away do not count
OPEN_SPACING_M = 0.5
EDGE = "edge"  # what one without a name is called
_EDGES = (EDGE, "kerb", "curb")  # words in the names of what is one
_MEET_M = 1e-3  # ends of drawn pieces this close are one place
_GRID_M = 1e-5  # to which what is drawn twice is rounded
_FACED_M = 1.0  # so far apart what lies before an edge's two faces is looked for
_SEEN_M = 0.2  # so far apart points of an edge are looked at from its street
SPUR_M = 0.01  # as thick is a wall that is drawn without any width
_Drawn = tuple[FloatArray, str, str]  # a line (n, 2) [m], its name and its layer
_ELSEWHERE_M = 1e5  # regions of a whole city may be given for a road beside it


class Kind(StrEnum):
    """What a region means to a vehicle."""

    OBSTACLE = "obstacle"  # nothing may enter
    SWEEPABLE = "sweepable"  # overhangs may pass over it, wheels may not


class Side(StrEnum):
    """On which side of an obstacle a vehicle passes it, as it drives: an obstacle that is passed on the left lies to its right."""

    LEFT = "left"
    RIGHT = "right"

    @property
    def other(self) -> Side:
        """The opposite side."""
        return Side.RIGHT if self is Side.LEFT else Side.LEFT


class Edge(NamedTuple):
    """A kerb or a wall as drawn, a line in the road's plane [m]."""

    label: str
    line: shapely.LineString


@dataclass(frozen=True)
class Region:
    """A polygon in the road's plane [m]; ``side`` is where it must be passed, None where that is free."""

    kind: Kind
    polygon: shapely.Polygon
    label: str = field(default="", metadata={"decides": False})
    side: Side | None = None
    plan: str = field(default="", metadata={"decides": False})  #: the folder of the plan that swept it; "" of what a road file has
    edges: tuple[Edge, ...] = field(default=(), metadata={"decides": False})  #: that part it from the street, where they were drawn alone

    def at(self, x: float, y: float) -> Region:
        """Return the region as it is called at a place [m]: behind edges like the nearest one."""
        if not self.edges:
            return self
        place = shapely.Point(x, y)
        return replace(self, label=min(self.edges, key=lambda edge: float(edge.line.distance(place))).label)


def called(label: str) -> str:
    """Return what a sentence calls the obstacle with this label, "" where it has none: edges bound legs as obstacles, and stay edges."""
    words = label.casefold().replace("_", " ").split()
    what = next((word for word in _EDGES if word in words), Kind.OBSTACLE)
    return f"the {what}" if label == what else f"the {what} {label!r}" if label else "an obstacle"


def limit_called(side: str, binds: str | None) -> str:
    """Return what a sentence calls the road's limit on a side; ``binds``: see ``Road.binds``."""
    return f"the {side} limit of {binds}" if binds else f"the {side} limit"


def polygons_of(geometry: shapely.Geometry) -> list[shapely.Polygon]:
    """Return the polygons in a geometry, however deep they lie; lines and points that repairs left over are dropped."""
    return [part for part in shapely.get_parts(shapely.get_parts(geometry)) if isinstance(part, shapely.Polygon) and not part.is_empty]


def walls_of(lines: list[FloatArray]) -> list[shapely.Polygon]:
    """Return lines (n, 2) [m] as walls ``SPUR_M`` thick, those that touch as one, with holes where they enclose something."""
    drawn = shapely.union_all([shapely.LineString(line) for line in lines])
    return polygons_of(shapely.buffer(drawn, 0.5 * SPUR_M, cap_style="square", join_style="mitre"))


def is_island(edge: FloatArray, others: list[FloatArray], line: FloatArray) -> bool:
    """Return whether an edge is closed around a part of a ``line``, (n, 2) each [m], and others lie beyond it to both sides."""
    if len(edge) < 4 or not others or np.any(edge[0] != edge[-1]):  # noqa: PLR2004 - of a ring
        return False
    drawn, ring = shapely.LineString(line), shapely.Polygon(edge)
    if not (ring.is_valid and ring.intersects(drawn)) or ring.intersects(drawn.boundary):
        return False
    within = np.array(max(shapely.get_parts(shapely.intersection(drawn, ring)), key=shapely.length).coords)
    (ahead, aside), middle = within[-1] - within[0], 0.5 * (within[0] + within[-1])
    across = OPEN_M / max(float(np.hypot(ahead, aside)), SPUR_M) * np.array([-aside, ahead])
    ways = shapely.difference(shapely.linestrings([[middle, middle + across], [middle, middle - across]]), ring)
    return bool(np.all(shapely.intersects(ways, shapely.union_all([shapely.LineString(other) for other in others]))))


def is_median(edge: FloatArray, edges: shapely.STRtree, line: shapely.STRtree) -> bool:
    """Return whether an open edge, (n, 2) [m], stands between two arms of a line, whose pieces are given, before all other ``edges``.

    It does so along most of itself.
    """
    own = shapely.LineString(edge)
    if np.all(edge[0] == edge[-1]) or own.length == 0.0 or len(line.query(own, predicate="intersects")):
        return False
    fine = shapely.get_coordinates(shapely.segmentize(own, _FACED_M))
    steps = np.diff(fine, axis=0)
    length = np.hypot(*steps.T)
    fine, steps, length = fine[:-1][length > 0.0], steps[length > 0.0], length[length > 0.0]
    places, aside = fine + 0.5 * steps, np.column_stack([-steps[:, 1], steps[:, 0]]) / length[:, None]
    faces = list[BoolArray]()
    for face in (aside, -aside):
        ways = np.asarray(shapely.linestrings(np.stack([places + SPUR_M * face, places + 2.0 * OPEN_M * face], axis=1)))
        faces.append(_first(ways, line) < _first(ways, edges))
    return bool(np.sum(length[faces[0] & faces[1]]) > 0.5 * np.sum(length))


def _first(ways: NDArray[np.object_], lines: shapely.STRtree) -> FloatArray:
    """Return how far along straight ``ways`` (n,) the first of ``lines`` is, (n,) [m]; infinite without any."""
    way, met = lines.query(ways, predicate="intersects")
    first = np.full(len(ways), np.inf)
    apart = shapely.distance(shapely.get_point(ways[way], 0), shapely.intersection(ways[way], lines.geometries[met]))
    np.minimum.at(first, way, apart)
    return first


def outlines_of(geometry: shapely.Geometry) -> list[shapely.LineString]:
    """Return the lines that draw a geometry: a line itself, of polygons their outlines, each with its holes behind it."""
    if isinstance(geometry, shapely.LineString):
        return [geometry]
    return [ring for part in polygons_of(geometry) for ring in (part.exterior, *part.interiors)]


def refuse_elsewhere(regions: tuple[Region, ...], path: ReferencePath) -> None:
    """Refuse regions none of which lies near a road: wrong coordinates would go unnoticed, and nothing be in the way.

    Raises:
        RoadError: none is within 100 km.

    """
    nearest = float(np.min(distances(path, regions), initial=np.inf))
    if _ELSEWHERE_M < nearest < np.inf:
        msg = f"the {len(regions)} regions lie {nearest / 1e3:.0f} km from the road, or further"
        raise RoadError(msg, hint=ELSEWHERE_HINT)


def distances(path: ReferencePath, regions: tuple[Region, ...]) -> FloatArray:
    """Return how far each region lies from the road's centre line [m]; those beyond ``OPEN_M`` do not count."""
    if not regions:
        return np.empty(0)
    s = np.linspace(0.0, path.length, int(np.ceil(path.length / OPEN_SPACING_M)) + 1)
    points = np.stack(path.to_plane(s, 0.0), axis=1)
    centre = shapely.STRtree(np.asarray(shapely.linestrings(np.stack([points[:-1], points[1:]], axis=1))))
    _, apart = centre.query_nearest([region.polygon for region in regions], return_distance=True, all_matches=False)
    return np.asarray(apart)


def without_spurs(edge: FloatArray) -> tuple[FloatArray, list[shapely.Polygon]]:
    """Return an edge (n, 2) [m] without what is drawn out and back on itself, and that as walls ``SPUR_M`` thick: it has no width.

    What goes back along the rest of the edge is no wall; of an edge that is nothing but a way out and back one way is left.
    """
    points, spurs = edge, list[FloatArray]()
    while len(points) > 2:  # noqa: PLR2004 - points that make no turn
        length, turn = np.hypot(*np.diff(points, axis=0).T), turns_of(points)
        if np.any(length == 0.0):
            points = points[np.append(True, length > 0.0)]
        elif np.any(turn < BACK):
            tip = 1 + int(np.argmax(turn < BACK))
            spurs.append(points[[tip, tip - 1 if length[tip - 1] <= length[tip] else tip + 1]])
            points = np.delete(points, tip, axis=0)
        else:
            break
    if not spurs:
        return edge, []
    drawn = shapely.union_all(shapely.linestrings(spurs))
    if not np.any(points != points[0]):
        points = shapely.get_coordinates(shapely.get_geometry(shapely.line_merge(drawn), 0))
    walls = shapely.difference(drawn, shapely.buffer(shapely.LineString(points), SPUR_M))
    return points, polygons_of(shapely.buffer(shapely.line_merge(walls), 0.5 * SPUR_M, cap_style="flat", join_style="mitre"))


def snapped(lines: list[FloatArray], within: float) -> list[FloatArray]:
    """Return lines (n, 2) [m] whose ends are moved to the first of all ends that is ``within`` so many metres of them."""
    ends = np.array([point for line in lines for point in (line[0], line[-1])])
    places = [shapely.Point(end) for end in ends]
    own, near = shapely.STRtree(places).query(places, predicate="dwithin", distance=within)
    first = np.full(len(ends), len(ends))
    np.minimum.at(first, own, near)
    moved = ends[first].reshape(-1, 2, 2)
    return [np.concatenate([begin, line[1:-1], end]) for line, (begin, end) in zip(lines, moved[:, :, None], strict=True)]


def seen(edges: list[_Drawn], line: shapely.Geometry) -> list[_Drawn]:
    """Return edges, (n, 2) [m] with name and layer, without what lies beside a ``line`` and behind others: fences, and ends of walls.

    Of one that crosses others the parts between these are looked at one by one. What is further aside goes with what it is the end of.
    """
    if len(edges) <= 2:  # noqa: PLR2004 - one a side
        return edges
    drawn = np.array([shapely.LineString(edge) for edge, _, _ in edges])
    beside = shapely.union_all([shapely.buffer(part, OPEN_M, cap_style="flat") for part in shapely.get_parts(line) if part.length])
    beyond = shapely.difference(shapely.buffer(shapely.boundary(line), BEYOND_M), beside)
    room = shapely.get_parts(shapely.difference(beside, shapely.buffer(shapely.union_all(drawn), _MEET_M, cap_style="square")))
    before = shapely.buffer(shapely.union_all(room[shapely.intersects(room, line)]), 2.0 * _MEET_M)
    parts, edge_of = shapely.get_parts(_parted(drawn, shapely.boundary(beside)), return_index=True)
    length = shapely.length(parts)
    long = np.flatnonzero(length > 0.0)
    fine = shapely.segmentize(parts[long], np.minimum(0.5 * length[long], _SEEN_M))
    points, owner = shapely.get_coordinates(fine, return_index=True)
    inner = 1 + np.flatnonzero(owner[2:] == owner[:-2])  # where an edge begins at a kerb, its end is seen
    shapely.prepare([before, beside])
    within = shapely.contains_xy(before, points[inner]), ~shapely.contains_xy(beside, points[inner])
    is_seen, aside = (np.isin(np.arange(len(parts)), long[owner[inner[there]]]) for there in within)
    hidden = (length > 0.0) & ~is_seen & ~aside & (shapely.length(shapely.intersection(drawn, beyond)) < _MEET_M)[edge_of]
    same = np.diff(edge_of) == 0
    hidden |= aside & (np.append(hidden[1:] & same, False) | np.append(False, hidden[:-1] & same))
    found, ends = list[_Drawn](), np.flatnonzero(~same) + 1
    for edge, own, behind in zip(edges, np.split(parts, ends), np.split(hidden, ends), strict=True):
        cut = shapely.get_parts(shapely.line_merge(shapely.multilinestrings(own[~behind]))) if np.any(behind) else ()
        found += [(shapely.get_coordinates(part), *edge[1:]) for part in cut] if np.any(behind) else [edge]
    return found


def _parted(lines: NDArray[np.object_], bound: shapely.Geometry) -> NDArray[np.object_]:
    """Return each of ``lines`` as it is or, where it crosses others or a ``bound``, parted there into several."""
    others = np.array([*lines, bound])
    own, met = shapely.STRtree(others).query(lines, predicate="crosses")
    parted = lines.copy()
    for at in np.unique(own[~shapely.is_closed(lines[own])]):
        where = shapely.get_parts(shapely.intersection(lines[at], shapely.union_all(others[met[own == at]])))
        ends = np.unique([0.0, *shapely.line_locate_point(lines[at], shapely.centroid(where)), lines[at].length])
        parted[at] = shapely.geometrycollections([substring(lines[at], *stretch) for stretch in pairwise(ends)])
    return parted


def joined(edges: list[_Drawn]) -> list[_Drawn]:
    """Return edges, (n, 2) [m] with name and layer, in which those of a layer that meet end to end, two at a place, are one line.

    In which order and direction they are drawn does not count, nor that one is drawn twice, or over another's end. A line has the name of
    a piece at its end.
    """
    found, layers = list[_Drawn](), dict[str, list[_Drawn]]()
    for edge in edges:
        closed = np.array_equal(edge[0][0], edge[0][-1])  # or a point
        (found if closed else layers.setdefault(edge[2], [])).append(edge)
    for layer, own in layers.items():
        lines = np.array([shapely.LineString(points) for points in snapped([points for points, _, _ in own], _MEET_M)])
        later, before = shapely.STRtree(lines).query(lines, predicate="intersects")
        under = [shapely.union_all(lines[before[(later == at) & (before < at)]]) for at in range(len(lines))]
        once = shapely.line_merge(shapely.difference(lines, under, grid_size=_GRID_M))  # whole where they only cross
        each = shapely.union_all(lines[:, None], axis=1)  # what one draws out and back: a spur
        twice = np.sum(shapely.length(each) - shapely.length(once)) > _MEET_M
        merged = shapely.get_parts(shapely.line_merge(shapely.MultiLineString([*shapely.get_parts(once if twice else lines)])))
        nearest = shapely.STRtree(lines).nearest(shapely.get_point(merged, 0))
        named = [(np.array(one.coords), own[at][1], layer) for one, at in zip(merged, nearest, strict=True)]
        found += own if len(merged) == len(own) else named
    return found
