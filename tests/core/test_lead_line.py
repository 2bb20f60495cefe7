"""The line of the lead axle from that of the last one, and the articulation from which no steering brings a trailer back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from scipy.integrate import solve_ivp

from hdvplan.arrays import FloatArray
from hdvplan.driving.lead_line import lead_line
from hdvplan.errors import RoadError
from hdvplan.road.options import RoadOptions
from hdvplan.vehicle.kinematics import critical_angles, rates
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle


def driven(vehicle: Vehicle, length: float) -> tuple[FloatArray, FloatArray]:
    """Return the paths of the lead and of the last axle over a gentle S, by the textbook's equations of a chain of trailers."""
    units = vehicle.units

    def speeds(s: float, state: FloatArray) -> FloatArray:
        heading = state[2:]
        v, turn = 1.0, 0.05 * np.sin(2.0 * np.pi * s / length)
        rates = [v * np.cos(heading[0]), v * np.sin(heading[0]), turn]
        for ahead, unit, own, other in zip(units, units[1:], heading, heading[1:], strict=False):
            across, beta = -ahead.hitch_offset * turn, own - other
            v, turn = v * np.cos(beta) - across * np.sin(beta), (v * np.sin(beta) + across * np.cos(beta)) / unit.wheelbase
            rates.append(turn)
        return np.array(rates)

    s = np.arange(0.0, length, 0.25)
    state = solve_ivp(speeds, (0.0, length), np.zeros(2 + len(units)), t_eval=s, rtol=1e-10, atol=1e-10).y
    axle = state[:2]
    for ahead, unit, own, other in zip(units, units[1:], state[2:], state[3:], strict=False):
        axle = axle - ahead.hitch_offset * np.stack([np.cos(own), np.sin(own)]) - unit.wheelbase * np.stack([np.cos(other), np.sin(other)])
    return state[:2].T, axle.T


@pytest.mark.parametrize("name", ["tractor-semitrailer", "tractor-trailer-paper", "road-train", "a-double"])
def test_the_lead_axle_s_line_is_the_one_that_the_last_axle_followed(name: str) -> None:
    vehicle = load_vehicle(name)
    lead, last = driven(vehicle, 160.0)
    found = lead_line(vehicle, last, RoadOptions(max_curvature=0.2))
    ahead = len(lead) // 8  # what the chain began with dies away over its levers
    apart = shapely.distance(shapely.points(found[ahead:-ahead]), shapely.LineString(lead))
    assert float(np.max(apart)) < 0.002, float(np.max(apart))


def test_a_rigid_vehicle_has_one_line() -> None:
    points = np.array([[0.0, 0.0], [30.0, 0.0]])
    np.testing.assert_array_equal(lead_line(load_vehicle("bus"), points, RoadOptions()), points)


def test_a_line_that_no_trailer_follows_is_refused() -> None:
    corner = np.array([[0.0, 0.0], [20.0, 0.0], [3.0, 2.0]])
    with pytest.raises(RoadError):
        lead_line(load_vehicle("tractor-semitrailer"), corner, RoadOptions(smooth=0.5))


def test_the_preset_semitrailer_s_is_46_8_degrees() -> None:
    assert np.degrees(critical_angles(load_vehicle("tractor-semitrailer"))) == pytest.approx([46.8], abs=0.05)


def test_a_rigid_vehicle_has_none_and_one_whose_steering_cannot_fold_its_trailer_has_no_bound() -> None:
    assert len(critical_angles(load_vehicle("bus"))) == 0
    long = load_vehicle("tractor-semitrailer")
    units = (long.units[0], replace(long.units[1], wheelbase=12.0))  # longer than the least radius of 10 m
    assert critical_angles(replace(long, units=units)).tolist() == [np.inf]


@pytest.mark.parametrize("name", ["tractor-semitrailer", "tractor-trailer-paper", "road-train", "truck-dolly-semitrailer"])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_at_full_lock_it_stays_as_it_is_and_grows_backwards_beyond(name: str, side: float) -> None:
    vehicle = load_vehicle(name)
    critical = critical_angles(vehicle)
    assert np.all(np.isfinite(critical))
    table, lock = vehicle.table(), side * vehicle.max_curvature
    at = np.concatenate([np.zeros(2), side * critical])
    np.testing.assert_allclose(rates(table, 0.0, at, lock)[2:], 0.0, atol=1e-12)
    for more, grows in ((0.02, True), (-0.02, False)):
        z = at.copy()
        z[2] += side * more
        backwards = -side * rates(table, 0.0, z, lock)[2]
        assert bool(backwards > 0.0) is grows
