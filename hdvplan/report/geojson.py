"""The swept area of every body as GeoJSON that opens over a map."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely
from shapely.geometry import mapping
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from hdvplan.jit import FloatArray
from hdvplan.report.result import Result, body_name
from hdvplan.road.path import ReferencePath
from hdvplan.road.road import Road

CHUNK_M = 50.0  # a road's swept area is cut into pieces this long: each is simple even where the road crosses itself
CENTRE_SPACING_M = 0.5
_DEGREES_GRID = 1e-7  # about 1 cm
_METRES_GRID = 1e-3
_FRAME_NOTE = "planar coordinates in metres: the road file has no geographic position"

Json = dict[str, object]


def swept_geojson(result: Result) -> Json:
    """Return a FeatureCollection: one (Multi)Polygon a body, then the road's centre line and its regions.

    Longitude and latitude, rounded to 1e-7 degrees, where the road has them; else planar metres, rounded to 1 mm.
    """
    drive, envelope = result.drive, result.envelope
    road, vehicle = drive.road, drive.vehicle
    common: Json = {"road": road.name, "vehicle": vehicle.name}
    if road.notice is not None:
        common["attribution"] = road.notice
    if road.to_lonlat is None:
        common["note"] = _FRAME_NOTE
    features = []
    for unit in range(len(vehicle.units)):
        left, right = envelope.left[unit], envelope.right[unit]
        reaches: Json = {"max_left_m": round(float(np.nanmax(left)), 4), "max_right_m": round(-float(np.nanmin(right)), 4)}
        area = swept_area(road.path, envelope.s, left, right)
        features.append(_feature(area, road, common | {"kind": "swept area", "unit": body_name(vehicle, unit)} | reaches))
    s = np.linspace(0.0, road.path.length, max(2, int(np.ceil(road.path.length / CENTRE_SPACING_M)) + 1))
    centre = shapely.LineString(np.column_stack(road.path.to_plane(s, 0.0)))
    features.append(_feature(centre, road, common | {"kind": "road centre"}))
    for region in road.regions:
        label = {"name": region.label} if region.label else {}
        features.append(_feature(region.polygon, road, common | {"kind": "region", "region": str(region.kind)} | label))
    return {"type": "FeatureCollection", "features": features}


def swept_area(path: ReferencePath, s: FloatArray, left: FloatArray, right: FloatArray) -> BaseGeometry:
    """Return the plane area [m] between signed offsets ``left`` and ``right`` [m] at ``s`` [m]; NaN where nothing was swept."""
    swept = np.isfinite(left) & np.isfinite(right)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], swept, [False]]).astype(int)))
    length = max(1, round(CHUNK_M / (s[1] - s[0])))
    pieces = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        for first in range(begin, end - 1, length):
            part = slice(first, min(first + length + 1, end))  # neighbours share a cross-section
            outline = np.concatenate([_points(path, s[part], left[part]), _points(path, s[part], right[part])[::-1]])
            pieces.append(shapely.make_valid(shapely.Polygon(outline)))
    return shapely.union_all(pieces)


def _points(path: ReferencePath, s: FloatArray, offset: FloatArray) -> FloatArray:
    return np.column_stack(path.to_plane(s, offset))


def _feature(geometry: BaseGeometry, road: Road, properties: Json) -> Json:
    """Return a feature in the road's own coordinates; polygons wind as RFC 7946 wants them."""
    if road.to_lonlat is None:
        placed, grid, digits = geometry, _METRES_GRID, 3
    else:
        placed, grid, digits = shapely.transform(geometry, _lonlat(road.to_lonlat)), _DEGREES_GRID, 7
    if not isinstance(placed, shapely.LineString):
        placed = _polygons(shapely.set_precision(placed, grid))  # rounds and keeps the area valid
    shape = mapping(placed)
    return {
        "type": "Feature",
        "properties": properties,
        "geometry": {"type": shape["type"], "coordinates": _rounded(shape["coordinates"], digits)},
    }


def _lonlat(to_lonlat: Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]) -> Callable[[FloatArray], FloatArray]:
    return lambda points: np.column_stack(to_lonlat(points[:, 0], points[:, 1]))


def _polygons(geometry: BaseGeometry) -> shapely.Polygon | shapely.MultiPolygon:
    """Return the areas of ``geometry``, counter-clockwise; lines and points that repairs left over are dropped."""
    parts = [orient(part) for part in shapely.get_parts(shapely.get_parts(geometry)) if isinstance(part, shapely.Polygon)]
    return parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)


def _rounded(coordinates: object, digits: int) -> object:
    if isinstance(coordinates, float | int):
        return round(float(coordinates), digits)
    assert isinstance(coordinates, tuple | list)  # noqa: S101 - shapely nests nothing else
    return [_rounded(inner, digits) for inner in coordinates]
