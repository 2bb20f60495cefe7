"""Drive planned steering exactly: the independent judge of every plan.

The continuous road-aligned kinematics are integrated with the classical Runge-Kutta method at a fine step, with the
curvature held over each interval between stations, and wheels that the plan steers turning evenly. Nothing of the planner's
discretisation or linearisation enters.
"""

from __future__ import annotations

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.road.path import ReferencePath

SUBSTEP_M = 0.05  # the integration error of 100 m is then below 1e-6 m (tested against an adaptive integrator)

_simulate = core.function(
    "hdv_simulate", core.POINTER, core.INT, core.INT, core.POINTER, core.REAL, core.INT, core.REAL, core.POINTER, core.POINTER,
    core.INT, core.INT, core.POINTER,
)  # fmt: skip


def simulate(
    units: Records, path: ReferencePath, s_start: float, step: float, z_start: FloatArray, kappa: FloatArray, keep: int,
    steering: FloatArray | None = None,
) -> FloatArray:  # fmt: skip
    """Return the states while driving ``kappa`` [1/m], each value held over ``step`` [m] of road; shape (len(kappa) * keep + 1, n).

    ``steering`` (len(kappa) + 1, active) are the angles of active wheels at the ends of the steps; without it they are held [rad].
    ``keep`` states are returned for every step. NaN from where the model leaves its domain (1 - e_y k <= 0, or the lead rear axle
    no longer moves forward along the road).
    """
    n = len(z_start)
    if steering is None:
        steering = np.tile(z_start[1 + len(units) :], (len(kappa) + 1, 1))
    kappa, steering = np.ascontiguousarray(kappa, dtype=float), np.ascontiguousarray(steering, dtype=float)
    states = np.full((len(kappa) * keep + 1, n), np.nan)
    states[0] = z_start
    _simulate(
        core.address(units), len(units), n, core.address(path.record), s_start, len(kappa), step, core.address(kappa),
        core.address(steering), keep, int(np.ceil(step / keep / SUBSTEP_M)), core.address(states),
    )  # fmt: skip
    return states
