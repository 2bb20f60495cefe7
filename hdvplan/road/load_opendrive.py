"""Read a road from OpenDRIVE: one lane after another over the roads of a route, with the lanes' own edges as limits."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError
from hdvplan.road.arcs import rounded, wrapped
from hdvplan.road.crs import placed
from hdvplan.road.line import RawRoad
from hdvplan.road.opendrive import DRIVEN, LONGEST_M, SAME_M, OdrRoad, Section, read_roads
from hdvplan.road.options import ids_of
from hdvplan.texts import some_of

_SPACING_M = 0.25  # of the points on lanes and edges
_MEET_M = 0.3  # lanes whose ends are this close, and
_LINKED_M = 1.0  # where the file links two lanes of one road
_MEET_TURN = 0.2  # this parallel [rad] go on in each other: files drawn by hand have such gaps, and links that are wrong
_CUT_M = 2e-3  # records that begin this close together begin at one place
_LISTED = 12
_NOWHERE = ("+lat_0=0 +lon_0=0",)  # the projection that editors write when nobody placed the map


@dataclass(frozen=True)
class _Piece:
    """A lane in one section of a road, or the reference line (lane 0), in its driving direction."""

    road: OdrRoad
    section: Section
    lane: int
    forward: bool

    def lines(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return points of the middle, of the left and of the right edge, shape (3, n, 2) [m], and the middle's heading and curvature."""
        section, road = self.section, self.road
        starts = [*(item.s for item in road.geometries), *road.offset.rows[:, 0]]
        starts += [section.start + row[0] for lane in section.lanes.values() for row in lane.width.rows]
        ends = sorted({section.start, section.end, *(start for start in starts if section.start + _CUT_M < start < section.end - _CUT_M)})
        cells = [np.linspace(lo, hi, max(1, int(np.ceil((hi - lo) / _SPACING_M))) + 1) for lo, hi in pairwise(ends)]
        s = np.unique(np.concatenate(cells))
        s[-1] -= 2.0 * SAME_M  # still in the section
        return self._at(s)

    def _at(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the lines at arclengths ``s`` of the road; see ``lines``."""
        t = self.offsets(s)
        here = self.road.reference(s)
        normal = np.stack([-np.sin(here.heading), np.cos(here.heading)], axis=1)
        points: FloatArray = np.stack([here.x, here.y], axis=1) + t[:, 0, :, None] * normal
        (offset, slope, bend), stretch = t[0], 1.0 - here.curvature * t[0, 0]
        heading = here.heading + np.arctan2(slope, stretch)
        turned = stretch * (here.curvature * stretch + bend) + slope * (here.sharpness * offset + 2.0 * here.curvature * slope)
        curvature = turned / np.hypot(stretch, slope) ** 3
        if self.forward:
            return points, heading, curvature
        return points[[0, 2, 1], ::-1], heading[::-1] + np.pi, -curvature[::-1]

    def offsets(self, s: FloatArray) -> FloatArray:
        """Return t of the middle, and of the edges left and right of it, with two derivatives at ``s``; shape (3, 3, n)."""
        if self.lane:
            inner, outer = self.road.edges(self.section, self.lane, s)
            return np.stack([0.5 * (inner + outer), *((outer, inner) if self.lane > 0 else (inner, outer))])
        sides = [self.road.edges(self.section, lane, s)[1] if lane else self.road.offset.at(s) for lane in _outermost(self.section)]
        return np.stack([np.zeros_like(sides[0]), *sides])

    def at_end(self, *, first: bool) -> bool:
        """Tell whether it is the first piece of its road in its driving direction, or the last."""
        return self.section is self.road.sections[0 if first is self.forward else -1]

    def ends(self) -> tuple[FloatArray, FloatArray]:
        """Return x, y, heading where the middle begins and where it ends in its driving direction."""
        points, heading, _ = self._at(np.array([self.section.start, self.section.end - 2.0 * SAME_M]))
        return np.append(points[0, 0], heading[0]), np.append(points[0, -1], heading[-1])


@dataclass(frozen=True)
class _Stop:
    """A road that the user wants driven, and in which direction if that was said."""

    road: str
    forward: bool | None

    def holds(self, piece: _Piece) -> bool:
        return piece.road.number == self.road and self.forward in {None, piece.forward}


def read_opendrive(path: Path, *, road_ids: str | Sequence[str] | None, lane: int | None) -> RawRoad:
    """Return the lanes along a route in an OpenDRIVE file: their middle, and their edges beside it.

    ``road_ids`` are the roads to drive over, one by one or separated by commas; a minus sign drives one from its end. Between roads that
    do not meet, the shortest way is taken. ``lane`` is the lane on the first road, without which the outermost one that
    leads there is taken; 0 drives along the reference lines themselves, between the outermost lanes' edges.

    Raises:
        RoadError: the file cannot be used, or has no such roads, lanes or way.

    """
    name = path.name
    roads, projection, notes = read_roads(path)
    stops = _stops(roads, road_ids, name)
    pieces = _pieces(roads, reference=lane == 0)
    with np.errstate(all="ignore"):  # what is not finite is refused
        route = _route(pieces, stops, lane, name)
        length = sum(piece.section.end - piece.section.start for piece in route)
        if length > LONGEST_M:
            msg = f"{name}: the way is {1e-3 * length:.0f} km long; at most {1e-3 * LONGEST_M:.0f} km are driven"
            raise RoadError(msg, hint="choose a part of it with --road-ids")
        lines = [piece.lines() for piece in route]
    points, heading, curvature = (np.concatenate([line[part] for line in lines], axis=axis) for part, axis in ((0, 1), (1, 0), (2, 0)))
    if not all(np.all(np.isfinite(values)) for values in (points, heading, curvature)):
        msg = f"{name}: a lane on the way has no direction somewhere: it passes through the centre of a bend, or its curve stands still"
        raise RoadError(msg, hint="choose other roads or another lane with --road-ids and --lane")
    middle = points[0]
    entered = [piece for before, piece in zip([None, *route], route, strict=False) if before is None or before.road is not piece.road]
    driven = ", ".join(f"{'' if piece.forward else '-'}{piece.road.number} lane {piece.lane}" for piece in entered)
    notes = (f"{name}: over roads {driven}", *notes)
    raw = RawRoad(middle, sides=points[1:], rounded=rounded(middle, heading, curvature), notes=notes)
    if projection is None or any(words in projection for words in _NOWHERE):
        return raw
    return replace(raw, to_lonlat=placed(middle, projection.strip()).to_lonlat)


def _stops(roads: dict[str, OdrRoad], road_ids: str | Sequence[str] | None, name: str) -> list[_Stop]:
    if road_ids is None:
        if len(roads) == 1:
            return [_Stop(next(iter(roads)), None)]
        longest = sorted(roads.values(), key=lambda road: -road.length)
        listed = some_of([f"{road.number} ({road.length:.0f} m)" for road in longest], _LISTED)
        msg = f"{name}: {len(roads)} roads, and none is chosen; the longest are {listed}"
        raise RoadError(msg, hint="choose where to drive, such as with --road-ids FROM,TO of `hdvplan plan`")
    stops = []
    for text in ids_of(road_ids):
        forward = False if text.startswith("-") and text not in roads else None
        number = text if text in roads else text.removeprefix("-")
        if number not in roads:
            msg = f"{name}: no road has the id {number!r}; there are {some_of(roads, _LISTED)}"
            raise RoadError(msg)
        stops.append(_Stop(number, forward))
    return stops


def _outermost(section: Section) -> tuple[int, int]:
    """Return the outermost driven lanes of a section, on the left and on the right; 0 on a side without any."""
    driven = [number for number, lane in section.lanes.items() if lane.kind in DRIVEN]
    return max([0, *driven]), min([0, *driven])


def _pieces(roads: dict[str, OdrRoad], *, reference: bool) -> list[_Piece]:
    """Return every driven lane in every section, or with ``reference`` the reference lines both ways."""
    found: list[_Piece] = []
    for road in roads.values():
        for section in road.sections:
            if reference:
                found += [_Piece(road, section, 0, forward) for forward in (True, False) if any(_outermost(section))]
            else:
                driven = [number for number, lane in section.lanes.items() if number and lane.kind in DRIVEN]
                found += [_Piece(road, section, number, (number < 0) != road.left_hand) for number in driven]
    return found


def _route(pieces: list[_Piece], stops: list[_Stop], lane: int | None, name: str) -> list[_Piece]:
    """Return the lanes that lead from the start of the first stop to the end of the last one."""
    starts = [piece for piece in pieces if stops[0].holds(piece) and piece.at_end(first=True)]
    wanted = [piece for piece in starts if lane is None or piece.lane == lane]
    if not wanted:
        there = f"; there are {', '.join(str(piece.lane) for piece in starts)}" if starts else " that is driven this way"
        msg = f"{name}: road {stops[0].road} has no lane{'' if lane is None else f' {lane}'}{there}"
        raise RoadError(msg)
    after = _continuations(pieces)
    for start in sorted(wanted, key=lambda piece: (not piece.forward if len(stops) == 1 else False, -abs(piece.lane))):
        route = _shortest(pieces, after, start, stops)
        if route is not None:
            return route
    ids = ", ".join(stop.road for stop in stops)
    msg = f"{name}: no lane leads over roads {ids} in this order"
    raise RoadError(msg, hint="a minus sign drives a road from its end; lanes are not changed on the way")


def _continuations(pieces: list[_Piece]) -> list[list[int]]:
    """Return for each piece the numbers of those that begin where it ends."""
    ends = [piece.ends() for piece in pieces]
    starts = np.array([start for start, _ in ends])
    found = []
    for number, (_, end) in enumerate(ends):
        apart = np.hypot(*(starts[:, :2] - end[:2]).T)
        turn = np.abs(wrapped(starts[:, 2] - end[2]))
        near = np.flatnonzero((apart <= _LINKED_M) & (turn <= _MEET_TURN)).tolist()
        found.append([other for other in near if other != number and (apart[other] <= _MEET_M or _goes_on(pieces[number], pieces[other]))])
    return found


def _goes_on(piece: _Piece, other: _Piece) -> bool:
    """Tell whether the file says that a lane goes on in one of the road's next section."""
    if other.road is not piece.road or other.forward is not piece.forward:
        return False
    if other.section.start != piece.section.end if piece.forward else other.section.end != piece.section.start:
        return False
    if piece.lane == 0:
        return True
    lane = piece.section.lanes[piece.lane]
    return other.lane == (lane.after if piece.forward else lane.before)


def _shortest(pieces: list[_Piece], after: list[list[int]], start: _Piece, stops: list[_Stop]) -> list[_Piece] | None:
    """Return the shortest chain of pieces from ``start`` over all stops (Dijkstra), None without any."""
    first: tuple[float, int, int, tuple[int, ...]] = (0.0, pieces.index(start), 1, (pieces.index(start),))
    queue = [first]
    done: set[tuple[int, int]] = set()
    while queue:
        length, number, passed, chain = heapq.heappop(queue)
        piece = pieces[number]
        if passed == len(stops) and stops[-1].holds(piece) and piece.at_end(first=False):
            return [pieces[index] for index in chain]
        if (number, passed) in done:
            continue
        done.add((number, passed))
        for index in after[number]:
            other = pieces[index]
            enters = other.road is not piece.road and passed < len(stops) and stops[passed].holds(other)
            cost = length + other.section.end - other.section.start
            heapq.heappush(queue, (cost, index, passed + enters, (*chain, index)))
    return None
