"""On which side to pass every obstacle: groups of near ones in road order, each by a search over planned stretches of road."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import count

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.result import Passed, Trial
from hdvplan.passing.options import Options, independent_m, options_of, spans_of
from hdvplan.passing.trial import tried
from hdvplan.road.passages import Passage
from hdvplan.road.regions import Kind, Side
from hdvplan.road.road import Road

_REMEMBERED = 3  # obstacles behind one that a choice is judged with, and by which choices differ
_AROUND = 2  # obstacles on either side of one that its other side is judged with
_SWEEPS = 3  # over a group, of turning single obstacles to their better side
_LESS = 0.99  # of a cost: more is no reason to leave a side
_DIGITS = 3  # of a violation in metres: smaller differences do not decide
_MOST_TOGETHER = 20  # obstacles of a group whose sides are searched together: those of the next part stand beside the settled ones
_MOST_TRIALS = 500  # of a road: they take half a minute, and several where the road is full; what is left is passed on its usual side
_MOST_BLOCKED = 20  # obstacles without room on either side: on such a road no choice of the others' sides is worth minutes
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
            tried_ |= {number: _both(number, sides, road.passages, near, attempt) for number in part}
            chosen |= sides
            settled = settled | sides
    told = (number for number in chosen if road.passages[number].on_line or road.passages[number].kind is Kind.OBSTACLE)
    passed = tuple(_passed(case, road.passages[number], options[number], chosen[number], tried_.get(number)) for number in told)
    return road.passing(chosen), passed


def _passed(case: Case, passage: Passage, option: Options, side: Side, trials: tuple[Trial, Trial] | None) -> Passed:
    own, other = trials or (None, None)
    return Passed(case.road.regions[passage.region], passage.s_from, passage.s_to, side, option.forced, own, other, option.reason)


def _groups(numbers: Sequence[int], passages: Sequence[Passage], near: float) -> list[list[int]]:
    """Return the numbers of passages grouped where neighbours are less than ``near`` [m] apart."""
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
        turned = [number for number in best if _turn(number, best, passages, near, attempt)]
        if not turned:
            break
    return best


def _turn(number: int, best: Sides, passages: Sequence[Passage], near: float, attempt: Try) -> bool:
    own, other = _both(number, best, passages, near, attempt)
    if _better(other, own):
        best[number] = best[number].other
        return True
    return False


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
