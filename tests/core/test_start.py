"""Where drives begin and end, and what they hold: on roads that begin or end in a bend, too."""

from __future__ import annotations

import numpy as np
import pytest

from hdvplan.api import drive_case
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.centring.stationary import CentringTable
from hdvplan.driving.drive import Drive, drive
from hdvplan.driving.start import Start, kept_start, lies_beside, start_of
from hdvplan.judging.envelope import Envelope
from hdvplan.planning.objectives import geometric
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import stations_of
from hdvplan.road.line import Line, RawRoad, smoothed
from hdvplan.road.options import RoadOptions
from hdvplan.road.path import from_curvature
from hdvplan.road.pieces import Kerb
from hdvplan.road.road import Road
from hdvplan.solvers.riccati import RiccatiWorkspace
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle

SETTINGS = PlannerSettings(horizon=50.0)
FADE_M = 10.0  # of the curvature beyond a road's end
each_vehicle = pytest.mark.parametrize("vehicle", ["tractor-trailer-24m", "a-double"])


def driven(vehicle: str, s: list[float], curvature: list[float]) -> Drive:
    road = Road("bend", from_curvature(np.array(s), np.array(curvature)))
    return drive_case(Case(road, load_vehicle(vehicle), settings=SETTINGS))


def reaches(drive: Drive) -> FloatArray:
    envelope = Envelope(drive)
    return np.stack([envelope.reach_left, envelope.reach_right])


@each_vehicle
def test_a_long_vehicle_comes_into_a_tight_first_bend_along_the_road_s_continuation(vehicle: str) -> None:
    begins = driven(vehicle, [0.0, 11.0, 17.0, 80.0], [-0.124, -0.124, 0.0, 0.0])
    units = load_vehicle(vehicle)
    before = 5.0 * np.ceil((units.reach_ahead + units.reach_behind + 20.0) / 5.0)  # whole plans: the same stations
    s = [0.0, before - FADE_M, before, before + 11.0, before + 17.0, before + 80.0]
    whole = driven(vehicle, s, [0.0, 0.0, -0.124, -0.124, 0.0, 0.0])
    first = round(before / 0.25)
    # The table's knots lie elsewhere, and where the bodies behind the start were is not in the envelope: past the vehicle's length.
    past = round((units.reach_ahead + units.reach_behind) / 0.25)
    np.testing.assert_allclose(reaches(begins)[:, past:], reaches(whole)[:, first + past :], atol=2e-3)
    np.testing.assert_allclose(begins.z[0], whole.z[round(before / 0.5)], atol=2e-3)


def test_a_vehicle_that_lies_beside_the_continuation_starts_as_if_the_road_had_always_bent_so() -> None:
    begins = driven("tractor-trailer", [0.0, 30.0, 36.0, 80.0], [0.05, 0.05, 0.0, 0.0])
    np.testing.assert_array_equal(begins.z[0], begins.stations.centring.states[0])


@each_vehicle
def test_a_road_may_end_in_a_tight_bend(vehicle: str) -> None:
    ends = driven(vehicle, [0.0, 63.0, 69.0, 80.0], [0.0, 0.0, -0.124, -0.124])
    assert np.all(np.isfinite(ends.z))
    goes_on = driven(vehicle, [0.0, 63.0, 69.0, 80.0, 90.0, 150.0], [0.0, 0.0, -0.124, -0.124, 0.0, 0.0])
    np.testing.assert_allclose(reaches(ends), reaches(goes_on)[:, : reaches(ends).shape[1]], atol=0.02)


def test_a_trailer_sweeps_the_last_metres_as_if_the_road_went_on() -> None:
    s, k = [0.0, 63.0, 69.0, 80.0], [0.0, 0.0, 0.05, 0.05]
    ends = driven("tractor-trailer", s, k)
    goes_on = driven("tractor-trailer", [*s, 80.0 + FADE_M, 120.0], [*k, 0.0, 0.0])
    here, there = Envelope(ends), Envelope(goes_on)
    # The rest of the last plan is driven as it was planned: its discretisation differs from the simulation by some millimetres.
    np.testing.assert_allclose(here.left[1], there.left[1, : len(here.s)], atol=0.01)
    np.testing.assert_allclose(here.right[1], there.right[1, : len(here.s)], atol=0.01)
    assert len(ends.z) == len(ends.kappa) + 1 == 161  # what was planned and is told as executed ends with the road


def start_at(road: Road, vehicle: Vehicle) -> Start:
    return start_of(stations_of(road, vehicle, CentringTable.of(vehicle), step=0.5, horizon=50.0), vehicle)


