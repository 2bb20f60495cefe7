"""How far a driver may stray from a plan so that every body still keeps to the street: the largest tracking error.

The midpoint of the lead unit's front axle is at most the error E beside its planned track, in a direction at most E / l off it, with l the
tracking length. The bound holds for every error of this kind: ``hdvplan/core/tracking.h``, and docs/maths.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.driving.drive import Drive
from hdvplan.judging.balance import Balance
from hdvplan.judging.bodies import part_named
from hdvplan.judging.obstacles import Approach
from hdvplan.judging.straying import FINER, SPACING_M, Chain, chain_of
from hdvplan.road.street import Kerb, Pieces, pieces_of
from hdvplan.vehicle.body import axles_behind

_ROUNDED_M = 1e-4  # the error is found to this
_MOST = 1 << 18  # brushes at once
_FIRST_M, _GROWTH = 0.2, 1.4  # error that is looked at first, and by how much more then
_NEAR = 0.9  # of an error that has no bound, from which on nothing larger is looked for
_ASKEW = 0.7  # of a heading error [rad], beyond which no bound stays finite
_LARGEST_M = 1.0  # and at most: who strays further does not follow a path
_MEMORY_M, _AHEAD_M = 400.0, 20.0  # of a plan before and beyond a place, on which errors there depend
_AT_ONCE = 128  # brushes that are followed up together
_ROUNDING = 1e-9
_ANYWHERE_M = 1e9  # of the line

TRACKED, STRAY, BRUSH, APPROACH = (core.record(f"hdv_{name}") for name in ("tracked", "stray", "brush", "approach"))
_POSED = core.record("hdv_posed")
_stray = core.function("hdv_stray", core.POINTER)
_approach = core.function("hdv_approach", core.POINTER, core.POINTER, core.INT, core.POINTER)
_brushes = core.function(
    "hdv_brushes", core.POINTER, core.POINTER, core.POINTER, core.POINTER, core.INT, returns=core.INT
)  # fmt: skip


@dataclass(frozen=True)
class Tracking:
    """The largest tracking error of a plan, and the place where a larger one may fail.

    ``error`` is 0 where the plan touches a limit. ``unit`` and ``part`` are as in ``Verdict``.
    """

    error: float  #: largest lateral error of the front axle's midpoint, E [m]
    length: float  #: its direction is at most E / ``length`` off [m]
    s: float  #: arclength of the place that decides [m]
    x: float  #: of the body there [m]
    y: float
    unit: int
    part: str
    decided: bool = True  #: whether the place decides; else larger errors may be allowed: they have no bound, or were not looked at


class Tracked:
    """A chain of planned tracks with a driver's errors: how far bodies stray at most."""

    def __init__(self, units: Records, links: Records, length: float) -> None:
        self.units, self.links, self.length = units, np.ascontiguousarray(links), length
        self.strays = np.zeros(links.shape, STRAY)
        self.levels = int(np.clip(2.0 * length / SPACING_M + _ROUNDING, 1, core.number("HDV_MOST_LEVELS")))
        self.record = np.zeros(1, TRACKED)
        for name, array in (("units", units), ("links", self.links), ("strays", self.strays)):
            self.record[name] = core.address(array)
        self.record["intervals"], self.record["count"] = links.shape
        self.record["spacing"], self.record["levels"] = SPACING_M, self.levels

    def err(self, error: float) -> None:
        """Bound what bodies stray with errors up to ``error`` [m]."""
        self.record["error"], self.record["slope"] = error, error / self.length
        _stray(core.address(self.record))

    def approaches(self, brushes: Records) -> FloatArray:
        """Return how far brushes (n,) come at most: the gain, and what is added to the error's gain [m], (2, n).

        Of a brush whose gap the errors cannot close it is no more than that: what is returned is less than the gap.
        """
        brushes, found = np.ascontiguousarray(brushes), np.empty(len(brushes), APPROACH)
        _approach(core.address(self.record), core.address(brushes), len(brushes), core.address(found))
        return np.stack([found["gain"], np.nan_to_num(found["remainder"], nan=np.inf)])  # a bound that ends in no number is none

    def closed(self, brushes: Records) -> Records:
        """Return the brushes whose gap the errors may close, that of the least error first."""
        gain, remainder = self.approaches(brushes)
        most = float(self.record["error"][0]) * gain + remainder
        order = np.argsort(brushes["gap"] / most)
        return brushes[order[: np.count_nonzero(most > brushes["gap"])]]

    def solved(self, brush: Records, most: float) -> float:
        """Return the largest error below ``most`` at which the errors do not close the gap of one brush (1,) [m]."""
        begin = max(int((brush["at"][0] - _MEMORY_M) / SPACING_M), 0)
        end = min(int((brush["at"][0] + _AHEAD_M) / SPACING_M), len(self.links))
        around = Tracked(self.units, self.links[begin:end], self.length)
        low, high, error, gap = 0.0, most, most, max(float(brush["gap"][0]), 0.0)
        brush = brush.copy()
        brush["at"] -= begin * SPACING_M
        brush["gap"] = 0.0  # all of its approach is looked at, whether the gap can be closed or not
        while high - low > _ROUNDED_M:
            around.err(error)
            gain, remainder = (float(number) for number in around.approaches(brush)[:, 0])
            over = error * gain + remainder - gap
            low, high = (error, high) if over <= 0.0 else (low, error)
            square = min(remainder / error**2, 1.0 / _ROUNDED_M**2)  # as which the remainder grows, or nearly
            error = 2.0 * gap / (gain + float(np.sqrt(gain**2 + 4.0 * square * gap))) - 0.1 * _ROUNDED_M
            if not low < error < high:
                error = 0.5 * (low + high)
        return low


