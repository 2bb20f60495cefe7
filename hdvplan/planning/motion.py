"""The motion that a planning step linearises at: the last plan, extended along the road and moved by each QP's step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.arrays import FloatArray, Records
from hdvplan.vehicle.kinematics import POSE
from hdvplan.vehicle.model import Vehicle


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
