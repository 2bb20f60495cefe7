"""What a road file says, the options it is read with, and the road that smoothing makes of it; that road driven beside it, or back.

Edges and regions stay where they are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError
from hdvplan.road.checks import MAX_LENGTH_M, MIN_LENGTH_M
from hdvplan.road.drawn import drawn_kerbs
from hdvplan.road.given import given_line
from hdvplan.road.limits import About, Limits
from hdvplan.road.options import OF_POINTS, Corners, RoadOptions, refuse_unheeded
from hdvplan.road.path import from_curvature
from hdvplan.road.pieces import Kerb
from hdvplan.road.road import Road, Smoothing

if TYPE_CHECKING:
    from hdvplan.road.crs import ToLonLat
    from hdvplan.road.regions import Region
from hdvplan.arrays import carried
from hdvplan.road.path import ReferencePath, from_samples

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


_TIGHTEST = 0.5  # of the moved line [1/m]; at the centre of curvature it would be infinite
_SPACING_M = 0.25  # of the moved line's knots, before stretching


def reversed_road(road: Road) -> Road:
    """Return the road driven the other way: s runs from its end, left and right change sides."""
    path, length = road.path, road.path.length
    s = path.spacing * np.arange(round(length / path.spacing), -1.0, -1.0)
    here = path.at(s)
    turned = from_samples(here.x, here.y, here.heading + np.pi, -here.curvature, path.spacing, closed=path.closed)
    limits, smoothing = road.limits, road.smoothing
    if limits is not None:
        limits = Limits(
            *(column[::-1] for column in (length - limits.s, -limits.right, -limits.left, -limits.right_sweep, -limits.left_sweep))
        )
    if smoothing is not None:
        deviation, curvature = length - smoothing.max_deviation_s, length - smoothing.max_curvature_s
        smoothing = replace(smoothing, max_deviation_s=deviation, max_curvature_s=curvature)
    about = None if road.about is None else road.about.reversed(length)
    drawn = None if road.drawn is None else tuple(kerb.reversed(length) for kerb in road.drawn)
    return replace(road, path=turned, smoothing=smoothing, about=about).within(limits, drawn, road.bridges)


def offset_road(road: Road, offset: float) -> Road:
    """Return the road with its reference moved by ``offset`` [m], left positive; the limits' edges stay in the plane.

    Arclength shrinks on the inside of bends: d s' = (1 - offset k) ds, so s' = s - offset (psi(s) - psi(0)). The moved
    line's curvature, k / (1 - offset k), is as continuous as the drawn one's.

    Raises:
        RoadError: the moved line reaches, or comes within 2 m of, the drawn one's centre of curvature; or a limit that the
            road file gives lies on the wrong side of the moved line.

    """
    path = road.path
    s = np.linspace(0.0, path.length, max(2, int(np.ceil(path.length / _SPACING_M))) + 1)
    here = path.at(s)
    stretch = 1.0 - offset * here.curvature
    bad = (stretch <= 0.0) | (np.abs(here.curvature) > _TIGHTEST * stretch)
    if np.any(bad):
        at = float(s[np.argmin(np.where(bad, stretch, np.inf))])
        radius = 1.0 / abs(float(path.at(at).curvature))
        msg = f"an offset of {offset:g} m comes too near the centre of the bend at s = {at:z.1f} m, whose radius is {radius:.2f} m"
        raise RoadError(msg, s_m=at, hint="choose a smaller --offset, or allow a wider bend with --smooth")
    along = s - offset * (np.unwrap(here.heading) - here.heading[0])
    moved = _moved(path, offset, s, along)
    limits, smoothing = road.limits, road.smoothing
    if limits is not None:
        columns = (limits.left, limits.right, limits.left_sweep, limits.right_sweep)
        nodes = np.union1d(limits.s, s[[0, -1]])  # enough: limits are linear in s, and s' is linear where the road is not bent
        nodes = np.union1d(nodes, s[np.abs(here.curvature) > 0.0]) if any(np.ptp(column) > 0.0 for column in columns) else nodes
        limits = Limits(np.interp(nodes, s, along), *(np.interp(nodes, limits.s, column) - offset for column in columns))
        _refuse_outside(limits, offset)
    if smoothing is not None:
        curvature = np.abs(here.curvature / stretch)
        tightest = int(np.argmax(curvature))
        there = float(np.interp(smoothing.max_deviation_s, s, along))
        smoothing = replace(
            smoothing, max_deviation_s=there, max_curvature=float(curvature[tightest]), max_curvature_s=float(along[tightest])
        )
    about, drawn = road.about, road.drawn
    if about is not None:
        corners = tuple(one._replace(s=float(np.interp(one.s, s, along))) for one in about.corners)
        about = replace(about, s=np.interp(about.s, s, along), offset=about.offset + offset, corners=corners)
    if drawn is not None:
        drawn = tuple(replace(kerb, s=carried(kerb.s, s, along)) for kerb in drawn)
    return replace(road, path=moved, smoothing=smoothing, about=about).within(limits, drawn, road.bridges)


def _refuse_outside(limits: Limits, offset: float) -> None:
    for beyond, side in ((limits.left <= 0.0, "left"), (limits.right >= 0.0, "right")):
        if np.any(beyond):
            at = float(limits.s[np.argmax(beyond)])
            msg = f"an offset of {offset:g} m lies beyond the road's own {side} limit at s = {at:z.1f} m"
            raise RoadError(msg, s_m=at, hint="choose a smaller --offset; left is positive")


def _moved(path: ReferencePath, offset: float, s: FloatArray, along: FloatArray) -> ReferencePath:
    """Return the parallel line, with knots at equal arclengths; ``along`` are its arclengths at ``s``."""
    length = float(along[-1])
    knots = np.linspace(0.0, length, max(2, int(np.ceil(length / path.spacing))) + 1)
    at = np.clip(np.interp(knots, along, s), 0.0, path.length)
    turned = np.unwrap(path.at(s).heading)
    for _ in range(3):  # Newton: interpolation is good to 1e-4 m already
        here = path.at(at)
        heading = here.heading + 2.0 * np.pi * np.round((np.interp(at, s, turned) - here.heading) / (2.0 * np.pi))
        at = np.clip(at + (knots - (at - offset * (heading - turned[0]))) / (1.0 - offset * here.curvature), 0.0, path.length)
    here = path.at(at)
    x, y = path.to_plane(at, offset)
    return from_samples(x, y, here.heading, here.curvature / (1.0 - offset * here.curvature), float(knots[1]), closed=path.closed)
