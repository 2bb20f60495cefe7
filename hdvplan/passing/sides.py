"""On which side to pass every obstacle: groups of near ones in road order, each by a search over planned stretches of road."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np

from hdvplan.case import Case
from hdvplan.centring.weights import CentringTable
from hdvplan.errors import RoadError
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.passed import Passed, Trial
from hdvplan.passing.trial import tried
from hdvplan.road.obstructed import Obstructed, Passage
from hdvplan.road.regions import Side
from hdvplan.road.road import Road

_CLEAR_M = 0.5  # an obstacle this far from the balanced swept area leaves no choice
_REMEMBERED = 3  # obstacles behind one that a partial choice is judged with, and by which choices differ
_AROUND = 2  # obstacles on either side of one that its other side is judged with
_SWEEPS = 3  # over a group, of turning single obstacles to their better side
_BETTER = 0.99  # of the cost: less is no reason to leave the usual side
_MOST_DETOUR_M = 6.0  # of an obstacle's edge from the line; walls along the road reach further out
_SAME_M = 1e-3  # violations that differ by less are the same

Sides = dict[int, Side]
Try = Callable[[Mapping[int, Side]], Trial]


@dataclass(frozen=True)
class Options:
    """The sides on which an obstacle can be passed, the usual one first; ``reason`` says why there is only one."""

    sides: tuple[Side, ...]
    forced: bool = False
    reason: str | None = None


def choose_sides(case: Case) -> tuple[Road, tuple[Passed, ...]]:
    """Return the case's road with its obstacles passed on the best sides, and how each of them is passed.

    Raises:
        RoadError: an obstacle has no room on the side on which it must be passed.

    """
    road = case.road.obstructed if case.road.has_obstacles else None
    if road is None:
        return case.road, ()
    options = [_options(case, road, number) for number in range(len(road.passages))]
    near = independent_m(case, road)
    attempt = _memory(case, road, near)
    chosen = dict(enumerate(option.sides[0] for option in options))
    for group in groups_of(road.passages, near):
        if any(len(options[number].sides) > 1 for number in group):
            chosen |= _improved(group, _searched(group, options, road.passages, near, attempt), options, road.passages, near, attempt)
    passed = tuple(_passed(case, road, number, options[number], chosen, near, attempt) for number in range(len(options)))
    return case.road.passing([chosen[number] for number in range(len(options))]), passed


def independent_m(case: Case, road: Obstructed) -> float:
    """Return the distance between obstacles from which on one's side has no bearing on the other's [m].

    The vehicle's length, and the road in which it goes back from the furthest detour to the line: two arcs of its tightest curvature,
    entered and left at its curvature rate.
    """
    vehicle = case.vehicle
    reach = [max(abs(passage.low), abs(passage.high)) for passage in road.passages]
    detour = min(max(reach, default=0.0), _MOST_DETOUR_M) + 0.5 * vehicle.width
    turn = 2.0 * np.sqrt(detour / vehicle.max_curvature) + 2.0 * vehicle.max_curvature / vehicle.max_curvature_rate
    return float(vehicle.reach_ahead + vehicle.reach_behind + turn)


def groups_of(passages: Sequence[Passage], near: float) -> list[list[int]]:
    """Return the numbers of the passages in order, grouped where neighbours are less than ``near`` [m] apart."""
    groups: list[list[int]] = []
    end = -np.inf
    for number, passage in enumerate(passages):
        if not groups or passage.s_from - end >= near:
            groups.append([])
        groups[-1].append(number)
        end = max(end, passage.s_to)
    return groups


def _options(case: Case, road: Obstructed, number: int) -> Options:
    """Return the sides on which an obstacle can be passed at all."""
    passage = road.passages[number]
    region = case.road.regions[passage.region]
    usual = passage.usual
    if passage.around:
        return Options((usual,), reason="it lies on both sides of the line")
    if region.side is not None:
        _refuse_closed(case, passage, region.side)
        return Options((region.side,), forced=True, reason="the side is given")
    closed = {side: _lacking(case, passage, side) for side in Side}
    open_ = tuple(side for side in (usual, usual.other) if closed[side] is None)
    if not open_:
        return Options((usual,), reason=f"no side has room: {closed[usual.other]}")
    if len(open_) == 1:
        return Options(open_, reason=f"closed: {closed[open_[0].other]}")
    if not passage.on_line and _apart(case, passage) > _CLEAR_M:
        return Options((usual,), reason="the swept area does not come near it")
    return Options(open_)


def _lacking(case: Case, passage: Passage, side: Side) -> str | None:
    """Return why there is no room between an obstacle and the road's edge on a side, None where there is."""
    needed = case.vehicle.width + 2.0 * case.settings.clearance
    if passage.room[side] >= needed - 2.0 * KEPT_M:
        return None
    return f"{max(passage.room[side], 0.0):.2f} m between it and the {side} limit, {needed:.2f} m are needed"


def _refuse_closed(case: Case, passage: Passage, side: Side) -> None:
    lacking = _lacking(case, passage, side)
    if lacking is not None:
        label = case.road.regions[passage.region].label
        named = f"the obstacle {label!r}" if label else "an obstacle"
        missing = case.vehicle.width + 2.0 * case.settings.clearance - passage.room[side]
        s = 0.5 * (passage.s_from + passage.s_to)
        msg = f"{named} at s = {s:.1f} m cannot be passed on the {side}: {lacking}, {missing:.2f} m more"
        raise RoadError(msg, s_m=s, hint="leave its side open, or pass it on the other one")


