"""The swept area of every body as GeoJSON that opens over a map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from hdvplan.arrays import FloatArray, runs_of
from hdvplan.judging.balance import Breach
from hdvplan.judging.bodies import wheel_tracks
from hdvplan.judging.result import Result, body_name
from hdvplan.report import BREACH, INK, MUTED, body_colour
from hdvplan.report.kerbs import broken_kerb, shown_kerbs, simple_line
from hdvplan.report.rooms import approach_of
from hdvplan.road.path import ReferencePath
from hdvplan.road.regions import Region, polygons_of
from hdvplan.road.road import Road

CHUNK_M = 50.0  # a road's swept area is cut into pieces this long: each is simple even where the road crosses itself
CENTRE_SPACING_M = 0.5
_DEGREES = 7  # decimals: about 1 cm
_FINE_DEGREES = 9  # about 0.1 mm, for areas that are centimetres wide
_METRES_GRID = 1e-3
_SIMPLER_M = 1e-3  # points are left out that would move no line by more: nine of ten
_FRAME_NOTE = "planar coordinates in metres: the road file has no geographic position"

Json = dict[str, Any]


def swept_geojson(result: Result) -> Json:
    """Return a FeatureCollection: one (Multi)Polygon a body, lines for limits and their breaches, the road's centre, regions, tracks.

    The driven line is that of the lead unit's rear axle. The tracks are those of ``hdvplan.judging.bodies``, one line a wheel.
    Every feature carries its colours as simplestyle properties (github.com/mapbox/simplestyle-spec), which geojson.io and
    GitHub draw by; in QGIS they are fields for data-defined styles.
    Longitude and latitude, rounded to 1e-7 degrees, where the road has them; else planar metres, rounded to 1 mm.
    """
    return {"type": "FeatureCollection", "features": swept_features(result)}


def _most(reach: FloatArray) -> float | None:
    """Return the largest reach [m]; None of a body that is nowhere beside the line, as in a jack-knife."""
    return round(float(np.nanmax(reach)), 4) if np.any(np.isfinite(reach)) else None


def swept_features(result: Result, areas: Sequence[BaseGeometry] | None = None, named: Json | None = None) -> list[Json]:
    """Return the features of ``swept_geojson``, with the properties ``named``; ``areas`` [m] stand for what bodies sweep along a leg."""
    drive, envelope = result.drive, result.envelope
    road, vehicle = drive.road, drive.vehicle
    common: Json = {"road": road.name, "vehicle": vehicle.name} | (named or {})
    if road.notice is not None:
        common["attribution"] = road.notice
    if road.to_lonlat is None:
        common["note"] = _FRAME_NOTE
    features = []
    for unit in range(len(vehicle.units)):
        left, right = envelope.left[unit], envelope.right[unit]
        reaches: Json = {"max_left_m": _most(left), "max_right_m": _most(-right)}
        area = swept_area(road.path, envelope.s, left, right) if areas is None else areas[unit]
        styled = area_style(body_colour(unit))
        features.append(feature(area, road, common | {"kind": "swept area", "unit": body_name(vehicle, unit)} | reaches | styled))
    for kerb in shown_kerbs(result):
        kind, width = ("limit of overhangs", 1) if kerb.binds == "overhangs" else ("limit", 2)
        named = common | {"kind": kind, "side": kerb.side} | ({"bridged": True} if kerb.bridged else {})
        features.append(feature(kerb.line, road, named | _line_style(INK, width)))
    features += [_broken(result, breach, common) for breach in result.balance.breaches]
    s = np.linspace(0.0, road.path.length, max(2, int(np.ceil(road.path.length / CENTRE_SPACING_M)) + 1))
    features.append(
        feature(
            simple_line(_points(road.path, s, np.zeros(len(s))), _SIMPLER_M), road, common | {"kind": "road centre"} | _line_style(MUTED, 1)
        )
    )
    driven = _points(drive.stations.path, drive.poses_s, drive.poses_z[:, 0])
    features.append(feature(simple_line(driven, _SIMPLER_M), road, common | {"kind": "driven line"} | _line_style(INK, 1), fine=True))
    features += [region_feature(region, road, common) for region in road.regions if areas is None]  # a leg's are cut
    for track in wheel_tracks(drive):
        wheel, line = track.wheel, simple_line(track.points, _SIMPLER_M)
        properties = common | {"kind": "wheel track", "unit": body_name(vehicle, wheel.unit), "axle": wheel.axle, "side": wheel.side}
        features.append(feature(line, road, properties | _line_style(body_colour(wheel.unit), 1)))
    return features


def region_feature(region: Region, road: Road, common: Json) -> Json:
    """Return an obstacle or a sweepable area beside a road."""
    properties = common | {"kind": "region", "region": str(region.kind)} | ({"name": region.label} if region.label else {})
    return feature(shapely.simplify(region.polygon, _SIMPLER_M), road, properties | area_style(MUTED))


def swept_area(path: ReferencePath, s: FloatArray, left: FloatArray, right: FloatArray) -> BaseGeometry:
    """Return the plane area [m] between signed offsets ``left`` and ``right`` [m] at ``s`` [m]; NaN where nothing was swept."""
    length = max(1, round(CHUNK_M / (s[1] - s[0])))
    pieces = []
    for begin, end in runs_of(np.isfinite(left) & np.isfinite(right)):
        for first in range(begin, end - 1, length):
            part = slice(first, min(first + length + 1, end))  # neighbours share a cross-section
            outline = np.concatenate([_points(path, s[part], left[part]), _points(path, s[part], right[part])[::-1]])
            pieces.append(shapely.make_valid(shapely.simplify(shapely.Polygon(outline), _SIMPLER_M, preserve_topology=False)))
    return shapely.union_all(pieces)


def _broken(result: Result, breach: Breach, common: Json) -> Json:
    """Return the stretch of a kerb over which it is broken, or the outline of an obstacle that was entered, with the depth."""
    where: Json = {"kind": "broken limit", "side": breach.side, "depth_m": round(breach.depth, 4), "s_m": round(breach.s_deepest, 2)}
    if breach.obstacle is None:
        line = broken_kerb(result, breach, CENTRE_SPACING_M)
    else:
        line = approach_of(result, breach).obstacle.polygon.exterior
    return feature(shapely.LineString(line), result.drive.road, common | where | _line_style(BREACH, 5))


def area_style(colour: str) -> Json:
    """Return the simplestyle properties of an area."""
    return {"stroke": colour, "stroke-width": 1, "stroke-opacity": 1.0, "fill": colour, "fill-opacity": 0.35}


def _line_style(colour: str, width: int) -> Json:
    return {"stroke": colour, "stroke-width": width, "stroke-opacity": 1.0}


def _points(path: ReferencePath, s: FloatArray, offset: FloatArray) -> FloatArray:
    return np.column_stack(path.to_plane(s, offset))


def feature(geometry: BaseGeometry, road: Road, properties: Json, *, fine: bool = False) -> Json:
    """Return a feature in the road's own coordinates, degrees to 1 cm or, ``fine``, to 0.1 mm; polygons wind as RFC 7946 wants them."""
    to_lonlat = road.to_lonlat
    if to_lonlat is None:
        placed, grid, digits = geometry, _METRES_GRID, 3
    else:
        digits = _FINE_DEGREES if fine else _DEGREES
        placed = shapely.transform(geometry, lambda points: np.column_stack(to_lonlat(points[:, 0], points[:, 1])))
        grid = 10.0**-digits
    if not isinstance(placed, shapely.LineString):
        parts = [orient(part) for part in polygons_of(_rounded(placed, grid))]
        placed = parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)
    rounded = shapely.transform(placed, lambda points: np.round(points, digits))
    return {"type": "Feature", "properties": properties, "geometry": shapely.geometry.mapping(rounded)}


def _rounded(area: BaseGeometry, grid: float) -> BaseGeometry:
    """Return a valid area whose corners lie on a grid; one with spikes too thin for it is repaired after rounding."""
    try:
        return shapely.set_precision(area, grid)
    except shapely.GEOSException:
        return shapely.make_valid(shapely.set_precision(area, grid, mode="pointwise"))
