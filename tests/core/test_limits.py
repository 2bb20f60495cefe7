import numpy as np
import pytest

from hdvplan.errors import OptionError, RoadError
from hdvplan.jit import FloatArray
from hdvplan.road.road import Limits

S = np.array([0.0, 10.0, 30.0])
WIDE = np.array([3.0, 2.5, 3.0])


def test_limits_are_linear_between_and_held_beyond() -> None:
    table = Limits(S, WIDE, -WIDE, WIDE + 1.0, -WIDE - 0.5).table(np.array([-5.0, 5.0, 10.0, 20.0, 99.0]))
    reach = np.array([3.0, 2.75, 2.5, 2.75, 3.0])
    assert np.allclose(table, [reach, -reach, reach + 1.0, -reach - 0.5], rtol=0.0, atol=1e-12)


def changed(values: FloatArray, by: float) -> FloatArray:
    out = values.copy()
    out[1] += by
    return out


@pytest.mark.parametrize(
    ("left", "right", "left_sweep", "right_sweep", "word"),
    [
        (WIDE, -WIDE, changed(WIDE, -0.1), -WIDE, "less room than wheels on the left"),
        (WIDE, -WIDE, WIDE, changed(-WIDE, 0.1), "less room than wheels on the right"),
    ],
)
def test_limits_that_contradict_each_other_are_refused_with_their_place(
    left: FloatArray, right: FloatArray, left_sweep: FloatArray, right_sweep: FloatArray, word: str
) -> None:
    with pytest.raises(RoadError, match=word) as caught:
        Limits(S, left, right, left_sweep, right_sweep)
    assert caught.value.s_m == 10.0


@pytest.mark.parametrize(
    ("left", "right", "side"), [(0.0, 3.0, "left"), (np.nan, 3.0, "left"), (3.0, -2.0, "right"), (3.0, np.inf, "right")]
)
def test_a_constant_limit_is_a_positive_number_of_metres(left: float, right: float, side: str) -> None:
    with pytest.raises(OptionError, match=f"the {side} limit"):
        Limits.constant(left, right, 100.0)
