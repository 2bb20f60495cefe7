"""What a plan wants from axles that it steers itself, and what their wheels can do.

Beside the objective every active axle is wanted where it runs on the balanced circle of the road beside it: that is what keeps a
trailer behind its tractor where the road begins and ceases to bend, and on constant curves it agrees with the objective. The wheels'
angle is wanted near that circle's, lightly, so that a straight leaves them straight; what costs is turning them.
Wheel angles are states of the motion. Between stations they change evenly; each change is an input of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.jit import FloatArray, compiled
from hdvplan.planning.linearise import linearise_objective
from hdvplan.planning.merit import residual_squared
from hdvplan.planning.motion import aux_ahead
from hdvplan.planning.qp import StageQp
from hdvplan.planning.stations import Stations
from hdvplan.vehicle.model import Vehicle

OFFSET_WEIGHT = 1.0  # of an active axle's squared offset from where it is wanted, against the centred error's square
CHANGE_WEIGHT = 20.0  # of the square of a change of angle between stations: as smooth for 7 m of trailer as 1e3 for curvature [m^2]
ANGLE_WEIGHT = 0.1  # of an angle's squared difference from the balanced circle's [m^2]


@dataclass(frozen=True)
class Steering:
    """The wishes for one drive's active axles, and the memory of writing them into one planning step's program."""

    units: FloatArray
    stations: Stations
    axles: tuple[int, ...]  # units, from 0
    nothing: FloatArray  # (stations,) zeros
    weight: FloatArray  # (stations,), root of ``OFFSET_WEIGHT``
    target: FloatArray  # (axles, stations), where each axle is wanted, times ``weight`` [m]
    aim: FloatArray  # (stations, axles), the balanced circle's angles where the axle is [rad]
    ahead: FloatArray  # (axles,), of the lead rear axle on a straight [m]
    most: FloatArray  # (axles,) [rad]
    change: FloatArray  # (axles,), largest between two stations [rad]
    feet: FloatArray  # (axles, N+1), last feet of the axles [m]
    squares: FloatArray  # (N+1,), what the stages' objectives are worth
    Q: FloatArray  # (N+1, n, n), of one axle's offset
    q: FloatArray  # (N+1, n)

    @classmethod
    def of(cls, vehicle: Vehicle, stations: Stations, stages: int) -> Steering:
        """Return the memory for horizons of ``stages`` intervals."""
        axles, s, n = vehicle.active, stations.s, vehicle.states
        ahead = np.array([aux_ahead(vehicle, axle) for axle in axles])
        weight = np.full(len(s), np.sqrt(OFFSET_WEIGHT))
        wanted, angles = stations.centering.e_active + stations.bias[:, None], stations.centering.steering
        beside = [s + by for by in ahead]
        target = [weight * np.interp(at, s, column) for at, column in zip(beside, wanted.T, strict=True)]
        aim = [np.interp(at, s, column) for at, column in zip(beside, angles.T, strict=True)]
        return cls(
            vehicle.table(),
            stations,
            axles,
            np.zeros(len(s)),
            weight,
            np.array(target),
            np.stack(aim, axis=1),
            ahead,
            np.array([vehicle.units[axle].max_steering_angle for axle in axles]),
            np.array([vehicle.units[axle].max_steering_rate * stations.step for axle in axles]),
            np.zeros((len(axles), stages + 1)),
            np.zeros(stages + 1),
            np.zeros((stages + 1, n, n)),
            np.zeros((stages + 1, n)),
        )

    def by_stage(self) -> tuple[FloatArray, ...]:
        """Return every array that belongs to the plan as a view of shape (stages, values)."""
        return (*(feet[:, None] for feet in self.feet), self.squares[:, None])

    def guess(self, first: int, begin: int, z: FloatArray) -> None:
        """Bring a guessed motion's angles from stage ``begin`` on within what the wheels can do; ``z[0]`` is given."""
        self.feet[:, begin:] = self.stations.s[first + begin : first + len(z)] + self.ahead[:, None]
        _keep_wheels(z, max(begin, 1), self.most, self.change)

    def write(self, first: int, begin: int, measured: int, z: FloatArray, Q: FloatArray, q: FloatArray) -> int:
        """Add the wishes to the objective of the stages from ``begin`` on; return -1, or a stage whose axle has no foot.

        The objective that they are added to is the square of one residual at the stages behind number ``measured``.
        """
        path, road, horizon = self.stations.path, self.stations.road, slice(first, first + len(z))
        _add_angles(z, self.aim[horizon], ANGLE_WEIGHT, CHANGE_WEIGHT, begin, measured, self.squares, Q, q)
        for axle, target, feet in zip(self.axles, self.target, self.feet, strict=True):
            lost = linearise_objective(
                self.units, axle, path.coefficients, path.s_first, path.spacing, road[:, horizon], z, self.nothing[horizon],
                self.weight[horizon], target[horizon], feet, begin, len(z), self.Q, self.q,
            )  # fmt: skip
            if lost >= 0:
                return lost
            _add_offset(self.Q, self.q, begin, self.squares, Q, q)
        return -1

    def write_inputs(self, z: FloatArray, qp: StageQp) -> None:
        """Write what changing the angles costs, and the limits of angles and changes."""
        _write_inputs(z, self.most, self.change, CHANGE_WEIGHT, qp.R, qp.r, qp.x_low, qp.x_high, qp.u_low, qp.u_high)


