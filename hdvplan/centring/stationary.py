"""Driving in a circle: the stationary geometry that sweeps a road of constant curvature evenly.

In stationary circular motion every wheel's axle line passes through the centre of the circle, so where a body lies about
the centre follows from the body ahead: both see their common coupling at the same distance. The outermost point is the
furthest corner of any body, tail included; the innermost is the foot of the centre on a body's inner edge, or that
edge's nearer corner; and [GEO]'s balance asks that both are equally far from the road's centre. Everything is solved
numerically, for any chain, with or without steered axles; for a bus and a tractor-trailer it is sections IV-B and IV-C of [GEO].

A table over curvatures is solved once for each vehicle: one root search a stage would cost more than the whole planning step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from hdvplan.arrays import BoolArray, FloatArray
from hdvplan.vehicle.model import Unit, Vehicle

_STRAIGHT = 1e-8  # gentler curves are scaled from this one, whose offsets still have eight digits [1/m]
_GENTLEST = -0.5  # K of a residual that lateral shifts still move enough; the vehicles of the papers stay above -0.18
_ROUNDS, _GRID = 8, 101  # of the search for the tightest circle: to the last digit
_TYPICAL = 0.05  # curvature at which a vehicle's auxiliary axle is chosen [1/m]
_LEAST = 1e-3  # share of the lead axle's coefficient below which the auxiliary axle's counts as this in K
_NOWHERE = 1e-9  # stands for the radius, times curvature, of a point that no circle puts beyond its centre
_STEEPEST = 2.0  # largest coefficient of either axle; the vehicles of the papers stay below it on roads they can drive
_MOST = 200  # evaluations; smooth functions take about ten
_CLOSE = 1e-15  # of the root itself: the last step's length


@dataclass(frozen=True)
class Centring:
    """Balanced driving at points of a road, signed: positive curvature turns left; arrays of shape (n,) unless said otherwise."""

    lead: FloatArray  # coefficients of the residual to centre, see ``coefficients``; with their limits on the straight
    aux: FloatArray
    target: FloatArray  # [m]
    kappa: FloatArray  # tan(front angle) / wheelbase [1/m]
    e_y: FloatArray  # lead rear axle [m]
    axle: int  # which axle the auxiliary one is, see ``auxiliary_axle``
    e_aux: FloatArray  # auxiliary axle [m]
    e_psi: FloatArray  # heading of the lead body off the circle's tangent; zero unless its rear axle is steered [rad]
    beta: FloatArray  # articulation angles, shape (n, couplings) [rad]
    steering: FloatArray  # wheel angles of the axles that the plan steers, which aim at their law, shape (n, active) [rad]
    half_width: FloatArray  # of the swept band, equal on both sides [m]
    saturated: BoolArray  # no balanced circle is this tight: the tightest one is given

    @property
    def weight(self) -> FloatArray:
        """K, the lead axle's coefficient per auxiliary axle's; held at +-1000 where the lead axle alone is centred."""
        return self.lead / np.where(np.abs(self.aux) < _LEAST * np.abs(self.lead), np.copysign(_LEAST * self.lead, self.aux), self.aux)

    @cached_property
    def states(self) -> FloatArray:
        """The vehicle's road-aligned states, shape (n, states)."""
        return np.column_stack([self.e_y, self.e_psi, self.beta, self.steering])


