"""The points of a body that must lie in free space, whether it fits anywhere at all, and everything that a rigid vehicle can reach.

Headings are followed in cells, and for each cell intervals of the lateral offset. How, and why nothing is missed: hdvplan/core/poses.c and
hdvplan/core/reach_set.c.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hdvplan import core
from hdvplan.arrays import FloatArray, IntArray, Records
from hdvplan.proof.space import MOST, Beside, Frame, around, frame_record
from hdvplan.vehicle.model import Unit

_SAME_M = 1e-9
POINTS_M = 0.4  # between the points of an outline that are looked at: a bend of 8 m of radius reaches 2.5 mm in between
_OUTLINE = core.record("hdv_outline")
_fits = core.function("hdv_fits", core.POINTER, core.POINTER, core.POINTER, returns=core.INT)


class Outline(NamedTuple):
    """Points of one body that must lie in free space: ahead of its axle and left of its middle (n, 2) [m], and by which region (n,)."""

    points: FloatArray
    region: IntArray  # 0: the drivable one, 1: the one for overhangs
    rear: float  # of the body, ahead of the point of reference [m]
    front: float
    half: float  # width [m]
    reach: float  # of the furthest point [m]


def outline_of(unit: Unit, *, two_regions: bool) -> Outline:
    """Return a body's outline; between its axles it keeps to the drivable region where overhangs have a separate one."""
    ends = np.unique([-unit.rear_overhang, 0.0, min(unit.wheelbase, unit.front), unit.front])
    pieces = [np.linspace(a, b, int(np.ceil((b - a) / POINTS_M)) + 1) for a, b in pairwise(ends)]
    ahead = np.unique(np.concatenate(pieces)) if pieces else ends
    half = 0.5 * unit.width
    overhang = (ahead < -_SAME_M) | (ahead > unit.wheelbase + _SAME_M)
    across = np.linspace(-half, half, int(np.ceil(unit.width / POINTS_M)) + 1)[1:-1]
    points = [np.column_stack([ahead, np.full(len(ahead), side)]) for side in (half, -half)]
    points += [np.column_stack([np.full(len(across), end), across]) for end in (ends[-1], ends[0])]
    whole = np.concatenate([overhang, overhang, np.full(2 * len(across), True)])
    # Corners first: they rule out most poses at once.
    order = np.argsort(-np.abs(np.concatenate(points)[:, 0] - 0.5 * (ends[0] + ends[-1])), kind="stable")
    region = np.where(whole, 1, 0) if two_regions else np.ones(len(whole))
    return _outline(np.concatenate(points)[order], region[order])


def seen_from(outline: Outline, ahead: float) -> Outline:
    """Return an outline whose point of reference lies ``ahead`` of the old one [m]."""
    return _outline(outline.points - np.array([ahead, 0.0]), outline.region)


def _outline(points: FloatArray, region: NDArray[np.generic]) -> Outline:
    reach = float(np.max(np.hypot(points[:, 0], points[:, 1])))
    ends = float(np.min(points[:, 0])), float(np.max(points[:, 0])), float(np.max(points[:, 1]))
    return Outline(np.ascontiguousarray(points), np.ascontiguousarray(region.astype(np.int64)), *ends, reach)


def outline_record(outline: Outline) -> Records:
    """Return an outline as the core takes it; its arrays must outlive the record."""
    sizes = (outline.rear, outline.front, outline.half, outline.reach)
    return np.array([(core.address(outline.points), core.address(outline.region), len(outline.region), *sizes)], _OUTLINE)


def fits(outline: Outline, space: Beside, frame: Frame, *, two_regions: bool) -> int:
    """Return the first station at which the body fits in no pose, its axle on the normal there; -1 if there is none."""
    near, body, stations = around(space, outline.reach, two_regions=two_regions), outline_record(outline), frame_record(frame)
    return int(_fits(core.address(body), core.address(stations), core.address(near.record)))


GRID = core.record("hdv_grid")
_REACHED = core.record("hdv_reached")
CELLS = core.record("hdv_cells")
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
