"""Legs: driven forwards and backwards, planned across the cusps between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from hdvplan.arrays import FloatArray
from hdvplan.driving.drive import Drive, simulate
from hdvplan.driving.legs import drive_legs, driven_legs, ready_legs
from hdvplan.errors import OptionError
from hdvplan.judging.bodies import corners
from hdvplan.judging.result import result_of
from hdvplan.planning.course import course_of
from hdvplan.planning.objectives import objective_named
from hdvplan.planning.settings import Discretisation, PlannerSettings
from hdvplan.road.legs import Leg, Legs
from hdvplan.road.path import ReferencePath, from_curvature, from_samples
from hdvplan.road.road import Road
from hdvplan.solvers.registry import DEFAULT, dependable
from hdvplan.vehicle.kinematics import place_many
from hdvplan.vehicle.load import load_vehicle, preset_names
from hdvplan.vehicle.model import Vehicle
from tests.core.rules import advance

SETTINGS = PlannerSettings(horizon=60.0)
BEND = from_curvature([0.0, 15.0, 25.0, 45.0], [0.0, 0.0, 0.05, 0.05])


def arc(x: float, y: float, heading: float, curvature: float, length: float) -> ReferencePath:
    """Return a circular arc that begins at a place and a heading."""
    s = np.linspace(0.0, length, int(np.ceil(length / 0.5)) + 1)
    headings, half = heading + curvature * s, 0.5 * curvature * s
    chord = s * np.sinc(half / np.pi)
    return from_samples(
        x + chord * np.cos(heading + half), y + chord * np.sin(heading + half), headings, np.full(len(s), curvature), float(s[1])
    )  # fmt: skip


def planned(legs: Legs, vehicle: str, objective: str = "geometric") -> tuple[Drive, ...]:
    return drive_legs(legs, load_vehicle(vehicle), objective_named(objective), dependable(DEFAULT), SETTINGS)


def there_and_back(*backward: bool) -> Legs:
    """Return legs along one bend."""
    return Legs("bend", tuple(Leg(Road("bend", BEND), one) for one in backward))


@pytest.mark.parametrize("name", preset_names())
def test_steps_back_undo_steps_forward(name: str) -> None:
    vehicle, random, steps = load_vehicle(name), np.random.default_rng(1), 20
    begin = random.uniform(-0.1, 0.1, vehicle.states)
    k, kappa = random.uniform(-0.02, 0.02, (steps, 2)), random.uniform(-0.5, 0.5, steps) * vehicle.max_curvature
    z, units, code = begin.copy(), vehicle.table(), Discretisation.GAUSS.code
    for i in range(steps):
        advance(code, units, k[i, 0], k[i, 1], 0.5, z.copy(), kappa[i], z)
    for i in reversed(range(steps)):
        advance(code, units, k[i, 0], k[i, 1], -0.5, z.copy(), kappa[i], z)
    assert np.allclose(z, begin, rtol=0.0, atol=1e-12)  # rounding of 40 steps, which trailers magnify some ten times backwards


@pytest.mark.parametrize("name", ["bus", "articulated-bus", "tractor-semitrailer", "semitrailer-steered", "road-train"])
def test_a_drive_backwards_passes_through_the_poses_of_the_drive_forwards(name: str) -> None:
    vehicle, kappa = load_vehicle(name), 0.05 * np.sin(0.2 * np.arange(60))
    path = BEND.extended(30.0, 30.0)
    forth = simulate(vehicle.table(), path, 0.0, 0.5, np.zeros(vehicle.states), kappa, 1)
    back = simulate(vehicle.table(), path, 30.0, -0.5, forth[-1], kappa[::-1], 1)
    assert np.allclose(back[::-1], forth, rtol=0.0, atol=1e-6)  # m and rad: of the integration, which is good to 1e-6 m over 100 m


@pytest.mark.parametrize("name", ["articulated-bus", "tractor-semitrailer", "tractor-trailer"])
def test_a_backward_leg_played_in_reverse_is_a_forward_drive_by_the_textbook_s_equations(name: str) -> None:
    vehicle = load_vehicle(name)
    drive = planned(there_and_back(False, True), name)[1]
    lead, trailer = vehicle.units
    here = drive.stations.path.at(drive.poses_s)
    poses = place_many(
        vehicle.table(), np.stack([here.x, here.y, np.cos(here.heading), np.sin(here.heading), here.curvature]), drive.poses_z
    )
    x, y, heading = poses[:, 0]["x"], poses[:, 0]["y"], here.heading + drive.poses_z[:, 1]
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    place, turn = CubicSpline(way, np.stack([x, y], axis=1)), CubicSpline(way, heading)
    tangent = place(way, 1)
    slip = np.arctan2(tangent[:, 1], tangent[:, 0]) - heading
    assert np.max(np.abs(np.sin(slip[1:-1]))) < 2e-3  # rad: of a spline through points 0.25 m apart, where steering changes by steps

    def rate(at: float, theta: FloatArray) -> FloatArray:
        beta = float(turn(at)) - theta
        return np.asarray((np.sin(beta) - lead.hitch_offset * np.cos(beta) * turn(at, 1)) / trailer.wheelbase)

    found = solve_ivp(rate, (0.0, float(way[-1])), heading[:1] - drive.poses_z[:1, 2], t_eval=way, rtol=1e-9, atol=1e-10).y[0]
    ahead = np.stack([x - lead.hitch_offset * np.cos(heading), y - lead.hitch_offset * np.sin(heading)], axis=1)
    axle = ahead - trailer.wheelbase * np.stack([np.cos(found), np.sin(found)], axis=1)
    apart = np.hypot(axle[:, 0] - poses[:, 1]["x"], axle[:, 1] - poses[:, 1]["y"])
    assert np.max(apart) < 2e-3  # m: the spline's, as above


@pytest.mark.parametrize("name", ["bus", "tractor-trailer", "semitrailer-active", "a-double"])
def test_at_a_cusp_the_vehicle_stands_where_the_next_leg_begins(name: str) -> None:
    first, second, third = planned(there_and_back(False, True, False), name)
    outlines = [corners(drive, np.array([0, len(drive.poses_s) - 1])) for drive in (first, second, third)]
    assert np.allclose(outlines[0][1], outlines[1][1], rtol=0.0, atol=1e-9)  # m: the same line
    assert np.allclose(outlines[1][0], outlines[2][0], rtol=0.0, atol=1e-9)
    assert max(drive.prediction_error for drive in (first, second, third)) < 3e-3  # m: Gauss's rule over steps of 0.5 m
    assert all(plan.usable for drive in (first, second, third) for plan in drive.plans)


def test_wheels_turn_while_the_vehicle_stands_and_no_faster_than_they_can_elsewhere() -> None:
    bus = load_vehicle("bus")
    turn = 0.8 * bus.max_curvature
    out = arc(0.0, 0.0, 0.0, turn, 8.0)
    end = out.at(out.length)
    x, y, heading = float(end.x), float(end.y), float(end.heading)
    back = arc(x, y, heading + np.pi, turn, 8.0)  # as it is driven: reversed it is directed as the bus heads
    end = back.at(back.length)
    line = arc(float(end.x), float(end.y), float(end.heading) - np.pi, -turn, 8.0)
    one, other = planned(Legs("turn", (Leg(Road("out", out), False), Leg(Road("back", line), True))), "bus")
    assert one.kappa[-1] - other.kappa[-1] > turn  # from the left to the right; the other leg's last interval was driven first
    for drive in (one, other):
        most = bus.max_curvature_rate * drive.stations.step
        assert np.max(np.abs(np.diff(drive.kappa))) <= most + 1e-9  # rounding


def test_a_course_has_the_stations_of_its_legs_in_the_order_of_driving() -> None:
    road, bus = Road("bend", BEND).with_limits(3.0, 3.0), load_vehicle("bus")
    course = course_of((Leg(road, False), Leg(road, True)), bus, step=0.4, stages=10)
    points, steps = course.stations.points, course.stations.points["step"]
    assert (len(points), course.end) == (2 * 114 + 1 + 10, 228)  # 113 steps a leg, and the station where the bus stands first
    assert np.array_equal(np.flatnonzero(steps == 0.0), [0, 114])
    assert np.all(steps[1:114] == 45.0 / 113)
    assert np.all(steps[115:] == -45.0 / 113)
    assert np.allclose(points["curvature"][1:115], points["curvature"][115:229][::-1][:114], rtol=0.0, atol=1e-12)
    assert np.allclose(points["curvature_between"][1:114], points["curvature_between"][115:228][::-1], rtol=0.0, atol=1e-12)
    moved = points["s"] + steps
    assert np.allclose(moved[1:114], points["s"][2:115])
    assert np.allclose(moved[115:-1], points["s"][116:])
    here = course.stations.path.at(points["s"])
    assert np.allclose(here.x, points["x"], rtol=0.0, atol=1e-7)  # of a spline whose knots lie elsewhere
    assert np.all(np.isinf(points["room_left"][course.end + 1 :]))
    assert np.all(np.isfinite(points["room_left"][: course.end + 1]))


def test_a_leg_is_judged_like_any_drive() -> None:
    road = Road("bend", BEND).with_limits(3.0, 3.0)
    forwards, backwards = planned(Legs("bend", (Leg(road, False), Leg(road, True))), "tractor-semitrailer")
    rooms = [result_of(drive, solver=DEFAULT, objective="geometric").balance.min_clearance for drive in (forwards, backwards)]
    assert all(room is not None and room > -0.01 for room in rooms)  # as a limit is kept


def test_an_objective_that_counts_along_one_line_is_refused() -> None:
    with pytest.raises(OptionError, match="several legs"):
        planned(there_and_back(False, True), "bus", "balanced")


@pytest.mark.parametrize(("vehicle", "horizon"), [("bus", 20.0), ("tractor-semitrailer", 30.0)])
def test_a_horizon_in_which_a_vehicle_folds_is_refused_with_the_one_that_it_needs(vehicle: str, horizon: float) -> None:
    short = replace(SETTINGS, horizon=horizon - 5.0)
    wanted = objective_named("geometric"), dependable(DEFAULT)
    with pytest.raises(OptionError, match="would fold") as raised:
        drive_legs(there_and_back(False, True), load_vehicle(vehicle), *wanted, short)
    assert raised.value.hint == f"--horizon {horizon:g} or more"
    assert len(drive_legs(there_and_back(False), load_vehicle(vehicle), *wanted, short)) == 1


@pytest.mark.parametrize("replan", [1.0, 5.0])
def test_a_semitrailer_is_backed_onto_a_straight_line(replan: float) -> None:
    vehicle = load_vehicle("tractor-semitrailer")
    drive = _backed(vehicle, replan)
    late = drive.poses_z[: len(drive.poses_z) // 2]  # in order of s: the second half of the way comes first
    straight = np.zeros((5, len(late)))
    straight[2] = 1.0
    assert np.max(np.abs(place_many(vehicle.table(), straight, late)["y"])) < 0.05  # m, after 30 m; it began 0.3 m off
    assert np.max(np.abs(np.rad2deg(drive.poses_z[:, 2]))) < 10.0


def _backed(vehicle: Vehicle, replan: float) -> Drive:
    """Return the drive along 60 m rear first, from 0.3 m beside the line."""
    legs = Legs("straight", (Leg(Road("straight", from_curvature([0.0, 60.0], [0.0, 0.0])), True),))
    settings = PlannerSettings(horizon=30.0, replan=replan)
    begun = ready_legs(legs, vehicle, objective_named("geometric"), dependable(DEFAULT), settings)
    return driven_legs(replace(begun, begin=begun.begin._replace(z=begun.begin.z + np.eye(vehicle.states)[0] * 0.3)))[0]
