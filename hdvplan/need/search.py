"""The least room for which a plan exists, searched by plans within less and less: an even half width, or one edge while the other is held.

Every attempt is a whole plan, judged by its simulation, and bounds the answer from above by the room in which it just touches the kerbs,
whatever it was asked to keep: where kerbs move outwards, every gap grows by at least as much. From below nothing is proved: a value is
called out of reach where no attempt reaches it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hdvplan import api
from hdvplan.case import Case
from hdvplan.errors import HdvplanError, PlanError, RoadError, SolverError
from hdvplan.judging.balance import KEPT_M, balance_of, gaps_of
from hdvplan.judging.clearance import SIDES, Approach, touches_along, touches_of
from hdvplan.judging.result import Result
from hdvplan.planning.planner import Plan
from hdvplan.planning.settings import Scheme
from hdvplan.planning.stations import ROOM_M
from hdvplan.road.pieces import Kerb
from hdvplan.road.road import Road

TOLERANCE_M = 0.01  # of every answer
WIDE_M = 15.0  # no more room is looked for; obstacles count to 20 m off the line
_ROUNDING_M = 1e-6
_SURE_M = 1e-3  # more than what is executed is off what was planned
_STEP_M = 0.32  # by which a search begins to ask for less
_SHRINKS = 4.0  # by how much the step does where a plan does not keep what was asked for
_AGAIN_M = 0.04  # the step of later passes: often a plan that is asked for much less needs less than one that is asked for little less
_GAIN_M = 5e-3  # a pass that gains less is the last
_NONE_M = 0.1  # the least reach that is asked for: kerbs of one side lie on that side of the line
OTHER = {"left": "right", "right": "left"}
_GIVES_M = 8e-3  # a plan within limits that can be kept needs no more: they are elastic, and 5 to 8 mm beyond them is usual in bends


# Objectives, by RTI; where nothing fits SQP takes up to ten times as long. Within the same limits these end in different local optima.
ATTEMPTS = ("geometric", "lead-axle")
_SEARCHED = "balanced"  # of eight the one that needed least within little room on five roads, by up to 2 cm


@dataclass(frozen=True)
class Question:
    """What is to be least: a room, by the road that leaves it. The kerbs on ``sides`` move with it, the others must be kept."""

    road: Callable[[float], Road]
    sides: tuple[str, ...]
    lowest: float  # no less is asked for [m]
    first: tuple[float, ...]  # what is asked for until a plan is found that would do [m]

    def needed(self, result: Result, room: float) -> float:
        """Return how much room a plan within ``room`` needed, the clearance wanted included [m]; infinite where no room would do.

        Where it left some, kerbs are moved in until they touch: inside corners that is less than the gap.
        """
        spare = spare_of(result)
        held = min((spare[side] for side in SIDES if side not in self.sides), default=0.0)
        if min(held, _islands_spare(result)) < -KEPT_M or too_near(result) is not None:
            return np.inf
        least = min(*(spare[side] for side in self.sides), room)  # infinite where a street wider than its turn has no kerb inside
        if least > 0.0:
            nearer = max(room - least, self.lowest)
            there = self._spare(result, nearer)
            if there < 0.0:
                room -= (room - nearer) * least / (least - there)
                there = self._spare(result, room)
            else:
                room = nearer
            least = min(there, 0.0)
        return max(self.lowest, room - least)

    def _spare(self, result: Result, room: float) -> float:
        spare = spare_of(result, self.road(room))
        return min(spare[side] for side in self.sides)


@dataclass(frozen=True)
class Least:
    """The least room that was reached, and the plan that reached it, judged there; ``result`` is None where nothing did."""

    room: float  # infinite where nothing did [m]
    result: Result | None
    lowest: float  # no less was asked for [m]
    out_of_reach: float  # the most room within which every attempt failed, or the least that may be asked for [m]
    plans: int  # that were made
    failure: HdvplanError | None  # of the last attempt that ended in one
    blocked: Approach | None = None  # the obstacle that the last plan which does not pass comes too near to, if there is one


class _WorseError(Exception):
    """A drive ends because it needs more than another did."""


def least(
    case: Case,
    question: Question,
    known: Sequence[Result] = (),
    *,
    on_progress: Callable[[float], None] | None = None,
    on_result: Callable[[Result], None] | None = None,
) -> Least:
    """Return the least room of ``question`` along ``case.road``, to ``TOLERANCE_M``.

    Plans that are ``known``, made for any street of the same line, or one within the first limits give a bound. From there the search goes
    down, in steps that shrink where they fail, of at most half of what may be asked for: plans within far too little room take longest.
    ``on_progress`` receives how far a pass is, from 0 to 1, ``on_result`` every new plan; without it those that are seen to need more than
    another end there.
    """
    best = Least(np.inf, None, question.lowest, question.lowest, 0, None)
    for result in known:
        best = _better(best, question, on_road(result, question.road(question.first[0])), question.first[0])
    for room in question.first:
        if not np.isfinite(best.room):
            best = _tried(case, question, room, ATTEMPTS, best, on_result)
    step, before = _STEP_M, best.room
    while np.isfinite(best.room) and best.room - question.lowest > TOLERANCE_M + _ROUNDING_M:
        room, wanted = best.room, best.room - max(min(step, 0.5 * (best.room - question.lowest)), TOLERANCE_M)
        last = room - wanted <= TOLERANCE_M + _ROUNDING_M
        if last and wanted - _ROUNDING_M <= best.out_of_reach < room:
            break  # the pass before asked for it
        best = _tried(case, question, wanted, (_SEARCHED,), best, on_result)
        if last:
            best = replace(best, out_of_reach=wanted) if room - best.room < _GAIN_M else best
            if before - best.room < _GAIN_M:
                break
            step, before = _AGAIN_M, best.room
        elif best.room > wanted + _GIVES_M:
            step /= _SHRINKS
        if on_progress is not None:
            on_progress(1.0 - min(1.0, step / _STEP_M))
    return best if best.result is None else replace(best, result=on_road(best.result, question.road(best.room)))


def plans_of(case: Case, objectives: Sequence[str], on_plan: Callable[[Plan], None] | None = None) -> Iterator[Result | HdvplanError]:
    """Plan a case by every one of ``objectives``, one after the other; a plan that cannot be made gives its error."""
    settings = replace(case.settings, scheme=Scheme.RTI)
    for objective in objectives:
        try:
            yield api.plan(replace(case, objective=objective, settings=settings), on_plan=on_plan)
        except (PlanError, RoadError, SolverError) as error:  # an obstacle with a given side may leave no room within narrow limits
            yield error


def spare_of(result: Result, road: Road | None = None) -> dict[str, float]:
    """Return the least gap to the kerbs on each side, of its own road or another, beyond the clearance wanted; negative: lacking [m].

    Sweepable areas are not among them: they stay where kerbs move.
    """
    clearance, drive = result.case.settings.clearance, result.drive
    street = replace(road or drive.road, faces=())
    gaps = gaps_of(touches_of(replace(drive, road=street), result.envelope.s)) if road or street.regions else result.gaps
    return {side: min(float(np.min(gap)) for (of, _), gap in gaps.items() if of == side) - clearance for side in SIDES}


def _islands_spare(result: Result) -> float:
    """Return the least gap of wheels to the sweepable areas, beyond the clearance wanted; infinite without any [m]."""
    islands = replace(result.drive.road, limits=None, drawn=None)
    gaps = gaps_of(touches_of(replace(result.drive, road=islands), result.envelope.s))
    return min((float(np.min(gap)) for gap in gaps.values()), default=np.inf) - result.case.settings.clearance


def too_near(result: Result) -> Approach | None:
    """Return how a plan passes the obstacle to which it keeps least of the clearance wanted; None if it keeps it to all."""
    nearest = min(result.approaches, key=lambda approach: approach.distance, default=None)
    wanted = result.case.settings.clearance - KEPT_M
    return nearest if nearest is not None and nearest.distance < wanted else None


def _tried(
    case: Case, question: Question, room: float, attempts: Sequence[str], best: Least, on_result: Callable[[Result], None] | None
) -> Least:
    """Try all ways within ``room`` until one needs no more; return what is the least now."""
    within = replace(case, road=question.road(room))
    watched = _worse(within, question.sides, best.room - room) if on_result is None and np.isfinite(best.room) else None
    try:
        for made in plans_of(within, attempts, watched):
            best = replace(best, plans=best.plans + 1)
            if isinstance(made, HdvplanError):
                best = replace(best, failure=made)
                continue
            best = replace(best, blocked=too_near(made) or best.blocked)
            if on_result is not None:
                on_result(made)
            best = _better(best, question, made, room)
            if best.room <= room + _GIVES_M:
                break
    except _WorseError:
        best = replace(best, plans=best.plans + 1)
    return best


def _worse(case: Case, sides: Sequence[str], lacking: float) -> Callable[[Plan], None]:
    """Return what ends a drive by ``_WorseError`` where it lacks more than ``lacking`` [m] to the kerbs on ``sides``.

    What a plan predicts says where to look; what counts is how far the part that is executed goes beyond the kerbs.
    """
    road, vehicle, settings = replace(case.road, faces=()), case.vehicle, case.settings
    street, path = road.kerbs, road.path.extended(vehicle.reach_behind + ROOM_M, vehicle.reach_ahead + ROOM_M + settings.horizon)
    pieces = None if street is None else street.pieces(path.s_first, path.s_last)
    chosen = [SIDES.index(side) for side in sides]

    def look(plan: Plan) -> None:
        if pieces is None or plan.violation <= lacking:
            return
        s = settings.step * (plan.first + np.arange(settings.executed + 1, dtype=np.float64))
        touches = touches_along(vehicle, path, pieces, s, plan.z[: len(s)], plan.kappa[: len(s) - 1])[:, :, chosen]
        gap = np.where(touches["piece"] < 0, np.inf, touches["gap"])
        if settings.clearance - np.min(gap) > lacking + _SURE_M:
            raise _WorseError

    return look


def _better(best: Least, question: Question, result: Result, room: float) -> Least:
    needed = question.needed(result, room)
    return replace(best, room=needed, result=result) if needed < min(best.room, WIDE_M) else best


def on_road(result: Result, road: Road) -> Result:
    """Return the same drive judged on another road of the same line, whose regions it passes on the same sides."""
    there = replace(road, faces=result.drive.road.faces)
    case, drive = replace(result.case, road=there), replace(result.drive, road=there)
    return replace(result, case=case, drive=drive, balance=balance_of(drive), proof=None, attempts=())


def even(road: Road) -> Callable[[float], Road]:
    """Return what gives the road with kerbs a half width [m] to both sides of its line."""
    return lambda half: road.with_limits(half, half)


def beside_held(road: Road, held: tuple[Kerb, ...], side: str) -> Callable[[float], Road]:
    """Return what gives the road with the kerbs ``held``, and those on ``side`` at a reach [m] from its line."""
    return lambda reach: road.with_kerbs((*held, *kerbs_on(road.with_limits(reach, reach), side)))


def kerbs_on(road: Road, side: str) -> tuple[Kerb, ...]:
    """Return the kerbs on one side of a road, "left" or "right"; none without limits."""
    return () if road.kerbs is None else tuple(kerb for kerb in road.kerbs.kerbs if kerb.left == (side == "left"))


def least_half_width(case: Case, known: Sequence[Result] = (), *, on_progress: Callable[[float], None] | None = None) -> Least:
    """Return the least half width W for which a plan keeps +-W everywhere, and what obstacles leave of it.

    The road's own widths do not count; its obstacles and the clearance wanted do. ``known`` are plans for other streets of the same line.
    """
    lowest = 0.5 * case.vehicle.width + case.settings.clearance
    return least(case, Question(even(case.road), SIDES, lowest, _first(case)), known, on_progress=on_progress)


def least_edge(
    case: Case, held: tuple[Kerb, ...], side: str, known: Sequence[Result] = (), *, on_progress: Callable[[float], None] | None = None
) -> Least:
    """Return the least reach on ``side`` ("left" or "right") for which a plan keeps the kerbs ``held``, which lie opposite.

    Nothing is reached, and ``result`` is None, where no plan keeps them. ``known`` are plans as for ``least_half_width``.
    """
    return least(case, Question(beside_held(case.road, held, side), (side,), _NONE_M, _first(case)), known, on_progress=on_progress)


def _first(case: Case) -> tuple[float, ...]:
    """Return what is asked for first: so much that limits hardly matter; where an obstacle cannot be passed so, less [m]."""
    return WIDE_M, 2.0 * case.vehicle.width, 4.0 * case.vehicle.width
