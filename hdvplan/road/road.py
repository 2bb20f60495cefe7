"""A road: its reference path, its limits along s, and where it came from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import OptionError, RoadError
from hdvplan.road.obstructed import Obstructed, obstructed
from hdvplan.road.path import ReferencePath
from hdvplan.road.regions import OPEN_M, Kind, Region, Side

_JUMP_M = 1e-3  # over which limits end


@dataclass(frozen=True)
class Limits:
    """Signed lateral limits [m] at increasing arclengths ``s`` [m]: left positive, right negative, linear between.

    ``left`` and ``right`` bound wheels and everything between the axles (the drivable region of [BUS]); overhangs may
    reach ``left_sweep`` and ``right_sweep``, which are at least as wide. Beyond the ends the last value holds as far as the road goes,
    ``along`` says what holds beyond that. Where obstacles block the road, the left limit lies right of the right one.
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
                msg = f"{what} at s = {s:.1f} m"
                raise RoadError(msg, s_m=s)

    @classmethod
    def constant(cls, left: float, right: float, length: float) -> Limits:
        """Return limits that are the same everywhere; ``left`` and ``right`` are positive reaches [m]."""
        for side, reach in (("left", left), ("right", right)):
            if not (np.isfinite(reach) and reach > 0.0):
                msg = f"the {side} limit must be a positive number of metres, not {reach:g}"
                raise OptionError(msg)
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

    def along(self, path: ReferencePath, s_from: float, s_to: float) -> Limits:
        """Return the limits that hold from ``s_from`` to ``s_to`` [m] of a road on ``path``, which may lie beyond its ends.

        On a closed road they are the same in every lap. On an open one nothing is kept or judged before its first and beyond its last
        point, so that the road is open to ``OPEN_M`` there, unless limits are given there: a road that was cut goes on.
        """
        ends = np.array([0.0, path.length]) if path.closed else np.array([min(0.0, self.s[0]), max(path.length, self.s[-1])])
        inside, held = (self.s > ends[0]) & (self.s < ends[1]), self.table(ends)
        columns = np.stack([self.left, self.right, self.left_sweep, self.right_sweep])[:, inside]
        s, values = np.concatenate([ends[:1], self.s[inside], ends[1:]]), np.concatenate([held[:, :1], columns, held[:, 1:]], axis=1)
        if path.closed:
            laps = path.length * np.arange(np.floor(s_from / path.length), np.ceil(s_to / path.length))
            return Limits(np.concatenate([s + lap for lap in laps]), *np.tile(values, len(laps)))
        outwards = np.array([[1.0], [-1.0], [1.0], [-1.0]])
        free = outwards * np.maximum(outwards * held, OPEN_M)
        s, values = np.concatenate([s[:1] - _JUMP_M, s, s[-1:] + _JUMP_M]), np.concatenate([free[:, :1], values, free[:, 1:]], axis=1)
        return Limits(s, *values)


@dataclass(frozen=True)
class Smoothing:
    """How the given points were changed to get a usable reference path."""

    points: int  #: given points
    duplicates: int  #: points dropped because they repeat their neighbour
    max_deviation: float  #: furthest that the line was moved [m]
    max_deviation_s: float  #: where [m]
    rms_deviation: float  #: [m]
    max_curvature: float  #: of the smoothed line [1/m]
    max_curvature_s: float  #: where [m]


@dataclass(frozen=True)
class Road:
    """A named road that a vehicle can be planned along.

    ``limits`` are what a vehicle must keep; ``band`` are the limits before ``regions`` changed them, for ``within``. Planning chooses
    the sides on which obstacles are passed, and then changes the band again.
    """

    name: str = field(metadata={"decides": False})
    path: ReferencePath
    limits: Limits | None = None
    smoothing: Smoothing | None = field(default=None, metadata={"decides": False})
    #: x, y [m] -> degrees
    to_lonlat: Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]] | None = field(default=None, metadata={"decides": False})
    notice: str | None = field(default=None, metadata={"decides": False})  #: attribution that figures made from this road must carry
    regions: tuple[Region, ...] = ()
    band: Limits | None = None
    notes: tuple[str, ...] = field(default=(), metadata={"decides": False})  #: notes from reading its file
    edges: Limits | None = None  #: the limits before obstacles cut them; None where there are none

    @property
    def own_limits(self) -> Limits | None:
        """The limits as they were before obstacles and sweepable areas changed them, None without."""
        return self.band if self.regions else self.limits

    @property
    def has_obstacles(self) -> bool:
        """Whether the road has obstacles."""
        return any(region.kind is Kind.OBSTACLE for region in self.regions)

    @cached_property
    def obstructed(self) -> Obstructed | None:
        """The road's band with its regions: the limits for any choice of the sides on which obstacles are passed."""
        band = self.band
        given = None if band is None else (band.s, np.stack([band.left, band.right, band.left_sweep, band.right_sweep]))
        return obstructed(self.path, self.regions, given) if self.regions else None

    def within(self, band: Limits | None) -> Road:
        """Return the road with the limits ``band``, or without limits if it is None, as its regions narrow and widen them."""
        road = replace(self, limits=band, band=band, edges=None)
        found = road.obstructed
        return road if found is None else road.passing(found.usual)

    def passed_on(self, side: Side) -> Road:
        """Return the road with ``side`` given for every obstacle on its line that has none."""
        found = self.obstructed
        on_line = set() if found is None else {passage.region for passage in found.passages if passage.on_line}
        if not on_line:
            return self
        regions = tuple(replace(one, side=one.side or side) if number in on_line else one for number, one in enumerate(self.regions))
        return replace(self, regions=regions).within(self.band)

    def passing(self, sides: Mapping[int, Side]) -> Road:
        """Return the road with the limits that passing its obstacles on ``sides`` leaves, by the numbers of ``obstructed.passages``."""
        found = self.obstructed
        if found is None:
            return self
        limits, edges = (Limits(nodes, *values) for nodes, values in (found.limits(sides), found.limits({})))
        road = replace(self, limits=limits, edges=edges if found.passages else None)
        road.__dict__["obstructed"] = found  # where ``cached_property`` looks: band and regions are the same
        return road

    def __getstate__(self) -> dict[str, object]:
        """Return the fields alone: the rest follows from them."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def with_limits(self, left: float, right: float) -> Road:
        """Return the road with constant limits, which its obstacles still cut; ``left``, ``right`` are positive reaches [m]."""
        return self.within(Limits.constant(left, right, self.path.length))
