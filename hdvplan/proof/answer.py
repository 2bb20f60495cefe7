"""Whether a road can be driven at all: a proof that it cannot, or nothing.

What is proved holds for the kinematic model alone (no slip, forward along the road), for any start, and any steering up to the largest
curvature at any rate. What is not proved impossible need not be possible.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hdvplan.case import Case
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.fit import Trouble
from hdvplan.judging.result import Proof, Result
from hdvplan.judging.verdict import verdict_of
from hdvplan.proof.reach import Grid, Pair, Reached, coupling_of, fits, outline_of, reachable, reachable_with_trailer, seen_from
from hdvplan.proof.space import Beside, Frame, beside, frame_of
from hdvplan.road.road import Road
from hdvplan.vehicle.kinematics import axles_behind
from hdvplan.vehicle.model import Unit, Vehicle

LESS_M = (0.05, 0.15)  # room by which the coarse sets prove less than the fine ones, of one unit and of two
_BEFORE_M, _AFTER_M = 50.0, 20.0  # of the place where less room would lose the set, that is looked at
_LENGTHS_M = (40.0, 20.0, 10.0, 5.0)  # tried for a proof
ROUNDING_M = 5e-3  # what the judge of a plan may miss between its poses, stations and outline points
_MORE_CURVATURE = 1e-6  # of the largest: a solver's rounding
_PLACES_M = 0.5  # between the normals at which a body alone is looked at


class Resolution(NamedTuple):
    """How finely a reachable set is followed: ``step`` of road [m] and ``cell`` of heading [rad]."""

    step: float
    cell: float


# The coarse one first, which proves what lacks some centimetres more, in a fraction of the time.
# Short steps leave less to be done unseen between two stations, narrow cells per step less to be turned by rounding: no one is always best.
RIGID = (Resolution(0.1, 1e-3), Resolution(0.05, 5e-4), Resolution(0.2, 2e-4))
ARTICULATED = (Resolution(0.2, 4e-3), Resolution(0.1, 2e-3))


class Follow(NamedTuple):
    """What follows the leading units: in some free space, at a resolution, from where to where [m]."""

    run: Callable[[Beside, Resolution, float, float], tuple[Frame, Reached]]
    resolutions: tuple[Resolution, ...]


def proof_of(case: Case, s_from: float | None = None, s_to: float | None = None) -> Proof | None:
    """Return a proof that ``case.vehicle`` cannot pass ``case.road`` from ``s_from`` to ``s_to`` [m], the whole road without them.

    None where nothing is proved. A limit counts as broken as in the verdict on a plan: by over ``KEPT_M``, with the clearance of
    ``case.settings``. Obstacles may be passed on either side. Of a third unit and those behind it only the places are looked at; of a
    second one whose axle the plan steers, and of all behind a leading unit whose rear axle is steered, too.
    """
    length = case.road.path.length
    first, last = 0.0 if s_from is None else max(0.0, s_from), length if s_to is None else min(length, s_to)
    if last - first < _PLACES_M:
        return None
    reach = sum(outline_of(unit, two_regions=False).reach for unit in case.vehicle.units[:2])
    room, less = KEPT_M + ROUNDING_M - case.settings.clearance, LESS_M[len(followed(case.vehicle)) > 1]
    around = 3.0 * reach + 15.0  # of line: in most bends more than bodies reach; where it is less, nothing is proved
    space, tighter = (beside(case.road, first - around, last + around, room=one) for one in (room, room - less))
    if space is None or tighter is None:
        return None
    found = _by_place(case.road, case.vehicle, space, first, last)
    return found or _by_motion(case.road, case.vehicle, (space, tighter), first, last)


def _by_place(road: Road, vehicle: Vehicle, space: Beside, first: float, last: float) -> Proof | None:
    """Return where one of the bodies does not fit in any pose, None if nowhere."""
    whole, two_regions = road.path.length, _two_regions(road)
    for number, (unit, behind) in enumerate(zip(vehicle.units, axles_behind(vehicle), strict=True)):
        # Its axle gets as far: on the inside of a bend it is further behind along the road than in metres.
        stations = np.arange(first, min(last, whole - 2.0 * float(behind) - vehicle.lead.wheelbase), _PLACES_M)
        if not len(stations):
            continue
        outline = outline_of(unit, two_regions=two_regions)
        bad = fits(outline, space, frame_of(road.path, stations), two_regions=two_regions)
        if bad >= 0:
            return Proof("place", float(stations[bad]), float(stations[bad]), number)
    return None


def _by_motion(road: Road, vehicle: Vehicle, spaces: tuple[Beside, Beside], first: float, last: float) -> Proof | None:
    """Return the stretch on which everything that the leading units can reach is lost, None if there is none.

    Nothing more is followed where the coarse set would not even be lost with less room, the second of ``spaces``, and only what lies around
    where it would. That saves time, and proves nothing.
    """
    follow = follower(road, vehicle)
    if follow is None:
        return None
    unit = len(followed(vehicle)) - 1
    coarse = follow.resolutions[0]
    tight = _lost(follow, spaces[1], coarse, first, last)
    while tight is not None:
        begin, seen = max(first, tight - _BEFORE_M), min(last, tight + _AFTER_M)
        for resolution in follow.resolutions:
            found = _lost(follow, spaces[0], resolution, begin, seen)
            if found is not None:
                return _shortest(follow, spaces[0], resolution, begin, found, unit)
        tight = _lost(follow, spaces[1], coarse, seen, last) if last - seen > _PLACES_M else None
    return None


def _lost(follow: Follow, space: Beside, resolution: Resolution, s_from: float, s_to: float) -> float | None:
    """Return where nothing is left of the reachable set [m], None if something is."""
    frame, found = follow.run(space, resolution, s_from, s_to)
    return None if found.empty < 0 else float(frame.s[found.empty])


def _shortest(follow: Follow, space: Beside, resolution: Resolution, first: float, s_to: float, unit: int) -> Proof:
    """Return the proof with the shortest stretch of a few on which the set is lost: halved while it still is."""
    found = Proof("motion", first, s_to, unit)
    for length in _LENGTHS_M:
        if s_to - length > first:
            lost = _lost(follow, space, resolution, s_to - length, s_to + _PLACES_M)
            if lost is None:
                break
            found = Proof("motion", s_to - length, lost, unit)
    return found


def followed(vehicle: Vehicle) -> tuple[Unit, ...]:
    """Return the leading units whose motion is followed: none where the first one's rear axle is steered."""
    if vehicle.lead.steering_ratio > 0.0:
        return ()  # that axle does not move along its body
    return vehicle.units[: 1 if len(vehicle.units) == 1 or vehicle.units[1].active else 2]


