"""Everything that a vehicle with one trailer can reach along a road: for each cell of the leading unit's heading a polygon.

How it is followed, and why nothing is missed: hdvplan/core/reach_trailer.c.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hdvplan import core
from hdvplan.proof.coupling import Coupling
from hdvplan.proof.poses import Outline, outline_record
from hdvplan.proof.reach import GRID, Answer, Grid, Reached
from hdvplan.proof.space import Beside, Frame, around, frame_record

SIDES = core.number("HDV_SIDES")  # of a polygon
LEADING = core.constant("HDV_LEADING")  # cells of the leading heading in which the room that a trailer leaves is tabulated [rad]
_COUPLING = core.record(
    "hdv_coupling",
    [
        *((name, float) for name in ("hitch_offset", "offset_share", "first", "step")),
        *((name, core.ADDRESS) for name in ("angle", "rate")),
        ("entries", np.int64),
    ],
)
_PAIR = core.record("hdv_coupled", [(name, core.ADDRESS) for name in ("lead", "trailer", "coupling")])
_POLYGONS = core.record("hdv_polygons", [("full", core.ADDRESS), ("h", core.ADDRESS)])
_reachable = core.function("hdv_reachable_with_trailer", core.POINTER, core.REAL, *[core.POINTER] * 5, core.INT, core.POINTER)


class Pair(NamedTuple):
    """A leading unit and its trailer, whose outline is seen from the coupling."""

    lead: Outline
    trailer: Outline
    coupling: Coupling

    @property
    def reach(self) -> float:
        """How far any point lies from the leading axle [m]."""
        return max(self.lead.reach, self.trailer.reach + abs(self.coupling.hitch_offset))


def reachable_with_trailer(pair: Pair, kappa: float, space: Beside, frame: Frame, grid: Grid, *, two_regions: bool) -> Reached:
    """Follow everything that a vehicle can reach from any pose at the first station, until nothing is left.

    The trailer's heading is looked at in cells like the leading one's. See ``reachable``; the offsets and headings are those of the
    leading unit.
    """
    near, stations, found = around(space, pair.reach, two_regions=two_regions), frame_record(frame), Answer.empty(len(frame.s))
    coupling = pair.coupling
    bodies = outline_record(pair.lead), outline_record(pair.trailer)
    tables = (core.address(coupling.angle), core.address(coupling.rate), len(coupling.rate))
    following = np.array([(coupling.hitch_offset, coupling.offset_share, coupling.first, coupling.step, *tables)], _COUPLING)
    units, layout = np.array([tuple(map(core.address, (*bodies, following)))], _PAIR), np.array([grid], GRID)
    sets = [(np.zeros(grid.cells, np.int64), np.empty((grid.cells, SIDES))) for _ in range(2)]
    memory = np.array([tuple(map(core.address, one)) for one in sets], _POLYGONS)
    allowed = np.zeros((int(np.pi / LEADING) + 2, int(2.0 * np.pi / grid.size) + 2, 3))
    records = map(core.address, (stations, layout, near.record, memory, allowed))
    _reachable(core.address(units), kappa, *records, allowed.shape[1], core.address(found.record))
    return found.read()
