"""Everything that a rigid vehicle can reach along a road: headings in cells, and for each cell intervals of the lateral offset.

How it is followed, and why nothing is missed: hdvplan/core/reach_set.c.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, IntArray, Records
from hdvplan.proof.poses import Outline, outline_record
from hdvplan.proof.space import MOST, Beside, Frame, around, frame_record

GRID = core.record("hdv_grid", [("first", float), ("size", float), ("cells", np.int64)])
_REACHED = core.record(
    "hdv_reached",
    [*((name, np.int64) for name in ("empty", "open")), *((name, core.ADDRESS) for name in ("low", "high", "right", "left", "filled"))],
)
CELLS = core.record("hdv_cells", [("number", core.ADDRESS), ("pieces", core.ADDRESS)])
_reachable = core.function("hdv_reachable", core.POINTER, core.REAL, *[core.POINTER] * 8)


class Grid(NamedTuple):
    """Cells of the heading: cell j holds ``first`` + j ``size`` <= theta < ``first`` + (j + 1) ``size`` [rad]."""

    first: float
    size: float
    cells: int


class Reached(NamedTuple):
    """What was reached at every station: ``empty`` is the first station with nothing, or -1; ``open`` the last that bounds nothing, or -1.

    ``low`` and ``high`` (stations,) bound the offset [m], ``right`` and ``left`` the heading off the road's [rad], ``filled`` is the
    number of cells.
    """

    empty: int
    open: int
    low: FloatArray
    high: FloatArray
    right: FloatArray
    left: FloatArray
    filled: IntArray


class Answer(NamedTuple):
    """Memory for what the core says was reached."""

    record: Records  # (1,) of ``_REACHED``
    bounds: FloatArray  # (4, stations): low, high, right, left
    filled: IntArray  # (stations,)

    @classmethod
    def empty(cls, stations: int) -> Answer:
        """Return memory for so many stations."""
        bounds, filled = np.full((4, stations), np.nan), np.zeros(stations, np.int64)
        return cls(np.array([(-1, -1, *map(core.address, bounds), core.address(filled))], _REACHED), bounds, filled)

    def read(self) -> Reached:
        """Return what the core has written."""
        low, high, right, left = self.bounds
        return Reached(int(self.record["empty"][0]), int(self.record["open"][0]), low, high, right, left, self.filled)


def reachable(
    outline: Outline, kappa: float, space: Beside, frame: Frame, grid: Grid, *, two_regions: bool,
    keep: tuple[IntArray, FloatArray] | None = None,
) -> Reached:  # fmt: skip
    """Follow everything that a body can reach from any pose at the first station, until nothing is left.

    ``kappa`` is the largest curvature [1/m]. ``keep``, (stations, cells) and (stations, cells, MOST, 2), take the sets.
    """
    near, body, stations = around(space, outline.reach, two_regions=two_regions), outline_record(outline), frame_record(frame)
    cells = [(np.zeros(grid.cells, np.int64), np.empty((grid.cells, MOST, 2))) for _ in range(2)]  # how many intervals, and these
    slopes, found = np.empty((2 * grid.cells, 2)), Answer.empty(len(frame.s))
    memory, layout = np.array([tuple(map(core.address, one)) for one in cells], CELLS), np.array([grid], GRID)
    kept = (None, None) if keep is None else tuple(map(core.address, keep))
    records = (stations, layout, near.record, memory, slopes)
    _reachable(core.address(body), kappa, *map(core.address, records), *kept, core.address(found.record))
    return found.read()
