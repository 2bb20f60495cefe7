"""The sides on which each obstacle can be passed at all, and how far apart obstacles must be not to bear on each other."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from hdvplan.arrays import BoolArray, FloatArray
from hdvplan.case import Case
from hdvplan.centring.stationary import CentringTable
from hdvplan.errors import RoadError
from hdvplan.judging.balance import KEPT_M
from hdvplan.road.passages import Passage
from hdvplan.road.regions import Side, called
from hdvplan.road.road import Road

_CLEAR_M = 0.5  # an obstacle this far from what is swept leaves no choice
_MOST_DETOUR_M = 6.0  # of an obstacle's edge from the line
_SETTLED_M = 5.0  # more than the least road for changing sides: see docs/maths.md


@dataclass(frozen=True)
class Options:
    """The sides on which an obstacle can be passed, the usual one first; ``reason`` says why there is only one."""

    sides: tuple[Side, ...]
    forced: bool = False
    reason: str | None = None
    blocked: bool = False  # neither side has room: ``sides`` is the one that lacks less

    @property
    def open(self) -> bool:
        """Whether there is anything to choose."""
        return len(self.sides) > 1


def options_of(case: Case) -> list[Options]:
    """Return the options of every passage of the case's road.

    An obstacle beside the line has only its usual side where the vehicle, balanced everywhere, does not come near it, and no detour
    around another one leads there. A side is closed where the road's edge, or an obstacle that leaves no choice, lies nearer to the
    obstacle than the vehicle is wide.

    Raises:
        RoadError: an obstacle has no room on the side on which it must be passed.

    """
    road = case.road
    options = [_by_place(case, passage, road.regions[passage.region].side) for passage in road.passages]
    _reopen(case, options)
    spans = spans_of(road.passages)
    looked: Iterable[int] = range(len(options))
    while True:  # an obstacle with one side left may close another's
        fixed = {number: option.sides[0] for number, option in enumerate(options) if not option.open}
        found = {number: _by_room(case, spans, number, options[number], fixed) for number in looked}
        closed = [number for number, option in found.items() if options[number].open and not option.open]
        for number, option in found.items():
            options[number] = option
        if not closed:
            return options
        looked = [int(number) for number in np.flatnonzero(np.any([_shares(road, spans, number) for number in closed], axis=0))]


def _shares(road: Road, spans: FloatArray, number: int) -> BoolArray:
    """Return which passages share a place of the road with one of them, shape (passages,); ``spans`` are where they begin and end [m]."""
    begin, end = spans
    laps = road.path.length * np.array([-1.0, 0.0, 1.0]) if road.path.closed else np.zeros(1)
    return np.asarray(np.any([(begin + lap <= end[number]) & (end + lap >= begin[number]) for lap in laps], axis=0))


def spans_of(passages: Sequence[Passage]) -> FloatArray:
    """Return where passages begin and end, shape (2, passages) [m]."""
    return np.array([[passage.s_from, passage.s_to] for passage in passages]).reshape(-1, 2).T


def independent_m(case: Case, passages: Sequence[Passage]) -> float:
    """Return the distance between obstacles from which on one's side has no bearing on the other's [m].

    The vehicle's length, and the road that it takes from the furthest detour on one side to the furthest on the other: two arcs of its
    tightest curvature, entered and left at its curvature rate.
    """
    vehicle = case.vehicle
    furthest = max((max(abs(passage.low), abs(passage.high)) for passage in passages), default=0.0)
    across = 2.0 * min(furthest, _MOST_DETOUR_M) + vehicle.width
    turn = 2.0 * np.sqrt(across / vehicle.max_curvature) + 2.0 * vehicle.max_curvature / vehicle.max_curvature_rate
    return float(vehicle.reach_ahead + vehicle.reach_behind + turn + _SETTLED_M)


def _by_place(case: Case, passage: Passage, side: Side | None) -> Options:
    """Return an obstacle's options as its place has them, whatever room there is."""
    if passage.around:
        return Options((passage.usual,), reason="it lies on both sides of the line")
    if not case.road.path.closed and (passage.s_to < 0.0 or passage.s_from > case.road.path.length):
        return Options((passage.usual,), reason="it lies beyond the road's end")
    if side is not None:
        return Options((side,), forced=True, reason="its side is given")
    if not passage.on_line and _apart(case, passage) > _CLEAR_M:
        return Options((passage.usual,), reason=_FAR)
    return Options((passage.usual, passage.usual.other))


