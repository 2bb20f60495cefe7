"""On which side to pass every obstacle: groups of near ones in road order, each by a search over planned stretches of road."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import count

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.driving.drive import Drive, drive
from hdvplan.errors import PlanError, SolverError
from hdvplan.judging.balance import KEPT_M, gaps_of
from hdvplan.judging.clearance import approaches, touches_of
from hdvplan.judging.envelope import SPACING_M, Envelope
from hdvplan.judging.result import Passed, Trial
from hdvplan.passing.options import Options, independent_m, options_of, spans_of
from hdvplan.planning.bias import Bias
from hdvplan.planning.objectives import objective_named
from hdvplan.road.passages import Passage
from hdvplan.road.regions import Kind, Side
from hdvplan.road.road import Road, part_of
from hdvplan.solvers.registry import dependable

_REMEMBERED = 3  # obstacles behind one that a choice is judged with, and by which choices differ
_AROUND = 2  # obstacles on either side of one that its other side is judged with
_SWEEPS = 3  # over a group, of turning single obstacles to their better side
_LESS = 0.99  # of a cost: more is no reason to leave a side
_DIGITS = 3  # of a violation in metres: smaller differences do not decide
_MOST_TOGETHER = 20  # obstacles of a group whose sides are searched together: those of the next part stand beside the settled ones
_MOST_TRIALS = 500  # of a road: they take half a minute, and several where the road is full; what is left is passed on its usual side
_MOST_BLOCKED = 20  # obstacles without room on either side: on such a road no choice of the others' sides is worth minutes
_ROOM_M = 20.0  # of path and limits beyond the ends of a stretch, the vehicle and its horizon
_NO_PLAN = Trial(np.inf, np.inf, -np.inf, np.inf, np.inf)
_UNTRIED = f"no other side was tried: the road has more obstacles than {_MOST_TRIALS} trials are enough for"

Sides = dict[int, Side]
Try = Callable[[Mapping[int, Side]], Trial]


def choose_sides(case: Case) -> tuple[Road, tuple[Passed, ...]]:
    """Return the case's road with its obstacles and islands passed on the best sides, and how each of them is passed.

    Raises:
        RoadError: an obstacle has no room on the side on which it must be passed.

    """
    road = case.road
    if not road.passages:
        return road, ()
    options = options_of(case)
    chosen = {number: option.sides[0] for number, option in enumerate(options)}
    open_ = [number for number, option in enumerate(options) if option.open]
    near = independent_m(case, [road.passages[number] for number in open_])
    fixed = {number: side for number, side in chosen.items() if not options[number].open}
    blocked = sum(option.blocked for option in options)
    untried = f"no other side was tried: {blocked} obstacles block the road" if blocked > _MOST_BLOCKED else _UNTRIED
    known: dict[frozenset[tuple[int, Side]], Trial] = {}
    tried_: dict[int, tuple[Trial, Trial]] = {}
    for group in _groups(open_, road.passages, near):
        settled = fixed
        for first in range(0, len(group), _MOST_TOGETHER):
            part = group[first : first + _MOST_TOGETHER]
            if len(known) >= _MOST_TRIALS or blocked > _MOST_BLOCKED:
                for number in part:
                    options[number] = replace(options[number], reason=untried)
                continue
            attempt = _memory(case, settled, near, known)
            sides = _improved(_searched(part, road.passages, near, options, attempt), road.passages, near, attempt)
            sides = _left_beside(sides, road.passages, near, attempt)
            tried_ |= {number: _both(number, sides, road.passages, near, attempt) for number in part}
            chosen |= sides
            settled = settled | sides
    noted = (number for number in chosen if road.passages[number].on_line or road.passages[number].kind is Kind.OBSTACLE)
    passed = tuple(_passed(case, road.passages[number], options[number], chosen[number], tried_.get(number)) for number in noted)
    return road.passing(chosen), passed


def _passed(case: Case, passage: Passage, option: Options, side: Side, trials: tuple[Trial, Trial] | None) -> Passed:
    own, other = trials or (None, None)
    region, crossed = case.road.regions[passage.region], not (passage.on_line or side is passage.usual)
    return Passed(region, passage.s_from, passage.s_to, side, option.forced, own, other, option.reason, crossed)


def _groups(numbers: Sequence[int], passages: Sequence[Passage], near: float) -> list[list[int]]:
    groups: list[list[int]] = []
    end = -np.inf
    for number in numbers:
        if not groups or passages[number].s_from - end >= near:
            groups.append([])
        groups[-1].append(number)
        end = max(end, passages[number].s_to)
    return groups


def _memory(case: Case, fixed: Mapping[int, Side], near: float, known: dict[frozenset[tuple[int, Side]], Trial]) -> Try:
    """Return a function that tries sides of neighbouring obstacles, each choice once, among those that are ``fixed``.

    ``known`` keeps the trials.
    """
    step, length, passages = case.settings.replan, case.road.path.length, case.road.passages
    standing = spans_of([passages[number] for number in fixed if passages[number].on_line])

    def attempt(sides: Mapping[int, Side]) -> Trial:
        key = frozenset(sides.items())
        if key not in known:
            first = min(passages[number].s_from for number in sides) - near
            last = max(passages[number].s_to for number in sides) + near
            first = _before(first, standing, near)
            begin, end = step * np.floor(first / step), step * np.ceil(last / step)
            begin, end = (begin, min(end, begin + length)) if case.road.path.closed else (max(0.0, begin), min(length, end))
            known[key] = tried(case, {**fixed, **sides}, begin, end)
        return known[key]

    return attempt


def _before(s: float, standing: FloatArray, near: float) -> float:
    """Return where a plan that should begin at ``s`` can begin on the line: before obstacles that stand there, shape (2, n) [m]."""
    for _ in range(_REMEMBERED):
        there = (standing[0] - near < s) & (s < standing[1] + near)
        s = min(s, float(np.min(standing[0, there], initial=np.inf)) - near)
    return s


def _searched(group: list[int], passages: Sequence[Passage], near: float, options: Sequence[Options], attempt: Try) -> Sides:
    """Return the sides of a group with the least violation: a shortest way through its obstacles in road order.

    A choice for the first obstacles is extended by both sides of the next one. That costs what a plan past it and the last
    ``_REMEMBERED`` before it violates. The least costly choice goes on first, of equal ones the longest. Choices that agree on the
    obstacles remembered have the same future, and only the best of them goes on: the work is linear in the number of obstacles.
    """
    order, seen = count(), set[tuple[int, tuple[Side, ...]]]()
    heap: list[tuple[tuple[float, float], int, float, int, tuple[Side, ...]]] = [((0.0, 0.0), 0, 0.0, next(order), ())]
    while True:
        (violation, harm), _, _, _, sides = heapq.heappop(heap)
        done = len(sides)
        if done == len(group):
            return dict(zip(group, sides, strict=True))
        alike = (done, sides[-_REMEMBERED:])
        if alike in seen:
            continue
        seen.add(alike)
        window = _behind(group, done, passages, near, _REMEMBERED)
        for side in options[group[done]].sides:
            extended = (*sides, side)
            trial = attempt(dict(zip(window, extended[-len(window) :], strict=True)))
            price = (violation + round(trial.violation, _DIGITS), harm + round(trial.harm, _DIGITS))
            heapq.heappush(heap, (price, -done - 1, trial.cost, next(order), extended))


def _improved(sides: Sides, passages: Sequence[Passage], near: float, attempt: Try) -> Sides:
    """Return a group's sides after single obstacles were turned to the other one wherever that is better."""
    best = dict(sides)
    for _ in range(_SWEEPS):
        before = dict(best)
        for number in sides:
            own, other = _both(number, best, passages, near, attempt)
            if _better(other, own):
                best[number] = best[number].other
        if best == before:
            break
    return best