@dataclass(frozen=True)
class Search:
    """What a largest error is looked for in: a chain, how far its bodies stray, and the kerbs around it."""

    chain: Chain
    tracked: Tracked
    pieces: list[Pieces]

    def closed(self) -> Records | None:
        """Return brushes whose gap errors may close, that of the least error first; none if there are none, None if there are too many.

        Of all poses every fifth is looked at, and all where that does not do: what is missed between is taken off every gap.
        """
        if not np.all(self.tracked.strays["heading"] < _ASKEW):
            return None
        found = self._brushes(slice(None, None, FINER))
        if found is None or not len(found):
            return found
        about = np.abs(found["by_axle"]) + np.abs(found["by_heading"]) / self.tracked.length
        found = found[np.argsort(found["gap"] / about)]
        for first in range(0, len(found), _AT_ONCE):
            closed = self._closely(self.tracked.closed(found[first : first + _AT_ONCE]))
            if closed is None or len(closed):
                return closed
        return found[:0]

    def _closely(self, brushes: Records) -> Records | None:
        """Return what errors may close at the poses around some brushes, as ``closed``."""
        near = np.unique(np.searchsorted(self.chain.front, brushes["at"]))
        parts = [brushes[:0]]
        for run in np.split(near, np.flatnonzero(np.diff(near) > 2 * FINER) + 1) if len(near) else []:
            more = self._brushes(slice(max(int(run[0]) - FINER, 0), int(run[-1]) + FINER + 1))
            if more is None:
                return None
            parts.append(more)
        return self.tracked.closed(np.concatenate(parts))

    def _brushes(self, poses: slice) -> Records | None:
        """Return the pairs of bodies and kerbs whose gap might be closed at some poses; None where there are too many."""
        behind = axles_behind(self.chain.vehicle)
        arrays = tuple(np.ascontiguousarray(array[poses]) for array in (self.chain.poses, self.chain.s, self.chain.front))
        posed = np.array([(*(core.address(array) for array in (*arrays, behind)), len(arrays[1]))], _POSED)
        found = []
        for street in self.pieces:
            brushes = np.empty(_MOST, BRUSH)
            where = (self.tracked.record, street.record, posed, brushes)
            count = _brushes(*(core.address(array) for array in where), _MOST)
            if count > _MOST:
                return None
            found.append(brushes[:count])
        return np.concatenate(found)


