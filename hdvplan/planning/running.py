"""Running extremes along arrays. scipy.ndimage has them too, but takes 0.1 s to load, which every plan would wait for."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from hdvplan.arrays import FloatArray


class Pick(Protocol):
    """``np.minimum`` or ``np.maximum``."""

    def __call__(self, one: FloatArray, other: FloatArray, /) -> FloatArray:
        """Return the smaller, or the larger, values."""


def running(pick: Pick, values: FloatArray, behind: int, ahead: int) -> FloatArray:
    """Return every entry's extreme over ``behind`` entries before it to ``ahead`` after it, along the last axis; the ends go on.

    Windows are doubled: log2 of their size passes over the array.
    """
    size, width, count = behind + ahead + 1, 1, values.shape[-1]
    window = np.pad(values, [(0, 0)] * (values.ndim - 1) + [(behind, ahead)], mode="edge")
    while 2 * width <= size:
        window, width = pick(window[..., :-width], window[..., width:]), 2 * width
    return pick(window[..., :count], window[..., size - width :][..., :count])