@compiled
def _keep_wheels(z: FloatArray, begin: int, most: FloatArray, change: FloatArray) -> None:
    """Bring the angles of stages from ``begin`` >= 1 on within their limits; the last states are the angles."""
    rigid = z.shape[1] - most.size
    for i in range(begin, z.shape[0]):
        for wheel in range(most.size):
            before = z[i - 1, rigid + wheel]
            angle = max(min(z[i, rigid + wheel], before + change[wheel], most[wheel]), before - change[wheel], -most[wheel])
            z[i, rigid + wheel] = angle


@compiled
def _add_angles(
    z: FloatArray, aim: FloatArray, angle_weight: float, change_weight: float, begin: int, measured: int, squares: FloatArray,
    Q: FloatArray, q: FloatArray,
) -> None:  # fmt: skip
    """Add the angles' part to Q, q of the stages from ``begin`` on, and begin ``squares`` with all but the axles' offsets."""
    rigid = z.shape[1] - aim.shape[1]
    for i in range(begin, z.shape[0]):
        squares[i] = residual_squared(Q[i], q[i], z.shape[1]) if i > measured else 0.0
        for wheel in range(aim.shape[1]):
            j = rigid + wheel
            off = z[i, j] - aim[i, wheel]
            squares[i] += angle_weight * off * off + change_weight * (z[i, j] - z[i - 1, j]) ** 2
            Q[i, j, j] += 2.0 * angle_weight
            q[i, j] += 2.0 * angle_weight * off


@compiled
def _add_offset(Q_own: FloatArray, q_own: FloatArray, begin: int, squares: FloatArray, Q: FloatArray, q: FloatArray) -> None:
    """Add one axle's residual to the stages from ``begin`` on."""
    n = q_own.shape[1]
    for i in range(begin, q_own.shape[0]):
        squares[i] += residual_squared(Q_own[i], q_own[i], n)
        for j in range(n):
            q[i, j] += q_own[i, j]
            for k in range(n):
                Q[i, j, k] += Q_own[i, j, k]


@compiled
def _write_inputs(
    z: FloatArray, most: FloatArray, largest: FloatArray, weight: float, R: FloatArray, r: FloatArray, x_low: FloatArray,
    x_high: FloatArray, u_low: FloatArray, u_high: FloatArray,
) -> None:  # fmt: skip
    """Write the wheels' inputs and bounds, which stand behind those of the curvature."""
    rigid = z.shape[1] - most.size
    for i in range(r.shape[0]):
        for wheel in range(most.size):
            own, angle = 1 + wheel, z[i + 1, rigid + wheel]
            change = angle - z[i, rigid + wheel]
            R[i, own, own], r[i, own] = 2.0 * weight, 2.0 * weight * change
            u_low[i, own], u_high[i, own] = -largest[wheel] - change, largest[wheel] - change
            x_low[i, own], x_high[i, own] = -most[wheel] - angle, most[wheel] - angle
