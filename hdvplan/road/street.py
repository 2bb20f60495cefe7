"""The street in the plane: the kerbs within which a vehicle stays, and the stretch of line that each piece of them belongs to.

The line is only for steering along. A width counts from the line as it was given, an edge lies where it was drawn, and nothing here depends
on how far planning moved its own line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hdvplan import core
from hdvplan.arrays import BoolArray, FloatArray, Records, running
from hdvplan.road.kerbs import kerb_of
from hdvplan.road.limits import Limits
from hdvplan.road.path import ReferencePath

if TYPE_CHECKING:
    from hdvplan.road.given import GivenLine

PIECE = core.record("hdv_piece")
STREET = core.record("hdv_street")
# Where a body is nearest to a kerb: see core/street.h.
CONTACT = core.record("hdv_contact")
CONTACTS = core.record(
    "hdv_contacts",
    at=np.dtype((CONTACT, (2, core.number("HDV_SECTIONS")))),
    near=np.dtype((float, 2)),
    overhang=np.dtype((CONTACT, (2, 2))),
)
_look_many = core.function("hdv_look_many", core.POINTER, core.INT, core.POINTER, core.INT, core.INT, *[core.POINTER] * 4)
_rooms = core.function("hdv_rooms", core.POINTER, core.INT, *[core.POINTER] * 4)
_TURN_M, _AROUND_M = 1.0, 15.0  # of the line's samples, and beside a place: how much it turns
_MOST_BEND = 1.5  # [rad] that count: a kerb in a hairpin is as near along the line as across it
_SAMPLES_M = 0.25  # of a line that is smooth: an arc of 10 m is then 0.8 mm off its chord
_ON_M = 1000.0  # that kerbs go on beyond a road: further than a vehicle and its horizon
_SHORTEST_M = 1e-6  # two points of a kerb nearer than this are one
_BACK = -1.0 + 1e-9  # cosine of a turn: a kerb that goes back on itself has no width there
_SLIVER_M, _SHARPLY = 0.005, -0.5  # a shorter side that the kerb turns to, or from, by over 120 degrees was drawn by nobody
_STRAIGHT = 1e-7  # [rad] of turn: less is rounding of coordinates of a thousand kilometres, and no corner
_WALL, _ACROSS = 0.25, 0.5  # metres of line a metre, and cosine to the line, below which a piece is a wall across the street
_CLEANED = 5  # times that such points are taken out


@dataclass(frozen=True)
class Kerb:
    """One side of a street: ``points`` (n, 2) [m] in the direction of the line, and the line's arclengths ``s`` (n,) beside them [m].

    ``wheels`` tells the kerb that wheels must keep, which overhangs may cross, from the one that bounds all of a body. Where a kerb ends
    at an open road's ends it goes on straight, at a closed one's seam in the next lap, unless it is a shorter one of several on its side.
    """

    points: FloatArray
    s: FloatArray
    left: bool
    wheels: bool = False
    goes_on: bool = True

    def reversed(self, length: float) -> Kerb:
        """Return the kerb along the line driven the other way, which is ``length`` long [m]."""
        return replace(self, points=self.points[::-1], s=length - self.s[::-1], left=not self.left)

    def shifted(self, by: float) -> Kerb:
        """Return the kerb with arclengths that count from ``by`` [m]."""
        return replace(self, s=self.s - by)


class Corner(NamedTuple):
    """A corner of a given line: its arclength on the path, its place [m], and how far the line turns there, left positive [rad]."""

    s: float
    x: float
    y: float
    turn: float


@dataclass(frozen=True)
class About:
    """The line that widths count from: its points (n, 2) [m] and the arclengths ``s`` (n,) on the path that they belong to [m].

    The path lies ``offset`` to the left of it [m]. ``sharp`` are the points where it has a kink, ``corners`` those of 20 degrees and more.
    """

    points: FloatArray
    s: FloatArray
    sharp: BoolArray
    closed: bool
    offset: float = 0.0
    corners: tuple[Corner, ...] = ()
    reading: str = ""  # see ``Corners``; "" of a line that is no points

    @classmethod
    def given(cls, line: GivenLine, s_points: FloatArray) -> About:
        """Return the line as it was given; ``s_points`` are the arclengths of its given points on the path [m]."""
        s = np.interp(line.number, np.arange(len(s_points)), s_points)
        at = [int(np.searchsorted(line.number, number)) for number, _ in line.corners]
        places = zip(s[at].tolist(), *line.points[at].T.tolist(), strict=True)
        corners = tuple(Corner._make((*place, turn)) for place, (_, turn) in zip(places, line.corners, strict=True))
        return cls(line.points, s, line.sharp, line.closed, corners=corners)

    @classmethod
    def smooth(cls, path: ReferencePath) -> About:
        """Return a path as the line that widths count from."""
        s = np.linspace(0.0, path.length, int(np.ceil(path.length / _SAMPLES_M)) + 1)
        here = path.at(s)
        return cls(np.stack([here.x, here.y], axis=1), s, np.zeros(len(s), bool), path.closed)

    @property
    def ends(self) -> FloatArray:
        """The directions of its first and its last chord, (2, 2), unit vectors."""
        chords = np.diff(self.points, axis=0)
        chords = chords[np.any(chords != 0.0, axis=1)][[0, -1]]
        return np.asarray(chords / np.hypot(*chords.T)[:, None])

    def reversed(self, length: float) -> About:
        """Return the line driven the other way, on a path of that length [m]."""
        corners = tuple(one._replace(s=length - one.s, turn=-one.turn) for one in self.corners[::-1])
        points, s, sharp = self.points[::-1], length - self.s[::-1], self.sharp[::-1]
        return replace(self, points=points, s=s, sharp=sharp, offset=-self.offset, corners=corners)

    def part(self, s_from: float, s_to: float, length: float) -> About:
        """Return the line around a stretch of its path, which is ``length`` long and whose ends it may lie beyond; s is from its start [m].

        It reaches to the next points before and beyond.
        """
        laps = length * np.arange(np.floor(s_from / length), np.ceil(s_to / length)) if self.closed else np.zeros(1)
        s = np.concatenate([self.s + lap for lap in laps])
        own = slice(max(int(np.searchsorted(s, s_from, side="right")) - 1, 0), int(np.searchsorted(s, s_to)) + 1)
        points, sharp = np.tile(self.points, (len(laps), 1))[own], np.tile(self.sharp, len(laps))[own]
        around = [one._replace(s=one.s + float(lap)) for lap in laps for one in self.corners]
        corners = tuple(one._replace(s=one.s - s_from) for one in around if s_from <= one.s <= s_to)
        return replace(self, points=points, s=s[own] - s_from, sharp=sharp, closed=False, corners=corners)

    def kerbs(self, limits: Limits, corner_radius: float = 0.0) -> tuple[Kerb, ...]:
        """Return the kerbs that lie at ``limits`` from the line; those of wheels besides where overhangs may cross them."""
        points, s, sharp = self._with_nodes(limits.s)
        rows = limits.table(s) + self.offset
        wanted = (2, 3, 0, 1) if limits.two_regions else (2, 3)
        found = []
        for row in wanted:
            kerbs = kerb_of(points, s, sharp, rows[row], closed=self.closed, corner_radius=corner_radius)
            found += [Kerb(kerb.points, kerb.number, row % 2 == 0, row < 2, kerb.whole) for kerb in kerbs]  # noqa: PLR2004 - rows of ``Limits.table``
        return tuple(found)

    def _with_nodes(self, nodes: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Return the line with points where limits change."""
        new = np.setdiff1d(nodes[(nodes > self.s[0]) & (nodes < self.s[-1])], self.s)
        at = np.searchsorted(self.s, new)
        between = np.stack([np.interp(new, self.s, column) for column in self.points.T], axis=1)
        return np.insert(self.points, at, between, axis=0), np.insert(self.s, at, new), np.insert(self.sharp, at, False)


