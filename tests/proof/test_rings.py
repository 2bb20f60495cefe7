"""Proofs against closed forms: see ``tests.proof.rings`` for why these are the least widths."""

from __future__ import annotations

import numpy as np
import pytest

from hdvplan.judging.balance import KEPT_M
from hdvplan.proof.answer import proof_of
from hdvplan.vehicle.load import load_vehicle
from tests.proof.rings import least_half_width, ring, steady_half_width, steady_half_width_of_pair

RIGID = ("bus", "citaro-k", "rigid-truck")
RADII_M = (12.5, 16.0, 20.0)
QUICK = [("bus", 16.0)]
CELLS = [
    pytest.param(vehicle, radius, marks=() if (vehicle, radius) in QUICK else pytest.mark.slow) for vehicle in RIGID for radius in RADII_M
]
FITS_M = 1e-3  # wider than the exact least half width
LACKS_M = 0.015  # of half width: 3 cm of width
PAIRS = [("tractor-trailer", 17.88), ("tractor-trailer", 25.0), ("tractor-trailer-paper", 17.88)]


@pytest.mark.slow
@pytest.mark.parametrize("name", RIGID)
@pytest.mark.parametrize("radius", RADII_M)
def test_a_whole_ring_gives_away_less_than_a_millimetre_to_any_steering(name: str, radius: float) -> None:
    unit = load_vehicle(name).lead
    steady = steady_half_width(unit, radius)
    assert steady - 1e-3 < least_half_width(unit, radius, 2.0 * np.pi) <= steady + 1e-6  # what the root's bracket adds
    assert least_half_width(unit, radius, 0.5 * np.pi) < steady - 2e-3  # a quarter does give something away, if little


@pytest.mark.slow
@pytest.mark.parametrize(("name", "radius"), CELLS)
def test_a_ring_as_wide_as_the_least_is_not_called_impossible(name: str, radius: float) -> None:
    vehicle = load_vehicle(name)
    half_width = steady_half_width(vehicle.lead, radius) - KEPT_M + FITS_M
    assert proof_of(ring(vehicle, radius, half_width)) is None


@pytest.mark.parametrize(("name", "radius"), CELLS)
def test_a_ring_three_centimetres_narrower_is_proved_impossible(name: str, radius: float) -> None:
    vehicle = load_vehicle(name)
    half_width = steady_half_width(vehicle.lead, radius) - KEPT_M - LACKS_M
    found = proof_of(ring(vehicle, radius, half_width))
    assert found is not None
    assert found.kind == "motion"
    assert 0.0 <= found.s_from < found.s_to <= 2.0 * np.pi * radius


def test_a_ring_in_which_no_pose_fits_is_proved_place_by_place() -> None:
    bus = load_vehicle("bus")
    chord = 0.5 * (np.hypot(16.0, 6.0) - 16.0)  # half of what a straight line of the bus's length needs in a circle of 16 m
    found = proof_of(ring(bus, 16.0, 0.5 * bus.width + chord - 0.1))
    assert found is not None
    assert (found.kind, found.unit) == ("place", 0)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "radius"), PAIRS)
def test_a_ring_in_which_a_trailer_follows_steadily_is_not_called_impossible(name: str, radius: float) -> None:
    vehicle = load_vehicle(name)
    half_width = steady_half_width_of_pair(vehicle, radius) - KEPT_M + FITS_M
    assert proof_of(ring(vehicle, radius, half_width)) is None
