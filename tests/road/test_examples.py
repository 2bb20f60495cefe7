"""The made-up places: what their files promise."""

from __future__ import annotations

import numpy as np
import pytest

from hdvplan.judging.fit import Trouble, fit_of
from hdvplan.legs import load_legs
from hdvplan.road.load import load_road
from hdvplan.road.scenarios import shipped
from hdvplan.vehicle.load import load_vehicle

BUS = load_vehicle("bus")
LEGS = ("side_street", "three_point_turn")


def test_every_example_loads_with_its_regions_and_says_that_it_is_none_of_osm() -> None:
    assert list(shipped("examples")) == [
        "kerb_bend", "kerb_bend_wall", "parked_van", "parked_van_tight", "side_street", "street_corner", "three_point_turn",
    ]  # fmt: skip
    for name in shipped("examples"):
        road = load_legs(name).legs[0].road if name in LEGS else load_road(name)
        assert road.regions
        assert road.notice is None
        assert road.to_lonlat is not None


@pytest.mark.parametrize(("name", "spare"), [("parked_van", 0.15), ("parked_van_tight", -0.15)])
def test_the_van_reaches_half_a_metre_over_the_lane_s_centre_and_leaves_the_passage(name: str, spare: float) -> None:
    limits = load_road(name).passable
    assert limits is not None
    left, right, _, _ = limits.table(np.array([80.0]))
    assert float(right[0]) == pytest.approx(0.5, abs=1e-3)  # nine decimals of a degree are 0.1 mm
    assert float(left[0] - right[0]) == pytest.approx(BUS.width + spare, abs=1e-3)


def test_geometry_tells_the_passages_apart() -> None:
    assert fit_of(load_road("parked_van"), BUS).fits is True
    (finding,) = fit_of(load_road("parked_van_tight"), BUS).findings
    assert finding.trouble is Trouble.WIDTH
    assert finding.needed - finding.available == pytest.approx(0.15, abs=1e-3)
    # The van stands from 78 m to 83.5 m; beside it limits change within the 0.1 m between two places of the table.
    assert finding.s_from == pytest.approx(78.0, abs=0.11)
    assert finding.s_to == pytest.approx(83.5, abs=0.11)


def test_the_bend_fits_only_with_the_overhang_over_the_kerb() -> None:
    assert fit_of(load_road("kerb_bend"), BUS).fits is True
    (finding,) = fit_of(load_road("kerb_bend_wall"), BUS).findings
    assert finding.needed == pytest.approx(5.09, abs=0.01)  # twice the balanced half width of R = 16 m, smoothed to 15.8 m
    assert finding.available == pytest.approx(4.25, abs=0.01)  # 2.75 m inside and 1.5 m outside


def test_the_corner_is_rounded_within_the_stated_deviation_and_houses_stay() -> None:
    road = load_road("street_corner")
    assert road.smoothing is not None
    assert road.smoothing.max_deviation < 5.0
    assert road.smoothing.max_curvature <= 1.01 * 0.125
    assert road.passable is not None
    left, right, left_sweep, _ = road.passable.table(np.array([30.0]))
    np.testing.assert_allclose([left[0], right[0], left_sweep[0]], [4.0, -3.5, 4.5], atol=0.03)  # drawn; the line moves by 3 cm here


@pytest.mark.parametrize("name", LEGS)
def test_the_drives_of_several_legs_are_drawn_so_that_nothing_is_moved(name: str) -> None:
    legs = load_legs(name)
    assert [leg.direction for leg in legs.legs] == ["forward", "backward", "forward"]
    assert legs.notes == ()
    first, last = legs.legs[0].road.path.at(0.0), legs.legs[-1].road.path.at(legs.legs[-1].road.path.length)
    assert abs(np.cos(float(last.heading) - float(first.heading)) + 1.0) < 1e-3  # they turn the vehicle round
