"""The least room for which a plan exists, searched over objectives and schemes.

Every attempt is a whole plan, judged by its simulation, and bounds the answer from above by what it really took, whatever it was asked
to keep. From below nothing is proved: a value is called out of reach where no attempt reaches it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from hdvplan import api
from hdvplan.case import Case
from hdvplan.errors import HdvplanError, PlanError, RoadError, SolverError
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.obstacles import Approach
from hdvplan.judging.result import Result
from hdvplan.need.measure import Taken, taken_by
from hdvplan.planning.settings import Scheme
from hdvplan.road.road import Limits

TOLERANCE_M = 0.01  # of every answer
WIDE_M = 15.0  # no more room is looked for; obstacles count to 20 m off the line
_ROUNDING_M = 1e-6


class Attempt(NamedTuple):
    """One way to plan a case, by the names that the command line knows."""

    objective: str
    scheme: Scheme


# Within the same limits these end in different local optima. The cheap and usually best ones come first.
ATTEMPTS = (
    Attempt("geometric", Scheme.RTI),
    Attempt("lead-axle", Scheme.RTI),
    Attempt("balanced", Scheme.RTI),
    Attempt("geometric", Scheme.SQP),
    Attempt("lead-axle", Scheme.SQP),
    Attempt("balanced", Scheme.SQP),
)
FREE = (Attempt("body-max", Scheme.RTI), Attempt("geometric", Scheme.RTI))  # within limits so wide that they are none


@dataclass(frozen=True)
class Question:
    """What is to be least: the road's own limits that leave a given room, and the room that a plan needed."""

    band: Callable[[float], Limits]
    needed: Callable[[Taken], float]  # infinite where no room would do [m]
    lowest: float  # no less is asked for [m]


@dataclass(frozen=True)
class Least:
    """The least room that was reached, and the plan that reached it; ``result`` is None where nothing did."""

    room: float  # infinite where nothing did [m]
    result: Result | None
    lowest: float  # no less was asked for [m]
    out_of_reach: float  # the most room within which every attempt failed, or the least that may be asked for [m]
    plans: int  # that were made
    failure: HdvplanError | None  # of the last attempt that ended in one
    blocked: Approach | None = None  # the obstacle that the last plan which does not pass comes too near to, if there is one


def least(
    case: Case,
    question: Question,
    *,
    on_progress: Callable[[float], None] | None = None,
    on_result: Callable[[Result, Taken], None] | None = None,
) -> Least:
    """Return the least room of ``question`` along ``case.road``, to ``TOLERANCE_M``.

    Plans within wide limits give a first bound; from there the search goes down, in steps that grow while they succeed, then by halves.
    ``on_progress`` receives a share that grows from 0 to 1, ``on_result`` every plan and what it took.
    """
    best = _tried(case, question, WIDE_M, FREE, Least(np.inf, None, question.lowest, question.lowest, 0, None), on_result, every=True)
    room = 2.0 * case.vehicle.width
    while not np.isfinite(best.room) and room < WIDE_M:
        best, room = _tried(case, question, room, ATTEMPTS, best, on_result), 2.0 * room
    if not np.isfinite(best.room):
        return best
    step, whole = TOLERANCE_M, max(best.room - best.out_of_reach, TOLERANCE_M)
    while best.room - best.out_of_reach > TOLERANCE_M + _ROUNDING_M:
        wanted = max(best.room - step, best.out_of_reach)
        best = _tried(case, question, wanted, ATTEMPTS, best, on_result)
        if best.room <= wanted + _ROUNDING_M:
            step = 2.0 * step if wanted - TOLERANCE_M > best.out_of_reach else TOLERANCE_M
            if wanted <= question.lowest:
                break
        else:
            best = replace(best, out_of_reach=wanted)
            step = max(0.5 * (best.room - wanted), TOLERANCE_M)
        if on_progress is not None:
            on_progress(1.0 - min(1.0, (best.room - best.out_of_reach) / whole))
    return best


def plans_of(case: Case, attempts: Sequence[Attempt]) -> Iterator[Result | HdvplanError]:
    """Plan a case in every way of ``attempts``, one after the other; a plan that cannot be made gives its error."""
    for attempt in attempts:
        settings = replace(case.settings, scheme=attempt.scheme)
        try:
            yield api.plan(replace(case, objective=attempt.objective, settings=settings))
        except (PlanError, RoadError, SolverError) as error:  # an obstacle with a given side may leave no room within narrow limits
            yield error


def _tried(
    case: Case, question: Question, room: float, attempts: Sequence[Attempt], best: Least,
    on_result: Callable[[Result, Taken], None] | None, *, every: bool = False,
) -> Least:  # fmt: skip
    """Try all ways within ``room``, until one needs no more unless ``every`` is wanted; return what is the least now."""
    road = case.road.within(question.band(room))
    for made in plans_of(replace(case, road=road), attempts):
        best = replace(best, plans=best.plans + 1)
        if isinstance(made, HdvplanError):
            best = replace(best, failure=made)
            continue
        took = taken_by(made)
        if not took.passes:
            best = replace(best, blocked=_too_near(made) or best.blocked)
        if on_result is not None:
            on_result(made, took)
        needed = question.needed(took)
        if needed < min(best.room, WIDE_M):
            best = replace(best, room=needed, result=made)
        if not every and best.room <= room + _ROUNDING_M:
            break
    return best


def _too_near(result: Result) -> Approach | None:
    """Return how a plan passes the obstacle to which it keeps least of the clearance wanted; None if it keeps it to all."""
    nearest = min(result.approaches, key=lambda approach: approach.distance, default=None)
    wanted = result.case.settings.clearance - KEPT_M
    return nearest if nearest is not None and nearest.distance < wanted else None
