"""The types of arrays and records, lengths along lines, runs and repeats, and extremes over windows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Records = NDArray[np.void]  # a structured array; every module that makes one names its columns
_NO_LENGTH_M = 1e-6  # between points of a polyline that are one


def chord_of(points: FloatArray) -> FloatArray:
    """Return the length along a polyline at its points [m]."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])


def end_ways(points: FloatArray) -> FloatArray:
    """Return the directions of a line's first and last chord, (2, 2), unit vectors; points (n, 2) that repeat others have none."""
    chords = np.diff(points, axis=0)
    chords = chords[np.any(chords != 0.0, axis=1)][[0, -1]]
    return np.asarray(chords / np.hypot(*chords.T)[:, None])


def turns_of(points: FloatArray) -> FloatArray:
    """Return the cosine of the turn at each point of a polyline (n, 2) [m] between its ends, (n - 2,); 0 at points that repeat others."""
    step = np.diff(points, axis=0)
    length = np.hypot(*step.T)
    return np.asarray(np.sum(step[1:] * step[:-1], axis=1) / np.maximum(length[1:] * length[:-1], _NO_LENGTH_M**2))


def carried(at: FloatArray, s: FloatArray, along: FloatArray) -> FloatArray:
    """Return arclengths ``at`` of a line on a moved one, on which its ``s`` are ``along``; beyond the ends both run alike [m]."""
    inside = np.clip(at, s[0], s[-1])
    return np.interp(inside, s, along) + (at - inside)


def runs_of(flags: BoolArray) -> IntArray:
    """Return for every run of true values the number of its first and of the entry behind its last, (n, 2)."""
    return np.flatnonzero(np.diff(flags.astype(int), prepend=0, append=0)).reshape(-1, 2)


def counted_up(counts: IntArray) -> tuple[IntArray, IntArray]:
    """Return the number of every entry as often as its count says, and beside each the number of the repeat, from 0."""
    of = np.repeat(np.arange(len(counts)), counts)
    return of, np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts)


def running(pick: Callable[[FloatArray, FloatArray], FloatArray], values: FloatArray, behind: int, ahead: int) -> FloatArray:
    """Return every entry's extreme over ``behind`` entries before it to ``ahead`` after it, along the last axis; the ends go on.

    ``pick`` is ``np.minimum`` or ``np.maximum``. Windows are doubled: log2 of their size passes over the array. scipy.ndimage has this
    too, but takes 0.1 s to load, which every plan would wait for.
    """
    size, width, count = behind + ahead + 1, 1, values.shape[-1]
    window = np.pad(values, [(0, 0)] * (values.ndim - 1) + [(behind, ahead)], mode="edge")
    while 2 * width <= size:
        window, width = pick(window[..., :-width], window[..., width:]), 2 * width
    return pick(window[..., :count], window[..., size - width :][..., :count])
