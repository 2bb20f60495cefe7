from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from hdvplan import api
from hdvplan.api import plan
from hdvplan.case import Case
from hdvplan.centring.stationary import CentringTable
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.clearance import SIDES
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import verdict_of
from hdvplan.need.answer import need_of
from hdvplan.need.search import (
    TOLERANCE_M,
    WIDE_M,
    Least,
    Question,
    _worse,
    _WorseError,
    even,
    kerbs_on,
    least,
    least_edge,
    least_half_width,
    spare_of,
)
from hdvplan.planning.planner import Plan
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.line import Line, RawRoad, smoothed
from hdvplan.road.options import RoadOptions
from hdvplan.road.path import from_curvature
from hdvplan.road.pieces import Kerb
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.road.widened import GAP_M
from hdvplan.vehicle.load import load_vehicle

BUS = load_vehicle("bus")
SETTINGS = PlannerSettings(horizon=50.0)
_LEG_M = 45.0  # of a street before and after its corner


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


def corner(degrees: float) -> Case:
    """Return two straights that meet in a corner, as a map gives them: the path is smooth, widths are about the corner."""
    angle = np.radians(degrees)
    points = np.array([[0.0, 0.0], [_LEG_M, 0.0], [_LEG_M * (1.0 + np.cos(angle)), _LEG_M * np.sin(angle)]])
    line = Line("corner", RawRoad(points), RoadOptions(max_curvature=0.9 * BUS.max_curvature))
    return Case(smoothed(line)[0], BUS, settings=SETTINGS)


@pytest.fixture
def bend() -> Case:
    return bend_of_16_m()


def test_a_straight_road_needs_half_the_vehicles_width() -> None:
    found = least_half_width(case_on([0.0, 60.0], [0.0, 0.0]))
    assert found.room == pytest.approx(0.5 * BUS.width, abs=1e-6)  # the simulation of a straight drive is exact to rounding


