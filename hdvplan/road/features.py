"""The features of vector files, whatever reads them: geometries as GeoJSON has them, names, and what they are beside a road."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError
from hdvplan.road.checks import refuse_far
from hdvplan.road.columns import folded
from hdvplan.road.crs import Plane
from hdvplan.road.options import RoadOptions, Role
from hdvplan.road.regions import Kind, Region, Side
from hdvplan.texts import printable

Json = dict[str, Any]
_IDS = ("name", "id", "@id", "osm_id", "ref")
LINES = {"LineString", "MultiLineString"}
POINTS = {"Point", "MultiPoint"}
_POLYGONS = {"Polygon", "MultiPolygon"}
_LONGEST_LABEL = 250  # letters of a name that is told and drawn
_MOST_CROSSING = 2000  # points of a polygon that crosses itself: it does so as often as the square of their number


AREAS = {Role.OBSTACLE, Role.SWEEPABLE}
_SPELLINGS = {  # of layers with a role without --role; those of edges are also values of a property "edge", and names
    Role.OBSTACLE: "obstacle obstacles hinder hindernis hindernisse building buildings gebaude byggnad byggnader batiment batiments",
    Role.SWEEPABLE: "sweepable sweepables overrunnable uberfahrbar overkorbar",
    Role.EDGE: "left right left_edge right_edge edge_left edge_right edge_l edge_r left_kerb right_kerb kerb kerbs kerb_left kerb_right"
    " left_curb right_curb curb_left curb_right links rechts rand_links rand_rechts linker_rand rechter_rand fahrbahnrand vanster hoger"
    " vansterkant hogerkant vanster_kant hoger_kant kant_vanster kant_hoger vagkant gauche droite bord_gauche bord_droit",
}
_ROLES = {name: role for role, names in _SPELLINGS.items() for name in names.split()}


@dataclass(frozen=True)
class Feature:
    """A geometry as GeoJSON has it, what is known about it, the layer it lies in, and the system of its coordinates.

    Without a ``system`` coordinates are lengths in a plane of their own. ``drawn`` says that a drawing program made it, which
    knows closed lines and no polygons. ``times`` (n,) [s] are those at which the points of a line were recorded.
    """

    geometry: object
    properties: Json
    labels: tuple[str, ...] = ()
    layer: str = ""
    system: str | None = None
    drawn: bool = False
    times: FloatArray | None = None


def labels_of(item: Json) -> tuple[str, ...]:
    """Return what a GeoJSON feature may be called by: names and ids of its properties, then its own."""
    sources = (as_object(item.get("properties")), item)
    return tuple(str(source[key]) for source in sources for key in _IDS if source.get(key) is not None)


def as_object(member: object) -> Json:
    """Return a member of JSON that should be an object; an empty one where it is something else."""
    return member if isinstance(member, dict) else {}


def role_of(feature: Feature, options: RoadOptions) -> Role | None:
    """Return a feature's role: as the user says, as its property says, or as its layer or name says."""
    names = (*feature.labels, feature.layer)
    given = next((options.named_roles[name] for name in names if name in options.named_roles), None)
    if given is not None or feature.properties.get("region") is not None:
        return given
    edges = (str(feature.properties.get("edge", "")), *feature.labels[:1])
    return Role.EDGE if any(_ROLES.get(folded(name)) is Role.EDGE for name in edges) else _ROLES.get(folded(feature.layer))


def parts_of(geometry: Json, name: str) -> list[Any]:
    """Return the parts of a line geometry: their raw coordinates.

    Raises:
        RoadError: it has none.

    """
    coordinates = geometry.get("coordinates")
    parts = [coordinates] if geometry["type"] == "LineString" else coordinates
    if not isinstance(parts, list | tuple) or not parts:
        msg = f"{name}: a {geometry['type']} has no coordinates"
        raise RoadError(msg)
    return list(parts)


def is_finite(value: object) -> bool:
    """Tell a number from everything else that JSON can say, and from integers that no float can hold."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def flat(geometry: object) -> list[Json]:
    """Return the geometries of a GeoJSON geometry, those of a collection one by one; none where it is no geometry."""
    if not isinstance(geometry, dict) or not isinstance(geometry.get("type"), str):
        return []
    if geometry["type"] == "GeometryCollection":
        members = geometry.get("geometries")
        return [inner for member in members for inner in flat(member)] if isinstance(members, list | tuple) else []
    return [geometry]


def coordinates_of(part: object, name: str, *, fewest: int = 2) -> FloatArray:
    """Return the first two coordinates of a line's part or a ring, shape (n, 2); heights are dropped."""
    if not isinstance(part, list | tuple) or len(part) < fewest:
        what = "a line needs at least two points" if fewest == 2 else "a ring needs at least three points"  # noqa: PLR2004
        msg = f"{name}: {what}, this one has {len(part) if isinstance(part, list | tuple) else 0}"
        raise RoadError(msg)
    for number, position in enumerate(part, start=1):
        pair = position[:2] if isinstance(position, list | tuple) else ()
        if len(pair) < 2 or not all(is_finite(value) for value in pair):  # noqa: PLR2004
            msg = f"{name}: point {number} is not a pair of finite numbers: {json.dumps(position)[:60]}"
            raise RoadError(msg)
    return np.array([position[:2] for position in part], dtype=float)


