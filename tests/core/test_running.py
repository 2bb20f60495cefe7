"""Running extremes, against windows cut out one by one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.arrays import running
from tests.core.chains import few


@pytest.mark.parametrize("pick", [np.minimum, np.maximum])
@given(count=st.integers(1, 40), behind=st.integers(0, 60), ahead=st.integers(0, 60), seed=st.integers(0, 10**6))
@few
def test_extremes_are_those_of_the_window(pick: np.ufunc, count: int, behind: int, ahead: int, seed: int) -> None:
    values = np.random.default_rng(seed).uniform(-1.0, 1.0, (2, count))
    values[1, count // 2] = np.inf
    extreme = np.min if pick is np.minimum else np.max
    expected = [[extreme(row[max(i - behind, 0) : i + ahead + 1]) for i in range(count)] for row in values]
    assert np.array_equal(running(pick, values, behind, ahead), expected)
