"""Read a road from GeoJSON (RFC 7946): one line, chosen by name when there are several, and the regions beside it."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from hdvplan.errors import RoadError
from hdvplan.jit import FloatArray
from hdvplan.road.crs import LONLAT, Plane, check_lonlat, is_geographic, to_plane
from hdvplan.road.raw import RawRoad
from hdvplan.road.regions import Kind, Region

Json = dict[str, Any]
_SNAP_M = 0.01
_IDS = ("name", "id", "@id", "osm_id", "ref")


@dataclass(frozen=True)
class _Line:
    """A line feature: its parts' raw coordinates, its properties, and what it may be called."""

    parts: list[Any]
    properties: Json
    labels: tuple[str, ...]


def read_geojson(text: str, name: str, *, crs: str | None = None, feature: str | None = None) -> RawRoad:
    """Return the road in a GeoJSON text; ``name`` begins the messages, ``feature`` is the name or id of the line.

    ``crs`` overrides the file's own ``crs`` member; without either, coordinates are longitude and latitude.

    Raises:
        RoadError: no line, several lines and none chosen, parts that do not join, or impossible coordinates.

    """
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        msg = f"{name} is not valid JSON: {error}"
        raise RoadError(msg) from error
    if not isinstance(document, dict) or not isinstance(document.get("type"), str):
        msg = f"{name} is not GeoJSON: it has no 'type'"
        raise RoadError(msg)
    features = _features(document, name)
    line = _chosen(_lines(features, name), feature, name)
    parts = [_coordinates(part, name) for part in line.parts]
    system = crs or _member_crs(document, name)
    everything = np.concatenate(parts)
    if is_geographic(system):
        check_lonlat(everything, name)
    plane = to_plane(everything, system)
    points = _joined(_split(plane, parts), name)
    reaches, notice = _reaches(line.properties, len(points), name), _notice(line.properties)
    return RawRoad(points, reaches, to_lonlat=plane.to_lonlat, notice=notice, regions=_regions(features, plane, name))


def _member_crs(document: Json, name: str) -> str:
    """Return the system that an old GeoJSON file names, else longitude and latitude."""
    member = document.get("crs")
    if member is None:
        return LONLAT
    system = _object(member.get("properties")).get("name") if isinstance(member, dict) else None
    if not isinstance(system, str):
        msg = f"{name}: the 'crs' member names no coordinate reference system"
        raise RoadError(msg, hint="name it, such as --crs EPSG:3006")
    return LONLAT if system.endswith("CRS84") else system


def _features(document: Json, name: str) -> list[Json]:
    """Return the document's features; a bare geometry becomes one."""
    kind = document["type"]
    if kind == "FeatureCollection":
        features = document.get("features")
        if not isinstance(features, list) or not all(isinstance(item, dict) for item in features):
            msg = f"{name}: 'features' must be a list of features"
            raise RoadError(msg)
    else:
        features = [document] if kind == "Feature" else [{"geometry": document}]
    return features


def _lines(features: list[Json], name: str) -> list[_Line]:
    """Return every line feature."""
    found: list[_Line] = []
    for item in features:
        properties = _object(item.get("properties"))
        labels = tuple(str(source[key]) for source in (properties, item) for key in _IDS if source.get(key) is not None)
        for geometry in _flat(item.get("geometry")):
            if geometry["type"] in {"LineString", "MultiLineString"}:
                coordinates = geometry.get("coordinates")
                parts = [coordinates] if geometry["type"] == "LineString" else coordinates
                if not isinstance(parts, list) or not parts:
                    msg = f"{name}: a {geometry['type']} has no coordinates"
                    raise RoadError(msg)
                found.append(_Line(parts, properties, labels))
    return found


def _regions(features: list[Json], plane: Plane, name: str) -> tuple[Region, ...]:
    """Return the polygons that have a region, in the road's plane."""
    found: list[Region] = []
    for item in features:
        properties = _object(item.get("properties"))
        if properties.get("region") is None:
            continue
        label = next((str(source[key]) for source in (properties, item) for key in _IDS if source.get(key) is not None), "")
        where = f"{name}: region {label!r}" if label else f"{name}: region {len(found) + 1}"
        if properties["region"] not in list(Kind):
            msg = f"{where} is {properties['region']!r}; a region is obstacle or sweepable"
            raise RoadError(msg)
        for geometry in _flat(item.get("geometry")) or [{"type": "feature without geometry"}]:
            if geometry["type"] not in {"Polygon", "MultiPolygon"}:
                msg = f"{where} is a {geometry['type']}, not a Polygon or MultiPolygon"
                raise RoadError(msg, hint="draw a fence or a wall as a narrow polygon")
            given = geometry.get("coordinates")
            for rings in given if geometry["type"] == "MultiPolygon" and isinstance(given, list) and given else [given]:
                found += [Region(Kind(properties["region"]), polygon, label) for polygon in _polygons(rings, plane, where)]
    return tuple(found)


def _polygons(rings: object, plane: Plane, where: str) -> list[shapely.Polygon]:
    """Return a polygon of GeoJSON in the road's plane: several where its rings touch or cross themselves."""
    if not isinstance(rings, list) or not rings:
        msg = f"{where} has no coordinates"
        raise RoadError(msg)
    placed = [plane.into(_coordinates(ring, where, fewest=3)) for ring in rings]
    if not all(np.all(np.isfinite(ring)) for ring in placed):
        msg = f"{where} lies outside the road's coordinate reference system"
        raise RoadError(msg)
    whole = shapely.make_valid(shapely.Polygon(placed[0], placed[1:]))
    parts = [part for part in shapely.get_parts(shapely.get_parts(whole)) if isinstance(part, shapely.Polygon)]
    if not parts:
        msg = f"{where} has no area"
        raise RoadError(msg)
    return parts


