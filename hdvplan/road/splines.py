"""Splines through the points of lines, and what is at equal distances along them."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from scipy.ndimage import maximum_filter1d

from hdvplan.arrays import FloatArray, IntArray, chord_of
from hdvplan.errors import RoadError
from hdvplan.road.checks import MAX_LENGTH_M, MIN_LENGTH_M
from hdvplan.road.path import ReferencePath, from_samples

FEWEST_CELLS = 8  # of a very short road
_EXACT_M = 0.25  # knots of a line that is not smoothed
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_STEP_M = 0.5
_AHEAD = 0.8  # of the tightest radius, along the line, lies the point that is driven to
_LEAST = 0.1  # of a step, that a drive comes on along the line: so it does not go round a point for ever
_MOST = 2.0  # steps that it comes on: the line may come by again
_BLEND_M = 40.0  # before its end, over which a drive is moved to the end of the line
_DUPLICATE_M = 0.02
_DENSE_M = 1.0  # longer segments of the given line are sampled: the points between are as good as the given ones
_SPACING_SHARE = 1.25  # smoothing length over the points' spacing
_LONGEST_M = 5.0  # smoothing length, and
_ROUGH_M = 1.0  # the third difference of positions from which on it is used


def check_length(length: float, shortest: float = MIN_LENGTH_M) -> None:
    """Refuse a road that is shorter than ``shortest``, or too long [m].

    Raises:
        RoadError: it is one of them.

    """
    if length < shortest:
        msg = f"the road is {length:.2f} m long; at least {shortest:g} m are needed"
        raise RoadError(msg)
    if length > MAX_LENGTH_M:
        msg = f"the road is {length / 1e3:.0f} km long; at most {MAX_LENGTH_M / 1e3:.0f} km can be smoothed at once"
        raise RoadError(msg, hint="are the coordinates metres? otherwise cut the road into parts")


def spline_through(knots: FloatArray, points: FloatArray, *, closed: bool) -> CubicSpline[np.float64]:
    """Return the spline through ``points``, shape (n, 2) [m], at ``knots``; a closed one is periodic."""
    return CubicSpline(knots, points, bc_type="periodic") if closed else CubicSpline(knots, points, bc_type="not-a-knot")


def equal_arclengths(spline: CubicSpline[np.float64], spacing: float) -> tuple[FloatArray, FloatArray]:
    """Return a plane spline's parameters at equal arclengths of about ``spacing``, and the arclengths of its knots [m]."""
    half = 0.5 * np.diff(spline.x)
    velocity = spline(spline.x[:-1, None] + half[:, None] * (_NODES + 1.0), 1)
    s = np.concatenate([[0.0], np.cumsum(np.hypot(velocity[..., 0], velocity[..., 1]) @ _WEIGHTS * half)])
    uniform = np.linspace(0.0, float(s[-1]), max(FEWEST_CELLS, round(float(s[-1]) / spacing)) + 1)
    inverse = CubicHermiteSpline(s, spline.x, 1.0 / np.hypot(*spline(spline.x, 1).T))
    return np.clip(inverse(uniform), 0.0, spline.x[-1]), s


def path_through(points: FloatArray, max_curvature: float) -> tuple[ReferencePath, FloatArray] | None:
    """Return the path through dense points of a line without kinks, which stays where it is, and their arclengths on it.

    ``points`` has shape (n, 2) [m]. None: somewhere the line is tighter than ``max_curvature`` [1/m].

    Raises:
        RoadError: the line is too short or too long.

    """
    chord = chord_of(points)
    check_length(float(chord[-1]))
    kept = np.unique(np.append(np.searchsorted(chord, np.arange(0.0, chord[-1] - 0.5 * _EXACT_M, _EXACT_M)), len(points) - 1))
    spline = spline_through(chord[kept], points[kept], closed=False)
    path, s, tightest = path_along(spline, _EXACT_M)
    return None if tightest > max_curvature else (path, np.interp(chord, chord[kept], s))


def path_along(spline: CubicSpline[np.float64], spacing: float) -> tuple[ReferencePath, FloatArray, float]:
    """Return the path along an open plane spline, the arclengths of its knots [m], and the largest curvature of the path's knots [1/m]."""
    parameters, s = equal_arclengths(spline, spacing)
    (x, y), (dx, dy), (ddx, ddy) = (spline(parameters, order).T for order in range(3))
    curvature = (dx * ddy - dy * ddx) / np.hypot(dx, dy) ** 3
    path = from_samples(x, y, np.arctan2(dy, dx), curvature, float(s[-1]) / (len(parameters) - 1))
    return path, s, float(np.max(np.abs(curvature)))


