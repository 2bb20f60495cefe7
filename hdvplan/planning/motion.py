"""The motion that a planning step linearises at: the last plan, extended along the road and moved by each QP's step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.qp.program import StageSolution
from hdvplan.vehicle.kinematics import POSE
from hdvplan.vehicle.model import Vehicle

_GUESS = core.function("hdv_guess_motion", *(core.POINTER,) * 4, core.INT, core.POINTER, core.POINTER, core.INT)
_TAKE_STEP = core.function("hdv_take_step", core.POINTER, core.POINTER, core.REAL, returns=core.REAL)


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


def guess(
    scene: Records, z_start: FloatArray, states: FloatArray, curvatures: FloatArray, kept: int, most: FloatArray, change: FloatArray
) -> None:
    """Extend the motion of a ``scene``, a record of ``SCENE``, of which ``kept`` stages are known, and let it begin at ``z_start``.

    From stage ``kept`` on, and for the curvature that leads there, it takes the road's stationary geometry ``states`` (N+1, n) and
    ``curvatures`` (N+1,), brought within what can be steered: at most ``most``, changing by at most ``change`` a station; of the
    curvature first, then of the wheels that the plan steers. A motion that keeps these bounds keeps them after any share of a QP's step.
    """
    start = np.ascontiguousarray(z_start, float)
    arrays = map(core.address, (scene, start, states, curvatures))
    _GUESS(*arrays, kept, core.address(most), core.address(change), len(most) - 1)


def take_step(scene: Records, solution: StageSolution, share: float) -> float:
    """Move the motion of a ``scene``, a record of ``SCENE``, by ``share`` of a QP's solution, less where it would leave the model's domain.

    The first state is given: a solver's residual must not move it. Returns the largest change of a state, or infinity
    where no part of the step could be taken.
    """
    return float(_TAKE_STEP(core.address(scene), core.address(solution.record), share))
