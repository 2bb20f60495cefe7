from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from hdvplan.api import plan
from hdvplan.case import Case
from hdvplan.errors import PlanError
from hdvplan.judging.verdict import verdict_of
from hdvplan.need.answer import Need, need_of
from hdvplan.need.search import Least
from hdvplan.need.stretch import stretch_of
from hdvplan.need.widening import Widening, Widenings, chosen, least_widenings
from hdvplan.report.needs import area_of, need_json, need_lines, patches_of
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Limits, Road
from tests.need.test_room import BUS, bend_of_16_m, case_on, least_in_the_bend

LACK_M = 0.25


@pytest.fixture(scope="module")
def narrow() -> Case:
    """A quarter turn whose limits lack a quarter of a metre on either side."""
    case = bend_of_16_m()
    half = least_in_the_bend().room - LACK_M
    return replace(case, road=case.road.with_limits(half, half))


@pytest.fixture(scope="module")
def found(narrow: Case) -> Widenings:
    assert narrow.road.limits is not None
    return least_widenings(narrow, narrow.road.limits)


def within(case: Case, own: Limits, widening: Widening, share: float) -> Case:
    part = Widening(widening.s, share * widening.outwards, None)
    return replace(case, road=case.road.within(part.widened(own)))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["area", "depth"])
def test_the_vehicle_fits_after_the_change_and_not_with_5_percent_less(narrow: Case, found: Widenings, kind: str) -> None:
    widening, own = getattr(found, kind), narrow.road.limits
    assert own is not None
    assert widening.result is not None
    assert verdict_of(plan(within(narrow, own, widening, 1.0))).fits is True
    for objective in ("geometric", "balanced", "lead-axle"):
        assert verdict_of(plan(replace(within(narrow, own, widening, 0.95), objective=objective))).fits is False


@pytest.mark.slow
def test_the_least_area_is_smaller_and_the_least_depth_shallower(narrow: Case, found: Widenings) -> None:
    assert found.area is not None
    assert found.depth is not None
    own, path = narrow.road.limits, narrow.road.path
    assert own is not None
    area, depth = (area_of(patches_of(widening, own, path)) for widening in (found.area, found.depth))
    assert area < depth
    assert found.depth.depth < found.area.depth
    # An even widening by what is lacking would do, and no even widening by clearly less: 2 cm are tolerances of need and verdict.
    assert LACK_M - 0.03 < found.depth.depth < LACK_M + 0.03


@pytest.mark.slow
def test_a_widening_with_which_no_plan_was_found_is_told_as_what_is_lacking_at_least(narrow: Case, found: Widenings) -> None:
    assert found.area is not None
    nothing = Least(np.inf, None, 1.27, 15.0, 6, None)
    need = Need(narrow, None, nothing, None, None, replace(found, area=replace(found.area, result=None)))
    said = need_lines(need)[0]
    assert said.startswith(f"NO: the bus does not fit; at least {need_json(need, 0.0)['widening_m2']:.1f} m2 of road are lacking, ")
    assert said.endswith("; no plan along the whole road was found with it")


@pytest.mark.slow
def test_a_widening_with_which_a_plan_was_found_stands_for_both(narrow: Case, found: Widenings) -> None:
    assert found.area is not None
    assert found.depth is not None
    nowhere = Least(np.inf, None, 1.27, 15.0, 6, None)
    for area, depth in ((replace(found.area, result=None), found.depth), (found.area, replace(found.depth, result=None))):
        told, fits = chosen(area, depth), area if area.result is not None else depth
        assert told == Widenings(fits, fits, None)
        assert " m2 would do, " in need_lines(Need(narrow, None, nowhere, None, None, told))[0]
    worse = replace(found.area, outwards=10.0 * found.area.outwards)  # after repairs
    assert chosen(worse, found.depth) == Widenings(found.depth, found.depth, None)
    assert chosen(found.area, found.depth) == found


def test_a_road_that_is_wide_enough_needs_no_widening(narrow: Case) -> None:
    wide = narrow.road.with_limits(4.0, 4.0)
    assert wide.limits is not None
    found = least_widenings(replace(narrow, road=wide), wide.limits)
    assert found.fitting is not None
    assert (found.area, found.depth) == (None, None)


