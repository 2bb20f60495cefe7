"""What a plan wants from axles that it steers itself, and what their wheels can do.

Beside the objective the wheels are wanted at the angles of the balanced circle of the road beside each axle: a trailer then steers
where it is, not where its tractor is, and a straight leaves its wheels straight. Turning them costs, as it does for the front
wheels. The objective and the limits decide the rest. Wheel angles are states of the motion; between stations they change
evenly, and each change is a separate input.

With this wish alone the semitrailer's worst reach and mean imbalance came out as low as with its axle's offset as a second residual.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray
from hdvplan.planning.terms.term import CorePart, Needs, Place, Scene, core_functions
from hdvplan.vehicle.body import auxiliary_ahead
from hdvplan.vehicle.model import Vehicle

CHANGE_WEIGHT = 20.0  # of the square of a change between stations: as smooth for 7 m of trailer as 1e3 is for curvature [m^2]
ANGLE_WEIGHT = 10.0  # of the squared difference from the wanted angle; ten times more or less changes no reach by 2 cm [m^2]

_FUNCTIONS = core_functions("steering")
_POINTERS = [(name, core.ADDRESS) for name in ("aim", "most", "change")]
_DATA = core.record("hdv_steering", [("wheels", np.int64), *_POINTERS, ("angle_weight", float), ("change_weight", float)])


@dataclass(frozen=True)
class Steering:
    """The wish for all axles that the plan steers; their columns belong to the vehicle."""

    def needs(self, vehicle: Vehicle) -> Needs:  # noqa: ARG002 - a protocol's method
        """Return nothing: see ``Term``."""
        return Needs()

    def part(self, scene: Scene, place: Place) -> SteeringPart:  # noqa: ARG002 - needs no column of its own
        """Return the term in its place: see ``Term``."""
        vehicle, stations = scene.vehicle, scene.stations
        axles = [vehicle.units[axle] for axle in vehicle.active]
        beside = [stations.s + auxiliary_ahead(vehicle, axle) for axle in vehicle.active]
        angles = [np.interp(at, stations.s, wanted) for at, wanted in zip(beside, stations.centring.steering.T, strict=True)]
        aim = np.stack(angles, axis=1)
        most = np.array([unit.max_steering_angle for unit in axles])
        change = np.array([unit.max_steering_rate * stations.step for unit in axles])
        data = np.array([(len(axles), *map(core.address, (aim, most, change)), ANGLE_WEIGHT, CHANGE_WEIGHT)], _DATA)
        return SteeringPart(scene, _FUNCTIONS, data, aim, most, change)


@dataclass(frozen=True)
class SteeringPart(CorePart):
    """Actively steered axles in their place; see ``Part``."""

    aim: FloatArray  # (stations, active), left positive [rad]
    most: FloatArray  # (active,) [rad]
    change: FloatArray  # (active,), largest, between two stations [rad]
