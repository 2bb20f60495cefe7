"""Make the legs of a drive from their lines as drawn: smoothed, directed as the vehicle heads, joined at the cusps, each in its street.

What is drawn beside the lines bounds every leg, in the plane: edges are walls, and nothing that lies across the straight continuation of a
leg's line is passed on one side of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
import shapely
import shapely.affinity

from hdvplan.arrays import FloatArray, end_ways
from hdvplan.errors import RoadError
from hdvplan.road.joints import joined
from hdvplan.road.legs import SAME_M, SHORTEST_M, Leg, Legs
from hdvplan.road.line import Line, RawLeg, RawRoad, is_closed, smoothed
from hdvplan.road.options import RoadOptions
from hdvplan.road.passages import Line as Axis
from hdvplan.road.regions import EDGE, OPEN_M, Edge, Kind, Region, polygons_of, refuse_elsewhere

LeadLine = Callable[[FloatArray, RoadOptions], FloatArray]  # of the line of the last axle (n, 2) [m], as the vehicle heads

LEAD_GAP_M = 1.0  # between the end of a leg and where a line of the last axle leads the first one: such lines are a hint
_NEAR_M = (0.1, 0.5)  # to which the last axle's lines are smoothed, if they can be
_SMOOTHED_FIRST = f"the last axle's lines are smoothed first: without --smooth, or with {_NEAR_M[0]:g}, they may lead there"
_WALL_M = 0.05  # as thick is an edge that parts nothing, on its side away from the lines
_CUT_M = 1e-3  # half the width of the gap in a wall across a line's continuation: no body passes it
_SLIVER_M2 = 1e-3  # of parts of a place: what rounding leaves along edges is smaller
_AREA_M = 0.1  # a sweepable area this close to an edge joins it
_BESIDE = {"offset": "--offset", "reverse": "--reverse"}


def legs_of(line: Line, lead_line: LeadLine | None = None) -> Legs:
    """Return the legs that a file holds; with ``lead_line`` the lines driven backwards are the last axle's, from which that leads.

    Raises:
        RoadError: the file holds no legs, a leg that cannot be smoothed, legs that do not meet, an edge across a leg, or an option that
            has no meaning for legs, or regions that are all elsewhere.

    """
    raw, options = line.raw, line.options
    if not raw.legs:
        msg = f"{line.name} holds a road, and no legs"
        raise RoadError(msg, hint='legs have the properties "leg" and "direction", or a column direction with 1 and -1')
    given = next((option for name, option in _BESIDE.items() if getattr(options, name)), None)
    if given is not None:
        msg = f"{line.name}: a drive of several legs has no use for {given}"
        raise RoadError(msg, hint=f"leave {given} out")
    legs, notes = _met(line, lead_line)
    refuse_elsewhere(raw.regions, legs[0].road.path)
    regions = (*raw.regions, *_beyond_edges(raw, legs, line.name))
    return Legs(line.name, tuple(within(leg, regions) for leg in legs), (*raw.notes, *(f"{line.name}: {note}" for note in notes)), regions)


def _met(line: Line, lead_line: LeadLine | None) -> tuple[tuple[Leg, ...], tuple[str, ...]]:
    """Return all legs in their widths alone, and notes on how they were moved to meet.

    A last axle's line leads the lead axle to where it is drawn only if it is hardly smoothed: that is tried first where nobody says more.
    """
    if lead_line is not None and line.options.smooth is None:
        for smooth in _NEAR_M:
            with suppress(RoadError):
                return _met(replace(line, options=replace(line.options, smooth=smooth)), lead_line)
    legs = tuple(_leg(line, number, one, lead_line) for number, one in enumerate(line.raw.legs, start=1))
    try:
        return joined(legs, SAME_M if lead_line is None else LEAD_GAP_M)
    except RoadError as error:
        ours = lead_line is None or line.options.smooth is None
        raise _of(line.name, error if ours else RoadError(str(error), hint=_SMOOTHED_FIRST)) from error


def _leg(line: Line, number: int, given: RawLeg, lead_line: LeadLine | None) -> Leg:
    """Return a leg in its widths alone."""
    raw, name = given.raw, f"{line.name}, leg {number}"
    if given.backward:
        raw = _turned(raw)
    try:
        if given.backward and lead_line is not None:
            raw = _led(raw, lead_line, line.options)
        _refuse_closed(raw)
        road, _ = smoothed(Line(name, raw, line.options), SHORTEST_M)
    except RoadError as error:
        raise _of(name, error) from error
    if not given.backward or lead_line is None:
        return Leg(road, given.backward)
    (x, y), (ahead, across) = given.raw.points[-1].tolist(), -end_ways(given.raw.points)[1]
    return Leg(road, given.backward, (x, y, float(np.arctan2(across, ahead))))


def _led(raw: RawRoad, lead_line: LeadLine, options: RoadOptions) -> RawRoad:
    """Return the lead axle's line for one of the last axle."""
    if raw.reaches is not None:
        msg = "widths count from the line of the lead axle, and this one is the last axle's"
        raise RoadError(msg, hint="draw edges, or take the widths out of the file")
    return replace(raw, points=lead_line(raw.points, options), lines=None)


def _refuse_closed(raw: RawRoad) -> None:
    if is_closed(raw.points):
        msg = "it ends where it begins"
        raise RoadError(msg, hint="a leg leads from one cusp to the next")


def _of(name: str, error: RoadError) -> RoadError:
    """Return a refusal that begins with what it is of."""
    text = str(error).removeprefix(f"{name}: ")
    return RoadError(f"{name}: {text}", s_m=error.s_m, hint=error.hint)


