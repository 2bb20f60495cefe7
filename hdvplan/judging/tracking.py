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
from hdvplan.judging.straying import SPACING_M, Chain, Posed, chain_of
from hdvplan.road.pieces import Kerb, Pieces, pieces_of
from hdvplan.vehicle.body import axles_behind

_ROUNDED_M = 1e-4  # the error is found to this
_MOST = 1 << 18  # brushes at once
_FIRST_M, _GROWTH = 0.2, 1.4  # where the largest error has no bound: one that is looked at first, and by how much more then
_NEAR = 0.9  # of an error that has no bound, from which on nothing larger is looked for
_ASKEW = 0.7  # of a heading error [rad], beyond which no bound stays finite
_LARGEST_M = 1.0  # and at most: who strays further does not follow a path
_MEMORY_M, _AHEAD_M = 200.0, 5.0  # of a plan before and beyond a place, on which errors there depend
_AROUND_M = 15.0  # of a place: others there are looked at together with it
_AT_ONCE, _MORE = 128, 8  # brushes that are followed up together at first, and how many times as many after that
_FEW = 16  # of those that may be closed: the first ones, which are looked at closely before the others
_APART = 2  # simulated poses from one to the next, where poses around are looked at together
_ASIDE = 0.4  # of what the error is found to, from the likeliest one on: the next one is then on the other side of what is sought
_LEAST = 1e-30  # that is divided by
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
        error = float(self.record["error"][0])
        closed = error * gain + remainder > brushes["gap"]
        gain, remainder, brushes = gain[closed], remainder[closed], brushes[closed]
        return brushes[np.argsort(_closing(brushes["gap"], gain, remainder, error), kind="stable")]

    def solved(self, closed: Records) -> tuple[float, Records]:
        """Return the largest error that does not close the gap of some brushes [m], which the present one closes, and the brush (1,).

        Those count that are near to the first one, so that the same errors move them.
        """
        at = closed["at"][0]
        begin, end = (int(np.clip((at + to) / SPACING_M, 0, len(self.links))) for to in (-_AROUND_M - _MEMORY_M, _AROUND_M + _AHEAD_M))
        own = closed[np.abs(closed["at"] - at) < _AROUND_M]
        around, there, high = Tracked(self.units, self.links[begin:end], self.length), own.copy(), float(self.record["error"][0])
        there["at"] -= begin * SPACING_M
        (over, number), low = self._over(own), 0.0
        before, error = high, high - over
        while high - low > _ROUNDED_M:
            if not low < error < high:
                error = 0.5 * (low + high)
            around.err(error)
            over_before, (over, number) = over, around._over(there)
            low, high = (low, error) if over > 0.0 else (error, high)
            slope = (over - over_before) / (error - before)  # of the secant; 1 or more
            before, aside = error, _ASIDE * _ROUNDED_M  # to the other side of what is sought, where this is near
            error -= over / max(slope, 1.0) + (aside if over > 0.0 else -aside)
        return low, own[number : number + 1]

    def _over(self, brushes: Records) -> tuple[float, int]:
        """Return by how much the present error is more than one that closes a gap [m], exact where that is nothing, and which brush's."""
        whole, error = brushes.copy(), float(self.record["error"][0])
        whole["gap"] = 0.0  # all of their approach is looked at, whether the gap can be closed or not
        gain, remainder = self.approaches(whole)
        closing = _closing(brushes["gap"], gain, remainder, error)
        return error - float(np.min(closing)), int(np.argmin(closing))


def _closing(gap: FloatArray, gain: FloatArray, remainder: FloatArray, error: float) -> FloatArray:
    """Return with which errors gaps [m] may close, (n,) [m]; remainders [m] are those of ``error``, and grow as its square, or nearly."""
    gap, square = np.maximum(gap, 0.0), np.minimum(remainder / error**2, 1.0 / _ROUNDED_M**2)
    found: FloatArray = 2.0 * gap / np.maximum(gain + np.sqrt(gain**2 + 4.0 * square * gap), _LEAST)
    return found


