"""From raw map vertices to a reference path: as near to them as a bounded, continuous curvature allows.

Map lines are polylines, and a polyline has no curvature. Gaussian filters and unconstrained splines cut corners by an
amount that nobody chose, so the line is found by optimisation instead: a quadratic program over the offsets from a
base line (``offsets.py``), solved again on its own result until the offsets vanish (sequential convex programming).
What it minimises is a smoothing spline's trade of fit against change of curvature, which leaves straights and arcs
where they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from hdvplan.arrays import FloatArray, carried, chord_of, turns_of
from hdvplan.errors import ProjectionError, RoadError
from hdvplan.road.checks import BACK, MIN_LENGTH_M
from hdvplan.road.offsets import Stations, program_of, solve_offsets
from hdvplan.road.path import KNOT_SPACING_M, ReferencePath, from_samples
from hdvplan.road.road import Smoothing
from hdvplan.road.splines import (
    FEWEST_CELLS,
    check_length,
    densified,
    equal_arclengths,
    path_through,
    pursued,
    shares,
    smoothing_lengths,
    spline_through,
    vertex_of,
)

_DEVIATIONS_M = (5.0, 10.0, 20.0)  # that are tried one after the other where nobody says how far a line may be moved
_DRIVEN_SHARE, _DRIVEN_EXCESS = 0.9, 1.5  # of the curvature: of a drive along a line, and where two are made one or moved to an end
_STATION_M = 1.0  # the unknown offsets stand this far apart: a spline knot a metre holds a radius of 8 m to 0.2 %
_WIDEST_SIGMA_M = 10.0  # of the Gaussian that makes the first line; else as wide as the tightest radius
_SETTLED_M = 0.01  # size of the offsets at which the base line is its own solution
_SLOWEST = 1e-3  # of a line by the length of its chords; of a bend it is about 1
_ENOUGH_ROUNDS = 10  # where both bounds leave next to no choice, the line may creep along; then keeping them will do
_MAX_ROUNDS = 40
_BOUND_SHARE = 0.995  # of both bounds goes into the program: between stations the line exceeds it by less than the rest
_CURVATURE_EXCESS = 1.005  # accepted on the final line
_SLACK_M = 1e-3  # of the deviation bound
_SMALLEST_SHARE = 0.125  # of the offsets that a round may go, once whole steps do not settle
_LARGEST_TURN = 0.5  # offsets times curvature in one round; at 1 the offset line would fold
_BLAME_M = 20.0  # from the largest deviation to the corner that causes it
_MARGIN_M = 10.0  # a datum's foot may lie beyond the ends while the line still moves


@dataclass(frozen=True)
class SmoothedLine:
    """A reference path, what it cost in deviation, and the arclengths of the given points on it, shape (points,) [m]."""

    path: ReferencePath
    smoothing: Smoothing
    s_points: FloatArray


@dataclass(frozen=True)
class _Line:
    """A C2 spline through stations at equal arclengths."""

    spline: CubicSpline[np.float64]
    stations: Stations

    def path(self) -> ReferencePath:
        """Return the spline itself as a path's table, with the fourth and fifth powers zero, extended at the ends."""
        table = np.zeros((self.spline.c.shape[1], 12))
        table[:, 0:4], table[:, 6:10] = self.spline.c[::-1, :, 0].T, self.spline.c[::-1, :, 1].T
        stations = self.stations
        path = ReferencePath(table, 0.0, stations.spacing, stations.length, stations.closed)
        return path.extended(_MARGIN_M, _MARGIN_M)


def smooth_line(
    points: FloatArray, *, closed: bool, max_deviation: float | None, max_curvature: float, shortest: float = MIN_LENGTH_M
) -> SmoothedLine:
    """Return the smoothest path within ``max_deviation`` [m] of a polyline and with |curvature| <= ``max_curvature`` [1/m].

    ``points`` has shape (n, 2) [m]; a closed line repeats its first point at the end. An open path starts and ends
    exactly in the given end points. A line that is shorter than ``shortest`` [m] is refused. The deviation is measured from the
    given points and from the polyline between them; it holds to 1 mm, the curvature to 1 %. None: 5 m, or as much as it takes where
    the line turns more tightly than that; an open one that nothing smooths is driven along then, as one drives a narrow hairpin.

    Raises:
        RoadError: the line is too short or too long, turns back on itself, or has a corner that cannot be rounded
            within the deviation.

    """
    check_length(float(chord_of(points)[-1]), shortest)
    if max_deviation is not None:
        return _within(points, closed=closed, max_deviation=max_deviation, max_curvature=max_curvature)
    for bound in _DEVIATIONS_M:
        try:
            return _within(points, closed=closed, max_deviation=bound, max_curvature=max_curvature)
        except RoadError as error:
            refusal = error
    found = None if closed else _driven_along(points, max_curvature)
    if found is None:
        raise refusal
    return found


