"""The least widening of a road's own street with which a vehicle fits: the least area, or the least largest depth.

A widening is what a plan sweeps beyond the kerbs, and comes with a plan that fits. For the least depth all kerbs move outwards alike. The
least area begins with a plan in the street as it is, which goes beyond it as little as it must, or with plans of that search, or of the
same for one side's kerbs alone; within a part of its widening, plans need less and less.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.errors import HdvplanError
from hdvplan.judging.clearance import SIDES
from hdvplan.judging.envelope import SPACING_M
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import verdict_of
from hdvplan.need.land import Beside, Patch, area_of, around, around_all, moved, on_kerbs
from hdvplan.need.search import ATTEMPTS, TOLERANCE_M, WIDE_M, Question, least, on_road, plans_of
from hdvplan.progress import part_of
from hdvplan.road.pieces import Kerb

_LAST = 2  # plans of a search for the least room that the one for the least area begins with: they need least
_ROUNDS = 8  # of making a widening smaller
_LESS = 0.25  # of its depth that it is made smaller by
_WORTH = 0.98  # of its area: what is less better ends them
_PART_M = 1.0  # of the line, at least, for which one of several plans is chosen
_SHARES = (0.0, 0.25, 1.0)  # of what lies between two plans that changing from one to the other may sweep
_SLICES = 100  # of a patch along the line
_ASIDE_M = (0.0, 0.01, 0.03)  # of room around what is swept


class Swept(NamedTuple):
    """A plan of a street, and what it sweeps beyond the kerbs."""

    plan: Result
    patches: tuple[Patch, ...]


@dataclass(frozen=True)
class Widening:
    """Areas by which the street grows, and a plan that fits then, judged in the street as it was and as it is ``then``."""

    patches: tuple[Patch, ...]
    result: Result
    then: Result

    @property
    def depth(self) -> float:
        """How far any kerb moves, at most [m]."""
        return max((patch.depth for patch in self.patches), default=0.0)

    @property
    def area(self) -> float:
        """The area of all patches together; what several cover counts once [m2]."""
        return area_of(self.patches)


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
    ways = [tuple(sides), *((side,) for side in sides if len(sides) > 1)]  # where one side's kerbs stay it may be less area
    parts = len(ways) + (len(ways) > 1)  # and what is mixed of them
    kept: list[Widening | None] = []
    made: list[Swept] = []
    for number, way in enumerate(ways):
        question = Question(partial(moved, road, way), way, TOLERANCE_M, (1.0, 4.0, WIDE_M))
        enough = _enough(case, question, plans, part_of(on_progress, number / parts, (number + 1) / parts))
        begun = _swept((*enough[:1], *enough[1:][-_LAST:]), way)
        made += begun
        if enough:
            kept.append(_kept(case, way, _smallest(case, question, begun)))
        if enough and number == 0:
            kept.append(_kept(case, way, min(enough, key=lambda plan: question.needed(plan, 0.0))))
    found = [one for one in kept if one is not None]
    if len(ways) > 1 and found and not road.path.closed:
        mixed = _mixed(case, sides, [*made, *(Swept(one.result, one.patches) for one in found)])
        found += [] if mixed is None else [mixed]
    if not found:
        return Widenings(None, None, None)
    return Widenings(min(found, key=lambda one: one.area), min(found, key=lambda one: one.depth), None)


def _swept(plans: Iterable[Result], sides: Sequence[str]) -> list[Swept]:
    return [Swept(plan, around(plan, sides)[1]) for plan in plans]


def _mixed(case: Case, sides: Sequence[str], plans: Sequence[Swept]) -> Widening | None:
    """Return a widening that is made of what the cheapest of several plans needs, part by part of the line, if one is found.

    At one bend it may be the left kerbs that move for the least area, at the next one the right.
    """
    question = Question(partial(moved, case.road, sides), tuple(sides), TOLERANCE_M, (WIDE_M,))
    made = itertools.chain.from_iterable(_plans(case, around_all(cheapest, sides)[0]) for cheapest in _cheapest(plans))
    usable = _swept((plan for plan in made if question.needed(plan, 0.0) < WIDE_M), sides)
    return _kept(case, sides, _smallest(case, question, usable)) if usable else None


def _cheapest(plans: Sequence[Swept]) -> Iterator[list[Beside]]:
    """Yield ways along the line by one of several plans after the other that sweep least beyond the kerbs.

    From one to another they are apart: a share of that is swept over a vehicle's length in between, how much is not known.
    """
    envelopes, every = [one.plan.envelope for one in plans], round(_PART_M / SPACING_M)
    s, length = envelopes[0].s[::every], sum(unit.length for unit in plans[0].plan.case.vehicle.units)
    reach = np.array([[envelope.reach_left[::every], envelope.reach_right[::every]] for envelope in envelopes])
    apart = length * np.max(np.abs(reach[:, None] - reach), axis=2)  # (plans, plans, stations) [m2]
    swept = np.array([_along(one.patches, s) for one in plans])
    for share in _SHARES:
        chosen = cheapest_way(swept, share * apart)
        runs = [0, *(np.flatnonzero(np.diff(chosen)) + 1).tolist()]
        ends = [-np.inf, *s[runs[1:]].tolist(), np.inf]
        yield [Beside(plans[chosen[run]].plan, *part) for run, part in zip(runs, itertools.pairwise(ends), strict=True)]


def cheapest_way(costs: FloatArray, changes: FloatArray) -> list[int]:
    """Return the choice at every station with which ``costs`` (n, stations) and those of changes (n, n, stations) add up to least."""
    least, onwards = np.zeros(len(costs)), np.zeros(costs.shape, np.intp)
    for at in reversed(range(costs.shape[1])):
        ways = changes[:, :, at] + least
        onwards[:, at] = np.argmin(ways, axis=1)
        least = costs[:, at] + np.min(ways, axis=1)
    chosen = [int(np.argmin(least))]
    for at in range(costs.shape[1] - 1):
        chosen.append(int(onwards[chosen[-1], at]))
    return chosen


def _along(patches: Sequence[Patch], s: FloatArray) -> FloatArray:
    """Return the area of patches beside every station of the line, evenly over their lengths, (n,) [m2]."""
    area = np.zeros(len(s))
    for patch in patches:
        beside = np.clip(np.searchsorted(s, np.linspace(patch.s_from, patch.s_to, _SLICES)), 0, len(s) - 1)
        np.add.at(area, beside, patch.polygon.area / _SLICES)
    return area


def _enough(case: Case, question: Question, known: Sequence[Result], on_progress: Callable[[float], None] | None) -> list[Result]:
    """Return plans, those that are ``known`` and those of a search for the least room, which fit where only kerbs of the question move."""
    plans = list(known)
    least(case, question, known, on_progress=on_progress, on_result=lambda plan: plans.append(on_road(plan, case.road)))
    return [plan for plan in plans if question.needed(plan, 0.0) < WIDE_M]


def _smallest(case: Case, question: Question, plans: Sequence[Swept]) -> Result:
    """Return the plan that needs the least area, of ``plans`` and those that are made within a part of what the best one needs."""
    area, best = min(((area_of(one.patches), one.plan) for one in plans), key=lambda one: one[0])
    for _ in range(_ROUNDS):
        kerbs, _ = around(best, question.sides, -_LESS * question.needed(best, 0.0))
        for plan in _plans(case, kerbs):
            less = area_of(around(plan, question.sides)[1])
            if question.needed(plan, 0.0) > WIDE_M or less > _WORTH * area:
                return best
            area, best = less, plan
    return best


def _kept(case: Case, sides: Sequence[str], plan: Result) -> Widening | None:
    """Return the widening that a plan needs, with as much room around as it takes to find a plan within it, then without the rest.

    Where none is found it is the one within which ``plan`` itself, made for another street, fits; None where it does not.
    """
    for again in (True, False):
        for aside in _ASIDE_M:
            kerbs, patches = around(plan, sides, aside)
            found = _fitting(case, kerbs, patches, _plans(case, kerbs) if again else (plan,))
            if found is not None:
                kerbs, patches = around(found.result, sides)
                return _fitting(case, kerbs, patches, _plans(case, kerbs)) or found
    return None


def _fitting(case: Case, kerbs: tuple[Kerb, ...], patches: tuple[Patch, ...], plans: Iterable[Result]) -> Widening | None:
    """Return a widening with the first of ``plans`` that fits within it; None where none does."""
    street = on_kerbs(case.road, kerbs)
    judged = ((plan, on_road(plan, street)) for plan in plans)
    return next((Widening(patches, plan, then) for plan, then in judged if verdict_of(then).fits), None)


def _plans(case: Case, kerbs: tuple[Kerb, ...]) -> Iterator[Result]:
    """Yield the plan within other kerbs, judged in the street of the case, if there is one."""
    for made in plans_of(replace(case, road=on_kerbs(case.road, kerbs)), ATTEMPTS[:1]):
        if not isinstance(made, HdvplanError):
            yield on_road(made, case.road)
