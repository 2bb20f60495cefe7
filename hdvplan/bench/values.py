"""The new side's numbers of a comparison as a flat list: what dashboards take and histories keep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.bench.compare import Comparison
from hdvplan.bench.suite import cell_words

STEP = "mean step"  # of a cell; the statistics of all cells together have their own names
ALL_CELLS = "all cells"


@dataclass(frozen=True)
class Value:
    """One number of both sides, in its unit; larger is worse."""

    cell: str
    what: str
    unit: str
    base: float
    new: float
    noise: float = np.nan  # the factor by which a cell's times are uncertain


def values_of(comparison: Comparison) -> tuple[Value, ...]:
    """Return the mean step of every cell that was measured on both sides, then the statistics of all cells together."""
    cells = [
        Value(cell_words(entry.cell), STEP, "ms", 1e3 * entry.decision.base, 1e3 * entry.decision.new, entry.decision.noise)
        for entry in comparison.times
        if entry.decision is not None and np.isfinite(entry.decision.base) and np.isfinite(entry.decision.new)
    ]
    found = [Value(ALL_CELLS, one.statistic.name, one.statistic.unit, one.base, one.new) for one in comparison.found]
    return (*cells, *found)
