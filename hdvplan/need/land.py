"""The land that a plan sweeps beyond kerbs, as areas between a kerb and where it moves to."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import BoolArray, FloatArray, Records, chord_of
from hdvplan.driving.drive import Drive
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.bodies import corners, united
from hdvplan.judging.clearance import Shapes
from hdvplan.judging.result import Result
from hdvplan.road.kerbs import kerb_of
from hdvplan.road.pieces import Kerb
from hdvplan.road.road import Road
from hdvplan.road.street import Street

_SHARP = 0.3  # turn of a kerb that is a corner [rad]
_FAR_M = (3.0, 6.0, 12.0, 24.0)  # of the land beside a kerb that is looked at: no more of it than what is swept there
_BESIDE_M = 10.0  # of kerb before and after the places where a body is furthest beyond it; a longer body may reach over its length
_ASKEW_M = 5.0  # that a body askew reaches a place sooner or later than its length says
_CUT_M = 0.1  # of a ring of kerb that is moved all around: it begins and ends somewhere
_SEAM_M = 1e-4  # between an area and its kerb: what rounding leaves of land there is none
_ROUNDING_M = 1e-6
_ROUND, _PART = 4.0, 1.6  # turn of a kerb that may come round to itself, and of the parts that it is looked at in [rad]
_LEAST_M2 = 1e-4  # of an area: less is rounding


@dataclass(frozen=True)
class Patch:
    """An area between a kerb and where it moves to, in the road's plane [m]."""

    side: str
    region: str  # "drivable" or "sweepable", see ``Breach``
    s_from: float  # [m]
    s_to: float  # [m]
    s_deepest: float  # [m]
    depth: float  # how far the kerb moves at the deepest place [m]
    polygon: BaseGeometry


class Beside(NamedTuple):
    """A plan beside a part of its road's line."""

    result: Result
    s_from: float  # [m]
    s_to: float  # [m]

    def own(self, touches: Records) -> Records:
        """Return those of the plan's touches that lie beside the part, (n,)."""
        return touches[(touches["s"] >= self.s_from) & (touches["s"] < self.s_to)]


def area_of(patches: Sequence[Patch]) -> float:
    """Return the area of patches together; what several cover counts once [m2]."""
    return float(shapely.union_all([patch.polygon for patch in patches]).area)


def side_of(kerb: Kerb) -> str:
    """Return the side of a kerb: "left" or "right"."""
    return "left" if kerb.left else "right"


def on_kerbs(road: Road, kerbs: tuple[Kerb, ...]) -> Road:
    """Return a road that has limits with other kerbs; those beside its path, which are a forecast, are left where they are."""
    return replace(road, drawn=kerbs, faces=None)


def moved(road: Road, sides: Sequence[str], by: float) -> Road:
    """Return a road with its kerbs on some sides ``by`` metres further out."""
    street = road.bounds
    assert street is not None  # noqa: S101 - for the type checker: the road has limits
    moved = (_moved(kerb, by, closed=street.closed) if side_of(kerb) in sides else [kerb] for kerb in street.kerbs)
    return on_kerbs(road, tuple(itertools.chain.from_iterable(moved)))


def _moved(kerb: Kerb, by: float, *, closed: bool) -> list[Kerb]:
    number, reach = np.arange(len(kerb.s), dtype=np.float64), np.full(len(kerb.s), by if kerb.left else -by)
    found = kerb_of(kerb.points, number, _corners(kerb.points), reach, closed=closed and kerb.goes_on)  # all of a wall has one arclength
    return [replace(kerb, points=one.points, s=np.interp(one.number, number, kerb.s), goes_on=kerb.goes_on and one.whole) for one in found]


def _corners(points: FloatArray) -> BoolArray:
    heading = _heading(points)
    turn: FloatArray = np.diff(heading, prepend=heading[0], append=heading[-1])
    return np.abs(turn) > _SHARP


def _heading(points: FloatArray) -> FloatArray:
    return np.unwrap(np.arctan2(*np.diff(points, axis=0).T[::-1]))


def around(result: Result, sides: Sequence[str], aside: float = 0.0) -> tuple[tuple[Kerb, ...], tuple[Patch, ...]]:
    """Return the kerbs of a plan's road, those on ``sides`` moved out around what it sweeps beyond them, and the areas between.

    The clearance wanted counts as swept, and ``aside`` [m] more where a kerb moves.
    """
    return around_all([Beside(result, -np.inf, np.inf)], sides, aside)


