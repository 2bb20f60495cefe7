"""Roots of rising functions and running extremes, against scipy's search and windows cut out one by one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import elementwise

from hdvplan.arrays import FloatArray, running
from hdvplan.centring.stationary import find_roots
from tests.core.chains import few

SHARES = st.lists(st.floats(0.001, 0.999), min_size=1, max_size=9)


@pytest.mark.parametrize(
    ("name", "low", "high"), [("sinh", -3.0, 2.0), ("arctan", -0.5, 900.0), ("exp", -30.0, 5.0), ("cbrt", -1.0, 8.0), ("arcsin", -1.0, 1.0)]
)
@given(shares=SHARES)
@few
def test_roots_are_those_that_scipy_finds(name: str, low: float, high: float, shares: list[float]) -> None:
    function = getattr(np, name)
    wanted = function(low) + np.array(shares) * (function(high) - function(low))
    ends = np.full_like(wanted, low), np.full_like(wanted, high)

    def excess(x: FloatArray, wanted: FloatArray) -> FloatArray:
        left: FloatArray = function(x) - wanted
        return left

    expected = elementwise.find_root(excess, ends, args=(wanted,), tolerances={"xrtol": 1e-15}).x
    # compared as values, which are up to 150 and good to some roundings: where a function is flat its root is not well known
    assert np.allclose(function(find_roots(lambda x: function(x) - wanted, *ends)), function(expected), rtol=0.0, atol=2e-13)


def test_few_evaluations_find_many_roots() -> None:
    wanted, seen = np.linspace(0.01, 0.99, 1000), []

    def excess(x: FloatArray) -> FloatArray:
        seen.append(x)
        left: FloatArray = x**3 - wanted
        return left

    found = find_roots(excess, np.zeros(1000), np.ones(1000))
    assert np.allclose(found, np.cbrt(wanted), rtol=1e-14, atol=0.0)  # rounding
    assert len(seen) < 30  # bisection needs 50


def test_a_root_at_an_end_is_found_and_without_one_the_nearer_end_is_given() -> None:
    ends = np.zeros(4), np.ones(4)
    found = find_roots(lambda x: x - np.array([0.0, 1.0, -2.0, 3.0]), *ends)
    assert np.array_equal(found, [0.0, 1.0, 0.0, 1.0])


@pytest.mark.parametrize("pick", [np.minimum, np.maximum])
@given(count=st.integers(1, 40), behind=st.integers(0, 60), ahead=st.integers(0, 60), seed=st.integers(0, 10**6))
@few
def test_extremes_are_those_of_the_window(pick: np.ufunc, count: int, behind: int, ahead: int, seed: int) -> None:
    values = np.random.default_rng(seed).uniform(-1.0, 1.0, (2, count))
    values[1, count // 2] = np.inf
    extreme = np.min if pick is np.minimum else np.max
    expected = [[extreme(row[max(i - behind, 0) : i + ahead + 1]) for i in range(count)] for row in values]
    assert np.array_equal(running(pick, values, behind, ahead), expected)
