"""Read a path of one's own from a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.driving.followed import PLANE_HINT, GivenPath
from hdvplan.errors import RoadError
from hdvplan.road.crs import LONLAT, IntoPlane, ToLonLat, check_lonlat
from hdvplan.road.load import find_road
from hdvplan.road.load_csv import read_columns
from hdvplan.vehicle.model import Vehicle

_LINES = (".gpx", ".kml", ".geojson")  # files of lines in longitude and latitude; any other one is a table


def read_given_path(path: Path, vehicle: Vehicle, to_lonlat: ToLonLat | None = None) -> GivenPath:
    """Return the path in a CSV file with columns x, y and, if it has them, heading, beta1, ..., steering1, ...; as ``path.csv`` is written.

    Columns lon, lat [deg] do as well, along a road whose plane has ``to_lonlat``, and so does the line in a GPX, KML or GeoJSON file.

    Raises:
        RoadError: as for ``read_columns``, or degrees along a road that has none.
        OSError: the file cannot be read.

    """
    couplings = [f"beta{number}" for number in range(1, len(vehicle.units))]
    steered = [f"steering{number}" for number in range(1, len(vehicle.active) + 1)]
    if path.suffix.lower() in _LINES and path.is_file():
        columns, lines = _line_in(path), list[int]()
    else:
        columns, lines = read_columns(path, ("x", "y"), "path", ("heading", *couplings, *steered), instead=("lon", "lat"))

    def together(names: list[str]) -> FloatArray | None:
        return np.column_stack([columns[name] for name in names]) if names and all(name in columns for name in names) else None

    across, up = ("lon", "lat") if "lon" in columns else ("x", "y")
    places = zip(columns[across].tolist(), columns[up].tolist(), strict=True)
    names = tuple(
        f"{f'line {lines[row]}' if lines else f'point {row + 1}'} of {path.name} ({across} {x:.9g}, {up} {y:.9g})"
        for row, (x, y) in enumerate(places)
    )
    if "lon" not in columns:
        points = np.column_stack([columns["x"], columns["y"]])
    elif to_lonlat is None:
        msg = f"path {path.name} is in degrees, and the road is not"
        raise RoadError(msg, hint=PLANE_HINT)
    else:
        degrees = np.column_stack([columns["lon"], columns["lat"]])
        check_lonlat(degrees, f"path {path.name}")
        points = IntoPlane(LONLAT, to_lonlat.plane)(degrees)
    return GivenPath(points, columns.get("heading"), together(couplings), together(steered), names)


def _line_in(path: Path) -> dict[str, FloatArray]:
    """Return the columns lon, lat [deg] of the line in a file that a road may be read from, or x, y [m] where that knows no degrees.

    Raises:
        RoadError: no such line, or more than one.

    """
    try:
        line = find_road(path).line
    except RoadError as error:
        raise RoadError(str(error), hint="keep in the file the one line that is driven, or give columns x, y or lon, lat") from error
    assert line is not None  # noqa: S101 - for the type checker: of a file there is one
    raw, (x, y) = line.raw, line.raw.points.T
    return {"x": x, "y": y} if raw.to_lonlat is None else dict(zip(("lon", "lat"), raw.to_lonlat(x, y), strict=True))
