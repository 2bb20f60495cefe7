"""From the features of a vector file to a road: one line that is chosen, edges beside it, and regions around it."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field, replace
from enum import StrEnum
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from hdvplan.errors import OptionError, RoadError
from hdvplan.jit import FloatArray
from hdvplan.road.columns import folded
from hdvplan.road.crs import LONLAT, Plane, check_lonlat, is_geographic, looks_like_degrees, to_plane
from hdvplan.road.raw import RawRoad
from hdvplan.road.regions import Kind, Region

Json = dict[str, Any]
_SNAP_M = 0.01
_IDS = ("name", "id", "@id", "osm_id", "ref")
_LISTED = 20  # lines that a question names
_LINES = {"LineString", "MultiLineString"}
_POLYGONS = {"Polygon", "MultiPolygon"}


class Role(StrEnum):
    """What a feature beside the line is."""

    OBSTACLE = "obstacle"
    SWEEPABLE = "sweepable"
    EDGE = "edge"


_LAYERS = {  # layers of these names have a role without being told
    **dict.fromkeys(("obstacle", "obstacles", "hinder", "hindernis", "hindernisse"), Role.OBSTACLE),
    **dict.fromkeys(("sweepable", "sweepables", "overrunnable", "uberfahrbar", "overkorbar"), Role.SWEEPABLE),
}
_EDGES = {  # values of a property "edge", names, and layers
    "left",
    "right",
    "left_edge",
    "right_edge",
    "edge_left",
    "edge_right",
    "edge_l",
    "edge_r",
    "left_kerb",
    "right_kerb",
    "kerb",
    "kerbs",
    "kerb_left",
    "kerb_right",
    "left_curb",
    "right_curb",
    "curb_left",
    "curb_right",
    "links",
    "rechts",
    "rand_links",
    "rand_rechts",
    "linker_rand",
    "rechter_rand",
    "fahrbahnrand",
    "vanster",
    "hoger",
    "vansterkant",
    "hogerkant",
    "vanster_kant",
    "hoger_kant",
    "kant_vanster",
    "kant_hoger",
    "vagkant",
    "gauche",
    "droite",
    "bord_gauche",
    "bord_droit",
}


@dataclass(frozen=True)
class Feature:
    """A geometry as GeoJSON has it, what is known about it, the layer it lies in, and the system of its coordinates.

    Without a ``system`` coordinates are metres in a plane of their own. ``drawn`` tells that a drawing program made it, which
    knows closed lines and no polygons.
    """

    geometry: object
    properties: Json
    labels: tuple[str, ...] = ()
    layer: str = ""
    system: str | None = None
    drawn: bool = False


@dataclass(frozen=True)
class Choice:
    """Which feature is the road, in which layer, and what role other features or whole layers have, by their name."""

    feature: str | None = None
    layer: str | None = None
    roles: dict[str, Role] = field(default_factory=dict)


def roles_of(given: tuple[str, ...]) -> dict[str, Role]:
    """Return the roles in texts such as ``hoarding=obstacle``: the name of a layer or a feature, and what it is.

    Raises:
        OptionError: a text is not of this form, or names no role.

    """
    roles: dict[str, Role] = {}
    for text in given:
        name, _, role = text.rpartition("=")
        if not name or role not in list(Role):
            msg = f"--role {text!r} is not NAME=ROLE; a role is {', '.join(list(Role)[:-1])} or {list(Role)[-1]}"
            raise OptionError(msg, hint="NAME is a layer or a feature of the road file, such as --role hoarding=obstacle")
        roles[name] = Role(role)
    return roles


def labels_of(item: Json) -> tuple[str, ...]:
    """Return what a GeoJSON feature may be called by: names and ids of its properties, then its own."""
    sources = (as_object(item.get("properties")), item)
    return tuple(str(source[key]) for source in sources for key in _IDS if source.get(key) is not None)


@dataclass(frozen=True)
class _Line:
    """A line feature's parts: their raw coordinates. Those of a drawing run in any direction: it knows none."""

    feature: Feature
    parts: list[Any]
    directed: bool = True


