"""How states are predicted from a planned curvature: one rule for each entry, with its exact linearisation.

A rule says where the state is one station ahead, z_next = z + step * F(z, z_next, kappa), and how that changes with z and kappa. To add
one: a member of ``Discretisation``, and its branch in ``hdv_advance`` and ``linearise_interval`` of ``hdvplan/core/dynamics.c``.
"""

from __future__ import annotations

from enum import StrEnum

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records


class Discretisation(StrEnum):
    """The rules."""

    MIDPOINT = "midpoint"  # explicit midpoint rule: agrees with the simulation to millimetres at 0.5 m
    EULER = "euler"  # as in [GEO]
    GAUSS = "gauss"  # implicit midpoint rule: Gauss-Legendre collocation at one point, half the error of the explicit one

    @property
    def code(self) -> int:
        """The rule as the core takes it."""
        return _CODES[self]


_CODES = {rule: core.number(f"HDV_{rule.name}") for rule in Discretisation}
_ADVANCE = core.function(
    "hdv_advance", core.INT, core.POINTER, core.INT, *(core.REAL,) * 3, core.INT, core.POINTER, core.REAL, core.POINTER
)


def advance(rule: int, units: Records, k: float, k_between: float, step: float, z: FloatArray, kappa: float, out: FloatArray) -> None:
    """Write the state one station ahead into ``out`` (n,), active wheels held.

    ``k`` and ``k_between`` are the road's curvature at the station and half-way to the next [1/m].
    """
    z = np.ascontiguousarray(z)
    _ADVANCE(rule, core.address(units), len(units), k, k_between, step, len(z), core.address(z), kappa, core.address(out))
