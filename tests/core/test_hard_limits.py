"""Limits: what they may be, that bind, that can hardly be kept, and that cannot: the least bad plan always exists."""

from dataclasses import replace

import numpy as np
import pytest

from hdvplan.api import drive_case
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.driving.drive import drive
from hdvplan.driving.start import approach_to
from hdvplan.errors import OptionError, RoadError
from hdvplan.judging.balance import balance_of
from hdvplan.judging.envelope import Envelope
from hdvplan.planning.objectives import geometric, lead_axle
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.road.limits import Limits
from hdvplan.road.load import load_road
from hdvplan.road.options import RoadOptions
from hdvplan.road.path import ReferencePath, from_curvature, from_samples
from hdvplan.road.road import Road, part_of
from hdvplan.road.scenarios import uturn, uturn_profile
from hdvplan.solvers.riccati import RiccatiWorkspace
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.chains import arc

BUS, TRAILER = load_vehicle("bus"), load_vehicle("tractor-trailer")
FAR_M = 3.5


def passage(width: float, reach: float = 0.5) -> Road:
    """Return a straight road on which an obstacle from the right reaches ``reach`` over the centre and leaves ``width`` beside it."""
    s = np.array([0.0, 100.0 - 1e-6, 100.0, 108.0, 108.0 + 1e-6, 200.0])
    left, right = np.full(6, reach + width), np.array([-FAR_M, -FAR_M, reach, reach, -FAR_M, -FAR_M])
    return Road("passage", from_curvature(np.array([0.0, 200.0]), np.zeros(2)), Limits(s, left, right, left, right))


def kerb(reach: float) -> Road:
    """Return a right-angled bend with a lane 3.5 m wide and a kerb that overhangs may reach over, ``reach`` from the centre."""
    path = from_curvature(*uturn_profile(0.045, 12.0, angle=0.5 * np.pi))
    s, one = np.array([0.0, path.length]), np.ones(2)
    return Road("kerb", path, Limits(s, 1.75 * one, -1.75 * one, reach * one, -reach * one))


def test_a_rear_axle_objective_touches_a_hard_limit_to_a_centimetre_without_crossing_it() -> None:
    balance = balance_of(drive(uturn(), BUS, lead_axle, RiccatiWorkspace, PlannerSettings()))
    assert balance.min_clearance is not None
    assert 0.0 <= balance.min_clearance < 0.01  # asked for


@pytest.mark.parametrize("scheme", list(Scheme))
@pytest.mark.parametrize("vehicle", [BUS, TRAILER], ids=lambda v: v.name)
def test_a_passage_fifteen_centimetres_wider_than_the_vehicle_is_driven_without_contact(vehicle: Vehicle, scheme: Scheme) -> None:
    balance = balance_of(drive(passage(vehicle.width + 0.15), vehicle, geometric, RiccatiWorkspace, PlannerSettings(scheme=scheme)))
    assert balance.min_clearance is not None
    assert balance.min_clearance >= 0.0
    assert balance.breaches == ()


@pytest.mark.parametrize("scheme", list(Scheme))
def test_a_passage_fifteen_centimetres_narrower_is_impossible_at_its_place_and_by_its_depth(scheme: Scheme) -> None:
    done = drive(passage(BUS.width - 0.15), BUS, geometric, RiccatiWorkspace, PlannerSettings(scheme=scheme))
    balance = balance_of(done)
    assert all(plan.usable for plan in done.plans)
    by_side = {breach.side: breach for breach in balance.breaches}
    assert set(by_side) == {"left", "right"}
    assert 99.5 < by_side["right"].s_from < 101.0
    assert 107.0 < by_side["right"].s_to < 108.5
    together = by_side["left"].depth + by_side["right"].depth
    assert 0.15 <= together < 0.25  # the bus is so much too wide; the rest is that it stands not quite straight
    assert max(by_side["left"].depth, by_side["right"].depth) < 0.15  # shared between both sides


def test_a_bend_that_needs_the_kerb_is_driven_over_it_and_impossible_where_the_kerb_is_an_obstacle() -> None:
    over = balance_of(drive(kerb(3.0), BUS, lead_axle, RiccatiWorkspace, PlannerSettings()))
    assert over.breaches == ()
    against = balance_of(drive(kerb(1.75), BUS, lead_axle, RiccatiWorkspace, PlannerSettings()))
    assert against.violation > 0.3
    deepest = max(against.breaches, key=lambda breach: breach.depth)
    assert 50.0 < deepest.s_deepest < 100.0  # in the bend


