"""Whether a vehicle fits a road, by geometry alone: what its balanced circle at every curvature needs.

A circle as tight as the road is wherever one looks: on a bend shorter than the vehicle this asks for more than it will
sweep, and it knows nothing of the room that swinging around an obstacle takes. The plan is the judge; this is its forecast.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from hdvplan.arrays import BoolArray, FloatArray
from hdvplan.centring.stationary import CentringTable, swept_band
from hdvplan.road.road import Road
from hdvplan.vehicle.model import Vehicle

if TYPE_CHECKING:  # plans are judged without tables
    import pandas as pd

_SPACING_M = 0.5  # a curvature ramp of 0.1 1/m^2 changes by 0.05 1/m over it at most

_SAME_CURVATURE = 1e-9  # rounding of the path's table [1/m]
_APART_M = 5.0  # stretches nearer to each other than this are one
_ENOUGH_M = 1e-3  # of width: what a table's digits show


class Trouble(StrEnum):
    """Why a vehicle does not fit."""

    WIDTH = "width"  # more than there is between the limits
    CURVATURE = "curvature"  # more than the vehicle can steer
    CIRCLE = "circle"  # no balanced circle is as tight as the road


@dataclass(frozen=True)
class Finding:
    """A stretch of road that a vehicle does not fit, with what is there and what it needs at the worst place.

    Metres between the limits for a width, 1/m for a curvature. Where overhangs have separate limits,  ``available`` is
    between those limits that the worst part of the vehicle meets.
    """

    trouble: Trouble
    s_from: float  # [m]
    s_to: float  # [m]
    s_worst: float  # [m]
    available: float
    needed: float


@dataclass(frozen=True)
class Needs:
    """What a vehicle needs along a road, balanced everywhere; shape (n,) each. Rooms are None without limits."""

    s: FloatArray  # [m]
    kappa: FloatArray  # of the lead rear axle, magnitude [1/m]
    saturated: BoolArray  # no balanced circle is this tight
    width: FloatArray  # between the outermost and the innermost body point [m]
    axles: FloatArray  # the same without overhangs: what must lie on the drivable region [m]
    room: FloatArray | None  # for ``width``: the overhangs' limit outside, the wheels' inside [m]
    drivable: FloatArray | None  # for ``axles`` [m]

    @property
    def lacking(self) -> FloatArray | None:
        """How much room is missing, negative where there is some to spare [m]."""
        if self.room is None or self.drivable is None:
            return None
        return np.maximum(self.width - self.room, self.axles - self.drivable)


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
    findings: tuple[Finding, ...]  # where it does not fit, in order of s

    @property
    def fits(self) -> bool | None:
        """The verdict; None where the road has no limits to judge by and nothing else rules the vehicle out."""
        if self.saturated or self.findings or not self.long_enough:
            return False
        return None if self.spare is None else True


def facts_of(road: Road) -> RoadFacts:
    """Return the numbers of a road."""
    s = _stations(road)
    curvature = np.abs(road.path.at(s).curvature)
    tightest = int(np.argmax(curvature > np.max(curvature) - _SAME_CURVATURE))  # the first one of a constant stretch
    room = None if road.passable is None else np.subtract(*road.passable.table(s)[:2])  # between the limits that wheels must keep
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
    needs = needs_of(road, vehicle, _stations(road))
    lacking = needs.lacking
    least = None if lacking is None else int(np.argmax(lacking))
    return Fit(
        vehicle.name,
        0.5 * float(np.max(needs.width)),
        bool(np.any(needs.saturated)),
        road.path.length >= vehicle.reach_ahead + vehicle.reach_behind,
        None if lacking is None or least is None else -0.5 * float(lacking[least]),
        None if least is None else float(needs.s[least]),
        _findings(needs, vehicle),
    )


def needs_of(road: Road, vehicle: Vehicle, s: FloatArray) -> Needs:
    """Return what ``vehicle`` needs at arclengths ``s`` [m] of ``road``.

    In a balanced circle the outermost point belongs to an overhang, the innermost to an axle.
    """
    curvature = road.path.at(s).curvature
    balanced = CentringTable.of(vehicle).at(curvature)
    kappa = np.abs(balanced.kappa)
    outer, inner = swept_band(vehicle, kappa)
    outer_axle, inner_axle = swept_band(vehicle, kappa, axles_only=True)
    room = drivable = None
    if road.passable is not None:
        left, right, left_sweep, right_sweep = road.passable.table(s)
        outside_right, outside_left = left - right_sweep, left_sweep - right
        room = np.where(curvature > 0.0, outside_right, np.where(curvature < 0.0, outside_left, np.maximum(outside_left, outside_right)))
        drivable = left - right
    return Needs(s, kappa, balanced.saturated, outer - inner, outer_axle - inner_axle, room, drivable)


def fit_table(road: Road, vehicles: list[Vehicle]) -> pd.DataFrame:
    """Return a road's curvature [1/m] and limits over s [m], and the width that each vehicle needs there [m]."""
    import pandas as pd  # noqa: PLC0415 - see above

    s = _stations(road)
    none = np.full((4, len(s)), np.nan)
    limits = none if road.passable is None else road.passable.table(s)
    columns = {"s": s, "curvature": road.path.at(s).curvature}
    columns |= dict(zip(("left", "right", "left_sweep", "right_sweep"), limits, strict=True))
    return pd.DataFrame(columns | {f"needed_width_{vehicle.name}": needs_of(road, vehicle, s).width for vehicle in vehicles})


