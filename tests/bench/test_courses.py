from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from hdvplan.api import drive_case
from hdvplan.bench.measuring.courses import PINCH_LENGTH_M, PINCH_RAMP_M, cases_of, with_limits
from hdvplan.bench.suite import Cell, Suite, suite_of
from hdvplan.case import Case
from hdvplan.errors import RoadError
from hdvplan.road.limits import Limits
from hdvplan.road.load import load_road
from hdvplan.road.options import RoadOptions
from hdvplan.road.path import from_curvature
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.vehicle.load import load_vehicle

BUS = load_vehicle("bus")
SUITE = Suite(roads=("uturn",), vehicles=("bus",))


def limits(road: Road, suite: Suite) -> Limits:
    found = with_limits(road, BUS, suite).limits
    assert found is not None
    return found


def test_limits_lie_beyond_the_geometric_half_width_of_the_tightest_bend() -> None:
    found = limits(SCENARIOS["uturn"](), replace(SUITE, slack=0.4))
    # 2.486 m is the published geometric expectation of this U-turn, to its printed millimetre.
    np.testing.assert_allclose(found.left, 2.486 + 0.4, atol=1e-3)
    np.testing.assert_array_equal(found.right, -found.left)


def test_roads_of_a_junction_are_chosen_as_in_plan() -> None:
    (case,) = cases_of(suite_of({"roads": ["neuweiler"], "vehicles": ["bus"], "schemes": ["rti"], "solvers": ["piqp"], "road_ids": "0,5"}))
    assert case.road.path.length == load_road("neuweiler", RoadOptions(road_ids="0,5")).path.length
    with pytest.raises(RoadError, match=r"has no use for --road-ids|has no road ids"):
        cases_of(replace(SUITE, road_ids="0,5"))


def test_limits_beyond_the_half_width_bind_nowhere_however_far_smoothing_moves_the_line(tmp_path: Path) -> None:
    """Beside the line as given they would lie 0.6 m within the room of a bus that follows a curve of 25 m for a corner."""
    (tmp_path / "corner.csv").write_text("x,y\n0,0\n60,0\n60,60\n", encoding="utf-8")
    road = load_road(tmp_path / "corner.csv", RoadOptions(smooth=5.0, max_curvature=0.04))
    assert road.smoothing is not None
    assert road.smoothing.max_deviation > 2.0 * SUITE.slack
    drive = drive_case(Case(with_limits(road, BUS, SUITE), BUS))
    assert all(plan.merit is None for plan in drive.plans)


def test_without_limits_a_road_loses_its_own() -> None:
    road = SCENARIOS["uturn"]()
    assert road.limits is not None
    assert with_limits(road, BUS, replace(SUITE, limits=False)).limits is None


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_a_pinch_narrows_the_outer_side_in_the_middle_of_the_tightest_bend(turn: float) -> None:
    profile = np.array([0.0, 30.0, 40.0, 70.0, 80.0, 110.0]), turn * np.array([0.0, 0.0, 0.05, 0.05, 0.0, 0.0])
    found = limits(Road("bend", from_curvature(*profile)), replace(SUITE, half_width=3.0, pinch=1.25))
    outer, inner = (-found.right, found.left) if turn > 0 else (found.left, -found.right)
    assert set(inner) == {3.0}
    assert outer.min() == 1.75
    deep = found.s[outer == outer.min()]
    # The middle of the constant part is at 55 m; limits are sampled every 0.25 m, and its ends are found to two samples.
    assert deep.mean() == pytest.approx(55.0, abs=0.5)
    assert np.ptp(deep) == pytest.approx(PINCH_LENGTH_M, abs=0.5)
    touched = found.s[outer < 3.0]
    assert np.ptp(touched) == pytest.approx(PINCH_LENGTH_M + 2 * PINCH_RAMP_M, abs=1.0)


def test_obstacles_cut_pinched_limits_too() -> None:
    road = replace(SCENARIOS["uturn"](), regions=(Region(Kind.OBSTACLE, shapely.box(20.0, 1.5, 25.0, 4.0)),))
    for pinch in (None, 1.0):
        found = with_limits(road, BUS, replace(SUITE, half_width=3.0, pinch=pinch)).passable
        assert found is not None
        assert found.table(np.array([22.0]))[0, 0] == pytest.approx(1.5, abs=1e-6)  # a foot on a quintic is exact to 1e-9 m


def test_a_pinch_that_closes_the_road_is_refused() -> None:
    with pytest.raises(RoadError, match=r"closes uturn, whose limits are 5\.97 m apart"):
        with_limits(SCENARIOS["uturn"](), BUS, replace(SUITE, pinch=6.0))


def test_cases_come_in_the_order_of_the_suite_s_cells() -> None:
    suite = Suite(roads=("uturn", "sturn"), vehicles=("tractor-trailer", "bus"), objective="balanced", horizon=30.0)
    found = [Cell(case.road.name, case.vehicle.name, case.settings.scheme, case.solver_name) for case in cases_of(suite)]
    assert found == suite.cells()
    assert {(case.objective, case.settings.horizon) for case in cases_of(suite)} == {("balanced", 30.0)}
