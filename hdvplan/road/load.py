"""Load a road: a file, a shipped road, or a scenario, as a reference path with limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import OptionError, RoadError
from hdvplan.road.drawn import drawn_kerbs
from hdvplan.road.features import OPTIONS, Choice, refuse_unheeded, roles_of
from hdvplan.road.given import CORNERS_ASKED, Corners, given_line
from hdvplan.road.library import NOTICE, example_file, example_names, road_file, road_names
from hdvplan.road.limits import Limits
from hdvplan.road.load_csv import has_wkt, read_csv
from hdvplan.road.load_geojson import json_object, read_geojson
from hdvplan.road.load_overpass import read_overpass
from hdvplan.road.load_vector import read_vector
from hdvplan.road.path import from_curvature
from hdvplan.road.raw import RawRoad
from hdvplan.road.road import Road, Smoothing
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.road.steps import MIN_LENGTH_M, refuse_far, refuse_outliers, refuse_sparse
from hdvplan.road.street import About, Kerb
from hdvplan.road.texts import refuse_unreadable, text_of
from hdvplan.road.units import ASKED, UNITS
from hdvplan.spelling import did_you_mean
from hdvplan.texts import printable

LONG_M = 50e3  # from this length on a line is smoothed in windows, and planned in stretches
REFERENCE_SLACK = 1.25  # a balanced lead axle turns wider than the road's centre, which may thus be tighter than its limit
_CLOSED_M = 0.01  # how near the last point must come to the first for a closed road
_CLOSED_TURN = np.deg2rad(100.0)  # a road that returns to its start at a sharper angle merely crosses itself there
_JUMP_M = 1e-6  # a limit's jump takes this long
_TEXTS = {".csv", ".tsv", ".txt", ".dat", ".asc", ""}  # and what these hold is told by their text
_OF_POINTS = "corners", "corner_radius"  # options that say how points are read
_TIGHTEST = 0.5  # smoothing stations 1 m apart cannot represent a radius below 2 m [1/m]


@dataclass(frozen=True)
class RoadOptions:
    """How to read a road file; each has a command-line option of the same name.

    ``smooth`` is the largest allowed deviation from the given line [m], ``crs`` the coordinate reference system of the
    file's coordinates, ``feature`` the name or id of the line, ``layer`` the layer that holds it, ``max_curvature`` the
    tightest reference curvature that the caller's vehicle can follow [1/m]. ``reverse`` drives the line the other way;
    ``offset`` moves the reference to the left of the driving direction [m], such as -1.75 to the middle of the right lane.
    ``roles`` say what layers or features beside the line are, such as ``hoarding=obstacle``. ``road_ids`` are the roads of
    an OpenDRIVE file to drive over, such as ``3,12,-5`` or ``("3", "12", "-5")``, and ``lane`` the lane on the first of them.
    ``unit`` is the unit of coordinates in a plane without a coordinate reference system: mm, cm, m, ft or in. ``corners`` says how points
    are read, see ``Corners``, and ``corner_radius`` rounds the kerbs inside sharp ones [m]; without them the file's properties do.
    """

    smooth: float = 5.0
    crs: str | None = None
    feature: str | None = None
    max_curvature: float = 0.125
    offset: float = 0.0
    reverse: bool = False
    layer: str | None = None
    roles: tuple[str, ...] = ()
    road_ids: str | Sequence[str] | None = None
    lane: int | None = None
    unit: str | None = None
    corners: str | None = None
    corner_radius: float | None = None

    def __post_init__(self) -> None:
        """Refuse values that no road can be read with."""
        if not 0.0 < self.smooth < np.inf:
            msg = f"the allowed deviation must be a positive number of metres, not {self.smooth:g}"
            raise OptionError(msg)
        if not 0.0 < self.max_curvature <= _TIGHTEST:
            msg = f"the largest reference curvature must be positive and at most {_TIGHTEST:g} 1/m, not {self.max_curvature:g}"
            raise OptionError(msg)
        if self.corner_radius is not None and not 0.0 <= self.corner_radius < np.inf:
            msg = f"a corner radius must be a number of metres, not {self.corner_radius:g}"
            raise OptionError(msg)
        if self.corners is not None and self.corners not in list(Corners):
            msg = f"corners are read as {CORNERS_ASKED}, not as {self.corners!r}"
            raise OptionError(msg)
        if not np.isfinite(self.offset):
            msg = f"the offset must be a number of metres, not {self.offset:g}"
            raise OptionError(msg)
        if self.unit is not None and self.unit not in UNITS:
            msg = f"the unit must be {ASKED}, not {self.unit!r}"
            raise OptionError(msg)
        ids = self.road_ids
        one_by_one = isinstance(ids, tuple | list) and len(ids) > 0 and all(isinstance(one, str) for one in ids)
        if not (ids is None or isinstance(ids, str) or one_by_one):
            msg = f"road_ids must be ids of roads as text, not {ids!r}"
            raise OptionError(msg, hint='such as "3,12,-5" or ("3", "12", "-5")')


@dataclass(frozen=True)
class Line:
    """What a file says of a road, and how it shall be read: all that is known before smoothing."""

    name: str
    raw: RawRoad
    options: RoadOptions

    @property
    def long(self) -> bool:
        """Whether it is smoothed in windows, and planned in stretches."""
        points = self.length > LONG_M and not self.raw.is_profile and self.raw.rounded is None
        return points and not is_closed(self.raw.points)

    @property
    def length(self) -> float:
        """Along the given points, or of the profile [m]."""
        steps = np.diff(self.raw.points, axis=0)
        return float(self.raw.points[-1, 0] - self.raw.points[0, 0] if self.raw.is_profile else np.sum(np.hypot(*steps.T)))


@dataclass(frozen=True)
class Found:
    """A road that was found: call it for the road itself, which takes longer. ``line`` is None of a scenario."""

    make: Callable[[], Road]
    options: RoadOptions
    line: Line | None = None

    def __call__(self) -> Road:
        """Return the road in the direction and at the offset at which it is driven."""
        if self.line is not None and self.line.long:
            from hdvplan.road.windows import whole_road  # noqa: PLC0415 - as below

            return whole_road(self.line)
        from hdvplan.road.lane import offset_road, reversed_road  # noqa: PLC0415 - as below

        road = self.make()
        if self.options.reverse:
            road = reversed_road(road)
        return offset_road(road, self.options.offset) if self.options.offset else road


def load_road(source: str | Path, options: RoadOptions = RoadOptions()) -> Road:
    """Return the road in the file ``source``, or the shipped road or scenario of that name; a file wins over a name.

    Raises:
        RoadError: no such file or name, an unusable file, or a line that cannot be smoothed within the options or moved.

    """
    return find_road(source, options)()


def find_road(source: str | Path, options: RoadOptions = RoadOptions()) -> Found:
    """Read what ``load_road`` would load, and return what makes the road of it.

    Raises:
        RoadError: no such file or name, or an unusable file.

    """
    path = Path(source)
    shipped, example = road_file(str(source)), example_file(str(source))
    if path.is_file():
        line = Line(printable(path.stem), _read(path, options), options)
    elif shipped is not None:
        raw = _read(shipped, options)
        line = Line(shipped.stem, replace(raw, notice=raw.notice or NOTICE), options)
    elif example is not None:
        line = Line(example.stem, _read(example, options), options)
    elif str(source) in SCENARIOS:
        refuse_unheeded(f"the scenario {source}", options, *OPTIONS)
        return Found(SCENARIOS[str(source)], options)
    else:
        raise _unknown(source)
    return Found(partial(_road, line), options, line)


def _unknown(source: str | Path) -> RoadError:
    path = Path(source)
    if path.is_dir():
        return RoadError(f"{path} is a folder, not a road file")
    names = [*road_names(), *example_names(), *SCENARIOS]
    otherwise = "give a road file, or a name from `hdvplan roads list`"
    if not path.suffix and len(path.parts) == 1:
        msg = f"no road file, shipped road or scenario is called {str(source)!r}"
        return RoadError(msg, hint=did_you_mean(path.name, names, otherwise))
    beside = [file.name for file in path.parent.iterdir() if file.is_file()] if path.parent.is_dir() else []
    hint = did_you_mean(path.name, beside, did_you_mean(path.stem, names, otherwise))
    return RoadError(f"road file {path} does not exist", hint=hint)


def _read(path: Path, options: RoadOptions) -> RawRoad:
    try:
        refuse_unreadable(path)
        raw = _raw(path, options)
    except OSError as error:
        msg = f"road file {path} cannot be read: {error.strerror or error}"
        raise RoadError(msg) from error
    except RecursionError as error:
        msg = f"{path.name} is nested too deeply"
        raise RoadError(msg) from error
    if not raw.is_profile:
        refuse_far(raw.points, path.name)
        refuse_outliers(raw.points, raw.lines, path.name)
        refuse_sparse(raw.points, path.name, LONG_M)
    return raw


def _raw(path: Path, options: RoadOptions) -> RawRoad:
    """Return what the file says; its name says what kind it is, and where that says nothing, its text."""
    choice = Choice(options.feature, options.layer, roles_of(options.roles))
    suffix, crs = path.suffix.lower(), options.crs
    if suffix == ".xodr":
        from hdvplan.road.load_opendrive import read_opendrive  # noqa: PLC0415 - few files need it

        refuse_unheeded(f"{path.name}: an OpenDRIVE file", options, "crs", "feature", "layer", "roles", "unit", *_OF_POINTS)
        return read_opendrive(path, road_ids=options.road_ids, lane=options.lane)
    if options.road_ids is not None or options.lane is not None:
        msg = f"{path.name} has no road ids and lanes to choose; OpenDRIVE files (.xodr) have"
        raise RoadError(msg)
    if crs is not None:
        refuse_unheeded(f"{path.name}: a file in {crs}", options, "unit")
    text = text_of(path) if suffix in _TEXTS else None
    if suffix in {".json", ".geojson"} or (text is not None and text.lstrip().startswith("{")):
        document = json_object(text or text_of(path), path.name)
        if "elements" in document:
            refuse_unheeded(f"{path.name}: a file of OpenStreetMap", options, "crs", "unit")
            return read_overpass(document, path.name, choice=choice)
        if document.get("type") == "Topology" or "geometryType" in document:
            return read_vector(path, crs=crs, choice=choice, unit=options.unit)
        refuse_unheeded(f"{path.name}: a GeoJSON file, in degrees or a system that it names,", options, "unit")
        return read_geojson(document, path.name, crs=crs, choice=choice)
    if text is None or text.lstrip().startswith("<") or has_wkt(text):
        return read_vector(path, crs=crs, choice=choice, unit=options.unit)
    if options.feature is not None:
        msg = f"{path.name}: a CSV file has no features to choose {options.feature!r} from"
        raise RoadError(msg)
    refuse_unheeded(f"{path.name}: a CSV file", options, "layer", "roles")
    return read_csv(text, path.name, crs=crs, unit=options.unit)


def _road(line: Line) -> Road:
    return smoothed(line)[0]


def smoothed(line: Line) -> tuple[Road, FloatArray]:
    """Return the road of a line as it is drawn, and the arclengths of the line's points on it [m]; direction and offset are not applied.

    Raises:
        RoadError: the line cannot be smoothed within its options, or has widths and edges.

    """
    from hdvplan.road.smooth import smooth_line, smoothing_of  # noqa: PLC0415 - a file is refused without loading SciPy
    from hdvplan.road.through import MAX_LENGTH_M, path_through  # noqa: PLC0415 - as above

    name, raw, options = line.name, line.raw, line.options
    if raw.is_profile:
        refuse_unheeded(f"{name}: a curvature profile", options, *_OF_POINTS)
        s, kappa = raw.points.T
        s = s - s[0]
        if not MIN_LENGTH_M <= s[-1] <= MAX_LENGTH_M:
            msg = f"{name}: the profile is {s[-1]:g} m long; {MIN_LENGTH_M:g} m to {MAX_LENGTH_M / 1e3:g} km can be used"
            raise RoadError(msg)
        return Road(name, from_curvature(s, kappa)).within(_widths(s, raw.reaches)), s
    dense = None if raw.rounded is None else path_through(raw.rounded, options.max_curvature)
    smoothing: Smoothing | None
    if dense is None:
        smooth = smooth_line(raw.points, closed=is_closed(raw.points), max_deviation=options.smooth, max_curvature=options.max_curvature)
        path, smoothing, s_points = smooth.path, smooth.smoothing, smooth.s_points
    else:
        path, s_points = dense
        smoothing = None if raw.rounded is raw.points else smoothing_of(path, raw.points, s_points)
    closed = is_closed(raw.points)
    corners = Corners(options.corners or raw.corners or Corners.AUTO)
    about = About.given(given_line(raw.points, closed=closed, corners=corners), s_points)
    about = replace(about, corners=()) if raw.sides is not None else replace(about, reading=corners)
    radius = raw.corner_radius if options.corner_radius is None else options.corner_radius
    road = Road(name, path, None, smoothing, raw.to_lonlat, raw.notice, raw.regions, notes=raw.notes, about=about, corner_radius=radius)
    if raw.edges:
        if raw.reaches is not None or raw.sides is not None:
            msg = f"{name}: the line has widths, and edges are drawn beside it"
            raise RoadError(msg, hint="keep one of the two: take the widths out of the file, or the edges")
        kerbs, more = drawn_kerbs(path, raw.edges)
        return replace(road, notes=(*road.notes, *(f"{name}: {note}" for note in more))).with_kerbs(kerbs), s_points
    if raw.sides is not None:
        return road.with_kerbs(tuple(Kerb(side, s_points, left) for side, left in zip(raw.sides, (True, False), strict=True))), s_points
    return road.with_widths(_widths(s_points, raw.reaches)), s_points


def is_closed(points: FloatArray) -> bool:
    """Tell whether a line, shape (n, 2) [m], repeats its first point at its end and goes on there without a sharp turn."""
    apart = np.hypot(*(points - points[0]).T) > _CLOSED_M
    if apart[-1] or not np.any(apart):
        return False
    first, last = int(np.argmax(apart)), len(apart) - 1 - int(np.argmax(apart[::-1]))
    leave, arrive = points[first] - points[0], points[-1] - points[last]
    turn = np.arctan2(arrive[0] * leave[1] - arrive[1] * leave[0], arrive @ leave)
    return bool(abs(turn) < _CLOSED_TURN)


def _widths(s: FloatArray, reaches: FloatArray | None) -> Limits | None:
    """Return signed limits at arclengths ``s``, which do not decrease: two points at the same place make a jump."""
    if reaches is None:
        return None
    ends = np.append(np.diff(s) <= 0.0, False)  # of jumps
    nodes = np.maximum.accumulate(s - np.where(ends, _JUMP_M, 0.0))
    left, right, left_sweep, right_sweep = reaches
    return Limits(nodes, left, -right, left_sweep, -right_sweep)
