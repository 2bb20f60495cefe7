"""The motion that a planning step linearises at: the last plan, shifted along the road and moved by each QP's step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.jit import FloatArray, Records, compiled
from hdvplan.vehicle.kinematics import POSE
from hdvplan.vehicle.model import Vehicle

_STEEPEST = 1.3  # largest heading error a plan may reach: the model's domain ends at pi/2 [rad]
_INSIDE = 0.05  # smallest 1 - e_y k a plan may reach
_SHORTEST = 1e-3  # share of a step below which it is not taken at all


@dataclass(frozen=True)
class Motion:
    """States and curvatures over one horizon, and the poses that they put the bodies in."""

    stages: Records  # (N+1,): z (n,), and kappa, held until the next stage [1/m]; the last one's kappa is not used
    poses: Records  # (N+1, units) of ``POSE``, where the motion was last linearised

    @classmethod
    def empty(cls, vehicle: Vehicle, stages: int) -> Motion:
        """Return the memory for a horizon of ``stages`` intervals."""
        record = np.dtype([("z", float, (vehicle.states,)), ("kappa", float)])
        return cls(np.zeros(stages + 1, record), np.zeros((stages + 1, len(vehicle.units)), POSE))

    @property
    def z(self) -> FloatArray:
        """The states, (N+1, n)."""
        return self.stages["z"]

    @property
    def kappa(self) -> FloatArray:
        """The curvatures, (N,) [1/m]."""
        return self.stages["kappa"][:-1]


@compiled
def shift(arrays: tuple[FloatArray, ...], by: int) -> None:
    """Move every array ``by`` stages towards its beginning; its last ``by`` stages keep their values."""
    for array in arrays:
        for i in range(array.shape[0] - by):
            for j in range(array.shape[1]):
                array[i, j] = array[i + by, j]


@compiled
def shift_rows(stages: Records, rows: Records, by: int) -> None:
    """Move a program's rows ``by`` stages towards the beginning, before its stages; rows that never bind look all alike."""
    for i in range(stages.size - by):
        if stages[i].live > 0.0 or stages[i + by].live > 0.0:
            for row in range(rows.shape[1]):
                rows[i, row] = rows[i + by, row]


@compiled
def guess(
    motion: Records, z_start: FloatArray, states: FloatArray, curvatures: FloatArray, kept: int, kappa_before: float, most: FloatArray,
    change: FloatArray,
) -> None:  # fmt: skip
    """Extend a motion of which ``kept`` stages are known, and let it begin at ``z_start``.

    From stage ``kept`` on, and for the curvature that leads there, it takes the road's stationary geometry ``states`` (N+1, n) and
    ``curvatures`` (N+1,), brought within what can be steered: at most ``most``, changing by at most ``change`` a station; of the
    curvature first, then of the wheels that the plan steers. A motion that keeps these bounds keeps them after any share of a QP's step.
    """
    for j in range(z_start.size):
        motion[0].z[j] = z_start[j]
    for i in range(max(kept, 1), motion.size):
        z, before = motion[i].z, motion[i - 1].z
        for j in range(z_start.size):
            z[j] = states[i, j]
        for wheel in range(1, most.size):
            j = z.size - most.size + wheel
            z[j] = max(min(z[j], before[j] + change[wheel], most[wheel]), before[j] - change[wheel], -most[wheel])
    for i in range(max(kept - 1, 0), motion.size):
        held = motion[i - 1].kappa if i > 0 else kappa_before
        motion[i].kappa = max(min(curvatures[i], held + change[0], most[0]), held - change[0], -most[0])


@compiled
def take_step(motion: Records, points: Records, road: Records, share: float) -> float:
    """Move a motion by ``share`` of a QP's solution, less where it would leave the model's domain.

    The first state is given: a solver's residual must not move it. Returns the largest change of a state, or infinity
    where no part of the step could be taken.
    """
    n, length, inside = motion[0].z.size, 2.0 * share, False
    while not inside and length > _SHORTEST:
        length *= 0.5
        inside = True
        for i in range(1, motion.size):
            z, x = motion[i].z, points[i].x
            e_y, e_psi = z[0] + length * x[0], z[1] + length * x[1]
            if not (abs(e_psi) < _STEEPEST and 1.0 - e_y * road[i].curvature > _INSIDE):
                inside = False
                break
    if not inside:
        return np.inf
    largest = 0.0
    for i in range(1, motion.size):
        z, x = motion[i].z, points[i].x
        for j in range(n):
            z[j] += length * x[j]
            largest = max(largest, length * abs(x[j]))
        motion[i - 1].kappa += length * x[n]
    return largest
