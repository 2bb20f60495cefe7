"""A vehicle as a chain of units, validated once and frozen.

The first unit is the bus or the tractor: its rear axle carries the road-aligned state and its front axle steers. Every
further unit is coupled to the one ahead of it: ``wheelbase`` is then the distance from the coupling to its axle.

Any unit's axle may be steered by a fixed law, as vehicles are built: by ``steering_ratio`` times the front wheels' angle
(first unit) or times the articulation angle at the unit's own coupling (others), up to ``max_steering_angle``. The sign is
such that a positive ratio improves off-tracking: the axle turns its wheels out of the bend.

A trailer's axle with a ``max_steering_rate`` is active: the plan steers it, and the law is only what it aims at on constant curves.

How tightly a vehicle turns may be given by the sizes of its tightest turn, as data sheets do.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import accumulate, pairwise
from numbers import Real

import numpy as np

from hdvplan import core
from hdvplan.arrays import Records
from hdvplan.errors import VehicleError, refused_in
from hdvplan.settings import of_kind

MAX_DIMENSION_M = 50.0  # no single road unit is longer; catches millimetres and feet
MAX_RATIO = 2.0  # of steering: an axle that follows its coupling's track exactly has 1
MAX_ANGLE = 0.25 * np.pi  # of an axle's wheels [rad]; catches degrees
MOST_CURVATURE = 1.0  # [1/m], and of its change [1/m^2]
MOST_UNITS = core.number("HDV_MOST_UNITS")  # road trains on roads have up to nine; what planning takes grows with the cube of their number
MAX_RATE = 1.0  # of an active axle's wheels [rad/m]; catches degrees

UNIT = core.record("hdv_unit")  # hdvplan/core/hdvplan.h has the fields


@dataclass(frozen=True)
class Unit:
    """One rigid body. Lengths in metres along the body's axis.

    Raises:
        VehicleError: a dimension has the wrong sign or is impossible.

    """

    wheelbase: float  #: front axle (first unit) or coupling (others) to the axle [m]
    front_overhang: float  #: body ahead of the front axle or coupling; negative where a bare drawbar reaches further [m]
    rear_overhang: float  #: body behind the axle [m]
    width: float  #: [m]
    hitch_offset: float = 0.0  #: coupling of the next unit behind the axle; negative: ahead of it [m]
    steering_ratio: float = 0.0  #: of the axle's steering angle to the front wheels' or to the articulation; 0: not steered
    max_steering_angle: float = MAX_ANGLE  #: of this axle [rad]
    max_steering_rate: float = 0.0  #: of an axle that the plan steers, per metre travelled [rad/m]; 0: by the law
    name: str = field(default="", metadata={"decides": False})  #: name in messages and pictures

    def __post_init__(self) -> None:
        """Refuse impossible dimensions by name."""
        for one in fields(self):
            if one.name != "name":
                of_kind(one.name, getattr(self, one.name), Real, error=VehicleError)
        drawbar = max(self.wheelbase, 0.0)  # behind which the body of a trailer may begin
        _hold(self, "wheelbase", 0.5)
        _hold(self, "front_overhang", -drawbar)
        _hold(self, "rear_overhang", 0.0)
        _hold(self, "width", 0.5, 5.0)
        _hold(self, "hitch_offset", -self.wheelbase)
        if not (np.isfinite(self.steering_ratio) and 0.0 <= self.steering_ratio <= MAX_RATIO):
            msg = f"steering_ratio = {self.steering_ratio:g} must lie between 0 and {MAX_RATIO:g}"
            raise VehicleError(msg, field="steering_ratio", hint="a positive ratio turns the wheels out of the bend")
        angle, rate = self.max_steering_angle, self.max_steering_rate
        if not (np.isfinite(angle) and 0.0 < angle <= MAX_ANGLE):
            msg = f"max_steering_angle = {angle:g} rad must lie above 0 and be at most {MAX_ANGLE:.3f}"
            raise VehicleError(msg, field="max_steering_angle", hint=f"it is in radians: 20 degrees are {np.deg2rad(20.0):.3f}")
        if not (np.isfinite(rate) and 0.0 <= rate <= MAX_RATE):
            msg = f"max_steering_rate = {rate:g} rad/m must lie between 0 and {MAX_RATE:g}"
            raise VehicleError(msg, field="max_steering_rate", hint="it is in radians per metre travelled")
        if self.active and not self.steering_ratio > 0.0:
            msg = "an active axle needs a steering_ratio above 0, to aim at on constant curves"
            raise VehicleError(msg, field="steering_ratio")

    @property
    def front(self) -> float:
        """Distance from the axle to the foremost edge of the body [m]."""
        return self.wheelbase + self.front_overhang

    @property
    def length(self) -> float:
        """Length of the body [m]."""
        return self.front + self.rear_overhang

    @property
    def active(self) -> bool:
        """Whether the plan steers the axle, not the law."""
        return self.max_steering_rate > 0.0


def _hold(unit: Unit, name: str, low: float, high: float = MAX_DIMENSION_M) -> None:
    """Refuse a dimension that lies outside its bounds [m]."""
    value = getattr(unit, name)
    if not (np.isfinite(value) and low <= value <= high):
        msg = f"{name} = {value:g} m must lie between {low:g} and {high:g} m"
        raise VehicleError(msg, field=name, hint="dimensions are in metres")


@dataclass(frozen=True)
class Vehicle:
    """A lead unit and its trailers, with the limits of the lead unit's steering.

    Raises:
        VehicleError: a dimension has the wrong sign or is impossible.

    """

    name: str = field(metadata={"decides": False})
    units: tuple[Unit, ...]
    max_curvature: float = 0.1  #: tan(front angle) / wheelbase: of the lead rear axle's path unless that is steered [1/m]
    max_curvature_rate: float = 0.1  #: per metre travelled [1/m^2]
    source: str = field(default="", metadata={"decides": False})

    def __post_init__(self) -> None:
        """Refuse impossible dimensions by name."""
        of_kind("units", self.units, tuple, "units=(hdvplan.Unit(...),)", VehicleError)
        for unit_ in self.units:
            of_kind("a unit", unit_, Unit, "units=(hdvplan.Unit(...),)", VehicleError)
        if not self.units:
            msg = f"vehicle {self.name!r} has no unit"
            raise VehicleError(msg, hint="describe the bus or tractor in a [[unit]] table")
        if len(self.units) > MOST_UNITS:
            msg = f"vehicle {self.name!r} has {len(self.units)} units; at most {MOST_UNITS} are planned"
            raise VehicleError(msg, field="unit")
        for name, value, unit in (
            ("max_curvature", self.max_curvature, "1/m"),
            ("max_curvature_rate", self.max_curvature_rate, "1/m^2"),
        ):
            of_kind(name, value, Real, error=VehicleError)
            if not (np.isfinite(value) and 0.0 < value <= MOST_CURVATURE):
                msg = f"vehicle {self.name!r}: {name} = {value:g} {unit} must lie above 0 and be at most {MOST_CURVATURE:g}"
                raise VehicleError(msg, field=name)
        lead = f"vehicle {self.name!r}, unit 1"
        with refused_in(lead):
            _hold(self.lead, "front_overhang", 0.0)
        if self.lead.active:
            msg = f"{lead}: max_steering_rate = {self.lead.max_steering_rate:g} rad/m, but only a trailer's axle can be steered actively"
            raise VehicleError(msg, field="max_steering_rate", hint="the rear axle of unit 1 takes a steering_ratio alone")

    @property
    def lead(self) -> Unit:
        """The bus or tractor."""
        return self.units[0]

    @property
    def states(self) -> int:
        """Number of road-aligned states: e_y, e_psi, one articulation angle a coupling, one wheel angle an active axle."""
        return self.rigid_states + len(self.active)

    @property
    def rigid_states(self) -> int:
        """Number of the states that say where the bodies are: all but the active axles' wheel angles, which come last."""
        return 1 + len(self.units)

    @property
    def active(self) -> tuple[int, ...]:
        """The units, from 0, whose axles the plan steers."""
        return tuple(number for number, unit in enumerate(self.units) if unit.active)

    @property
    def width(self) -> float:
        """The widest body [m]."""
        return max(unit.width for unit in self.units)

    @property
    def behind(self) -> tuple[float, ...]:
        """Every axle's distance behind the lead rear axle on a straight [m]."""
        return tuple(accumulate((ahead.hitch_offset + unit.wheelbase for ahead, unit in pairwise(self.units)), initial=0.0))

    @property
    def reach_ahead(self) -> float:
        """Distance from the lead rear axle to the foremost point of the stretched vehicle [m]."""
        return max(unit.front - behind for unit, behind in zip(self.units, self.behind, strict=True))

    @property
    def reach_behind(self) -> float:
        """Distance from the lead rear axle to the rearmost point of the stretched vehicle [m]."""
        return max(behind + unit.rear_overhang for unit, behind in zip(self.units, self.behind, strict=True))

    def table(self) -> Records:
        """Return the dimensions for the core, one record of ``UNIT`` per unit."""
        return self._table.copy()

    @cached_property
    def _table(self) -> Records:
        table = np.zeros(len(self.units), UNIT)
        table["steered_by"] = 1 + np.arange(len(self.units))
        table["steered_by"][list(self.active)] = np.arange(self.rigid_states, self.states)
        for record, unit in zip(table, self.units, strict=True):
            for name in ("wheelbase", "hitch_offset", "front", "rear_overhang"):
                record[name] = getattr(unit, name)
            record["half_width"] = 0.5 * unit.width
            law = (-1.0, 0.5 * np.pi) if unit.active else (unit.steering_ratio, unit.max_steering_angle)
            record["steering_ratio"], record["max_steering_angle"] = law
        return table


