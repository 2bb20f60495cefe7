"""Planning step by step: the same plans as in one piece; and legs that are driven past their drawn cusps, or stop short of them."""

from __future__ import annotations

import re

import numpy as np
import pytest
import shapely

import hdvplan
from hdvplan import stepping
from hdvplan.api import drive_case
from hdvplan.errors import OptionError, PlanError
from hdvplan.legs import past, plan_legs
from hdvplan.planning.bias import Bias
from hdvplan.road.legs import Leg, Legs
from hdvplan.road.load_legs import within
from hdvplan.road.path import from_curvature
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle
from tests.fakes import Fake


def case_of(vehicle: str, half_width: float) -> hdvplan.Case:
    road = hdvplan.load_road("uturn").with_limits(half_width, half_width)
    return hdvplan.Case(road, hdvplan.load_vehicle(vehicle), settings=hdvplan.PlannerSettings(horizon=30.0))


@pytest.mark.parametrize(("vehicle", "half_width"), [("bus", 2.6), ("semitrailer-active", 3.2)])
def test_an_undisturbed_loop_drives_what_plan_drives(vehicle: str, half_width: float) -> None:
    case = case_of(vehicle, half_width)
    stepper = hdvplan.Stepper(case)
    states, kappas, plans = [stepper.z], [], 0
    while not stepper.done:
        count, plan = stepper.count, stepper.plan()
        part = stepper.simulate(plan)
        states += list(part[1:])
        kappas += list(plan.kappa[:count])
        stepper.arrive(part[-1], plan.kappa[count - 1])
        plans += 1
    drive = hdvplan.plan(case).drive
    assert plans == len(drive.plans)
    assert np.array_equal(kappas, drive.kappa)
    assert np.abs(np.array(states) - drive.z).max() < 1e-9  # plan keeps poses between stations, which only divides the steps


def test_every_step_of_the_documented_loop_is_found_again_from_the_plane() -> None:
    stepper = hdvplan.Stepper(case_of("bus", 3.0))
    while not stepper.done:
        count, plan = stepper.count, stepper.plan()
        z = stepper.simulate(plan)[-1]
        guess = stepper.s
        stepper.arrive(z, plan.kappa[count - 1])
        x, y = stepper.path.to_plane(stepper.s, z[0])
        assert np.allclose(stepper.path.project(x, y, near=guess), (stepper.s, z[0]), rtol=0.0, atol=1e-9)
    assert stepper.s > stepper.case.road.path.length  # the last station is the first beyond the end


def test_a_plan_begins_where_the_vehicle_is_put() -> None:
    stepper = hdvplan.Stepper(case_of("bus", 3.5))
    first = stepper.plan()
    stepper.arrive(stepper.simulate(first)[-1] + [0.2, 0.01], first.kappa[stepper.count - 1])
    assert (stepper.at, stepper.s) == (10, 5.0)
    second = stepper.plan()
    assert np.allclose(second.z[0], stepper.z, atol=1e-12)
    assert abs(second.z[-1, 0] - first.z[-1, 0]) < 0.05  # and it comes back


def into_a_bend(curvature: float, offset: float) -> hdvplan.Case:
    path = from_curvature(np.array([0.0, 11.0, 17.0, 60.0]), np.array([curvature, curvature, 0.0, 0.0]))
    vehicle, settings = hdvplan.load_vehicle("tractor-trailer-24m"), hdvplan.PlannerSettings(horizon=50.0)
    return hdvplan.Case(hdvplan.Road("bend", path), vehicle, settings=settings, bias=Bias.constant(offset))


@pytest.mark.parametrize("offset", [0.0, -0.1])
def test_a_loop_starts_in_a_tight_bend_as_plan_does(offset: float) -> None:
    case = into_a_bend(-0.124, offset)
    stepper, drive = hdvplan.Stepper(case), drive_case(case)
    assert not np.array_equal(drive.z[0], drive.stations.centring.states[0])  # it has come along the road's continuation
    assert np.array_equal(stepper.z, drive.z[0])
    for expected in drive.plans[:2]:
        plan = stepper.plan()
        assert np.array_equal(plan.kappa, expected.kappa)
        stepper.arrive(drive.z[stepper.at + stepper.count], plan.kappa[stepper.count - 1])


