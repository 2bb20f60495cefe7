"""The answer to what a vehicle needs on a road: the least room, where it is decided, and the least widening of the road's own limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hdvplan.case import Case
from hdvplan.judging.bodies import part_named
from hdvplan.judging.clearance import SIDES
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import lonlat_of
from hdvplan.need.bound import Bound, proved_below
from hdvplan.need.room import OTHER, beside_held, even, kerbs_on, least_edge, least_half_width
from hdvplan.need.search import WIDE_M, Least
from hdvplan.need.widening import Widenings, least_widenings, own_plans
from hdvplan.road.street import Kerb


@dataclass(frozen=True)
class Place:
    """The point of a vehicle that decides how much room it needs; see ``Verdict`` for the frame."""

    s: float  #: arclength [m]
    x: float
    y: float
    lonlat: tuple[float, float] | None
    side: str  #: "left" or "right"
    unit: int  #: index of the body
    part: str  #: of the body, see ``contact``


@dataclass(frozen=True)
class Need:
    """What ``case.vehicle`` needs on ``case.road``.

    ``room`` is the least half width, or the least reach on ``side`` with the other edge fixed. ``widenings`` are those of the road's own
    street, on ``side`` alone if an edge was fixed; None if it has none. ``held`` is the least reach of the fixed edge with the other side
    wide open; it is computed only if no plan keeps that edge.
    """

    case: Case
    side: str | None
    room: Least
    place: Place | None  #: where ``room`` is decided; None where no plan was found
    held: Least | None
    widenings: Widenings | None
    bound: Bound | None = None  #: room that is proved to be too little; None if nothing is proved or no proof was wanted


def need_of(case: Case, *, prove: bool | None = False, on_progress: Callable[[float], None] | None = None) -> Need:
    """Return the least half width for a case, and the least widening of its road's own street where it has one.

    With ``prove`` the largest half width that is proved to be too small is also computed, which takes some seconds more; None: unless the
    vehicle fits as the road is. ``on_progress`` receives a share that grows from 0 to 1.
    """
    ends = _ends(prove=prove is not False)
    known = own_plans(case)
    room = least_half_width(case, known, on_progress=_part(on_progress, 0.0, ends[0]))
    widenings = _widenings(case, known, SIDES, room, _part(on_progress, *ends))
    last, wanted = _part(on_progress, ends[1], 1.0), _fits(widenings) is not True if prove is None else prove
    bound = proved_below(case, even(case.road), room, SIDES, None, on_progress=last) if wanted else None
    return Need(case, None, room, _place(room.result, SIDES), None, widenings, bound)


def edge_need_of(
    case: Case, held: tuple[Kerb, ...], side: str, *, prove: bool | None = False, on_progress: Callable[[float], None] | None = None
) -> Need:
    """Return the least reach on ``side`` ("left" or "right") with the kerbs ``held`` on the other, and the least widening on ``side``.

    ``prove`` looks for the largest reach that is proved to be too small as well, and ``on_progress`` is told, as for ``need_of``.
    """
    ends, sides, road = _ends(prove=prove is not False), (side,), beside_held(case.road, held, side)
    own = case if case.road.limits is None else replace(case, road=case.road.with_kerbs((*held, *kerbs_on(case.road, side))))
    known = own_plans(own)
    room = least_edge(case, held, side, known, on_progress=_part(on_progress, 0.0, ends[0]))
    widenings = _widenings(own, known, sides, room, _part(on_progress, *ends))
    last, wanted = _part(on_progress, ends[1], 1.0), _fits(widenings) is not True if prove is None else prove
    if room.result is not None:
        bound = proved_below(case, road, room, sides, None, on_progress=last) if wanted else None
        return Need(case, side, room, _place(room.result, sides), None, widenings, bound)
    other = OTHER[side]
    least = least_edge(case, kerbs_on(case.road.with_limits(WIDE_M, WIDE_M), side), other)
    place = _place(least.result, (other,))
    bound = proved_below(case, road, room, sides, None if place is None else place.s) if wanted else None
    return Need(case, side, room, place, least, widenings, bound)


def _widenings(
    case: Case, known: list[Result], sides: tuple[str, ...], room: Least, on_progress: Callable[[float], None] | None
) -> Widenings | None:
    if case.road.limits is None:
        return None
    if room.result is None:
        return Widenings(None, None, None)  # what no width lets pass, no widening does
    return least_widenings(case, [*known, room.result], sides, on_progress=on_progress)


def _fits(widenings: Widenings | None) -> bool | None:
    return None if widenings is None else widenings.fitting is not None


def _ends(*, prove: bool) -> tuple[float, float]:
    """Return the shares of the time after which the least room and the widenings are known."""
    return (0.2, 0.6) if prove else (0.4, 1.0)


def _part(on_progress: Callable[[float], None] | None, start: float, end: float) -> Callable[[float], None] | None:
    return None if on_progress is None else lambda share: on_progress(start + (end - start) * share)


def _place(result: Result | None, sides: tuple[str, ...]) -> Place | None:
    """Return where a plan came nearest to the kerbs on some sides: with less room they would be broken there first."""
    if result is None:
        return None
    nearest = {key: touch for key, touch in result.balance.touches.items() if key[0] in sides}
    where, region = min(nearest, key=lambda key: float(np.min(nearest[key]["gap"])))
    touches = nearest[where, region]
    unit, at = (int(number) for number in np.unravel_index(np.argmin(touches["gap"]), touches.shape))
    s, x, y, ahead = (float(touches[unit, at][name]) for name in ("s", "x", "y", "ahead"))
    return Place(s, x, y, lonlat_of(result, x, y), where, unit, part_named(result.drive.vehicle.units[unit], ahead))
