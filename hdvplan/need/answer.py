"""The answer to what a vehicle needs on a road: the least room, where it is decided, and the least widening of the road's own limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from hdvplan.arrays import runs_of
from hdvplan.case import Case
from hdvplan.judging.bodies import part_named
from hdvplan.judging.clearance import SIDES
from hdvplan.judging.result import Proof, Result
from hdvplan.need.search import OTHER, TOLERANCE_M, WIDE_M, Least, beside_held, even, kerbs_on, least_edge, least_half_width
from hdvplan.need.widening import Widenings, least_widenings, own_plans
from hdvplan.progress import part_of
from hdvplan.proof.answer import Stretch, joined, proof_of
from hdvplan.road.pieces import Kerb
from hdvplan.road.road import Road

_WITHIN_M = 0.3  # of the least gap: where a plan that is asked for less is expected to need it


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
class Bound:
    """Room that is proved to be too little, and the proof; what is less is too little as well."""

    room: float  # [m]
    proof: Proof


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
    given: tuple[float, float] | None = None  #: reaches left and right [m] of limits that are none of the road's own

    def __repr__(self) -> str:
        """Return one line, for a notebook."""
        what = self.side or "half width"
        return f"<{type(self).__name__} of {self.case.vehicle.name} on {self.case.road.name}: {self.room.room:.2f} m {what}>"

    @property
    def asked(self) -> str:
        """The limits that the vehicle fits within or not, in words."""
        if self.given is None:
            return "the road's own limits"
        left, right = self.given
        return f"{left:.2f} m to either side" if left == right else f"{left:.2f} m to the left and {right:.2f} m to the right"

    @property
    def fits(self) -> bool | None:
        """Whether the vehicle fits within the road's own limits; where there are none, None if some do, which is the answer, else False."""
        if self.widenings is not None:
            return self.widenings.fitting is not None
        return None if self.room.result is not None else False


def need_of(case: Case, *, prove: bool | None = False, on_progress: Callable[[float], None] | None = None) -> Need:
    """Return the least half width for a case, and the least widening of its road's own street where it has one.

    With ``prove`` the largest half width that is proved to be too small is also computed, which takes some seconds more; None: unless the
    vehicle fits as the road is. ``on_progress`` receives a share that grows from 0 to 1.
    """
    return _need(case, case, None, even(case.road), partial(least_half_width, case), prove=prove, on_progress=on_progress)


def edge_need_of(
    case: Case, held: tuple[Kerb, ...], side: str, *, prove: bool | None = False, on_progress: Callable[[float], None] | None = None
) -> Need:
    """Return the least reach on ``side`` ("left" or "right") with the kerbs ``held`` on the other, and the least widening on ``side``.

    ``prove`` looks for the largest reach that is proved to be too small as well, and ``on_progress`` is told, as for ``need_of``.
    """
    own = case if case.road.limits is None else replace(case, road=case.road.with_kerbs((*held, *kerbs_on(case.road, side))))
    road, least_of = beside_held(case.road, held, side), partial(least_edge, case, held, side)
    return _need(case, own, side, road, least_of, prove=prove, on_progress=on_progress)


def _need(
    case: Case,
    own: Case,
    side: str | None,
    road: Callable[[float], Road],
    least_of: Callable[..., Least],
    *,
    prove: bool | None,
    on_progress: Callable[[float], None] | None,
) -> Need:
    """Answer with the least room of ``least_of``; ``own`` is the case in the street as it is, ``road`` the one with some room."""
    ends, sides = ((0.4, 1.0) if prove is False else (0.2, 0.6)), SIDES if side is None else (side,)
    known = own_plans(own)
    room = least_of(known, on_progress=part_of(on_progress, 0.0, ends[0]))
    widenings = _widenings(own, known, sides, room, part_of(on_progress, *ends))
    place, held = _place(room.result, sides), None
    if room.result is None and side is not None:
        held = least_edge(case, kerbs_on(case.road.with_limits(WIDE_M, WIDE_M), side), OTHER[side])
        place = _place(held.result, (OTHER[side],))
    bound = None
    if prove or (prove is None and (widenings is None or widenings.fitting is None)):
        bound = proved_below(case, road, room, sides, None if place is None else place.s, on_progress=part_of(on_progress, ends[1], 1.0))
    return Need(case, side, room, place, held, widenings, bound)


def _widenings(
    case: Case, known: list[Result], sides: tuple[str, ...], room: Least, on_progress: Callable[[float], None] | None
) -> Widenings | None:
    if case.road.limits is None:
        return None
    if room.result is None:
        return Widenings(None, None, None)  # what no width lets pass, no widening does
    return least_widenings(case, [*known, room.result], sides, on_progress=on_progress)


def _place(result: Result | None, sides: tuple[str, ...]) -> Place | None:
    """Return where a plan came nearest to the kerbs on some sides: with less room they would be broken there first."""
    if result is None:
        return None
    nearest = {key: touch for key, touch in result.balance.touches.items() if key[0] in sides}
    where, region = min(nearest, key=lambda key: float(np.min(nearest[key]["gap"])))
    touches = nearest[where, region]
    unit, at = (int(number) for number in np.unravel_index(np.argmin(touches["gap"]), touches.shape))
    s, x, y, ahead = (float(touches[unit, at][name]) for name in ("s", "x", "y", "ahead"))
    return Place(s, x, y, result.drive.road.lonlat(x, y), where, unit, part_named(result.drive.vehicle.units[unit], ahead))


def proved_below(
    case: Case,
    road: Callable[[float], Road],
    least: Least,
    sides: tuple[str, ...],
    place: float | None,
    *,
    on_progress: Callable[[float], None] | None = None,
) -> Bound | None:
    """Return the most room, to ``TOLERANCE_M``, within which nothing is proved to fit; None where nothing is proved.

    ``road`` gives the road with a room, whose kerbs on ``sides`` move with it. Looked at are the places where the best plan came nearly as
    near to them as anywhere, or, without a plan, the arclength ``place`` [m]. Halving makes some seven proofs; ``on_progress`` receives
    their share, 0 to 1.
    """
    places = _places(least, sides, place)
    stretches = joined(places, case.vehicle, case.road.path.length)

    def tried(room: float) -> Bound | None:
        narrow = replace(case, road=road(room))
        proofs = (proof_of(narrow, stretch.s_from, stretch.s_to) for stretch in stretches)
        return next((Bound(room, proof) for proof in proofs if proof is not None), None)

    if least.result is None:
        return tried(WIDE_M)
    best, low, high = None, least.lowest, least.room
    halvings = int(np.ceil(np.log2(max((high - low) / TOLERANCE_M, 1.0))))
    for number in range(halvings):
        middle = 0.5 * (low + high)
        found = tried(middle)
        if found is None:
            high = middle
        else:
            best, low = found, middle
        if on_progress is not None:
            on_progress((number + 1) / halvings)
    return best


def _places(least: Least, sides: tuple[str, ...], place: float | None) -> list[Stretch]:
    if least.result is None:
        return [] if place is None else [Stretch(place, place, 0.0)]
    s = least.result.envelope.s
    gap = np.min([np.min(of_units, axis=0) for (side, _), of_units in least.result.gaps.items() if side in sides], axis=0)
    runs = [slice(begin, end) for begin, end in runs_of(gap < np.min(gap) + _WITHIN_M)]
    return [Stretch(float(s[run][0]), float(s[run][-1]), -float(np.min(gap[run]))) for run in runs]
