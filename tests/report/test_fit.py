"""The forecast of geometry: which places a vehicle does not fit, and why."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hdvplan.judging.fit import Trouble, finding_text, fit_of, fit_table, needs_of
from hdvplan.road.limits import Limits
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.road.scenarios import turn_profile
from hdvplan.vehicle.load import load_vehicle

BUS, TRAILER = load_vehicle("bus"), load_vehicle("tractor-trailer")


def turn(radius: float) -> Road:
    return Road("turn", from_curvature(*turn_profile(1.0 / radius, 10.0, 20.0)))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_room_for_overhangs_counts_on_the_outside_of_a_bend_only(sign: float) -> None:
    road = turn(sign * 16.0)
    needs = needs_of(road, BUS, np.array([70.0]))
    ends, one = np.array([0.0, road.path.length]), np.ones(2)
    tight = 0.5 * float(needs.axles[0]) + 0.1
    inside, outside = (tight, tight + 1.4) if sign > 0.0 else (tight + 1.4, tight)  # of left_sweep, -right_sweep
    open_outside = replace(road, limits=Limits(ends, tight * one, -tight * one, inside * one, -outside * one))
    open_inside = replace(road, limits=Limits(ends, tight * one, -tight * one, outside * one, -inside * one))
    assert fit_of(open_outside, BUS).fits is True
    (finding,) = fit_of(open_inside, BUS).findings
    assert finding.available == pytest.approx(2.0 * tight)


def test_each_reason_has_its_sentence_with_place_and_numbers() -> None:
    narrow = fit_of(turn(20.0).with_limits(1.7, 1.7), BUS).findings[0]
    assert finding_text(narrow, "bus").startswith("too narrow for the bus from s = 5")
    assert "limits are 3.40 m apart, needs 4.59 m" in finding_text(narrow, "bus")
    tight = fit_of(turn(9.0), BUS).findings[0]
    assert tight.trouble is Trouble.CURVATURE
    assert tight.available == BUS.max_curvature
    radius = (4 * 9.0**2 + 2 * 2.54 * 9.0 - 9.34**2) / (4 * 9.0 + 2 * 2.54)  # R1 of [GEO], eq. 17
    assert tight.needed == pytest.approx(1.0 / radius, rel=1e-3)  # the table of balanced circles is linear between entries
    assert "needs a curvature of 0.145 1/m" in finding_text(tight, "bus")
    none = fit_of(turn(4.0), load_vehicle("tractor-trailer-24m")).findings[0]
    assert none.trouble is Trouble.CIRCLE
    blocked = Limits(np.array([0.0, 150.0]), *(value * np.ones(2) for value in (-1.0, 1.0, -1.0, 1.0)))
    (shut,) = fit_of(replace(turn(50.0), limits=blocked), BUS).findings
    wanted = f"limits overlap by 2.00 m, needs {shut.needed:.2f} m: {2.0 + shut.needed:.2f} m have to go"
    assert finding_text(shut, "bus").endswith(wanted)


def test_neighbouring_places_are_one_finding_and_distant_ones_two() -> None:
    s = np.array([0.0, 20.0, 21.0, 22.0, 23.0, 24.0, 60.0, 61.0, 62.0, 100.0])
    reach = np.array([2.0, 2.0, 1.2, 2.0, 1.2, 2.0, 2.0, 1.1, 2.0, 2.0])
    road = Road("pinches", from_curvature(np.array([0.0, 100.0]), np.zeros(2)), Limits(s, reach, -reach, reach, -reach))
    findings = fit_of(road, BUS).findings
    assert [round(finding.s_worst) for finding in findings] == [21, 61]
    assert (findings[0].s_from, findings[0].s_to) == (21.0, 23.0)  # places are those looked at: every 0.5 m, and the limits' own
    assert findings[1].available == pytest.approx(2.2)


def test_the_table_has_the_width_that_every_vehicle_needs() -> None:
    table = fit_table(turn(20.0), [BUS, TRAILER])
    assert list(table.columns[:6]) == ["s", "curvature", "left", "right", "left_sweep", "right_sweep"]
    assert table["left"].isna().all()
    assert table["needed_width_bus"].iloc[0] == pytest.approx(BUS.width)
    assert table["needed_width_bus"].max() == pytest.approx(2.0 * fit_of(turn(20.0), BUS).half_width)
    assert (table["needed_width_tractor-trailer"].max() > table["needed_width_bus"].max()) is np.True_