class Pieces(NamedTuple):
    """Kerbs as the core takes them: ``record`` (1,) of ``STREET`` holds addresses of the others."""

    pieces: Records  # (n,) of ``PIECE``
    reach: FloatArray  # (n,) [m]
    record: Records


@dataclass(frozen=True)
class Street:
    """The kerbs of a road of ``length`` [m]; a closed one has them in every lap.

    ``ends`` are the directions in which those of an open road go on: before its start and beyond its end, (2, 2), unit vectors.
    ``line`` has the line's s, x and y [m], its heading and how much it turns around there [rad], (5, n): in a bend, kerbs far along it
    are near.
    """

    kerbs: tuple[Kerb, ...]
    length: float
    closed: bool
    ends: FloatArray
    line: FloatArray | None = None
    begin: float = 0.0  #: the arclength of the road's start [m]

    @classmethod
    def along(cls, path: ReferencePath, kerbs: tuple[Kerb, ...], about: About | None = None) -> Street:
        """Return the street of a path; what lies beyond its ends goes on as the line ``about`` which widths count, or else as the path."""
        s = np.linspace(0.0, path.length, int(np.ceil(path.length / _TURN_M)) + 1)
        here = path.at(s)
        turned, around = np.unwrap(here.heading), int(np.ceil(_AROUND_M / _TURN_M))
        bend = running(np.maximum, turned, around, around) - running(np.minimum, turned, around, around)
        ends = np.stack([np.cos(here.heading[[0, -1]]), np.sin(here.heading[[0, -1]])], axis=1) if about is None else about.ends
        return cls(kerbs, path.length, path.closed, ends, np.stack([s, here.x, here.y, turned, bend]))

    @cached_property
    def two_regions(self) -> bool:
        """Whether wheels have kerbs of their own."""
        return any(kerb.wheels for kerb in self.kerbs)

    def pieces(self, s_from: float, s_to: float) -> Pieces:
        """Return the pieces of all kerbs from ``s_from`` to ``s_to`` [m], a closed road's in every lap there."""
        found = pieces_of(self.unrolled(s_from, s_to), np.inf if self.closed else self.begin + self.length)
        pieces = found.pieces
        if self.line is None:
            return found
        beyond = np.stack([pieces["x"] + pieces["length"] * pieces["cos"], pieces["y"] + pieces["length"] * pieces["sin"]])
        ends = ((pieces["s_begin"], pieces["x"], pieces["y"]), (pieces["s_end"], *beyond))
        further = np.maximum(*(self._further(*end) for end in ends))
        pieces["wall"] &= self._across(pieces)
        pieces["s_low"] -= further
        pieces["s_high"] += further
        order = np.argsort(pieces["s_low"], kind="stable")
        pieces[:] = pieces[order]
        np.maximum.accumulate(pieces["s_high"], out=found.reach)
        return found

    def _across(self, pieces: Records) -> BoolArray:
        """Return which pieces stand beside one place of the line, or are steep to it: the kerb outside a hairpin does neither."""
        assert self.line is not None  # noqa: S101 - as below
        s = 0.5 * (pieces["s_begin"] + pieces["s_end"]) - self.begin
        heading = np.interp(np.mod(s, self.length) if self.closed else s, self.line[0], self.line[3])
        along = np.abs(pieces["cos"] * np.cos(heading) + pieces["sin"] * np.sin(heading))
        return np.asarray((pieces["s_begin"] == pieces["s_end"]) | (along < _ACROSS))

    def _further(self, s: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return how much further along the line than beside them a body near points x, y of kerbs may be [m]."""
        assert self.line is not None  # noqa: S101 - for the type checker: who asks has one
        at = s - self.begin
        at = np.mod(at, self.length) if self.closed else at
        line_x, line_y, _, bend = (np.interp(at, self.line[0], column) for column in self.line[1:])
        inside = (at >= 0.0) & (at <= self.length)
        return np.where(inside, np.hypot(x - line_x, y - line_y) * np.minimum(bend, _MOST_BEND), 0.0)

    def beside(self, s_from: float, s_to: float) -> tuple[Kerb, ...]:
        """Return the kerbs beside a stretch of the line, which may lie beyond the road's ends [m]."""
        parts = (between(kerb, s_from, s_to) for kerb in self.unrolled(s_from, s_to))
        return tuple(part for part in parts if len(part.points) > 1)

    def part(self, kerb: Kerb, s_from: float, s_to: float) -> Kerb:
        """Return what of a kerb lies beside the line from ``s_from`` to ``s_to`` [m], which may lie beyond the ends."""
        if not self.closed:
            return between(self._longer(kerb, np.zeros(1)), s_from, s_to)
        first, last = np.ceil((s_from - kerb.s[-1]) / self.length), np.floor((s_to - kerb.s[0]) / self.length)
        # between two laps of a kerb that does not go on there is none, but where a part reaches into both
        return between(self._longer(kerb, self.length * np.arange(first, max(first, last) + 1.0)), s_from, s_to)

    def replaced(self, kerb: Kerb, parts: Sequence[Kerb]) -> Kerb:
        """Return a kerb with ``parts`` of it changed, in order of s; see ``part``."""
        parts = [part for part in parts if len(part.s)]
        if not (self.closed and parts):
            return _replaced(kerb, parts) if parts else kerb
        if parts[0].s[-1] - parts[0].s[0] >= self.length:  # all around
            return replace(kerb, points=np.concatenate([parts[0].points, parts[0].points[:1]]), s=np.append(parts[0].s, self.length))
        start = self.length * np.floor(parts[0].s[0] / self.length)  # of the lap that the parts begin in
        laps = self.length * np.array([-1.0, 0.0, 1.0])
        whole = _replaced(self._longer(kerb, laps), [replace(part, s=part.s + lap - start) for lap in laps for part in parts])
        return between(whole, float(kerb.s[0]), float(kerb.s[-1]))

    def shifted(self, by: float) -> Street:
        """Return the street with arclengths that count from ``by`` [m]."""
        return replace(self, begin=self.begin - by, kerbs=tuple(kerb.shifted(by) for kerb in self.kerbs))

    def unrolled(self, s_from: float, s_to: float) -> tuple[Kerb, ...]:
        """Return the kerbs in every lap of a closed road there; those of an open one go on beyond its ends."""
        ends = (np.array([s_from, s_to]) - self.begin) / self.length
        first, last = (np.floor(ends[0]), np.ceil(ends[1])) if self.closed else (0.0, 1.0)
        laps = self.length * np.arange(first, last, dtype=np.float64)
        alone = laps[:, None]  # a kerb that does not go on is another one in every lap
        return tuple(self._longer(kerb, one) for kerb in self.kerbs for one in ([laps] if kerb.goes_on else alone))

    def _longer(self, kerb: Kerb, laps: FloatArray) -> Kerb:
        if not self.closed and kerb.goes_on:
            points = np.vstack([kerb.points[0] - _ON_M * self.ends[0], kerb.points, kerb.points[-1] + _ON_M * self.ends[1]])
            s = np.concatenate([[kerb.s[0] - _ON_M], kerb.s, [kerb.s[-1] + _ON_M]])
            end = self.begin + self.length
            at, place = int(np.searchsorted(s, end, side="right")), [np.interp(end, s, column) for column in points.T]
            # what lies beyond the end is a piece of its own
            return replace(kerb, points=np.insert(points, at, place, axis=0), s=np.insert(s, at, end))
        return replace(kerb, points=np.tile(kerb.points, (len(laps), 1)), s=np.concatenate([kerb.s + lap for lap in laps]))


def look(street: Pieces, units: Records, behind: FloatArray, s: FloatArray, poses: Records) -> Records:
    """Return what is tightest of all bodies at ``poses`` (k, units), whose lead rear axle is at ``s`` (k,): (k, units, 2, sections).

    Records of ``CONTACT``, to the left and to the right kerbs, as a plan looks for them. ``units`` is a vehicle's table, ``behind`` are its
    axles' distances behind the lead rear axle on a straight [m].
    """
    found = np.zeros(poses.shape, CONTACTS)
    s, poses = np.ascontiguousarray(s), np.ascontiguousarray(poses)
    _look_many(
        core.address(street.record), core.number("HDV_TO_PLAN"), core.address(units), len(units), len(s), core.address(behind),
        core.address(s), core.address(poses), core.address(found),
    )  # fmt: skip
    return found["at"]


def rooms_of(street: Pieces, s: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the distance of points x, y [m] of the line at arclengths ``s`` to the left and to the right kerbs, (2, n) [m].

    Negative beyond a kerb, infinite where there is none.
    """
    rooms = np.empty((len(s), 2))
    s, x, y = (np.ascontiguousarray(column) for column in (s, x, y))
    _rooms(core.address(street.record), len(s), core.address(s), core.address(x), core.address(y), core.address(rooms))
    return rooms.T


def pieces_of(kerbs: Sequence[Kerb], end: float = np.inf) -> Pieces:
    """Return the pieces of kerbs beside a road that ends at arclength ``end`` [m]."""
    of = [_pieces(kerb) for kerb in kerbs]
    found = np.concatenate([np.zeros(0, PIECE), *of])
    found["kerb"] = np.repeat(np.arange(len(of)), [len(pieces) for pieces in of])
    found["corner"] |= found["s_begin"] == end  # a body that has left the road in part keeps beside its side what is left of the kerb
    return laid_out(found, end)


def laid_out(pieces: Records, end: float = np.inf) -> Pieces:
    """Return pieces (n,) of ``PIECE`` as the core takes them, in order of s, beside a road that ends at arclength ``end`` [m]."""
    found = np.ascontiguousarray(pieces[np.argsort(pieces["s_low"], kind="stable")])
    reach = np.maximum.accumulate(found["s_high"])
    return Pieces(found, reach, np.array([(core.address(found), core.address(reach), len(found), end, 0.0)], STREET))


def _pieces(kerb: Kerb) -> Records:
    """Return the pieces of one kerb, with the street on their left: those of a left kerb run against the line."""
    order = slice(None, None, -1) if kerb.left else slice(None)
    points, s = kerb.points[order], kerb.s[order]
    for _ in range(_CLEANED):
        step = np.diff(points, axis=0)
        length = np.hypot(*step.T)
        turn = np.sum(step[1:] * step[:-1], axis=1) / np.maximum(length[1:] * length[:-1], _SHORTEST_M**2)
        sliver = (turn < _SHARPLY) & (np.minimum(length[1:], length[:-1]) < _SLIVER_M)
        back = (turn < _BACK) | sliver & ~np.append(False, sliver[:-1])  # of a sliver's two turns one goes
        kept = np.append(length > _SHORTEST_M, True) & ~np.concatenate([[False], back, [False]])
        if np.all(kept):
            break
        points, s = points[kept], s[kept]
    step = np.diff(points, axis=0)
    found = np.zeros(len(step), PIECE)
    if len(found) == 0:  # inside a ring that is narrower than its width: a point bounds nothing
        return found
    found["x"], found["y"] = points[:-1].T
    found["length"] = np.hypot(*step.T)
    found["cos"], found["sin"] = (step / found["length"][:, None]).T
    for name in ("cos", "sin"):
        found[f"before_{name}"] = np.concatenate([found[name][:1], found[name][:-1]])
    found["s_begin"], found["s_end"] = s[:-1], s[1:]
    found["s_low"], found["s_high"] = np.minimum(s[:-1], s[1:]), np.maximum(s[:-1], s[1:])
    found["left"], found["wheels"] = kerb.left, kerb.wheels
    found["wall"] = np.abs(np.diff(s)) < _WALL * found["length"]
    found["corner"] = found["before_cos"] * found["sin"] - found["before_sin"] * found["cos"] < -_STRAIGHT
    if not kerb.goes_on:
        found = np.append(found, found[-1:])
        found[-1:][["x", "y", "length", "s_begin", "s_low", "s_high"]] = (*points[-1], 0.0, s[-1], s[-1], s[-1])
        found["corner"][[0, -1]] = found["ends_after"][-2:] = 1
    found["ends"][[0, -1]] = 1, not kerb.goes_on
    return found


def _replaced(kerb: Kerb, parts: Sequence[Kerb]) -> Kerb:
    """Return a kerb with ``parts`` in place of its own points beside their stretches of the line, in order of s."""
    points, s, begin = [], [], -np.inf
    for part in parts:
        own = (kerb.s > begin) & (kerb.s < part.s[0])
        points += [kerb.points[own], part.points]
        s += [kerb.s[own], part.s]
        begin = part.s[-1]
    own = kerb.s > begin
    return replace(kerb, points=np.concatenate([*points, kerb.points[own]]), s=np.concatenate([*s, kerb.s[own]]))


def between(kerb: Kerb, low: float, high: float) -> Kerb:
    """Return a kerb's part beside a stretch of the line, from arclength ``low`` to ``high`` [m]."""
    if high <= kerb.s[0] or low >= kerb.s[-1] or high <= low:
        return replace(kerb, points=np.empty((0, 2)), s=np.empty(0))
    inside = (kerb.s >= low) & (kerb.s <= high)
    ends = [np.array([end]) if kerb.s[0] < end < kerb.s[-1] and end not in kerb.s else np.empty(0) for end in (low, high)]
    cut = [np.stack([np.interp(end, kerb.s, column) for column in kerb.points.T], axis=1) for end in ends]
    points, s = (np.concatenate([cut[0], kerb.points[inside], cut[1]]), np.concatenate([ends[0], kerb.s[inside], ends[1]]))
    apart = np.append(True, np.hypot(*np.diff(points, axis=0).T) > _SHORTEST_M)
    return replace(kerb, points=points[apart], s=s[apart])
