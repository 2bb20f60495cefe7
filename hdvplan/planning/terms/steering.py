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

from hdvplan.jit import FloatArray, Records, compiled
from hdvplan.planning.terms.term import Horizon, Needs, Place, Scene
from hdvplan.vehicle.body import auxiliary_ahead
from hdvplan.vehicle.model import Vehicle

CHANGE_WEIGHT = 20.0  # of the square of a change between stations: as smooth for 7 m of trailer as 1e3 is for curvature [m^2]
ANGLE_WEIGHT = 10.0  # of the squared difference from the wanted angle; ten times more or less changes no reach by 2 cm [m^2]


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
        return SteeringPart(
            scene,
            np.stack(angles, axis=1),
            np.array([unit.max_steering_angle for unit in axles]),
            np.array([unit.max_steering_rate * stations.step for unit in axles]),
        )


@dataclass(frozen=True)
class SteeringPart:
    """Actively steered axles in their place; see ``Part``."""

    scene: Scene
    aim: FloatArray  # (stations, active), left positive [rad]
    most: FloatArray  # (active,) [rad]
    largest: FloatArray  # (active,), of a change between two stations [rad]
    memory: tuple[FloatArray, ...] = ()
    violation: float = 0.0

    def extend(self, horizon: Horizon, begin: int) -> int:
        """See ``Part``."""
        return self._linearise(horizon, begin)

    def linearise(self, horizon: Horizon) -> int:
        """See ``Part``."""
        return self._linearise(horizon, 1)

    def price(self, horizon: Horizon) -> float:
        """Return what angles and their changes cost: see ``Part``."""
        return price_of(self.scene.motion.stages, self._aim(horizon))

    def _linearise(self, horizon: Horizon, begin: int) -> int:
        linearise_steering(self.scene.motion.stages, self._aim(horizon), self.most, self.largest, begin, self.scene.qp.stages)
        return -1

    def _aim(self, horizon: Horizon) -> FloatArray:
        return self.aim[horizon.first : horizon.first + len(horizon.road)]


@compiled
def linearise_steering(motion: Records, aim: FloatArray, most: FloatArray, largest: FloatArray, begin: int, stages: Records) -> None:
    """Write the wheels' part of a program; their inputs and bounds stand behind those of the curvature.

    Costs of angles are added at stages i >= ``begin``; changes and bounds are written at all.
    """
    for i in range(motion.size - 1):
        stage, ahead, z, following = stages[i], stages[i + 1], motion[i].z, motion[i + 1].z
        for wheel in range(most.size):
            j, own = z.size - most.size + wheel, 1 + wheel
            angle = following[j]
            change = angle - z[j]
            if i + 1 >= begin:
                ahead.Q[j, j] += 2.0 * ANGLE_WEIGHT
                ahead.q[j] += 2.0 * ANGLE_WEIGHT * (angle - aim[i + 1, wheel])
            stage.R[own, own], stage.r[own] = 2.0 * CHANGE_WEIGHT, 2.0 * CHANGE_WEIGHT * change
            ahead.x_low[own], ahead.x_high[own] = -most[wheel] - angle, most[wheel] - angle
            stage.u_low[own], stage.u_high[own] = -largest[wheel] - change, largest[wheel] - change


@compiled
def price_of(motion: Records, aim: FloatArray) -> float:
    """Return what a motion's wheel angles and their changes cost."""
    total = 0.0
    for i in range(1, motion.size):
        z, before = motion[i].z, motion[i - 1].z
        for wheel in range(aim.shape[1]):
            j = z.size - aim.shape[1] + wheel
            total += ANGLE_WEIGHT * (z[j] - aim[i, wheel]) ** 2 + CHANGE_WEIGHT * (z[j] - before[j]) ** 2
    return total