def follower(road: Road, vehicle: Vehicle) -> Follow | None:
    """Return what follows the leading units along a stretch, None where none can be followed."""
    kappa = vehicle.max_curvature * (1.0 + _MORE_CURVATURE)
    two_regions = _two_regions(road)
    units = followed(vehicle)
    if not units:
        return None
    lead, *behind = (outline_of(unit, two_regions=two_regions) for unit in units)
    pair = [Pair(lead, seen_from(body, units[1].wheelbase), coupling_of(*units)) for body in behind]  # from the coupling

    def run(space: Beside, resolution: Resolution, s_from: float, s_to: float) -> tuple[Frame, Reached]:
        frame = frame_of(road.path, np.arange(s_from, s_to, resolution.step))
        around = (kappa, space, frame, grid_of(frame, resolution.cell))
        if pair:
            return frame, reachable_with_trailer(pair[0], *around, two_regions=two_regions)
        return frame, reachable(lead, *around, two_regions=two_regions)

    return Follow(run, ARTICULATED if pair else RIGID)


def _two_regions(road: Road) -> bool:
    return road.kerbs is not None and road.kerbs.two_regions


def grid_of(frame: Frame, cell: float) -> Grid:
    """Return the cells for all headings that are less than a right angle off the road's somewhere."""
    low, high = float(np.min(frame.heading)) - 1.6, float(np.max(frame.heading)) + 1.6
    return Grid(low, cell, int(np.ceil((high - low) / cell)))


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