def road_of(features: list[Feature], name: str, choice: Choice) -> RawRoad:
    """Return the road among ``features``; ``name`` begins the messages.

    Raises:
        RoadError: no line, several lines and none chosen, parts that do not join, impossible coordinates, or several
            coordinate reference systems.

    """
    line = _chosen(_lines(features, name), choice, name)
    parts = [_coordinates(part, name) for part in line.parts]
    system = line.feature.system
    everything = np.concatenate(parts)
    notes: tuple[str, ...] = ()
    if system is None and looks_like_degrees(everything):
        notes = (f"{name}: coordinates are read as longitude and latitude, for metres they are too close together",)
        system = LONLAT
        features = [replace(feature, system=feature.system or LONLAT) for feature in features]
    if system is not None and is_geographic(system):
        check_lonlat(everything, name)
    plane = None if system is None else to_plane(everything, system)
    placed = parts if plane is None else np.split(plane.points, np.cumsum([len(part) for part in parts])[:-1])
    points = _joined(placed, name, directed=line.directed)
    beside = _Beside(name, system, plane, choice, line.feature.geometry)
    regions: list[Region] = []
    for feature in features:
        regions += beside.regions(feature, len(regions) + 1)
    return RawRoad(
        points,
        _reaches(line.feature.properties, len(points), name),
        to_lonlat=None if plane is None else plane.to_lonlat,
        notice=_notice(line.feature.properties),
        regions=tuple(regions),
        edges=tuple(edge for feature in features for edge in beside.edges(feature)),
        notes=notes,
    )


@dataclass(frozen=True)
class _Beside:
    """Features beside the chosen line, in its plane."""

    name: str
    system: str | None
    plane: Plane | None
    choice: Choice
    line: object  # the geometry of the chosen line

    def regions(self, feature: Feature, number: int) -> list[Region]:
        """Return the regions of a feature, none if it is no region; ``number`` is the first one's."""
        given, role = feature.properties.get("region"), _role(feature, self.choice)
        if given is None and (role not in {Role.OBSTACLE, Role.SWEEPABLE} or feature.geometry is self.line):
            return []
        label = feature.labels[0] if feature.labels else feature.layer
        where = f"{self.name}: region {label!r}" if label else f"{self.name}: region {number}"
        if given is not None and given not in list(Kind):
            msg = f"{where} is {given!r}; a region is obstacle or sweepable"
            raise RoadError(msg)
        kind = Kind(given or str(role))
        found: list[Region] = []
        for geometry in _flat(feature.geometry) or [{"type": "feature without geometry"}]:
            rings = _rings(geometry, closed_lines=feature.drawn)
            if rings is None and given is None:
                continue  # a layer of obstacles may hold their texts and points too
            if rings is None:
                msg = f"{where} is a {geometry['type']}, not a Polygon or MultiPolygon"
                raise RoadError(msg, hint="draw a fence or a wall as a narrow polygon")
            self._check_system(feature, where)
            found += [Region(kind, polygon, label) for ring in rings for polygon in self._polygons(ring, where)]
        return found

    def edges(self, feature: Feature) -> list[FloatArray]:
        """Return the lines of a feature in the plane if it is an edge, none else."""
        if feature.geometry is self.line or _role(feature, self.choice) is not Role.EDGE:
            return []
        where = f"{self.name}: edge {(feature.labels or (feature.layer,))[0]!r}"
        lines = [part for geometry in _flat(feature.geometry) if geometry["type"] in _LINES for part in _parts(geometry, where)]
        if lines:
            self._check_system(feature, where)
        return [self._placed(_coordinates(part, where), where) for part in lines]

    def _check_system(self, feature: Feature, where: str) -> None:
        if feature.system != self.system:
            theirs, ours = (system or "no coordinate reference system" for system in (feature.system, self.system))
            msg = f"{where} has {theirs}, the road has {ours}"
            raise RoadError(msg, hint="bring them into one system first: ogr2ogr -t_srs EPSG:N one.gpkg FILE")

    def _placed(self, points: FloatArray, where: str) -> FloatArray:
        placed = points if self.plane is None else self.plane.into(points)
        if not np.all(np.isfinite(placed)):
            msg = f"{where} lies outside the road's coordinate reference system"
            raise RoadError(msg)
        return placed

    def _polygons(self, rings: object, where: str) -> list[shapely.Polygon]:
        """Return a polygon of GeoJSON in the plane: several where its rings touch or cross themselves."""
        if not isinstance(rings, list | tuple) or not rings:
            msg = f"{where} has no coordinates"
            raise RoadError(msg)
        placed = [self._placed(_coordinates(ring, where, fewest=3), where) for ring in rings]
        whole = shapely.make_valid(shapely.Polygon(placed[0], placed[1:]))
        parts = [part for part in shapely.get_parts(shapely.get_parts(whole)) if isinstance(part, shapely.Polygon)]
        if not parts:
            msg = f"{where} has no area"
            raise RoadError(msg)
        return parts


