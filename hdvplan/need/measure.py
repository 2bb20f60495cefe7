"""The room that a plan used beside its line: room of the road itself, and room that obstacles limit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.arrays import BoolArray, FloatArray
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.result import Result
from hdvplan.road.road import Limits

ROWS = ("left", "right", "left_sweep", "right_sweep")  # of ``Limits``
OUTWARDS = np.array([1.0, -1.0, 1.0, -1.0])[:, None]
_SAME_M = 1e-9  # rounding of a limit that no region has moved


@dataclass(frozen=True)
class Taken:
    """How far a plan reached outwards at arclengths ``s`` [m], the clearance wanted included; rows as in ``ROWS``, shape (4, n).

    Bodies count in the rows of overhangs; wheels in the first two rows, where bodies count too if overhangs have no limits of their own.
    """

    s: FloatArray
    reach: FloatArray
    counts: BoolArray  # where no sweepable area goes beyond the road's own limit: with less room than was reached, it would be broken
    passes: bool  # whether what obstacles and sweepable areas leave is kept, to ``KEPT_M``

    def beyond(self, band: Limits) -> FloatArray:
        """Return how far the plan reached beyond a road's own limits, negative within, -inf where they do not count, (4, n) [m]."""
        beyond: FloatArray = np.where(self.counts, self.reach - OUTWARDS * band.table(self.s), -np.inf)
        return beyond


def taken_by(result: Result) -> Taken:
    """Return what a plan took of its road, which has limits."""
    road, s, clearance = result.drive.road, result.envelope.s, result.case.settings.clearance
    limits = road.limits
    assert limits is not None  # noqa: S101 - for the type checker: all that is asked here is asked about limits
    table = OUTWARDS * limits.table(s)
    band = table if road.band is None else OUTWARDS * road.band.table(s)
    own, counts = np.abs(table - band) <= _SAME_M, table - band <= _SAME_M  # what an obstacle cuts counts: a narrower band would cut it
    gaps = np.full(table.shape, np.inf)
    for (side, region), of_units in result.gaps.items():
        rows = [0, 2] if not limits.two_regions else [2] if region == "sweepable" else [0]
        gaps[np.add(rows, side == "right")] = np.fmin.reduce(of_units, axis=0)
    gaps[np.isnan(gaps)] = np.inf
    kept = gaps >= clearance - KEPT_M
    clear = all(approach.distance >= clearance - KEPT_M for approach in result.approaches)
    return Taken(s, table - gaps + clearance, counts, clear and bool(np.all(kept | own)))
