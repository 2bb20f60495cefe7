"""Features beside the chosen line of a vector file: regions and edges, in the line's plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError
from hdvplan.road.checks import refuse_far
from hdvplan.road.crs import Plane
from hdvplan.road.features import LINES, Choice, Feature, Json, Role, coordinates_of, flat, parts_of, role_of
from hdvplan.road.regions import Kind, Region, Side
from hdvplan.texts import printable

_POLYGONS = {"Polygon", "MultiPolygon"}
_LONGEST_LABEL = 250  # letters of a name that is told and drawn
_MOST_CROSSING = 2000  # points of a polygon that crosses itself: it does so as often as the square of their number


@dataclass(frozen=True)
class Beside:
    """Features beside the chosen line, in its plane."""

    name: str
    system: str | None
    plane: Plane | None
    choice: Choice
    lines: tuple[object, ...]  # the geometries of the line, or of the legs
    metres: float  # a unit of coordinates without a system

    def regions(self, feature: Feature, number: int) -> list[Region]:
        """Return the regions of a feature, none if it is no region; ``number`` is the first one's."""
        given, role = feature.properties.get("region"), role_of(feature, self.choice)
        if given is None and (role not in {Role.OBSTACLE, Role.SWEEPABLE} or self._is_line(feature)):
            return []
        label = label_of(feature)
        where = f"{self.name}: region {label!r}" if label else f"{self.name}: region {number}"
        if given is not None and given not in list(Kind):
            msg = f"{where} is {given!r}; a region is obstacle or sweepable"
            raise RoadError(msg)
        kind = Kind(given or str(role))
        side = _side(feature, where)
        found: list[Region] = []
        for geometry in flat(feature.geometry) or [{"type": "feature without geometry"}]:
            rings = _rings(geometry, closed_lines=feature.drawn)
            if rings is None and given is None:
                continue  # a layer of obstacles may hold their texts and points too
            if rings is None:
                msg = f"{where} is a {geometry['type']}, not a Polygon or MultiPolygon"
                raise RoadError(msg, hint="draw a fence or a wall as a narrow polygon")
            self._check_system(feature, where)
            found += [Region(kind, polygon, label, side) for ring in rings for polygon in self._polygons(ring, where)]
        return found

    def edges(self, feature: Feature) -> list[FloatArray]:
        """Return the lines of a feature in the plane if it is an edge, none else."""
        if self._is_line(feature) or role_of(feature, self.choice) is not Role.EDGE:
            return []
        where = f"{self.name}: edge {(feature.labels or (feature.layer,))[0]!r}"
        lines = [part for geometry in flat(feature.geometry) if geometry["type"] in LINES for part in parts_of(geometry, where)]
        if lines:
            self._check_system(feature, where)
        return [self._placed(coordinates_of(part, where), where) for part in lines]

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
