"""Limits along a line: how far a street reaches to either side of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import OptionError, RoadError

WIDEST_M = 250.0  # from a line to the nearer of its limits: beyond it is no street, but one of 3 m in centimetres


@dataclass(frozen=True)
class Limits:
    """Signed lateral limits [m] at increasing arclengths ``s`` [m]: left positive, right negative, linear between.

    ``left`` and ``right`` bound wheels and everything between the axles (the drivable region of [BUS]); overhangs may
    reach ``left_sweep`` and ``right_sweep``, which are at least as wide. Beyond the ends the last value holds. Where obstacles block the
    road, the left limit lies right of the right one.
    """

    s: FloatArray
    left: FloatArray
    right: FloatArray
    left_sweep: FloatArray
    right_sweep: FloatArray

    def __post_init__(self) -> None:
        """Refuse limits that give overhangs less room than wheels."""
        for bad, what in (
            (self.left_sweep < self.left, "overhangs have less room than wheels on the left"),
            (self.right_sweep > self.right, "overhangs have less room than wheels on the right"),
        ):
            if np.any(bad):
                s = float(self.s[int(np.argmax(bad))])
                msg = f"{what} at s = {s:z.1f} m"
                raise RoadError(msg, s_m=s)

    @classmethod
    def constant(cls, left: float, right: float, length: float) -> Limits:
        """Return limits that are the same everywhere; ``left`` and ``right`` are positive reaches [m]."""
        for side, reach in (("left", left), ("right", right)):
            what = "half width" if left == right else f"{side} limit"
            if not (np.isfinite(reach) and reach > 0.0):
                msg = f"the {what} must be a positive number of metres, not {reach:g}"
                raise OptionError(msg)
            if reach > WIDEST_M:
                msg = f"the {what} must be at most {WIDEST_M:g} m, not {reach:g}"
                raise OptionError(msg, hint="is it in metres?")
        s = np.array([0.0, length])
        one = np.ones(2)
        return cls(s, left * one, -right * one, left * one, -right * one)

    @property
    def two_regions(self) -> bool:
        """Whether overhangs have more room than wheels anywhere."""
        return bool(np.any(self.left_sweep > self.left) or np.any(self.right_sweep < self.right))

    def table(self, s: FloatArray) -> FloatArray:
        """Return the limits at arclengths ``s`` [m]: rows left, right, left_sweep, right_sweep; shape (4, len(s))."""
        columns = (self.left, self.right, self.left_sweep, self.right_sweep)
        return np.stack([np.interp(s, self.s, column) for column in columns])
