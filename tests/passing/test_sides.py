"""On which side obstacles are passed: what brute force finds, in time that grows with their number alone."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

import hdvplan.passing.sides
from hdvplan.api import plan
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.errors import RoadError
from hdvplan.judging.verdict import verdict_of
from hdvplan.passing import options
from hdvplan.passing.sides import choose_sides
from hdvplan.planning.bias import Bias
from hdvplan.planning.settings import PlannerSettings
from hdvplan.report.summary import crossed_texts, summary_of
from hdvplan.road.regions import Side
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle
from tests.nightly import nightly
from tests.passing.arrangements import free_by_force, road_with, slalom

BUS = load_vehicle("bus")
L, R = Side.LEFT, Side.RIGHT
STAGGER = [(60.0, 63.0, -1.5, 1.4), (78.0, 81.0, -1.4, 1.5)]  # by room left, then right: 15 m are too short to change sides
DEADEND = [(60.0, 63.0, -1.4, 1.3), (73.0, 79.0, -1.0, 4.6)]  # by room left, and there the second one is a wall


def sides_of(road: Road, vehicle: str = "bus") -> list[Side]:
    return [passed.side for passed in choose_sides(Case(road, load_vehicle(vehicle)))[1]]


@pytest.mark.parametrize("boxes", [STAGGER, DEADEND])
@pytest.mark.parametrize("vehicle", ["bus", "tractor-semitrailer"])
def test_a_side_that_leads_into_the_next_obstacle_is_not_taken(boxes: list[tuple[float, float, float, float]], vehicle: str) -> None:
    result = plan(Case(road_with(boxes), load_vehicle(vehicle)))
    assert verdict_of(result).fits
    assert len({passed.side for passed in result.passed}) == 1
    for passed in result.passed:
        if passed.other is not None:
            assert passed.other.violation > 0.2  # changing sides is some decimetres short
            assert passed.own is not None
            assert passed.own.violation == 0.0


def test_a_closed_side_is_not_tried_and_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hdvplan.passing.sides, "tried", lambda *_: pytest.fail("nothing is to be tried"))
    (passed,) = choose_sides(Case(road_with([(60.0, 66.0, -1.0, 2.5)]), BUS))[1]
    assert (passed.side, passed.other) == (R, None)
    assert passed.reason == "left is closed: 2.10 m to the left of it, 2.54 m needed"
    wall = road_with([(60.0, 66.0, -1.0, 1.0), (50.0, 76.0, 2.5, 4.6)])  # a side is closed by another obstacle, too
    assert [one.side for one in choose_sides(Case(wall, BUS))[1]] == [R, R]


def test_an_obstacle_that_the_swept_area_does_not_come_near_costs_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hdvplan.passing.sides, "tried", lambda *_: pytest.fail("nothing is to be tried"))
    ((passed,)) = choose_sides(Case(road_with([(60.0, 66.0, 2.0, 4.0)], half_width=None), BUS))[1]
    assert (passed.side, passed.reason) == (R, "the swept area does not come near it")
    assert choose_sides(Case(road_with([(60.0, 66.0, 2.0, 4.0)]), BUS, bias=Bias.constant(-1.0)))[1][0].reason is not None
    plain = replace(road_with([(60.0, 66.0, 2.0, 4.0)]), regions=())
    assert choose_sides(Case(plain, BUS)) == (plain, ())


def test_a_detour_that_leads_to_an_obstacle_beside_the_line_opens_both_of_its_sides() -> None:
    # Left of the first one only a gap of 1.5 m remains before the second, right of it the road ends: left of both.
    boxes = [(60.0, 66.0, -2.0, 0.6), (62.0, 65.0, 2.1, 3.1)]
    result = plan(Case(road_with(boxes).with_limits(7.0, 4.2), BUS))
    assert [passed.side for passed in result.passed] == [L, L]
    assert verdict_of(result).fits


@pytest.mark.parametrize(("right", "side"), [(2.5, R), (2.3, R), (1.9, L)])
def test_an_obstacle_beside_the_line_is_passed_as_the_line_passes_it_where_the_vehicle_fits(right: float, side: Side) -> None:
    road = road_with([(60.0, 66.0, 0.5, 2.0)]).with_limits(9.0, right)  # right of it 3.0, 2.8 and 2.4 m: too little, too, for the clearance
    result = plan(Case(road, BUS, settings=PlannerSettings(clearance=0.2)))
    assert [passed.side for passed in result.passed] == [side]
    warned = "the obstacle 'o0' at s = 63.0 m is passed on the left, the line passes it on the right"
    assert [text.split(":")[0] for text in crossed_texts(summary_of(result))] == ([warned] if side is L else [])


def test_a_side_is_forced_for_one_obstacle_or_for_all_on_the_line() -> None:
    one = [(60.0, 63.0, -0.5, 0.5), (160.0, 163.0, -0.5, 0.5), (220.0, 223.0, 3.0, 4.0)]
    road = road_with(one, half_width=6.0, sides=[None, R])
    assert sides_of(road.passed_on(L)) == [L, R, R]  # its own side counts more, and the last one is not on the line
    passed = choose_sides(Case(road.passed_on(L), BUS))[1]
    assert [p.forced for p in passed] == [True, True, False]
    assert all(p.other is None and p.reason for p in passed)


def test_a_forced_side_without_room_is_refused_with_what_is_missing_and_where() -> None:
    road = road_with([(60.0, 66.0, -1.0, 2.5)], sides=[L])
    message = r"the obstacle 'o0' at s = 63\.0 m cannot be passed on the left: 2\.10 m to the left of it, 2\.54 m needed, 0\.44 m missing"
    with pytest.raises(RoadError, match=message) as caught:
        plan(Case(road, BUS))
    assert caught.value.s_m == pytest.approx(63.0, abs=0.1)
    with pytest.raises(RoadError, match=r"3\.04 m needed, 0\.44 m missing"):  # 2.6 m right of it; with 0.25 m to keep on either side
        plan(Case(road_with([(60.0, 66.0, -2.0, 1.0)], sides=[R]), BUS, settings=PlannerSettings(clearance=0.25)))


def test_the_case_that_was_asked_is_the_one_of_the_result_and_gives_the_same_plan_after_pickling() -> None:
    case = Case(road_with(STAGGER), BUS)
    again = pickle.loads(pickle.dumps(case))  # noqa: S301 - our own bytes
    result, other = plan(case), plan(again)
    assert result.case.key == case.key == other.case.key
    np.testing.assert_array_equal(result.drive.z, other.drive.z)
    assert [passed.side for passed in result.passed] == [passed.side for passed in other.passed]


def test_obstacles_far_apart_are_tried_by_themselves(monkeypatch: pytest.MonkeyPatch) -> None:
    boxes = [(s, s + 3.0, -1.0, 1.1) for s in (60.0, 160.0, 260.0)]
    tries = trials_of(Case(road_with(boxes), BUS), monkeypatch)
    assert tries == 6  # either side of each


@pytest.mark.slow
def test_the_work_is_linear_in_the_number_of_obstacles(monkeypatch: pytest.MonkeyPatch) -> None:
    boxes = [(60.0 + 14.0 * i, 62.0 + 14.0 * i, -1.2 - 0.2 * (i % 2), 1.4 - 0.2 * (i % 2)) for i in range(9)]
    three, six, nine = (trials_of(Case(road_with(boxes[:count]), BUS), monkeypatch) for count in (3, 6, 9))
    assert nine - six <= six - three + 4  # as much for the next three as for the last three; 4 where fewer have neighbours


def test_a_large_group_is_searched_part_by_part_beside_what_is_settled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hdvplan.passing.sides, "_MOST_TOGETHER", 2)
    assert verdict_of(plan(Case(slalom(24, 4, (3.0, 18.0)), BUS))).fits  # a group of four


def test_after_enough_trials_obstacles_are_passed_on_their_usual_side_and_say_so(monkeypatch: pytest.MonkeyPatch) -> None:
    case = Case(road_with([(s, s + 3.0, -1.0, 1.1) for s in (60.0, 160.0, 260.0, 360.0)]), BUS)
    monkeypatch.setattr(hdvplan.passing.sides, "_MOST_TRIALS", 3)
    assert trials_of(case, monkeypatch) == 4  # two for each of the first two, none for the others
    passed = choose_sides(case)[1]
    assert [one.own is None for one in passed] == [False, False, True, True]
    assert [one.side for one in passed[2:]] == [R, R]
    assert all("no other side was tried" in (one.reason or "") for one in passed[2:])


def test_on_a_road_that_is_blocked_again_and_again_no_sides_are_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    walls = [(s, s + 1.0, -4.0, 4.0) for s in 60.0 + 5.0 * np.arange(21)]
    case = Case(road_with([*walls, (260.0, 263.0, -1.0, 1.1)]), BUS)
    assert trials_of(case, monkeypatch) == 0
    last = choose_sides(case)[1][-1]
    assert (last.side, last.own, last.reason) == (R, None, "no other side was tried: 21 obstacles block the road")
    assert trials_of(Case(road_with([*walls[1:], (260.0, 263.0, -1.0, 1.1)]), BUS), monkeypatch) == 2


def test_obstacles_close_each_other_one_by_one_and_only_those_beside_are_looked_at_again(monkeypatch: pytest.MonkeyPatch) -> None:
    looked, room = list[int](), options._room

    def noted(road: Road, spans: FloatArray, number: int, side: Side, others: dict[int, Side]) -> float:
        looked.append(number)
        return room(road, spans, number, side, others)

    monkeypatch.setattr(options, "_room", noted)
    boxes = [(60.0, 65.0, -1.2, 4.6), *((60.0 + 4.0 * i, 65.0 + 4.0 * i, -0.5, 0.5) for i in range(1, 20))]
    passed = choose_sides(Case(road_with(boxes), BUS))[1]
    assert [one.side for one in passed] == [R] * 20
    assert [one.reason for one in passed[1:3]] == [f"left is closed: 0.00 m to the left of it, {BUS.width:.2f} m needed"] * 2
    assert len(looked) <= 6 * len(boxes)  # either side of the one itself, before, and of the one behind


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", [nightly("bus"), "tractor-trailer"])
@pytest.mark.parametrize(
    ("seed", "count", "gaps"),
    [
        (1, 3, (5.0, 25.0)),
        (21, 4, (3.0, 18.0)),
        nightly(10, 3, (5.0, 25.0)),
        *(nightly(seed, 4 + seed % 3, (3.0, 18.0)) for seed in (20, 22, 23, 24)),
    ],
)
def test_whatever_brute_force_finds_free_is_found(seed: int, count: int, gaps: tuple[float, float], vehicle: str) -> None:
    case = Case(slalom(seed, count, gaps), load_vehicle(vehicle))
    assert verdict_of(plan(case)).fits is any(True for _ in free_by_force(case))


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", [nightly("bus"), "tractor-trailer"])
def test_twenty_obstacles_are_passed_free(vehicle: str) -> None:
    assert verdict_of(plan(Case(slalom(206, 20, (8.0, 32.0)), load_vehicle(vehicle)))).fits


def trials_of(case: Case, monkeypatch: pytest.MonkeyPatch) -> int:
    calls, real = [0], hdvplan.passing.sides.tried

    def counted(*arguments: object) -> object:
        calls[0] += 1
        return real(*arguments)  # type: ignore[arg-type] # passed on as they come

    with monkeypatch.context() as patched:
        patched.setattr(hdvplan.passing.sides, "tried", counted)
        choose_sides(case)
    return calls[0]
