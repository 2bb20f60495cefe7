"""A driven manoeuvre, see ``core/follow.c``."""

import numpy as np
from scipy.optimize import brentq

from hdvplan.arrays import FloatArray, IntArray, Records
from tests.core.twins.kinematics import rates


def rates_along(units: Records, point: tuple[float, float], heading: float, y: FloatArray) -> tuple[FloatArray, float]:
    """Return dy/ds of the lead heading and the articulations, and the kappa that moves the lead unit's ``point`` along ``heading``."""
    ahead, left = point
    z = np.concatenate([[0.0, 0.0], y[1:]])

    def velocity(kappa: float) -> tuple[float, float]:
        sideways, turn = rates(units, 0.0, z, kappa)[:2]
        return 1.0 - left * turn, sideways + ahead * turn

    def miss(kappa: float) -> float:
        along, across = velocity(kappa)
        return float(across * np.cos(heading - y[0]) - along * np.sin(heading - y[0]))

    kappa = float(brentq(miss, -1.0, 1.0, xtol=1e-16))
    return rates(units, 0.0, z, kappa)[1:] / np.hypot(*velocity(kappa)), kappa


def follow(
    units: Records, point: tuple[float, float], pieces: FloatArray, counts: IntArray, substeps: int, heading: float, most: float
) -> tuple[FloatArray, FloatArray]:
    """Return lead heading and articulations at every pose, and kappa; NaN from where ``kappa`` passes ``most``."""
    y = np.zeros(len(units))
    states, kappas = np.full((1 + counts.sum(), len(y)), np.nan), np.full(1 + counts.sum(), np.nan)
    states[0], kappas[0], row = y, rates_along(units, point, heading, y)[1], 0
    for (length, begin, end), count in zip(pieces, counts, strict=True):
        h = length / (count * substeps)
        for step in range(count * substeps):
            directions = [heading + begin * u + 0.5 * (end - begin) / length * u * u for u in h * (step + np.array([0.0, 0.5, 1.0]))]
            f_1, first = rates_along(units, point, directions[0], y)
            f_2, second = rates_along(units, point, directions[1], y + 0.5 * h * f_1)
            f_3, third = rates_along(units, point, directions[1], y + 0.5 * h * f_2)
            f_4, fourth = rates_along(units, point, directions[2], y + h * f_3)
            if max(map(abs, (first, second, third, fourth))) > most:
                return states, kappas
            y = y + h / 6.0 * (f_1 + 2.0 * f_2 + 2.0 * f_3 + f_4)
            if (step + 1) % substeps == 0:
                row += 1
                states[row], kappas[row] = y, rates_along(units, point, directions[2], y)[1]
        heading += 0.5 * (begin + end) * length
    return states, kappas