def as_object(member: object) -> Json:
    """Return a member of JSON that should be an object; an empty one where it is something else."""
    return member if isinstance(member, dict) else {}


def _role(feature: Feature, choice: Choice) -> Role | None:
    """Return a feature's role: as the user says, as its property says, or as its layer or name says."""
    names = (*feature.labels, feature.layer)
    told = next((choice.roles[name] for name in names if name in choice.roles), None)
    if told is not None or feature.properties.get("region") is not None:
        return told
    said = (str(feature.properties.get("edge", "")), *feature.labels[:1], feature.layer)
    if any(folded(name) in _EDGES for name in said):
        return Role.EDGE
    return _LAYERS.get(folded(feature.layer))


def _lines(features: list[Feature], name: str) -> list[_Line]:
    """Return every line feature."""
    return [
        _Line(feature, _parts(geometry, name)) for feature in features for geometry in _flat(feature.geometry) if geometry["type"] in _LINES
    ]


def _parts(geometry: Json, name: str) -> list[Any]:
    coordinates = geometry.get("coordinates")
    parts = [coordinates] if geometry["type"] == "LineString" else coordinates
    if not isinstance(parts, list | tuple) or not parts:
        msg = f"{name}: a {geometry['type']} has no coordinates"
        raise RoadError(msg)
    return list(parts)


def _rings(geometry: Json, *, closed_lines: bool) -> list[Any] | None:
    """Return the rings of each polygon of a geometry, None if it is none."""
    given = geometry.get("coordinates")
    if geometry["type"] == "MultiPolygon" and isinstance(given, list | tuple) and given:
        return list(given)
    if geometry["type"] in _POLYGONS:
        return [given]
    if closed_lines and geometry["type"] == "LineString" and given and len(given) > 3 and given[0] == given[-1]:  # noqa: PLR2004
        return [[given]]
    return None


