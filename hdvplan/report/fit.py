"""Whether a vehicle fits a road, by geometry alone: what its balanced circle at every curvature needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.centering.weights import CenteringTable
from hdvplan.jit import FloatArray
from hdvplan.road.road import Road
from hdvplan.vehicle.model import Vehicle

_SPACING_M = 0.5  # a curvature ramp of 0.1 1/m^2 changes by 0.05 1/m over it at most

_SAME_CURVATURE = 1e-9  # rounding of the path's table [1/m]


@dataclass(frozen=True)
class RoadFacts:
    """A road's numbers; lengths in metres, curvature in 1/m. ``narrowest`` is the least distance between the limits."""

    name: str
    length: float
    closed: bool
    max_curvature: float  # magnitude
    max_curvature_s: float
    point_spacing: float | None  # mean, of the given points; None for a curvature profile
    narrowest: float | None
    narrowest_s: float | None


@dataclass(frozen=True)
class Fit:
    """One vehicle on one road, balanced everywhere."""

    vehicle: str
    half_width: float  # needed at the tightest place [m]
    saturated: bool  # the tightest place is tighter than any balanced circle: more than ``half_width`` is needed
    long_enough: bool  # the road is at least as long as the vehicle
    spare: float | None  # least of (distance between the limits) / 2 - needed half width [m]; None without limits
    spare_s: float | None  # where [m]

    @property
    def fits(self) -> bool | None:
        """The verdict; None where the road has no limits to judge by and nothing else rules the vehicle out."""
        if self.saturated or not self.long_enough:
            return False
        return None if self.spare is None else self.spare >= 0.0


def facts_of(road: Road) -> RoadFacts:
    """Return the numbers of a road."""
    s = _stations(road)
    curvature = np.abs(road.path.at(s).curvature)
    tightest = int(np.argmax(curvature > np.max(curvature) - _SAME_CURVATURE))  # the first one of a constant stretch
    room = _room(road, s)
    narrowest = None if room is None else int(np.argmin(room))
    smoothing = road.smoothing
    return RoadFacts(
        road.name,
        road.path.length,
        road.path.closed,
        float(curvature[tightest]),
        float(s[tightest]),
        None if smoothing is None else road.path.length / max(1, smoothing.points - smoothing.duplicates - 1),
        None if room is None or narrowest is None else float(room[narrowest]),
        None if narrowest is None else float(s[narrowest]),
    )


def fit_of(road: Road, vehicle: Vehicle) -> Fit:
    """Return what ``vehicle`` needs on ``road`` and how much of the limits it leaves."""
    s = _stations(road)
    needed = CenteringTable.of(vehicle).at(road.path.at(s).curvature)
    room = _room(road, s)
    spare = None if room is None else 0.5 * room - needed.half_width
    least = None if spare is None else int(np.argmin(spare))
    return Fit(
        vehicle.name,
        float(np.max(needed.half_width)),
        bool(np.any(needed.saturated)),
        road.path.length >= vehicle.reach_ahead + vehicle.reach_behind,
        None if spare is None or least is None else float(spare[least]),
        None if least is None else float(s[least]),
    )


def _stations(road: Road) -> FloatArray:
    return np.linspace(0.0, road.path.length, max(2, int(np.ceil(road.path.length / _SPACING_M)) + 1))


def _room(road: Road, s: FloatArray) -> FloatArray | None:
    """Return the distance between the limits that wheels must keep [m], shape (len(s),)."""
    if road.limits is None:
        return None
    left, right, _, _ = road.limits.table(s)
    room: FloatArray = left - right
    return room