def test_a_bend_that_cannot_be_driven_into_is_said_before_the_first_step() -> None:
    with pytest.raises(PlanError, match="a bend into which the tractor-trailer-24m cannot be driven"):
        hdvplan.Stepper(into_a_bend(-0.8, 0.0))


@pytest.mark.parametrize("wrong", [[0.0], [0.0, np.nan]])
def test_a_wrong_state_is_refused(wrong: list[float]) -> None:
    stepper = hdvplan.Stepper(case_of("bus", 3.5))
    with pytest.raises(hdvplan.HdvplanError, match="is 2 finite numbers"):
        stepper.arrive(np.array(wrong), 0.0)
    assert stepper.at == 0


def test_a_curvature_that_the_vehicle_cannot_steer_was_not_driven() -> None:
    stepper = hdvplan.Stepper(case_of("bus", 3.5))
    with pytest.raises(OptionError, match=r"curvature of -0\.5 1/m was not driven: the bus steers up to 0\.\d+ 1/m"):
        stepper.arrive(stepper.z, -0.5)
    assert stepper.at == 0


def test_from_far_beside_the_line_there_is_no_plan_but_one_that_leads_on() -> None:
    """From 50 m beside it the plan was 36 m beside it half a metre on, and called solved."""
    case = hdvplan.Case(hdvplan.load_road("uturn").with_limits(3.5, 3.5), hdvplan.load_vehicle("bus"))
    for off in (-50.0, 15.0, 50.0):
        stepper = hdvplan.Stepper(case)
        stepper.arrive(stepper.z + np.eye(len(stepper.z))[0] * off, 0.0)
        if abs(off) > 20.0:
            with pytest.raises(PlanError, match=r"no plan was found that leads on from 50\.0 m beside the road's line"):
                stepper.plan()
        else:
            plan = stepper.plan()
            assert np.max(np.abs(stepper.simulate(plan) - plan.z[: stepper.count + 1])) < 0.05


def put(z: list[float], *, after: tuple[list[float], ...] = ()) -> hdvplan.Stepper:
    """Return a stepper at the station 10 in a state, after plans from others there."""
    stepper = hdvplan.Stepper(hdvplan.Case(hdvplan.load_road("uturn").with_limits(3.0, 3.0), hdvplan.load_vehicle("bus")))
    for before in after:
        stepper.arrive(np.array(before), 0.0)
        with pytest.raises(PlanError):
            stepper.plan()
        stepper.at = 0
    stepper.arrive(np.array(z), 0.0)
    return stepper


@pytest.mark.parametrize("before", [[30.0, 0.0], [0.0, 1.5], [0.0, 2.0]])
def test_a_plan_after_one_that_was_refused_is_that_of_a_new_stepper(before: list[float]) -> None:
    """The next began at the motion that did not lead on: unusable, 23 m beyond a limit, and nothing was raised."""
    with pytest.raises(PlanError):
        put([0.0, 1.5], after=([30.0, 0.0],)).plan()
    plan, expected = put([0.3, 0.1], after=(before, before)).plan(), put([0.3, 0.1]).plan()
    assert expected.usable
    assert np.array_equal(plan.z, expected.z)
    assert np.array_equal(plan.kappa, expected.kappa)


@pytest.mark.parametrize(("off", "said"), [
    (1.5, "leads on from 0.0 m beside the road's line, with a heading error of 86 degrees"),
    (-np.pi / 2, "a heading error of -90 degrees: along the road's line a vehicle is planned below 90"),
    (2.0, "a heading error of 115 degrees: along the road's line a vehicle is planned below 90"),
])  # fmt: skip
def test_a_heading_from_which_no_plan_leads_on_is_named(off: float, said: str) -> None:
    with pytest.raises(PlanError, match=re.escape(said)) as raised:
        put([0.0, off]).plan()
    assert "heading" in str(raised.value.hint)


