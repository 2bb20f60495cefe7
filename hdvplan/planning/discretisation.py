"""How a planned curvature is turned into predicted states: one rule an entry, with its exact linearisation.

A rule says where the state is one station ahead, z_next = z + step * F(z, kappa), and how that changes with z and kappa. To add one:
a member of ``Discretisation``, and its branch in ``advance`` and ``linearise_interval``.
"""

from __future__ import annotations

from enum import StrEnum

import numpy as np

from hdvplan.jit import FloatArray, Record, Records, compiled, inner
from hdvplan.vehicle.kinematics import derivative, jacobian, turn


class Discretisation(StrEnum):
    """The rules."""

    MIDPOINT = "midpoint"  # explicit midpoint rule: agrees with the simulation to millimetres at 0.5 m
    EULER = "euler"  # as in [GEO]

    @property
    def code(self) -> int:
        """The rule as kernels take it."""
        return _CODES[self]


_CODES = {rule: code for code, rule in enumerate(Discretisation)}
_MIDPOINT = _CODES[Discretisation.MIDPOINT]


def memory(states: int) -> Records:
    """Return the memory of one linearisation, one record."""
    n = states
    vectors, squares = ("f", "b", "b_first", "middle"), ("a", "a_first")
    sizes = dict.fromkeys(vectors, (n,)) | dict.fromkeys(squares, (n, n)) | {"chain": (3, n + 1)}
    return np.zeros(1, np.dtype([(name, float, size) for name, size in sizes.items()]))


@compiled
def advance(
    rule: int, units: Records, k: float, k_between: float, step: float, z: FloatArray, kappa: float, out: FloatArray, work: Record
) -> None:
    """Write the state one station ahead into ``out`` (n,), active wheels held.

    ``k`` and ``k_between`` are the road's curvature at the station and half-way to the next [1/m], ``work`` a record of ``memory``.
    """
    derivative(units, k, z, kappa, work.f)
    if rule == _MIDPOINT:
        for j in range(z.size):
            work.middle[j] = z[j] + 0.5 * step * work.f[j]
        derivative(units, k_between, work.middle, kappa, work.f)
    for j in range(z.size):
        out[j] = z[j] + step * work.f[j]


@inner
def linearise_interval(
    rule: int, units: Records, at: Record, step: float, motion: Record, ahead: FloatArray, poses: Records, stage: Record, work: Record,
    probe: Records,
) -> None:  # fmt: skip
    """Write A, B, c of one interval into its ``stage``: dz_next = A dz + B d kappa + defect, at the motion from a stage to ``ahead``.

    ``at`` is the station, ``poses`` are the stage's, ``probe`` (units,) is memory for others.

    The last state of the vehicle's own block is kappa of the interval before, and the first input its change: kappa's column of A is
    B's. An active axle's wheels turn evenly between stations, by the motion's change of their angle and an input of their own.
    """
    z, kappa = motion.z, motion.kappa
    n, rigid, f, a, b = z.size, 1 + units.size, work.f, work.a, work.b
    jacobian(units, at.curvature, z, kappa, poses, f, a, b, work.chain)
    if rule == _MIDPOINT:
        half = 0.5 * step
        for j in range(n):
            work.middle[j] = z[j] + half * f[j] if j < rigid else 0.5 * (z[j] + ahead[j])
            work.b_first[j] = b[j]
            for t in range(n):
                work.a_first[j, t] = a[j, t]
        turn(units, work.middle, probe)
        jacobian(units, at.curvature_between, work.middle, kappa, probe, f, a, b, work.chain)
        for j in range(n):  # the middle depends on z and kappa: a += step / 2 a a_first, b += step / 2 a b_first
            by_kappa = b[j]
            for t in range(n):
                total = a[j, t]
                for m in range(n):
                    total += half * a[j, m] * work.a_first[m, t]
                by_kappa += half * a[j, t] * work.b_first[t]
                stage.A[j, t] = step * total
            stage.A[j, n] = stage.B[j, 0] = step * by_kappa
    else:
        for j in range(n):
            for t in range(n):
                stage.A[j, t] = step * a[j, t]
            stage.A[j, n] = stage.B[j, 0] = step * b[j]
    for j in range(n):
        stage.A[j, j] += 1.0
        stage.c[j] = z[j] + step * f[j] - ahead[j]
    for wheel in range(rigid, n):
        for j in range(rigid):
            stage.B[j, 1 + wheel - rigid] = 0.5 * step * a[j, wheel] if rule == _MIDPOINT else 0.0
        stage.c[wheel] = 0.0
