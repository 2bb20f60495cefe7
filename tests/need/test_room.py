from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely

from hdvplan.api import plan
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.centring.weights import CentringTable
from hdvplan.judging.verdict import verdict_of
from hdvplan.need.answer import need_of
from hdvplan.need.measure import taken_by
from hdvplan.need.room import least_edge, least_half_width
from hdvplan.need.search import TOLERANCE_M, Least
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.cells import GAP_M
from hdvplan.road.path import from_curvature
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Limits, Road
from hdvplan.vehicle.load import load_vehicle

BUS = load_vehicle("bus")
SETTINGS = PlannerSettings(horizon=50.0)
_SAMPLING_M = 0.008  # limits are kept with a margin of up to so much between samples, see docs/maths.md


def case_on(s: list[float], kappa: list[float]) -> Case:
    path = from_curvature(np.array(s), np.array(kappa))
    return Case(Road("bend", path), BUS, settings=SETTINGS)


@cache
def bend_of_16_m() -> Case:
    """Return a quarter turn of 16 m radius between straights."""
    return case_on([0.0, 30.0, 38.0, 60.0, 68.0, 110.0], [0.0, 0.0, 0.0625, 0.0625, 0.0, 0.0])


@cache
def least_in_the_bend() -> Least:
    """Return the least half width there, found once for all tests."""
    return least_half_width(bend_of_16_m())


@pytest.fixture
def bend() -> Case:
    return bend_of_16_m()


def test_a_straight_road_needs_half_the_vehicles_width() -> None:
    found = least_half_width(case_on([0.0, 60.0], [0.0, 0.0]))
    assert found.room == pytest.approx(0.5 * BUS.width, abs=1e-6)  # the simulation of a straight drive is exact to rounding


def test_a_long_circle_needs_what_the_balanced_circle_sweeps() -> None:
    found = least_half_width(case_on([0.0, 150.0], [0.05, 0.05]))
    expected = float(CentringTable.of(BUS).at(np.array([0.05])).half_width[0])
    # No plan is narrower than the circle that the vehicle must end up on; the answer is good to its tolerance.
    assert expected - 1e-3 < found.room < expected + TOLERANCE_M


def test_a_little_more_room_fits_and_less_does_not(bend: Case) -> None:
    found = least_in_the_bend()
    assert found.result is not None
    assert found.room - found.out_of_reach <= TOLERANCE_M + 1e-6  # rounding of the comparison
    wider = replace(bend, road=bend.road.with_limits(found.room + 0.01, found.room + 0.01))
    assert verdict_of(plan(wider)).fits is True
    narrower = replace(bend, road=bend.road.with_limits(found.room - 0.02, found.room - 0.02))
    for objective in ("geometric", "balanced", "body-max", "lead-axle"):
        assert verdict_of(plan(replace(narrower, objective=objective))).fits is False


def test_the_clearance_is_added_to_what_the_vehicle_sweeps(bend: Case) -> None:
    plain = least_in_the_bend().room
    kept = least_half_width(replace(bend, settings=replace(SETTINGS, clearance=0.3))).room
    assert kept == pytest.approx(plain + 0.3, abs=TOLERANCE_M)


def test_a_held_edge_is_kept_and_the_other_side_gets_what_it_costs(bend: Case) -> None:
    length, even = bend.road.path.length, least_in_the_bend().room
    held = Limits.constant(even - 0.3, even - 0.3, length)
    found = least_edge(bend, held, "right")
    assert found.result is not None
    taken = taken_by(found.result)
    assert np.max(taken.reach[0]) <= even - 0.3 + 1e-3  # what a held edge is kept to
    assert found.room > even + 0.2  # the swept width itself hardly changes
    both = replace(bend, road=bend.road.with_limits(even - 0.3, found.room + _SAMPLING_M))
    assert verdict_of(plan(both)).fits is True


def test_a_held_edge_that_no_plan_keeps_has_no_answer(bend: Case) -> None:
    found = least_edge(bend, Limits.constant(0.9, 0.9, bend.road.path.length), "right")
    assert found.result is None
    assert found.room == np.inf