def test_where_no_program_is_solved_the_last_plan_goes_on_for_a_vehicle_that_is_near_it(monkeypatch: pytest.MonkeyPatch) -> None:
    first = put([0.0, 0.0]).plan()
    monkeypatch.setattr(stepping, "dependable", lambda _: Fake("giving up", honest=first.qp_count))
    stepper = put([0.0, 0.0])
    count = stepper.count
    assert stepper.plan().usable
    stepper.arrive(first.z[count] + [0.1, 0.0], first.kappa[count - 1])
    plan = stepper.plan()
    assert not plan.usable
    assert np.array_equal(plan.kappa[: len(first.kappa) - count - 1], first.kappa[count:-1])
    stepper.arrive(np.array([3.0, 0.0]), plan.kappa[count - 1])
    with pytest.raises(PlanError, match="leads on from 3"):
        stepper.plan()


STRAIGHT = from_curvature([0.0, 20.0], [0.0, 0.0])
BOTH = Legs("back and forth", (Leg(Road("out", STRAIGHT), False), Leg(Road("back", STRAIGHT), True)))


def bend(wall_m: float) -> Legs:
    """Return a bend that is driven and backed along again, and a wall so far beyond its end."""
    path = from_curvature([0.0, 12.0, 16.0, 26.0], [0.0, 0.0, 0.06, 0.06])
    end = path.at(path.length)
    ahead, left = np.array([np.cos(end.heading), np.sin(end.heading)]), np.array([-np.sin(end.heading), np.cos(end.heading)])
    centre = np.array([float(end.x), float(end.y)]) + wall_m * ahead
    wall = Region(
        Kind.OBSTACLE, shapely.Polygon([centre - 9 * left, centre + 9 * left, centre + 9 * left + ahead, centre - 9 * left + ahead]), "wall"
    )
    return Legs("bend", tuple(within(Leg(Road("bend", path), backward), (wall,)) for backward in (False, True)), (), (wall,))


def test_a_cusp_past_the_drawn_one_lengthens_both_of_its_legs_and_moves_nothing_else() -> None:
    for by in (1.5, -1.5):
        first, second = past(BOTH, np.array([by])).legs
        assert first.road.path.length == second.road.path.length == pytest.approx(20.0 + by, abs=1e-9)
        for leg in (first, second):
            end = leg.road.path.at(leg.road.path.length)
            assert float(end.x) == pytest.approx(20.0 + by, abs=1e-6)
            assert float(leg.road.path.at(0.0).x) == pytest.approx(0.0, abs=1e-6)


def test_where_the_drawn_cusp_leaves_no_room_to_a_wall_the_legs_stop_short_of_it() -> None:
    truck = load_vehicle("rigid-truck")
    legs = bend(truck.lead.front - 0.4)  # the front would stand in the wall
    drawn = plan_legs(legs, truck, refine=False)
    assert drawn.fits is False
    assert drawn.past == ()
    moved = plan_legs(legs, truck)
    assert moved.fits
    assert -8.0 <= moved.past[0] < -0.3  # as far as legs may stop short; as far as they lack room, but for what planning finds beside it
    assert moved.room > drawn.room


def test_a_single_leg_has_no_cusp_to_move() -> None:
    narrow = Road("back", STRAIGHT).with_limits(1.0, 1.0)
    assert plan_legs(Legs("back", (Leg(narrow, True),)), load_vehicle("rigid-truck")).past == ()


def test_a_plan_that_fits_is_along_the_drawn_cusps() -> None:
    truck = load_vehicle("rigid-truck")
    assert plan_legs(bend(truck.lead.front + 3.0), truck).past == ()