def tracking_of(drive: Drive, balance: Balance, length: float) -> Tracking | None:
    """Return the largest tracking error of a judged drive with a tracking ``length`` [m]; None on a road without limits.

    The street counts, not the clearance that was to be kept from it. The error is at most the least room, and at most 1 m.
    """
    if balance.min_clearance is None:
        return None
    error, held, brush, decided = 0.0, 0.0, None, True
    most, unknown = min(balance.min_clearance, _LARGEST_M), np.inf
    if most > 0.0:
        chain = chain_of(drive)
        search = Search(chain, Tracked(chain.vehicle.table(), chain.links, length), pieces_around(drive, balance))
        error = min(most, _FIRST_M)
    while error > held:
        search.tracked.err(error)
        closed = search.closed()
        if closed is not None and len(closed):
            brush, decided = closed[:1], True
            error = most = search.tracked.solved(brush, error)
            continue
        if closed is None:
            unknown, brush, decided = error, None, False
        else:
            held = error
        error = min(_GROWTH * held if held > 0.0 else most, 0.5 * (held + unknown), most)
        if held > _NEAR * unknown:
            error = held
    if brush is None:
        return Tracking(error, length, *_tightest(drive, balance), decided and error < _LARGEST_M)
    at, street = brush[0], drive.road.kerbs
    s, part = float(at["s"]), part_named(drive.vehicle.units[at["unit"]], float(at["ahead"]))
    if street is not None and street.closed:
        s = street.begin + (s - street.begin) % street.length
    return Tracking(error, length, s, float(at["x"]), float(at["y"]), int(at["unit"]), part)


def _tightest(drive: Drive, balance: Balance) -> tuple[float, float, float, int, str]:
    """Return s, x, y, unit and part of the place with the least room."""
    places = [(near.distance, near.s, near.x, near.y, near.unit, near.part) for near in balance.approaches]
    for touches in balance.touches.values():
        unit, at = (int(number) for number in np.unravel_index(np.argmin(touches["gap"]), touches.shape))
        room, s, x, y, ahead = (float(touches[unit, at][name]) for name in ("gap", "s", "x", "y", "ahead"))
        places.append((room, s, x, y, unit, part_named(drive.vehicle.units[unit], ahead)))
    return min(places)[1:]


def pieces_around(drive: Drive, balance: Balance) -> list[Pieces]:
    """Return what bounds a drive: the kerbs, and every obstacle's outline as one."""
    street, path = drive.road.kerbs, drive.stations.path
    kerbs = [] if street is None else [street.pieces(path.s_first, path.s_last)]
    return kerbs + [_around(near) for near in balance.approaches]


def _around(near: Approach) -> Pieces:
    """Return an obstacle's outline, clockwise, as a kerb: beside no part of the line, but wherever a body comes near to it."""
    points = shapely.get_coordinates(shapely.geometry.polygon.orient(near.obstacle.polygon, -1.0).exterior)
    kerb = Kerb(points[::-1] if near.side == "left" else points, np.full(len(points), near.s), near.side == "left")
    pieces = pieces_of([kerb])
    found = pieces.pieces
    found["s_low"], found["s_high"] = -_ANYWHERE_M, _ANYWHERE_M
    pieces.reach[:] = _ANYWHERE_M
    turn = found["before_cos"] * found["sin"] - found["before_sin"] * found["cos"]
    turn[0] = found["cos"][-1] * found["sin"][0] - found["sin"][-1] * found["cos"][0]  # a ring
    found["before_cos"][0], found["before_sin"][0] = found["cos"][-1], found["sin"][-1]
    found["corner"], found["ends"] = turn < 0.0, 0
    return pieces
