"""The answer to what a vehicle needs on a road: the least room, where it is decided, and the least widening of the road's own limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hdvplan.case import Case
from hdvplan.judging.contact import contact
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import point_of
from hdvplan.need.bound import Bound, proved_below
from hdvplan.need.measure import OUTWARDS, ROWS, taken_by
from hdvplan.need.room import ASKED, edge_band, even_band, least_edge, least_half_width
from hdvplan.need.search import TOLERANCE_M, WIDE_M, Least
from hdvplan.need.widening import Widenings, least_widenings
from hdvplan.road.road import Limits


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
    limits; None if it has none, or an edge was fixed. ``held`` is the least reach of the fixed edge with the other side wide open; it is
    computed only if no plan keeps that edge.
    """

    case: Case
    side: str | None
    room: Least
    place: Place | None  #: where ``room`` is decided; None where no plan was found
    held: Least | None
    widenings: Widenings | None
    bound: Bound | None = None  #: room that is proved to be too little; None if nothing is proved or no proof was wanted


def need_of(case: Case, *, prove: bool = False, on_progress: Callable[[float], None] | None = None) -> Need:
    """Return the least half width for a case, and the least widening of its road's own limits where it has some.

    With ``prove`` the largest half width that is proved to be too small is also computed, which takes some seconds more.
    ``on_progress`` receives a share that grows from 0 to 1.
    """
    own = case.road.own_limits
    planned = 1.0 - _PROOFS_SHARE if prove else 1.0
    share = planned if own is None else _ROOMS_SHARE * planned
    room = least_half_width(case, on_progress=_part(on_progress, 0.0, share))
    widenings = None
    if own is not None and room.result is None:
        widenings = Widenings(None, None, None)  # what no width lets pass, no widening does
    elif own is not None:
        widenings = least_widenings(case, own, on_progress=_part(on_progress, share, planned))
    place = _place(room.result, None)
    last = _part(on_progress, planned, 1.0)
    bound = proved_below(case, even_band(case.road), room, [0, 1, 2, 3], None, on_progress=last) if prove else None
    return Need(case, None, room, place, None, widenings, bound)


def edge_need_of(case: Case, held: Limits, side: str, *, prove: bool = False, on_progress: Callable[[float], None] | None = None) -> Need:
    """Return the least reach on ``side`` ("left" or "right") with the other edge of ``held`` kept.

    ``prove`` looks for the largest reach that is proved to be too small as well, which takes some seconds more.
    ``on_progress`` receives a share that grows from 0 to 1.
    """
    planned = 1.0 - _PROOFS_SHARE if prove else 1.0
    room = least_edge(case, held, side, on_progress=_part(on_progress, 0.0, planned))
    band, last = edge_band(held, side), _part(on_progress, planned, 1.0)
    if room.result is not None:
        bound = proved_below(case, band, room, ASKED[side], None, on_progress=last) if prove else None
        return Need(case, side, room, _place(room.result, side), None, None, bound)
    other = "right" if side == "left" else "left"
    least = least_edge(case, Limits.constant(WIDE_M, WIDE_M, case.road.path.length), other)
    place = _place(least.result, other)
    bound = proved_below(case, band, room, ASKED[side], None if place is None else place.s) if prove else None
    return Need(case, side, room, place, least, None, bound)


_ROOMS_SHARE = 0.2  # of the time that both answers take
_PROOFS_SHARE = 0.4  # of the time of an answer with a proof


def _part(on_progress: Callable[[float], None] | None, start: float, end: float) -> Callable[[float], None] | None:
    return None if on_progress is None else lambda share: on_progress(start + (end - start) * share)


def _place(result: Result | None, side: str | None) -> Place | None:
    """Return where a plan reached furthest over the road's own limits, on one side or on either."""
    if result is None:
        return None
    took, rows = taken_by(result), [0, 1, 2, 3] if side is None else ASKED[side]
    reach = np.where(took.counts[rows], took.reach[rows], -np.inf)
    # A plan may reach as far at many places, where nothing keeps it from it: the one that decides leaves the least room opposite.
    opposite = [row ^ 1 for row in rows]
    limits = result.drive.road.limits
    room = reach * 0.0 if limits is None else (OUTWARDS * limits.table(took.s) - took.reach)[opposite]
    first, at = np.unravel_index(np.argmin(np.where(reach >= np.max(reach) - TOLERANCE_M, room, np.inf)), reach.shape)
    row, s = rows[int(first)], float(took.s[at])
    where, overhangs = ROWS[row % 2], result.two_regions and row > 1
    unit = int(np.nanargmin(result.gaps[where, "sweepable" if overhangs else "drivable"][:, at]))
    axles_only = result.two_regions and not overhangs
    x, y, lonlat = point_of(result, unit, where, s, axles_only=axles_only)
    return Place(s, x, y, lonlat, where, unit, contact(result.drive, unit, where, s, axles_only=axles_only))
