"""Everything that a vehicle with one trailer can reach along a road: for each cell of the leading unit's heading a polygon.

How it is followed, and why nothing is missed: hdvplan/core/reach_trailer.c.

How a trailer follows: a coordinate of its heading that steering alone does not change. Per metre that the leading unit moves forward,
turning by kappa, a trailer behind a coupling ``hitch_offset`` a behind the axle, with its axle ``wheelbase`` l behind the coupling, turns
by (p(gamma) - a kappa c(gamma)) / l, where gamma is the articulation angle, and with tau = tan of the trailer's wheels out of the bend

    p = sin(gamma) + tau cos(gamma),   c = cos(gamma) - tau sin(gamma).

Of a vehicle that turns on the spot, theta - G(gamma) with G' = 1 / (1 + (a / l) c) does not change. Its rate W' = p / (l + a c) holds no
steering: it follows from x = theta - W alone. Without offset, W is the trailer's heading.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray
from hdvplan.proof.reach import GRID, Answer, Grid, Outline, Reached, outline_record
from hdvplan.proof.space import Beside, Frame, around, frame_record
from hdvplan.vehicle.model import Unit

SHARPEST = 1.5  # articulation angle: beyond 86 degrees no combination is said to drive forward [rad]
_STEP = 1e-3  # of the tables [rad]


class Coupling(NamedTuple):
    """Tables over x = theta - W, from ``first`` in steps of ``step`` [rad]: articulation angle [rad], and rate of W [1/m]."""

    hitch_offset: float  # of the leading unit [m]
    offset_share: float  # |a| / l
    first: float
    step: float
    angle: FloatArray
    rate: FloatArray


def coupling_of(lead: Unit, trailer: Unit) -> Coupling:
    """Return how ``trailer`` follows ``lead``."""
    gamma = np.linspace(-SHARPEST, SHARPEST, 4001)
    wheels = np.tan(np.clip(trailer.steering_ratio * gamma, -trailer.max_steering_angle, trailer.max_steering_angle))
    sideways, along = np.sin(gamma) + wheels * np.cos(gamma), np.cos(gamma) - wheels * np.sin(gamma)
    share = lead.hitch_offset / trailer.wheelbase
    per_angle = 1.0 / (1.0 + share * along)
    x = np.concatenate([[0.0], np.cumsum(0.5 * (per_angle[1:] + per_angle[:-1]) * np.diff(gamma))])
    x -= np.interp(0.0, gamma, x)
    rate = sideways / (trailer.wheelbase + lead.hitch_offset * along)
    at = np.arange(x[0], x[-1] + _STEP, _STEP)
    return Coupling(lead.hitch_offset, abs(share), float(at[0]), _STEP, np.interp(at, x, gamma), np.interp(at, x, rate))


SIDES = core.number("HDV_SIDES")  # of a polygon
LEADING = core.constant("HDV_LEADING")  # cells of |leading heading| in which the room that a trailer leaves is tabulated [rad]
_COUPLING = core.record("hdv_coupling")
_PAIR = core.record("hdv_coupled")
_POLYGONS = core.record("hdv_polygons")
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
    allowed = np.zeros((int(0.5 * np.pi / LEADING) + 2, int(2.0 * np.pi / grid.size) + 2, 3))
    records = map(core.address, (stations, layout, near.record, memory, allowed))
    _reachable(core.address(units), kappa, *records, allowed.shape[1], core.address(found.record))
    return found.read()
