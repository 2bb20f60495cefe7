"""What a plan wants from axles that it steers itself, and what their wheels can do.

Beside the objective the wheels are wanted at the angles of the balanced circle of the road beside each axle: a trailer then steers
where it is, not where its tractor is, and a straight leaves its wheels straight. Turning them costs, as it does for the front
wheels. The objective and the limits decide the rest. Wheel angles are states of the motion; between stations they change
evenly, and each change is an input of its own.

With this wish alone the semitrailer's worst reach and mean imbalance came out as low as with its axle's offset as a second residual.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.jit import FloatArray, compiled
from hdvplan.planning.motion import aux_ahead
from hdvplan.planning.stations import Stations
from hdvplan.qp.program import StageQp
from hdvplan.vehicle.model import Vehicle

CHANGE_WEIGHT = 20.0  # of the square of a change between stations: as smooth for 7 m of trailer as 1e3 is for curvature [m^2]
ANGLE_WEIGHT = 10.0  # of the squared difference from the wanted angle; ten times more or less changes no reach by 2 cm [m^2]


@dataclass(frozen=True)
class Steering:
    """The wanted angles and the limits of one drive's active axles."""

    aim: FloatArray  # (stations, active), left positive [rad]
    most: FloatArray  # (active,) [rad]
    largest: FloatArray  # (active,), of a change between two stations [rad]

    @classmethod
    def of(cls, vehicle: Vehicle, stations: Stations) -> Steering:
        """Return the wishes for driving ``vehicle`` along all ``stations``."""
        s, axles = stations.s, [vehicle.units[axle] for axle in vehicle.active]
        beside = [s + aux_ahead(vehicle, axle) for axle in vehicle.active]
        angles = [np.interp(at, s, wanted) for at, wanted in zip(beside, stations.centring.steering.T, strict=True)]
        return cls(
            np.stack(angles, axis=1),
            np.array([unit.max_steering_angle for unit in axles]),
            np.array([unit.max_steering_rate * stations.step for unit in axles]),
        )

    def keep(self, z: FloatArray, begin: int) -> None:
        """Bring a motion's angles from stage ``begin`` >= 1 on within what the wheels can do, after those before."""
        _keep(z, begin, self.most, self.largest)

    def write(self, first: int, z: FloatArray, qp: StageQp) -> None:
        """Write what angles and their changes cost at the motion ``z`` from station ``first``, and their limits."""
        _write(
            z, self.aim[first : first + len(z)], self.most, self.largest, ANGLE_WEIGHT, CHANGE_WEIGHT, qp.Q, qp.q, qp.R, qp.r, qp.x_low,
            qp.x_high, qp.u_low, qp.u_high,
        )  # fmt: skip

    def cost(self, first: int, z: FloatArray) -> float:
        """Return what the angles of the motion ``z`` from station ``first`` cost."""
        return _cost(z, self.aim[first : first + len(z)], ANGLE_WEIGHT, CHANGE_WEIGHT)


@compiled
def _keep(z: FloatArray, begin: int, most: FloatArray, largest: FloatArray) -> None:
    for i in range(begin, z.shape[0]):
        for wheel in range(most.size):
            j = z.shape[1] - most.size + wheel
            z[i, j] = max(min(z[i, j], z[i - 1, j] + largest[wheel], most[wheel]), z[i - 1, j] - largest[wheel], -most[wheel])


@compiled
def _write(
    z: FloatArray, aim: FloatArray, most: FloatArray, largest: FloatArray, angle_weight: float, change_weight: float,
    Q: FloatArray, q: FloatArray, R: FloatArray, r: FloatArray, x_low: FloatArray, x_high: FloatArray, u_low: FloatArray,
    u_high: FloatArray,
) -> None:  # fmt: skip
    """Write the wheels' part of a program; their inputs and bounds stand behind those of the curvature."""
    for i in range(r.shape[0]):
        for wheel in range(most.size):
            j, own = z.shape[1] - most.size + wheel, 1 + wheel
            angle = z[i + 1, j]
            change = angle - z[i, j]
            Q[i + 1, j, j], q[i + 1, j] = 2.0 * angle_weight, 2.0 * angle_weight * (angle - aim[i + 1, wheel])
            R[i, own, own], r[i, own] = 2.0 * change_weight, 2.0 * change_weight * change
            x_low[i, own], x_high[i, own] = -most[wheel] - angle, most[wheel] - angle
            u_low[i, own], u_high[i, own] = -largest[wheel] - change, largest[wheel] - change


@compiled
def _cost(z: FloatArray, aim: FloatArray, angle_weight: float, change_weight: float) -> float:
    total = 0.0
    for i in range(1, z.shape[0]):
        for wheel in range(aim.shape[1]):
            j = z.shape[1] - aim.shape[1] + wheel
            total += angle_weight * (z[i, j] - aim[i, wheel]) ** 2 + change_weight * (z[i, j] - z[i - 1, j]) ** 2
    return total
