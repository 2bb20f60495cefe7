"""Limits in their place, see ``core/limits.c``: what is known of every stage, and its rows."""

from dataclasses import dataclass, field

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.planning.stations import Stations
from hdvplan.vehicle.body import POINTS_PER_EDGE, axis_points, axles_behind, edge_points
from hdvplan.vehicle.model import Vehicle
from tests.core.twins.edges import Edge
from tests.core.twins.kinematics import places
from tests.core.twins.path import Record
from tests.core.twins.screening import CLEAR, clear_by_axis, clear_by_state


@dataclass
class Limits:
    """Of ``stages`` intervals, with ``each`` rows an edge; ``reach`` is the furthest from the lead axle that a body can be."""

    vehicle: Vehicle
    stations: Stations
    stages: int
    each: int
    reach: float
    clearance: float
    memory: dict[str, FloatArray] = field(init=False)

    def __post_init__(self) -> None:
        """Know nothing."""
        n, units, count = self.vehicle.states, len(self.vehicle.units), self.stages + 1
        sizes = {
            "z": (n,),
            "axis_feet": (units, 4),
            "feet": (units, POINTS_PER_EDGE, 2),
            "g": (units, 2, self.each, n),
            "h": (units, 2, self.each),
        }
        edges = dict.fromkeys(("clear", "gap", "looked", "never"), (units, 2))
        self.memory = {name: np.zeros((count, *size)) for name, size in (sizes | edges | {"live": ()}).items()}

    @property
    def violation(self) -> float:
        """The deepest breach."""
        return max(0.0, -float(np.min(self.memory["gap"][1:])))

    def price(self, linear: FloatArray, quadratic: FloatArray) -> float:
        """Return what breaches cost at prices of the rows (N+1, rows)."""
        over = np.maximum(0.0, -self.memory["h"].reshape(linear.shape)) * self.memory["live"][:, None]
        return float(np.sum((linear * over + 0.5 * quadratic * over**2)[1:]))

    def move(self, by: int) -> None:
        """Let stage ``by`` become the first; the last ``by`` keep what they know."""
        for array in self.memory.values():
            array[: len(array) - by] = array[by:].copy()

    def linearise(self, first: int, z: FloatArray, begin: int, *, fresh: bool, binding: bool) -> None:
        """Write the rows of stages from ``begin`` on at the motion z (N+1, n) that begins at station ``first``."""
        units, seen = self.vehicle.table(), self.memory
        for i in range(begin, self.stages + 1):
            at = self.stations.points[first + i]
            if fresh:
                self._begin(i, at, z[i])
            change = abs(z[i] - seen["z"][i])
            moved = change[0] + self.reach * sum(change[1 : 1 + len(units)])
            slid = np.inf if moved > 0.0 and at["varies"] > 0.0 else moved
            seen["z"][i], seen["live"][i] = z[i], 0.0
            seen["clear"][i] -= np.where(seen["looked"][i] > 0.0, slid, moved)
            axles = places(units, np.array([at["x"], at["y"], at["cos"], at["sin"]]), z[i])
            for unit in range(len(units)):
                self._write(i, at, axles, unit, binding=binding)

    def _begin(self, i: int, at: Record, z: FloatArray) -> None:
        """Forget stage i: feet as on a straight, clearances by a bound from the state."""
        seen, axles = self.memory, at["s"] - axles_behind(self.vehicle)[:, None]
        seen["axis_feet"][i] = axles + axis_points(self.vehicle)
        seen["feet"][i] = (axles + edge_points(self.vehicle)["ahead"])[:, :, None]
        seen["clear"][i], seen["z"][i] = clear_by_state(self.vehicle.table(), at, z), z
        seen["looked"][i] = seen["never"][i] = 0.0

    def _write(self, i: int, at: Record, axles: FloatArray, unit: int, *, binding: bool) -> None:
        """Bring what is known of both edges of a body up to date."""
        units, seen, margin = self.vehicle.table(), {name: array[i] for name, array in self.memory.items()}, at["margin"] + self.clearance

        def is_clear(side: int) -> bool:
            return bool(seen["clear"][unit, side] - margin > CLEAR and not (binding and seen["looked"][unit, side]))

        if not (is_clear(0) and is_clear(1)):
            bounds = clear_by_axis(
                units[unit], axis_points(self.vehicle)[unit], self.stations.path, at, axles[unit], seen["axis_feet"][unit]
            )
            for side, bound in enumerate(bounds):
                if bound - margin > CLEAR:
                    seen["clear"][unit, side], seen["looked"][unit, side] = bound, 0.0
        for side in range(2):
            one, g, h = (unit, side), seen["g"][unit, side], seen["h"][unit, side]
            seen["gap"][one] = seen["clear"][one]
            if not is_clear(side):
                edge = Edge(units, self.stations, at, axles, unit, side, edge_points(self.vehicle)[unit], margin)
                seen["gap"][one], seen["clear"][one] = edge.written(seen["feet"][unit, :, side], g, h)
                seen["looked"][one], seen["never"][one] = 1.0, 0.0
            if not is_clear(side):
                self.memory["live"][i] = 1.0
            elif not seen["never"][one]:
                g[:], h[:], seen["never"][one] = 0.0, seen["clear"][one] - margin, 1.0
