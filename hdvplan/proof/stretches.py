"""Where on a road to look for a proof: around the breaches of a plan, and the places that the fit check calls too narrow.

A proof on any stretch is one for the road, for nothing is supposed of how the vehicle enters it. Which stretches are examined is thus a
matter of time alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.fit import Trouble
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import verdict_of
from hdvplan.proof.answer import proof_of
from hdvplan.vehicle.model import Vehicle

_LENGTHS_BEFORE = 3.0  # of the vehicle: by then the pose in which it enters a stretch is forgotten
_LENGTHS_AFTER = 1.5  # what it must swing out for comes within this
MOST_M = 1000.0  # of road that is examined: a proof takes some seconds for 100 m


class Stretch(NamedTuple):
    """A part of a road, by the lead rear axle's place, and how much room is lacking in it."""

    s_from: float  # [m]
    s_to: float  # [m]
    lacking: float  # at the worst place [m]


def proved(result: Result, *, on_progress: Callable[[float], None] | None = None) -> Result:
    """Return a judged plan with a proof that nothing fits, where it breaks its limits and there is one on a tight stretch.

    At most ``MOST_M`` of road are examined, the worst stretches first. ``on_progress`` receives their share, 0 to 1.
    """
    if verdict_of(result).fits is not False:
        return result
    stretches = stretches_of(result)
    lengths = [stretch.s_to - stretch.s_from for stretch in stretches]
    for number, stretch in enumerate(stretches):
        proof = proof_of(result.case, stretch.s_from, stretch.s_to)
        if proof is not None:
            return replace(result, proof=proof)
        if on_progress is not None:
            on_progress(sum(lengths[: number + 1]) / sum(lengths))
    return result


def stretches_of(result: Result) -> list[Stretch]:
    """Return the stretches around what a plan breaks and what its forecast lacks, the worst first."""
    wanted, vehicle = result.case.settings.clearance, result.drive.vehicle
    places = [Stretch(breach.s_from, breach.s_to, breach.depth) for breach in result.balance.breaches]
    places += [Stretch(near.s_from, near.s_to, wanted - near.distance) for near in result.approaches if near.distance < wanted - KEPT_M]
    for finding in result.fit.findings:
        lacking = finding.needed - finding.available if finding.trouble is Trouble.WIDTH else 0.0
        places.append(Stretch(finding.s_from, finding.s_to, lacking))
    verdict = verdict_of(result)
    places.append(Stretch(verdict.s, verdict.s, -(verdict.spare or 0.0)))
    return joined(places, vehicle, result.drive.road.path.length)


def joined(places: Iterable[Stretch], vehicle: Vehicle, length: float) -> list[Stretch]:
    """Return stretches around ``places`` of a road of ``length`` [m], those that meet as one, the worst first.

    Of more than ``MOST_M`` in all, the least bad are left out, and what is left of the last one is cut off.
    """
    whole = vehicle.reach_ahead + vehicle.reach_behind
    found: list[Stretch] = []
    for place in sorted(places):
        begin = max(0.0, place.s_from - vehicle.reach_ahead - _LENGTHS_BEFORE * whole)
        end = min(length, place.s_to + vehicle.reach_behind + _LENGTHS_AFTER * whole)
        if found and begin <= found[-1].s_to:
            found[-1] = Stretch(found[-1].s_from, max(end, found[-1].s_to), max(place.lacking, found[-1].lacking))
        else:
            found.append(Stretch(begin, end, place.lacking))
    return list(_worst(sorted(found, key=lambda stretch: -stretch.lacking)))


def _worst(stretches: Iterable[Stretch]) -> Iterator[Stretch]:
    """Yield the first ``MOST_M`` of ``stretches``."""
    left = MOST_M
    for stretch in stretches:
        if left <= 0.0:
            return
        yield stretch._replace(s_to=min(stretch.s_to, stretch.s_from + left))
        left -= stretch.s_to - stretch.s_from
