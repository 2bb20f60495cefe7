"""What lies around a vehicle whose leading axle stands on one of the road's normals, in the road's frame there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hdvplan.jit import FloatArray, IntArray, compiled
from hdvplan.proof.space import MOST, Beside, Frame, free_space


class Around(NamedTuple):
    """What lies around the axle at one station, in the road's frame there.

    ``corners`` (n, 2) of obstacles, ``free`` and ``lines`` (2, bins, ...): counts and lines of ``free_space``, by regions; ``near`` (2,):
    lowest and highest offset on the axle's own normal.
    """

    corners: FloatArray
    free: IntArray
    lines: FloatArray
    near: FloatArray


@compiled
def unknown(beside: Beside, bins: int) -> Around:
    """Return memory for what is around one station after the other."""
    return Around(np.empty_like(beside.corners), np.zeros((2, bins), np.int64), np.empty((2, bins, MOST, 4)), np.empty(2))


@compiled
def around_at(beside: Beside, frame: Frame, i: int, reach: float, two_regions: bool, memory: Around) -> Around:
    """Return what lies around station ``i``, as far as bodies within ``reach`` [m] of the axle can touch it; valid until the next call."""
    window, bins = _window(beside, frame.s[i], reach), memory.free.shape[1]
    _axle_room(beside, frame, i, memory.near)
    for region in range(0 if two_regions else 1, 2):
        free_space(
            beside, region, window, frame.x[i], frame.y[i], frame.heading[i], memory.near, bins, memory.free[region], memory.lines[region]
        )
    return Around(memory.corners[: _corners_near(beside, frame, i, reach, memory.corners)], memory.free, memory.lines, memory.near)


@compiled
def _window(beside: Beside, s: float, reach: float) -> IntArray:
    """Return the first and the last (excluded) quadrilateral that a body can touch whose axle stands at ``s``."""
    first = max(0, int(np.searchsorted(beside.s, s - 2.5 * reach - 10.0)) - 1)
    return np.array([first, min(beside.s.size - 1, int(np.searchsorted(beside.s, s + 2.5 * reach + 10.0)))])


@compiled
def _axle_room(beside: Beside, frame: Frame, i: int, near: FloatArray) -> None:
    """Write between which offsets the axle can stand on its own normal: those of the quadrilaterals around it."""
    cos, sin = np.cos(frame.heading[i]), np.sin(frame.heading[i])
    last = beside.s.size - 2
    at = int(np.searchsorted(beside.s, frame.s[i]))
    near[0], near[1] = np.inf, -np.inf
    for k in range(min(max(at - 2, 0), last), min(at + 1, last) + 1):
        for c in range(4):
            v = (beside.quads[1, k, c, 1] - frame.y[i]) * cos - (beside.quads[1, k, c, 0] - frame.x[i]) * sin
            near[0], near[1] = min(near[0], v), max(near[1], v)


@compiled
def _corners_near(beside: Beside, frame: Frame, i: int, reach: float, corners: FloatArray) -> int:
    """Write those corners of obstacles that a body can touch into ``corners``, in the road's frame, and return how many they are."""
    cos, sin = np.cos(frame.heading[i]), np.sin(frame.heading[i])
    number = 0
    for n in range(beside.corners.shape[0]):
        x, y = beside.corners[n, 0] - frame.x[i], beside.corners[n, 1] - frame.y[i]
        u = x * cos + y * sin
        if abs(u) <= reach:
            corners[number, 0], corners[number, 1] = u, y * cos - x * sin
            number += 1
    return number
