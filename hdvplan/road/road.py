"""A road: its reference path, its street, and where it came from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.road.edges import limits_beside, narrowed
from hdvplan.road.limits import Limits
from hdvplan.road.passages import Line, Passage, passages_of
from hdvplan.road.path import ReferencePath
from hdvplan.road.regions import OPEN_M, Kind, Region, Side, distances
from hdvplan.road.street import About, Kerb, Street
from hdvplan.road.widened import widened


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
        limits = self.limits
        if limits is None and np.any(distances(self.path, self.regions) <= OPEN_M):
            limits = Limits.constant(OPEN_M, OPEN_M, self.path.length)
        return None if limits is None else Street.along(self.path, About.smooth(self.path).kerbs(limits))

    @cached_property
    def bounds(self) -> Street | None:
        """The street's kerbs with the sweepable areas that join it, without what lies within it; None without limits."""
        street, areas = self.given, [region.polygon for region in self.regions if region.kind is Kind.SWEEPABLE]
        return replace(street, kerbs=widened(self.line, street, areas)) if street is not None and areas else street

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
    def line(self) -> Line:
        """Its line, as the places of regions beside it are found."""
        return Line.of(self.path)

    @cached_property
    def passages(self) -> tuple[Passage, ...]:
        """Where the road passes its regions, in order of s."""
        return passages_of(self.line, self.regions, self.bounds) if self.regions else ()

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
