"""How evenly a drive sweeps its road, and whether it keeps the limits: judged on the simulated envelope alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hdvplan.arrays import FloatArray, Records
from hdvplan.centring.stationary import CentringTable
from hdvplan.driving.drive import Drive
from hdvplan.judging.bodies import part_named
from hdvplan.judging.clearance import Approach, Touches, approaches, half_width_of, touches_of
from hdvplan.judging.envelope import SPACING_M, Envelope
from hdvplan.vehicle.model import Vehicle

KEPT_M = 0.01  # a limit counts as kept when broken by no more than this, as simulated
_NEAR_M = 0.5  # to a kerb: a body that passes so near tells that it is kept there

ONE_M = 2.0  # stretches on which a limit is broken are one if they are this near to each other, or no contact lies between them

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
    place: tuple[float, float]  #: of the body at the deepest place, x and y [m]
    obstacle: str | None = None  #: the name of the obstacle that is hit, "" for one without a name; None for the road's own edge


@dataclass(frozen=True)
class Balance:
    """The envelope in numbers. Reaches are positive [m]."""

    envelope: Envelope
    expected_half_width: float  #: of the geometric weight, at the road's largest curvature [m]
    saturated: bool  #: whether no balanced circle is as tight as the road
    min_clearance: float | None  #: to edges and obstacles; negative when one is broken; None without limits [m]
    breaches: tuple[Breach, ...]  #: deeper than KEPT_M, in order of s
    approaches: tuple[Approach, ...] = ()  #: nearest to each obstacle
    touches: Touches = field(default_factory=dict)  #: where bodies came nearest to the kerbs, beside the envelope's stations

    @cached_property
    def max_left(self) -> float:
        """Largest left reach [m]."""
        return float(np.max(self.envelope.reach_left))

    @cached_property
    def max_right(self) -> float:
        """Largest right reach [m]."""
        return float(-np.min(self.envelope.reach_right))

    @cached_property
    def mean_abs_imbalance(self) -> float:
        """Mean over s of the absolute value of left(s) + right(s) [m]."""
        return float(np.mean(np.abs(self.envelope.reach_left + self.envelope.reach_right)))

    @property
    def imbalance(self) -> float:
        """Largest left less largest right reach [m]."""
        return self.max_left - self.max_right

    @property
    def half_width(self) -> float:
        """The least constant half width that contains everything the plan swept [m], on a road without limits about the line as given."""
        return max(self.max_left, self.max_right) if self.beside_given is None else self.beside_given[0]

    @cached_property
    def beside_given(self) -> tuple[float, Touches] | None:
        """That half width of a road without limits, and what touches its kerbs; None with limits, or where the driven line is as given."""
        drive = self.envelope.drive
        if drive.road.limits is not None or drive.road.about is None:
            return None
        return half_width_of(drive, self.envelope.s, max(self.max_left, self.max_right))

    @property
    def violation(self) -> float:
        """Depth of the deepest breach; 0 when all limits are kept [m]."""
        return 0.0 if self.min_clearance is None else max(0.0, -self.min_clearance)


def balance_of(drive: Drive) -> Balance:
    """Reduce a drive's envelope, and what it left of its street, to the numbers that the tables show."""
    envelope = Envelope(drive)
    k = drive.road.path.at(envelope.s).curvature
    tightest = CentringTable.of(drive.vehicle).at(np.array([np.max(np.abs(k))]))
    near = approaches(drive)
    touches = touches_of(drive, envelope.s)
    clearance, breaches = _clearance(drive, envelope.s, touches, near)
    return Balance(
        envelope,
        float(tightest.half_width[0]),
        bool(tightest.saturated[0]),
        clearance,
        breaches,
        near,
        touches,
    )


class Place(NamedTuple):
    """Where a body comes nearest to a kerb or an obstacle, and how near [m]; the rest as in ``Breach``."""

    room: float
    s: float
    x: float
    y: float
    side: str
    unit: int
    part: str
    region: str | None
    obstacle: str | None


