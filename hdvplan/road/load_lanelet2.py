"""Read a road from a Lanelet2 map, one lanelet after another, and write a driven line into it. The only user of lanelet2."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from shapely.ops import nearest_points, substring

from hdvplan.errors import RoadError
from hdvplan.road.assemble import road_of
from hdvplan.road.crs import LONLAT
from hdvplan.road.features import Feature
from hdvplan.road.line import RawRoad
from hdvplan.road.options import Corners, RoadOptions, ids_of
from hdvplan.texts import some_of

_MARK = re.compile(rb"""<tag\s+k=["']type["']\s+v=["']lanelet["']""")
_NODE = re.compile(rb"""<node\s[^>]*>""")
_PLACE = re.compile(rb"""\s(lat|lon)=["']([^"']*)""")
_PARTS = ("core", "geometry", "io", "projection", "routing", "traffic_rules")
_RULES = ("de", "vehicle")  # of who may drive where: the library has no others
_LISTED = 12
_WAYS, _TRIED = 6, 1000  # that are told; places at which ways begin, for the longest of them


def is_lanelet2(path: Path) -> bool:
    """Tell whether a file in OpenStreetMap's form holds lanelets."""
    return _MARK.search(path.read_bytes()) is not None


def read_lanelet2(path: Path, *, road_ids: str | Sequence[str] | None) -> RawRoad:
    """Return the lanelets along a route in a Lanelet2 map: their centreline, and their bounds as edges.

    ``road_ids`` are the lanelets to drive over, one by one or separated by commas; a minus sign drives one against its direction, where
    the map allows it. Between lanelets that do not meet, the shortest way without a change of lane is taken.

    Raises:
        RoadError: lanelet2 is not installed, or the map cannot be used, or has no such lanelets or way.

    """
    library, projector, _, route = _routed(path, road_ids)
    name = path.name
    whole = library.core.LaneletSequence(route)
    features = [
        Feature({"type": "LineString", "coordinates": _lonlat(projector, line)}, properties, (label,), system=LONLAT)
        for label, line, properties in (
            ("centreline", whole.centerline, {"corners": Corners.ROUND}),
            ("left", whole.leftBound, {}),
            ("right", whole.rightBound, {}),
        )
    ]
    driven = ", ".join(_id(lanelet) for lanelet in route)
    raw = road_of(features, name, RoadOptions(feature="centreline"))
    return replace(raw, notes=(*raw.notes, f"{name}: over lanelets {driven}"))


def with_centreline(path: Path, road_ids: str | Sequence[str] | None, line: shapely.Geometry) -> bytes:
    """Return a Lanelet2 map in which the driven line is the centreline of the lanelets along a route, at the heights of the middle.

    ``line`` is a LineString in the order of driving, of longitudes and latitudes [deg]; ``road_ids`` as for ``read_lanelet2``.

    Raises:
        RoadError: as of ``read_lanelet2``.
        OSError: there is no room for temporary files.

    """
    library, projector, lanelets, route = _routed(path, road_ids)
    places = [projector.forward(library.core.GPSPoint(lat, lon, 0.0)) for lon, lat in shapely.get_coordinates(line)]
    driven = shapely.LineString([(place.x, place.y) for place in places])
    begins = [shapely.LineString([(bound[0].x, bound[0].y) for bound in (lanelet.leftBound, lanelet.rightBound)]) for lanelet in route[1:]]
    cuts = [0.0, *(driven.project(nearest_points(driven, begin)[0]) for begin in begins), driven.length]
    joint: list[Any] = []  # the point that a lanelet's centreline shares with the one before it
    for lanelet, (begin, end) in zip(route, pairwise(cuts), strict=True):
        middle = shapely.LineString([(point.x, point.y, point.z) for point in lanelet.centerline])
        heights = [(x, y, middle.interpolate(middle.project(shapely.Point(x, y))).z) for x, y in substring(driven, begin, end).coords]
        points = [*joint, *(library.core.Point3d(library.core.getId(), *place) for place in heights[len(joint) :])]
        centreline = library.core.LineString3d(library.core.getId(), points[::-1] if lanelet.inverted() else points)
        lanelets.add(centreline)
        lanelets.laneletLayer[lanelet.id].centerline = centreline
        joint = points[-1:]
    with TemporaryDirectory() as folder:
        written = Path(folder) / "map.osm"
        library.io.write(str(written), lanelets, projector)
        return written.read_bytes()


def _routed(path: Path, road_ids: str | Sequence[str] | None) -> tuple[SimpleNamespace, Any, Any, list[Any]]:
    """Return the library, the projection of a map to a plane, its lanelets, and those along a route."""
    library = _library()
    projector = library.projection.LocalCartesianProjector(library.io.Origin(*_first_place(path)))
    try:
        lanelets, _ = library.io.loadRobust(str(path), projector)
    except (RuntimeError, ValueError) as error:
        msg = f"{path.name} is no Lanelet2 map that can be read: {error}"
        raise RoadError(msg) from error
    return library, projector, lanelets, _route(library, lanelets, road_ids, path.name)


def _library() -> SimpleNamespace:
    """Load lanelet2, which only such maps need: it has no types."""
    try:
        return SimpleNamespace(**{part: import_module(f"lanelet2.{part}") for part in _PARTS})
    except ImportError as error:
        msg = f"Lanelet2 maps are read by lanelet2, which cannot be loaded: {error}"
        raise RoadError(msg, hint="pip install 'hdvplan[lanelet2]'") from error