def _object(member: object) -> Json:
    """Return a member that should be an object; an empty one where it is something else."""
    return member if isinstance(member, dict) else {}


def _is_finite(value: object) -> bool:
    """Tell a number from everything else that JSON can say, and from integers that no float can hold."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _flat(geometry: object) -> list[Json]:
    if not isinstance(geometry, dict) or not isinstance(geometry.get("type"), str):
        return []
    if geometry["type"] == "GeometryCollection":
        members = geometry.get("geometries")
        return [inner for member in members for inner in _flat(member)] if isinstance(members, list) else []
    return [geometry]


def _chosen(lines: list[_Line], feature: str | None, name: str) -> _Line:
    if not lines:
        msg = f"{name}: no LineString or MultiLineString in it"
        raise RoadError(msg, hint="a road is a line feature; simplified map edges may have lost theirs")
    matching = lines if feature is None else [line for line in lines if feature in line.labels]
    if len(matching) == 1:
        return matching[0]
    names = ", ".join(repr(line.labels[0]) if line.labels else "(unnamed)" for line in (matching or lines)[:20])
    if feature is None:
        msg = f"{name}: {len(lines)} lines, and none is chosen: {names}"
        raise RoadError(msg, hint="choose one with --name or --id")
    if matching:
        msg = f"{name}: {len(matching)} lines are called {feature!r}"
        raise RoadError(msg, hint="choose by a unique --id")
    msg = f"{name}: no line is called {feature!r}; there are {names}"
    raise RoadError(msg)


def _coordinates(part: object, name: str, *, fewest: int = 2) -> FloatArray:
    """Return the first two coordinates of a line's part or a ring, shape (n, 2); heights are dropped."""
    if not isinstance(part, list) or len(part) < fewest:
        what = "a line needs at least two points" if fewest == 2 else "a ring needs at least three points"  # noqa: PLR2004
        msg = f"{name}: {what}, this one has {len(part) if isinstance(part, list) else 0}"
        raise RoadError(msg)
    for number, position in enumerate(part, start=1):
        if not isinstance(position, list) or len(position) < 2 or not all(_is_finite(value) for value in position[:2]):  # noqa: PLR2004
            msg = f"{name}: point {number} is not a pair of finite numbers: {json.dumps(position)[:60]}"
            raise RoadError(msg)
    return np.array([position[:2] for position in part], dtype=float)


def _split(plane: Plane, parts: list[FloatArray]) -> list[FloatArray]:
    return np.split(plane.points, np.cumsum([len(part) for part in parts])[:-1])


def _joined(parts: list[FloatArray], name: str) -> FloatArray:
    """Return one line from parts that join end to start, in their own direction, whatever their order."""
    in_order = all(np.hypot(*(after[0] - before[-1])) <= _SNAP_M for before, after in pairwise(parts))
    if in_order:
        return np.concatenate(parts)
    ends = np.array([point for part in parts for point in (part[0], part[-1])])
    for i, part in enumerate(parts):
        for row in (0, -1):
            near = int(np.argmax(np.hypot(*(ends - part[row]).T) <= _SNAP_M))
            parts[i][row] = ends[near]
    merged = shapely.line_merge(shapely.MultiLineString(parts), directed=True)
    if isinstance(merged, shapely.LineString):
        return np.asarray(merged.coords, dtype=float)
    pieces = [np.asarray(piece.coords, dtype=float) for piece in merged.geoms]
    gaps = [min(float(np.hypot(*(other[0] - piece[-1]))) for j, other in enumerate(pieces) if j != i) for i, piece in enumerate(pieces)]
    listed = ", ".join(f"{gap:.2f} m" for gap in sorted(gaps)[: len(pieces) - 1][:10])
    msg = f"{name}: the line's {len(parts)} parts do not join to one; from an end to the next start there are gaps of {listed}"
    raise RoadError(msg, hint="join the parts, or turn the ones that run backwards")


def _reaches(properties: Json, count: int, name: str) -> FloatArray | None:
    given = [key for key in ("left_m", "right_m", "width_m") if properties.get(key) is not None]
    if not given:
        return None
    if set(given) not in ({"left_m", "right_m"}, {"width_m"}):
        msg = f"{name}: properties {', '.join(given)} do not give the width: left_m with right_m, or width_m alone"
        raise RoadError(msg)
    for key in given:
        value = properties[key]
        if not (_is_finite(value) and value > 0.0):
            msg = f"{name}: property {key} must be a positive number of metres, not {value!r}"
            raise RoadError(msg)
    left, right = (0.5 * properties["width_m"],) * 2 if given == ["width_m"] else (properties["left_m"], properties["right_m"])
    return np.tile(np.array([[left], [right], [left], [right]], dtype=float), count)


def _notice(properties: Json) -> str | None:
    """Return the short attribution: its first sentence and the licence."""
    attribution = str(properties.get("attribution") or "").split(". ")[0].rstrip(".")
    licence = str(properties.get("licence") or properties.get("license") or "").replace("-", " ")
    return ", ".join(part for part in (attribution, licence) if part) or None
