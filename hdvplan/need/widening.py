"""The least widening of a road's own street with which a vehicle fits: the least area, or the least largest depth.

A widening is what a plan sweeps beyond the kerbs, and comes with a plan that fits. For the least depth all kerbs move outwards alike. The
least area begins with a plan in the street as it is, which goes beyond it as little as it must, or with plans of that search, or of the
same for one side's kerbs alone; within a part of its widening, plans need less and less.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

from hdvplan.case import Case
from hdvplan.errors import HdvplanError
from hdvplan.judging.clearance import SIDES
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import verdict_of
from hdvplan.need.land import Patch, area_of, around, moved, on_kerbs
from hdvplan.need.search import ATTEMPTS, TOLERANCE_M, WIDE_M, Question, least, on_road, plans_of
from hdvplan.progress import part_of
from hdvplan.road.pieces import Kerb

_LAST = 2  # plans of a search for the least room that the one for the least area begins with: they need least
_ROUNDS = 8  # of making a widening smaller
_LESS = 0.25  # of its depth that it is made smaller by
_WORTH = 0.98  # of its area: what is less better ends them
_ASIDE_M = (0.0, 0.01, 0.03)  # of room around what is swept


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
    kept: list[Widening | None] = []
    for number, way in enumerate(ways):
        question = Question(partial(moved, road, way), way, TOLERANCE_M, (1.0, 4.0, WIDE_M))
        enough = _enough(case, question, plans, part_of(on_progress, number / len(ways), (number + 1) / len(ways)))
        if enough:
            kept.append(_kept(case, way, _smallest(case, question, (*enough[:1], *enough[1:][-_LAST:]))))
        if enough and number == 0:
            kept.append(_kept(case, way, min(enough, key=lambda plan: question.needed(plan, 0.0))))
    found = [one for one in kept if one is not None]
    if not found:
        return Widenings(None, None, None)
    return Widenings(min(found, key=lambda one: one.area), min(found, key=lambda one: one.depth), None)


def _enough(case: Case, question: Question, known: Sequence[Result], on_progress: Callable[[float], None] | None) -> list[Result]:
    """Return plans, those that are ``known`` and those of a search for the least room, which fit where only kerbs of the question move."""
    plans = list(known)
    least(case, question, known, on_progress=on_progress, on_result=lambda plan: plans.append(on_road(plan, case.road)))
    return [plan for plan in plans if question.needed(plan, 0.0) < WIDE_M]


def _smallest(case: Case, question: Question, plans: Sequence[Result]) -> Result:
    """Return the plan that needs the least area, of ``plans`` and those that are made within a part of what the best one needs."""
    area, best = min(((area_of(around(plan, question.sides)[1]), plan) for plan in plans), key=lambda one: one[0])
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