def _within(points: FloatArray, *, closed: bool, max_deviation: float, max_curvature: float) -> SmoothedLine:
    kept, vertex = np.unique(vertex_of(points), return_inverse=True)
    vertices = points[kept]
    if closed:
        vertices[-1] = vertices[0]
    chord = chord_of(vertices)
    u = densified(chord)
    data = np.stack([np.interp(u, chord, column) for column in vertices.T], axis=1)
    line, s = _first_line(data, u, min(1.0 / max_curvature, _WIDEST_SIGMA_M), closed=closed)
    try:
        weights = shares(u) / smoothing_lengths(vertices, chord, u, closed=closed) ** 6
        line, s, e = _settled(line, data, u, weights, s, max_deviation, max_curvature)
        path = _finished(line)
        s, e = path.extended(_MARGIN_M, _MARGIN_M).project(data[:, 0], data[:, 1], s * (path.length / line.stations.length))
    except ProjectionError as error:
        raise _turned_back(error.s_m) from error
    s = np.maximum.accumulate(np.clip(s, 0.0, path.length))
    smoothing = _smoothing(path, s, e, shares(u), len(points), len(points) - len(kept))
    return SmoothedLine(path, smoothing, np.interp(chord, u, s)[vertex])


def _driven_along(points: FloatArray, max_curvature: float) -> SmoothedLine | None:
    """Return the path of a drive along an open line; None where the line turns back at a point, or that is tighter than it may be."""
    kept, vertex = np.unique(vertex_of(points), return_inverse=True)
    vertices = points[kept]
    if np.min(turns_of(vertices), initial=1.0) < BACK:
        return None
    for driven, along in pursued(vertices, _DRIVEN_SHARE * max_curvature):
        found = path_through(driven, _DRIVEN_EXCESS * max_curvature)
        if found is not None:
            path, s_driven = found
            s = np.interp(chord_of(vertices), along, s_driven)
            here = path.at(s)
            apart = np.hypot(here.x - vertices[:, 0], here.y - vertices[:, 1])
            return SmoothedLine(path, _smoothing(path, s, apart, np.ones(len(s)), len(points), len(points) - len(kept)), s[vertex])
    return None


def smoothing_of(path: ReferencePath, points: FloatArray, near: FloatArray) -> Smoothing:
    """Return how far ``path`` lies from ``points``, shape (n, 2) [m], whose arclengths are about ``near`` [m]."""
    s, e = path.extended(_MARGIN_M, _MARGIN_M).project(points[:, 0], points[:, 1], near)
    return _smoothing(path, np.clip(s, 0.0, path.length), e, np.ones(len(points)), len(points), 0)


def _smoothing(path: ReferencePath, s: FloatArray, e: FloatArray, weights: FloatArray, points: int, duplicates: int) -> Smoothing:
    fine = np.linspace(0.0, path.length, 4 * len(path.coefficients) + 1)
    curvature = np.abs(path.at(fine).curvature)
    farthest, tightest = int(np.argmax(np.abs(e))), int(np.argmax(curvature))
    return Smoothing(
        points=points,
        duplicates=duplicates,
        max_deviation=float(abs(e[farthest])),
        max_deviation_s=float(s[farthest]),
        rms_deviation=float(np.sqrt(np.average(e**2, weights=weights))),
        max_curvature=float(curvature[tightest]),
        max_curvature_s=float(fine[tightest]),
    )


def _first_line(data: FloatArray, u: FloatArray, sigma: float, *, closed: bool) -> tuple[_Line, FloatArray]:
    """Return the Gaussian-filtered line and roughly the data's arclengths on it."""
    cells = max(FEWEST_CELLS, round(float(u[-1]) / _STATION_M))
    uniform = np.linspace(0.0, float(u[-1]), cells + 1)
    raw = np.stack([np.interp(uniform, u, column) for column in data.T], axis=1)
    sigma /= float(uniform[1])
    if closed:
        lap = gaussian_filter1d(raw[:-1], sigma, axis=0, mode="wrap")
        filtered = np.vstack([lap, lap[:1]])
    else:  # reflecting in the end points keeps them where they are, and a straight end straight
        reach = int(np.ceil(4.0 * sigma))
        padded = np.pad(raw, ((reach, reach), (0, 0)), mode="reflect", reflect_type="odd")
        filtered = gaussian_filter1d(padded, sigma, axis=0)[reach:-reach]
        filtered[[0, -1]] = raw[[0, -1]]
    line, s = _resampled(filtered, _STATION_M, closed=closed)
    return line, np.interp(u, uniform, s)


def _turned_back(s: float | None) -> RoadError:
    msg = f"the line turns back on itself near s = {s:z.0f} m"
    return RoadError(msg, s_m=s, hint="remove the points that go back, or cut the road there")


