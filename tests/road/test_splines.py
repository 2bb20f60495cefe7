"""Splines and filters along lines are those of SciPy, which takes longer to load than a plan."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from hdvplan.arrays import FloatArray
from hdvplan.road.splines import Spline, filtered, hermite, largest_around, lost, spline_through

ROUNDING = 1e-11  # of values of some tens, through systems that are diagonally dominant, or nearly
COUNTS = [2, 3, 4, 5, 60]


def line(count: int, *, closed: bool = False) -> tuple[FloatArray, FloatArray]:
    """Return uneven knots (n,) and points (n, 2)."""
    rng = np.random.default_rng(count)
    x, y = np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 2.0, count - 1))]), rng.uniform(-10.0, 10.0, (count, 2))
    if closed:
        y[-1] = y[0]
    return x, y


def check(found: Spline, expected: CubicSpline | CubicHermiteSpline) -> None:
    at = np.linspace(found.x[0] - 0.1, found.x[-1] + 0.1, 301).reshape(7, 43)
    at = np.clip(at, found.x[0], found.x[-1]) if expected.extrapolate == "periodic" else at
    inside = at < found.x[-1]  # where a periodic one begins anew
    for order in range(3):
        np.testing.assert_allclose(found(at, order)[inside], expected(at, order)[inside], rtol=0.0, atol=ROUNDING * 10.0**order)


@pytest.mark.parametrize("count", COUNTS)
def test_an_open_spline_is_that_of_scipy(count: int) -> None:
    x, y = line(count)
    check(spline_through(x, y), CubicSpline(x, y, bc_type="not-a-knot"))


@pytest.mark.parametrize("count", COUNTS)
def test_a_spline_with_given_ends_is_that_of_scipy(count: int) -> None:
    x, y = line(count)
    ends = np.array([1.0, -0.5]), np.array([0.3, 2.0])
    check(spline_through(x, y, ends=ends), CubicSpline(x, y, bc_type=((1, ends[0]), (1, ends[1]))))


@pytest.mark.parametrize("count", COUNTS[2:])
def test_a_closed_spline_is_that_of_scipy(count: int) -> None:
    x, y = line(count, closed=True)
    check(spline_through(x, y, closed=True), CubicSpline(x, y, bc_type="periodic"))


def test_a_curve_with_given_slopes_is_that_of_scipy() -> None:
    x, y = line(20)
    check(hermite(x, y[:, 0], y[:, 1]), CubicHermiteSpline(x, y[:, 0], y[:, 1]))


@pytest.mark.parametrize("sigma", [0.4, 1.0, 7.3])
def test_filters_are_those_of_scipy(sigma: float) -> None:
    _, y = line(90)
    inner = slice(lost(sigma), len(y) - lost(sigma))
    np.testing.assert_allclose(filtered(y, sigma, closed=True), gaussian_filter1d(y, sigma, axis=0, mode="wrap"), rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(filtered(y, sigma, closed=False), gaussian_filter1d(y, sigma, axis=0)[inner], rtol=0.0, atol=ROUNDING)
    np.testing.assert_array_equal(largest_around(y[:, 0], 10, closed=True), maximum_filter1d(y[:, 0], 21, mode="wrap"))
    np.testing.assert_array_equal(largest_around(y[:, 0], 10, closed=False), maximum_filter1d(y[:, 0], 21, mode="nearest"))
