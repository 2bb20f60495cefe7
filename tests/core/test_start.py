"""Roads that begin or end in a bend."""

from __future__ import annotations

import numpy as np
import pytest

from hdvplan.api import drive_case
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.driving.drive import Drive
from hdvplan.judging.envelope import envelope_of
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle

SETTINGS = PlannerSettings(horizon=50.0)
FADE_M = 10.0  # of the curvature beyond a road's end
each_vehicle = pytest.mark.parametrize("vehicle", ["tractor-trailer-24m", "a-double"])


def driven(vehicle: str, s: list[float], curvature: list[float]) -> Drive:
    road = Road("bend", from_curvature(np.array(s), np.array(curvature)))
    return drive_case(Case(road, load_vehicle(vehicle), settings=SETTINGS))


def reaches(drive: Drive) -> FloatArray:
    envelope = envelope_of(drive)
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
    here, there = envelope_of(ends), envelope_of(goes_on)
    # The rest of the last plan is driven as it was planned: its discretisation differs from the simulation by some millimetres.
    np.testing.assert_allclose(here.left[1], there.left[1, : len(here.s)], atol=0.01)
    np.testing.assert_allclose(here.right[1], there.right[1, : len(here.s)], atol=0.01)
    assert len(ends.z) == len(ends.kappa) + 1 == 161  # what was planned and is told as executed ends with the road
