"""How evenly a drive sweeps its road, and whether it keeps the limits: judged on the simulated envelope alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.arrays import FloatArray, IntArray
from hdvplan.centring.weights import CentringTable
from hdvplan.driving.drive import Drive
from hdvplan.judging.contact import contact
from hdvplan.judging.envelope import SPACING_M, Envelope, envelope_of
from hdvplan.judging.obstacles import Approach, approaches
from hdvplan.road.road import Limits

KEPT_M = 0.01  # a limit counts as kept when broken by no more than this, as simulated
_ROUNDING_M = 1e-9  # of a limit at a station

Gaps = dict[tuple[str, str], FloatArray]  # rooms, (units, n) [m], by the side and the region of a limit


@dataclass(frozen=True)
class Breach:
    """A stretch of road over which a limit is broken."""

    s_from: float  #: where it begins [m]
    s_to: float  #: where it ends [m]
    s_deepest: float  #: where it is deepest [m]
    depth: float  #: of the breach at the deepest place [m]
    side: str  #: "left" or "right"
    unit: int  #: index of the body at the deepest place
    part: str  #: of that body, see ``contact``
    region: str  #: "drivable": wheels or wheelbase beyond the limit; "sweepable": a body beyond the overhangs' limit, or in an obstacle
    obstacle: str | None = None  #: the name of the obstacle that is hit, "" for one without a name; None for the road's own edge


@dataclass(frozen=True)
class Balance:
    """The envelope in numbers. Reaches are positive [m]."""

    max_left: float  #: [m]
    max_right: float  #: [m]
    mean_abs_imbalance: float  #: mean over s of the absolute value of left(s) + right(s) [m]
    expected_half_width: float  #: of the geometric weight, at the road's largest curvature [m]
    saturated: bool  #: whether no balanced circle is as tight as the road
    min_clearance: float | None  #: to edges and obstacles; negative when one is broken; None without limits [m]
    breaches: tuple[Breach, ...]  #: deeper than KEPT_M, in order of s
    approaches: tuple[Approach, ...] = ()  #: nearest to each obstacle

    @property
    def imbalance(self) -> float:
        """Largest left less largest right reach [m]."""
        return self.max_left - self.max_right

    @property
    def half_width(self) -> float:
        """The least constant half width that contains everything the plan swept [m]."""
        return max(self.max_left, self.max_right)

    @property
    def violation(self) -> float:
        """Depth of the deepest breach; 0 when all limits are kept [m]."""
        return 0.0 if self.min_clearance is None else max(0.0, -self.min_clearance)


def balance_of(drive: Drive, envelope: Envelope) -> Balance:
    """Reduce a drive's envelope to the numbers that the tables show."""
    left, right = envelope.reach_left, envelope.reach_right
    k = drive.road.path.at(envelope.s).curvature
    tightest = CentringTable.of(drive.vehicle).at(np.array([np.max(np.abs(k))]))
    near = approaches(drive)
    clearance, breaches = _clearance(drive, envelope, near)
    return Balance(
        float(np.max(left)),
        float(-np.min(right)),
        float(np.mean(np.abs(left + right))),
        float(tightest.half_width[0]),
        bool(tightest.saturated[0]),
        clearance,
        breaches,
        near,
    )


def edges_of(drive: Drive) -> Limits | None:
    """Return the limits without those that obstacles make: how near obstacles are is judged in the plane."""
    return drive.road.limits if drive.road.edges is None else drive.road.edges


def gaps_of(drive: Drive, envelope: Envelope, limits: Limits | None) -> Gaps:
    """Return the room that every body leaves to ``limits``, shape (units, n) [m], negative beyond them, by the limit's side and region.

    Empty without limits; NaN where a body never was. "drivable" binds wheels and wheelbase where overhangs have limits of
    their own, else whole bodies.
    """
    if limits is None:
        return {}
    _, _, left_sweep, right_sweep = limits.table(envelope.s)
    region = "sweepable" if limits.two_regions else "drivable"
    gaps = {("left", region): left_sweep - envelope.left, ("right", region): envelope.right - right_sweep}
    return gaps | wheel_gaps_of(drive, envelope.s, limits) if limits.two_regions else gaps


def wheel_gaps_of(drive: Drive, s: FloatArray, limits: Limits | None) -> Gaps:
    """Return ``gaps_of`` wheels and what lies between a body's axles alone, at the envelope's arclengths ``s`` [m]."""
    if limits is None:
        return {}
    left, right, _, _ = limits.table(s)
    axles = envelope_of(drive, axles_only=True)
    return {("left", "drivable"): left - axles.left, ("right", "drivable"): axles.right - right}


def edge_gaps_of(drive: Drive, envelope: Envelope) -> Gaps:
    """Return ``gaps_of`` the road's own edges, see ``edges_of``, corners between the envelope's stations included."""
    edges = edges_of(drive)
    return at_corners(gaps_of(drive, envelope, edges), envelope.s, edges)