def around_all(plans: Sequence[Beside], sides: Sequence[str], aside: float = 0.0) -> tuple[tuple[Kerb, ...], tuple[Patch, ...]]:
    """Return the kerbs moved out around what each of some plans of a road sweeps beside its own part of the line; see ``around``."""
    result, kerbs, patches = plans[0].result, [], []
    street, clearance = result.drive.road.bounds, result.case.settings.clearance
    assert street is not None  # noqa: S101 - for the type checker: the road has limits
    beside = max(_BESIDE_M, *(unit.length for unit in result.case.vehicle.units))
    for kerb in street.kerbs:
        side, region = side_of(kerb), "drivable" if kerb.wheels or not street.two_regions else "sweepable"
        parts = []
        for plan in plans if side in sides else ():
            stretches = _stretches(plan.own(plan.result.balance.touches[side, region]), clearance, street, beside)
            cut = [(max(s_from, plan.s_from), min(s_to, plan.s_to)) for s_from, s_to in stretches]
            parts += [_beside(plan.result.drive, street, kerb, stretch, clearance + aside) for stretch in cut]
        kerbs.append(street.replaced(kerb, [part for of_stretch in parts for part, _ in of_stretch]) if parts else kerb)
        whole = [patch for of_stretch in parts for patch in _joined([found for _, found in of_stretch])]
        patches += [replace(patch, side=side, region=region) for patch in whole]
    return tuple(kerbs), tuple(sorted(patches, key=lambda patch: (patch.s_from, patch.side)))


def _stretches(touches: Records, clearance: float, street: Street, beside: float) -> list[tuple[float, float]]:
    """Return the stretches of a kerb that bodies are beyond by more than counts as kept, with as much as is ``beside`` them [m]."""
    gap = touches["gap"] - clearance
    found: list[tuple[float, float, float]] = []  # from, to, deepest
    for s, lacking in sorted(zip(touches["s"][gap < 0.0].tolist(), (-gap[gap < 0.0]).tolist(), strict=True)):
        if found and s - beside < found[-1][1]:
            found[-1] = found[-1][0], s + beside, max(found[-1][2], lacking)
        else:
            found.append((s - beside, s + beside, lacking))
    if street.closed and len(found) > 1 and found[-1][1] - street.length > found[0][0]:  # over the start
        last = found.pop()
        found[0] = last[0] - street.length, found[0][1], max(found[0][2], last[2])
    deep = [(s_from, s_to) for s_from, s_to, lacking in found if lacking > KEPT_M]
    if street.closed and any(s_to - s_from >= street.length for s_from, s_to in deep):
        return [(0.0, street.length)]
    return deep


class _Strip(NamedTuple):
    """The land behind a part of a kerb, beside a stretch of the line."""

    stretch: tuple[float, float]  # [m]
    part: Kerb
    far: FloatArray  # the points of its other edge
    land: BaseGeometry


def _beside(drive: Drive, street: Street, kerb: Kerb, stretch: tuple[float, float], aside: float) -> list[tuple[Kerb, list[Patch]]]:
    """Return the parts of a kerb beside a stretch that are moved out around what is swept beyond them, and the areas between."""
    for far in _FAR_M:
        parts = [_around(drive, strip, aside) for strip in _strips(street, kerb, stretch, far)]
        if all(patch.depth < far - KEPT_M for _, found in parts for patch in found):
            break
    return parts


def _strips(street: Street, kerb: Kerb, stretch: tuple[float, float], width: float) -> list[_Strip]:
    """Return the land behind a kerb beside a stretch, in parts where the kerb goes round: what is swept in another round does not count."""
    around_all = street.closed and stretch[1] - stretch[0] >= street.length
    part = street.part(kerb, stretch[0], stretch[1] - (_CUT_M if around_all else 0.0))
    turn, length = float(np.ptp(_heading(part.points))), stretch[1] - stretch[0]
    count = int(np.ceil(turn / _PART)) if turn > _ROUND else 1
    if count > 1 and length > count * _BESIDE_M:
        cuts = np.linspace(*stretch, count + 1).tolist()
        return [strip for one in itertools.pairwise(cuts) for strip in _strips(street, kerb, one, width)]
    far = np.concatenate([one.points for one in _moved(part, width, closed=False)])
    land = shapely.make_valid(shapely.Polygon(np.concatenate([part.points, far[::-1]])))
    return [_Strip(stretch, part, far, land)] if land.area > _LEAST_M2 else []  # at an inner corner a stretch of line may have none


def _joined(parts: Sequence[list[Patch]]) -> list[Patch]:
    """Return the areas beside the parts of a stretch; what was cut in two between parts is one again."""
    whole: list[Patch] = []
    for found in parts:
        for patch in found:
            last = next((one for one in whole if one.s_to <= patch.s_from and one.polygon.distance(patch.polygon) < _ROUNDING_M), None)
            if last is None:
                whole.append(patch)
                continue
            deeper = max(last, patch, key=lambda one: one.depth)
            whole[whole.index(last)] = replace(
                deeper, s_from=last.s_from, s_to=patch.s_to, polygon=shapely.union(last.polygon, patch.polygon)
            )
    return whole


