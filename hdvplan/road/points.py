"""Given points as the data of the smoothing: which repeat their neighbour, what lies between them, and how much each tells."""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import maximum_filter1d

from hdvplan.arrays import FloatArray, IntArray

_DUPLICATE_M = 0.02
_DENSE_M = 1.0  # longer segments of the given line are sampled: the points between are as good as the given ones
_SPACING_SHARE = 1.25  # smoothing length over the points' spacing
_LONGEST_M = 5.0  # smoothing length, and
_ROUGH_M = 1.0  # the third difference of positions from which on it is used


def vertex_of(points: FloatArray) -> IntArray:
    """Map near-duplicates to their representative: return for each point its own number, or that of the one that replaces it.

    The end point always represents itself.
    """
    stands = np.zeros(len(points), dtype=np.int64)
    places = points.tolist()
    last = 0
    for i, place in enumerate(places):
        last = i if math.dist(place, places[last]) >= _DUPLICATE_M else last
        stands[i] = last
    if last > 0:
        stands[stands == last] = len(points) - 1
    return stands


def densified(chord: FloatArray) -> FloatArray:
    """Return chord lengths no further apart than ``_DENSE_M`` that include the given ones."""
    pieces = np.maximum(1, np.ceil(np.diff(chord) / _DENSE_M - 0.01))
    number = np.concatenate([[0.0], np.cumsum(pieces)])
    u: FloatArray = np.interp(np.arange(number[-1] + 1.0), number, chord)
    return u


def shares(u: FloatArray) -> FloatArray:
    """Return the length of line that each sample stands for [m]."""
    half = 0.5 * np.diff(u)
    shares: FloatArray = np.append(half, 0.0) + np.append(0.0, half)
    return shares


def smoothing_lengths(vertices: FloatArray, chord: FloatArray, u: FloatArray, *, closed: bool) -> FloatArray:
    """Return the length below which features are smoothed away at each datum [m].

    It follows what the points can tell: their spacing, and the cube root of their positions' third difference (a change
    of curvature over a step, or noise). Dense smooth input is so left alone, and bare map corners are rounded widely.
    """
    spacing = np.diff(chord)
    ahead = np.diff(vertices, axis=0)
    if closed:
        spacing, ahead = np.concatenate([spacing[-2:], spacing, spacing[:2]]), np.concatenate([ahead[-2:], ahead, ahead[:2]])
    turn = np.arctan2(ahead[:-1, 0] * ahead[1:, 1] - ahead[:-1, 1] * ahead[1:, 0], np.sum(ahead[:-1] * ahead[1:], axis=1))
    turn = np.concatenate([turn[:1], turn, turn[-1:]]) if turn.size else np.zeros(2)
    third = spacing * np.abs(np.diff(turn))
    ell = np.clip(np.maximum(_SPACING_SHARE * spacing, np.cbrt(third / _ROUGH_M) * _LONGEST_M), _SPACING_SHARE, _LONGEST_M)
    if closed:
        ell = ell[2:-2]
    segment = np.clip(np.searchsorted(chord, u, side="right") - 1, 0, len(ell) - 1)
    reach = int(2.0 * _LONGEST_M / _DENSE_M)
    return maximum_filter1d(ell[segment], 2 * reach + 1, mode="wrap" if closed else "nearest")
