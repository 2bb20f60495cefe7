"""Cubic splines and filters along lines, in a few lines: scipy.interpolate and scipy.ndimage take 0.4 s to load."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded

from hdvplan.arrays import FloatArray, running

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)
FEWEST_CELLS = 8  # of a very short road
_CUT = 4.0  # standard deviations from which on a Gaussian is nothing


@dataclass(frozen=True)
class Spline:
    """A curve of cubics between knots ``x`` (n,): ``c`` (4, n - 1, ...) are the factors of the powers from each knot on, highest first."""

    x: FloatArray
    c: FloatArray

    def __call__(self, at: FloatArray, order: int = 0) -> FloatArray:
        """Return the values at parameters ``at``, or the derivatives of order 1 or 2; beyond the ends their cubics go on."""
        number = np.clip(np.searchsorted(self.x, at, side="right") - 1, 0, len(self.x) - 2)
        left = (at - self.x[number]).reshape(*np.shape(at), *(1,) * (self.c.ndim - 2))
        a, b, c, d = self.c
        if order == 0:
            return np.asarray(((a[number] * left + b[number]) * left + c[number]) * left + d[number])
        if order == 1:
            return np.asarray((3.0 * a[number] * left + 2.0 * b[number]) * left + c[number])
        return np.asarray(6.0 * a[number] * left + 2.0 * b[number])


def hermite(x: FloatArray, y: FloatArray, slopes: FloatArray) -> Spline:
    """Return the curve through values ``y`` (n, ...) at knots ``x`` (n,), with these slopes (n, ...)."""
    step = np.diff(x).reshape(-1, *(1,) * (y.ndim - 1))
    chord = np.diff(y, axis=0) / step
    bend = (slopes[:-1] + slopes[1:] - 2.0 * chord) / step
    return Spline(x, np.stack([bend / step, (chord - slopes[:-1]) / step - bend, slopes[:-1], y[:-1]]))


def spline_through(x: FloatArray, y: FloatArray, *, closed: bool = False, ends: tuple[FloatArray, FloatArray] | None = None) -> Spline:
    """Return the curve through values ``y`` (n, k) at knots ``x`` (n,) whose first and second derivatives do not jump.

    A closed one ends as it begins; ``ends`` are the slopes at the ends (k,); else the first two cubics are one, and the last two.
    """
    step = np.diff(x)
    chord = np.diff(y, axis=0) / step[:, None]
    if len(x) == 2 and ends is None:  # noqa: PLR2004 - knots of a straight line
        return hermite(x, y, np.repeat(chord, 2, axis=0))
    if len(x) == 3 and ends is None and not closed:  # noqa: PLR2004 - knots of a parabola
        bend = (chord[1] - chord[0]) / (x[2] - x[0])
        return hermite(x, y, np.stack([chord[0] - bend * step[0], chord[0] + bend * step[0], chord[1] + bend * step[1]]))
    if closed:
        return hermite(x, y, _slopes_of_closed(step, chord))
    bands, given = np.zeros((3, len(x))), np.zeros_like(y)
    bands[0, 2:], bands[1, 1:-1], bands[2, :-2] = step[:-1], 2.0 * (step[:-1] + step[1:]), step[1:]
    given[1:-1] = 3.0 * (step[1:, None] * chord[:-1] + step[:-1, None] * chord[1:])
    if ends is not None:
        bands[1, [0, -1]] = 1.0
        given[0], given[-1] = ends
    else:
        for end, near, beyond, band in ((0, 0, 1, 0), (-1, -1, -2, 2)):
            both = step[near] + step[beyond]
            bands[1, end], bands[band, 1 if end == 0 else -2] = step[beyond], both
            given[end] = ((step[near] + 2.0 * both) * step[beyond] * chord[near] + step[near] ** 2 * chord[beyond]) / both
    return hermite(x, y, solve_banded((1, 1), bands, given))


def _slopes_of_closed(step: FloatArray, chord: FloatArray) -> FloatArray:
    """Return the slopes at the knots of a closed curve: a cyclic system, as one in bands and a correction of rank one."""
    before, count = np.roll(step, 1), len(step)
    given = 3.0 * (step[:, None] * np.roll(chord, 1, axis=0) + before[:, None] * chord)
    bands = np.zeros((3, count))
    bands[0, 1:], bands[1], bands[2, :-1] = before[:-1], 2.0 * (before + step), step[1:]
    corner = -bands[1, 0]  # any number that leaves the bands regular
    across, along = np.zeros(count), np.zeros(count)
    across[0], across[-1], along[0], along[-1] = corner, before[-1], 1.0, step[0] / corner
    bands[1, 0] -= corner
    bands[1, -1] -= before[-1] * step[0] / corner
    found = solve_banded((1, 1), bands, np.column_stack([given, across]))
    moved, unit = found[:, :-1], found[:, -1]
    slopes = moved - np.outer(unit, along @ moved / (1.0 + along @ unit))
    return np.concatenate([slopes, slopes[:1]])


def equal_arclengths(spline: Spline, spacing: float) -> tuple[FloatArray, FloatArray]:
    """Return a plane spline's parameters at equal arclengths of about ``spacing``, and the arclengths of its knots [m]."""
    half = 0.5 * np.diff(spline.x)
    left, (a, b, c, _) = (half[:, None] * (_NODES + 1.0))[..., None], spline.c[:, :, None]
    velocity = (3.0 * a * left + 2.0 * b) * left + c
    s = np.concatenate([[0.0], np.cumsum(np.hypot(velocity[..., 0], velocity[..., 1]) @ _WEIGHTS * half)])
    uniform = np.linspace(0.0, float(s[-1]), max(FEWEST_CELLS, round(float(s[-1]) / spacing)) + 1)
    inverse = hermite(s, spline.x, 1.0 / np.hypot(*spline(spline.x, 1).T))
    return np.clip(inverse(uniform), 0.0, spline.x[-1]), s


def filtered(values: FloatArray, sigma: float, *, closed: bool) -> FloatArray:
    """Return values (n, k) filtered by a Gaussian of ``sigma`` values; an open line loses some at its ends, see ``lost``."""
    reach = lost(sigma)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    weights /= np.sum(weights)
    if closed:
        values = values[np.arange(-reach, len(values) + reach) % len(values)]
    return np.stack([np.convolve(column, weights, mode="valid") for column in values.T], axis=1)


def lost(sigma: float) -> int:
    """Return how many values a Gaussian of ``sigma`` values reaches to either side."""
    return int(_CUT * sigma + 0.5)


def largest_around(values: FloatArray, reach: int, *, closed: bool) -> FloatArray:
    """Return the largest of each value (n,) and its neighbours, ``reach`` to either side."""
    if not closed:
        return running(np.maximum, values, reach, reach)
    around = values[np.arange(-reach, len(values) + reach) % len(values)]
    return running(np.maximum, around, reach, reach)[reach : len(values) + reach]
