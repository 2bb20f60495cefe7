"""The most room that is proved to be too little: what ``need`` knows from below."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hdvplan.case import Case
from hdvplan.judging.result import Proof
from hdvplan.need.search import TOLERANCE_M, WIDE_M, Least
from hdvplan.proof.answer import Stretch, joined, proof_of
from hdvplan.road.road import Road

_WITHIN_M = 0.3  # of the least gap: where a plan that is asked for less is expected to need it


@dataclass(frozen=True)
class Bound:
    """Room that is proved to be too little, and the proof; what is less is too little as well."""

    room: float  # [m]
    proof: Proof


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
    near = gap < np.min(gap) + _WITHIN_M
    ends = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(int)))
    runs = [slice(begin, end) for begin, end in zip(ends[::2], ends[1::2], strict=True)]
    return [Stretch(float(s[run][0]), float(s[run][-1]), -float(np.min(gap[run]))) for run in runs]