def _first_place(path: Path) -> tuple[float, float]:
    """Return latitude and longitude of a map's first node [deg], the origin of a plane around it."""
    node = _NODE.search(path.read_bytes())
    found = {} if node is None else {key.decode(): value for key, value in _PLACE.findall(node[0])}
    try:
        return float(found["lat"]), float(found["lon"])
    except (KeyError, ValueError) as error:
        msg = f"{path.name}: the map's first node has no latitude and longitude"
        raise RoadError(msg) from error


def _id(lanelet: Any) -> str:  # noqa: ANN401 - an object of lanelet2, as below
    return f"{'-' if lanelet.inverted() else ''}{lanelet.id}"


def _lonlat(projector: Any, line: Any) -> list[list[float]]:  # noqa: ANN401
    """Return a line's points as GeoJSON has them, longitude and latitude [deg]; a point that is there twice once."""
    points = [(place.lon, place.lat) for place in (projector.reverse(point.basicPoint()) for point in line)]
    return [list(point) for before, point in zip([None, *points], points, strict=False) if point != before]


def _route(library: SimpleNamespace, lanelets: Any, road_ids: str | Sequence[str] | None, name: str) -> list[Any]:  # noqa: ANN401
    """Return the lanelets of the shortest way over those that are wanted, one after the other."""
    rules = library.traffic_rules.create(*_RULES)
    driven = {_id(way): way for one in lanelets.laneletLayer for way in (one, one.invert()) if rules.canPass(way)}
    if road_ids is None and len({lanelet.id for lanelet in driven.values()}) != 1:
        raise _unchosen(library, lanelets, driven, name)
    stops, graph = _stops(driven, road_ids, name), library.routing.RoutingGraph(lanelets, rules)
    routes = [(0.0, [way]) for way in stops[0]]
    for before, after in pairwise(stops):
        ways = [(length, route, graph.getRoute(route[-1], end, 0, False)) for length, route in routes for end in after]  # no change of lane
        routes = [(length + way.length2d(), [*route, *list(way.shortestPath())[1:]]) for length, route, way in ways if way is not None]
        if not routes:
            msg = f"{name}: no way leads from lanelet {_id(before[0])} to {_id(after[0])}"
            raise RoadError(msg, hint="lanes are not changed on the way; a minus sign drives a lanelet against its direction")
    return min(routes, key=lambda one: one[0])[1]


def _unchosen(library: SimpleNamespace, lanelets: Any, driven: dict[str, Any], name: str) -> RoadError:  # noqa: ANN401
    """Return what is said where no lanelet is chosen: how many there are, and some of the longest ways that do not cross themselves."""
    found: list[tuple[float, str]] = []
    for choice in _longest_first(library, lanelets, driven)[:_LISTED]:
        whole = library.core.LaneletSequence(_route(library, lanelets, choice, name))
        middle, *bounds = (shapely.LineString([(p.x, p.y) for p in line]) for line in (whole.centerline, whole.leftBound, whole.rightBound))
        if not middle.intersects(shapely.union_all(bounds)):
            found.append((middle.length, choice))  # shorter where the other direction of its last lanelet is nearer
    told = [f"{choice} ({length:.0f} m)" for length, choice in sorted(found, reverse=True)[:_WAYS]]
    count = len({lanelet.id for lanelet in driven.values()})
    msg = f"{name}: {count} lanelets that vehicles drive, and none is chosen; long ways are {', '.join(told)}"
    return RoadError(msg, hint=f"choose where to drive, such as with --road-ids {told[0].partition(' ')[0] if told else 'FROM,TO'}")


def _longest_first(library: SimpleNamespace, lanelets: Any, driven: dict[str, Any]) -> list[str]:  # noqa: ANN401
    """Return ways as users choose them, for each lanelet at which some end that of the furthest beginning, the longest first."""
    graph = library.routing.RoutingGraph(lanelets, library.traffic_rules.create(*_RULES))
    names, number = list(driven), {way: index for index, way in enumerate(driven)}
    length = np.array([library.geometry.length2d(lanelet) for lanelet in driven.values()])
    follows = [(number[way], number[_id(after)]) for way, lanelet in driven.items() for after in graph.following(lanelet)]
    begins, ends = np.array(follows, dtype=int).reshape(-1, 2).T
    links, entries = csr_array((length[ends], (begins, ends)), shape=(len(names), len(names))), np.setdiff1d(np.arange(len(names)), ends)
    longest: dict[str, tuple[float, str]] = {}
    for entry in (entries if len(entries) else np.arange(len(names)))[:_TRIED].tolist():
        way = dijkstra(links, indices=[entry])[0]
        end = int(np.argmax(np.where(np.isfinite(way), way, -1.0)))
        choice = names[entry] if end == entry else f"{names[entry]},{names[end]}"
        longest[names[end]] = max(longest.get(names[end], (0.0, "")), (length[entry] + way[end], choice))
    return [choice for _, choice in sorted(longest.values(), reverse=True)]


def _stops(lanelets: dict[str, Any], road_ids: str | Sequence[str] | None, name: str) -> list[list[Any]]:
    """Return those of the lanelets that are wanted, by what they are called; without a minus sign in either direction."""
    there = sorted({one.removeprefix("-") for one in lanelets}, key=int)
    wanted = there if road_ids is None else ids_of(road_ids)
    found = [[lanelets[way] for way in (one, f"-{one}") if way in lanelets] for one in wanted]
    unknown = next((one for one, ways in zip(wanted, found, strict=True) if not ways), None)
    if unknown is not None:
        one_way = unknown.startswith("-") and unknown[1:] in there
        what = (
            f"lanelet {unknown[1:]} is one-way"
            if one_way
            else f"vehicles drive no lanelet {unknown!r}; there are {some_of(there, _LISTED)}"
        )
        msg = f"{name}: {what}"
        raise RoadError(msg)
    return found
