"""The papers' roads: they turn by what they should, within the published lengths and limits."""

from __future__ import annotations

import numpy as np
import pytest

from hdvplan.errors import OptionError
from hdvplan.road.scenarios import Profile, roundabout, sturn_profile, turn_profile, uturn, uturn_articulated, uturn_profile


def turned(profile: Profile) -> float:
    s, kappa = map(np.array, profile)
    return float(np.sum(0.5 * (kappa[1:] + kappa[:-1]) * np.diff(s)))


def test_the_bus_uturn_is_the_one_of_the_paper() -> None:
    s, kappa = uturn_profile()
    lengths = np.diff(s)
    assert turned((s, kappa)) == pytest.approx(np.pi, abs=1e-12)
    assert lengths[2] == pytest.approx(31.5, abs=0.1)  # read off the figure to a decimetre
    limits = uturn().limits
    assert limits is not None
    assert (limits.left[0], limits.right[0]) == (3.0, -3.0)


def test_the_articulated_uturn_fills_the_published_horizon() -> None:
    road = uturn_articulated()
    assert road.path.length == pytest.approx(134.2, abs=1e-9)
    assert road.limits is None
    assert float(road.path.at(65.0).curvature) == pytest.approx(0.065, abs=1e-9)


def test_the_roundabout_has_the_published_pieces() -> None:
    road = roundabout()
    assert road.path.length == pytest.approx(50 + 5.5 + 135 + 5.5 + 50, abs=1e-9)
    assert float(road.path.at(120.0).curvature) == pytest.approx(1.0 / 17.88, abs=1e-9)
    assert road.limits is not None
    assert road.limits.left[0] == 3.56


@pytest.mark.parametrize("curvature", [0.02, 0.1, -0.06])
@pytest.mark.parametrize("sharpness", [0.002, 0.02])
def test_an_sturn_ends_in_its_first_direction(curvature: float, sharpness: float) -> None:
    s, kappa = sturn_profile(curvature, sharpness)
    assert turned((s, kappa)) == pytest.approx(0.0, abs=1e-12)
    assert np.max(np.abs(np.diff(kappa) / np.diff(s))) == pytest.approx(sharpness)
    assert np.max(np.abs(kappa)) == pytest.approx(abs(curvature))


def test_pieces_of_no_length_are_left_out() -> None:
    s, _ = turn_profile(0.05, 10.0, 0.0, lead_in=0.0, lead_out=0.0)
    np.testing.assert_allclose(s, [0.0, 10.0, 20.0])


def test_impossible_profiles_are_refused() -> None:
    with pytest.raises(OptionError, match="cannot be made of pieces"):
        uturn_profile(0.060, 60.0)
    with pytest.raises(OptionError, match="pieces of 50, 0, 10, 0, 50 m"):
        turn_profile(0.05, 0.0, 10.0)
    with pytest.raises(OptionError, match="sharpness"):
        sturn_profile(0.05, 0.0)
