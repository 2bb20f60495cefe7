"""A path of one's own as it is given: as arrays, or in a table of points."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from hdvplan.arrays import BoolArray, FloatArray, running
from hdvplan.errors import OptionError, RoadError
from hdvplan.fileio import read_json
from hdvplan.road.columns import unread_note
from hdvplan.road.crs import LONLAT, IntoPlane, ToLonLat, check_lonlat, parse_crs
from hdvplan.road.given import GivenLine, given_line
from hdvplan.road.load import find_road
from hdvplan.road.load_csv import read_columns
from hdvplan.road.path import ReferencePath
from hdvplan.settings import METRES
from hdvplan.vehicle.model import Vehicle

PLANE_HINT = "its x and y are in the plane of the road's path (`plane` in summary.json), as path.csv is; or give lon and lat"
DENSE_M = 1.0  # points no further apart tell what lies between: any curve through them is the same to some centimetres
_FILLED_M = 0.5  # between others, so that a bend begins within as much: at a radius of 18 m the front of a bus is then 3 cm off
_TURNS = 5e-3  # points that turn by themselves by less are rounded [rad]: 1 cm at 3 m
_REACH = 3  # chords beside others; further on, a spline has a fiftieth left of what such a point does to it
_LINES = (".gpx", ".kml", ".geojson")  # files of lines in longitude and latitude; any other one is a table
_OURS, _SUMMARY = ("path.csv", "loop_worst.csv"), "summary.json"  # what we write of a path, and what says in which plane
_LIKE = 0.1  # of a road's extent, by which that of a path in another unit may differ
_OF_LINE = {"s", "e_y", "e_psi", "kappa", "K"}  # what path.csv says of the road's line, which is asked again
_SHAPES = {"points": ("n", "2"), "heading": ("n",), "betas": ("n", "couplings"), "steering": ("n", "active")}


@dataclass(frozen=True)
class GivenPath:
    """Where the lead unit's rear axle is driven: points and headings, (n, 2) [m] and (n,) [rad], in the plane of the road's path.

    ``heading`` is None where it is the direction of a curve through the points, read as those of a road, or ``splined``. ``betas``
    (n, couplings) [rad], headings of units less those of the units behind them, is what the path's author says of the trailers, of which
    only the first row is used; ``steering`` (n, active) [rad] the wheels that the vehicle steers by itself.

    Raises:
        OptionError: arrays of other shapes, what is not a finite number, or angles of trailers or wheels beyond pi.

    """

    points: FloatArray
    heading: FloatArray | None = None
    betas: FloatArray | None = None
    steering: FloatArray | None = None
    name: str = ""  #: of its file
    notes: tuple[str, ...] = ()  #: on columns of its file that were not read
    names: tuple[str, ...] = ()  #: (n,) of its points, for messages
    splined: bool = False  #: the curve through its points is their spline

    def __post_init__(self) -> None:
        """Refuse arrays that are no path."""
        for name, shape in _SHAPES.items():
            try:
                given = None if getattr(self, name) is None else np.asarray(getattr(self, name), dtype=float)
            except (TypeError, ValueError) as error:
                msg = f"{name} is no array of numbers"
                raise OptionError(msg) from error
            if given is None:
                continue
            if given.ndim != len(shape) or len(given) != len(self.points) or (name == "points" and given.shape[1] != 2):  # noqa: PLR2004
                msg = f"{name} must have shape ({', '.join(shape)}{',' * (len(shape) == 1)}), not {given.shape}"
                raise OptionError(msg, hint=None if name == "points" else f"n is {len(self.points)}, that of points")
            if not np.all(np.isfinite(given)):
                msg = f"{name} holds what is not a finite number"
                raise OptionError(msg)
            object.__setattr__(self, name, given)
            most = float(np.max(np.abs(given), initial=0.0))
            if name in {"betas", "steering"} and most > np.pi:
                msg = f"{f'{self.name}: ' if self.name else ''}{name} reach {most:.4g} rad, more than half a turn"
                raise OptionError(msg, hint="is their unit degrees? Angles are in radians, or in columns such as beta1_deg")

    def named(self, row: int) -> str:
        """Return what messages call a point, by its number from 0."""
        x, y = self.points[row]
        return self.names[row] if self.names else f"its point {row + 1} ({x:.2f}, {y:.2f})"

    @property
    def spacing(self) -> FloatArray:
        """How far apart its points are, (n - 1,) [m]."""
        return np.asarray(np.hypot(*np.diff(self.points, axis=0).T))

    @property
    def otherwise(self) -> GivenPath:
        """The path whose curve between the points is as good a guess: of the points alone, or their spline."""
        return replace(self, heading=None, splined=self.heading is None and not self.splined)

    def unfilled(self) -> FloatArray:
        """Return the lengths of the chords over which the curve is a spline, as a point near them turns by itself, (k,) [m]."""
        return np.zeros(0) if self._read is None else self.spacing[self._read[1]]

    def filled(self) -> GivenPath:
        """Return the path with points between those further apart than ``DENSE_M`` [m], but for places where points turn by themselves."""
        if self._read is None:
            return self
        line, near = self._read
        spacing, rows = self.spacing, np.arange(len(self.points), dtype=np.float64)
        pieces = np.where(near | (spacing <= DENSE_M), 1.0, np.ceil(spacing / _FILLED_M))
        ends = np.append(0.0, np.cumsum(pieces))
        number = np.interp(np.arange(ends[-1] + 1.0), ends, rows)

        def between(values: FloatArray, at: FloatArray = rows) -> FloatArray:
            return np.array([np.interp(number, at, column) for column in values.T]).reshape(-1, len(number)).T

        betas, steering = (None if values is None else between(values) for values in (self.betas, self.steering))
        names = tuple(self.named(int(row)) for row in number)
        return replace(self, points=between(line.points, line.number), betas=betas, steering=steering, names=names)

    @cached_property
    def _read(self) -> tuple[GivenLine, BoolArray] | None:
        """Its points as a road's are read, and which chords are near one that turns by itself; None where its curve is another."""
        if self.heading is not None or self.splined or np.max(self.spacing, initial=0.0) <= DENSE_M:
            return None
        line = given_line(self.points, closed=False)
        turn = np.diff(np.unwrap(np.arctan2(*np.diff(self.points, axis=0).T[::-1])), prepend=0.0, append=0.0)
        alone = (np.interp(np.arange(len(self.points)), line.number, line.sharp) > 0.0) & (np.abs(turn) > _TURNS)
        return line, running(np.maximum, alone.astype(float), _REACH - 1, _REACH)[:-1] > 0.0