def _around(drive: Drive, strip: _Strip, aside: float) -> tuple[Kerb, list[Patch]]:
    """Return a part of a kerb that is moved out around what is swept beyond it, and the areas between."""
    stretch, part, far, land = strip
    line, swept = shapely.LineString(part.points), _swept(drive, stretch, land, aside, axles_only=part.wheels)
    patches = [_patch(part, line, area) for area in shapely.get_parts(land.intersection(swept)) if area.area > _LEAST_M2]
    patches = [patch for patch in patches if patch.depth > KEPT_M]
    moved_over = shapely.union_all([patch.polygon for patch in patches]).buffer(_SEAM_M, join_style="mitre")
    left = max(shapely.get_parts(land.difference(moved_over)), key=shapely.area)
    if left.is_empty:  # all of a short strip is swept: a wider one is looked at
        return replace(part, points=far, s=np.linspace(*stretch, len(far))), patches
    ring = shapely.get_coordinates(shapely.orient_polygons(left, exterior_cw=not part.left).exterior)[:-1]
    first, last = (_on_end(ring, part.points[end], far[end]) for end in (0, -1))
    points = np.roll(ring, -first, axis=0)[: (last - first) % len(ring) + 1]
    s = np.maximum.accumulate(_along(part, line, _spots(points)))
    s[[0, -1]] = stretch
    return Kerb(points, s, part.left, part.wheels, part.goes_on), patches


def _on_end(ring: FloatArray, at_kerb: FloatArray, at_far: FloatArray) -> int:
    """Return which point of the land's ring lies on an end of the strip, nearest to the kerb."""
    on_end = shapely.distance(_spots(ring), shapely.LineString([at_kerb, at_far])) < _ROUNDING_M
    return int(np.argmin(np.where(on_end, np.hypot(*(ring - at_kerb).T), np.inf)))


def _patch(part: Kerb, line: shapely.LineString, area: BaseGeometry) -> Patch:
    """Return an area beside a kerb; its depth is how far its new kerb is from the old one, either way."""
    new, old = _spots(shapely.get_coordinates(area)), _spots(part.points)
    old = old[shapely.distance(old, area) < _ROUNDING_M]
    edge = shapely.boundary(area).difference(line.buffer(_ROUNDING_M))
    s = _along(part, line, np.concatenate([new, old]))
    depth = np.concatenate([shapely.distance(new, line), shapely.distance(old, edge)])
    deepest = int(np.argmax(depth))
    return Patch("", "", float(np.min(s)), float(np.max(s)), float(s[deepest]), float(depth[deepest]), area)


def _along(part: Kerb, line: shapely.LineString, spots: Shapes) -> FloatArray:
    """Return the road's arclengths beside places at a kerb, whose points make ``line`` [m]."""
    return np.interp(shapely.line_locate_point(line, spots), chord_of(part.points), part.s)


def _spots(points: FloatArray) -> Shapes:
    return np.asarray(shapely.points(points))


def _swept(drive: Drive, stretch: tuple[float, float], strip: BaseGeometry, aside: float, *, axles_only: bool) -> BaseGeometry:
    """Return what bodies sweep, and come nearer to than ``aside`` [m], beside a stretch of the line where that is in a strip of land.

    That is the bodies at every pose, and what their edges sweep from pose to pose.
    """
    path, middle = drive.road.path, 0.5 * (stretch[0] + stretch[1])
    s = drive.poses_s - middle
    if path.closed:
        s = np.mod(s + 0.5 * path.length, path.length) - 0.5 * path.length
    half = 0.5 * (stretch[1] - stretch[0]) + _ASKEW_M
    near = np.flatnonzero((s > -half - drive.vehicle.reach_ahead) & (s < half + drive.vehicle.reach_behind))
    last = path.length if middle > path.length and not path.closed else np.inf  # of a vehicle that has left the road nothing beyond counts
    near = near[(near + 1 < len(drive.poses_s)) & (drive.poses_s[near] < last)]
    before, after = (corners(drive, at, axles_only=axles_only).reshape(-1, 4, 2) for at in (near, near + 1))
    touching = shapely.dwithin(shapely.polygons(before), strip, aside) | shapely.dwithin(shapely.polygons(after), strip, aside)
    before, after = before[touching], after[touching]
    edges = np.stack([before, np.roll(before, -1, axis=1), np.roll(after, -1, axis=1), after], axis=2).reshape(-1, 4, 2)
    swept = np.asarray(shapely.polygons(np.concatenate([before, after, edges])))
    crossing = ~shapely.is_valid(swept)  # of the sides where a body turns
    swept[crossing] = shapely.make_valid(swept[crossing])
    return united(swept).buffer(aside, quad_segs=4)
