"""The street's kerbs as lines of a drawing, what was swept beyond them, and what is swept when the driver strays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import BoolArray, FloatArray
from hdvplan.judging.balance import Breach
from hdvplan.judging.bodies import corners, judged_to, swept_pieces, united
from hdvplan.judging.result import Result
from hdvplan.judging.straying import BRUSH, SPACING_M, Posed, Tracked, chain_of
from hdvplan.road.passages import without_walls
from hdvplan.road.road import Road

SIMPLER_M = 2.5e-4  # lines leave out points that would move them by no more
_NEAR_M = 3.0  # from what was swept, on a road without widths
_FURTHER_M = 0.05  # beyond a kerb than the depth of its breach
_BESIDE_M = 1.0  # of a conflict, along the kerb: there what was swept is within it again
_SEEN_M = 0.005  # of the driver's error: less is told as 0.00 m
_TEETH_M = 0.3  # between the outlines of two poses: filled, which shows no less than the bound


class KerbLine(NamedTuple):
    """A kerb in the plane [m]: its side, the region of a limit that it bounds, and whether it binds ``wheels`` or ``overhangs``.

    Where it is ``bridged`` it was not drawn, but taken as straight.
    """

    side: str
    region: str
    binds: str
    line: shapely.LineString
    bridged: bool = False


def kerb_lines(road: Road, s_from: float, s_to: float, *, walls: bool = True) -> list[KerbLine]:
    """Return the kerbs beside a stretch of a road [m], those on the left first, with the ``walls`` that close what is behind islands."""
    street = road.kerbs
    if street is None:
        return []
    if not walls:
        faces = {id(face) for face in road.passed}
        street = replace(street, kerbs=tuple(without_walls(kerb) if id(kerb) in faces else kerb for kerb in street.kerbs))
    found = []
    for kerb in street.beside(s_from, s_to):
        named = ("sweepable", "overhangs") if street.two_regions and not kerb.wheels else ("drivable", "wheels")
        found.append(KerbLine("left" if kerb.left else "right", *named, simple_line(kerb.points)))
    return sorted(found, key=lambda one: (one.side, one.region))


def simple_line(points: FloatArray, off: float = SIMPLER_M) -> shapely.LineString:
    """Return a line without the points whose absence moves it by no more than ``off`` [m]."""
    line = shapely.simplify(shapely.LineString(points), off, preserve_topology=False)
    assert isinstance(line, shapely.LineString)  # noqa: S101 - a line stays one
    return line


def shown_kerbs(result: Result) -> list[KerbLine]:
    """Return the kerbs that a drawing shows, as far as they are judged: without widths only what is near the drive.

    Those of overhangs are shown where wheels have others.
    """
    road = result.drive.road
    every = kerb_lines(road, *judged_stretch(result, 0.0, np.inf), walls=False)
    of_wheels = [one for one in every if one.binds == "wheels"]
    found = _less([one for one in every if one.binds == "overhangs"], [one.line for one in of_wheels])
    found = sorted(of_wheels + found, key=lambda one: one.side)
    if road.bridges:
        bridges = _around(road.bridges)
        found = _less(found, road.bridges) + [one._replace(bridged=True) for one in _parts(found, lambda line: line & bridges)]
    if road.limits is not None:
        return found
    path = road.path
    centre = shapely.LineString(np.column_stack(path.to_plane(np.linspace(0.0, path.length, max(2, int(path.length))), 0.0)))
    near = shapely.buffer(centre, result.balance.half_width + _NEAR_M)
    return _parts(found, lambda line: line & near)


def _less(kerbs: list[KerbLine], hidden: Iterable[FloatArray | shapely.LineString]) -> list[KerbLine]:
    area = _around(hidden)
    return _parts(kerbs, lambda line: line - area)


def _around(lines: Iterable[FloatArray | shapely.LineString]) -> BaseGeometry:
    return shapely.buffer(shapely.MultiLineString(list(lines)), SIMPLER_M)


def _parts(kerbs: list[KerbLine], cut: Callable[[shapely.LineString], BaseGeometry]) -> list[KerbLine]:
    """Return the lines that ``cut`` leaves of each kerb."""
    parts = ((one, part) for one in kerbs for part in shapely.get_parts(cut(one.line)))
    return [one._replace(line=part) for one, part in parts if isinstance(part, shapely.LineString) and not part.is_empty]


def judged_stretch(result: Result, s_from: float, s_to: float) -> tuple[float, float]:
    """Return a stretch of the road; from or to an open one's end as far beyond as bodies were judged there [m]."""
    drive, vehicle, path = result.drive, result.drive.vehicle, result.drive.road.path
    if path.closed:
        return max(s_from, 0.0), min(s_to, path.length)
    low, high = float(drive.poses_s[0]) - vehicle.reach_behind, min(float(drive.poses_s[-1]), judged_to(drive)) + vehicle.reach_ahead
    return low if s_from <= 0.0 else s_from, high if s_to >= path.length else s_to


