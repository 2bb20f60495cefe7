"""Whether a road can be driven at all: a proof that it cannot, or nothing.

What is proved holds for the kinematic model alone (no slip, forward along the road), for any start, and any steering up to the largest
curvature at any rate. What is not proved is not thereby possible.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hdvplan.case import Case
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.proof import Proof
from hdvplan.proof.poses import Outline, fits, outline_of, reach_of
from hdvplan.proof.reach import Grid, Reached, reachable
from hdvplan.proof.space import Beside, Frame, beside, bins_for, frame_of, has_own_region
from hdvplan.road.road import Road
from hdvplan.vehicle.body import axles_behind
from hdvplan.vehicle.model import Vehicle

ROUNDING_M = 3e-3  # what the judge of a plan may miss between its poses, stations and outline points
_MORE_CURVATURE = 1e-6  # of the largest: a solver's rounding
_PLACES_M = 0.5  # between the normals at which a body alone is looked at
_ROOM_M = 40.0  # of path beyond the ends of a road: more than any vehicle's length


class Resolution(NamedTuple):
    """How finely the reachable set is followed: ``step`` of road [m] and ``cell`` of heading [rad]."""

    step: float
    cell: float


# The coarse one proves what lacks more than 5 cm or so, in an eighth of the time.
RESOLUTIONS = (Resolution(0.1, 1e-3), Resolution(0.05, 5e-4))


def proof_of(case: Case, s_from: float | None = None, s_to: float | None = None) -> Proof | None:
    """Return a proof that ``case.vehicle`` cannot pass ``case.road`` from ``s_from`` to ``s_to`` [m], the whole road without them.

    None where nothing is proved. A limit counts as broken as in the verdict on a plan: by over ``KEPT_M``, with the clearance of
    ``case.settings``. Obstacles may be passed on either side.
    """
    first, last = 0.0 if s_from is None else max(0.0, s_from), case.road.path.length if s_to is None else min(case.road.path.length, s_to)
    road = replace(case.road, path=case.road.path.extended(_ROOM_M, _ROOM_M))
    room = KEPT_M + ROUNDING_M - case.settings.clearance
    reach = max(reach_of(outline_of(unit, two_regions=False)) for unit in case.vehicle.units)
    space = beside(road, first - 3.0 * reach - 10.0, last + 3.0 * reach + 10.0, room=room)
    if space is None or last - first < _PLACES_M:
        return None
    two_regions = has_own_region(road.limits if road.edges is None else road.edges)
    return _by_place(road, case.vehicle, space, first, last, two_regions=two_regions) or _by_motion(
        road, case.vehicle, space, first, last, two_regions=two_regions
    )


def _by_place(road: Road, vehicle: Vehicle, space: Beside, first: float, last: float, *, two_regions: bool) -> Proof | None:
    """Return where one of the bodies does not fit in any pose, None if nowhere."""
    whole = road.path.length
    for number, (unit, behind) in enumerate(zip(vehicle.units, axles_behind(vehicle), strict=True)):
        stations = np.arange(first, min(last, whole - float(behind) - vehicle.lead.wheelbase), _PLACES_M)
        if not len(stations):
            continue
        outline = outline_of(unit, two_regions=two_regions)
        reach = reach_of(outline)
        bad = fits(outline, space, two_regions, frame_of(road.path, stations), reach, bins_for(reach))
        if bad >= 0:
            return Proof("place", float(stations[bad]), float(stations[bad]), number)
    return None


def _by_motion(road: Road, vehicle: Vehicle, space: Beside, first: float, last: float, *, two_regions: bool) -> Proof | None:
    """Return the stretch on which everything that the leading unit can reach is lost, None if there is none."""
    if vehicle.lead.steering_ratio > 0.0:
        return None  # its rear axle does not move along the body
    follow = _follower(road, vehicle, outline_of(vehicle.lead, two_regions=two_regions), space, two_regions=two_regions)
    for resolution in RESOLUTIONS:
        frame, found = follow(resolution, first, last)
        if found.empty < 0:
            continue
        s_to = float(frame.s[found.empty])
        length = 5.0
        while length < s_to - first:  # the shortest stretch of a few that proves the same
            frame, again = follow(resolution, s_to - length, s_to + 0.5 * resolution.step)
            if again.empty >= 0:
                return Proof("motion", s_to - length, float(frame.s[again.empty]), 0)
            length *= 2.0
        return Proof("motion", first, s_to, 0)
    return None


def _follower(
    road: Road, vehicle: Vehicle, outline: Outline, space: Beside, *, two_regions: bool
) -> Callable[[Resolution, float, float], tuple[Frame, Reached]]:
    """Return what follows the leading unit along a stretch at a resolution."""
    reach = reach_of(outline)
    kappa = vehicle.max_curvature * (1.0 + _MORE_CURVATURE)
    nothing = np.empty((0, 0), np.int64), np.empty((0, 0, 0, 2))

    def follow(resolution: Resolution, s_from: float, s_to: float) -> tuple[Frame, Reached]:
        frame = frame_of(road.path, np.arange(s_from, s_to, resolution.step))
        return frame, reachable(
            outline, kappa, space, two_regions, frame, grid_of(frame, resolution.cell), reach, bins_for(reach), *nothing
        )  # fmt: skip

    return follow


def grid_of(frame: Frame, cell: float) -> Grid:
    """Return the cells for all headings that are less than a right angle off the road's somewhere."""
    low, high = float(np.min(frame.heading)) - 1.6, float(np.max(frame.heading)) + 1.6
    return Grid(low, cell, int(np.ceil((high - low) / cell)))