def test_no_widening_helps_where_an_obstacle_blocks_the_road() -> None:
    case = case_on([0.0, 100.0], [0.0, 0.0])
    wall = Region(Kind.OBSTACLE, shapely.box(50.0, -60.0, 50.5, 60.0), "wall")
    road = replace(case.road, regions=(wall,)).with_limits(3.0, 3.0)
    need = need_of(replace(case, road=road))
    assert need.widenings == Widenings(None, None, None)
    said = need_lines(need)[0]
    assert "no widening of the road's own limits was found that would do: the obstacle 'wall' is in the way at s = 50." in said
    assert need_json(need, 0.0)["widening_m2"] is None


def test_an_obstacle_that_is_not_in_the_way_is_not_blamed() -> None:
    shed = Region(Kind.OBSTACLE, shapely.box(50.0, 10.0, 55.0, 15.0), "shed")
    case = case_on([0.0, 100.0], [0.0, 0.0])
    case = replace(case, road=replace(case.road, regions=(shed,)))
    too_tight = Least(np.inf, None, 1.27, 15.0, 2, PlanError("the road bends too tightly", s_m=20.0))
    (said,) = need_lines(Need(case, None, too_tight, None, None, None))
    assert said == "NO: no plan was found for the bus at any half width up to 15 m (the road bends too tightly)"


def test_patches_lie_between_the_old_and_the_new_limit() -> None:
    road = Road("straight", case_on([0.0, 60.0], [0.0, 0.0]).road.path).with_limits(3.0, 2.0)
    s = 0.25 * np.arange(241, dtype=np.float64)
    bump = np.interp(s, [20.0, 25.0, 35.0, 40.0], [0.0, 0.4, 0.4, 0.0])
    outwards = np.stack([0.0 * s, bump, 0.0 * s, bump])
    assert road.limits is not None
    patches = patches_of(Widening(s, outwards, None), road.limits, road.path)
    (patch,) = patches
    assert (patch.side, patch.region, patch.depth) == ("right", "drivable", 0.4)
    assert (patch.s_from, patch.s_to) == (20.0, 40.0)
    trapezium = shapely.Polygon([(20.0, -2.0), (25.0, -2.4), (35.0, -2.4), (40.0, -2.0)])
    assert shapely.symmetric_difference(patch.polygon, trapezium).area < 0.01  # outlines are simplified by up to 1 mm
    assert area_of(patches) == pytest.approx(6.0, abs=0.01)


def test_overhangs_that_need_room_of_their_own_are_told_apart() -> None:
    ends, one = np.array([0.0, 60.0]), np.ones(2)
    own = Limits(ends, 2.0 * one, -2.0 * one, 2.5 * one, -2.5 * one)
    s = 0.25 * np.arange(241, dtype=np.float64)
    outwards = np.zeros((4, len(s)))
    outwards[2, 80:120] = 0.3
    path = case_on([0.0, 60.0], [0.0, 0.0]).road.path
    (patch,) = patches_of(Widening(s, outwards, None), own, path)
    assert (patch.side, patch.region) == ("left", "sweepable")
    assert patch.polygon.bounds[1] == pytest.approx(2.5, abs=1e-3)  # as above


def test_wheels_that_move_out_take_the_overhangs_limit_with_them() -> None:
    ends, one = np.array([0.0, 60.0]), np.ones(2)
    own = Limits(ends, 2.0 * one, -2.0 * one, 2.1 * one, -2.1 * one)
    widened = Widening(ends, np.array([[0.5, 0.5], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]), None).widened(own)
    np.testing.assert_allclose(widened.table(np.array([30.0]))[:, 0], [2.5, -2.0, 2.5, -2.1])


def test_a_stretch_is_the_same_road_with_arclengths_of_its_own(narrow: Case) -> None:
    part = stretch_of(narrow, 20.0, 80.0)
    for s in (0.0, 13.0, 60.0):
        ours, theirs = narrow.road.path.at(20.0 + s), part.road.path.at(s)
        np.testing.assert_allclose([ours.x, ours.y, ours.curvature], [theirs.x, theirs.y, theirs.curvature], atol=1e-12)  # the same table
    assert part.road.path.length == 60.0
    assert part.road.limits is not None
    assert narrow.road.limits is not None
    np.testing.assert_array_equal(part.road.limits.table(np.array([30.0])), narrow.road.limits.table(np.array([50.0])))
    assert plan(part).drive.vehicle == BUS
