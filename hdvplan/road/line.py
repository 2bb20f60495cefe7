"""What a road file says, the options it is read with, and the road that smoothing makes of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError
from hdvplan.road.about import About
from hdvplan.road.checks import MAX_LENGTH_M, MIN_LENGTH_M
from hdvplan.road.drawn import drawn_kerbs
from hdvplan.road.given import given_line
from hdvplan.road.limits import Limits
from hdvplan.road.options import OF_POINTS, Corners, RoadOptions, refuse_unheeded
from hdvplan.road.path import from_curvature
from hdvplan.road.pieces import Kerb
from hdvplan.road.road import Road, Smoothing

if TYPE_CHECKING:
    from hdvplan.road.crs import ToLonLat
    from hdvplan.road.regions import Region

LONG_M = 50e3  # from this length on a line is smoothed in windows, and planned piece by piece
_CLOSED_M = 0.01  # how near the last point must come to the first for a closed road
_CLOSED_TURN = np.deg2rad(100.0)  # a road that returns to its start at a sharper angle merely crosses itself there
_JUMP_M = 1e-6  # a limit's jump takes this long


@dataclass(frozen=True)
class RawRoad:
    """A road as given: ``points`` of shape (n, 2) are x, y [m], or s [m], kappa [1/m] when ``is_profile``.

    ``reaches`` are the widths at the points, shape (4, n): left, right, left_sweep, right_sweep, all positive [m]. Or
    ``sides`` are the edges left and right of each point, shape (2, n, 2), or ``edges`` lines somewhere beside the road, each of
    shape (m, 2), x, y [m], called ``edge_names``. ``lines`` are the lines of the points in their file, where it has some; ``notes``
    what the reader has to say to the user. ``rounded`` are the points moved as little as it takes for a line without gaps and
    kinks, where that is known: it needs no smoothing. ``corners`` says how the points are read, where the file does, see
    ``Corners``, and ``corner_radius`` rounds the kerbs inside sharp ones [m]. ``legs`` are what a drive forwards and backwards is
    made of, in its order: ``points`` are then those of all.
    """

    points: FloatArray
    reaches: FloatArray | None = None
    is_profile: bool = False
    to_lonlat: ToLonLat | None = None
    notice: str | None = None
    regions: tuple[Region, ...] = ()
    edges: tuple[FloatArray, ...] = ()
    edge_names: tuple[str, ...] = ()
    sides: FloatArray | None = None
    lines: tuple[int, ...] | None = None
    notes: tuple[str, ...] = ()
    rounded: FloatArray | None = None
    corners: str | None = None
    corner_radius: float = 0.0
    legs: tuple[RawLeg, ...] = ()


@dataclass(frozen=True)
class RawLeg:
    """A leg as given: its line is drawn in the order of driving, also where it is driven ``backward``."""

    raw: RawRoad
    backward: bool


@dataclass(frozen=True)
class Line:
    """What a file says of a road, and how it shall be read: all that is known before smoothing.

    Raises:
        RoadError: a curvature profile that is too short or too long.

    """

    name: str
    raw: RawRoad
    options: RoadOptions

    def __post_init__(self) -> None:
        """Refuse a profile that no road can be made of."""
        if self.raw.is_profile and not MIN_LENGTH_M <= self.length <= MAX_LENGTH_M:
            msg = f"{self.name}: the profile is {self.length:g} m long; {MIN_LENGTH_M:g} m to {MAX_LENGTH_M / 1e3:g} km can be used"
            raise RoadError(msg)

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


def noted_again(road: Road, raw: RawRoad) -> Road:
    """Return the road, which is driven the other way than its line was drawn, with notes on edges as it is driven."""
    return replace(road, notes=_notes(raw, road.name, drawn_kerbs(road.path, raw.edges)[2])) if raw.edges else road


def _notes(raw: RawRoad, name: str, of_edges: tuple[str, ...]) -> tuple[str, ...]:
    return (*raw.notes, *(f"{name}: {note}" for note in of_edges))


def smoothed(line: Line, shortest: float = MIN_LENGTH_M) -> tuple[Road, FloatArray]:
    """Return the road of a line as it is drawn, and the arclengths of the line's points on it [m]; direction and offset are not applied.

    Raises:
        RoadError: the line cannot be smoothed within its options, is shorter than ``shortest`` [m], or has widths and edges.

    """
    name, raw, options = line.name, line.raw, line.options
    if raw.is_profile:
        refuse_unheeded(f"{name}: a curvature profile", options, *OF_POINTS)
        s, kappa = raw.points.T
        s = s - s[0]
        return Road(name, from_curvature(s, kappa)).within(_widths(s, raw.reaches)), s
    from hdvplan.road.smooth import smooth_line, smoothing_of  # noqa: PLC0415 - curvature profiles, and refusals, need no SciPy
    from hdvplan.road.splines import path_through  # noqa: PLC0415 - as above

    dense = None if raw.rounded is None else path_through(raw.rounded, options.max_curvature)
    smoothing: Smoothing | None
    if dense is None:
        bound, most = options.smooth, options.max_curvature
        smooth = smooth_line(raw.points, closed=is_closed(raw.points), max_deviation=bound, max_curvature=most, shortest=shortest)
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
        kerbs, undrawn, more = drawn_kerbs(path, raw.edges, about)
        return replace(road, notes=_notes(raw, name, more), bridges=undrawn).with_kerbs(kerbs), s_points
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
