"""Driving in a circle: the stationary geometry that sweeps a road of constant curvature evenly.

Every axle line of a vehicle in stationary circular motion passes through the centre of the circle, so each axle's
radius follows from the one ahead: R_{i+1}^2 = R_i^2 + M_i^2 - L_{i+1}^2. The outermost point is a corner, the innermost
the foot of an axle on its inner edge, and [GEO]'s balance asks that both are equally far from the road's centre.
For a bus and a tractor-trailer this is sections IV-B and IV-C of [GEO]; for longer chains it is the same formula.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import elementwise

from hdvplan.jit import BoolArray, FloatArray
from hdvplan.vehicle.model import Vehicle

_STRAIGHT = 1e-7  # curvatures below this use the limit R -> infinity [1/m]
_STEEPEST = 50.0  # largest |K|; the vehicles of the papers stay below 2


@dataclass(frozen=True)
class Stationary:
    """The balanced circle at given road curvatures, signed for left turns; arrays of shape (n,) unless said otherwise."""

    road_curvature: FloatArray  # magnitude [1/m]
    kappa: FloatArray  # of the lead rear axle's path [1/m]
    e_y: FloatArray  # lead rear axle [m]
    e_aux: FloatArray  # front axle of a single unit, last axle of a chain [m]
    beta: FloatArray  # articulation angles, shape (n, couplings) [rad]
    half_width: FloatArray  # of the swept band, equal on both sides [m]
    weight: FloatArray  # K = -e_aux / e_y, with its finite limit on the straight
    saturated: BoolArray  # no balanced circle is this tight: the tightest one is given


@dataclass(frozen=True)
class _Circle:
    """One vehicle in a circle; offsets are measured outwards from the lead rear axle's radius [m]."""

    outer: FloatArray  # outermost body point
    inner: FloatArray  # innermost body point
    aux: FloatArray  # auxiliary axle
    beta: FloatArray


def tightest_kappa(vehicle: Vehicle) -> float:
    """Return the curvature of the lead axle at which some axle's inner edge reaches the centre of the circle [1/m]."""
    squared, lowest = 0.0, (0.5 * vehicle.lead.width) ** 2
    for ahead, unit in zip(vehicle.units, vehicle.units[1:], strict=False):
        squared += ahead.hitch_offset**2 - unit.wheelbase**2
        lowest = max(lowest, (0.5 * unit.width) ** 2 - squared)
    return float(1.0 / np.sqrt(lowest))


def tightest_road(vehicle: Vehicle) -> float:
    """Return the curvature of the tightest road that ``vehicle`` can sweep evenly in a circle [1/m]."""
    return float(_road_curvature(vehicle, np.array([tightest_kappa(vehicle) * (1.0 - 1e-9)]))[0])


def stationary(vehicle: Vehicle, road_curvature: FloatArray) -> Stationary:
    """Return the balanced circle of ``vehicle`` on roads of the given curvature magnitudes [1/m], shape (n,).

    Source: [GEO] eqs. 14-23 with the corrected trailer weight K = -e_trailer/e_y (eq. 23 prints its reciprocal).
    """
    k = np.abs(np.asarray(road_curvature, float))
    limit = tightest_kappa(vehicle) * (1.0 - 1e-9)
    saturated = k >= tightest_road(vehicle)
    turning = (k > _STRAIGHT) & ~saturated
    kappa = np.where(saturated, limit, 0.0)
    if np.any(turning):
        wanted = k[turning]

        def excess(kappa: FloatArray, wanted: FloatArray) -> FloatArray:
            return _road_curvature(vehicle, kappa) - wanted

        bracket = (np.zeros_like(wanted), np.full_like(wanted, limit))
        kappa[turning] = elementwise.find_root(excess, bracket, args=(wanted,), tolerances={"xatol": 1e-16, "xrtol": 1e-14}).x
    circle = _circle(vehicle, kappa)
    middle = 0.5 * (circle.outer + circle.inner)  # R - R1
    e_y, e_aux = middle, middle - circle.aux
    straight = k <= _STRAIGHT
    slope_y, slope_aux = _straight_slopes(vehicle)
    kappa, e_y = np.where(straight, k, kappa), np.where(straight, slope_y * k, e_y)
    e_aux = np.where(straight, slope_aux * k, e_aux)
    weight = np.where(straight, _ratio(slope_aux, slope_y), _ratio(e_aux, e_y))
    return Stationary(k, kappa, e_y, e_aux, circle.beta, 0.5 * (circle.outer - circle.inner), weight, saturated)