def at_corners(gaps: Gaps, s: FloatArray, limits: Limits | None) -> Gaps:
    """Return ``gaps_of`` at arclengths ``s`` [m] with what corners of the limits leave that neither station beside them sees.

    They count at the nearer station. Of other corners one station is as narrow, and what is read from files stays so for ``TABLE_M``.
    """
    if limits is None:
        return gaps
    found: Gaps = {}
    table, corners = limits.table(s), _corners(limits, s)
    for (side, region), gap in gaps.items():
        row, sign = _row(side, region), 1.0 if side == "left" else -1.0
        places, narrowest, nearest = corners[row]
        found[side, region] = gap.copy()
        for room, reach in zip(found[side, region], sign * table[row] - gap, strict=True):
            np.fmin.at(room, nearest, sign * narrowest - np.interp(places, s, reach))
    return found


def judged_table(limits: Limits, s: FloatArray) -> FloatArray:
    """Return the limits (4, n) that ``at_corners`` judges at stations ``s`` [m]: the nearest ones have those of corners in between."""
    table = limits.table(s)
    for row, narrow, (_, narrowest, nearest) in zip(table, (np.minimum, np.maximum) * 2, _corners(limits, s), strict=True):
        narrow.at(row, nearest, narrowest)
    return table


def _corners(limits: Limits, s: FloatArray) -> list[tuple[FloatArray, FloatArray, IntArray]]:
    """Return for every row of the limits those corners that are narrower than the limit at both stations around them.

    Arclengths and signed limits there [m], and the numbers of the nearest of the stations ``s``, which are evenly spaced.
    """
    inside = (limits.s >= s[0]) & (limits.s <= s[-1])
    place = np.where(inside, limits.s - s[0], 0.0) / SPACING_M
    before, after, nearest = (pick(place).astype(np.int64) for pick in (np.floor, np.ceil, np.rint))
    columns = (limits.left, limits.right, limits.left_sweep, limits.right_sweep)
    found = []
    for column, row, sign in zip(columns, limits.table(s), (1.0, -1.0, 1.0, -1.0), strict=True):
        unseen = inside & (sign * column < np.minimum(sign * row[before], sign * row[after]) - _ROUNDING_M)
        found.append((limits.s[unseen], column[unseen], nearest[unseen]))
    return found


def _row(side: str, region: str) -> int:
    """Return the row of ``Limits.table`` that a limit is in; without separate ones for overhangs both rows are equal."""
    return ("left", "right").index(side) + (2 if region == "sweepable" else 0)


def _clearance(drive: Drive, envelope: Envelope, near: tuple[Approach, ...]) -> tuple[float | None, tuple[Breach, ...]]:
    """Return the least room, and every breach: of the road's edges as limits along s say, of obstacles as they lie in the plane."""
    gaps = edge_gaps_of(drive, envelope)
    if not gaps:
        return None, ()
    breaches = [breach for (side, region), gap in gaps.items() for breach in _breaches(drive, envelope.s, gap, side, region)]
    breaches = [breach for breach in breaches if not _told(breach, breaches)]
    region, length = next(iter(gaps))[1], drive.road.path.length
    breaches += [_hit(approach, region) for approach in near if approach.distance < -KEPT_M and 0.0 <= approach.s <= length]
    lowest = min(*(float(np.nanmin(gap)) for gap in gaps.values()), *(approach.distance for approach in near))
    return lowest, tuple(sorted(breaches, key=lambda breach: breach.s_from))


def _hit(approach: Approach, region: str) -> Breach:
    return Breach(
        approach.s_from, approach.s_to, approach.s, -approach.distance, approach.side, approach.unit, approach.part, region,
        approach.obstacle.label,
    )  # fmt: skip


def _told(breach: Breach, breaches: list[Breach]) -> bool:
    """Return whether a breach of the overhangs' limit is the wheels' own, where both limits coincide."""
    return breach.region == "sweepable" and any(
        other.region == "drivable"
        and (other.side, other.unit, other.part) == (breach.side, breach.unit, breach.part)
        and abs(other.s_deepest - breach.s_deepest) <= SPACING_M
        for other in breaches
    )


def _breaches(drive: Drive, s: FloatArray, gaps: FloatArray, side: str, region: str) -> list[Breach]:
    """Return the stretches on which the tightest of ``gaps`` (units, n) lies below -KEPT_M."""
    gap = np.fmin.reduce(gaps, axis=0)  # NaN where no body ever was: rounding may keep the first axle from s = 0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], gap < -KEPT_M, [False]]).astype(int)))
    found = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        deepest = begin + int(np.argmin(gap[begin:end]))
        unit, at, depth = int(np.nanargmin(gaps[:, deepest])), float(s[deepest]), float(-gap[deepest])
        axles_only = region == "drivable" and drive.road.limits is not None and drive.road.limits.two_regions
        part = contact(drive, unit, side, at, axles_only=axles_only)
        found.append(Breach(float(s[begin]), float(s[end - 1]), at, depth, side, unit, part, region))
    return found
