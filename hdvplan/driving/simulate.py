"""Drive planned steering exactly: the independent judge of every plan.

The continuous road-aligned kinematics are integrated with the classical Runge-Kutta method at a fine step, with the
curvature held over each interval between stations, and wheels that the plan steers turning evenly. Nothing of the planner's
discretisation or linearisation enters.
"""

from __future__ import annotations

import numpy as np

from hdvplan.jit import FloatArray, Records, compiled, inner
from hdvplan.road.path import Curve, ReferencePath, evaluate
from hdvplan.vehicle.kinematics import derivative, rear_wheels

SUBSTEP_M = 0.05  # the integration error of 100 m is then below 1e-6 m (tested against an adaptive integrator)


def simulate(
    units: Records, path: ReferencePath, s_start: float, step: float, z_start: FloatArray, kappa: FloatArray, keep: int,
    steering: FloatArray | None = None,
) -> FloatArray:  # fmt: skip
    """Return the states while driving ``kappa`` [1/m], each value held over ``step`` [m] of road; shape (len(kappa) * keep + 1, n).

    ``steering`` (len(kappa) + 1, active) are the angles of active wheels at the ends of the steps; without it they are held [rad].
    ``keep`` states are returned for every step. NaN from where the model leaves its domain (1 - e_y k <= 0, or the lead rear axle
    no longer moves forward along the road).
    """
    if steering is None:
        steering = np.tile(z_start[1 + len(units) :], (len(kappa) + 1, 1))
    return _simulate(
        units, path.curve, s_start, step, np.ascontiguousarray(z_start),
        np.ascontiguousarray(kappa), keep, int(np.ceil(step / keep / SUBSTEP_M)),
        np.ascontiguousarray(steering),
    )  # fmt: skip


@compiled
def _simulate(
    units: Records, curve: Curve, s_start: float, step: float, z_start: FloatArray,
    kappa: FloatArray, keep: int, substeps: int, steering: FloatArray,
) -> FloatArray:  # fmt: skip
    n, active = z_start.size, steering.shape[1]
    out = np.full((kappa.size * keep + 1, n), np.nan)
    for j in range(n):
        out[0, j] = z_start[j]
    z, probe = z_start.copy(), np.empty(n)
    f, turn = np.empty((4, n)), np.empty(active)
    h = step / (keep * substeps)
    for i in range(kappa.size):
        off = np.arctan(rear_wheels(units, kappa[i])[0])
        for k in range(active):
            turn[k] = (steering[i + 1, k] - steering[i, k]) / step
        for j in range(keep):
            for part in range(substeps):
                s = s_start + i * step + (j * substeps + part) * h
                k_here = evaluate(curve, s)[4]
                k_half = evaluate(curve, s + 0.5 * h)[4]
                k_next = evaluate(curve, s + h)[4]
                derivative(units, k_here, z, kappa[i], f[0])
                _turn(f[0], turn)
                _along(z, 0.5 * h, f[0], probe)
                derivative(units, k_half, probe, kappa[i], f[1])
                _turn(f[1], turn)
                _along(z, 0.5 * h, f[1], probe)
                derivative(units, k_half, probe, kappa[i], f[2])
                _turn(f[2], turn)
                _along(z, h, f[2], probe)
                derivative(units, k_next, probe, kappa[i], f[3])
                _turn(f[3], turn)
                for k in range(n):
                    z[k] += h / 6.0 * (f[0, k] + 2.0 * f[1, k] + 2.0 * f[2, k] + f[3, k])
                if not (1.0 - z[0] * k_next > 0.0 and abs(z[1] + off) < 0.5 * np.pi):
                    return out
            for k in range(n):
                out[i * keep + j + 1, k] = z[k]
        for k in range(active):  # no rounding may carry the wheels off the plan
            z[n - active + k] = out[(i + 1) * keep, n - active + k] = steering[i + 1, k]
    return out


@inner
def _turn(f: FloatArray, turn: FloatArray) -> None:
    """Write the rates of the wheels' angles, which are the last states."""
    for j in range(turn.size):
        f[f.size - turn.size + j] = turn[j]


@inner
def _along(z: FloatArray, h: float, f: FloatArray, out: FloatArray) -> None:
    for j in range(z.size):
        out[j] = z[j] + h * f[j]
