"""What vehicles need in a ring, in closed form: an oracle that shares nothing with the proofs.

The rear axle of a rigid vehicle is at the distance rho from the ring's centre, its heading turned inwards by a from the tangent. Moving
forward along its heading, rho changes by -rho tan(a) per radian driven round the centre. The pose fits a ring from R - w to R + w where

    rho cos(a) - W/2 >= R - w     and     (rho cos(a) + W/2)^2 + (f - rho sin(a))^2 <= (R + w)^2

for a front f ahead of the axle, longer than the rear overhang. With a = 0 the least w is that of the steady circle. A heading inwards
needs less, but only while rho falls; so a vehicle can be driven through less than that for a while, and never for good: the angle
that it gets is the integral of 1 / (rho tan(a)) over rho, with the least a that fits at each rho. This allows any steering, as large and
sudden as one likes. The least half width for an angle thus lies between that at which the integral is the angle and the steady one.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from hdvplan.case import Case
from hdvplan.judging.balance import KEPT_M
from hdvplan.proof.answer import proof_of
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Unit, Vehicle
from tests.nightly import nightly

RIGID = ("bus", "citaro-k", "rigid-truck")
RADII_M = (12.5, 16.0, 20.0)
QUICK = [("bus", 16.0)]
CELLS = [
    pytest.param(vehicle, radius, marks=() if (vehicle, radius) in QUICK else pytest.mark.nightly)
    for vehicle in RIGID
    for radius in RADII_M
]
FITS_M = 1e-3  # wider than the exact least half width
LACKS_M = 0.015  # of half width: 3 cm of width
PAIRS = [
    ("tractor-trailer", 17.88),
    nightly("tractor-trailer", 25.0),
    nightly("tractor-trailer-paper", 17.88),
]


_POINTS = 10_000  # of rho: the half width is then good to a tenth of a millimetre
_HALVINGS = 50  # of a


def ring(vehicle: Vehicle, radius: float, half_width: float, turns: float = 1.0) -> Case:
    """Return a road that goes round a circle, with even limits."""
    length = 2.0 * np.pi * radius * turns
    path = from_curvature(np.array([0.0, length]), np.full(2, 1.0 / radius))
    return Case(Road("ring", path).with_limits(half_width, half_width), vehicle)


def steady_half_width(unit: Unit, radius: float) -> float:
    """Return the half width of the ring about ``radius`` [m] in which a rigid vehicle can drive in a steady circle."""
    return (unit.width**2 + 2.0 * radius * unit.width + unit.front**2) / (4.0 * radius + 2.0 * unit.width)


def longest_angle(unit: Unit, radius: float, half_width: float) -> float:
    """Return the largest angle [rad] that any steering gets a rigid vehicle round a ring narrower than ``steady_half_width``."""
    inner, outer, half = radius - half_width, radius + half_width, 0.5 * unit.width
    rho = np.linspace(inner + half, outer - half, _POINTS)
    low, high = np.zeros(_POINTS), np.arcsin(0.5 * (unit.front - unit.rear_overhang) / rho)  # there all four corners are as far out
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        far = np.hypot(rho * np.cos(middle) + half, unit.front - rho * np.sin(middle))
        low, high = np.where(far > outer, middle, low), np.where(far > outer, high, middle)
    far = np.hypot(rho * np.cos(high) + half, unit.front - rho * np.sin(high))
    fits = (rho * np.cos(high) - half >= inner) & (far <= outer)
    return float(np.sum((rho[1] - rho[0]) / (rho[fits] * np.tan(high[fits]))))


def least_half_width(unit: Unit, radius: float, angle: float) -> float:
    """Return a half width below which no steering whatsoever gets a rigid vehicle round ``angle`` [rad] of a ring."""
    steady = steady_half_width(unit, radius)

    def over(half_width: float) -> float:
        return min(longest_angle(unit, radius, half_width), 1e3) - angle

    return float(brentq(over, 0.5 * unit.width + 0.05, steady + 1e-6, xtol=1e-6))


def steady_half_width_of_pair(vehicle: Vehicle, radius: float) -> float:
    """Return the same for a tractor with a trailer ([GEO], sec. III): the trailer's axle is innermost, the tractor's front outermost."""
    tractor, trailer = vehicle.units

    def band(rho: float) -> tuple[float, float]:
        behind = rho**2 + tractor.hitch_offset**2 - trailer.wheelbase**2
        return np.sqrt(behind) - 0.5 * trailer.width, np.hypot(rho + 0.5 * tractor.width, tractor.front)

    least = np.sqrt(trailer.wheelbase**2 - tractor.hitch_offset**2) + 1e-6
    rho = float(brentq(lambda at: sum(band(at)) - 2.0 * radius, least, 2.0 * radius))
    inside, outside = band(rho)
    return float(0.5 * (outside - inside))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "radius"), CELLS)
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


@pytest.mark.slow
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
