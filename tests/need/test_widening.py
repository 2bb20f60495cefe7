from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from hdvplan.api import plan
from hdvplan.case import Case
from hdvplan.errors import PlanError
from hdvplan.judging.bodies import corners, united
from hdvplan.judging.clearance import Approach
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import verdict_of
from hdvplan.need.answer import Need, edge_need_of, need_of
from hdvplan.need.land import around, moved, on_kerbs
from hdvplan.need.search import Least, kerbs_on, on_road, spare_of
from hdvplan.need.widening import Widening, Widenings, cheapest_way, least_widenings, own_plans
from hdvplan.report.needs import need_json, need_lines, shown_plan
from hdvplan.road.limits import Limits
from hdvplan.road.line import Line, RawRoad, smoothed
from hdvplan.road.options import RoadOptions
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle
from tests.need.test_room import BUS, bend_of_16_m, case_on, corner, least_in_the_bend
from tests.nightly import nightly

LACK_M = 0.25
BOTH = ("left", "right")


@pytest.fixture(scope="module")
def narrow() -> Case:
    """A quarter turn whose limits lack a quarter of a metre on either side."""
    case = bend_of_16_m()
    half = least_in_the_bend().room - LACK_M
    return replace(case, road=case.road.with_limits(half, half))


@pytest.fixture(scope="module")
def plans(narrow: Case) -> list[Result]:
    return own_plans(narrow)


@pytest.fixture(scope="module")
def found(narrow: Case, plans: list[Result]) -> Widenings:
    return least_widenings(narrow, plans)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["area", "depth"])
def test_the_vehicle_fits_after_the_change_and_not_with_a_tenth_less(narrow: Case, found: Widenings, kind: str) -> None:
    widening = getattr(found, kind)
    assert widening is not None
    kerbs, _ = around(widening.result, BOTH)
    for then in (on_road(widening.result, on_kerbs(narrow.road, kerbs)), widening.then):
        assert verdict_of(then).fits is True
    less, _ = around(widening.result, BOTH, -0.1 * widening.depth)  # by 2.5 cm: 2 cm are tolerances of need and verdict
    for objective in ("geometric", "balanced", "lead-axle"):
        assert verdict_of(plan(replace(narrow, road=on_kerbs(narrow.road, less), objective=objective))).fits is False


@pytest.mark.slow
def test_the_least_area_is_smaller_and_the_least_depth_shallower(found: Widenings) -> None:
    assert found.area is not None
    assert found.depth is not None
    assert found.area.area < found.depth.area
    assert found.depth.depth < found.area.depth
    # An even widening by what is lacking would do, and no even widening by clearly less: 2 cm are tolerances of need and verdict.
    assert LACK_M - 0.03 < found.depth.depth < LACK_M + 0.03


@pytest.mark.slow
def test_where_nothing_but_clearance_is_lacking_the_widening_is_what_it_lacks(narrow: Case) -> None:
    """No body is beyond a kerb there."""
    half = least_in_the_bend().room + 0.05
    wanted = replace(narrow.settings, clearance=0.25)
    kept = least_widenings(replace(narrow, road=narrow.road.with_limits(half, half), settings=wanted), [])
    assert kept.fitting is None
    assert kept.depth is not None
    assert kept.area is not None
    assert 0.2 - 0.03 < kept.depth.depth < 0.2 + 0.03  # 2 cm are tolerances of need and verdict
    assert 0.0 < kept.area.area <= kept.depth.area
    assert verdict_of(kept.area.result).fits is False  # in the street as it was


@pytest.mark.slow
def test_kerbs_on_both_sides_need_no_more_area_than_those_on_one_side_alone(narrow: Case, plans: list[Result], found: Widenings) -> None:
    assert found.area is not None
    for side in BOTH:
        alone = least_widenings(narrow, plans, (side,))
        assert alone.area is not None
        assert found.area.area <= alone.area.area + 1e-6  # rounding


