"""Read a road from GeoJSON (RFC 7946): one line, chosen by name when there are several, and the regions beside it."""

from __future__ import annotations

import json

from hdvplan.errors import RoadError
from hdvplan.road.assemble import road_of
from hdvplan.road.crs import LONLAT
from hdvplan.road.features import Choice, Feature, Json, as_object, labels_of
from hdvplan.road.raw import RawRoad

_ANY = Choice()


def read_geojson(document: Json, name: str, *, crs: str | None = None, choice: Choice = _ANY) -> RawRoad:
    """Return the road in a GeoJSON document; ``name`` begins the messages, ``choice`` says which line.

    ``crs`` overrides the file's own ``crs`` member; without either, coordinates are longitude and latitude.

    Raises:
        RoadError: no line, several lines and none chosen, parts that do not join, or impossible coordinates.

    """
    if not isinstance(document.get("type"), str):
        msg = f"{name} is not GeoJSON: it has no 'type'"
        raise RoadError(msg)
    system = crs or _member_crs(document, name)
    features = [
        Feature(item.get("geometry"), as_object(item.get("properties")), labels_of(item), system=system) for item in _items(document, name)
    ]
    return road_of(features, name, choice)


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
    return LONLAT if system.endswith("CRS84") else system


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