def _resampled(points: FloatArray, spacing: float, *, closed: bool) -> tuple[_Line, FloatArray]:
    """Return the spline through ``points`` with stations at equal arclengths, and the arclengths of the points."""
    chord = chord_of(points)
    if not np.all(np.diff(chord) > _SETTLED_M):
        raise _turned_back(float(chord[np.argmin(np.diff(chord))]))
    spline = spline_through(chord, points, closed=closed)
    speed = np.hypot(*spline(chord, 1).T)  # by the chord's length: 0 where it goes straight back
    if not np.all(speed > _SLOWEST):
        raise _turned_back(float(chord[np.argmin(speed)]))
    parameters, s = equal_arclengths(spline, spacing)
    stations = spline(parameters)
    stations[-1] = stations[0] if closed else points[-1]
    cells = len(parameters) - 1
    line = spline_through(np.linspace(0.0, float(s[-1]), cells + 1), stations, closed=closed)
    return _Line(line, Stations(cells if closed else cells + 1, float(s[-1]) / cells, closed)), s


def _settled(
    line: _Line, data: FloatArray, u: FloatArray, weights: FloatArray, s: FloatArray, max_deviation: float, max_curvature: float
) -> tuple[_Line, FloatArray, FloatArray]:
    """Move the line by the program's offsets until they vanish; also return the data's arclengths and offsets.

    ``u`` are the data's arclengths on the given line: a refusal names the place there, where the user can find it.
    """
    inner_deviation = _BOUND_SHARE * max_deviation
    share, largest = 1.0, np.inf
    needs: list[float] = []
    for number in range(_MAX_ROUNDS):
        stations, path = line.stations, line.path()
        s, e = path.project(data[:, 0], data[:, 1], np.clip(s, path.s_first, path.s_last))
        here = path.at(stations.s)
        between = path.at(np.linspace(0.0, stations.length, 4 * stations.count)).curvature
        bounded = np.max(np.abs(between)) <= _CURVATURE_EXCESS * max_curvature
        near = np.max(np.abs(e)) <= max_deviation + _SLACK_M
        if bounded and near and (largest < _SETTLED_M or number >= _ENOUGH_ROUNDS):
            return line, s, e
        program = program_of(
            stations, here.curvature, s, e, weights, max_deviation=inner_deviation, max_curvature=_BOUND_SHARE * max_curvature
        )
        solution = solve_offsets(program)
        if solution is None:
            break
        offsets, missing = solution
        needs = [*needs[-2:], missing]
        if min(needs) > _SLACK_M and len(needs) == 3 and np.ptp(needs) < _SLACK_M:  # noqa: PLR2004
            raise _sharp_corner(_corner(data, u, e), max_deviation, (inner_deviation + missing) / _BOUND_SHARE, max_curvature)
        largest_before, largest = largest, float(np.max(np.abs(offsets)))
        if largest > (1.0 - 0.25 * share) * largest_before:  # tight bounds can make whole steps swing to and fro
            share = max(0.5 * share, _SMALLEST_SHARE)
        turn = float(np.max(np.abs(here.curvature * offsets)))
        x, y = path.to_plane(stations.s, min(share, _LARGEST_TURN / max(turn, _LARGEST_TURN)) * offsets)
        moved, s_old = np.stack([x, y], axis=1), stations.s
        if stations.closed:
            moved, s_old = np.vstack([moved, moved[:1]]), np.append(s_old, stations.length)
        line, s_new = _resampled(moved, _STATION_M, closed=stations.closed)
        s = carried(s, s_old, s_new)
    at = _corner(data, u, e)
    msg = f"no line found within {max_deviation:.2f} m of the points near s = {at:z.0f} m with a radius of {1 / max_curvature:.1f} m"
    raise RoadError(msg, s_m=at, hint="allow more with --smooth, or remove the points that make the line turn so sharply")


def _corner(data: FloatArray, u: FloatArray, e: FloatArray) -> float:
    """Return where on the given line [m] the sharpest turn is near the datum of the largest deviation: the one to blame."""
    ahead = np.diff(data, axis=0)
    turn = np.arctan2(ahead[:-1, 0] * ahead[1:, 1] - ahead[:-1, 1] * ahead[1:, 0], np.sum(ahead[:-1] * ahead[1:], axis=1))
    near = np.abs(u - u[np.argmax(np.abs(e))]) <= _BLAME_M
    return float(u[np.argmax(np.where(near, np.pad(np.abs(turn), 1), -1.0))])


def _sharp_corner(at: float, max_deviation: float, needed: float, max_curvature: float) -> RoadError:
    msg = (
        f"the corner at s = {at:z.0f} m cannot be rounded to a radius of {1 / max_curvature:.1f} m"
        f" within {max_deviation:.2f} m; it needs {needed:.2f} m"
    )
    return RoadError(msg, s_m=at, hint=f"--smooth {np.ceil(10.0 * needed + 0.1) / 10.0:.1f}")


def _finished(line: _Line) -> ReferencePath:
    """Return the line at the usual knot spacing, every sample from its one spline."""
    parameters, s = equal_arclengths(line.spline, KNOT_SPACING_M)
    here = line.path().at(parameters)
    spacing = float(s[-1]) / (len(parameters) - 1)
    return from_samples(here.x, here.y, here.heading, here.curvature, spacing, closed=line.stations.closed)