def test_obstacles_stay_where_they_are() -> None:
    case = case_on([0.0, 100.0], [0.0, 0.0])
    box = Region(Kind.OBSTACLE, shapely.box(50.0, -3.0, 54.0, -0.5), "van")  # reaches to half a metre right of the line
    found = least_half_width(replace(case, road=replace(case.road, regions=(box,)).within(None)))
    assert found.result is not None
    # Beside the van the bus takes its width and the distance of its right side, which the cells of 5 cm round up.
    assert BUS.width - 0.5 <= found.room < BUS.width - 0.5 + 0.1
    assert all(approach.distance > -0.01 for approach in found.result.approaches)


def test_what_is_reached_beside_an_obstacle_needs_room_too() -> None:
    case = case_on([0.0, 100.0], [0.0, 0.0])
    van = Region(Kind.OBSTACLE, shapely.box(50.0, -20.0, 54.0, -0.5), "van")  # reaches to half a metre right of the line
    wall = Region(Kind.OBSTACLE, shapely.box(-20.0, 2.3, 120.0, 3.0), "wall")  # leaves room for the bus beside the van
    walled = replace(case, road=replace(case.road, regions=(van, wall)).within(None))
    found = least_half_width(walled)
    # As without the wall, which stands further out than the bus must go.
    assert BUS.width - 0.5 <= found.room < BUS.width - 0.5 + 0.1
    assert found.result is not None
    assert np.max(taken_by(found.result).reach) == found.room


def test_a_street_between_two_walls_needs_what_the_vehicle_takes() -> None:
    case = case_on([0.0, 60.0], [0.0, 0.0])
    walls = tuple(Region(Kind.OBSTACLE, shapely.box(-20.0, low, 80.0, low + 1.0), "wall") for low in (-4.0, 3.0))
    found = least_half_width(replace(case, road=replace(case.road, regions=walls).within(None)))
    assert found.room == pytest.approx(0.5 * BUS.width, abs=1e-6)  # as on the straight road without walls


@pytest.mark.slow
def test_kerbs_that_overhangs_pass_over_leave_wheels_the_room_that_is_needed(bend: Case) -> None:
    path = bend.road.path
    s = np.linspace(0.0, path.length, 221)
    sides = [[np.column_stack(path.to_plane(s, side * offset)) for offset in (2.2, 4.0)] for side in (1.0, -1.0)]
    kerbs = tuple(Region(Kind.SWEEPABLE, shapely.Polygon(np.concatenate([near, far[::-1]])), "kerb") for near, far in sides)
    need = need_of(replace(bend, road=replace(bend.road, regions=kerbs).within(None)))
    assert need.place is not None
    assert need.room.room > 2.2 - GAP_M - 0.01  # with less, no kerb joins the road; a plan keeps 8 mm between samples
    foot, offset = path.project(np.array([need.place.x]), np.array([need.place.y]), np.array([need.place.s]))
    assert foot[0] == pytest.approx(need.place.s, abs=1e-6)  # feet are good to a micrometre
    # The place is of the wheels, which decide: bodies reach beyond. Of places that reach as far to 1 cm, it has the least room opposite.
    assert abs(offset[0]) == pytest.approx(need.room.room, abs=TOLERANCE_M)


def test_a_road_that_an_obstacle_blocks_has_no_answer() -> None:
    case = case_on([0.0, 100.0], [0.0, 0.0])
    wall = Region(Kind.OBSTACLE, shapely.box(50.0, -60.0, 50.5, 60.0), "wall")
    assert least_half_width(replace(case, road=replace(case.road, regions=(wall,)).within(None))).result is None


def test_what_a_plan_takes_is_its_envelope_where_the_road_decides(bend: Case) -> None:
    result = plan(replace(bend, road=bend.road.with_limits(4.0, 5.0)))
    taken = taken_by(result)
    reaches: FloatArray = np.stack([result.envelope.reach_left, -result.envelope.reach_right] * 2)
    np.testing.assert_allclose(taken.reach, reaches, atol=1e-12)  # sums of the same numbers
    assert taken.passes
    assert np.all(taken.counts)
    own = result.drive.road.own_limits
    assert own is not None
    np.testing.assert_allclose(taken.beyond(own), reaches - np.array([4.0, 5.0, 4.0, 5.0])[:, None], atol=1e-12)