def _is_finite(value: object) -> bool:
    """Tell a number from everything else that JSON can say, and from integers that no float can hold."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _flat(geometry: object) -> list[Json]:
    if not isinstance(geometry, dict) or not isinstance(geometry.get("type"), str):
        return []
    if geometry["type"] == "GeometryCollection":
        members = geometry.get("geometries")
        return [inner for member in members for inner in _flat(member)] if isinstance(members, list | tuple) else []
    return [geometry]


def _chosen(lines: list[_Line], choice: Choice, name: str) -> _Line:
    if not lines:
        msg = f"{name}: no LineString or MultiLineString in it"
        raise RoadError(msg, hint="a road is a line feature; simplified map edges may have lost theirs")
    there = lines if choice.layer is None else [line for line in lines if line.feature.layer == choice.layer]
    if not there:
        layers = sorted({line.feature.layer for line in lines if line.feature.layer})
        msg = f"{name}: no line in a layer called {choice.layer!r}; there are {', '.join(map(repr, layers)) or 'no layers'}"
        raise RoadError(msg)
    if choice.feature is None:
        without = [line for line in there if _role(line.feature, choice) is None]
        matching = without if choice.layer is None and without else there
    else:
        matching = [line for line in there if choice.feature in line.feature.labels]
    if len(matching) == 1:
        return matching[0]
    if choice.layer is not None and choice.feature is None and all(line.feature.drawn for line in matching):
        return _Line(matching[0].feature, [part for line in matching for part in line.parts], directed=False)
    listed = _listed(matching or there)
    if choice.feature is None:
        msg = f"{name}: {len(matching)} lines, and none is chosen: {listed}"
        several = len({line.feature.layer for line in matching}) > 1
        raise RoadError(msg, hint="choose one with --name or --id" + (" or --layer" if several else ""))
    if matching:
        msg = f"{name}: {len(matching)} lines are called {choice.feature!r}"
        raise RoadError(msg, hint="choose by a unique --id")
    msg = f"{name}: no line is called {choice.feature!r}; there are {listed}"
    raise RoadError(msg)


def _listed(lines: list[_Line]) -> str:
    """Return the names of lines, with their layers where there are several."""
    several = len({line.feature.layer for line in lines}) > 1
    names = [
        (repr(line.feature.labels[0]) if line.feature.labels else "(unnamed)") + (f" in {line.feature.layer!r}" if several else "")
        for line in lines[:_LISTED]
    ]
    return ", ".join(names) + (", ..." if len(lines) > _LISTED else "")


def _coordinates(part: object, name: str, *, fewest: int = 2) -> FloatArray:
    """Return the first two coordinates of a line's part or a ring, shape (n, 2); heights are dropped."""
    if not isinstance(part, list | tuple) or len(part) < fewest:
        what = "a line needs at least two points" if fewest == 2 else "a ring needs at least three points"  # noqa: PLR2004
        msg = f"{name}: {what}, this one has {len(part) if isinstance(part, list | tuple) else 0}"
        raise RoadError(msg)
    for number, position in enumerate(part, start=1):
        pair = position[:2] if isinstance(position, list | tuple) else ()
        if len(pair) < 2 or not all(_is_finite(value) for value in pair):  # noqa: PLR2004
            msg = f"{name}: point {number} is not a pair of finite numbers: {json.dumps(position)[:60]}"
            raise RoadError(msg)
    return np.array([position[:2] for position in part], dtype=float)


def _joined(parts: list[FloatArray], name: str, *, directed: bool) -> FloatArray:
    """Return one line from parts that join end to start, in their own direction, or else the first one's; whatever their order."""
    in_order = all(np.hypot(*(after[0] - before[-1])) <= _SNAP_M for before, after in pairwise(parts))
    if in_order:
        return np.concatenate(parts)
    ends = np.array([point for part in parts for point in (part[0], part[-1])])
    for i, part in enumerate(parts):
        for row in (0, -1):
            near = int(np.argmax(np.hypot(*(ends - part[row]).T) <= _SNAP_M))
            parts[i][row] = ends[near]
    merged = shapely.line_merge(shapely.MultiLineString(parts), directed=directed)
    if isinstance(merged, shapely.LineString):
        start, end = (merged.project(shapely.Point(parts[0][row])) for row in (0, -1))
        return np.asarray(merged.coords if directed or start < end else merged.reverse().coords, dtype=float)
    pieces = [np.asarray(piece.coords, dtype=float) for piece in merged.geoms]
    gaps = [min(float(np.hypot(*(other[0] - piece[-1]))) for j, other in enumerate(pieces) if j != i) for i, piece in enumerate(pieces)]
    listed = ", ".join(f"{gap:.2f} m" for gap in sorted(gaps)[: len(pieces) - 1][:10])
    msg = f"{name}: the line's {len(parts)} parts do not join to one; from an end to the next start there are gaps of {listed}"
    raise RoadError(msg, hint="join the parts, or turn the ones that run backwards" if directed else "join them, or choose one with --id")


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