def unit_hint(points: FloatArray, road: ReferencePath, length: float) -> str:
    """Return which unit other than metres ``points`` (n, 2) seem to have, as they extend so many times as far as the road; "" if none."""
    own, whole = (
        float(np.max(np.ptp(one, axis=0))) for one in (points, np.column_stack(road.to_plane(np.linspace(0.0, length, 100), 0.0)))
    )
    unit = next((name for name, metres in METRES.items() if name != "m" and abs(own * metres - whole) < _LIKE * whole), None)
    return "" if unit is None else f"it extends over {own:.0f} m, the road over {whole:.0f} m: are its coordinates {unit}? Give metres"


def read_given_path(path: Path, vehicle: Vehicle, to_lonlat: ToLonLat | None = None) -> GivenPath:
    """Return the path in a CSV file with columns x, y and, if it has them, heading, beta1, ..., steering1, ...; as ``path.csv`` is written.

    Columns lon, lat [deg] do as well, along a road whose plane has ``to_lonlat``, and so does the line in a GPX, KML or GeoJSON file. A
    path of ours, beside a ``summary.json`` that names another plane, is brought into the road's.

    Raises:
        RoadError: as for ``read_columns``, degrees along a road that has none, or angles of some of the trailers or wheels alone.
        OptionError: as ``GivenPath``.
        OSError: the file cannot be read.

    """
    couplings = [f"beta{number}" for number in range(1, len(vehicle.units))]
    steered = [f"steering{number}" for number in range(1, len(vehicle.active) + 1)]
    if path.suffix.lower() in _LINES and path.is_file():
        (columns, told), unread, lines = _line_in(path), list[str](), list[int]()
    else:
        told = ()
        columns, unread, lines = read_columns(path, ("x", "y"), "path", ("heading", *couplings, *steered), instead=("lon", "lat"))

    if set(unread) >= _OF_LINE:
        unread = [title for title in unread if title not in _OF_LINE]

    def together(names: list[str]) -> FloatArray | None:
        found = [name for name in names if name in columns]
        if found and found != names:
            msg = f"path {path.name} has {', '.join(found)}, but not all of {', '.join(names)}"
            raise RoadError(msg)
        return np.column_stack([columns[name] for name in names]) if found else None

    across, up = ("lon", "lat") if "lon" in columns else ("x", "y")
    places = zip(columns[across].tolist(), columns[up].tolist(), strict=True)
    names = tuple(
        f"{f'line {lines[row]}' if lines else f'point {row + 1}'} of {path.name} ({across} {x:.9g}, {up} {y:.9g})"
        for row, (x, y) in enumerate(places)
    )
    heading, notes = columns.get("heading"), (*told, *unread_note(unread, path.name))
    if "lon" not in columns:
        points, theirs = np.column_stack([columns["x"], columns["y"]]), _plane_beside(path)
        if theirs is not None and to_lonlat is not None and theirs != to_lonlat.plane:
            points, heading = _brought(IntoPlane(theirs, to_lonlat.plane), points, heading)
            notes += (f"{path.name} was planned in another plane than the road's: it is brought into the road's",)
    elif to_lonlat is None:
        msg = f"path {path.name} is in degrees, and the road is not"
        raise RoadError(msg, hint=PLANE_HINT)
    else:
        degrees = np.column_stack([columns["lon"], columns["lat"]])
        check_lonlat(degrees, f"path {path.name}")
        points = IntoPlane(LONLAT, to_lonlat.plane)(degrees)
    return GivenPath(points, heading, together(couplings), together(steered), path.name, notes, names)