@pytest.mark.slow
def test_the_drawing_shows_the_plan_that_the_widening_belongs_to(narrow: Case, found: Widenings) -> None:
    shown = shown_plan(Need(narrow, None, least_in_the_bend(), None, None, found))
    assert found.area is not None
    assert shown is found.area.result
    swept = shapely.union_all(found.area.result.outlines.geometries)
    land = shapely.union_all([patch.polygon for patch in found.area.patches])
    shown_road = found.area.result.drive.road
    assert shown_road.given is not None
    assert narrow.road.given is not None
    for kerb, own in zip(shown_road.given.kerbs, narrow.road.given.kerbs, strict=True):
        np.testing.assert_array_equal(kerb.points, own.points)
    # What is not swept is room of up to 3 cm around another plan, and what lies between poses.
    assert shapely.area(shapely.difference(land, shapely.buffer(swept, 0.1))) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize(("held", "side"), [("left", "right"), nightly("right", "left")])
def test_a_kerb_that_must_not_move_leaves_an_area_on_the_other_side(held: str, side: str) -> None:
    case = corner(80.0)
    case = replace(case, road=case.road.with_limits(2.8, 2.8))
    need = edge_need_of(case, kerbs_on(case.road, held), side)
    assert need.widenings is not None
    assert need.widenings.area is not None
    assert {patch.side for patch in need.widenings.area.patches} == {side}
    assert spare_of(need.widenings.area.result)[held] > -0.011  # as kept: to 1 cm, and rounding
    assert need.room.room > 2.8


def test_kerbs_move_as_far_as_a_vehicle_sweeps_beyond_them() -> None:
    case = case_on([0.0, 120.0], [0.0, 0.0])
    wall = Region(Kind.OBSTACLE, shapely.box(55.0, -20.0, 65.0, 6.0), "wall")
    beside = plan(replace(case, road=replace(case.road, regions=(wall,))))
    own = case.road.with_limits(3.0, 3.0)
    kerbs, patches = around(on_road(beside, own), BOTH)
    assert max(patch.depth for patch in patches) > 6.0 + BUS.units[0].width - 3.0 - 0.01
    assert verdict_of(on_road(beside, on_kerbs(own, kerbs))).fits is True


def test_land_is_told_as_far_as_a_long_body_reaches_over_it() -> None:
    semi = load_vehicle("tractor-semitrailer")
    girder = replace(semi.units[1], wheelbase=38.0, rear_overhang=14.0, steering_ratio=1.0, max_steering_angle=0.78)
    case = case_on([0.0, 90.0, 98.0, 129.0, 137.0, 260.0], [0.0, 0.0, 1.0 / 30.0, 1.0 / 30.0, 0.0, 0.0])
    free = plan(replace(case, vehicle=replace(semi, units=(semi.units[0], girder)), objective="lead-axle"))
    own = free.case.road.with_limits(2.5, 30.0)
    _, patches = around(on_road(free, own), BOTH)
    assert own.bounds is not None
    left, right = (next(kerb.points for kerb in own.bounds.kerbs if kerb.left is side) for side in (True, False))
    street = shapely.make_valid(shapely.Polygon(np.concatenate([left, right[::-1]])))
    land = shapely.union_all([street, *(patch.polygon for patch in patches)])
    on_it = (free.drive.poses_s > 60.0) & (free.drive.poses_s < 240.0)
    bodies = np.asarray(shapely.polygons(corners(free.drive, np.flatnonzero(on_it)).reshape(-1, 4, 2)))
    beyond = shapely.difference(united(bodies), land)
    assert shapely.area(shapely.buffer(beyond, -0.01)) == 0.0  # 1 cm counts as kept


@pytest.mark.slow
def test_a_widening_is_none_where_neither_the_plan_nor_another_fits_within_it(monkeypatch: pytest.MonkeyPatch) -> None:
    case = case_on([0.0, 60.0], [0.0, 0.0])
    narrow = replace(case, road=case.road.with_limits(1.2, 1.2))
    monkeypatch.setattr("hdvplan.need.widening.around", lambda result, *_: (kerbs_on(result.drive.road, "left"), ()))
    monkeypatch.setattr("hdvplan.need.widening.on_kerbs", lambda road, _: road)  # nothing moves
    assert least_widenings(narrow, own_plans(narrow)) == Widenings(None, None, None)


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
    verge = replace(case.road, regions=(replace(shed, kind=Kind.SWEEPABLE),))
    (said,) = need_lines(Need(replace(case, road=verge), None, too_tight, None, None, None))
    assert said.endswith("(the road bends too tightly); wheels keep off sweepable areas, however wide the road is")


