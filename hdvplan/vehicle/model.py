"""A vehicle as a chain of units, validated once and frozen.

The first unit is the bus or the tractor: its rear axle carries the road-aligned state and its front axle steers. Every
further unit is coupled to the one ahead of it: ``wheelbase`` is then the distance from the coupling to its axle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.errors import VehicleError
from hdvplan.jit import FloatArray

MAX_DIMENSION_M = 50.0  # no single road unit is longer; catches millimetres and feet


@dataclass(frozen=True)
class Unit:
    """One rigid body. Lengths in metres along the body's axis."""

    wheelbase: float  # front axle (first unit) or coupling (others) to the axle [m]
    front_overhang: float  # body ahead of the front axle or coupling [m]
    rear_overhang: float  # body behind the axle [m]
    width: float  # [m]
    hitch_offset: float = 0.0  # coupling of the next unit behind the axle; negative: ahead of it [m]

    @property
    def front(self) -> float:
        """Distance from the axle to the foremost edge of the body [m]."""
        return self.wheelbase + self.front_overhang

    @property
    def length(self) -> float:
        """Length of the body [m]."""
        return self.front + self.rear_overhang


@dataclass(frozen=True)
class Vehicle:
    """A lead unit and its trailers, with the limits of the lead unit's steering.

    Raises:
        VehicleError: a dimension has the wrong sign or is impossible.

    """

    name: str
    units: tuple[Unit, ...]
    max_curvature: float = 0.1  # of the lead unit's rear axle path [1/m]
    max_curvature_rate: float = 0.1  # per metre travelled [1/m^2]
    source: str = ""

    def __post_init__(self) -> None:
        """Refuse impossible dimensions by name."""
        if not self.units:
            msg = f"vehicle {self.name!r} has no unit"
            raise VehicleError(msg, hint="describe the bus or tractor in a [[unit]] table")
        for field, value, unit in (
            ("max_curvature", self.max_curvature, "1/m"),
            ("max_curvature_rate", self.max_curvature_rate, "1/m^2"),
        ):
            if not (np.isfinite(value) and 0.0 < value <= 1.0):
                msg = f"vehicle {self.name!r}: {field} = {value:g} {unit} must lie above 0 and be at most 1"
                raise VehicleError(msg, field=field)
        for number, unit_ in enumerate(self.units, start=1):
            self._check_unit(number, unit_)

    def _check_unit(self, number: int, unit: Unit) -> None:
        lowest = {"wheelbase": 0.5, "front_overhang": 0.0, "rear_overhang": 0.0, "width": 0.5, "hitch_offset": -unit.wheelbase}
        highest = {"width": 5.0}
        for field, low in lowest.items():
            value, high = getattr(unit, field), highest.get(field, MAX_DIMENSION_M)
            if not (np.isfinite(value) and low <= value <= high):
                msg = f"vehicle {self.name!r}, unit {number}: {field} = {value:g} m must lie between {low:g} and {high:g} m"
                raise VehicleError(msg, field=field, hint="dimensions are in metres")

    @property
    def lead(self) -> Unit:
        """The bus or tractor."""
        return self.units[0]

    @property
    def states(self) -> int:
        """Number of road-aligned states: e_y, e_psi and one articulation angle a coupling."""
        return 1 + len(self.units)

    @property
    def width(self) -> float:
        """The widest body [m]."""
        return max(unit.width for unit in self.units)

    @property
    def reach_ahead(self) -> float:
        """Distance from the lead rear axle to the foremost point of the stretched vehicle [m]."""
        ahead, axle = self.lead.front, 0.0
        for front, unit in zip(self.units, self.units[1:], strict=False):
            axle += front.hitch_offset + unit.wheelbase
            ahead = max(ahead, unit.front - axle)
        return ahead

    @property
    def reach_behind(self) -> float:
        """Distance from the lead rear axle to the rearmost point of the stretched vehicle [m]."""
        behind, axle = self.lead.rear_overhang, 0.0
        for ahead, unit in zip(self.units, self.units[1:], strict=False):
            axle += ahead.hitch_offset + unit.wheelbase
            behind = max(behind, axle + unit.rear_overhang)
        return behind

    def table(self) -> FloatArray:
        """Return the dimensions for the kernels: rows units, columns wheelbase, hitch offset, front, rear, half width."""
        return np.array([[u.wheelbase, u.hitch_offset, u.front, u.rear_overhang, 0.5 * u.width] for u in self.units])
