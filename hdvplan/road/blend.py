"""Pieces of a line that meet with gaps and kinks become one line without: rounded where they meet, untouched elsewhere."""

from __future__ import annotations

import numpy as np
import scipy  # its subpackages load when they are first used

from hdvplan.arrays import BoolArray, FloatArray

_GAP_M = 2e-3  # within which two points are one place
_KINK = 4e-3  # [rad]
_PER_TURN_M = 20.0  # of rounding to either side for a kink of one radian: adds a curvature of some 0.05 1/m, and
_PER_ROOT_M = 5.4  # for the square root of a gap of one metre: the same
_SHORTEST_M, _LONGEST_M = 0.5, 5.0  # of a rounding to either side


def rounded(points: FloatArray, heading: FloatArray, curvature: FloatArray) -> FloatArray:
    """Return dense points of a line, shape (n, 2) [m], moved where it has gaps or kinks so that it has none.

    ``heading`` [rad] and ``curvature`` [1/m] are the pieces' own, shape (n,). A quintic joins the points, headings and
    curvatures on both sides of each place; what lies further from it stays exactly where it is.
    """
    chord, change = np.diff(points, axis=0), wrapped(np.diff(heading))
    length = np.hypot(*chord.T)
    middle = heading[:-1] + 0.5 * change
    turn = np.where(length > _GAP_M, np.abs(wrapped(np.arctan2(chord[:, 1], chord[:, 0]) - middle)), 0.0)
    kink = np.abs(change - 0.5 * (curvature[:-1] + curvature[1:]) * length)
    odd = np.flatnonzero((turn > _KINK) | (kink > _KINK))
    if not odd.size:
        return points
    reach = np.clip(_PER_TURN_M * kink + _PER_ROOT_M * np.sqrt(length * np.sin(np.minimum(turn, 0.5 * np.pi))), _SHORTEST_M, _LONGEST_M)
    u = np.concatenate([[0.0], np.cumsum(length)])
    moved = np.zeros(len(points), dtype=bool)
    for at in odd.tolist():
        moved |= (u > u[at] - reach[at]) & (u < u[at + 1] + reach[at])
    state = np.stack([np.cos(heading), np.sin(heading)], axis=1), curvature[:, None] * np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    line = points.copy()
    for first, last in _runs(moved):
        ends = [max(first - 1, 0), min(last + 1, len(points) - 1)]
        given = np.stack([np.stack([points[end], state[0][end], state[1][end]]) for end in ends])
        line[ends[0] : ends[1] + 1] = scipy.interpolate.BPoly.from_derivatives(u[ends], given)(u[ends[0] : ends[1] + 1])
    return line


def wrapped(angle: FloatArray) -> FloatArray:
    """Return angles between -pi and pi."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def _runs(flags: BoolArray) -> list[tuple[int, int]]:
    """Return first and last number of every run of true values."""
    ends = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [(int(first), int(last) - 1) for first, last in ends.reshape(-1, 2)]
