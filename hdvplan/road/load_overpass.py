"""Read a road from what the Overpass API answers: ways and relations of OpenStreetMap as JSON."""

from __future__ import annotations

from typing import Any

from hdvplan.errors import RoadError
from hdvplan.road.assemble import road_of
from hdvplan.road.crs import LONLAT
from hdvplan.road.features import Choice, Feature, Json, as_object
from hdvplan.road.library import NOTICE
from hdvplan.road.raw import RawRoad

_NO_WAY = {"platform", "stop", "stop_entry_only", "stop_exit_only"}  # roles in a bus route that are not driven


def read_overpass(document: Json, name: str, *, choice: Choice) -> RawRoad:
    """Return the road in an answer of the Overpass API; ``name`` begins the messages, ``choice`` says which way.

    Raises:
        RoadError: the answer has no geometry, or what ``road_of`` refuses.

    """
    elements = [element for element in document["elements"] if isinstance(element, dict)] if isinstance(document["elements"], list) else []
    nodes = {element.get("id"): [element.get("lon"), element.get("lat")] for element in elements if _is_node(element)}
    features = []
    for element in elements:
        geometry = _geometry(element, nodes)
        if geometry is not None:
            tags = as_object(element.get("tags"))
            labels = tuple(
                str(source[key]) for source, key in ((tags, "name"), (element, "id"), (tags, "ref")) if source.get(key) is not None
            )
            features.append(Feature(geometry, {"attribution": NOTICE}, labels, system=LONLAT))
    if not features:
        msg = f"{name}: no way with a geometry among {len(elements)} elements of OpenStreetMap"
        raise RoadError(msg, hint="ask Overpass for it: end the query with `out geom;`")
    return road_of(features, name, choice)


def _geometry(element: Json, nodes: dict[Any, list[Any]]) -> Json | None:
    """Return a way's or a relation's line as GeoJSON has it, None without one."""
    if element.get("type") == "way":
        points = _points(element, nodes)
        return {"type": "LineString", "coordinates": points} if points else None
    members = element.get("members")
    if element.get("type") == "relation" and isinstance(members, list):
        ways = [member for member in members if isinstance(member, dict) and member.get("type") == "way"]
        parts = [_points(way, nodes) for way in ways if str(way.get("role")) not in _NO_WAY]
        return {"type": "MultiLineString", "coordinates": [part for part in parts if part]} if any(parts) else None
    return None


def _points(way: Json, nodes: dict[Any, list[Any]]) -> list[list[Any]]:
    """Return the positions along a way: its own, or those of its nodes where the answer holds them."""
    given = way.get("geometry")
    if isinstance(given, list):
        return [[as_object(place).get("lon"), as_object(place).get("lat")] for place in given]
    numbers = way.get("nodes")
    if not isinstance(numbers, list) or not all(isinstance(number, int) and number in nodes for number in numbers):
        return []
    return [nodes[number] for number in numbers]


def _is_node(element: Json) -> bool:
    return element.get("type") == "node" and isinstance(element.get("id"), int)