def finding_text(finding: Finding, vehicle: str) -> str:
    """Return a finding as one sentence."""
    place = f"from s = {finding.s_from:z.1f} to {finding.s_to:z.1f} m"
    if finding.trouble is Trouble.WIDTH:
        lacks = f": {finding.needed - finding.available:.2f} m have to go" if finding.available < 0.0 else ""
        return f"too narrow for the {vehicle} {place}: limits {_apart(finding.available)}, needs {finding.needed:.2f} m{lacks}"
    if finding.trouble is Trouble.CURVATURE:
        evenly = f"sweeping it evenly needs a curvature of {finding.needed:.3f} 1/m, the vehicle steers {finding.available:.3f} 1/m at most"
        return f"too tight for the {vehicle} {place}: {evenly}"
    return f"too tight for the {vehicle} {place}: no balanced circle is this tight"


def folded_text(road: Road, findings: tuple[Finding, ...]) -> str | None:
    """Return what to say of limits that come far nearer to each other than the road's widths are: its line lies elsewhere than they do."""
    if road.limits is None or road.regions:
        return None
    least = 0.5 * float(np.min(np.subtract(*road.limits.table(road.limits.s)[2:])))
    folded = next((one for one in findings if one.trouble is Trouble.WIDTH and one.available < least), None)
    if folded is None:
        return None
    place = f"at s = {folded.s_worst:z.1f} m the limits, which count from the road's points, lie beside the smoothed line"
    return f"{place}: try --corners sharp or round, or draw the edges"


def finding_json(finding: Finding) -> dict[str, object]:
    """Return a finding under the names that other programs read."""
    return {
        "trouble": str(finding.trouble),
        "s_from_m": finding.s_from,
        "s_to_m": finding.s_to,
        "s_worst_m": finding.s_worst,
        "available": finding.available,
        "needed": finding.needed,
    }


def _apart(available: float) -> str:
    return f"are {available:.2f} m apart" if available >= 0.0 else f"overlap by {-available:.2f} m"


def _findings(needs: Needs, vehicle: Vehicle) -> tuple[Finding, ...]:
    """Return the stretches where ``vehicle`` does not fit; a circle that does not exist is not judged by its width."""
    most = np.full(len(needs.s), vehicle.max_curvature)
    tight = (needs.kappa > most + _SAME_CURVATURE) & ~needs.saturated
    found = [
        *_stretches(Trouble.CIRCLE, needs.s, needs.saturated, needs.kappa, needs.kappa),
        *_stretches(Trouble.CURVATURE, needs.s, tight, most, needs.kappa),
    ]
    if needs.room is not None and needs.drivable is not None:
        whole = needs.width - needs.room >= needs.axles - needs.drivable
        available, needed = np.where(whole, needs.room, needs.drivable), np.where(whole, needs.width, needs.axles)
        found += _stretches(Trouble.WIDTH, needs.s, needed - available > _ENOUGH_M, available, needed)
    return tuple(sorted(found, key=lambda finding: (finding.s_from, finding.trouble)))


def _stretches(trouble: Trouble, s: FloatArray, bad: BoolArray, available: FloatArray, needed: FloatArray) -> list[Finding]:
    at = np.flatnonzero(bad)
    found = []
    for part in np.split(at, np.flatnonzero(np.diff(s[at]) > _APART_M) + 1):
        if len(part):
            worst = part[np.argmax((needed - available)[part])]
            place = (float(s[part[0]]), float(s[part[-1]]), float(s[worst]))
            found.append(Finding(trouble, place[0], place[1], place[2], float(available[worst]), float(needed[worst])))
    return found


def _stations(road: Road) -> FloatArray:
    """Return arclengths for looking: evenly spaced ones, and those where limits change."""
    s = np.linspace(0.0, road.path.length, max(2, int(np.ceil(road.path.length / _SPACING_M)) + 1))
    if road.passable is None:
        return s
    nodes = road.passable.s
    return np.union1d(s, nodes[(nodes > 0.0) & (nodes < road.path.length)])
