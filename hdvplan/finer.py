"""Plan again where a plan breaks its limits: so that it lacks as little as can be, and with stations nearer together.

A plan that cannot keep its street makes the sum of its breaches least, not the deepest one. Planned with limits that give way by some
metres it keeps those wherever something does, and so lacks no more than these metres anywhere: halving finds the fewest.

From one station to the next a plan holds its curvature. On a road just wide enough for the vehicle, one that may steer more often can keep
limits that a coarse one breaks.

A plan that fits comes as near to limits as its objective likes. The largest clearance that one can keep leaves its driver the most room.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from math import ceil, inf, log

from hdvplan import api
from hdvplan.errors import HdvplanError
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.result import Attempt, Result
from hdvplan.judging.verdict import verdict_of
from hdvplan.planning.settings import MOST_STAGES, SHORTEST_STEP_M, PlannerSettings

_SHARE = 0.25  # of what was to be gained that a plan may miss and counts as found: what gives way is kept to some centimetres only
_REPAIRS = 3  # times as many as of a first plan: with as many, a long vehicle may lack 3 cm where 1.5 do
_DIVISORS = (2, 5)  # of the distance of stations: whole numbers, so that horizon and replanning distance remain multiples of it
_FIRST_M, _MOST = 0.2, 20  # clearance that is tried beyond the room of a plan, then twice that, and so on; plans at most
NEAR_M = 0.05  # room to spare below which people ask whether more can be had
LONG_M = 1000.0  # a road on which the plans that tell how much take longer than people wait for it
_WORTH = 0.1  # metres lacking at best per metre between stations beyond which a finer plan is not tried: that much is hardly ever gained


def replanned(result: Result, *, on_progress: Callable[[float], None] | None = None) -> Result:
    """Return the plan that lacks the least room, of one that breaks its limits and of others of its case; other plans as they are.

    Each lists in ``attempts`` what was tried. The others are planned with limits that give way; then, unless a proof says that nothing
    fits, with stations nearer together, until one fits or too much is lacking for that. All are judged by the limits as they are.
    ``on_progress`` receives the share of the attempts that are made, 0 to 1.
    """
    if verdict_of(result).fits is not False:
        return result
    best, attempts = result, [_attempt(result)]
    most = ceil(log(attempts[0].lacking / KEPT_M, 2.0 / (1.0 + _SHARE))) + len(_DIVISORS)
    with suppress(HdvplanError):  # what cannot be planned so is no better answer
        for found in _others(result, attempts[0].lacking):
            least = min(attempt.lacking for attempt in attempts)
            attempts.append(_attempt(found))
            best = found if attempts[-1].lacking < least else best
            if on_progress is not None:
                on_progress(min(1.0, (len(attempts) - 1) / most))
    return result if len(attempts) == 1 else replace(best, proof=result.proof, attempts=tuple(attempts))


def _others(result: Result, least: float) -> Iterator[Result]:
    """Make other plans of a case whose first plan lacks ``least`` [m]."""
    settings, none = result.case.settings, 0.0  # none: no plan is known that lacks only that much
    while least > max(KEPT_M, none + KEPT_M):
        give_way = 0.5 * (none + least)
        giving = replace(settings, give_way=give_way, rti_repairs=_REPAIRS * settings.rti_repairs)
        found = api.plan(replace(result.case, settings=giving))
        yield found
        lacking = _attempt(found).lacking
        missed = lacking > give_way + _SHARE * (least - give_way)
        least, none = min(least, lacking), give_way if missed else none
    for divisor in () if result.proof else _DIVISORS:
        finer = _divided(settings, divisor)
        if finer is None or not 0.0 < least <= _WORTH * settings.step:
            return
        found = api.plan(replace(result.case, settings=finer))
        yield found
        least = min(least, _attempt(found).lacking)


def _attempt(result: Result) -> Attempt:
    verdict, settings = verdict_of(result), result.case.settings
    return Attempt(settings.step, settings.give_way, 0.0 if verdict.fits else -(verdict.spare or 0.0))


def _divided(settings: PlannerSettings, divisor: int) -> PlannerSettings | None:
    """Return settings with stations so many times as near; None where that is finer than a plan may be."""
    step = settings.step / divisor
    if step < SHORTEST_STEP_M or settings.stages * divisor > MOST_STAGES:
        return None
    return replace(settings, step=step, give_way=0.5 * KEPT_M)  # half of what counts as kept


def is_near(result: Result) -> bool:
    """Tell whether a plan fits and comes nearer to its limits than people like, for its objective does not ask for room."""
    verdict = verdict_of(result)
    return bool(verdict.fits) and verdict.spare is not None and verdict.clearance_wanted + verdict.spare < NEAR_M


def clearest(result: Result, *, on_progress: Callable[[float], None] | None = None) -> Result:
    """Return the plan that was asked for the largest clearance and keeps it, to 1 cm, of one that fits and others of its case.

    Plans that do not fit, and those on roads without limits, are returned as they are. The clearance is that of the returned case's
    settings. ``on_progress`` receives the share of the plans that are made at most, 0 to 1.
    """
    if not verdict_of(result).fits or result.balance.min_clearance is None:
        return result
    best, kept, missed, step = result, result.case.settings.clearance, inf, result.balance.min_clearance + _FIRST_M
    for number in range(_MOST):
        if missed - kept <= KEPT_M:
            break
        wanted, step = (kept + step, 2.0 * step) if missed == inf else (0.5 * (kept + missed), step)
        found = result
        with suppress(HdvplanError):  # what cannot be planned so is too much
            found = api.plan(replace(result.case, settings=replace(result.case.settings, clearance=wanted)))
        if found is not result and verdict_of(found).fits:
            best, kept = found, wanted
        else:
            missed = wanted
        if on_progress is not None:
            on_progress((number + 1) / _MOST)
    return best