def test_overhangs_leave_the_lane_less_when_wheels_must_stay_in_it_and_less_still_at_a_cost() -> None:
    furthest, area = [], []
    free = PlannerSettings(overhang_cost=0.0)
    for wheels, settings in ((4.0, free), (1.75, free), (1.75, PlannerSettings())):
        road = kerb(4.0)
        assert road.limits is not None
        done = drive(
            replace(road, limits=replace(road.limits, left=np.full(2, wheels), right=np.full(2, -wheels))),
            BUS, lead_axle, RiccatiWorkspace, settings,
        )  # fmt: skip
        envelope = Envelope(done)
        outside = np.maximum(envelope.reach_left - 1.75, 0.0) + np.maximum(-envelope.reach_right - 1.75, 0.0)
        furthest.append(float(np.max(outside)))
        area.append(float(np.trapezoid(outside, envelope.s)))
        assert balance_of(done).breaches == ()
    # the published steps are 30 % and 6 %, 20 % and 30 %, on another road: at least 5 % each
    assert furthest[0] * 0.95 > furthest[1]
    assert furthest[1] * 0.95 > furthest[2]
    assert area[0] * 0.95 > area[1]
    assert area[1] * 0.95 > area[2]


@pytest.mark.parametrize("vehicle", [BUS, TRAILER], ids=lambda v: v.name)
def test_the_price_of_a_violation_does_not_matter_while_none_is_needed(vehicle: Vehicle) -> None:
    road, plans = passage(vehicle.width + 0.3), []
    for dear in (1.0, 10.0):
        settings = PlannerSettings(scheme=Scheme.SQP, elastic_weight=1e4 * dear, elastic_growth=1e5 * dear, sqp_tolerance=1e-7)
        plans.append(drive(road, vehicle, geometric, RiccatiWorkspace, settings))
    # The bus is driven to the last digit. The trailer ends where two contacts are as tight: rows that follow a motion know one of them, and
    # SQP, which takes no step that they forbid, stops tenths of a millimetre off the hard program's solution.
    off = 1e-9 if vehicle is BUS else 3e-4
    assert max(plan.violation for done in plans for plan in done.plans) < off
    assert np.max(np.abs(plans[0].z - plans[1].z)) < off


def test_a_wall_in_a_bend_is_passed_and_not_turned_away_from() -> None:
    """A vehicle askew draws its corner back from a wall by turning towards it: a trap for whoever follows the wall's slope."""
    base = load_road("goteborg_tuvevagen_brunnsbo", RoadOptions(max_curvature=0.125))
    s = np.array([0.0, 720.0 - 1e-6, 720.0, 726.0, 726.0 + 1e-6, base.path.length])
    left, right = np.full(6, FAR_M), np.array([-FAR_M, -FAR_M, -0.8, -0.8, -FAR_M, -FAR_M])
    road = replace(base, limits=Limits(s, left, right, left, right))
    assert balance_of(drive(road, BUS, geometric, RiccatiWorkspace, PlannerSettings())).breaches == ()


def test_a_breach_of_both_limits_where_they_coincide_is_told_once() -> None:
    s, half = np.array([0.0, 60.0, 61.0, 120.0]), np.full(4, 1.2)  # narrower than the vehicle; in the second half for its wheels alone
    wide = np.array([1.2, 1.2, 2.0, 2.0])
    road = Road("strip", from_curvature(np.array([0.0, 120.0]), np.zeros(2)), Limits(s, half, -half, wide, -wide))
    breaches = balance_of(drive(road, TRAILER, geometric, RiccatiWorkspace, PlannerSettings())).breaches
    assert {breach.region for breach in breaches} == {"drivable", "sweepable"}
    places = [(breach.unit, breach.side, breach.part, round(breach.s_deepest)) for breach in breaches]
    assert len(set(places)) == len(places)


S = np.array([0.0, 10.0, 30.0])
WIDE = np.array([3.0, 2.5, 3.0])


def test_limits_are_linear_between_and_held_beyond() -> None:
    table = Limits(S, WIDE, -WIDE, WIDE + 1.0, -WIDE - 0.5).table(np.array([-5.0, 5.0, 10.0, 20.0, 99.0]))
    reach = np.array([3.0, 2.75, 2.5, 2.75, 3.0])
    assert np.allclose(table, [reach, -reach, reach + 1.0, -reach - 0.5], rtol=0.0, atol=1e-12)