def places_of(vehicle: Vehicle, touches: Touches, near: Sequence[Approach] = ()) -> list[Place]:
    """Return where bodies come nearest to the kerbs of every side and region, infinitely far from none, and ``near`` to obstacles."""
    found = []
    for (side, region), touch in touches.items():
        unit, at = (int(number) for number in np.unravel_index(np.argmin(touch["gap"]), touch.shape))
        room, s, x, y, ahead = (float(touch[unit, at][name]) for name in ("gap", "s", "x", "y", "ahead"))
        found.append(Place(room, s, x, y, side, unit, part_named(vehicle.units[unit], ahead), region, None))
    return found + [Place(one.distance, one.s, one.x, one.y, one.side, one.unit, one.part, None, one.obstacle.label) for one in near]


def gaps_of(touches: Touches) -> Gaps:
    """Return the room that every body leaves, (units, n) [m], negative beyond a kerb, infinite where none is near."""
    return {key: touch["gap"] for key, touch in touches.items()}


def _clearance(drive: Drive, s: FloatArray, touches: Touches, near: tuple[Approach, ...]) -> tuple[float | None, tuple[Breach, ...]]:
    if not touches:
        return None, ()
    breaches = [breach for (side, region), touch in touches.items() for breach in _breaches(drive.vehicle, s, touch, side, region)]
    breaches = [breach for breach in breaches if not _is_the_wheels_own(breach, breaches)]
    region, length = next(iter(touches))[1], drive.road.path.length
    hits = (one for approach in near for one in approach.stretches or (approach,))
    breaches += [_hit(one, region) for one in hits if one.distance < -KEPT_M and 0.0 <= one.s <= length]
    lowest = min(*(float(np.min(touch["gap"])) for touch in touches.values()), *(approach.distance for approach in near))
    return lowest, tuple(sorted(breaches, key=lambda breach: breach.s_from))


def _hit(approach: Approach, region: str) -> Breach:
    return Breach(
        approach.s_from, approach.s_to, approach.s, -approach.distance, approach.side, approach.unit, approach.part, region,
        (approach.x, approach.y), approach.obstacle.label,
    )  # fmt: skip


def _is_the_wheels_own(breach: Breach, breaches: list[Breach]) -> bool:
    """Return whether a breach of the overhangs' limit is the wheels' own, where both limits coincide."""
    return breach.region == "sweepable" and any(
        other.region == "drivable"
        and (other.side, other.unit, other.part) == (breach.side, breach.unit, breach.part)
        and abs(other.s_deepest - breach.s_deepest) <= SPACING_M
        for other in breaches
    )


def _breaches(vehicle: Vehicle, s: FloatArray, touch: Records, side: str, region: str) -> list[Breach]:
    """Return the stretches on which the tightest of touches (units, n) lies below -KEPT_M; a contact leaps along a kerb beside bends.

    From corner to corner of a drawn kerb, as far as a body lies over both, bodies that pass at some distance do not tell that it is kept.
    """
    gap = np.min(touch["gap"], axis=0)
    broken = np.flatnonzero(gap < -KEPT_M)
    found = []
    near, kept = (np.diff(np.cumsum((gap >= -KEPT_M) & (gap < most))[broken]) > 0 for most in (_NEAR_M, np.inf))
    over = max(unit.length for unit in vehicle.units)
    apart = (np.diff(s[broken]) > ONE_M) & (near | kept & (np.diff(s[broken]) > over))
    for run in np.split(broken, np.flatnonzero(apart) + 1) if len(broken) else ():
        at = int(run[np.argmin(gap[run])])
        unit = int(np.argmin(touch["gap"][:, at]))
        deepest = touch[unit, at]
        place, part = float(deepest["s"]), part_named(vehicle.units[unit], float(deepest["ahead"]))
        span = (min(float(s[run[0]]), place), max(float(s[run[-1]]), place))
        found.append(Breach(*span, place, float(-gap[at]), side, unit, part, region, (float(deepest["x"]), float(deepest["y"]))))
    return found
