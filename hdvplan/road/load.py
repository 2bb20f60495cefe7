"""Load a road: a file, a shipped road, or a scenario, as a reference path with limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hdvplan.errors import OptionError, RoadError, did_you_mean
from hdvplan.jit import FloatArray
from hdvplan.road.library import NOTICE, example_file, example_names, road_file, road_names
from hdvplan.road.load_csv import read_csv
from hdvplan.road.load_geojson import read_geojson
from hdvplan.road.raw import RawRoad
from hdvplan.road.scenarios import SCENARIOS

if TYPE_CHECKING:  # a file is read, and refused, without the kernels that smooth it
    from hdvplan.road.road import Limits, Road

_CLOSED_M = 0.01  # how near the last point must come to the first for a closed road
_CLOSED_TURN = np.deg2rad(100.0)  # a road that returns to its start at a sharper angle merely crosses itself there
_JUMP_M = 1e-6  # a limit's jump takes this long
_TIGHTEST = 0.5  # smoothing stations 1 m apart cannot represent a radius below 2 m [1/m]


@dataclass(frozen=True)
class RoadOptions:
    """How to read a road file; each has a command-line option of the same name.

    ``smooth`` is the largest allowed deviation from the given line [m], ``crs`` the coordinate reference system of the
    file's coordinates, ``feature`` the name or id of the GeoJSON feature, ``max_curvature`` the tightest reference
    curvature that the caller's vehicle can follow [1/m]. ``reverse`` drives the line the other way; ``offset`` moves the
    reference to the left of the driving direction [m], such as -1.75 to the middle of the right lane.
    """

    smooth: float = 5.0
    crs: str | None = None
    feature: str | None = None
    max_curvature: float = 0.125
    offset: float = 0.0
    reverse: bool = False

    def __post_init__(self) -> None:
        """Refuse values that no road can be read with."""
        if not 0.0 < self.smooth < np.inf:
            msg = f"the allowed deviation must be a positive number of metres, not {self.smooth:g}"
            raise OptionError(msg)
        if not 0.0 < self.max_curvature <= _TIGHTEST:
            msg = f"the largest reference curvature must be positive and at most {_TIGHTEST:g} 1/m, not {self.max_curvature:g}"
            raise OptionError(msg)
        if not np.isfinite(self.offset):
            msg = f"the offset must be a number of metres, not {self.offset:g}"
            raise OptionError(msg)


def load_road(source: str | Path, options: RoadOptions = RoadOptions()) -> Road:
    """Return the road in the file ``source``, or the shipped road or scenario of that name; a file wins over a name.

    Raises:
        RoadError: no such file or name, an unusable file, or a line that cannot be smoothed within the options or moved.

    """
    return find_road(source, options)()


def find_road(source: str | Path, options: RoadOptions = RoadOptions()) -> Callable[[], Road]:
    """Read what ``load_road`` would load, and return what makes the road of it: that takes longer.

    Raises:
        RoadError: no such file or name, or an unusable file.

    """
    path = Path(source)
    shipped, example = road_file(str(source)), example_file(str(source))
    if path.is_file():
        make: Callable[[], Road] = partial(_road, path.stem, _read(path, options), options)
    elif shipped is not None:
        raw = _read(shipped, options)
        make = partial(_road, shipped.stem, replace(raw, notice=raw.notice or NOTICE), options)
    elif example is not None:
        make = partial(_road, example.stem, _read(example, options), options)
    elif str(source) in SCENARIOS:
        make = SCENARIOS[str(source)]
    else:
        raise _unknown(source)
    return partial(_driven, make, options)


def _driven(make: Callable[[], Road], options: RoadOptions) -> Road:
    """Return the road in the direction and at the offset at which it is driven."""
    from hdvplan.road.lane import offset_road, reversed_road  # noqa: PLC0415 - see above

    road = make()
    if options.reverse:
        road = reversed_road(road)
    return offset_road(road, options.offset) if options.offset else road


def _unknown(source: str | Path) -> RoadError:
    path = Path(source)
    if path.is_dir():
        return RoadError(f"{path} is a folder, not a road file")
    if path.suffix or len(path.parts) > 1:
        msg = f"road file {path} does not exist"
    else:
        msg = f"no road file, shipped road or scenario is called {str(source)!r}"
    names = (*road_names(), *example_names(), *SCENARIOS)
    otherwise = "give a .csv or .geojson file, or a name from `hdvplan roads list`"
    return RoadError(msg, hint=did_you_mean(path.stem, names, otherwise, most=3))


def _read(path: Path, options: RoadOptions) -> RawRoad:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        msg = f"road file {path} cannot be read: {error}"
        raise RoadError(msg) from error
    suffix = path.suffix.lower()
    if suffix in {".geojson", ".json"} or (suffix != ".csv" and text.lstrip().startswith("{")):
        return read_geojson(text, path.name, crs=options.crs, feature=options.feature)
    if options.feature is not None:
        msg = f"{path.name}: a CSV file has no features to choose {options.feature!r} from"
        raise RoadError(msg)
    return read_csv(text, path.name, crs=options.crs)


def _road(name: str, raw: RawRoad, options: RoadOptions) -> Road:
    from hdvplan.road.path import from_curvature  # noqa: PLC0415 - see above
    from hdvplan.road.road import Road  # noqa: PLC0415 - see above
    from hdvplan.road.smooth import MAX_LENGTH_M, MIN_LENGTH_M, smooth_line  # noqa: PLC0415 - see above

    if raw.is_profile:
        s, kappa = raw.points.T
        s = s - s[0]
        if not MIN_LENGTH_M <= s[-1] <= MAX_LENGTH_M:
            msg = f"{name}: the profile is {s[-1]:g} m long; {MIN_LENGTH_M:g} m to {MAX_LENGTH_M / 1e3:g} km can be used"
            raise RoadError(msg)
        return Road(name, from_curvature(s, kappa), _limits(s, raw.reaches))
    line = smooth_line(raw.points, closed=is_closed(raw.points), max_deviation=options.smooth, max_curvature=options.max_curvature)
    road = Road(name, line.path, None, line.smoothing, raw.to_lonlat, raw.notice, raw.regions)
    return road.within(_limits(line.s_points, raw.reaches))


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
    """Return signed limits at arclengths ``s``, which do not decrease: two points at the same place make a jump.

    Next to a jump, or a change steeper than 45 degrees, the narrower value holds ``TABLE_M`` further: tables of the limits
    are linear between their entries.
    """
    from hdvplan.road.regions import TABLE_M  # noqa: PLC0415 - see above
    from hdvplan.road.road import Limits  # noqa: PLC0415 - see above

    if reaches is None:
        return None
    first = np.append(True, np.diff(s) > 0.0)
    last = np.append(np.diff(s) > 0.0, True)
    ends, before, after = s[first], reaches[:, first], reaches[:, last]
    steep = np.flatnonzero(np.any(np.abs(before[:, 1:] - after[:, :-1]) > np.diff(ends), axis=0))
    stretches = [(ends[i], ends[i + 1], np.minimum(after[:, i], before[:, i + 1])) for i in steep]
    stretches += [(ends[i], ends[i], np.minimum(before[:, i], after[:, i])) for i in np.flatnonzero(np.any(before != after, axis=0))]
    edges = [edge + sign * (TABLE_M + out) for lo, hi, _ in stretches for edge, sign in ((lo, -1.0), (hi, 1.0)) for out in (0.0, _JUMP_M)]
    nodes = np.unique(np.concatenate([ends, [edge for edge in edges if ends[0] < edge < ends[-1]]]))
    table = np.stack([_between(nodes, ends, low, high) for low, high in zip(before, after, strict=True)])
    for lo, hi, narrow in stretches:
        held = (nodes >= lo - TABLE_M) & (nodes <= hi + TABLE_M)
        table[:, held] = np.minimum(table[:, held], narrow[:, None])
    left, right, left_sweep, right_sweep = table
    return Limits(nodes, left, -right, left_sweep, -right_sweep)


def _between(nodes: FloatArray, ends: FloatArray, before: FloatArray, after: FloatArray) -> FloatArray:
    """Return values at ``nodes``, linear from ``after`` one end to ``before`` the next; at an end the value before it."""
    cell = np.clip(np.searchsorted(ends, nodes, side="left") - 1, 0, len(ends) - 2)
    part = (nodes - ends[cell]) / (ends[cell + 1] - ends[cell])
    values: FloatArray = (1.0 - part) * after[cell] + part * before[cell + 1]
    return values
