"""Coordinate reference systems: between degrees or map coordinates and a plane in metres. The only user of pyproj."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError

if TYPE_CHECKING:  # many roads are in metres, and need no PROJ
    from pyproj import CRS, Transformer

LONLAT = "OGC:CRS84"
_LONG = re.compile(r"(?:urn:(?:x-)?ogc:def:crs:|https?://www\.opengis\.net/def/crs/)EPSG[:/][^:/]*[:/](\d+)", re.IGNORECASE)
_TENTH = 1.6e-9  # [deg] from a tenth of a degree, which PROJ would take instead
_LOCAL = "+proj=tmerc +ellps=WGS84 +units=m +k=1 +x_0=0 +y_0=0 "  # in this order: of planes made here alone
_LARGEST_LON, _LARGEST_LAT = 180.0, 90.0  # [deg]
_STEP_M = 100.0  # over which a system's scale is measured
_FALSE_LENGTHS = 0.01  # share by which lengths may be wrong: 3 cm of 3 m
_DEGREES_SPACING = 1e-2  # of points
_ELSEWHERE_M = 1000.0  # no street is so wide
ELSEWHERE_HINT = "are their coordinates swapped (longitude comes first), or of another system?"  # of what lies far from its road
_DEGREES_LENGTH = 5.0  # no road is this short in metres, or this long in degrees


@dataclass(frozen=True)
class ToLonLat:
    """The way from x, y [m] in the plane of the system ``plane`` to longitude and latitude [deg]; any shape.

    Longitudes are those nearest to the plane's meridian: across the antimeridian they go on beyond 180 degrees.
    """

    plane: str  # what pyproj calls it: a code, or a PROJ string

    def __call__(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return longitudes and latitudes [deg] of places ``x`` east, ``y`` north [m] in the plane, two arrays of one shape."""
        lon, lat = (np.asarray(value, dtype=float) for value in _transformer(self.plane, LONLAT).transform(x, y))
        turns = np.round((np.where(np.isfinite(lon), lon, 0.0) - _meridian(self.plane)) / 360.0)  # infinite outside the system's area
        return lon - 360.0 * turns, lat


@dataclass(frozen=True)
class IntoPlane:
    """The way from points of the system ``given``, shape (n, 2), into the plane of the system ``plane``, x, y [m]."""

    given: str
    plane: str

    def __call__(self, points: FloatArray) -> FloatArray:
        """Return the points in the plane, shape (n, 2)."""
        if self.given == self.plane:
            return points
        return _transformed(LONLAT, self.plane, lonlat_of(self.given, points))


@dataclass(frozen=True)
class Plane:
    """Points in a plane, shape (n, 2), x east, y north [m], and the way back to longitude and latitude [deg].

    ``into`` brings further points of the same system, shape (n, 2), into this plane.
    """

    points: FloatArray
    to_lonlat: ToLonLat
    into: IntoPlane


def short_name(name: str) -> str:
    """Return a system's name as people write it: EPSG:27700 for what old GeoJSON files call urn:ogc:def:crs:EPSG::27700."""
    code = _LONG.fullmatch(name)
    return name if code is None else f"EPSG:{code[1]}"


def parse_crs(name: str) -> CRS:
    """Return the coordinate reference system called ``name``, such as ``EPSG:3006``.

    Raises:
        RoadError: unknown, or neither projected nor geographic.

    """
    from pyproj import CRS  # noqa: PLC0415 - see above
    from pyproj.exceptions import CRSError  # noqa: PLC0415 - see above

    try:
        crs = CRS.from_user_input(name)
    except (CRSError, UnicodeError) as error:  # the second of undecodable bytes
        msg = f"unknown coordinate reference system {name!r}"
        raise RoadError(msg, hint="give an EPSG code, such as --crs EPSG:3006") from error
    if not (crs.is_projected or crs.is_geographic):
        msg = f"{name} is neither a projected nor a geographic coordinate reference system"
        raise RoadError(msg, hint="give an EPSG code, such as --crs EPSG:3006")
    return crs


