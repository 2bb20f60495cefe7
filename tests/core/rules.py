"""The rules by which states are predicted, written out once more: as the gap that a motion leaves to them."""

from collections.abc import Callable

from hdvplan.arrays import FloatArray
from hdvplan.planning.discretisation import Discretisation

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
