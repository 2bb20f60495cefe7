"""Read a road from JSON: GeoJSON (RFC 7946), and what the Overpass API answers, ways and relations of OpenStreetMap."""

from __future__ import annotations

import json
from typing import Any

from hdvplan.errors import RoadError
from hdvplan.road.assemble import road_of
from hdvplan.road.crs import LONLAT, short_name
from hdvplan.road.features import Feature, Json, as_object, labels_of
from hdvplan.road.line import RawRoad
from hdvplan.road.options import USUAL, RoadOptions
from hdvplan.road.scenarios import NOTICE

_NO_WAY = {"platform", "stop", "stop_entry_only", "stop_exit_only"}  # roles in a bus route that are not driven


def read_geojson(document: Json, name: str, options: RoadOptions = USUAL) -> RawRoad:
    """Return the road in a GeoJSON document; ``name`` begins the messages, ``options`` say which line.

    Their ``crs`` overrides the file's own ``crs`` member; without either, coordinates are longitude and latitude.

    Raises:
        RoadError: no line, several lines and none chosen, parts that do not join, or impossible coordinates.

    """
    if not isinstance(document.get("type"), str):
        msg = f"{name} is not GeoJSON: it has no 'type'"
        raise RoadError(msg)
    system = options.crs or _member_crs(document, name)
    features = [
        Feature(item.get("geometry"), as_object(item.get("properties")), labels_of(item), system=system) for item in _items(document, name)
    ]
    return road_of(features, name, options)


def json_object(text: str, name: str) -> Json:
    """Return the object that a JSON text holds.

    Raises:
        RoadError: it is no JSON, or no object.

    """
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        msg = f"{name} is not valid JSON: {error}"
        raise RoadError(msg) from error
    if not isinstance(document, dict):
        msg = f"{name} is not GeoJSON: it has no 'type'"
        raise RoadError(msg)
    return document


def _member_crs(document: Json, name: str) -> str:
    """Return the system that an old GeoJSON file names, else longitude and latitude."""
    member = document.get("crs")
    if member is None:
        return LONLAT
    system = as_object(member.get("properties")).get("name") if isinstance(member, dict) else None
    if not isinstance(system, str):
        msg = f"{name}: the 'crs' member names no coordinate reference system"
        raise RoadError(msg, hint="name it, such as --crs EPSG:3006")
    return LONLAT if system.endswith("CRS84") else short_name(system)


def _items(document: Json, name: str) -> list[Json]:
    """Return the document's features; a bare geometry becomes one."""
    kind = document["type"]
    if kind == "FeatureCollection":
        features = document.get("features")
        if not isinstance(features, list) or not all(isinstance(item, dict) for item in features):
            msg = f"{name}: 'features' must be a list of features"
            raise RoadError(msg)
        return features
    return [document] if kind == "Feature" else [{"geometry": document}]


def read_overpass(document: Json, name: str, options: RoadOptions = USUAL) -> RawRoad:
    """Return the road in an answer of the Overpass API; ``name`` begins the messages, ``options`` say which way.

    Raises:
        RoadError: the answer has no geometry, or what ``road_of`` refuses.

    """
    elements = [element for element in document["elements"] if isinstance(element, dict)] if isinstance(document["elements"], list) else []
    named = [element for element in elements if element.get("type") == "node" and isinstance(element.get("id"), int)]
    nodes = {element["id"]: [element.get("lon"), element.get("lat")] for element in named}
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
    return road_of(features, name, options)


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