def _is_metric(crs: CRS) -> bool:
    """Tell whether planning may take lengths from a system: not in degrees or feet, nor Web Mercator, which is wrong by 50 % and more."""
    operation = crs.coordinate_operation
    web = operation is not None and "Pseudo Mercator" in operation.method_name
    return crs.is_projected and not web and {axis.unit_name for axis in crs.axis_info[:2]} == {"metre"}


def to_plane(points: FloatArray, name: str = LONLAT) -> Plane:
    """Return points in a plane in which lengths are true; as ``placed``.

    Raises:
        RoadError: as ``placed``, degrees for metres, or lengths in this system are wrong by more than 1 % here.

    """
    from pyproj import Geod  # noqa: PLC0415 - see above

    if looks_like_degrees(points) and not is_geographic(name):
        msg = f"the coordinates look like degrees, but {name} is not in degrees"
        raise RoadError(msg, hint="--crs is the system of the road's own coordinates: leave it out")
    plane = placed(points, name)
    here = plane.points[len(points) // 2]
    lon, lat = plane.to_lonlat(*(here + _STEP_M * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])).T)
    apart = Geod(ellps="WGS84").inv(lon[[0, 0]], lat[[0, 0]], lon[1:], lat[1:])[2]
    if not np.all(apart > 0.0):  # far outside, where many coordinates lead to one place, or to none
        raise _outside(name)
    scale = _STEP_M / apart
    wrong = scale[np.argmax(np.abs(scale - 1.0))] - 1.0
    if not abs(wrong) <= _FALSE_LENGTHS:
        msg = f"lengths in {name} are wrong by {100.0 * wrong:+.1f} % here"
        hint = "are x east and y north? else give longitude and latitude, or a metric system of this place such as its UTM zone"
        raise RoadError(msg, hint=hint)
    return plane


def placed(points: FloatArray, name: str) -> Plane:
    """Return points of the system ``name`` in a plane: of projected systems in metres as they are, others projected.

    ``points`` has shape (n, 2): easting and northing or longitude and latitude [deg], always in this order. The projection
    is a transverse Mercator at the middle of the points' extent with scale 1: its lengths are right to 1e-6 within 9 km of
    that meridian.

    Raises:
        RoadError: an unusable system, or points outside the area where it is defined.

    """
    name = short_name(name)
    plane = name if _is_metric(parse_crs(name)) else _local(lonlat_of(name, points))
    to_lonlat, into = ToLonLat(plane), IntoPlane(name, plane)
    there = into(points)
    if not np.all(np.isfinite(to_lonlat(there[:, 0], there[:, 1]))):
        raise _outside(name)
    return Plane(there, to_lonlat, into)


def _outside(name: str) -> RoadError:
    msg = f"the coordinates lie outside the area of {name}"
    return RoadError(msg, hint="check --crs and that the order is easting, northing (or longitude, latitude)")


def is_local(to_lonlat: ToLonLat) -> bool:
    """Tell whether the plane is a projection of ours about a road that came in degrees, so that nobody else knows it."""
    return to_lonlat.plane.startswith(_LOCAL)


def is_geographic(name: str) -> bool:
    """Tell whether the system's coordinates are degrees.

    Raises:
        RoadError: an unusable system.

    """
    return not parse_crs(name).is_projected


def lonlat_of(name: str, points: FloatArray) -> FloatArray:
    """Return longitude and latitude [deg] of points of any system, shape (n, 2)."""
    return points if name == LONLAT else _transformed(name, LONLAT, points)