def _apart(case: Case, passage: Passage) -> float:
    """Return the room between an obstacle beside the line and what the vehicle sweeps, balanced everywhere [m]."""
    vehicle, path = case.vehicle, case.road.path
    s = np.clip(np.arange(passage.s_from - vehicle.reach_behind, passage.s_to + vehicle.reach_ahead, 0.5), 0.0, path.length)
    swept = CentringTable.of(vehicle).at(path.at(s).curvature)
    if np.any(swept.saturated):
        return -np.inf
    half, aim = float(np.max(swept.half_width)) + case.settings.clearance, case.bias.at(s)
    return float(passage.low - np.max(aim) - half if passage.low > 0.0 else np.min(aim) - passage.high - half)


def _memory(case: Case, road: Obstructed, near: float) -> Try:
    """Return a function that tries sides of neighbouring obstacles, each choice once."""
    known: dict[frozenset[tuple[int, Side]], Trial] = {}
    step, length = case.settings.replan, case.road.path.length

    def attempt(sides: Mapping[int, Side]) -> Trial:
        key = frozenset(sides.items())
        if key not in known:
            first = min(road.passages[number].s_from for number in sides) - near
            last = max(road.passages[number].s_to for number in sides) + near
            known[key] = tried(case, road, sides, max(0.0, step * np.floor(first / step)), min(length, step * np.ceil(last / step)))
        return known[key]

    return attempt


def _behind(number: int, passages: Sequence[Passage], near: float, most: int) -> list[int]:
    """Return the numbers of up to ``most`` obstacles before ``number`` that bear on it, and its own."""
    first = number
    while first > max(number - most, 0) and passages[number].s_from - passages[first - 1].s_to < near:
        first -= 1
    return list(range(first, number + 1))


def _searched(group: list[int], options: Sequence[Options], passages: Sequence[Passage], near: float, attempt: Try) -> Sides:
    """Return the sides of a group with the least violation: a shortest way through its obstacles in road order.

    A choice for the first obstacles is extended by both sides of the next one, which costs what a plan past it and the last
    ``_REMEMBERED`` before it violates. The least costly choice goes on first, of equal ones the longest. Choices that agree on the
    obstacles remembered have the same future, and only the best of them goes on: the work is linear in the number of obstacles.
    """
    order, seen = count(), set[tuple[int, tuple[Side, ...]]]()
    heap: list[tuple[float, int, float, int, tuple[Side, ...]]] = [(0.0, 0, 0.0, next(order), ())]
    while True:
        worst, _, _, _, sides = heapq.heappop(heap)
        done = len(sides)
        if done == len(group):
            return dict(zip(group, sides, strict=True))
        alike = (done, sides[-_REMEMBERED:])
        if alike in seen:
            continue
        seen.add(alike)
        window = _behind(group[done], passages, near, min(_REMEMBERED, done))
        for side in options[group[done]].sides:
            extended = (*sides, side)
            trial = attempt(dict(zip(window, extended[-len(window) :], strict=True)))
            violation = worst + _SAME_M * round(trial.violation / _SAME_M) if np.isfinite(trial.violation) else np.inf
            heapq.heappush(heap, (violation, -done - 1, trial.cost, next(order), extended))


def _improved(group: list[int], sides: Sides, options: Sequence[Options], passages: Sequence[Passage], near: float, attempt: Try) -> Sides:
    """Return the sides after single obstacles were turned to the other one wherever that is better."""
    best = dict(sides)
    for _ in range(_SWEEPS):
        turned = False
        for number in group:
            if len(options[number].sides) > 1:
                around = {other: best[other] for other in _around(number, group, passages, near)}
                other = around | {number: best[number].other}
                if _better(attempt(other), attempt(around)):
                    best[number], turned = other[number], True
        if not turned:
            break
    return best


def _around(number: int, group: list[int], passages: Sequence[Passage], near: float) -> list[int]:
    """Return the numbers of the obstacles on either side of ``number`` that bear on it, and its own."""
    place = group.index(number)
    ahead = [other for other in group[place + 1 : place + 1 + _AROUND] if passages[other].s_from - passages[number].s_to < near]
    behind = [other for other in _behind(number, passages, near, _AROUND) if other in group]
    return behind + ahead


def _better(one: Trial, other: Trial) -> bool:
    if max(one.violation, other.violation) > 0.0 and not abs(one.violation - other.violation) <= _SAME_M:
        return one.violation < other.violation
    return one.cost < _BETTER * other.cost


def _passed(case: Case, road: Obstructed, number: int, option: Options, chosen: Sides, near: float, attempt: Try) -> Passed:
    passage = road.passages[number]
    group = next(group for group in groups_of(road.passages, near) if number in group)
    own, other = None, None
    if len(option.sides) > 1:
        around = {one: chosen[one] for one in _around(number, group, road.passages, near)}
        own, other = attempt(around), attempt(around | {number: chosen[number].other})
    return Passed(
        case.road.regions[passage.region], passage.s_from, passage.s_to, chosen[number], option.forced, own, other, option.reason
    )  # fmt: skip
