"""The street in the plane: the kerbs within which a vehicle stays, and the stretch of line that each piece of them belongs to.

The line is only for steering along. A width counts from the line as it was given, an edge lies where it was drawn, and nothing here depends
on how far planning moved its own line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hdvplan import core
from hdvplan.arrays import BoolArray, FloatArray, Records, running
from hdvplan.road.limits import About
from hdvplan.road.path import ReferencePath
from hdvplan.road.pieces import Kerb, Pieces, between, in_order, laid_out, replaced_by

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
BEYOND_M = 60.0  # the road's ends, where what is drawn counts: as long as the longest vehicle and its swing
_TURN_M, _AROUND_M = 1.0, 15.0  # of the line's samples, and beside a place: how much it turns
_MOST_BEND = 1.5  # [rad] that count: a kerb in a hairpin is as near along the line as across it
_ACROSS = 0.5  # cosine to the line, below which a piece is a wall across the street
_ON_M = 1000.0  # that kerbs go on beyond a road: further than a vehicle and its horizon


@dataclass(frozen=True)
class Street:
    """The kerbs of a road of ``length`` [m]; a closed one has them in every lap.

    ``ends`` are the directions in which those of an open road go on: before its start and beyond its end, (2, 2), unit vectors.
    ``line`` has s, x and y of the line [m], an open road's with what lies beyond its ends, its heading and how much it turns around there
    [rad], (5, n): in a bend, kerbs far along it are near.
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
        beyond = 0.0 if path.closed else BEYOND_M
        s = np.linspace(-beyond, path.length + beyond, int(np.ceil((path.length + 2.0 * beyond) / _TURN_M)) + 1)
        here, given = path.extended(beyond, beyond).at(s), path.at(np.array([0.0, path.length])).heading
        turned, around = np.unwrap(here.heading), int(np.ceil(_AROUND_M / _TURN_M))
        bend = running(np.maximum, turned, around, around) - running(np.minimum, turned, around, around)
        ends = np.stack([np.cos(given), np.sin(given)], axis=1) if about is None else about.ends
        return cls(kerbs, path.length, path.closed, ends, np.stack([s, here.x, here.y, turned, bend]))

    @cached_property
    def two_regions(self) -> bool:
        """Whether wheels have kerbs of their own."""
        return any(kerb.wheels for kerb in self.kerbs)

    def pieces(self, s_from: float, s_to: float) -> Pieces:
        """Return the pieces of all kerbs from ``s_from`` to ``s_to`` [m], a closed road's in every lap there."""
        end = np.inf if self.closed else self.begin + self.length
        pieces = in_order(self.unrolled(s_from, s_to), end)
        if self.line is None:
            return laid_out(pieces, end)
        beyond = np.stack([pieces["x"] + pieces["length"] * pieces["cos"], pieces["y"] + pieces["length"] * pieces["sin"]])
        ends = ((pieces["s_begin"], pieces["x"], pieces["y"]), (pieces["s_end"], *beyond))
        further = np.maximum(*(self._further(*end) for end in ends))
        pieces["wall"] &= self._across(pieces)
        pieces["s_low"] -= further
        pieces["s_high"] += further
        order = np.argsort(pieces["kerb"], kind="stable")
        for own in np.split(order, np.flatnonzero(np.diff(pieces["kerb"][order])) + 1):  # who sees a piece sees those before it, too
            pieces["s_low"][own] = np.minimum.accumulate(pieces["s_low"][own][::-1])[::-1]
            pieces["s_high"][own] = np.maximum.accumulate(pieces["s_high"][own])
            low, high = pieces["s_low"][own[0]], pieces["s_high"][own[-1]]
            if np.any(pieces["ends"][own]) and high - low < BEYOND_M:
                pieces["s_low"][own], pieces["s_high"][own] = low, high  # and of a wall the whole: each piece has its front alone
        return laid_out(pieces, end)

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
        inside = (at >= self.line[0, 0]) & (at <= self.line[0, -1])
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
            return replaced_by(kerb, parts) if parts else kerb
        if parts[0].s[-1] - parts[0].s[0] >= self.length:  # all around
            return replace(kerb, points=np.concatenate([parts[0].points, parts[0].points[:1]]), s=np.append(parts[0].s, self.length))
        start = self.length * np.floor(parts[0].s[0] / self.length)  # of the lap that the parts begin in
        laps = self.length * np.array([-1.0, 0.0, 1.0])
        whole = replaced_by(self._longer(kerb, laps), [replace(part, s=part.s + lap - start) for lap in laps for part in parts])
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