@dataclass(frozen=True)
class Beside:
    """Features beside the chosen line, in its plane."""

    name: str
    system: str | None
    plane: Plane | None
    options: RoadOptions
    lines: tuple[object, ...]  # the geometries of the line, or of the legs
    metres: float  # a unit of coordinates without a system

    def regions(self, feature: Feature, number: int) -> list[Region]:
        """Return the regions of a feature, none if it is no region; ``number`` is the first one's."""
        given, role = feature.properties.get("region"), role_of(feature, self.options)
        label = label_of(feature)
        if given is None and (role not in AREAS or self._is_line(feature)):
            return []
        where = f"{self.name}: region {label!r}" if label else f"{self.name}: region {number}"
        if given is not None and given not in list(Kind):
            msg = f"{where} is {given!r}; a region is obstacle or sweepable"
            raise RoadError(msg)
        kind = Kind(given or str(role))
        side = _side(feature, where)
        found: list[Region] = []
        for geometry in flat(feature.geometry) or [{"type": "feature without geometry"}]:
            rings = _rings(geometry, closed_lines=feature.drawn or given is None)
            if rings is None and given is None:
                continue  # see ``open_lines``; a layer of obstacles may hold their texts too
            if rings is None:
                msg = f"{where} is a {geometry['type']}, not a Polygon or MultiPolygon"
                raise RoadError(msg, hint="draw a fence or a wall as a narrow polygon")
            self._check_system(feature, where)
            found += [Region(kind, polygon, label, side) for ring in rings for polygon in self._polygons(ring, where)]
        return found

    def edges(self, feature: Feature) -> tuple[list[FloatArray], list[FloatArray]]:
        """Return the lines of an edge in the plane, of its areas, which are street, the outlines, and islands in these; of others none."""
        if self._is_line(feature) or role_of(feature, self.options) is not Role.EDGE:
            return [], []
        areas = [rings for geometry in flat(feature.geometry) for rings in _rings(geometry, closed_lines=False) or ()]
        where = self._named(feature, areas)
        surfaces = [polygon for rings in areas for polygon in self._polygons(rings, where)]
        outlines, islands = [surface.exterior for surface in surfaces], [hole for surface in surfaces for hole in surface.interiors]
        drawn, holes = ([np.asarray(ring.coords) for ring in rings] for rings in (outlines, islands))
        return self._lines(feature, flat(feature.geometry)) + drawn, holes

    def open_lines(self, feature: Feature) -> list[FloatArray]:
        """Return the lines of a feature in the plane that should be an area and are not closed."""
        if feature.properties.get("region") is not None or self._is_line(feature) or role_of(feature, self.options) not in AREAS:
            return []
        drawn = [geometry for geometry in flat(feature.geometry) if _rings(geometry, closed_lines=True) is None]
        return self._lines(feature, drawn)

    def _lines(self, feature: Feature, geometries: list[Json]) -> list[FloatArray]:
        lines = [geometry for geometry in geometries if geometry["type"] in LINES]
        where = self._named(feature, lines)
        return [self._placed(coordinates_of(part, where), where) for geometry in lines for part in parts_of(geometry, where)]

    def _named(self, feature: Feature, read: list[Any]) -> str:
        """Return what messages call a feature, of which this is ``read``: in the system of the line."""
        where = f"{self.name}: {role_of(feature, self.options)} {label_of(feature)!r}"
        if read:
            self._check_system(feature, where)
        return where

    def _is_line(self, feature: Feature) -> bool:
        return any(feature.geometry is line for line in self.lines)

    def _check_system(self, feature: Feature, where: str) -> None:
        if feature.system != self.system:
            theirs, ours = (system or "no coordinate reference system" for system in (feature.system, self.system))
            msg = f"{where} has {theirs}, the road has {ours}"
            raise RoadError(msg, hint="bring them into one system first: ogr2ogr -t_srs EPSG:N one.gpkg FILE")

    def _placed(self, points: FloatArray, where: str) -> FloatArray:
        placed = self.metres * points if self.plane is None else self.plane.into(points)
        lonlat = placed if self.plane is None else np.stack(self.plane.to_lonlat(*placed.T), axis=1)
        if not (np.all(np.isfinite(placed)) and np.all(np.isfinite(lonlat))):
            msg = f"{where} lies outside the road's coordinate reference system"
            raise RoadError(msg)
        refuse_far(placed, where)
        return placed

    def _polygons(self, rings: object, where: str) -> list[shapely.Polygon]:
        """Return a polygon of GeoJSON in the plane: several where its rings touch or cross themselves."""
        if not isinstance(rings, list | tuple) or not rings:
            msg = f"{where} has no coordinates"
            raise RoadError(msg)
        placed = [self._placed(coordinates_of(ring, where, fewest=3), where) for ring in rings]
        drawn = shapely.Polygon(placed[0], placed[1:])
        count = int(shapely.get_num_coordinates(drawn))
        if count > _MOST_CROSSING and not drawn.is_valid:
            msg = f"{where} crosses itself, and has {count} points; at most {_MOST_CROSSING} are taken apart"
            raise RoadError(msg, hint="repair it first: ogr2ogr -makevalid one.gpkg FILE")
        whole = shapely.make_valid(drawn)
        parts = [part for part in shapely.get_parts(shapely.get_parts(whole)) if isinstance(part, shapely.Polygon)]
        if not parts:
            msg = f"{where} has no area"
            raise RoadError(msg)
        return parts


def _side(feature: Feature, where: str) -> Side | None:
    """Return on which side a region must be passed, as its property says."""
    given = feature.properties.get("pass")
    if given is None:
        return None
    if given not in list(Side):
        msg = f"{where} has pass = {given!r}; a region is passed on the left or on the right"
        raise RoadError(msg)
    return Side(given)


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


def label_of(feature: Feature) -> str:
    """Return what is told and drawn of a feature beside the line: of a drawing its layer, where a name is a number of the program's."""
    return printable(feature.layer if feature.drawn or not feature.labels else feature.labels[0])[:_LONGEST_LABEL]