@dataclass(frozen=True)
class Search:
    """What a largest error is looked for in: a chain, how far its bodies stray, and the kerbs around it."""

    chain: Chain
    tracked: Tracked
    pieces: list[Pieces]

    def largest(self, most: float) -> tuple[float, Records | None, bool]:
        """Return the largest error up to ``most`` [m], the brush (1,) that decides it, if one does, and whether larger ones have a bound.

        Where ``most`` has no bound, smaller errors are tried from little on.
        """
        found, held, unknown, error = self._held(most), 0.0, np.inf, min(most, _FIRST_M)
        if found is not None:
            return *found, True
        while error > held:
            found = self._held(error)
            if found is None:
                unknown = error
            elif found[1] is not None:
                return *found, True
            else:
                held = error
            error = min(_GROWTH * held if held > 0.0 else most, 0.5 * (held + unknown), most)
            if held > _NEAR * unknown:
                break
        return held, None, False

    def _held(self, error: float) -> tuple[float, Records | None] | None:
        """Return the largest error up to this one [m], and the brush (1,) that decides it, if one does; None where no bound is known."""
        near, brush = self.near(error), None
        closed = None if near is None else self.closed(near)
        while near is not None and closed is not None and len(closed):
            solved, brush = self.tracked.solved(closed[:_FEW])
            error = min(solved, error - _ROUNDED_M)
            if error <= 0.0:
                return 0.0, brush
            self.tracked.err(error)
            closed = self.closed(near)
        return None if closed is None else (error, brush)

    def near(self, error: float) -> Records | None:
        """Return the pairs whose gap errors up to this one [m] might close, likely ones first; None where no bound is known.

        Of all poses those that were simulated are looked at: what is missed between them is taken off every gap.
        """
        self.tracked.err(error)
        if not np.all(self.tracked.strays["heading"] < _ASKEW):
            return None
        found = self._brushes(self.chain.posed)
        if found is None:
            return None
        about = np.abs(found["by_axle"]) + np.abs(found["by_heading"]) / self.tracked.length
        return found[np.argsort(found["gap"] / about)]

    def closed(self, near: Records) -> Records | None:
        """Return brushes whose gap the present errors may close, that of the least error first; None where there are too many.

        ``near`` are all that errors as large might. Around those that may, more poses are looked at.
        """
        first, count = 0, _AT_ONCE
        while first < len(near):
            likely = self.tracked.closed(near[first : first + count])
            for part in (likely[:_FEW], likely[_FEW:]):
                closed = self._closely(part)
                if closed is None or len(closed):
                    return closed
            first, count = first + count, _MORE * count
        return near[:0]

    def _closely(self, brushes: Records) -> Records | None:
        """Return what errors may close at the poses around some brushes, as ``closed``."""
        at = np.unique(np.searchsorted(self.chain.posed.front, brushes["at"]))
        last, parts = len(self.chain.posed.s) - 1, [brushes[:0]]
        for run in np.split(at, np.flatnonzero(np.diff(at) > _APART) + 1) if len(at) else []:
            more = self._brushes(self.chain.closely(max(int(run[0]) - 1, 0), min(int(run[-1]) + 1, last)))
            if more is None:
                return None
            parts.append(more)
        return self.tracked.closed(np.concatenate(parts))

    def _brushes(self, posed: Posed) -> Records | None:
        """Return the pairs of bodies and kerbs whose gap might be closed at some poses; None where there are too many."""
        behind, found = axles_behind(self.chain.vehicle), []
        record = np.array([(*(core.address(array) for array in (posed.poses, posed.s, posed.front, behind)), len(posed.s))], _POSED)
        for street in self.pieces:
            brushes = np.empty(_MOST, BRUSH)
            where = (self.tracked.record, street.record, record, brushes)
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
    error, brush, decided, most = 0.0, None, True, min(balance.min_clearance, _LARGEST_M)
    if most > 0.0:
        chain = chain_of(drive)
        search = Search(chain, Tracked(chain.vehicle.table(), chain.links, length), pieces_around(drive, balance))
        error, brush, decided = search.largest(most)
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