def ring(length: float = 30.0) -> ReferencePath:
    turned = np.linspace(0.0, 2.0 * np.pi, 101)
    radius = length / (2.0 * np.pi)
    x, y, curvature = radius * np.sin(turned), radius * (1.0 - np.cos(turned)), np.full(101, 1.0 / radius)
    return from_samples(x, y, turned, curvature, length / 100, closed=True)


def test_what_lies_beyond_the_road_s_end_does_not_push_the_plan_over_a_limit_on_the_road() -> None:
    # The lane leaves the line to the left by one in eight: a front that follows it comes 1.2 m further to the left beyond the end.
    s = np.array([0.0, 40.0, 55.0, 70.0])
    left, right = np.array([3.0, 3.0, 3.375, 5.25]), np.array([-3.0, -3.0, 0.375, 2.25])
    slanted = Road("slanted", arc(0.0, 70.0), Limits(s, left, right, left, right))
    found = balance_of(drive_case(Case(slanted, load_vehicle("bus"), settings=PlannerSettings(horizon=50.0))))
    assert found.breaches == ()


def test_what_comes_to_the_start_of_a_closed_road_keeps_the_limits_of_the_lap_s_end() -> None:
    end = np.array([0.0, 28.0, 29.0, 30.0])
    narrow = Limits(end, np.array([4.0, 4.0, 2.0, 4.0]), np.full(4, -4.0), np.array([4.0, 4.0, 2.0, 4.0]), np.full(4, -4.0))
    vehicle, settings = load_vehicle("bus"), PlannerSettings(horizon=20.0)
    way = approach_to(Road("ring", ring(), narrow), vehicle, settings)
    part = part_of(Road("ring", ring(), narrow), 0.0, 15.0, 20.0, 20.0)
    for road, start in ((way, way.path.length), (part, 0.0)):
        assert road.given is not None
        (left,) = (kerb for kerb in road.given.unrolled(start - 2.0, start) if kerb.left)
        at = int(np.argmin(np.abs(left.s - (start - 1.0))))
        here = road.path.extended(20.0, 20.0).at(float(left.s[at]))
        assert np.hypot(left.points[at, 0] - here.x, left.points[at, 1] - here.y) == pytest.approx(2.0, abs=1e-3)  # in chords of 0.25 m


def changed(values: FloatArray, by: float) -> FloatArray:
    out = values.copy()
    out[1] += by
    return out


@pytest.mark.parametrize(
    ("left", "right", "left_sweep", "right_sweep", "word"),
    [
        (WIDE, -WIDE, changed(WIDE, -0.1), -WIDE, "less room than wheels on the left"),
        (WIDE, -WIDE, WIDE, changed(-WIDE, 0.1), "less room than wheels on the right"),
    ],
)
def test_limits_that_contradict_each_other_are_refused_with_their_place(
    left: FloatArray, right: FloatArray, left_sweep: FloatArray, right_sweep: FloatArray, word: str
) -> None:
    with pytest.raises(RoadError, match=word) as caught:
        Limits(S, left, right, left_sweep, right_sweep)
    assert caught.value.s_m == 10.0


@pytest.mark.parametrize(
    ("left", "right", "named"),
    [
        (0.0, 3.0, "left limit"),
        (np.nan, 3.0, "left limit"),
        (3.0, -2.0, "right limit"),
        (3.0, np.inf, "right limit"),
        (-3.0, -3.0, "half width"),
    ],
)
def test_a_constant_limit_is_a_positive_number_of_metres(left: float, right: float, named: str) -> None:
    with pytest.raises(OptionError, match=f"the {named} must be a positive number"):
        Limits.constant(left, right, 100.0)


@pytest.mark.parametrize(("left", "right", "named"), [(3750.0, 3750.0, "half width"), (3.0, 250.1, "right limit")])
def test_a_constant_limit_that_no_street_has_is_refused(left: float, right: float, named: str) -> None:
    with pytest.raises(OptionError, match=f"the {named} must be at most 250 m, not {right:g}") as caught:
        Limits.constant(left, right, 100.0)
    assert caught.value.hint == "is it in metres?"
    assert Limits.constant(250.0, 250.0, 100.0).right[0] == -250.0