_FAR = "the swept area does not come near it"


def _apart(case: Case, passage: Passage) -> float:
    """Return the room between an obstacle beside the line and what the vehicle sweeps, balanced everywhere [m]."""
    vehicle, path = case.vehicle, case.road.path
    s = np.clip(np.arange(passage.s_from - vehicle.reach_behind, passage.s_to + vehicle.reach_ahead, 0.5), 0.0, path.length)
    swept = CentringTable.of(vehicle).at(path.at(s).curvature)
    if np.any(swept.saturated):
        return -np.inf
    half, aim = float(np.max(swept.half_width)) + case.settings.clearance, case.bias.at(s)
    return float(passage.low - np.max(aim) - half if passage.low > 0.0 else np.min(aim) - passage.high - half)


def _reopen(case: Case, options: list[Options]) -> None:
    """Open both sides of obstacles to which a detour around an open one leads; walls along the road stay where they are."""
    open_ = [number for number, option in enumerate(options) if option.open]
    passages = case.road.passages
    near = independent_m(case, [passages[number] for number in open_])
    reach = case.vehicle.width + 2.0 * case.settings.clearance + _CLEAR_M
    begin, end = spans_of(passages)
    low, high = np.array([[passage.low, passage.high] for passage in passages]).reshape(-1, 2).T
    left = (end - begin < near) & np.array([option.reason == _FAR for option in options], dtype=bool)
    for number in open_:  # grows
        here = passages[number]
        beside = (low < here.high + reach) & (high > here.low - reach)
        for other in np.flatnonzero(left & beside & (begin < here.s_to + near) & (end > here.s_from - near)).tolist():
            there = passages[other]
            options[other] = Options((there.usual, there.usual.other))
            left[other] = False
            open_.append(other)


def _room(road: Road, spans: FloatArray, number: int, side: Side, others: Mapping[int, Side]) -> float:
    """Return the least distance [m] between a passage's polygon and what lies on that side of it: a kerb, or one of ``others``."""
    passage, shared = road.passages[number], _shares(road, spans, number)
    beside = {road.passages[other].region for other, its in others.items() if shared[other] and its is not side} - {passage.region}
    apart = shapely.distance(road.regions[passage.region].polygon, [road.regions[other].polygon for other in beside])
    return float(np.min(apart, initial=passage.rooms[side]))


def _by_room(case: Case, spans: FloatArray, number: int, option: Options, fixed: Mapping[int, Side]) -> Options:
    """Return an obstacle's options without those that have no room beside ``fixed`` obstacles."""
    if not (option.open or option.forced):
        return option
    passage, width = case.road.passages[number], case.vehicle.width
    own = passage.usual if option.open and not passage.on_line else None  # where the line passes it: closed to bodies, not to a clearance
    asked = {side: width if side is own else width + 2.0 * case.settings.clearance for side in option.sides}
    rooms = {side: _room(case.road, spans, number, side, fixed) for side in option.sides}
    closed = {
        side: f"{room:.2f} m to the {side} of it, {asked[side]:.2f} m needed"
        for side, room in rooms.items()
        if room < asked[side] - 2.0 * KEPT_M
    }
    if option.forced and closed:
        (side, why), label = next(iter(closed.items())), case.road.regions[passage.region].label
        s, missing = 0.5 * (passage.s_from + passage.s_to), asked[side] - rooms[side]
        msg = f"{called(label)} at s = {s:z.1f} m cannot be passed on the {side}: {why}, {missing:.2f} m missing"
        raise RoadError(msg, s_m=s, hint="give no side, to pass it where there is more room")
    if option.forced or not closed:
        return option
    if len(closed) == len(option.sides):
        widest = max(rooms, key=lambda side: rooms[side])
        why = f"both sides are closed; {widest}: {closed[widest]}; {widest.other}: {closed[widest.other]}"
        return Options((widest,), reason=why, blocked=True)
    ((side, why),) = closed.items()
    return Options((side.other,), reason=f"{side} is closed: {why}")
