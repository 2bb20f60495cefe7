"""The coordinate systems that drawings and maps of a road are written in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray
from hdvplan.road.crs import IntoPlane, ToLonLat, is_local
from hdvplan.road.road import Road

LONLAT_CODE = "EPSG:4326"
_UTM_LATITUDES = (-80.0, 84.0)  # [deg]


@dataclass(frozen=True)
class System:
    """A coordinate system for a file about a road, and the way there from the road's plane."""

    name: str | None  # a code or a PROJ string; None: metres of no known place
    note: str  # what the file and its reader are told
    plane: str | None = None  # of the road, where that is another one

    def place(self, geometry: BaseGeometry) -> BaseGeometry:
        """Return a geometry of the road's plane in this system."""
        if self.plane is None or self.name is None:
            return geometry
        if self.name == LONLAT_CODE:  # across the antimeridian longitudes go on, else a line would go round the world
            to_lonlat = ToLonLat(self.plane)
            return shapely.transform(geometry, lambda points: np.column_stack(to_lonlat(points[:, 0], points[:, 1])))
        return shapely.transform(geometry, IntoPlane(self.plane, self.name))


def map_system(road: Road) -> System:
    """Return the system of a map: the road's own, or longitude and latitude where the road came in degrees."""
    if isinstance(road.to_lonlat, ToLonLat) and is_local(road.to_lonlat):
        return System(LONLAT_CODE, f"longitude and latitude, {LONLAT_CODE}", road.to_lonlat.plane)
    return drawing_system(road)


def drawing_system(road: Road) -> System:
    """Return the system of a drawing in metres: the road's own, or its UTM zone on WGS 84 where the road came in degrees."""
    if not isinstance(road.to_lonlat, ToLonLat):
        return System(None, "metres of the road file, which names no coordinate system")
    plane = road.to_lonlat.plane
    if not is_local(road.to_lonlat):
        return System(plane, f"metres in {plane}, the system of the road file")
    middle = np.array([np.median(part) for part in road.path.to_plane(np.linspace(0.0, road.path.length, 101), 0.0)])
    lon, lat = (float(value[0]) for value in road.to_lonlat(middle[:1], middle[1:]))
    if not _UTM_LATITUDES[0] <= lat <= _UTM_LATITUDES[1]:
        return System(plane, f"metres in {plane}")
    zone = int(np.floor((lon + 180.0) / 6.0)) % 60 + 1
    code = f"EPSG:{(32600 if lat >= 0.0 else 32700) + zone}"
    return System(code, f"metres in {code}, WGS 84 / UTM zone {zone}{'N' if lat >= 0.0 else 'S'}{_stretch(plane, code, middle)}", plane)


def _stretch(plane: str, code: str, middle: FloatArray) -> str:
    """Return what a true length is multiplied by in a system, as a remark."""
    ends = IntoPlane(plane, code)(np.stack([middle, middle + np.array([100.0, 0.0])]))
    return f": lengths times {float(np.hypot(*(ends[1] - ends[0]))) / 100.0:.5f}"
