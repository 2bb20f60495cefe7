"""Limits along a line, how far a street reaches to either side of it, and the line that they count from, as it was given."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hdvplan.arrays import BoolArray, FloatArray, end_ways
from hdvplan.errors import OptionError, RoadError
from hdvplan.road.kerbs import kerb_of
from hdvplan.road.path import ReferencePath
from hdvplan.road.pieces import Kerb

if TYPE_CHECKING:
    from hdvplan.road.given import GivenLine


WIDEST_M = 250.0  # from a line to the nearer of its limits: beyond it is no street, but one of 3 m in centimetres


@dataclass(frozen=True)
class Limits:
    """Signed lateral limits [m] at increasing arclengths ``s`` [m]: left positive, right negative, linear between.

    ``left`` and ``right`` bound wheels and everything between the axles (the drivable region of [BUS]); overhangs may
    reach ``left_sweep`` and ``right_sweep``, which are at least as wide. Beyond the ends the last value holds. Where obstacles block the
    road, the left limit lies right of the right one.
    """

    s: FloatArray
    left: FloatArray
    right: FloatArray
    left_sweep: FloatArray
    right_sweep: FloatArray

    def __post_init__(self) -> None:
        """Refuse limits that give overhangs less room than wheels."""
        for bad, what in (
            (self.left_sweep < self.left, "overhangs have less room than wheels on the left"),
            (self.right_sweep > self.right, "overhangs have less room than wheels on the right"),
        ):
            if np.any(bad):
                s = float(self.s[int(np.argmax(bad))])
                msg = f"{what} at s = {s:z.1f} m"
                raise RoadError(msg, s_m=s)

    @classmethod
    def constant(cls, left: float, right: float, length: float) -> Limits:
        """Return limits that are the same everywhere; ``left`` and ``right`` are positive reaches [m]."""
        for side, reach in (("left", left), ("right", right)):
            what = "half width" if left == right else f"{side} limit"
            if not (np.isfinite(reach) and reach > 0.0):
                msg = f"the {what} must be a positive number of metres, not {reach:g}"
                raise OptionError(msg)
            if reach > WIDEST_M:
                msg = f"the {what} must be at most {WIDEST_M:g} m, not {reach:g}"
                raise OptionError(msg, hint="is it in metres?")
        s = np.array([0.0, length])
        one = np.ones(2)
        return cls(s, left * one, -right * one, left * one, -right * one)

    @property
    def two_regions(self) -> bool:
        """Whether overhangs have more room than wheels anywhere."""
        return bool(np.any(self.left_sweep > self.left) or np.any(self.right_sweep < self.right))

    def table(self, s: FloatArray) -> FloatArray:
        """Return the limits at arclengths ``s`` [m]: rows left, right, left_sweep, right_sweep; shape (4, len(s))."""
        columns = (self.left, self.right, self.left_sweep, self.right_sweep)
        return np.stack([np.interp(s, self.s, column) for column in columns])


_SAMPLES_M = 0.25  # of a line that is smooth: an arc of 10 m is then 0.8 mm off its chord


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
        return end_ways(self.points)

    def reversed(self, length: float) -> About:
        """Return the line driven the other way, on a path of that length [m]."""
        corners = tuple(one._replace(s=length - one.s, turn=-one.turn) for one in self.corners[::-1])
        points, s, sharp = self.points[::-1], length - self.s[::-1], self.sharp[::-1]
        return replace(self, points=points, s=s, sharp=sharp, offset=-self.offset, corners=corners)

    def part(self, s_from: float, s_to: float, length: float) -> About:
        """Return the line around a stretch of its path, which is ``length`` long and whose ends it may lie beyond; s is from its start [m].

        It reaches to the next points before and beyond, and has two points at least.
        """
        laps = length * np.arange(np.floor(s_from / length), np.ceil(s_to / length)) if self.closed else np.zeros(1)
        s = np.concatenate([self.s + lap for lap in laps])
        all_points = np.tile(self.points, (len(laps), 1))
        steps = np.flatnonzero(np.any(np.diff(all_points, axis=0) != 0.0, axis=1))  # of a part beyond the ends the nearest one is taken
        first, last = int(np.searchsorted(s, s_from, side="right")) - 1, int(np.searchsorted(s, s_to))
        own = slice(max(min(first, int(steps[-1])), 0), max(last, int(steps[0]) + 1) + 1)
        points, sharp = all_points[own], np.tile(self.sharp, len(laps))[own]
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