_LARGEST_RADIUS_M = 1e6


def tightest(way: str, size: float, unit: Unit, where: str) -> float:
    """Return the largest curvature [1/m] of a lead unit from ``size`` [m], its ``turning_radius`` or ``turning_circle``.

    The one is the least radius of the front axle's middle, the other the diameter of the circle between walls.

    Raises:
        VehicleError: no vehicle of these dimensions turns so, in words that begin with ``where``.

    """
    if unit.steering_ratio > 0.0:
        return _steered(way, size, unit, where)
    if way == "turning_circle":
        return _between_walls(size, unit, where)
    least = float(np.hypot(unit.wheelbase, 1.0 / MOST_CURVATURE))
    if not least < size <= _LARGEST_RADIUS_M:
        limit = f"larger than {least:.2f} m for this wheelbase" if size <= least else f"at most {_LARGEST_RADIUS_M:g} m"
        msg = f"{where}: turning_radius = {size:g} m must be {limit}"
        raise VehicleError(msg, field="turning_radius", hint="it is the least radius of the middle of the front axle")
    return float(1.0 / (size**2 - unit.wheelbase**2) ** 0.5)


def _between_walls(diameter: float, unit: Unit, where: str) -> float:
    """Return the largest curvature of the rear axle's path from the diameter of the circle that the outer front corner draws."""
    front = unit.wheelbase + unit.front_overhang
    inner = max(0.5 * unit.width, 1.0 / MOST_CURVATURE)  # at least: then the rear axle turns about its inner end
    least = 2.0 * float(np.hypot(front, 0.5 * unit.width + inner))
    if not least < diameter <= 2.0 * _LARGEST_RADIUS_M:
        limit = f"larger than {least:.2f} m for these dimensions" if diameter <= least else f"at most {2.0 * _LARGEST_RADIUS_M:g} m"
        msg = f"{where}: turning_circle = {diameter:g} m must be {limit}"
        raise VehicleError(msg, field="turning_circle", hint="it is the diameter of the turning circle between walls")
    return float(1.0 / (((0.5 * diameter) ** 2 - front**2) ** 0.5 - 0.5 * unit.width))


