"""The judge of every plan: bodies are swept continuously along the kerbs, against known answers and against poses every millimetre."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.arrays import FloatArray
from hdvplan.centring.stationary import CentringTable, stationary
from hdvplan.driving.drive import Drive, simulate
from hdvplan.judging.balance import balance_of
from hdvplan.judging.clearance import touches_of
from hdvplan.planning.objectives import geometric
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import stations_of
from hdvplan.road.limits import Limits
from hdvplan.road.path import ReferencePath, from_curvature
from hdvplan.road.pieces import Kerb
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.vehicle import kinematics
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.chains import arc, few, three_units, winding
from tests.core.twins.kinematics import evaluate
from tests.core.twins.street import TO_JUDGE, look
from tests.nightly import nightly

BUS, TRAILER = load_vehicle("bus"), load_vehicle("tractor-trailer")
SAME = 1e-9  # rounding of coordinates of 1 km, where kerbs go on


def driven(road: Road, vehicle: Vehicle, z: FloatArray, kappa: FloatArray) -> Drive:
    """Return a drive from its first state on, with a curvature for every half metre."""
    stations = stations_of(road, vehicle, CentringTable.of(vehicle), step=0.5, horizon=20.0)
    poses = simulate(vehicle.table(), stations.path, 0.0, 0.5, z, kappa, 2)
    poses_s = 0.25 * np.arange(len(poses), dtype=np.float64)
    held, settings = np.repeat(kappa, 2), PlannerSettings(horizon=20.0)
    return Drive(road, vehicle, settings, stations, geometric(stations, vehicle), poses[::2], kappa, poses_s, poses, held, (), 0.0)


def straight(road: Road, vehicle: Vehicle, e_y: float = 0.0) -> Drive:
    """Return a drive along a straight road, beside its line."""
    return driven(road, vehicle, np.eye(vehicle.states)[0] * e_y, np.zeros(round(road.path.length / 0.5)))


def drawn(path: ReferencePath, *kerbs: Kerb) -> Road:
    return Road("drawn", path, Limits.constant(20.0, 20.0, path.length), drawn=kerbs)


def gap(done: Drive, side: str | None = None, region: str = "drivable") -> float:
    """Return the least gap of all bodies, to one side or both."""
    touches = touches_of(done, np.arange(0.0, done.road.path.length, 0.25))
    return float(min(np.min(touch["gap"]) for (of, what), touch in touches.items() if what == region and side in {of, None}))


@pytest.mark.parametrize("vehicle", [BUS, TRAILER, three_units()], ids=lambda v: v.name)
def test_in_a_straight_passage_a_body_leaves_what_it_is_narrower(vehicle: Vehicle) -> None:
    done = straight(Road("straight", arc(0.0, 60.0)).with_limits(2.0, 1.6), vehicle, 0.1)
    touches = touches_of(done, np.arange(0.0, 60.0, 0.25))
    for number, unit in enumerate(vehicle.units):
        for side, room in (("left", 1.9), ("right", 1.7)):
            assert np.min(touches[side, "drivable"]["gap"][number]) == pytest.approx(room - 0.5 * unit.width, abs=SAME)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("vehicle", [BUS, TRAILER], ids=lambda v: v.name)
def test_a_vehicle_in_a_steady_circle_is_as_near_to_both_arcs_as_its_radii_say(vehicle: Vehicle, sign: float) -> None:
    radius, reach = 15.0, 4.0
    circle = stationary(vehicle, np.array([1.0 / radius]))
    lead = last = 1.0 / float(circle.kappa[0])
    if len(vehicle.units) > 1:
        last = float(np.sqrt(lead**2 + vehicle.lead.hitch_offset**2 - vehicle.units[1].wheelbase ** 2))
    half, turned = 0.5 * vehicle.width, np.linspace(-1.4, 3.4, 1000)  # kerbs begin behind the vehicle and end before it
    kerbs = []
    for left in (True, False):
        far = radius - sign * reach if left else radius + sign * reach
        points = np.stack([far * np.sin(turned), sign * (radius - far * np.cos(turned))], axis=1)
        kerbs.append(Kerb(points, radius * turned, left, goes_on=False))
    state = sign * np.concatenate([[radius - lead, 0.0], circle.beta[0]])
    done = driven(drawn(arc(sign / radius, 40.0), *kerbs), vehicle, state, np.full(80, sign / lead))
    inside, outside = ("left", "right") if sign > 0.0 else ("right", "left")
    # chords of 9 cm lie 0.1 mm off their arc
    assert gap(done, outside) == pytest.approx(radius + reach - np.hypot(lead + half, vehicle.lead.front), abs=1e-3)
    assert gap(done, inside) == pytest.approx(last - half - (radius - reach), abs=1e-3)


@pytest.mark.parametrize("apart", [-0.2, -0.001, 0.001, 0.05, 0.3])
def test_a_front_corner_that_passes_a_point_of_a_kerb_is_as_near_as_its_circle_is(apart: float) -> None:
    radius = 15.0
    lead = 1.0 / float(stationary(BUS, np.array([1.0 / radius])).kappa[0])
    reach = np.hypot(lead + 0.5 * BUS.width, BUS.lead.front) + apart
    turned = np.array([1.0, 1.5, 2.0])  # around (0, 15), from below
    far = np.array([reach + 30.0, reach, reach + 30.0])
    points = np.stack([far * np.sin(turned), radius - far * np.cos(turned)], axis=1)
    point = Kerb(points, radius * turned, left=False, goes_on=False)
    done = driven(drawn(arc(1.0 / radius, 80.0), point), BUS, np.array([radius - lead, 0.0]), np.full(160, 1.0 / lead))
    # The corner moves across the direction to the point: within a quarter of the gap, or 5 mm, of it the distance grows by 3 % of the
    # gap, or by (2.5 mm)^2 / 1 mm. Beyond it the point lies beside a corner of 90 degrees, which is as deep in 5 mm.
    found = gap(done, "right")
    assert apart - SAME <= found
    if apart > 0.0:
        assert found <= apart + max(0.03 * apart, 0.006)
    else:
        assert found <= max(0.0, apart + 2e-3)  # that much less than it is deep may be missed


def test_a_contact_has_its_place_and_the_body_s_point() -> None:
    spike = Kerb(
        np.array([[0.0, 3.0], [29.9, 3.0], [30.0, 1.2], [30.1, 3.0], [60.0, 3.0]]), np.array([0.0, 29.9, 30.0, 30.1, 60.0]), left=True
    )
    done = straight(drawn(arc(0.0, 60.0), spike), BUS)
    touch = touches_of(done, np.arange(0.0, 60.0, 0.25))["left", "drivable"][0]
    deepest = touch[np.argmin(touch["gap"])]
    assert deepest["gap"] == pytest.approx(1.2 - 0.5 * BUS.width, abs=SAME)
    assert deepest["s"] == pytest.approx(30.0, abs=SAME)
    assert deepest["y"] == pytest.approx(0.5 * BUS.width, abs=SAME)
    assert deepest["x"] == pytest.approx(30.0, abs=SAME)
    (breach,) = balance_of(done).breaches
    assert breach.place == pytest.approx((30.0, 0.5 * BUS.width), abs=SAME)


def test_a_long_obstacle_that_is_entered_in_two_places_is_broken_in_two() -> None:
    edge = 0.5 * BUS.width
    wall = [(5.0, 3.0), (20.0, edge - 0.2), (35.0, 3.0), (50.0, edge - 0.1), (65.0, 3.0), (65.0, 4.0), (5.0, 4.0)]
    walls = (Region(Kind.OBSTACLE, shapely.Polygon(wall), "wall"),)
    road = Road("walled", arc(0.0, 80.0), Limits.constant(20.0, 20.0, 80.0), regions=walls)
    balance = balance_of(straight(road, BUS))
    (whole,), (first, second) = balance.approaches, balance.breaches
    for breach, depth, s in ((first, 0.2, 20.0), (second, 0.1, 50.0)):
        half = depth * 15.0 / (3.0 - edge + depth)  # where a side of the wall crosses that of the bus
        assert (breach.depth, breach.s_deepest, breach.s_from, breach.s_to) == pytest.approx((depth, s, s - half, s + half), abs=1e-6)
    assert (whole.distance, whole.s, whole.s_from, whole.s_to) == (-first.depth, first.s_deepest, first.s_from, second.s_to)


@pytest.mark.parametrize("where", ["before the start", "beyond the end"])
def test_what_lies_before_the_start_and_beyond_the_end_is_judged(where: str) -> None:
    s = {"before the start": -2.0, "beyond the end": 63.0}[where]
    along = np.array([-30.0, s - 0.1, s, s + 0.1, 90.0])
    across = np.array([3.0, 3.0, 1.0, 3.0, 3.0])
    for side, sign in (("left", 1.0), ("right", -1.0)):
        road = drawn(arc(0.0, 60.0), Kerb(np.stack([along, sign * across], axis=1), along, left=side == "left"))
        done = straight(road, BUS)
        assert gap(done, side) == pytest.approx(1.0 - 0.5 * BUS.width, abs=SAME)
        (breach,) = balance_of(done).breaches
        assert breach.side == side
        assert breach.s_deepest == pytest.approx(s, abs=SAME)


def loop() -> ReferencePath:
    """Return a road that turns left by 270 degrees and crosses its own beginning."""
    return from_curvature(np.array([0.0, 40.0, 44.0, 44.0 + 15.0 * 1.5 * np.pi - 4.0, 44.0 + 15.0 * 1.5 * np.pi, 160.0]),
                          np.array([0.0, 0.0, 1.0 / 15.0, 1.0 / 15.0, 0.0, 0.0]))  # fmt: skip


def test_where_a_road_crosses_itself_the_kerbs_of_its_other_arm_do_not_count() -> None:
    path = loop()
    s = np.arange(0.0, 160.0, 0.5)
    road = Road("loop", path).with_limits(2.0, 5.0)
    assert road.street is not None
    line = np.stack(path.to_plane(s, 0.0), axis=1)
    assert all(shapely.crosses(shapely.LineString(line), shapely.LineString(kerb.points)) for kerb in road.street.kerbs)
    done = driven(road, BUS, np.zeros(2), path.at(s + 0.25).curvature)
    # The rear axle follows the line but for half a step's change of curvature; its inner side is nearest to the left kerb.
    assert gap(done, "left") == pytest.approx(2.0 - 0.5 * BUS.width, abs=0.02)


def test_a_closed_road_has_its_kerbs_in_every_lap() -> None:
    radius = 20.0
    turned = np.linspace(0.0, 2.0 * np.pi, 2001)
    path = replace(arc(1.0 / radius, 2.0 * np.pi * radius), closed=True)
    far = np.where(np.arange(2001) == 1974, radius - 1.2, radius - 3.0)  # a spike just before the lap's end
    inner = Kerb(np.stack([far * np.sin(turned), radius - far * np.cos(turned)], axis=1), radius * turned, left=True)
    lead = 1.0 / float(stationary(BUS, np.array([1.0 / radius])).kappa[0])
    done = driven(drawn(path, inner), BUS, np.array([radius - lead, 0.0]), np.full(4, 1.0 / lead))
    touch = touches_of(done, np.arange(0.0, path.length, 0.25))["left", "drivable"][0]
    deepest = touch[np.argmin(touch["gap"])]
    assert deepest["s"] == pytest.approx(radius * turned[1974], abs=0.1)  # the tail stands there at the start
    assert deepest["gap"] < 0.0


def dense(done: Drive) -> float:
    """Return the least gap of all bodies at poses every millimetre."""
    path, vehicle, low = done.stations.path, done.vehicle, np.inf
    assert done.stations.street is not None
    for i, kappa in enumerate(done.kappa):
        s = 0.5 * i
        states = simulate(vehicle.table(), path, s, 0.5, done.z[i], np.array([kappa]), 500)
        places = np.ascontiguousarray(s + 0.001 * np.arange(501))
        point = np.stack([evaluate(path, at) for at in places], axis=1)
        poses = kinematics.place_many(vehicle.table(), np.ascontiguousarray(point), states)
        low = min(low, float(np.min(look(done.stations.street, vehicle, places, poses, TO_JUDGE)["at"]["gap"])))
    return low


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", [nightly(BUS), TRAILER, nightly(three_units())], ids=lambda v: v.name)
@given(seed=st.integers(0, 10**6))
@few
def test_no_pose_between_those_that_are_looked_at_comes_nearer_by_more_than_two_millimetres(vehicle: Vehicle, seed: int) -> None:
    random, path = np.random.default_rng(seed), winding()
    s = np.sort(np.append(random.uniform(0.0, 110.0, 40), [0.0, 110.0]))
    sides = []
    for side, sign in ((True, 1.0), (False, -1.0)):
        x, y = path.to_plane(s, sign * random.uniform(1.5, 5.0, len(s)))
        sides.append(Kerb(np.stack([x, y], axis=1), s, side))
    kappa = path.at(np.asarray(0.5 * np.arange(40) + 0.25, float)).curvature + random.uniform(-0.02, 0.02, 40)
    done = driven(drawn(path, *sides), vehicle, 0.1 * random.uniform(-1.0, 1.0, vehicle.states), kappa)
    true, found = dense(done), gap(done)
    # Within a quarter of the room, or 5 mm, a front corner closes in by less than a third of the way.
    assert true - 1e-3 <= found <= true + 2e-3 + max(0.1 * true, 0.0)