def test_patches_lie_between_the_old_and_the_new_kerb() -> None:
    case = case_on([0.0, 60.0], [0.0, 0.0])
    wide = plan(replace(case, road=case.road.with_limits(3.0, 3.0)))
    road = case.road.with_limits(3.0, 1.0)
    kerbs, (patch,) = around(on_road(wide, road), BOTH)
    assert (patch.side, patch.region) == ("right", "drivable")
    assert patch.depth == pytest.approx(0.5 * BUS.width - 1.0, abs=1e-6)  # the simulation of a straight drive is exact to rounding
    right = next(kerb for kerb in kerbs if not kerb.left)
    assert float(np.min(right.points[:, 1])) == pytest.approx(-0.5 * BUS.width, abs=1e-3)  # with a seam of 0.1 mm
    assert patch.polygon.bounds[3] == pytest.approx(-1.0, abs=1e-6)
    assert patch.polygon.area == pytest.approx((patch.s_to - patch.s_from) * patch.depth, rel=1e-3)


def test_the_answer_names_the_clearance_that_is_lacking_and_what_stays() -> None:
    case = case_on([0.0, 60.0], [0.0, 0.0])
    wide = plan(replace(case, road=case.road.with_limits(3.0, 3.0)))
    island = Region(Kind.OBSTACLE, shapely.box(50.0, 10.0, 55.0, 15.0), "island")
    widening = Widening(around(on_road(wide, case.road.with_limits(3.0, 1.0)), BOTH)[1], wide, wide)
    asked = replace(case, road=replace(wide.drive.road, regions=(island,)), settings=replace(case.settings, clearance=0.5))
    no, yes = (
        need_lines(Need(asked, None, least_in_the_bend(), None, None, found))[0]
        for found in (Widenings(widening, widening, None), Widenings(None, None, wide))
    )
    assert no.startswith("NO: the bus does not fit with 0.50 m of clearance; widening the road by ")
    assert no.endswith(" m at the deepest, clearance included; obstacles stay where they are")
    near = Approach(island, 0.53, 40.0, 40.0, 40.0, 52.0, 9.5, 0, "left", "front corner")
    beside = replace(widening, result=replace(wide, balance=replace(wide.balance, approaches=(near,))))
    told = need_lines(Need(asked, None, least_in_the_bend(), None, None, Widenings(beside, beside, None)))[0]
    assert told == f"{no}, such as the obstacle 'island', 0.53 m off at s = 40.0 m"
    assert yes.startswith("YES: the bus fits within the road's own limits with 0.50 m of clearance; ")


def test_kerbs_that_move_outwards_leave_every_body_at_least_as_much_more_room() -> None:
    case = corner(90.0)
    street = case.road.with_limits(3.4, 3.4)
    result = plan(replace(case, road=street))
    before, after = spare_of(result), spare_of(on_road(result, moved(street, BOTH, 0.5)))
    for side in BOTH:
        assert after[side] >= before[side] + 0.5 - 1e-3  # chords of a kerb


@pytest.mark.slow
@pytest.mark.parametrize("half", [1.8, nightly(2.1)])
def test_a_kerb_that_goes_round_more_than_once_moves_in_every_round(half: float) -> None:
    free = case_on([0.0, 30.0, 30.0 + 3.0 * np.pi * 18.0, 60.0 + 3.0 * np.pi * 18.0], [0.0, 1.0 / 18.0, 1.0 / 18.0, 0.0])
    road = free.road.with_limits(half, half)
    result = plan(replace(free, road=road))
    kerbs, patches = around(result, BOTH)
    assert verdict_of(on_road(result, on_kerbs(road, kerbs))).fits
    lacking = -min(spare_of(result).values())
    assert max(patch.depth for patch in patches) == pytest.approx(lacking, abs=0.02)  # of a gap, and of a kerb that bends
    own = on_road(result, road.with_limits(half + lacking, half + lacking))
    assert max(spare_of(own).values()) < 1.0  # metres: no kerb of another round counts