def _left_beside(sides: Sides, passages: Sequence[Passage], near: float, attempt: Try) -> Sides:
    """Return a group's sides where an obstacle that the line leaves free is passed as the line passes it, if the vehicle fits there.

    The other side may be that of oncoming traffic: more room is no reason to go there.
    """
    best = dict(sides)
    for number, side in sides.items():
        if not passages[number].on_line and side is not passages[number].usual:
            own, usual = _both(number, best, passages, near, attempt)
            if usual.clearance >= min(own.clearance, 0.0) - KEPT_M:
                best[number] = side.other
    return best


def _both(number: int, sides: Sides, passages: Sequence[Passage], near: float, attempt: Try) -> tuple[Trial, Trial]:
    """Return what the chosen and the other side of an obstacle come to, among its neighbours as they are passed."""
    group = list(sides)
    place = group.index(number)
    ahead = [other for other in group[place + 1 : place + 1 + _AROUND] if passages[other].s_from - passages[number].s_to < near]
    around = {other: sides[other] for other in (*_behind(group, place, passages, near, _AROUND), *ahead)}
    return attempt(around), attempt(around | {number: sides[number].other})


def _behind(group: list[int], place: int, passages: Sequence[Passage], near: float, most: int) -> list[int]:
    """Return up to ``most`` obstacles before a place in a group that bear on the one there, and that one."""
    first = place
    while first > max(place - most, 0) and passages[group[place]].s_from - passages[group[first - 1]].s_to < near:
        first -= 1
    return group[first : place + 1]


