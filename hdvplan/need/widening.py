"""The least widening of a road's own street with which a vehicle fits: the least area, or the least largest depth.

A widening is what a plan sweeps beyond the kerbs, and comes with a plan that fits. For the least depth all kerbs move outwards alike. The
least area begins with a plan in the street as it is, which goes beyond it as little as it must; within a part of its widening, plans need
less and less.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import BoolArray, FloatArray, Records
from hdvplan.case import Case
from hdvplan.driving.drive import Drive
from hdvplan.errors import HdvplanError
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.bodies import corners
from hdvplan.judging.clearance import SIDES
from hdvplan.judging.obstacles import Shapes
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import verdict_of
from hdvplan.need.search import ATTEMPTS, TOLERANCE_M, WIDE_M, Question, least, on_road, plans_of
from hdvplan.road.kerbs import kerb_of
from hdvplan.road.pieces import Kerb
from hdvplan.road.road import Road
from hdvplan.road.street import Street

_SHARP = 0.3  # turn of a kerb that is a corner [rad]
_FAR_M = 3.0  # of the land beside a kerb that is looked at: further is no street
_BESIDE_M = 10.0  # of kerb before and after what is swept beyond it: it ends sooner where a kerb's corner is cut
_ASKEW_M = 5.0  # that a body askew reaches a place sooner or later than its length says
_CUT_M = 0.1  # of a ring of kerb that is moved all around: it begins and ends somewhere
_SEAM_M = 1e-4  # between an area and its kerb: what rounding leaves of land there is none
_ROUNDING_M = 1e-6
_LEAST_M2 = 1e-4  # of an area: less is rounding
_STARTS = 3  # plans that the search for the least area may begin with
_ROUNDS = 8  # of making a widening smaller
_LESS = 0.25  # of its depth that it is made smaller by
_WORTH = 0.98  # of its area: what is less better ends them
_ASIDE_M = (0.0, 0.01, 0.03)  # of room around what is swept


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


@dataclass(frozen=True)
class Widening:
    """Areas by which the street grows, and a plan that fits then, judged in the street as it was."""

    patches: tuple[Patch, ...]
    result: Result

    @property
    def depth(self) -> float:
        """How far any kerb moves, at most [m]."""
        return max((patch.depth for patch in self.patches), default=0.0)

    @property
    def area(self) -> float:
        """The area of all patches together; what several cover counts once [m2]."""
        return _area(self.patches)


@dataclass(frozen=True)
class Widenings:
    """The widening of least area and the one of least largest depth.

    Both are None where the vehicle fits as the road is, and ``fitting`` is the plan; all are None where no widening of the road's own
    street was found that would do: an obstacle is in the way, or no plan was found at any width.
    """

    area: Widening | None
    depth: Widening | None
    fitting: Result | None


def own_plans(case: Case) -> list[Result]:
    """Return plans in the street of ``case.road`` as it is; none without one. The first that fits is the last."""
    plans: list[Result] = []
    for plan in () if case.road.limits is None else plans_of(case, ATTEMPTS):
        plans += [] if isinstance(plan, HdvplanError) else [plan]
        if plans and verdict_of(plans[-1]).fits:
            break
    return plans


def least_widenings(
    case: Case, known: Sequence[Result], sides: Sequence[str] = SIDES, *, on_progress: Callable[[float], None] | None = None
) -> Widenings:
    """Return the least widenings of the street of ``case.road``, whose kerbs may move on ``sides`` alone; obstacles stay.

    ``known`` are plans, ``own_plans`` or for other streets of the same line: one of them may fit.
    """
    road, plans = case.road, [on_road(result, case.road) for result in known]
    fitting = next((plan for plan in plans if verdict_of(plan).fits), None)
    if fitting is not None:
        return Widenings(None, None, fitting)
    question = Question(lambda by: moved(road, sides, by), tuple(sides), TOLERANCE_M, (1.0, 4.0, WIDE_M))
    least(case, question, plans, on_progress=on_progress, on_result=lambda plan: plans.append(on_road(plan, road)))
    enough = [plan for plan in plans if question.needed(plan, 0.0) < WIDE_M]
    if not enough:
        return Widenings(None, None, None)
    shallow = _kept(case, sides, min(enough, key=lambda plan: question.needed(plan, 0.0)))
    small = _kept(case, sides, _smallest(case, question, enough[:_STARTS]))
    return Widenings(min(small, shallow, key=lambda one: one.area), min(shallow, small, key=lambda one: one.depth), None)


def _smallest(case: Case, question: Question, plans: Sequence[Result]) -> Result:
    """Return the plan that needs the least area, of ``plans`` and those that are made within a part of what the best one needs."""
    area, best = min(((_area(around(plan, question.sides)[1]), plan) for plan in plans), key=lambda one: one[0])
    for _ in range(_ROUNDS):
        kerbs, _ = around(best, question.sides, -_LESS * question.needed(best, 0.0))
        for plan in _plans(case, kerbs):
            less = _area(around(plan, question.sides)[1])
            if question.needed(plan, 0.0) > WIDE_M or less > _WORTH * area:
                return best
            area, best = less, plan
    return best


def _kept(case: Case, sides: Sequence[str], plan: Result) -> Widening:
    """Return the widening that a plan needs, with as much room around as it takes to find a plan within it, then without the rest."""
    found: Widening | None = None
    for aside in _ASIDE_M:
        found = found or _found(case, around(plan, sides, aside))
    if found is None:
        return Widening(around(plan, sides)[1], plan)
    return _found(case, around(found.result, sides)) or found


def _found(case: Case, wider: tuple[tuple[Kerb, ...], tuple[Patch, ...]]) -> Widening | None:
    """Return a widening with a plan that is found within it; None where none is."""
    kerbs, patches = wider
    for plan in _plans(case, kerbs):
        if verdict_of(on_road(plan, on_kerbs(case.road, kerbs))).fits:
            return Widening(patches, plan)
    return None


def _plans(case: Case, kerbs: tuple[Kerb, ...]) -> Iterator[Result]:
    """Yield the plan within other kerbs, judged in the street of the case, if there is one."""
    for made in plans_of(replace(case, road=on_kerbs(case.road, kerbs)), ATTEMPTS[:1]):
        if not isinstance(made, HdvplanError):
            yield on_road(made, case.road)


def _area(patches: Sequence[Patch]) -> float:
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
    heading = np.unwrap(np.arctan2(*np.diff(points, axis=0).T[::-1]))
    turn: FloatArray = np.diff(heading, prepend=heading[0], append=heading[-1])
    return np.abs(turn) > _SHARP


def around(result: Result, sides: Sequence[str], aside: float = 0.0) -> tuple[tuple[Kerb, ...], tuple[Patch, ...]]:
    """Return the kerbs of a plan's road, those on ``sides`` moved out around what it sweeps beyond them, and the areas between.

    The clearance wanted counts as swept, and ``aside`` [m] more where a kerb moves.
    """
    street, kerbs, patches = result.drive.road.bounds, [], []
    assert street is not None  # noqa: S101 - for the type checker: the road has limits
    clearance = result.case.settings.clearance
    for kerb in street.kerbs:
        side, region = side_of(kerb), "drivable" if kerb.wheels or not street.two_regions else "sweepable"
        stretches = _stretches(result.balance.touches[side, region], clearance, street) if side in sides else []
        parts = [_around(result.drive, street, kerb, stretch, clearance + aside) for stretch in stretches]
        kerbs.append(street.replaced(kerb, [part for part, _ in parts]) if parts else kerb)
        patches += [replace(patch, side=side, region=region) for _, found in parts for patch in found]
    return tuple(kerbs), tuple(sorted(patches, key=lambda patch: (patch.s_from, patch.side)))


def _stretches(touches: Records, clearance: float, street: Street) -> list[tuple[float, float]]:
    """Return the stretches of a kerb, beside which bodies are beyond it by more than counts as kept, with some before and after."""
    gap = touches["gap"] - clearance
    found: list[tuple[float, float, float]] = []  # from, to, deepest
    for s, lacking in sorted(zip(touches["s"][gap < 0.0].tolist(), (-gap[gap < 0.0]).tolist(), strict=True)):
        if found and s - _BESIDE_M < found[-1][1]:
            found[-1] = found[-1][0], s + _BESIDE_M, max(found[-1][2], lacking)
        else:
            found.append((s - _BESIDE_M, s + _BESIDE_M, lacking))
    if street.closed and len(found) > 1 and found[-1][1] - street.length > found[0][0]:  # over the start
        last = found.pop()
        found[0] = last[0] - street.length, found[0][1], max(found[0][2], last[2])
    deep = [(s_from, s_to) for s_from, s_to, lacking in found if lacking > KEPT_M]
    if street.closed and any(s_to - s_from >= street.length for s_from, s_to in deep):
        return [(0.0, street.length)]
    return deep


def _around(drive: Drive, street: Street, kerb: Kerb, stretch: tuple[float, float], aside: float) -> tuple[Kerb, list[Patch]]:
    """Return a part of a kerb that is moved out around what is swept beyond it, and the areas between."""
    around_all = street.closed and stretch[1] - stretch[0] >= street.length
    part = street.part(kerb, stretch[0], stretch[1] - (_CUT_M if around_all else 0.0))
    line, far = shapely.LineString(part.points), np.concatenate([one.points for one in _moved(part, _FAR_M, closed=False)])
    strip = shapely.make_valid(shapely.Polygon(np.concatenate([part.points, far[::-1]])))
    swept = _swept(drive, stretch, strip, axles_only=kerb.wheels).buffer(aside, quad_segs=4)
    patches = [_patch(part, line, area) for area in shapely.get_parts(strip.intersection(swept)) if area.area > _LEAST_M2]
    patches = [patch for patch in patches if patch.depth > KEPT_M]
    moved_over = shapely.union_all([patch.polygon for patch in patches]).buffer(_SEAM_M, join_style="mitre")
    left = max(shapely.get_parts(strip.difference(moved_over)), key=shapely.area)
    ring = shapely.get_coordinates(shapely.orient_polygons(left, exterior_cw=not kerb.left).exterior)[:-1]
    first, last = (_on_end(ring, part.points[end], far[end]) for end in (0, -1))
    points = np.roll(ring, -first, axis=0)[: (last - first) % len(ring) + 1]
    s = np.maximum.accumulate(_along(part, line, _spots(points)))
    s[[0, -1]] = stretch
    return Kerb(points, s, kerb.left, kerb.wheels, kerb.goes_on), patches


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
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(part.points, axis=0).T))])
    return np.interp(shapely.line_locate_point(line, spots), at, part.s)


def _spots(points: FloatArray) -> Shapes:
    return np.asarray(shapely.points(points))


def _swept(drive: Drive, stretch: tuple[float, float], strip: BaseGeometry, *, axles_only: bool) -> BaseGeometry:
    """Return what bodies sweep beside a stretch of the line where they touch a strip of land.

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
    touching = shapely.intersects(shapely.polygons(before), strip) | shapely.intersects(shapely.polygons(after), strip)
    before, after = before[touching], after[touching]
    edges = np.stack([before, np.roll(before, -1, axis=1), np.roll(after, -1, axis=1), after], axis=2).reshape(-1, 4, 2)
    swept = np.asarray(shapely.polygons(np.concatenate([before, after, edges])))
    crossing = ~shapely.is_valid(swept)  # of the sides where a body turns
    swept[crossing] = shapely.make_valid(swept[crossing])
    return shapely.union_all(swept)
