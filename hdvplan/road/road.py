"""A road: its reference path, its limits along s, and where it came from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import OptionError, RoadError
from hdvplan.road.drawn import open_kerb
from hdvplan.road.edges import edge_reaches, offsets_of
from hdvplan.road.passages import Line, Passage, passages_of
from hdvplan.road.path import ReferencePath
from hdvplan.road.regions import OPEN_M, Kind, Region, Side, distances
from hdvplan.road.street import About, Kerb, Street
from hdvplan.road.widened import widened

_SPACING_M = 0.1  # of places beside the faces of regions
_BESIDE_M, _WITHIN_M = 1e-6, 1e-3  # that a face is longer than its points, for rounding; from its ends, where walls begin


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

    ``limits`` are where its kerbs lie beside its path, without ``regions``. Planning chooses the sides on which those are passed.
    """

    name: str = field(metadata={"decides": False})
    path: ReferencePath
    limits: Limits | None = None
    smoothing: Smoothing | None = field(default=None, metadata={"decides": False})
    #: x, y [m] -> degrees
    to_lonlat: Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]] | None = field(default=None, metadata={"decides": False})
    notice: str | None = field(default=None, metadata={"decides": False})  #: attribution that figures made from this road must carry
    regions: tuple[Region, ...] = ()
    notes: tuple[str, ...] = field(default=(), metadata={"decides": False})  #: notes from reading its file
    #: the line that widths count from; None: the path itself
    about: About | None = field(default=None, metadata={"decides": False})
    drawn: tuple[Kerb, ...] | None = None  #: the kerbs as they are drawn, of which ``limits`` are what lies beside the path
    #: with which kerbs inside sharp corners are rounded [m]
    corner_radius: float = field(default=0.0, metadata={"decides": False})
    #: the faces of regions, as they are passed; None: each on its usual side
    faces: tuple[Kerb, ...] | None = field(default=None, metadata={"decides": False})

    @cached_property
    def given(self) -> Street | None:
        """The street's kerbs without its regions; without limits those of an open place where it has regions, None else."""
        if self.drawn is not None:
            return Street.along(self.path, self.drawn)
        if self.limits is not None:
            return Street.along(self.path, About.smooth(self.path).kerbs(self.limits))
        near = bool(np.any(distances(self.path, self.regions) <= OPEN_M))
        return Street.along(self.path, tuple(open_kerb(self.path, left=left) for left in (True, False))) if near else None

    @cached_property
    def bounds(self) -> Street | None:
        """The street's kerbs with the sweepable areas that join it, without what lies within it; None without limits."""
        street, areas = self.given, [region.polygon for region in self.regions if region.kind is Kind.SWEEPABLE]
        return replace(street, kerbs=widened(Line.of(self.path), street, areas)) if street is not None and areas else street

    @cached_property
    def kerbs(self) -> Street | None:
        """The street itself, without its obstacles: what a drive is judged by; None without limits and regions."""
        street, islands = self.bounds, tuple(face for face in self.passed if face.wheels)
        return street if street is None or not islands else replace(street, kerbs=(*street.kerbs, *islands))

    @cached_property
    def street(self) -> Street | None:
        """The street that is planned in, where the faces of obstacles are kerbs, too; None where nothing limits it."""
        street, obstacles = self.kerbs, tuple(face for face in self.passed if not face.wheels)
        return street if street is None or not obstacles else replace(street, kerbs=(*street.kerbs, *obstacles))

    @cached_property
    def beside(self) -> Limits | None:
        """How far the street reaches from the path, without obstacles: for pictures; None without limits."""
        if self.bounds is None:
            return None
        given = self.limits if self.drawn is None and not self.regions else None
        limits = limits_beside(self.path, self.bounds.kerbs) if given is None else given
        return narrowed(self.path, limits, [face for face in self.passed if face.wheels])

    @cached_property
    def passable(self) -> Limits | None:
        """How far the street reaches from the path as its obstacles leave it: for tables and forecasts; None where nothing limits it."""
        obstacles = [face for face in self.passed if not face.wheels]
        return None if self.beside is None else narrowed(self.path, self.beside, obstacles)

    @cached_property
    def passages(self) -> tuple[Passage, ...]:
        """Where the road passes its regions, in order of s."""
        return passages_of(self.path, self.regions, self.bounds)

    @property
    def passed(self) -> tuple[Kerb, ...]:
        """The faces of its regions, as they are passed."""
        if self.faces is not None:
            return self.faces
        return tuple(face for passage in self.passages for face in passage.faces[passage.usual])

    def within(self, limits: Limits | None, drawn: tuple[Kerb, ...] | None = None) -> Road:
        """Return the road with ``limits`` beside its path, or without limits if that is None.

        ``drawn`` are the kerbs themselves, where they do not follow from those.
        """
        return replace(self, limits=limits, drawn=drawn, faces=None)

    def with_kerbs(self, kerbs: tuple[Kerb, ...]) -> Road:
        """Return the road in a street that is drawn."""
        return self.within(limits_beside(self.path, kerbs), kerbs)

    def with_widths(self, widths: Limits | None) -> Road:
        """Return the road with limits that count from the line as it was given."""
        if widths is None or self.about is None:
            return self.within(widths)
        return self.within(widths, self.about.kerbs(widths, self.corner_radius))

    def passed_on(self, side: Side) -> Road:
        """Return the road with ``side`` given for every region on its line that has none."""
        on_line = {passage.region for passage in self.passages if passage.on_line}
        if not on_line:
            return self
        regions = tuple(replace(one, side=one.side or side) if number in on_line else one for number, one in enumerate(self.regions))
        return replace(self, regions=regions, faces=None)

    def passing(self, sides: Mapping[int, Side]) -> Road:
        """Return the road with its regions passed on ``sides``, by the numbers of ``passages``."""
        road = replace(self, faces=tuple(face for number, side in sides.items() for face in self.passages[number].faces[side]))
        road.__dict__["passages"] = self.passages  # where ``cached_property`` looks: path and regions are the same
        return road

    def __getstate__(self) -> dict[str, object]:
        """Return the fields alone: the rest follows from them."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def with_limits(self, left: float, right: float) -> Road:
        """Return the road with constant limits; ``left``, ``right`` are positive reaches [m]."""
        return self.with_widths(Limits.constant(left, right, self.path.length))


def limits_beside(path: ReferencePath, kerbs: tuple[Kerb, ...]) -> Limits:
    """Return how far kerbs lie from a path, along its normals."""
    reaches = {}
    for wheels in (False, True):
        own = [kerb for kerb in kerbs if kerb.wheels is wheels]
        if own:
            s, reaches[wheels] = edge_reaches(path, own)
    left, right = reaches[False]
    inner = reaches.get(True, reaches[False])
    return Limits(s, inner[0], -inner[1], np.maximum(left, inner[0]), -np.maximum(right, inner[1]))


def narrowed(path: ReferencePath, limits: Limits, faces: Sequence[Kerb]) -> Limits:
    """Return limits beside a path as the faces of regions narrow them: those of obstacles all of them, others those of wheels."""
    if not faces:
        return limits
    ends = np.array([(np.min(face.s), np.max(face.s)) for face in faces])
    jumps = ends[:, None] + np.array([(-_BESIDE_M, _BESIDE_M), (_WITHIN_M, -_WITHIN_M)])
    s = np.unique(np.concatenate([limits.s, np.arange(0.0, path.length, _SPACING_M), np.clip(jumps.ravel(), 0.0, path.length)]))
    table = limits.table(s)
    for face, (begin, end) in zip(faces, ends, strict=True):
        near = np.flatnonzero((s >= begin - _BESIDE_M) & (s <= end + _BESIDE_M))
        met = offsets_of(path, face, s[near])
        seen = np.isfinite(met) & (s[near] >= begin + _WITHIN_M) & (s[near] <= end - _WITHIN_M)
        if np.any(seen):
            met = np.interp(s[near], s[near][seen], met[seen])
            for row in range(0 if face.left else 1, 2 if face.wheels else 4, 2):
                table[row, near] = np.minimum(table[row, near], met) if face.left else np.maximum(table[row, near], met)
    return Limits(s, *table)
