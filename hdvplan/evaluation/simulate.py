"""Drive a planned curvature exactly: the independent judge of every plan.

The continuous road-aligned kinematics are integrated with the classical Runge-Kutta method at a fine step, with the
curvature held over each interval between stations. Nothing of the planner's discretisation or linearisation enters.
"""

from __future__ import annotations

import numpy as np

from hdvplan.jit import FloatArray, compiled
from hdvplan.road.path import ReferencePath, evaluate
from hdvplan.vehicle.kinematics import derivative

SUBSTEP_M = 0.05  # the integration error of 100 m is then below 1e-6 m (tested against an adaptive integrator)


def simulate(
    units: FloatArray, path: ReferencePath, s_start: float, step: float, z_start: FloatArray, kappa: FloatArray, keep: int
) -> FloatArray:
    """Return the states while driving ``kappa`` [1/m], each value held over ``step`` [m] of road; shape (len(kappa) * keep + 1, n).

    ``keep`` states are returned for every step. NaN from where the model leaves its domain (1 - e_y k <= 0 or |e_psi| >= pi/2).
    """
    return _simulate(
        units, path.coefficients, path.s_first, path.spacing, s_start, step, np.ascontiguousarray(z_start),
        np.ascontiguousarray(kappa), keep, int(np.ceil(step / keep / SUBSTEP_M)),
    )  # fmt: skip


@compiled
def _simulate(
    units: FloatArray, coefficients: FloatArray, s_first: float, spacing: float, s_start: float, step: float, z_start: FloatArray,
    kappa: FloatArray, keep: int, substeps: int,
) -> FloatArray:  # fmt: skip
    n = z_start.size
    out = np.full((kappa.size * keep + 1, n), np.nan)
    out[0] = z_start
    z, probe = z_start.copy(), np.empty(n)
    f = np.empty((4, n))
    h = step / (keep * substeps)
    for i in range(kappa.size):
        for j in range(keep):
            for part in range(substeps):
                s = s_start + i * step + (j * substeps + part) * h
                k_here = evaluate(coefficients, s_first, spacing, s)[4]
                k_half = evaluate(coefficients, s_first, spacing, s + 0.5 * h)[4]
                k_next = evaluate(coefficients, s_first, spacing, s + h)[4]
                derivative(units, k_here, z, kappa[i], f[0])
                probe[:] = z + 0.5 * h * f[0]
                derivative(units, k_half, probe, kappa[i], f[1])
                probe[:] = z + 0.5 * h * f[1]
                derivative(units, k_half, probe, kappa[i], f[2])
                probe[:] = z + h * f[2]
                derivative(units, k_next, probe, kappa[i], f[3])
                z += h / 6.0 * (f[0] + 2.0 * f[1] + 2.0 * f[2] + f[3])
                if not (1.0 - z[0] * k_next > 0.0 and abs(z[1]) < 0.5 * np.pi):
                    return out
            out[i * keep + j + 1] = z
    return out
