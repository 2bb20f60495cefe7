"""The points of a body that must lie in free space, whether it fits anywhere at all, and everything that a vehicle can reach.

Headings are followed in cells: for each cell intervals of the lateral offset, or with a trailer a polygon. How, and why nothing is missed:
hdvplan/core/poses.c, hdvplan/core/reach_set.c and hdvplan/core/reach_trailer.c.

How a trailer follows: a coordinate of its heading that steering alone does not change. Per metre that the leading unit moves forward,
turning by kappa, a trailer behind a coupling ``hitch_offset`` a behind the axle, with its axle ``wheelbase`` l behind the coupling, turns
by (p(gamma) - a kappa c(gamma)) / l, where gamma is the articulation angle, and with tau = tan of the trailer's wheels out of the bend

    p = sin(gamma) + tau cos(gamma),   c = cos(gamma) - tau sin(gamma).

Of a vehicle that turns on the spot, theta - G(gamma) with G' = 1 / (1 + (a / l) c) does not change. Its rate W' = p / (l + a c) holds no
steering: it follows from x = theta - W alone. Without offset, W is the trailer's heading.
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
    """What was reached at every station, in memory that the core writes to.

    ``low`` and ``high`` (stations,) bound the offset [m], ``right`` and ``left`` the heading off the road's [rad], ``filled`` is the
    number of cells.
    """

    record: Records  # (1,) of ``_REACHED``
    low: FloatArray
    high: FloatArray
    right: FloatArray
    left: FloatArray
    filled: IntArray

    @classmethod
    def nothing(cls, stations: int) -> Reached:
        """Return memory for so many stations."""
        low, high, right, left = np.full((4, stations), np.nan)
        filled = np.zeros(stations, np.int64)
        record = np.array([(-1, -1, *map(core.address, (low, high, right, left, filled)))], _REACHED)
        return cls(record, low, high, right, left, filled)

    @property
    def empty(self) -> int:
        """The first station with nothing, or -1."""
        return int(self.record["empty"][0])

    @property
    def open(self) -> int:
        """The last station that bounds nothing, or -1."""
        return int(self.record["open"][0])


def reachable(
    outline: Outline, kappa: float, space: Beside, frame: Frame, grid: Grid, *, two_regions: bool,
    keep: tuple[IntArray, FloatArray] | None = None,
) -> Reached:  # fmt: skip
    """Follow everything that a body can reach from any pose at the first station, until nothing is left.

    ``kappa`` is the largest curvature [1/m]. ``keep``, (stations, cells) and (stations, cells, MOST, 2), take the sets.
    """
    near, body, stations = around(space, outline.reach, two_regions=two_regions), outline_record(outline), frame_record(frame)
    cells = [(np.zeros(grid.cells, np.int64), np.empty((grid.cells, MOST, 2))) for _ in range(2)]  # how many intervals, and these
    slopes, found = np.empty((2 * grid.cells, 2)), Reached.nothing(len(frame.s))
    memory, layout = np.array([tuple(map(core.address, one)) for one in cells], CELLS), np.array([grid], GRID)
    kept = (None, None) if keep is None else tuple(map(core.address, keep))
    records = (stations, layout, near.record, memory, slopes)
    _reachable(core.address(body), kappa, *map(core.address, records), *kept, core.address(found.record))
    return found


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
_reachable_with_trailer = core.function("hdv_reachable_with_trailer", core.POINTER, core.REAL, *[core.POINTER] * 5, core.INT, core.POINTER)


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
    near, stations, found = around(space, pair.reach, two_regions=two_regions), frame_record(frame), Reached.nothing(len(frame.s))
    coupling = pair.coupling
    bodies = outline_record(pair.lead), outline_record(pair.trailer)
    tables = (core.address(coupling.angle), core.address(coupling.rate), len(coupling.rate))
    following = np.array([(coupling.hitch_offset, coupling.offset_share, coupling.first, coupling.step, *tables)], _COUPLING)
    units, layout = np.array([tuple(map(core.address, (*bodies, following)))], _PAIR), np.array([grid], GRID)
    sets = [(np.zeros(grid.cells, np.int64), np.empty((grid.cells, SIDES))) for _ in range(2)]
    memory = np.array([tuple(map(core.address, one)) for one in sets], _POLYGONS)
    allowed = np.zeros((int(0.5 * np.pi / LEADING) + 2, int(2.0 * np.pi / grid.size) + 2, 3))
    records = map(core.address, (stations, layout, near.record, memory, allowed))
    _reachable_with_trailer(core.address(units), kappa, *records, allowed.shape[1], core.address(found.record))
    return found
