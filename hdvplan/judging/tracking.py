"""How far a driver may stray from a plan so that every body still keeps to the street: the largest tracking error.

The midpoint of the lead unit's front axle is at most the error E beside its planned track, in a direction at most E / l off it, with l the
tracking length. The bound holds for every error of this kind: ``hdvplan/core/tracking.h``, and docs/maths.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from hdvplan import core
from hdvplan.arrays import Records
from hdvplan.driving.drive import Drive
from hdvplan.judging.balance import Balance, places_of
from hdvplan.judging.bodies import part_named
from hdvplan.judging.clearance import Approach
from hdvplan.judging.straying import BRUSH, ROUNDED_M, Chain, Posed, Tracked, chain_of
from hdvplan.road.pieces import Kerb, Pieces, pieces_of
from hdvplan.vehicle.kinematics import axles_behind

_MOST = 1 << 18  # brushes at once
_FIRST_M, _GROWTH = 0.2, 1.4  # where the largest error has no bound: one that is looked at first, and by how much more then
_NEAR = 0.9  # of an error that has no bound, from which on nothing larger is looked for
_LARGEST_M = 1.0  # and at most: who strays further does not follow a path
_AT_ONCE, _MORE = 128, 8  # brushes that are followed up together at first, and how many times as many after that
_FEW = 16  # of those that may be closed: the first ones, which are looked at closely before the others
_APART = 2  # simulated poses from one to the next, where poses around are looked at together
_ANYWHERE_M = 1e9  # of the line

_POSED = core.record("hdv_posed")
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
            error = min(solved, error - ROUNDED_M)
            if error <= 0.0:
                return 0.0, brush
            self.tracked.err(error)
            closed = self.closed(near)
        return None if closed is None else (error, brush)

    def near(self, error: float) -> Records | None:
        """Return the pairs whose gap errors up to this one [m] might close, likely ones first; None where no bound is known.

        Of all poses those that were simulated are looked at: what is missed between them is taken off every gap.
        """
        if not self.tracked.bounded(error):
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
        found = np.concatenate(parts)
        closed = self.tracked.closed(found)
        return self.tracked.closed(found) if self.tracked.follow(closed["at"]) else closed

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
        _, s, x, y, _, unit, part, *_ = min(places_of(drive.vehicle, balance.touches, balance.approaches), key=lambda place: place[:4])
        return Tracking(error, length, s, x, y, unit, part, decided and error < _LARGEST_M)
    at, street = brush[0], drive.road.kerbs
    s, part = float(at["s"]), part_named(drive.vehicle.units[at["unit"]], float(at["ahead"]))
    if street is not None and street.closed:
        s = street.begin + (s - street.begin) % street.length
    return Tracking(error, length, s, float(at["x"]), float(at["y"]), int(at["unit"]), part)


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