def swept_band(vehicle: Vehicle, kappa: FloatArray, *, axles_only: bool = False) -> tuple[FloatArray, FloatArray]:
    """Return how far outwards and inwards of the lead rear axle a vehicle sweeps in a circle of curvature ``kappa`` [m].

    ``kappa`` >= 0 [1/m]; inwards is negative. ``axles_only`` leaves the overhangs out: what must stay on the drivable region.
    """
    if axles_only:
        units = tuple(replace(unit, front_overhang=0.0, rear_overhang=0.0) for unit in vehicle.units)
        vehicle = replace(vehicle, units=units)
    circle = _circle(vehicle, kappa)
    return circle.outer, circle.inner


def _ratio(e_aux: FloatArray | float, e_y: FloatArray | float) -> FloatArray:
    """Return K = -e_aux/e_y, held at +-_STEEPEST where the lead axle runs on the centre: then it alone is centred."""
    lead = np.where(np.abs(e_y) < np.abs(e_aux) / _STEEPEST, np.copysign(np.abs(e_aux) / _STEEPEST, e_y), e_y)
    return np.where(lead == 0.0, 0.0, -np.asarray(e_aux) / np.where(lead == 0.0, 1.0, lead))


def _road_curvature(vehicle: Vehicle, kappa: FloatArray) -> FloatArray:
    """Return the curvature of the road that a vehicle turning with ``kappa`` sweeps evenly: 1/R, R = (outer + inner)/2."""
    circle = _circle(vehicle, kappa)
    return kappa / (1.0 + 0.5 * (circle.outer + circle.inner) * kappa)


def _circle(vehicle: Vehicle, kappa: FloatArray) -> _Circle:
    """Return the stationary circle at lead curvatures ``kappa`` >= 0 [1/m].

    With a = R_i kappa, offsets are differences of roots written as quotients, so that nothing cancels on gentle curves.
    """
    half = 0.5 * vehicle.lead.width
    outer = _root_excess(1.0 + half * kappa, _furthest(vehicle, 0) ** 2 * kappa, kappa) + half
    inner = np.full_like(kappa, -half)
    axle = np.zeros_like(kappa)  # radius of the axle less the lead rear axle's [m]
    beta = np.empty((*kappa.shape, len(vehicle.units) - 1))
    for i, (ahead, unit) in enumerate(zip(vehicle.units, vehicle.units[1:], strict=False), start=1):
        scaled = 1.0 + axle * kappa
        behind = axle + _root_excess(scaled, (ahead.hitch_offset**2 - unit.wheelbase**2) * kappa, kappa)
        beta[..., i - 1] = np.arctan(ahead.hitch_offset * kappa / scaled) + np.arctan2(unit.wheelbase * kappa, 1.0 + behind * kappa)
        axle, half = behind, 0.5 * unit.width
        corner = axle + half + _root_excess(1.0 + (axle + half) * kappa, _furthest(vehicle, i) ** 2 * kappa, kappa)
        outer, inner = np.maximum(outer, corner), np.minimum(inner, axle - half)
    aux = axle if len(vehicle.units) > 1 else _root_excess(np.ones_like(kappa), vehicle.lead.wheelbase**2 * kappa, kappa)
    return _Circle(outer, inner, aux, beta)


def _root_excess(scaled: FloatArray, added: FloatArray, kappa: FloatArray) -> FloatArray:
    """Return sqrt(R^2 + c) - R [m] for scaled = R kappa and added = c kappa, without cancellation."""
    return added / (np.sqrt(np.maximum(scaled**2 + added * kappa, 0.0)) + scaled)


def _furthest(vehicle: Vehicle, unit: int) -> float:
    """Return the distance from the axle to the body's further end along its axis [m]."""
    return max(vehicle.units[unit].front, vehicle.units[unit].rear_overhang)


def _straight_slopes(vehicle: Vehicle) -> tuple[float, float]:
    """Return the limits of e_y/k and e_aux/k for R -> infinity [m^2]; only the widest bodies bound the swept band."""
    axle, outer, inner = 0.0, -np.inf, np.inf  # each times the curvature, off the lead rear axle's radius [m^2]
    for i, unit in enumerate(vehicle.units):
        if i > 0:
            axle += 0.5 * (vehicle.units[i - 1].hitch_offset ** 2 - unit.wheelbase**2)
        if unit.width == vehicle.width:
            outer, inner = max(outer, axle + 0.5 * _furthest(vehicle, i) ** 2), min(inner, axle)
    aux = axle if len(vehicle.units) > 1 else 0.5 * vehicle.lead.wheelbase**2
    middle = 0.5 * (outer + inner)
    return middle, middle - aux
