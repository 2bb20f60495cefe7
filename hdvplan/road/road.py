"""A road: its reference path, its street, and where it came from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np
import shapely

from hdvplan.arrays import FloatArray
from hdvplan.road.limits import About, Limits
from hdvplan.road.passages import Line, Passage, furthest, normals, offsets_of, passages_of
from hdvplan.road.path import ReferencePath
from hdvplan.road.pieces import Kerb
from hdvplan.road.regions import OPEN_M, Kind, Region, Side, distances
from hdvplan.road.street import Street
from hdvplan.road.widened import widened

_SPACING_M = 0.1  # of normals: between two of them a kerb is taken as straight
_ONE_M = 1e-3  # from each other: two kerbs are one
_NEAR_M = 6.0  # to the kerbs of most streets
_BESIDE_M, _WITHIN_M = 1e-6, 1e-3  # that a face is longer than its points, for rounding; from its ends, where walls begin


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
    #: x, y [m] in the plane of ``path``, arrays of one shape -> longitudes, latitudes [deg]
    to_lonlat: Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]] | None = field(default=None, metadata={"decides": False})
    notice: str | None = field(default=None, metadata={"decides": False})  #: attribution that figures made from this road must carry
    regions: tuple[Region, ...] = ()
    notes: tuple[str, ...] = field(default=(), metadata={"decides": False})  #: notes from reading its file
    #: the line that widths count from; None: the path itself
    about: About | None = field(default=None, metadata={"decides": False})
    drawn: tuple[Kerb, ...] | None = None  #: the kerbs as they are drawn, of which ``limits`` are what lies beside the path
    #: where straights bridge the gaps between drawn kerbs, and what bounds a side on which none is drawn, (n, 2) each [m]
    bridges: tuple[FloatArray, ...] = field(default=(), metadata={"decides": False})
    #: with which kerbs inside sharp corners are rounded [m]
    corner_radius: float = field(default=0.0, metadata={"decides": False})
    #: the faces of regions, as they are passed; None: each on its usual side
    faces: tuple[Kerb, ...] | None = field(default=None, metadata={"decides": False})

    def __repr__(self) -> str:
        """Return one line, for a notebook: all fields together have thousands of signs."""
        kerbs = "without limits" if self.given is None else "with limits"
        return f"<{type(self).__name__} {self.name}: {self.path.length:.1f} m, {kerbs}>"

    @cached_property
    def given(self) -> Street | None:
        """The street's kerbs without its regions; without limits those of an open place where it has regions, None else."""
        if self.drawn is not None:
            return Street.along(self.path, self.drawn, self.about)
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

    def within(self, limits: Limits | None, drawn: tuple[Kerb, ...] | None = None, bridges: tuple[FloatArray, ...] = ()) -> Road:
        """Return the road with ``limits`` beside its path, or without limits if that is None.

        ``drawn`` are the kerbs themselves, where they do not follow from those, and ``bridges`` what nobody drew in them.
        """
        return replace(self, limits=limits, drawn=drawn, bridges=bridges, faces=None)

    def with_kerbs(self, kerbs: tuple[Kerb, ...]) -> Road:
        """Return the road in a street that is drawn."""
        return self.within(limits_beside(self.path, kerbs), kerbs, self.bridges)

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

    def lonlat(self, x: float, y: float) -> tuple[float, float] | None:
        """Return longitude and latitude [deg] of a point in the plane, or None where the road has no geographic coordinates."""
        if self.to_lonlat is None:
            return None
        lon, lat = self.to_lonlat(np.array([x]), np.array([y]))
        return (float(lon[0]) + 180.0) % 360.0 - 180.0, float(lat[0])  # roads go on across the antimeridian

    def binds(self, side: str, region: str, x: float, y: float) -> str | None:
        """Return what the limit of a ``region`` binds that a body touches at x, y [m]: "wheels", "overhangs"; None: the whole body."""
        kerbs = [] if self.kerbs is None else [kerb for kerb in self.kerbs.kerbs if kerb.left is (side == "left")]
        apart = {wheels: shapely.MultiLineString([kerb.points for kerb in kerbs if kerb.wheels is wheels]) for wheels in (True, False)}
        wheels, bodies = (shapely.distance(shapely.Point(x, y), lines) for lines in apart.values())
        return ("overhangs" if region == "sweepable" else "wheels") if abs(wheels - bodies) > _ONE_M else None  # NaN: there is but one

    def __getstate__(self) -> dict[str, object]:
        """Return the fields alone: the rest follows from them."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def with_limits(self, left: float, right: float) -> Road:
        """Return the road with constant limits; ``left``, ``right`` are positive reaches [m]."""
        return self.with_widths(Limits.constant(left, right, self.path.length))


def part_of(road: Road, s_from: float, s_to: float, before: float, after: float) -> Road:
    """Return the part of a road from ``s_from`` to ``s_to`` [m]; arclengths count from ``s_from``.

    Path, kerbs and the faces of regions go on for ``before`` and ``after`` [m] beyond its ends as they do on the road.
    """
    first, last = s_from - before, s_to + after
    faces = None if road.faces is None else Street.along(road.path, road.faces).beside(first, last)
    part = replace(
        road,
        path=road.path.stretch(s_from, s_to, before, after),
        smoothing=None,
        about=None if road.about is None else road.about.part(s_from, s_to, road.path.length),
        limits=None if road.limits is None else _limits(road, road.limits, s_from, s_to),
        drawn=None if road.given is None else tuple(kerb.shifted(s_from) for kerb in road.given.beside(first, last)),
        faces=None if faces is None else tuple(face.shifted(s_from) for face in faces),
    )
    if road.drawn is None and not road.regions:  # its kerbs are drawn, but no others than those of its limits
        part.__dict__["beside"] = part.limits
    return part


def _limits(road: Road, limits: Limits, s_from: float, s_to: float) -> Limits:
    laps = np.arange(np.floor(s_from / road.path.length), np.ceil(s_to / road.path.length)) if road.path.closed else np.zeros(1)
    columns = (limits.left, limits.right, limits.left_sweep, limits.right_sweep)
    s = np.concatenate([limits.s + lap * road.path.length for lap in laps])
    return Limits(s - s_from, *(np.tile(column, len(laps)) for column in columns))


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
    s = np.unique(np.concatenate([limits.s, np.clip(jumps.ravel(), 0.0, path.length)]))
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


def edge_reaches(path: ReferencePath, kerbs: Sequence[Kerb]) -> tuple[FloatArray, FloatArray]:
    """Return arclengths [m] and how far ``path`` may be left there before a kerb, to the left and to the right, shape (2, n) [m].

    Each normal ends at the first kerb that it meets: names of sides do not count, only where kerbs lie, and the arclengths beside
    them, which tell those of another arm of the road. Where none is met within ``OPEN_M``, the road is open so far.
    """
    s = _places(path)
    here = path.at(s)
    chords = np.concatenate([np.stack([one.points[:-1], one.points[1:]], axis=1) for one in kerbs])
    ends = np.concatenate([np.stack([one.s[:-1], one.s[1:]], axis=1) for one in kerbs])
    middle, half = np.mean(ends, axis=1), 0.5 * np.ptp(ends, axis=1)
    tree = shapely.STRtree(np.asarray(shapely.linestrings(chords)))
    centre, normal = normals(here)
    reaches = []
    for sign in (1.0, -1.0):
        far, towards = furthest(sign * here.curvature), sign * normal
        reach = np.full(len(s), np.inf)
        for most in (_NEAR_M, OPEN_M):  # most normals end near by, and few chords are there to be looked at
            still = np.flatnonzero(np.isinf(reach))
            tips = centre[still] + np.minimum(far[still], most)[:, None] * towards[still]
            ray, chord = tree.query(shapely.linestrings(np.stack([centre[still], tips], axis=1)), predicate="intersects")
            at = still[ray]
            apart = np.abs(s[at] - middle[chord])
            apart = np.minimum(apart, path.length - apart) if path.closed else apart
            at, chord = (found[apart <= half[chord] + OPEN_M] for found in (at, chord))
            np.minimum.at(reach, at, _crossed(centre[at], towards[at], chords[chord]))
        seen = np.isfinite(reach)
        reaches.append(np.interp(s, s[seen], reach[seen]) if np.any(seen) else far)
    return s, np.stack(reaches)


def _crossed(origin: FloatArray, towards: FloatArray, chords: FloatArray) -> FloatArray:
    """Return how far rays from ``origin`` (n, 2) [m] along unit vectors ``towards`` (n, 2) go to ``chords`` (n, 2, 2) they meet [m]."""
    start, chord = chords[:, 0] - origin, chords[:, 1] - chords[:, 0]
    along = np.sort(np.einsum("nij,nj->ni", chords - origin[:, None], towards), axis=1)  # of both ends: the crossing lies between them
    turn = towards[:, 0] * chord[:, 1] - towards[:, 1] * chord[:, 0]
    across = start[:, 0] * chord[:, 1] - start[:, 1] * chord[:, 0]
    met = np.divide(across, turn, out=along[:, 0].copy(), where=turn != 0.0)  # where they lie on each other, the nearer end
    return np.asarray(np.maximum(np.clip(met, *along.T), 0.0))


def _places(path: ReferencePath) -> FloatArray:
    """Return the arclengths of the normals: on a part of a road that begins at a multiple of their spacing the same ones [m]."""
    return np.append(np.arange(0.0, path.length - 0.5 * _SPACING_M, _SPACING_M), path.length)
