"""The articulation from which no steering brings a trailer back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hdvplan.vehicle.kinematics import critical_angles, rates
from hdvplan.vehicle.load import load_vehicle


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