def coefficients(e_y: FloatArray, e_aux: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what to centre so that the swept area is balanced: lead, aux and target of lead e_y + aux e_aux - target [m].

    Given are both axles' balanced offsets in a left turn [m]. The coefficients are (K, 1) with K = -e_aux / e_y, which [GEO]
    shows to balance the swept area, wherever -0.5 <= K <= 2; that holds for the papers' vehicles on all roads they can drive.
    Where the lead axle runs near the centre, K has a pole: the pair is (K, 1) scaled to a lead coefficient of 2, which
    passes smoothly through (2, 0). Where both axles run equally far to the same side, K is near -1 and the residual would not
    notice a lateral shift: K is held at -0.5 (or its inverse is), and the residual aims at its value on the balanced circle.
    """
    size = np.maximum(np.hypot(e_y, e_aux), np.finfo(float).tiny)
    facing = np.where(e_y >= e_aux, 1.0, -1.0)
    lead, aux = -facing * e_aux / size, facing * e_y / size  # lead + aux >= 0: a shift to the left always raises the residual
    off_lead, off_aux = lead < _GENTLEST * aux, aux < _GENTLEST * lead
    lead, aux = np.where(off_lead, _GENTLEST * aux, lead), np.where(off_aux, _GENTLEST * lead, aux)
    scale = 1.0 / np.maximum(aux, np.maximum(lead, 0.0) / _STEEPEST)
    lead, aux = lead * scale, aux * scale
    return lead, aux, np.where(off_lead | off_aux, lead * e_y + aux * e_aux, 0.0)


@dataclass(frozen=True)
class _Circle:
    """One vehicle in a left circle; offsets are measured outwards from the centre's distance to the lead body's axis [m]."""

    outer: FloatArray  # outermost body point
    inner: FloatArray  # innermost body point
    lead: FloatArray  # lead rear axle
    axles: tuple[FloatArray, ...]  # lead front axle, then every trailer's
    e_psi: FloatArray
    beta: FloatArray
    turn: FloatArray  # of the lead body per metre forward: the inverse of that distance [1/m]
    possible: BoolArray  # every axle can follow, and no body reaches over the centre

    @property
    def road_curvature(self) -> FloatArray:
        """Curvature of the road that is swept evenly: 1/R, R = (outer + inner) / 2 as radii [1/m]."""
        return self.turn / (1.0 + 0.5 * (self.outer + self.inner) * self.turn)


def tightest_kappa(vehicle: Vehicle) -> float:
    """Return the largest kappa with a stationary circle: beyond, an axle cannot follow or a body reaches over the centre [1/m]."""
    low, high = _STRAIGHT, 2.0 / vehicle.lead.width
    for _ in range(_ROUNDS):  # possible up to one place: narrowed down by grids
        grid = np.linspace(low, high, _GRID)
        first = int(np.argmin(np.append(_circle(vehicle, grid[1:-1]).possible, False))) + 1
        low, high = float(grid[first - 1]), float(grid[first])
    return low


def tightest_road(vehicle: Vehicle) -> float:
    """Return the curvature of the tightest road that ``vehicle`` can sweep evenly in a circle [1/m]."""
    return float(_circle(vehicle, _limit(vehicle)).road_curvature[0])


def _limit(vehicle: Vehicle) -> FloatArray:
    """Return a kappa just below the largest one, shape (1,) [1/m]."""
    return np.array([tightest_kappa(vehicle) * (1.0 - 1e-9)])


def auxiliary_axle(vehicle: Vehicle) -> int:
    """Return which axle centring weighs against the lead rear axle: 0 the lead unit's front axle, i > 0 the axle of unit i.

    From the front axle to the last, axles run further and further inside. The two of a balanced residual must lie on either side of
    the road's centre, or a lateral shift hardly changes it; and close to each other in the chain, or the residual feels
    a shift twenty metres late. So where the lead rear axle runs outside, as a tractor's does, its partner is the first axle
    behind that runs inside; where it runs inside already, as a long bus's does, the partner is its own front axle.
    """
    if len(vehicle.units) == 1:
        return 0
    circle = _circle(vehicle, np.array([min(_TYPICAL, tightest_kappa(vehicle) * (1.0 - 1e-9))]))
    middle = 0.5 * (circle.outer + circle.inner)
    if middle[0] > circle.lead[0]:
        return 0
    inside = [i for i, axle in enumerate(circle.axles) if i > 0 and middle[0] > axle[0]]
    return inside[0] if inside else len(vehicle.units) - 1


def stationary(vehicle: Vehicle, road_curvature: FloatArray) -> Centring:
    """Return the balanced left circle of ``vehicle`` on roads of the given curvature magnitudes [1/m], shape (n,).

    Source: [GEO] eqs. 14-23 with the corrected trailer weight K = -e_trailer/e_y (eq. 23 prints its reciprocal).
    """
    k = np.abs(np.asarray(road_curvature, float))
    limit = _limit(vehicle)
    saturated, bent = k >= _circle(vehicle, limit).road_curvature[0], np.maximum(k, _STRAIGHT)
    kappa = np.full(k.shape, limit[0])
    if not np.all(saturated):
        wanted = bent[~saturated]
        low, high = np.full_like(wanted, 0.1 * _STRAIGHT), np.full_like(wanted, limit[0])
        kappa[~saturated] = find_roots(lambda kappa: _circle(vehicle, kappa).road_curvature - wanted, low, high)
    circle = _circle(vehicle, kappa)
    middle = 0.5 * (circle.outer + circle.inner)  # of the road, as the circle's offsets
    axle = auxiliary_axle(vehicle)
    e_y, e_aux = middle - circle.lead, middle - circle.axles[axle]
    lead, aux, target = coefficients(e_y, e_aux)
    steering = np.empty((*k.shape, len(vehicle.active)))
    for column, unit in enumerate(vehicle.active):
        steering[:, column] = -_steered(vehicle.units[unit], circle.beta[:, unit - 1])
    part = k / bent  # 1, or how much gentler the road is than the gentlest circle solved
    return Centring(
        lead, aux, part * target, part * kappa, part * e_y, axle, part * e_aux, part * circle.e_psi, part[:, None] * circle.beta,
        part[:, None] * steering, 0.5 * (circle.outer - circle.inner), saturated,
    )  # fmt: skip


def swept_band(vehicle: Vehicle, kappa: FloatArray, *, axles_only: bool = False) -> tuple[FloatArray, FloatArray]:
    """Return how far outwards and inwards of the lead rear axle a vehicle sweeps in a circle of curvature ``kappa`` [m].

    ``kappa`` >= 0 [1/m]; inwards is negative. ``axles_only`` leaves the overhangs out: what must stay on the drivable region.
    """
    if axles_only:
        units = tuple(replace(unit, front_overhang=min(unit.front_overhang, 0.0), rear_overhang=0.0) for unit in vehicle.units)
        vehicle = replace(vehicle, units=units)
    circle = _circle(vehicle, np.maximum(kappa, _STRAIGHT))
    return circle.outer - circle.lead, circle.inner - circle.lead


def _circle(vehicle: Vehicle, kappa: FloatArray) -> _Circle:
    """Return the stationary circle at ``kappa`` > 0 [1/m].

    In a body's axes, from its axle, the centre of the circle lies ``ahead`` and, to the left, 1 / turn + ``axis``. Distances from
    the centre are differences of roots written as quotients, so that nothing cancels on gentle curves.
    """
    lead = vehicle.lead
    wheels = np.minimum(lead.steering_ratio * np.arctan(lead.wheelbase * kappa), lead.max_steering_angle)
    turn = kappa + np.tan(wheels) / lead.wheelbase
    axis, ahead = np.zeros_like(kappa), np.tan(wheels) / turn
    beta, possible = np.empty((*kappa.shape, len(vehicle.units) - 1)), np.full(kappa.shape, True)
    outer, inner = np.full_like(kappa, -np.inf), np.full_like(kappa, np.inf)
    axles: list[FloatArray] = []

    def excess(left: FloatArray | float, along: FloatArray) -> FloatArray:
        """Return the distance from the centre of a point ``along`` of it and ``left`` of the body's axis, less 1 / turn."""
        scaled = 1.0 + (axis - left) * turn
        return axis - left + _root_excess(scaled, along**2 * turn, turn)

    for i, unit in enumerate(vehicle.units):
        if i > 0:
            front = vehicle.units[i - 1]
            behind = ahead + front.hitch_offset  # the centre, ahead of the coupling
            across = 1.0 + axis * turn
            off = np.arctan2(behind * turn, across)
            pull, can = _pull(unit, unit.wheelbase * turn / np.hypot(across, behind * turn), off)
            possible &= can
            beta[..., i - 1] = pull + off
            ahead = np.hypot(across, behind * turn) * np.cos(pull) * np.tan(_steered(unit, pull + off)) / turn
            axis = axis + _root_excess(across, (behind**2 - (unit.wheelbase - ahead) ** 2) * turn, turn)
        half = 0.5 * unit.width
        furthest = np.maximum(np.abs(unit.front - ahead), np.abs(unit.rear_overhang + ahead))
        nearest = np.maximum(np.maximum(ahead - unit.front, -unit.rear_overhang - ahead), 0.0)
        outer, inner = np.maximum(outer, excess(-half, furthest)), np.minimum(inner, excess(half, nearest))
        possible &= 1.0 + (axis - half) * turn >= 0.0
        if i == 0:
            rear = excess(0.0, ahead)
        axles.append(excess(0.0, ahead if i > 0 else lead.wheelbase - ahead))
    return _Circle(outer, inner, rear, tuple(axles), wheels, beta, turn, possible)


def _steered(unit: Unit, angle: FloatArray) -> FloatArray:
    """Return how far a trailer's wheels are turned out of the bend at articulation ``angle`` [rad]."""
    return np.clip(unit.steering_ratio * angle, -unit.max_steering_angle, unit.max_steering_angle)


def _pull(unit: Unit, length: FloatArray, off: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the angle of the coupling's velocity off a trailer's body [rad], and whether the axle can follow the circle.

    ``length`` is the wheelbase as a part of the coupling's radius, ``off`` the angle of that velocity off the body ahead, inwards.
    The angle solves sin(pull) + cos(pull) tan(wheels) = length, whose left-hand side rises until pull and wheels make a right angle.
    """
    if unit.steering_ratio == 0.0:
        return np.arcsin(np.minimum(length, 1.0)), length <= 1.0

    def reach(pull: FloatArray) -> FloatArray:
        return np.asarray(np.sin(pull) + np.cos(pull) * np.tan(_steered(unit, pull + off)))

    quarter = 0.5 * np.pi
    last: FloatArray = np.maximum((quarter - unit.steering_ratio * off) / (1.0 + unit.steering_ratio), quarter - unit.max_steering_angle)
    most = reach(last)
    wanted: FloatArray = np.minimum(length, most)
    return find_roots(lambda pull: reach(pull) - wanted, np.full_like(last, -quarter), last), length <= most


def _root_excess(scaled: FloatArray, added: FloatArray, turn: FloatArray) -> FloatArray:
    """Return sqrt(R^2 + c) - R [m] for scaled = R turn and added = c turn, without cancellation; any number where that is none."""
    return added / np.maximum(np.sqrt(np.maximum(scaled**2 + added * turn, 0.0)) + scaled, _NOWHERE)


def find_roots(rising: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray) -> FloatArray:
    """Return where ``rising``, elementwise, is zero between ``low`` and ``high``, all of shape (n,); the nearer end where it is not.

    scipy.optimize takes 0.3 s to load: a sixth of what a whole plan costs.
    Illinois method: a secant between the ends of a bracket, where an end that stays twice counts half the second time.
    Source: Dowell, Jarratt 1971.
    """
    at_low, at_high = rising(low), rising(high)
    x, stayed = high, np.zeros(low.shape)  # which end did: 1 the lower one, -1 the upper one
    for _ in range(_MOST):
        rise = at_high - at_low
        share = np.clip(np.divide(at_high, rise, out=np.zeros_like(rise), where=rise > 0.0), 0.0, 1.0)
        before, x = x, high - share * (high - low)
        if np.all(np.abs(x - before) <= _CLOSE * np.abs(x)):
            break
        at = rising(x)
        above = at > 0.0
        at_low = np.where(above, np.where(stayed > 0.0, 0.5, 1.0) * at_low, at)
        at_high = np.where(above, at, np.where(stayed < 0.0, 0.5, 1.0) * at_high)
        low, high, stayed = np.where(above, low, x), np.where(above, x, high), np.where(above, 1.0, -1.0)
    return x


_TABLE = np.linspace(0.0, 0.5, 2001)  # road curvatures [1/m]; linear interpolation errs by less than 1e-6 in K up to 0.1 1/m
_KEPT = 64  # tables of some 200 kB


@dataclass(frozen=True)
class CentringTable:
    """One vehicle's stationary geometry over curvature."""

    grid: Centring  # over ``_TABLE``
    tightest_road: float  # [1/m]

    @classmethod
    @lru_cache(maxsize=_KEPT)
    def of(cls, vehicle: Vehicle) -> CentringTable:
        """Tabulate the balanced circles of ``vehicle``; the last vehicles' tables are kept."""
        return cls(stationary(vehicle, _TABLE), tightest_road(vehicle))

    def at(self, road_curvature: FloatArray) -> Centring:
        """Return the geometry at signed road curvatures [1/m]; beyond the tightest circle it is held."""
        grid, sign, k = self.grid, np.sign(road_curvature), np.abs(road_curvature)

        def columns(values: FloatArray) -> FloatArray:
            return np.stack([sign * np.interp(k, _TABLE, one) for one in values.T], axis=-1) if values.size else np.empty((len(k), 0))

        even = {name: np.interp(k, _TABLE, getattr(grid, name)) for name in ("lead", "aux", "half_width")}
        odd = {name: sign * np.interp(k, _TABLE, getattr(grid, name)) for name in ("target", "kappa", "e_y", "e_aux", "e_psi")}
        saturated = k >= self.tightest_road
        return Centring(**even, **odd, axle=grid.axle, beta=columns(grid.beta), steering=columns(grid.steering), saturated=saturated)
