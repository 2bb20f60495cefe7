"""Plan again with stations nearer together where a plan breaks its limits.

At each station the planner uses the narrowest limit up to the next one (``hdvplan.planning.stations``). Where a limit narrows at a slope,
this takes away room: the slope times the distance between stations. On a road just wide enough for the vehicle, a coarse plan can therefore
fail where a finer one does not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from hdvplan import api
from hdvplan.errors import HdvplanError
from hdvplan.judging.result import Attempt, Result
from hdvplan.judging.verdict import verdict_of
from hdvplan.planning.settings import MOST_STAGES, SHORTEST_STEP_M, PlannerSettings

_DIVISORS = (2, 5)  # of the distance of stations: whole numbers, so that horizon and replanning distance remain multiples of it
_WORTH = 0.5  # metres lacking per metre between stations beyond which a finer plan is not tried: limits at that slope are rare


def replanned(result: Result, *, on_progress: Callable[[float], None] | None = None) -> Result:
    """Return the first plan with stations nearer together that keeps the limits which ``result`` breaks; else ``result``.

    Both list in ``attempts`` what was tried. A plan is not repeated if it lacks more room than the distance between stations can take away,
    or if its breach is proved to be inevitable. ``on_progress`` receives the share of the attempts that are made, 0 to 1.
    """
    verdict, last = verdict_of(result), result
    if verdict.fits is not False or verdict.proved:
        return result
    attempts = [_attempt(result)]
    for number, divisor in enumerate(_DIVISORS):
        settings = _divided(result.case.settings, divisor)
        if settings is None or attempts[-1].lacking > _WORTH * last.case.settings.step:
            break
        try:
            last = api.plan(replace(result.case, settings=settings))
        except HdvplanError:  # what cannot be planned so finely is no better answer
            break
        attempts.append(_attempt(last))
        if verdict_of(last).fits:
            return replace(last, attempts=tuple(attempts))
        if on_progress is not None:
            on_progress((number + 1) / len(_DIVISORS))
    return result if len(attempts) == 1 else replace(result, attempts=tuple(attempts))


def _attempt(result: Result) -> Attempt:
    verdict = verdict_of(result)
    return Attempt(result.case.settings.step, 0.0 if verdict.fits else -(verdict.spare or 0.0))


def _divided(settings: PlannerSettings, divisor: int) -> PlannerSettings | None:
    """Return settings with stations so many times as near; None where that is finer than a plan may be."""
    step = settings.step / divisor
    if step < SHORTEST_STEP_M or settings.stages * divisor > MOST_STAGES:
        return None
    return replace(settings, step=step)