@pytest.mark.slow
def test_drives_that_end_where_they_are_worse_change_no_answer(bend: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    whole: list[Result] = []
    every = least(bend, Question(even(bend.road), SIDES, 0.5 * BUS.width, (WIDE_M,)), on_result=whole.append)
    ended: list[Result] = []

    def kept(case: Case, on_plan: Callable[[Plan], None]) -> Result:
        ended.append(plan(case, on_plan=on_plan))
        return ended[-1]

    monkeypatch.setattr(api, "plan", kept)
    found = least_half_width(bend)
    assert (found.room, found.plans, found.out_of_reach) == (every.room, every.plans, every.out_of_reach)
    assert len(ended) < len(whole) == found.plans


def test_a_drive_ends_where_it_lacks_more_than_another_needs(bend: Case) -> None:
    narrow = replace(bend, road=bend.road.with_limits(1.5, 1.5))  # 0.23 m more than the straight bus is wide
    look, driven = _worse(narrow, SIDES, 0.1), []

    def watched(made: Plan) -> None:
        driven.append(made)
        look(made)

    plan(narrow, on_plan=_worse(narrow, SIDES, 10.0))
    with pytest.raises(_WorseError):
        plan(narrow, on_plan=watched)
    assert 0.0 < driven[-1].first * SETTINGS.step < 68.0  # it swings out before the bend


def test_a_long_circle_needs_what_the_balanced_circle_sweeps() -> None:
    found = least_half_width(case_on([0.0, 150.0], [0.05, 0.05]))
    expected = float(CentringTable.of(BUS).at(np.array([0.05])).half_width[0])
    # No plan is narrower than the circle that the vehicle must end up on; the answer is good to its tolerance.
    assert expected - 1e-3 < found.room < expected + TOLERANCE_M


@pytest.mark.slow
def test_a_little_more_room_fits_and_less_does_not(bend: Case) -> None:
    found = least_in_the_bend()
    assert found.result is not None
    assert found.room - found.out_of_reach <= TOLERANCE_M + 1e-6  # rounding of the comparison
    wider = replace(bend, road=bend.road.with_limits(found.room + 0.01, found.room + 0.01))
    assert verdict_of(plan(wider)).fits is True
    narrower = replace(bend, road=bend.road.with_limits(found.room - 0.021, found.room - 0.021))  # tolerances of need and verdict: 2 cm
    for objective in ("geometric", "balanced", "body-max", "lead-axle"):
        assert verdict_of(plan(replace(narrower, objective=objective))).fits is False


def test_the_plan_that_needs_least_just_touches_the_kerbs_there() -> None:
    found = least_in_the_bend()
    assert found.result is not None
    limits = found.result.drive.road.limits
    assert limits is not None
    assert limits.left[0] == found.room
    assert abs(min(spare_of(found.result).values())) < 1e-3  # kerbs are chords of up to 0.3 mm; a secant ends near its root


@pytest.mark.slow
@settings(max_examples=3, derandomize=True)
@given(st.floats(35.0, 100.0), st.floats(-0.3, 0.3))
def test_the_answer_agrees_with_the_plan_in_a_street_with_a_corner(degrees: float, more: float) -> None:
    case = corner(degrees)
    near = least_half_width(case).room + more
    own = replace(case, road=case.road.with_limits(near, near))
    need, fits = need_of(own), verdict_of(plan(own)).fits
    assert need.widenings is not None
    if fits:
        assert need.widenings.fitting is not None
    # A plan that was not found in one street may be found in a narrower one: then it fits the wider one too, whatever ``plan`` says.
    assert (need.widenings.fitting is not None) == (need.room.room <= near + KEPT_M)


def test_the_clearance_is_added_to_what_the_vehicle_sweeps(bend: Case) -> None:
    plain = least_in_the_bend().room
    kept = least_half_width(replace(bend, settings=replace(SETTINGS, clearance=0.3))).room
    assert kept == pytest.approx(plain + 0.3, abs=TOLERANCE_M)


@pytest.mark.slow
def test_a_held_edge_is_kept_and_the_other_side_gets_what_it_costs(bend: Case) -> None:
    even = least_in_the_bend().room
    held = kerbs_on(bend.road.with_limits(even - 0.3, even - 0.3), "left")
    found = least_edge(bend, held, "right")
    assert found.result is not None
    assert spare_of(found.result)["left"] >= -KEPT_M
    assert found.room > even + 0.2  # the swept width itself hardly changes
    both = replace(bend, road=bend.road.with_limits(even - 0.3, found.room))
    assert verdict_of(plan(both)).fits is True


def test_a_held_edge_that_no_plan_keeps_has_no_answer(bend: Case) -> None:
    s = np.array([0.0, 49.0, 50.0, 51.0, bend.road.path.length])
    wall = Kerb(np.stack(bend.road.path.to_plane(s, np.array([3.0, 3.0, -14.0, 3.0, 3.0])), axis=1), s, left=True)
    found = least_edge(bend, (wall,), "right")
    assert found.result is None
    assert found.room == np.inf


@pytest.mark.slow
@pytest.mark.parametrize("wall", [(), (Region(Kind.OBSTACLE, shapely.box(-20.0, 2.3, 120.0, 3.0), "wall"),)], ids=["alone", "and a wall"])
def test_obstacles_stay_where_they_are(wall: tuple[Region, ...]) -> None:
    case = case_on([0.0, 100.0], [0.0, 0.0])
    van = Region(Kind.OBSTACLE, shapely.box(50.0, -20.0, 54.0, -0.5), "van")  # reaches to half a metre right of the line
    found = least_half_width(replace(case, road=replace(case.road, regions=(van, *wall)).within(None)))
    assert found.result is not None
    # Beside the van the bus takes its width and the distance of its right side, which the cells of 5 cm round up; the wall is further out.
    assert BUS.width - 0.5 <= found.room < BUS.width - 0.5 + 0.1
    assert all(approach.distance > -0.01 for approach in found.result.approaches)


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


@pytest.mark.slow
def test_an_island_on_the_line_stays_where_the_kerbs_move() -> None:
    island = Region(Kind.SWEEPABLE, shapely.box(58.0, -0.8, 64.0, 0.8))
    road = Road("refuge", from_curvature(np.array([0.0, 120.0]), np.zeros(2)), regions=(island,)).with_limits(3.5, 3.5)
    case = Case(road, BUS)
    need = need_of(case)
    assert need.room.room == pytest.approx(0.8 + BUS.width, abs=0.02)  # and as much as a search stops at
    assert verdict_of(plan(replace(case, road=road.with_limits(need.room.room, need.room.room)))).fits
