"""The rules by which states are predicted, written out once more: as the gap that a motion leaves to them."""

from collections.abc import Callable

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.planning.settings import Discretisation

Rates = Callable[[FloatArray], FloatArray]  # dz/ds of a state, at one place of the road


def gap(rule: Discretisation, here: Rates, between: Rates, step: float, z: FloatArray, change: FloatArray, ahead: FloatArray) -> FloatArray:
    """Return where the rule ends, less ``ahead``; ``change`` is that of wheels which the plan turns, and zero of all other states.

    ``here`` are the rates at the road's place of ``z``, ``between`` half-way to the next.
    """
    if rule is Discretisation.EULER:
        slope = here(z)
    elif rule is Discretisation.MIDPOINT:
        slope = between(z + 0.5 * step * here(z) + 0.5 * change)
    else:
        slope = between(0.5 * (z + ahead))
    left: FloatArray = z + step * slope + change - ahead
    return left


_ADVANCE = core.function(
    "hdv_advance", core.INT, core.POINTER, core.INT, *(core.REAL,) * 3, core.INT, core.POINTER, core.REAL, core.POINTER
)


def advance(rule: int, units: Records, k: float, k_between: float, step: float, z: FloatArray, kappa: float, out: FloatArray) -> None:
    """Write the state one station ahead into ``out`` (n,), active wheels held.

    ``k`` and ``k_between`` are the road's curvature at the station and half-way to the next [1/m].
    """
    z = np.ascontiguousarray(z)
    _ADVANCE(rule, core.address(units), len(units), k, k_between, step, len(z), core.address(z), kappa, core.address(out))
