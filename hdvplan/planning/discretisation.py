"""How states are predicted from a planned curvature: one rule for each entry, with its exact linearisation.

A rule says where the state is one station ahead, z_next = z + step * F(z, z_next, kappa), and how that changes with z and kappa. To add
one: a member of ``Discretisation``, and its branch in ``advance`` and ``linearise_interval``.
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
    GAUSS = "gauss"  # implicit midpoint rule: Gauss-Legendre collocation at one point, half the error of the explicit one

    @property
    def code(self) -> int:
        """The rule as kernels take it."""
        return _CODES[self]


_CODES = {rule: code for code, rule in enumerate(Discretisation)}
_MIDPOINT, _EULER, _GAUSS = (_CODES[rule] for rule in (Discretisation.MIDPOINT, Discretisation.EULER, Discretisation.GAUSS))
_PASSES = 50  # of the fixed point in ``advance``: a step shorter than every wheelbase leaves less than half the error at each


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
    for _ in range(0 if rule == _EULER else 1 if rule == _MIDPOINT else _PASSES):
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
    """Write A, B, c of one interval into its ``stage``: dz_next = A dz + B d kappa + c, at the motion from a stage to ``ahead``.

    ``at`` is the station, ``poses`` are the stage's, ``probe`` (units,) is memory for others. c is z_next - ``ahead``; with an implicit
    rule z_next is where Newton's first step from ``ahead`` ends.

    The last state of the vehicle's own block is kappa of the interval before, and the first input its change: kappa's column of A is
    B's. An active axle's wheels turn evenly between stations, by the motion's change of their angle and a separate input.
    """
    z, kappa = motion.z, motion.kappa
    n, rigid, f, a, b, half = z.size, 1 + units.size, work.f, work.a, work.b, 0.5 * step
    if rule != _GAUSS:
        jacobian(units, at.curvature, z, kappa, poses, f, a, b, work.chain)
    if rule != _EULER:
        for j in range(n):
            work.middle[j] = z[j] + half * f[j] if rule == _MIDPOINT and j < rigid else 0.5 * (z[j] + ahead[j])
            work.b_first[j] = b[j]
            for t in range(n):
                work.a_first[j, t] = a[j, t]
        turn(units, work.middle, probe)
        jacobian(units, at.curvature_between, work.middle, kappa, probe, f, a, b, work.chain)
    if rule == _MIDPOINT:
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
                stage.A[j, t] = (half if rule == _GAUSS and t < rigid else step) * a[j, t]
            stage.A[j, n] = stage.B[j, 0] = step * b[j]
    for j in range(n):
        stage.A[j, j] += 1.0
        stage.c[j] = z[j] + step * f[j] - ahead[j]
    for wheel in range(rigid, n):
        for j in range(rigid):
            stage.B[j, 1 + wheel - rigid] = half * a[j, wheel] if rule != _EULER else 0.0
        stage.c[wheel] = 0.0
    if rule == _GAUSS:
        _collocate(half, rigid, a, stage)


@inner
def _collocate(half: float, rigid: int, a: FloatArray, stage: Record) -> None:
    """Solve (I - half * a) dz_next = A dz + B d kappa + c for dz_next, in place.

    The matrix is close to the identity: elimination needs no pivots. What a chain's couplings have from those behind them is zero.
    """
    n, m = a.shape[0], stage.B.shape[1]
    for j in range(rigid):
        for t in range(rigid):
            a[j, t] *= -half
        a[j, j] += 1.0
    for pivot in range(rigid):
        for j in range(rigid):
            share = a[j, pivot] / a[pivot, pivot]
            if j != pivot and share != 0.0:
                for t in range(pivot + 1, rigid):
                    a[j, t] -= share * a[pivot, t]
                for t in range(n + 1):
                    stage.A[j, t] -= share * stage.A[pivot, t]
                for t in range(1, m):
                    stage.B[j, t] -= share * stage.B[pivot, t]
                stage.c[j] -= share * stage.c[pivot]
    for j in range(rigid):
        scale = 1.0 / a[j, j]
        for t in range(n + 1):
            stage.A[j, t] *= scale
        for t in range(1, m):
            stage.B[j, t] *= scale
        stage.B[j, 0] = stage.A[j, n]
        stage.c[j] *= scale
