"""Both methods of our solver on dense matrices, see ``core/active_set.c`` and ``core/interior.c``."""

import numpy as np

from hdvplan.arrays import BoolArray, FloatArray
from tests.core.programs import Dense


def at_active_set(program: Dense, active: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return the point at which the ``active`` inequalities hold with equality, all others left out, and all multipliers of G v <= h."""
    held = np.vstack([program.E, program.G[active]])
    system = np.block([[program.P, held.T], [held, np.zeros((len(held), len(held)))]])
    found = np.linalg.solve(system, np.concatenate([-program.q, program.b, program.h[active]]))
    multipliers = np.zeros(len(program.h))
    multipliers[active] = found[len(program.q) + len(program.b) :]
    return found[: len(program.q)], multipliers


def interior(program: Dense, tolerance: float = 1e-9, most: int = 60) -> tuple[FloatArray, FloatArray]:
    """Return the optimum and the multipliers of G v <= h by Mehrotra's predictor-corrector method."""
    v = np.asarray(np.linalg.lstsq(program.E, program.b)[0], float)
    y, z = np.zeros(len(program.b)), np.ones(len(program.h))
    s: FloatArray = np.maximum(program.h - program.G @ v, 1.0)
    for _ in range(most):
        dual = program.P @ v + program.q + program.E.T @ y + program.G.T @ z
        equal, below, mean = program.E @ v - program.b, program.G @ v + s - program.h, float(s @ z) / len(s)
        if max(mean, *(float(np.max(np.abs(part))) for part in (dual, equal, below))) < tolerance:
            return v, z
        weights = z / s
        system = np.block([[program.P + program.G.T * weights @ program.G, program.E.T], [program.E, np.zeros((len(y), len(y)))]])
        products = s * z
        for corrects in (False, True):  # towards no products; then towards those that the first leaves, with its second order
            pushed = weights * below - products / s
            found = np.linalg.solve(system, -np.concatenate([dual + program.G.T @ pushed, equal]))
            d_v, d_y = found[: len(v)], found[len(v) :]
            d_s = -below - program.G @ d_v
            d_z = -(products + z * d_s) / s
            length = min(1.0, 1.0 / max(1e-300, float(np.max(-d_s / s)), float(np.max(-d_z / z))))
            left = float((s + length * d_s) @ (z + length * d_z)) / len(s)
            products = products if corrects else s * z + d_s * d_z - mean * (left / mean) ** 3
        length = min(1.0, 0.995 * length)
        v, y, z, s = v + length * d_v, y + length * d_y, z + length * d_z, s + length * d_s
    msg = f"no optimum after {most} iterations"
    raise AssertionError(msg)
