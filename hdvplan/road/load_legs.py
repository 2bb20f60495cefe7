"""Make the legs of a drive from their lines as drawn: smoothed, directed as the vehicle heads, joined at the cusps, each in its street.

What is drawn beside the lines bounds every leg, in the plane: edges are walls, and nothing that lies across the straight continuation of a
leg's line is passed on one side of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import shapely

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError
from hdvplan.road.joints import SAME_M, joined
from hdvplan.road.legs import Leg, Legs
from hdvplan.road.line import Line, RawLeg, RawRoad, is_closed, smoothed
from hdvplan.road.options import RoadOptions
from hdvplan.road.passages import Line as Axis
from hdvplan.road.regions import Kind, Region

LeadLine = Callable[[FloatArray, RoadOptions], FloatArray]  # of the line of the last axle (n, 2) [m], as the vehicle heads

LEAD_GAP_M = 1.0  # between the end of a leg and where a line of the last axle leads the first one: such lines are a hint
_WALL_M = 0.05  # as thick is an edge, on its side away from the lines
_CUT_M = 1e-3  # half the width of the gap in a wall across a line's continuation: no body passes it
_AREA_M = 0.1  # a sweepable area this close to an edge joins it
_BESIDE = {"offset": "--offset", "reverse": "--reverse"}


def legs_of(line: Line, lead_line: LeadLine | None = None) -> Legs:
    """Return the legs that a file holds; with ``lead_line`` the lines driven backwards are the last axle's, from which that leads.

    Raises:
        RoadError: the file holds no legs, a leg that cannot be smoothed, legs that do not meet, an edge across a leg, or an option that
            has no meaning for legs.

    """
    raw, options = line.raw, line.options
    if not raw.legs:
        msg = f"{line.name} holds a road, and no legs"
        raise RoadError(msg, hint='legs have the properties "leg" and "direction", or a column direction with 1 and -1')
    given = next((option for name, option in _BESIDE.items() if getattr(options, name)), None)
    if given is not None:
        msg = f"{line.name}: a drive of several legs has no use for {given}"
        raise RoadError(msg, hint=f"leave {given} out")
    legs = tuple(_leg(line, number, one, lead_line) for number, one in enumerate(raw.legs, start=1))
    try:
        legs, notes = joined(legs, SAME_M if lead_line is None else LEAD_GAP_M)
    except RoadError as error:
        raise _of(line.name, error) from error
    lines = shapely.union_all([Axis.of(leg.road.path).own for leg in legs])
    regions = (*raw.regions, *_walls(raw, lines, line.name))
    return Legs(line.name, tuple(within(leg, regions) for leg in legs), (*raw.notes, *(f"{line.name}: {note}" for note in notes)), regions)


def _leg(line: Line, number: int, given: RawLeg, lead_line: LeadLine | None) -> Leg:
    """Return a leg in its widths alone."""
    raw, name = given.raw, f"{line.name}, leg {number}"
    if given.backward:
        raw = _turned(raw)
    try:
        if given.backward and lead_line is not None:
            raw = _led(raw, lead_line, line.options)
        _refuse_closed(raw)
        road, _ = smoothed(Line(name, raw, line.options))
    except RoadError as error:
        raise _of(name, error) from error
    return Leg(road, given.backward)


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
    """Return a line drawn the other way."""
    reaches = None if raw.reaches is None else raw.reaches[[1, 0, 3, 2], ::-1]
    return replace(raw, points=raw.points[::-1], reaches=reaches, lines=None if raw.lines is None else raw.lines[::-1])


def _walls(raw: RawRoad, lines: shapely.Geometry, name: str) -> list[Region]:
    """Return the drawn edges as obstacles; where a sweepable area joins one, its own edge stands in its stead.

    Raises:
        RoadError: an edge crosses a leg's line.

    """
    edges = [shapely.LineString(edge) for edge in raw.edges]
    for edge in edges:
        if shapely.intersects(edge, lines):
            x, y = shapely.get_coordinates(shapely.intersection(edge, lines))[0]
            msg = f"{name}: a line that is drawn as an edge crosses the line of a leg at x {x:.1f}, y {y:.1f}: it would close the street"
            raise RoadError(msg, hint="take it out of the edges, or break it there")
    sweepable = [region.polygon for region in raw.regions if region.kind is Kind.SWEEPABLE]
    areas = [area for area in sweepable if np.any(shapely.dwithin(area, edges, _AREA_M))]
    there, drawn = (shapely.buffer(shapely.union_all(one), _AREA_M) for one in (areas, edges))
    found = [(shapely.difference(edge, there) if areas else edge, name) for edge, name in zip(edges, raw.edge_names, strict=True)]
    found += [(shapely.difference(shapely.boundary(area), drawn), "") for area in areas]
    parts = [(part, name) for line, name in found for part in shapely.get_parts(line) if shapely.length(part) > _CUT_M]
    return [Region(Kind.OBSTACLE, area, name or "edge") for part, name in parts for area in shapely.get_parts(_thick(part, lines)).tolist()]


def _thick(edge: shapely.LineString, lines: shapely.Geometry) -> shapely.Geometry:
    """Return an edge as thin as a wall: on the side of it that lies away from the lines of the legs."""
    if edge.is_ring:
        area = shapely.Polygon(edge)
        return shapely.difference(shapely.buffer(area, _WALL_M), area) if shapely.contains(area, lines) else area
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
        parts = shapely.get_parts(shapely.difference(region.polygon, cut)) if across else [region.polygon]
        found += [replace(region, polygon=part) for part in parts if isinstance(part, shapely.Polygon) and not part.is_empty]
    return replace(leg, road=replace(leg.road, regions=tuple(found)))
