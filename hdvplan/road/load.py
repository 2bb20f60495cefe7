"""Load a road: a file, a shipped road, or a scenario, as a reference path with limits."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hdvplan.errors import OptionError, RoadError
from hdvplan.jit import FloatArray
from hdvplan.road.library import NOTICE, road_file, road_names
from hdvplan.road.load_csv import read_csv
from hdvplan.road.load_geojson import read_geojson
from hdvplan.road.path import from_curvature
from hdvplan.road.raw import RawRoad
from hdvplan.road.road import Limits, Road
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.road.smooth import MAX_LENGTH_M, MIN_LENGTH_M, smooth_line

_CLOSED_M = 0.01  # how near the last point must come to the first for a closed road
_CLOSED_TURN = np.deg2rad(100.0)  # a road that returns to its start at a sharper angle merely crosses itself there
_TIGHTEST = 0.5  # smoothing stations 1 m apart cannot represent a radius below 2 m [1/m]


@dataclass(frozen=True)
class RoadOptions:
    """How to read a road file; each has a command-line option of the same name.

    ``smooth`` is the largest allowed deviation from the given line [m], ``crs`` the coordinate reference system of the
    file's coordinates, ``feature`` the name or id of the GeoJSON feature, ``max_curvature`` the tightest reference
    curvature that the caller's vehicle can follow [1/m].
    """

    smooth: float = 5.0
    crs: str | None = None
    feature: str | None = None
    max_curvature: float = 0.125

    def __post_init__(self) -> None:
        """Refuse values that no road can be read with."""
        if not 0.0 < self.smooth < np.inf:
            msg = f"the allowed deviation must be a positive number of metres, not {self.smooth:g}"
            raise OptionError(msg)
        if not 0.0 < self.max_curvature <= _TIGHTEST:
            msg = f"the largest reference curvature must be positive and at most {_TIGHTEST:g} 1/m, not {self.max_curvature:g}"
            raise OptionError(msg)


def load_road(source: str | Path, options: RoadOptions = RoadOptions()) -> Road:
    """Return the road in the file ``source``, or the shipped road or scenario of that name; a file wins over a name.

    Raises:
        RoadError: no such file or name, an unusable file, or a line that cannot be smoothed within the options.

    """
    path = Path(source)
    if path.is_file():
        return _read(path, options)
    shipped = road_file(str(source))
    if shipped is not None:
        road = _read(shipped, options)
        return road if road.notice else Road(road.name, road.path, road.limits, road.smoothing, road.to_lonlat, NOTICE)
    if str(source) in SCENARIOS:
        return SCENARIOS[str(source)]()
    raise _unknown(source)


def _unknown(source: str | Path) -> RoadError:
    path = Path(source)
    if path.is_dir():
        return RoadError(f"{path} is a folder, not a road file")
    names = [*road_names(), *SCENARIOS]
    close = difflib.get_close_matches(str(source), names, n=3, cutoff=0.5)
    if path.suffix or len(path.parts) > 1:
        close = close or difflib.get_close_matches(path.stem, names, n=3, cutoff=0.5)
        msg = f"road file {path} does not exist"
    else:
        msg = f"no road file, shipped road or scenario is called {str(source)!r}"
    hint = f"did you mean {' or '.join(close)}?" if close else "give a .csv or .geojson file, or a name from `hdvplan roads list`"
    return RoadError(msg, hint=hint)


def _read(path: Path, options: RoadOptions) -> Road:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        msg = f"road file {path} cannot be read: {error}"
        raise RoadError(msg) from error
    suffix = path.suffix.lower()
    if suffix in {".geojson", ".json"} or (suffix != ".csv" and text.lstrip().startswith("{")):
        raw = read_geojson(text, path.name, crs=options.crs, feature=options.feature)
    else:
        if options.feature is not None:
            msg = f"{path.name}: a CSV file has no features to choose {options.feature!r} from"
            raise RoadError(msg)
        raw = read_csv(text, path.name, crs=options.crs)
    return _road(path.stem, raw, options)


def _road(name: str, raw: RawRoad, options: RoadOptions) -> Road:
    if raw.is_profile:
        s, kappa = raw.points.T
        s = s - s[0]
        if not MIN_LENGTH_M <= s[-1] <= MAX_LENGTH_M:
            msg = f"{name}: the profile is {s[-1]:g} m long; {MIN_LENGTH_M:g} m to {MAX_LENGTH_M / 1e3:g} km can be used"
            raise RoadError(msg)
        return Road(name, from_curvature(s, kappa), _limits(s, raw.reaches))
    line = smooth_line(raw.points, closed=is_closed(raw.points), max_deviation=options.smooth, max_curvature=options.max_curvature)
    return Road(name, line.path, _limits(line.s_points, raw.reaches), line.smoothing, raw.to_lonlat, raw.notice)


def is_closed(points: FloatArray) -> bool:
    """Tell whether a line, shape (n, 2) [m], repeats its first point at its end and goes on there without a sharp turn."""
    apart = np.hypot(*(points - points[0]).T) > _CLOSED_M
    if apart[-1] or not np.any(apart):
        return False
    first, last = int(np.argmax(apart)), len(apart) - 1 - int(np.argmax(apart[::-1]))
    leave, arrive = points[first] - points[0], points[-1] - points[last]
    turn = np.arctan2(arrive[0] * leave[1] - arrive[1] * leave[0], arrive @ leave)
    return bool(abs(turn) < _CLOSED_TURN)


def _limits(s: FloatArray, reaches: FloatArray | None) -> Limits | None:
    """Return signed limits at increasing arclengths; points that share an arclength keep the first one's."""
    if reaches is None:
        return None
    keep = np.append(True, np.diff(s) > 0.0)
    left, right, left_sweep, right_sweep = reaches[:, keep]
    return Limits(s[keep], left, -right, left_sweep, -right_sweep)
