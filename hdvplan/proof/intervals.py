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
def common(pieces: FloatArray, number: int, room: FloatArray, free: int) -> int:
    """Replace ``pieces`` by what they have in common with the intervals ``room``; return how many are left."""
    if number == 1 and free == 1:  # nearly always
        pieces[0, 0], pieces[0, 1] = max(pieces[0, 0], room[0, 0]), min(pieces[0, 1], room[0, 1])
        return 1 if pieces[0, 0] <= pieces[0, 1] else 0
    most = 2 * pieces.shape[0]
    out = np.empty((most, 2))
    total, p, f = 0, 0, 0
    while p < number and f < free:
        low, high = max(pieces[p, 0], room[f, 0]), min(pieces[p, 1], room[f, 1])
        if low <= high:
            out[total, 0], out[total, 1] = low, high
            total += 1
        if pieces[p, 1] < room[f, 1]:
            p += 1
        else:
            f += 1
        if total == most:
            break
    if p < number and f < free:  # more than can be told apart
        out[total - 1, 1] = max(out[total - 1, 1], pieces[number - 1, 1])
    while total > pieces.shape[0]:
        out[total - 2, 1] = out[total - 1, 1]
        total -= 1
    for k in range(total):
        pieces[k, 0], pieces[k, 1] = out[k, 0], out[k, 1]
    return total
