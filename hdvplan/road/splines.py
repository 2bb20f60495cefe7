"""Splines through the points of lines, and what is at equal distances along them."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from hdvplan.arrays import FloatArray, chord_of
from hdvplan.errors import RoadError
from hdvplan.road.checks import MAX_LENGTH_M, MIN_LENGTH_M
from hdvplan.road.path import ReferencePath, from_samples

FEWEST_CELLS = 8  # of a very short road
_EXACT_M = 0.25  # knots of a line that is not smoothed
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)


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


def carried(at: FloatArray, s: FloatArray, along: FloatArray) -> FloatArray:
    """Return arclengths ``at`` of a line on a moved one, on which its ``s`` are ``along``; beyond the ends both run alike [m]."""
    inside = np.clip(at, s[0], s[-1])
    return np.interp(inside, s, along) + (at - inside)


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
    parameters, s = equal_arclengths(spline, _EXACT_M)
    (x, y), (dx, dy), (ddx, ddy) = (spline(parameters, order).T for order in range(3))
    curvature = (dx * ddy - dy * ddx) / np.hypot(dx, dy) ** 3
    if np.max(np.abs(curvature)) > max_curvature:
        return None
    path = from_samples(x, y, np.arctan2(dy, dx), curvature, float(s[-1]) / (len(parameters) - 1))
    return path, np.interp(chord, chord[kept], s)