def _plane_beside(path: Path) -> str | None:
    """Return the plane of a path that hdvplan wrote, from the summary beside it; None of other paths.

    Raises:
        RoadError: a plane that nobody knows.

    """
    if path.name not in _OURS:
        return None
    plane = None
    with suppress(OSError, ValueError, LookupError, TypeError):  # of none, and of other files of that name
        plane = read_json(path.with_name(_SUMMARY))["plane"]
    if not isinstance(plane, str):
        return None
    try:
        parse_crs(plane)
    except RoadError as error:
        msg = f"{_SUMMARY} beside {path.name} names a plane of no use: {error}"
        raise RoadError(msg, hint=f"plan again, or judge the path without that {_SUMMARY}") from error
    return plane


def _brought(into: IntoPlane, points: FloatArray, heading: FloatArray | None) -> tuple[FloatArray, FloatArray | None]:
    """Return points and headings in another plane, whose north is another one."""
    there = into(points)
    if heading is None:
        return there, None
    ahead = into(points + np.column_stack([np.cos(heading), np.sin(heading)])) - there
    turned = np.arctan2(ahead[:, 1], ahead[:, 0])
    return there, turned + 2.0 * np.pi * np.round((heading - turned) / (2.0 * np.pi))


def _line_in(path: Path) -> tuple[dict[str, FloatArray], tuple[str, ...]]:
    """Return the columns lon, lat [deg] of the line in a file that a road may be read from, or x, y [m] where that has none, and notes.

    Raises:
        RoadError: no such line, or more than one.

    """
    try:
        line = find_road(path).line
    except RoadError as error:
        raise RoadError(str(error), hint="keep in the file the one line that is driven, or give columns x, y or lon, lat") from error
    assert line is not None  # noqa: S101 - for the type checker: of a file there is one
    raw, (x, y) = line.raw, line.raw.points.T
    columns = {"x": x, "y": y} if raw.to_lonlat is None else dict(zip(("lon", "lat"), raw.to_lonlat(x, y), strict=True))
    return columns, raw.notes