def looks_like_degrees(points: FloatArray) -> bool:
    """Tell whether coordinates without a system, shape (n, 2), can only be degrees: in metres the road would be shorter than any."""
    spacing = np.hypot(*np.diff(points, axis=0).T)
    in_range = bool(np.all(np.abs(points) <= np.array([_LARGEST_LON, _LARGEST_LAT])))
    return in_range and bool(np.median(spacing) < _DEGREES_SPACING) and 0.0 < float(np.sum(spacing)) < _DEGREES_LENGTH


def check_lonlat(points: FloatArray, where: str) -> None:
    """Refuse longitudes and latitudes [deg], shape (n, 2), that cannot be any; ``where`` begins the message.

    Raises:
        RoadError: a value outside its range; says so if the two look swapped or metric.

    """
    lon, lat = points.T
    outside = np.flatnonzero((np.abs(lon) > _LARGEST_LON) | (np.abs(lat) > _LARGEST_LAT))
    if outside.size == 0:
        return
    at = int(outside[0])
    msg = f"{where}: point {at + 1} has longitude {lon[at]:g}, latitude {lat[at]:g}, outside +-180 and +-90 degrees"
    if np.all(np.abs(lon) <= _LARGEST_LAT) and np.all(np.abs(lat) <= _LARGEST_LON):
        raise RoadError(msg, hint="longitude and latitude look swapped: longitude comes first")
    hint = (
        "if the coordinates are metres, name their system, such as --crs EPSG:3006; metres of a drawing's own go into a CSV file with x,y"
    )
    raise RoadError(msg, hint=hint)


def _local(lonlat: FloatArray) -> str:
    """Return the transverse Mercator at the middle of the points' extent, as a PROJ string."""
    lon = np.unwrap(lonlat[:, 0], period=360.0)  # a road may cross the antimeridian
    lon_0, lat_0 = 0.5 * (lon.min() + lon.max()), 0.5 * (lonlat[:, 1].min() + lonlat[:, 1].max())
    lat_0, lon_0 = (round(value, 1) if abs(value - round(value, 1)) < _TENTH else value for value in (lat_0, lon_0))
    return f"{_LOCAL}+lat_0={lat_0:.9f} +lon_0={lon_0:.9f}"


def _transformed(source: str, target: str, points: FloatArray) -> FloatArray:
    return np.stack(_transformer(source, target).transform(points[:, 0], points[:, 1]), axis=1)


@lru_cache(maxsize=32)
def _meridian(plane: str) -> float:
    """Return the longitude of a projection's origin [deg]."""
    operation = parse_crs(plane).coordinate_operation
    values = {} if operation is None else {parameter.name: float(parameter.value) for parameter in operation.params}
    return next((value for name, value in values.items() if name.startswith("Longitude of")), 0.0)


@lru_cache(maxsize=32)
def _transformer(source: str, target: str) -> Transformer:
    """Return PROJ's transformer between two systems: the values above hold names alone, so that they pickle."""
    from pyproj import Transformer  # noqa: PLC0415 - see above

    if source == LONLAT and target.startswith(_LOCAL):  # what PROJ finds, too, after a search of 25 ms
        return Transformer.from_pipeline(f"+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step {target}")
    if target == LONLAT and source.startswith(_LOCAL):
        return Transformer.from_pipeline(f"+proj=pipeline +step +inv {source} +step +proj=unitconvert +xy_in=rad +xy_out=deg")
    return Transformer.from_crs(source, target, always_xy=True)


def refuse_far_edges(line: FloatArray, edges: FloatArray) -> None:
    """Refuse edges none of which is anywhere near the road; points of both, shape (n, 2) [m].

    Raises:
        RoadError: what is drawn is further away than ``_ELSEWHERE_M``.

    """
    apart = np.maximum(line.min(axis=0) - edges.max(axis=0), edges.min(axis=0) - line.max(axis=0))  # of both extents
    far = float(np.hypot(*np.maximum(apart, 0.0)))
    if far > _ELSEWHERE_M:
        msg = f"the edges lie {far / 1e3:.0f} km from the road"
        raise RoadError(msg, hint=ELSEWHERE_HINT)