def _better(one: Trial, other: Trial) -> bool:
    """Tell which trial is better: by violation, then by what is violated altogether, then by cost."""
    if one.violation != other.violation and not abs(one.violation - other.violation) <= KEPT_M:
        return one.violation < other.violation
    if max(one.harm, other.harm) > 0.0 and min(one.harm, other.harm) < _LESS * max(one.harm, other.harm):
        return one.harm < other.harm
    return one.cost < _LESS * other.cost


def tried(case: Case, sides: Mapping[int, Side], s_from: float, s_to: float) -> Trial:
    """Plan ``case`` from ``s_from`` to ``s_to`` [m] with the obstacles of some passages, and judge it.

    ``sides`` are those of the passages, by their numbers. The vehicle starts in the stationary geometry of the first point.
    """
    part = _stretch(case, sides, s_from, s_to)
    bias = Bias(case.bias.s - s_from, case.bias.offset)
    try:
        driven = drive(part, case.vehicle, objective_named(case.objective), dependable(case.solver), case.settings, bias=bias)
        return _judged(driven)
    except (PlanError, SolverError):
        return _NO_PLAN


def _stretch(case: Case, sides: Mapping[int, Side], s_from: float, s_to: float) -> Road:
    """Return a stretch as a separate road that continues, beyond both ends, as the whole one does."""
    vehicle, road = case.vehicle, case.road
    before, after = vehicle.reach_behind + _ROOM_M, case.settings.horizon + vehicle.reach_ahead + _ROOM_M
    there = [
        passage.region
        for number, passage in enumerate(road.passages)
        if number in sides and (road.path.closed or (passage.s_from < s_to and passage.s_to > s_from))
    ]
    part = part_of(road.passing(sides), s_from, s_to, before, after)
    return replace(part, regions=tuple(road.regions[one] for one in dict.fromkeys(there)))


def _judged(driven: Drive) -> Trial:
    envelope, settings = Envelope(driven), driven.settings
    gaps = gaps_of(touches_of(driven, envelope.s))
    distances = [(approach.distance, approach.s_to - approach.s_from + SPACING_M) for approach in approaches(driven)]
    clearance = min([*(float(np.nanmin(gap)) for gap in gaps.values()), *(distance for distance, _ in distances)], default=np.inf)
    lacking = settings.clearance - clearance
    harm = sum(SPACING_M * float(np.nansum(_missing(settings.clearance - gap) ** 2)) for gap in gaps.values())
    harm += sum(length * float(_missing(settings.clearance - distance)) ** 2 for distance, length in distances)
    off = 0.5 * (envelope.reach_left + envelope.reach_right) - driven.bias.at(envelope.s)
    turned = float(np.mean(np.diff(driven.kappa) ** 2))
    cost = float(np.mean(off**2)) + settings.smoothness * turned
    return Trial(lacking if lacking > KEPT_M else 0.0, harm, clearance, float(np.mean(np.abs(off))), cost)


def _missing(lacking: FloatArray | float) -> FloatArray:
    return np.where(np.asarray(lacking) > KEPT_M, lacking, 0.0)