def _turned(raw: RawRoad) -> RawRoad:
    reaches = None if raw.reaches is None else raw.reaches[[1, 0, 3, 2], ::-1]
    return replace(raw, points=raw.points[::-1], reaches=reaches, lines=None if raw.lines is None else raw.lines[::-1])


def _beyond_edges(raw: RawRoad, legs: tuple[Leg, ...], name: str) -> list[Region]:
    """Return what the drawn edges part from the legs' lines, as obstacles; an edge that parts nothing, because it ends, is a thin wall.

    Before the first leg and beyond the last one edges may end. Sweepable areas that join an edge belong to the street.

    Raises:
        RoadError: an edge crosses a leg's line.

    """
    named = [Edge(label or EDGE, shapely.LineString(edge)) for edge, label in zip(raw.edges, raw.edge_names, strict=True)]
    edges = [edge.line for edge in named]
    lines = shapely.union_all([Axis.of(leg.road.path).own for leg in legs])
    _refuse_closing(edges, lines, name)
    sweepable = [region.polygon for region in raw.regions if region.kind is Kind.SWEEPABLE]
    areas = shapely.union_all([area for area in sweepable if np.any(shapely.dwithin(area, edges, _AREA_M))])
    place = shapely.buffer(lines, OPEN_M)
    driven = shapely.difference(place, shapely.union(_open_at(legs[0], 0), _open_at(legs[-1], 1)))
    parted, found = shapely.union_all([face for one in (place, driven) for face in _parted(edges, one, lines)]), list[Region]()
    for face in polygons_of(parted):
        beside = tuple(edge for edge in named if shapely.dwithin(edge.line, face, SAME_M))
        label = ", ".join(dict.fromkeys(edge.label for edge in beside))
        found += [Region(Kind.OBSTACLE, part, label, edges=beside) for part in polygons_of(_without(face, areas))]
    for edge in named:
        ends = shapely.difference(shapely.intersection(edge.line, place), shapely.buffer(shapely.union(parted, areas), SAME_M))
        walls = [wall for part in shapely.get_parts(ends) if shapely.length(part) > SAME_M for wall in polygons_of(_thick(part, lines))]
        found += [Region(Kind.OBSTACLE, wall, edge.label, edges=(edge,)) for wall in walls]
    return found


def _parted(edges: Sequence[shapely.LineString], place: shapely.Geometry, lines: shapely.Geometry) -> list[shapely.Geometry]:
    """Return the parts of a place that edges part from the lines; edges that end within it part nothing."""
    faces = shapely.get_parts(shapely.polygonize([shapely.union_all([shapely.boundary(place), *edges])])).tolist()
    return [
        face
        for face in faces
        if shapely.area(face) > _SLIVER_M2 and shapely.within(shapely.point_on_surface(face), place) and not shapely.intersects(face, lines)
    ]


def _open_at(leg: Leg, which: int) -> shapely.Polygon:
    """Return the place before a leg's beginning (0), or beyond its end (1), where nobody need draw how the street goes on."""
    s = leg.ends[which]
    here = leg.road.path.at(s)
    x, y, back = float(here.x), float(here.y), s == 0.0
    square = shapely.box(x - OPEN_M if back else x, y - OPEN_M, x if back else x + OPEN_M, y + OPEN_M)
    turned: shapely.Polygon = shapely.affinity.rotate(square, float(here.heading), origin=(x, y), use_radians=True)
    return turned


def _refuse_closing(edges: Sequence[shapely.LineString], lines: shapely.Geometry, name: str) -> None:
    for edge in edges:
        if shapely.intersects(edge, lines):
            x, y = shapely.get_coordinates(shapely.intersection(edge, lines))[0]
            msg = f"{name}: a line that is drawn as an edge crosses the line of a leg at x {x:.1f}, y {y:.1f}: it would close the street"
            raise RoadError(msg, hint="take it out of the edges, or break it there")


def _without(face: shapely.Geometry, areas: shapely.Geometry) -> shapely.Geometry:
    """Return an area without others, and without the gaps between both that drawing leaves."""
    left = shapely.difference(face, areas)
    if not shapely.intersects(face, areas):
        return face
    return shapely.buffer(shapely.buffer(left, -0.5 * _AREA_M, join_style="mitre"), 0.5 * _AREA_M, join_style="mitre")


def _thick(edge: shapely.LineString, lines: shapely.Geometry) -> shapely.Geometry:
    """Return an edge as thin as a wall: on the side of it that lies away from the lines of the legs."""
    sides = [shapely.buffer(one, _WALL_M, single_sided=True, join_style="mitre") for one in (edge, shapely.reverse(edge))]
    return max(sides, key=lambda side: _away(side, edge, lines))


def _away(side: shapely.Geometry, edge: shapely.LineString, lines: shapely.Geometry) -> float:
    """Return how far from the lines the corners of one side of an edge lie on average, those on the edge itself left out [m]."""
    corners = np.asarray(shapely.points(shapely.get_coordinates(side)[:-1]))
    return float(np.mean(shapely.distance(corners[shapely.distance(corners, edge) > 0.5 * _WALL_M], lines)))


def within(leg: Leg, regions: tuple[Region, ...]) -> Leg:
    """Return a leg among obstacles; those across the continuation of its line are cut there, so that each part lies to one side of it."""
    axis = Axis.of(leg.road.path)
    beyond = shapely.difference(axis.endless, shapely.buffer(axis.own, _CUT_M))
    cut, found = shapely.buffer(beyond, _CUT_M, cap_style="flat"), list[Region]()
    for region in regions:
        across = shapely.intersects(region.polygon, beyond) and not shapely.intersects(region.polygon, axis.own)
        parts = polygons_of(shapely.difference(region.polygon, cut)) if across else [region.polygon]
        found += [replace(region, polygon=part) for part in parts]
    return replace(leg, road=replace(leg.road, regions=tuple(found)))
