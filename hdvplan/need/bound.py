"""The most room that is proved to be too little: what ``need`` knows from below."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.judging.proof import Proof
from hdvplan.need.measure import taken_by
from hdvplan.need.search import TOLERANCE_M, WIDE_M, Least
from hdvplan.proof.answer import proof_of
from hdvplan.proof.stretches import Stretch, joined
from hdvplan.road.road import Limits

_WITHIN_M = 0.3  # of the furthest reach: where a plan that is asked for less is expected to need it


@dataclass(frozen=True)
class Bound:
    """Room that is proved to be too little, and the proof; what is less is too little as well."""

    room: float  # [m]
    proof: Proof


def proved_below(
    case: Case,
    band: Callable[[float], Limits],
    least: Least,
    rows: Sequence[int],
    place: float | None,
    *,
    on_progress: Callable[[float], None] | None = None,
) -> Bound | None:
    """Return the most room, to ``TOLERANCE_M``, within which nothing is proved to fit; None where nothing is proved.

    ``band`` gives the limits that leave a room, ``rows`` of ``Taken`` are those that the room is asked for. Looked at are the places where
    the best plan reached nearly as far as anywhere, or, without a plan, the arclength ``place`` [m]. Halving makes some seven proofs;
    ``on_progress`` receives their share, 0 to 1.
    """
    places = _places(least, rows, place)
    stretches = joined(places, case.vehicle, case.road.path.length)

    def tried(room: float) -> Bound | None:
        narrow = replace(case, road=case.road.within(band(room)))
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


def _places(least: Least, rows: Sequence[int], place: float | None) -> list[Stretch]:
    if least.result is None:
        return [] if place is None else [Stretch(place, place, 0.0)]
    took = taken_by(least.result)
    reach: FloatArray = np.max(np.where(took.counts[rows], took.reach[rows], -np.inf), axis=0)
    near = reach > np.max(reach) - _WITHIN_M
    ends = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(int)))
    runs = [slice(begin, end) for begin, end in zip(ends[::2], ends[1::2], strict=True)]
    return [Stretch(float(took.s[run][0]), float(took.s[run][-1]), float(np.max(reach[run]))) for run in runs]