def beyond_kerb(result: Result, breach: Breach) -> BaseGeometry:
    """Return the area that was swept beyond a kerb where it is broken [m]."""
    points = shapely.get_coordinates(broken_kerb(result, breach, _BESIDE_M))
    step = np.diff(points, axis=0)
    across = np.stack([-step[:, 1], step[:, 0]], axis=1) / np.hypot(*step.T)[:, None]
    out = (breach.depth + _FURTHER_M) * (across if breach.side == "left" else -across)
    strips = np.stack([points[:-1], points[1:], points[1:] + out, points[:-1] + out], axis=1)
    wedges = np.stack([points[1:-1], points[1:-1] + out[:-1], points[1:-1] + out[1:]], axis=1)
    outside = shapely.union_all(np.concatenate([np.asarray(shapely.polygons(strips)), np.asarray(shapely.polygons(wedges))]))
    swept = _swept(result, breach)
    return shapely.intersection(shapely.union_all(swept[shapely.intersects(swept, outside)]), outside)


def broken_kerb(result: Result, breach: Breach, beside: float) -> shapely.LineString:
    """Return the part of a kerb that is broken, and ``beside`` it so much more of the line [m]."""
    near = kerb_lines(result.drive.road, breach.s_from - beside, breach.s_to + beside)
    own = [one.line for one in near if (one.side, one.region) == (breach.side, breach.region)]
    return min(own, key=shapely.Point(breach.place).distance)


def _swept(result: Result, breach: Breach) -> NDArray[np.object_]:
    """Return what bodies, or what lies between their axles, swept around a breach, in pieces."""
    drive, vehicle, path = result.drive, result.drive.vehicle, result.drive.road.path
    middle, half = 0.5 * (breach.s_from + breach.s_to), 0.5 * (breach.s_to - breach.s_from)
    apart = drive.poses_s - middle
    apart = apart - path.length * np.round(apart / path.length) if path.closed else apart
    near = np.flatnonzero(np.abs(apart) <= half + vehicle.reach_ahead + vehicle.reach_behind)
    wheels = result.two_regions and breach.region == "drivable"
    following = np.split(near, np.flatnonzero(np.diff(near) > 1) + 1)
    return np.concatenate([swept_pieces(corners(drive, poses, axles_only=wheels)) for poses in following])


def tubes_of(result: Result, stretches: Sequence[tuple[float, float]]) -> list[BaseGeometry]:
    """Return what bodies sweep at most with the largest tracking error, in the plane, for each stretch; nothing where the plan allows none.

    The lead axle is between the two arclengths of a stretch then [m]. Each corner of a body is moved to either side as far as the bound
    lets it.
    """
    tracking = result.tracking
    if tracking is None or not tracking.error > _SEEN_M:
        return []
    chain = chain_of(result.drive)
    tracked = Tracked(chain.vehicle.table(), chain.links, tracking.length)
    s, poses, front = chain.posed
    within: list[BoolArray] = [(s >= s_from) & (s <= s_to) for s_from, s_to in stretches]
    shown = np.flatnonzero(np.any(within, axis=0))  # at fewer poses, what front corners sweep has teeth
    tracked.bounded(tracking.error)
    tracked.follow(front[shown])
    outlines = _outlines(tracked, Posed(s[shown], poses[shown], front[shown]))
    return [united(outlines[one[shown]]).buffer(_TEETH_M).buffer(-_TEETH_M) for one in within]


def _outlines(tracked: Tracked, posed: Posed) -> NDArray[np.object_]:
    """Return the outlines of all bodies at some poses, with what they may stray, (poses, units)."""
    error = float(tracked.record["error"][0])
    found: list[NDArray[np.object_]] = []
    off = tracked.links["axle_off"][np.minimum((posed.front / SPACING_M).astype(int), len(tracked.links) - 1)]
    for number, unit in enumerate(tracked.units):
        pose, corners = posed.poses[:, number], []
        for ahead, side in ((unit["front"], 1.0), (unit["front"], -1.0), (-unit["rear_overhang"], -1.0), (-unit["rear_overhang"], 1.0)):
            brushes = np.zeros(len(pose), BRUSH)
            brushes["at"], brushes["by_axle"], brushes["by_heading"] = posed.front, side * np.cos(off[:, number]), side * ahead
            brushes["second"], brushes["unit"] = unit["half_width"], number
            gain, remainder = tracked.approaches(brushes)
            left = side * (unit["half_width"] + error * gain + remainder)
            corners.append([pose["x"] + ahead * pose["cos"] - left * pose["sin"], pose["y"] + ahead * pose["sin"] + left * pose["cos"]])
        found.append(np.atleast_1d(np.asarray(shapely.polygons(np.moveaxis(np.array(corners), -1, 0)))))
    return np.stack(found, axis=1)
