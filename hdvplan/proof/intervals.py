"""Disjoint, rising intervals in arrays (n, 2); where there are too many, some are joined: what is wider is safe."""

from __future__ import annotations

import numpy as np

from hdvplan.jit import FloatArray, compiled


@compiled
def joined(pieces: FloatArray, total: int, low: float, high: float) -> int:
    """Add the interval [low, high] to disjoint, rising ``pieces`` and return how many there are; of too many, the closest are joined."""
    if low > high:
        return total
    first = 0
    while first < total and pieces[first, 1] < low:
        first += 1
    last = first
    while last < total and pieces[last, 0] <= high:
        low, high = min(low, pieces[last, 0]), max(high, pieces[last, 1])
        last += 1
    if last == first:
        if total == pieces.shape[0]:
            return _squeezed(pieces, total, low, high)
        for p in range(total, first, -1):
            pieces[p, 0], pieces[p, 1] = pieces[p - 1, 0], pieces[p - 1, 1]
        total += 1
    elif last > first + 1:
        for p in range(last, total):
            pieces[p - (last - first) + 1, 0], pieces[p - (last - first) + 1, 1] = pieces[p, 0], pieces[p, 1]
        total -= last - first - 1
    pieces[first, 0], pieces[first, 1] = low, high
    return total


@compiled
def _squeezed(pieces: FloatArray, total: int, low: float, high: float) -> int:
    """Add an interval where there is no room for one more: the nearest one grows until it holds it."""
    nearest, least = 0, np.inf
    for p in range(total):
        distance = max(low - pieces[p, 1], pieces[p, 0] - high)
        if distance < least:
            nearest, least = p, distance
    pieces[nearest, 0], pieces[nearest, 1] = min(low, pieces[nearest, 0]), max(high, pieces[nearest, 1])
    return total


@compiled
def kept(found: FloatArray, number: int, pieces: FloatArray) -> int:
    """Copy intervals to where there is room for fewer, the last of which are joined; return how many there are."""
    while number > pieces.shape[0]:
        found[number - 2, 1] = found[number - 1, 1]
        number -= 1
    for k in range(number):
        pieces[k, 0], pieces[k, 1] = found[k, 0], found[k, 1]
    return number