def _steered(way: str, size: float, unit: Unit, where: str) -> float:
    """Return the largest curvature of a unit whose rear axle is steered as well, from either size of its tightest turn [m].

    The unit turns about a point ahead of its rear axle, so that the corner furthest out may be a rear one.
    """

    def turned(kappa: float) -> float:
        front = unit.wheelbase * kappa  # tangents of both axles' angles
        rear = float(np.tan(min(unit.steering_ratio * np.arctan(front), unit.max_steering_angle)))
        aside = unit.wheelbase / (front + rear)
        ahead, out = aside * rear, aside + 0.5 * unit.width
        if way == "turning_radius":
            return float(np.hypot(unit.wheelbase - ahead, aside))
        return 2.0 * float(np.hypot(max(unit.wheelbase + unit.front_overhang - ahead, unit.rear_overhang + ahead), out))

    least, straightest = turned(MOST_CURVATURE), 1.0 / _LARGEST_RADIUS_M
    if not least < size < turned(straightest):
        msg = f"{where}: {way} = {size:g} m must be larger than {least:.2f} m for these axles, and below {_LARGEST_RADIUS_M:g} m"
        raise VehicleError(msg, field=way, hint="of a steered rear axle max_curvature is tan(front wheels' angle) / wheelbase [1/m]")
    from scipy.optimize import brentq  # noqa: PLC0415 - few vehicles need it, and all commands load one

    return float(brentq(lambda kappa: turned(kappa) - size, straightest, MOST_CURVATURE))
