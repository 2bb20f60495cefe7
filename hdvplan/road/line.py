"""What a road file says, the options it is read with, and the road that smoothing makes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import OptionError, RoadError
from hdvplan.lengths import METRES
from hdvplan.road.checks import ASKED, MIN_LENGTH_M
from hdvplan.road.drawn import drawn_kerbs
from hdvplan.road.features import refuse_unheeded
from hdvplan.road.given import CORNERS_ASKED, Corners, given_line
from hdvplan.road.limits import Limits
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road, Smoothing
from hdvplan.road.street import About, Kerb

if TYPE_CHECKING:
    from hdvplan.road.crs import ToLonLat
    from hdvplan.road.regions import Region

LONG_M = 50e3  # from this length on a line is smoothed in windows, and planned piece by piece
OF_POINTS = "corners", "corner_radius"  # options that say how points are read
_CLOSED_M = 0.01  # how near the last point must come to the first for a closed road
_CLOSED_TURN = np.deg2rad(100.0)  # a road that returns to its start at a sharper angle merely crosses itself there
_JUMP_M = 1e-6  # a limit's jump takes this long
_TIGHTEST = 0.5  # smoothing stations 1 m apart cannot represent a radius below 2 m [1/m]


@dataclass(frozen=True)
class RawRoad:
    """A road as given: ``points`` of shape (n, 2) are x, y [m], or s [m], kappa [1/m] when ``is_profile``.

    ``reaches`` are the widths at the points, shape (4, n): left, right, left_sweep, right_sweep, all positive [m]. Or
    ``sides`` are the edges left and right of each point, shape (2, n, 2), or ``edges`` lines somewhere beside the road, each of
    shape (m, 2), x, y [m]. ``lines`` are the lines of the points in their file, where it has some; ``notes`` what the reader
    has to say to the user. ``rounded`` are the points moved as little as it takes for a line without gaps and kinks, where
    that is known: it needs no smoothing. ``corners`` says how the points are read, where the file does, see ``Corners``, and
    ``corner_radius`` rounds the kerbs inside sharp ones [m].
    """

    points: FloatArray
    reaches: FloatArray | None = None
    is_profile: bool = False
    to_lonlat: ToLonLat | None = None
    notice: str | None = None
    regions: tuple[Region, ...] = ()
    edges: tuple[FloatArray, ...] = ()
    sides: FloatArray | None = None
    lines: tuple[int, ...] | None = None
    notes: tuple[str, ...] = ()
    rounded: FloatArray | None = None
    corners: str | None = None
    corner_radius: float = 0.0


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
        if self.unit is not None and self.unit not in METRES:
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
        """Whether it is planned piece by piece."""
        return self.length > LONG_M and (self.raw.is_profile or not is_closed(self.raw.points))

    @property
    def windowed(self) -> bool:
        """Whether it is smoothed in windows."""
        return self.long and not self.raw.is_profile and self.raw.rounded is None

    @property
    def length(self) -> float:
        """Along the given points, or of the profile [m]."""
        steps = np.diff(self.raw.points, axis=0)
        return float(self.raw.points[-1, 0] - self.raw.points[0, 0] if self.raw.is_profile else np.sum(np.hypot(*steps.T)))


def smoothed(line: Line) -> tuple[Road, FloatArray]:
    """Return the road of a line as it is drawn, and the arclengths of the line's points on it [m]; direction and offset are not applied.

    Raises:
        RoadError: the line cannot be smoothed within its options, or has widths and edges.

    """
    from hdvplan.road.smooth import MAX_LENGTH_M, path_through, smooth_line, smoothing_of  # noqa: PLC0415 - a file is refused without loading SciPy  # noqa: PLC0415 - as above

    name, raw, options = line.name, line.raw, line.options
    if raw.is_profile:
        refuse_unheeded(f"{name}: a curvature profile", options, *OF_POINTS)
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