@pytest.mark.parametrize(("left", "right"), [(1.0, 1.4), (1.4, 1.0)])
def test_a_start_in_a_street_that_is_narrower_than_the_vehicle_lacks_as_little_as_can_be(left: float, right: float) -> None:
    bus = load_vehicle("bus")
    road = Road("narrow", from_curvature([0.0, 80.0], [0.0, 0.0])).with_limits(left, right)
    stations = stations_of(road, bus, CentringTable.of(bus), step=0.5, horizon=50.0)
    begin = kept_start(stations, bus, start_at(road, bus), 0.0)
    apart = begin.z[0] + np.array([0.5, -0.5]) * bus.width  # of its sides from the line, on a straight
    assert abs(begin.z[1]) < 1e-3  # askew it lacks more
    lacking = np.array([apart[0] - left, -right - apart[1]])
    assert np.max(lacking) == pytest.approx(0.5 * (bus.width - left - right), abs=0.02)  # the last of five moves, each half of what is left


def test_a_line_of_points_may_begin_in_a_tight_bend_too() -> None:
    """What lies before the road's start is a road of its own, whose widths count from the line as it was given."""
    corner = RawRoad(np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 90.0]]), np.full((4, 3), 12.0))
    vehicle = load_vehicle("a-double")
    road = smoothed(Line("corner", corner, RoadOptions(max_curvature=1.25 * vehicle.max_curvature)))[0]
    assert road.about is not None
    assert not lies_beside(road.path.extended(60.0, 0.0), vehicle, start_at(road, vehicle).z)
    drive = drive_case(Case(road, vehicle, settings=SETTINGS))
    assert np.all(np.isfinite(drive.z))
    length = road.path.length
    for end, stretch in ((0, (-50.0, 0.0)), (0, (-50.0, -10.0)), (1, (length, length + 50.0)), (1, (length + 10.0, length + 50.0))):
        np.testing.assert_allclose(road.about.part(*stretch, length).ends, road.about.ends[[end, end]], atol=1e-12)  # rounding


def test_a_start_that_nothing_mends_is_moved_no_further_than_it_helps() -> None:
    """A spike from the left kerb through the rear body, 4 m deep: every move of the rear asks for another one."""
    bus = load_vehicle("articulated-bus")
    left = np.array([[-60.0, 3.0], [-7.3, 3.0], [-7.1, -2.8], [-6.9, 3.0], [80.0, 3.0]])
    right = np.array([[-60.0, -3.0], [80.0, -3.0]])
    kerbs = tuple(Kerb(points, points[:, 0], side) for points, side in ((left, True), (right, False)))
    road = Road("spike", from_curvature([0.0, 80.0], [0.0, 0.0])).with_kerbs(kerbs)
    stations = stations_of(road, bus, CentringTable.of(bus), step=0.5, horizon=50.0)
    begin = start_at(road, bus)
    moved = kept_start(stations, bus, begin, 0.0).z - begin.z
    assert np.max(np.abs(moved) * [1.0, *[bus.reach_ahead + bus.reach_behind] * 2]) <= 5.0
    assert np.all(np.isfinite(drive_case(Case(road, bus, settings=SETTINGS)).z))


def test_a_drive_has_a_sample_at_every_station_and_poses_between() -> None:
    road = Road("bend", from_curvature(np.array([0.0, 20.0, 30.2]), np.array([0.0, 0.0, 0.03])))
    shares: list[float] = []
    settings = PlannerSettings(horizon=20.0, replan=4.0)
    done = drive(road, load_vehicle("bus"), geometric, RiccatiWorkspace, settings, on_progress=shares.append)
    assert len(done.z) == len(done.kappa) + 1 == 62  # 30.2 m in steps of 0.5 m
    assert done.poses_s[-1] == pytest.approx(33.5)  # when the rear end, 2.66 m behind the axle, has left the road
    assert np.max(np.diff(done.poses_s)) <= 0.25 + 1e-12
    assert np.array_equal(done.poses_z[::2][: len(done.z)], done.z)
    assert len(shares) == len(done.plans) == 8
    assert shares[-1] == 1.0
    assert np.all(np.diff(shares) > 0.0)
    for plan in done.plans:  # each starts from what was executed
        part = slice(plan.first, plan.first + settings.executed)
        assert np.array_equal(done.kappa[part], plan.kappa[: len(done.kappa[part])])
        assert np.max(np.abs(plan.z[0] - done.z[plan.first])) < 1e-12
        if plan.first > 0:
            assert plan.kappa_before == done.kappa[plan.first - 1]


def test_a_drive_begins_with_no_more_curvature_than_the_vehicle_has() -> None:
    road = Road("tight", from_curvature(np.array([0.0, 5.0, 10.0, 60.0]), np.array([0.14, 0.14, 0.0, 0.0])))
    done = drive(road, load_vehicle("bus"), geometric, RiccatiWorkspace, PlannerSettings(horizon=30.0))
    assert done.stations.centring.kappa[0] > 0.1
    assert done.plans[0].kappa_before == 0.1
    assert np.max(np.abs(done.kappa)) <= 0.1 + 1e-7  # what an active bound is kept to: active_set.c
