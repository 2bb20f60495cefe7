"""The one numerical derivative that every exact derivative is checked against."""

from collections.abc import Callable

import numpy as np

from hdvplan.arrays import FloatArray

STEP = 1e-3


def differences(function: Callable[[FloatArray], FloatArray | float], at: FloatArray, step: float = STEP) -> FloatArray:
    """Return the derivative of ``function`` at ``at`` by the five-point rule; shape (values, len(at)).

    Its error is about step^4 / 30 times the fifth derivative plus 1e-16 / step times the value: near 1e-12 for smooth
    functions of size one.
    """
    columns = []
    for j in range(at.size):
        unit = np.zeros(at.size)
        unit[j] = step
        far = np.atleast_1d(function(at - 2.0 * unit)) - np.atleast_1d(function(at + 2.0 * unit))
        close = np.atleast_1d(function(at + unit)) - np.atleast_1d(function(at - unit))
        columns.append((far + 8.0 * close) / (12.0 * step))
    return np.stack(columns, axis=-1)
