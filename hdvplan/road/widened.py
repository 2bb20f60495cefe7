"""Sweepable areas that join a street: overhangs may cross the kerb there, and what bounds them lies beyond."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import shapely

from hdvplan.arrays import FloatArray
from hdvplan.road.passages import Line, face_of
from hdvplan.road.pieces import Kerb
from hdvplan.road.regions import OPEN_M, Side
from hdvplan.road.street import BEYOND_M, Street

GAP_M = 0.1  # a sweepable polygon this close to a kerb joins it: drawn edges are chords of a bend
_BESIDE_M = 5.0  # of the kerb before and beyond a polygon, where it is as it was
_SAME_M = 1e-3  # closing leaves out vertices within 1 % of its distance, 0.5 mm, both out and in, and corners beside them move
_LEAST_M2 = 1e-4  # an area within a widened street that is smaller is no obstacle


def widened(line: Line, street: Street, areas: list[shapely.Polygon]) -> tuple[Kerb, ...]:
    """Return a street's kerbs with those of bodies moved out around the sweepable areas that join it, and those of wheels as they were."""
    bodies = [kerb for kerb in street.kerbs if not kerb.wheels]
    wheels = [kerb for kerb in street.kerbs if kerb.wheels] or [replace(kerb, wheels=True) for kerb in bodies]
    area = _closed(shapely.union_all(areas))
    found = [kerb for body in bodies for kerb in _moved_out(line, street, body, area)]
    return (*found, *wheels)


def _closed(area: shapely.Geometry) -> shapely.Geometry:
    return shapely.buffer(shapely.buffer(area, 0.5 * GAP_M, join_style="mitre"), -0.5 * GAP_M, join_style="mitre")


def _moved_out(line: Line, street: Street, kerb: Kerb, area: shapely.Geometry) -> Iterator[Kerb]:
    """Yield a kerb as it goes around an area that joins it, and the edges of what that leaves free within."""
    side = Side.RIGHT if kerb.left else Side.LEFT
    left = _beyond_ring(line, kerb, area) if line.path.closed else []
    if left:
        for polygon in left:
            yield from face_of(line, polygon, side, street)
        return
    parts = []
    for s_from, s_to in _stretches(line, street, kerb, area):
        part, centre = street.part(kerb, s_from, s_to), line.between(s_from, s_to)
        inner = shapely.buffer(line.between(s_from + _BESIDE_M, s_to - _BESIDE_M), OPEN_M, cap_style="flat")
        whole = _joined(centre, part, shapely.intersection(area, inner))
        points = None if whole is None else _outer(whole, part)
        if whole is None or points is None:
            continue
        s = line.beside(points, s_from, s_to)
        s[0], s[-1] = s_from, s_to
        parts.append(replace(part, points=points, s=s))
        for hole in whole.interiors:
            if shapely.Polygon(hole).area > _LEAST_M2:
                yield from face_of(line, shapely.Polygon(hole), side, street)
    yield street.replaced(kerb, parts) if parts else kerb


def _stretches(line: Line, street: Street, kerb: Kerb, area: shapely.Geometry) -> list[tuple[float, float]]:
    """Return the stretches of the line beside which parts of an area join a kerb, in order and apart [m]."""
    found: list[tuple[float, float]] = []
    for polygon in shapely.get_parts(area):
        for arm in line.arms(polygon):
            s_from, s_to = float(np.min(arm.s)) - _BESIDE_M, float(np.max(arm.s)) + _BESIDE_M
            if not line.path.closed:
                s_from, s_to = max(s_from, -BEYOND_M), min(s_to, line.path.length + BEYOND_M)
            elif s_to - s_from >= line.path.length:
                continue  # all around: see ``_beyond_ring``
            part = street.part(kerb, s_from, s_to)
            if len(part.points) > 1 and shapely.distance(shapely.LineString(part.points), polygon) <= GAP_M:
                found.append((s_from, s_to))
    merged: list[tuple[float, float]] = []
    for s_from, s_to in sorted(found):
        if merged and s_from <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(merged[-1][1], s_to))
        else:
            merged.append((s_from, s_to))
    return merged


def _beyond_ring(line: Line, kerb: Kerb, area: shapely.Geometry) -> list[shapely.Polygon]:
    """Return what is left inside of a closed road where an area joins all of its inner kerb, as a truck apron does."""
    centre, within = shapely.Polygon(shapely.get_coordinates(line.between(0.0, line.path.length))), shapely.Polygon(kerb.points)
    if not (within.is_valid and shapely.covers(centre, within) and shapely.covers(shapely.buffer(area, GAP_M), shapely.boundary(within))):
        return []
    whole = _closed(shapely.union(shapely.difference(centre, within), shapely.intersection(area, centre)))
    return [shapely.Polygon(hole) for part in shapely.get_parts(whole) for hole in part.interiors]


def _joined(centre: shapely.LineString, part: Kerb, area: shapely.Geometry) -> shapely.Polygon | None:
    """Return what lies between the line and a kerb together with the area that joins it; None where the kerb crosses the line."""
    between = shapely.Polygon(np.concatenate([shapely.get_coordinates(centre), part.points[::-1]]))
    if not between.is_valid:
        return None
    outside = shapely.difference(area, between)  # what lies within is no room more
    whole = _closed(shapely.union(between, outside))
    parts = [one for one in shapely.get_parts(whole) if shapely.dwithin(one, centre, _SAME_M)]
    return shapely.geometry.polygon.orient(parts[0], -1.0 if part.left else 1.0) if len(parts) == 1 else None


def _outer(whole: shapely.Polygon, part: Kerb) -> FloatArray | None:
    """Return the boundary of an area from a kerb's first point to its last, not along the line; None where those were covered."""
    ring = np.asarray(whole.exterior.coords)[:-1]
    ends = [int(np.argmin(np.hypot(*(ring - end).T))) for end in (part.points[0], part.points[-1])]
    if any(np.hypot(*(ring[at] - end)) > _SAME_M for at, end in zip(ends, (part.points[0], part.points[-1]), strict=True)):
        return None
    count = (ends[1] - ends[0]) % len(ring)
    between = ring[(ends[0] + np.arange(1, count)) % len(ring)]
    return np.concatenate([part.points[:1], between, part.points[-1:]])