def pursued(points: FloatArray, curvature: float) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the points of drives (m, 2) [m] along an open line of ``points`` (n, 2) [m], and how far along the line each is (m,) [m].

    A drive swings out behind a hairpin. So the first is the mean of one from either end, which swings out half as far before and behind
    it, and is the same line from either end. It may be too tight where hairpins follow each other closely. The other one drives from the
    start. Each ends where the line does.
    """
    there, back = _drive(points, curvature), _drive(points[::-1], curvature)[::-1]
    back[:, 2] = chord_of(points)[-1] - back[:, 2]
    share = np.linspace(0.0, 1.0, max(len(there), len(back)))
    mean = 0.5 * (_on(there, np.linspace(0.0, 1.0, len(there)), share) + _on(back, np.linspace(0.0, 1.0, len(back)), share))
    for drive in (mean, there):
        yield drive[:, :2], drive[:, 2]


def _drive(points: FloatArray, curvature: float) -> FloatArray:
    """Return the points of a drive from an open line's start, and how far along the line each is, (m, 3) [m].

    It turns with at most ``curvature`` [1/m], but for its last metres, over which it is moved to the end of the line.
    """
    along, ahead = chord_of(points), _AHEAD / curvature
    beyond = points[-1] + 2.0 * ahead * (points[-1] - points[-2]) / np.hypot(*(points[-1] - points[-2]))
    longer, s = np.vstack([points, beyond]), np.append(along, along[-1] + 2.0 * ahead)
    steps = _STEP_M * np.linspace(_LEAST, _MOST, 20)
    place, heading, at = points[0], math.atan2(*(points[1] - points[0])[::-1]), 0.0
    driven, passed = [place], [at]
    while at < along[-1]:
        to = _on(longer, s, at + ahead) - place
        turn = math.remainder(math.atan2(to[1], to[0]) - heading, 2.0 * math.pi)
        bend = 2.0 * math.sin(turn) / max(math.hypot(*to), _STEP_M) if abs(turn) < 0.5 * math.pi else math.copysign(curvature, turn)
        bend = min(max(bend, -curvature), curvature)
        middle = heading + 0.5 * _STEP_M * bend
        place, heading = place + _STEP_M * np.array([math.cos(middle), math.sin(middle)]), heading + _STEP_M * bend
        near = np.argmin(np.hypot(*(_on(longer, s, at + steps) - place).T)) if abs(turn) < 0.5 * math.pi else 0
        at += float(steps[near])
        driven.append(place)
        passed.append(at)
    left = np.clip(_STEP_M * np.arange(len(driven))[::-1] / min(_BLEND_M, 0.5 * _STEP_M * len(driven)), 0.0, 1.0)
    moved = np.array(driven) + (1.0 - left**3 * (10.0 - 15.0 * left + 6.0 * left**2))[:, None] * (points[-1] - driven[-1])
    return np.column_stack([moved, np.minimum(passed, along[-1] - 1e-9 * np.arange(len(passed))[::-1])])


def _on(points: FloatArray, along: FloatArray, at: FloatArray | float) -> FloatArray:
    """Return the columns of ``points`` (n, k), which lie at ``along`` (n,), in between, (..., k)."""
    return np.stack([np.interp(at, along, column) for column in points.T], axis=-1)


def vertex_of(points: FloatArray) -> IntArray:
    """Map near-duplicates to their representative: return for each point its own number, or that of the one that replaces it.

    The end point always represents itself.
    """
    stands = np.zeros(len(points), dtype=np.int64)
    places = points.tolist()
    last = 0
    for i, place in enumerate(places):
        last = i if math.dist(place, places[last]) >= _DUPLICATE_M else last
        stands[i] = last
    if last > 0:
        stands[stands == last] = len(points) - 1
    return stands


def densified(chord: FloatArray) -> FloatArray:
    """Return chord lengths no further apart than ``_DENSE_M`` that include the given ones."""
    pieces = np.maximum(1, np.ceil(np.diff(chord) / _DENSE_M - 0.01))
    number = np.concatenate([[0.0], np.cumsum(pieces)])
    return np.asarray(np.interp(np.arange(number[-1] + 1.0), number, chord))


def shares(u: FloatArray) -> FloatArray:
    """Return the length of line that each sample stands for [m]."""
    half = 0.5 * np.diff(u)
    return np.asarray(np.append(half, 0.0) + np.append(0.0, half))


def smoothing_lengths(vertices: FloatArray, chord: FloatArray, u: FloatArray, *, closed: bool) -> FloatArray:
    """Return the length below which features are smoothed away at each datum [m].

    It follows what the points can tell: their spacing, and the cube root of their positions' third difference (a change
    of curvature over a step, or noise). Dense smooth input is so left alone, and bare map corners are rounded widely.
    """
    spacing = np.diff(chord)
    ahead = np.diff(vertices, axis=0)
    if closed:
        spacing, ahead = np.concatenate([spacing[-2:], spacing, spacing[:2]]), np.concatenate([ahead[-2:], ahead, ahead[:2]])
    turn = np.arctan2(ahead[:-1, 0] * ahead[1:, 1] - ahead[:-1, 1] * ahead[1:, 0], np.sum(ahead[:-1] * ahead[1:], axis=1))
    turn = np.concatenate([turn[:1], turn, turn[-1:]]) if turn.size else np.zeros(2)
    third = spacing * np.abs(np.diff(turn))
    ell = np.clip(np.maximum(_SPACING_SHARE * spacing, np.cbrt(third / _ROUGH_M) * _LONGEST_M), _SPACING_SHARE, _LONGEST_M)
    if closed:
        ell = ell[2:-2]
    segment = np.clip(np.searchsorted(chord, u, side="right") - 1, 0, len(ell) - 1)
    reach = int(2.0 * _LONGEST_M / _DENSE_M)
    return maximum_filter1d(ell[segment], 2 * reach + 1, mode="wrap" if closed else "nearest")