@pytest.mark.slow
def test_overhangs_that_need_room_of_their_own_are_told_apart() -> None:
    ends, one = np.array([0.0, 110.0]), np.ones(2)
    case = bend_of_16_m()
    road = case.road.within(Limits(ends, 2.3 * one, -2.3 * one, 2.3 * one, -2.31 * one))
    found = least_widenings(replace(case, road=road), own_plans(replace(case, road=road)), ("right",))
    assert found.area is not None
    assert {(patch.side, patch.region) for patch in found.area.patches} >= {("right", "sweepable")}


@pytest.mark.slow
def test_a_closed_road_is_widened_over_its_start() -> None:
    path = case_on([0.0, 2.0 * np.pi * 15.0], [1.0 / 15.0, 1.0 / 15.0]).road.path
    ring = replace(path, closed=True)
    road = Road("ring", ring).with_limits(2.4, 2.4)
    case = Case(road, BUS, settings=bend_of_16_m().settings)
    found = least_widenings(case, own_plans(case))
    assert found.area is not None
    kerbs, _ = around(found.area.result, BOTH)
    assert verdict_of(on_road(found.area.result, on_kerbs(road, kerbs))).fits is True


def test_a_wall_beyond_the_line_s_end_moves_by_what_the_front_reaches_over_it_on_the_road_and_no_more() -> None:
    line, wall = np.array([[0.0, 0.0], [60.0, 0.0]]), 60.0 + BUS.lead.front - 0.2
    dead_end = np.array([[-25.0, 3.0], [wall, 3.0], [wall, -3.0], [-25.0, -3.0]])
    case = Case(smoothed(Line("dead end", RawRoad(line, edges=(dead_end,)), RoadOptions()))[0], BUS)
    widenings = least_widenings(case, own_plans(case))
    assert widenings.depth is not None
    assert widenings.depth.depth == pytest.approx(0.2, abs=0.03)  # tolerances of need and verdict
    assert widenings.depth.area == pytest.approx(0.2 * BUS.width, abs=0.03 * BUS.width)


def test_a_union_that_rounding_defeats_is_made_on_a_grid_of_a_micrometre(monkeypatch: pytest.MonkeyPatch) -> None:
    """Areas that a long vehicle sweeps in a hairpin were no union on one kind of processor: "Ring edge missing"."""
    exact = shapely.union_all

    def fragile(areas: list[shapely.Polygon], grid_size: float | None = None) -> object:
        if grid_size is None:
            msg = "TopologyException: Ring edge missing"
            raise shapely.errors.GEOSException(msg)
        return exact(areas, grid_size=grid_size)

    monkeypatch.setattr(shapely, "union_all", fragile)
    assert united([shapely.box(0.0, 0.0, 2.0, 1.0), shapely.box(1.0, 0.0, 3.0, 1.0)]).area == pytest.approx(3.0, abs=1e-5)


@pytest.mark.parametrize(("change", "chosen"), [(1.0, [0, 0, 1, 1]), (3.0, [1, 1, 1, 1])])
def test_the_cheapest_way_changes_plans_where_that_costs_less_than_it_saves(change: float, chosen: list[int]) -> None:
    costs = np.array([[0.0, 0.0, 3.0, 3.0], [1.0, 1.0, 0.0, 0.0]])
    changes = np.repeat(change * (1.0 - np.eye(2))[:, :, None], 4, axis=2)
    assert cheapest_way(costs, changes) == chosen


@pytest.mark.slow
def test_the_inner_kerb_of_every_bend_moves_where_that_is_the_least_area() -> None:
    """Two corners, one to the left and one to the right; kerbs of both sides at both, or of one at both, take more than twice as much."""
    points = np.array([[0.0, 0.0], [50.0, 0.0], [50.0, 40.0], [100.0, 40.0]])
    road, _ = smoothed(Line("corners", RawRoad(points), RoadOptions(max_curvature=0.9 * BUS.max_curvature)))
    case = Case(road.with_limits(3.0, 3.0), BUS)
    widening = least_widenings(case, own_plans(case)).area
    assert widening is not None
    assert verdict_of(widening.then).fits is True
    deep = [patch for patch in widening.patches if patch.depth > 0.5]
    assert [patch.side for patch in deep] == ["left", "right"]
    assert [patch.polygon.area for patch in deep] == pytest.approx([2.9, 2.9], abs=0.4)  # one such corner alone needs 2.8 m2
