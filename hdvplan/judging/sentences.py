"""Sentences about a judged drive: how it was planned, and what it breaks."""

from __future__ import annotations

import math

from hdvplan.judging.balance import KEPT_M, Breach
from hdvplan.judging.clearance import Approach
from hdvplan.judging.result import Result, body_name
from hdvplan.road.regions import called, limit_called

_NAMED = 3  # obstacles in a sentence; more are counted


def solver_texts(result: Result) -> list[str]:
    """Return a sentence for each way in which the solver that was asked for did not plan the whole drive; none where it did."""
    steps, at, texts = len(result.drive.plans), result.drive.stations.s, []
    if result.rescued:
        first, name = result.rescued[0], result.solver
        where = f"first at s = {at[first.first]:z.1f} m"
        texts.append(f"{name} failed in {len(result.rescued)} of {steps} planning steps, {where}: {first.instead}")
    if result.failed:
        first = result.failed[0]
        where = f"first at s = {at[first.first]:z.1f} m" + (f" ({first.reason})" if first.reason else "")
        texts.append(f"{len(result.failed)} of {steps} planning steps were not solved, {where}: the vehicle followed the last plan")
    return texts


def passed_texts(result: Result) -> list[str]:
    """Return on which side the first obstacles are passed, in order of s."""
    sides = [f"{called(one.obstacle.label)} on the {one.side}" for one in result.passed]
    more = f" and {len(sides) - _NAMED} more" if len(sides) > _NAMED else ""
    return [f"passes {', '.join(sides[:_NAMED])}{more}"] if sides else []


def farther_texts(result: Result) -> list[str]:
    """Return how far another plan can be kept from limits to which this one came as near as it could; none was looked for: nothing."""
    if result.most_clearance is None:
        return []
    more = result.most_clearance > result.case.settings.clearance + KEPT_M
    found = f"one that keeps {result.most_clearance:.2f} m" if more else "none that keeps more"
    return [f"the plan comes as near as limits allow; --clearance max finds {found}"]


def attempts_text(result: Result) -> str:
    """Return how a case that was planned more than once came to its answer, without a capital or a full stop; "" of others."""
    if not result.attempts:
        return ""
    first, *others = result.attempts
    steps = " and ".join(f"{attempt.step:g} m" for attempt in others if attempt.step != first.step)
    ways = ["limits that give way"] * any(attempt.step == first.step for attempt in others) + [f"stations {steps} apart"] * bool(steps)
    least = min(result.attempts, key=lambda attempt: attempt.lacking)
    answer = "it fits" if least.lacking == 0.0 else f"{least.lacking:.3f} m are lacking at best"
    shown = "; --no-refine shows the first" if least.lacking > 0.0 and least.give_way > 0.0 else ""
    again = f"planned again with {', and with '.join(ways)}, {answer}: that is the plan here{shown}"
    return f"the first plan lacks {first.lacking:.3f} m; {again}"


def between_texts(result: Result, spare: float | None) -> list[str]:
    """Return how well a given path's points tell what is swept, and whether that is worse than the room to ``spare`` [m]."""
    apart, room = result.between or (0.0, 0.0)
    if room <= KEPT_M:
        return []
    known = f"what is swept is known to within {room:.2f} m at best" if math.isfinite(room) else "nothing tells how well it is known"
    texts = [f"points are up to {apart:.1f} m apart: between them, {known}; of a planned path give one every 0.5 to 1 m"]
    decides = spare is not None and room > abs(spare)
    return [*texts, f"with points up to {apart:.1f} m apart the answer may be the other one"] if decides else texts


def breach_text(result: Result, breach: Breach) -> str:
    """Return a sentence that says which body breaks which limit, by how much and where."""
    name = body_name(result.drive.vehicle, breach.unit)
    if breach.obstacle is not None:
        named = called(breach.obstacle)
        return f"the {breach.part} of the {name} enters {named} by {breach.depth:.3f} m at s = {breach.s_deepest:z.1f} m"
    limit = limit_called(breach.side, result.drive.road.binds(breach.side, breach.region, *breach.place))
    return f"the {breach.part} of the {name} breaks {limit} by {breach.depth:.3f} m at s = {breach.s_deepest:z.1f} m"


def entered_text(result: Result, approach: Approach) -> str:
    """Return a sentence that says which body enters which obstacle, by how much and where."""
    named, name = called(approach.obstacle.label), body_name(result.drive.vehicle, approach.unit)
    return f"the {approach.part} of the {name} enters {named} by {-approach.distance:.3f} m at s = {approach.s:z.1f} m"
