"""The simulation, see ``core/simulate.c``."""

import numpy as np

from hdvplan.arrays import FloatArray, Records
from hdvplan.road.path import ReferencePath
from tests.core.twins.kinematics import rates, rear_wheels
from tests.core.twins.path import evaluate


def simulate(
    units: Records, path: ReferencePath, s_start: float, step: float, z_start: FloatArray, kappa: FloatArray, keep: int, substeps: int,
    steering: FloatArray,
) -> FloatArray:  # fmt: skip
    """Return the states while driving, shape (len(kappa) * keep + 1, n); NaN from where the model leaves its domain."""
    z, rigid, h = z_start.copy(), 1 + len(units), step / (keep * substeps)
    out = np.full((len(kappa) * keep + 1, len(z)), np.nan)
    out[0] = z
    for i, held in enumerate(kappa):
        off, turn = np.arctan(rear_wheels(units, held)), (steering[i + 1] - steering[i]) / step

        def slope(k: float, at: FloatArray, held: float = held, turn: FloatArray = turn) -> FloatArray:
            return np.concatenate([rates(units, k, at, held)[:rigid], turn])

        for part in range(keep * substeps):
            first, middle, last = (evaluate(path, s_start + i * step + (part + ahead) * h)[4] for ahead in (0.0, 0.5, 1.0))
            f_1 = slope(first, z)
            f_2 = slope(middle, z + 0.5 * h * f_1)
            f_3 = slope(middle, z + 0.5 * h * f_2)
            f_4 = slope(last, z + h * f_3)
            z = z + h / 6.0 * (f_1 + 2.0 * f_2 + 2.0 * f_3 + f_4)
            if not (1.0 - z[0] * last > 0.0 and abs(z[1] + off) < 0.5 * np.pi):
                return out
            if (part + 1) % substeps == 0:
                out[i * keep + (part + 1) // substeps] = z
        z[rigid:] = out[(i + 1) * keep, rigid:] = steering[i + 1]
    return out
