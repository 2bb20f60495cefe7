"""A drive of several legs, judged leg by leg: what decides over all of them, and where a trailer folds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from shapely.geometry.base import BaseGeometry

from hdvplan.answers import NO, word_of, worded
from hdvplan.arrays import FloatArray
from hdvplan.driving.drive import Drive
from hdvplan.judging.bodies import placed, united
from hdvplan.judging.result import Result, body_name
from hdvplan.judging.verdict import Verdict, short_verdict, verdict_details, verdict_line, verdict_of
from hdvplan.road.arcs import wrapped
from hdvplan.road.legs import Leg, Legs
from hdvplan.vehicle.kinematics import critical_angles

JACKKNIFE = "jack-knife"
_ROUNDING = np.deg2rad(0.1)  # beyond a critical angle: plans keep their bounds at stations, and simulation strays between them by less
_OFF_M, _TURNED = 0.1, np.deg2rad(2.0)  # off the last leg's line at its end: less is not told


@dataclass(frozen=True)
class Jackknife:
    """Where an articulation lies furthest beyond the angle from which no steering brings it back."""

    s: float  #: of the lead rear axle [m]
    x: float  #: of the coupling [m]
    y: float
    coupling: int  #: from 0
    angle: float  #: without its sign [rad]
    critical: float  #: [rad]


@dataclass(frozen=True)
class LegsResult:
    """The legs of a drive with their judged drives, each of them in order of s on its own line."""

    legs: Legs
    results: tuple[Result, ...]
    #: how far each cusp lies past the drawn one, negative short of it [m]; empty where they are the drawn ones
    past: tuple[float, ...] = ()

    def __repr__(self) -> str:
        """Return one line, for a notebook."""
        return f"<{type(self).__name__} of {self.name}: {self.text}>"

    @cached_property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Of each leg, on its street."""
        return tuple(verdict_of(result) for result in self.results)

    @cached_property
    def jackknives(self) -> tuple[Jackknife | None, ...]:
        """Of each leg, None where no trailer folds."""
        return tuple(jackknife_of(result.drive) for result in self.results)

    @cached_property
    def swept(self) -> tuple[BaseGeometry, ...]:
        """The area that all bodies sweep on each leg, in the plane [m]."""
        return tuple(united(result.swept) for result in self.results)

    @property
    def worst(self) -> int:
        """The number of the leg that decides, from 0: one that folds a trailer, else that with the least room, or the widest sweep."""
        return min(range(len(self.results)), key=self._rank)

    @property
    def fits(self) -> bool | None:
        """Whether all legs keep their street and no trailer folds; None where nothing limits any of them."""
        known = [verdict.fits for verdict in self.verdicts if verdict.fits is not None]
        if any(one is not None for one in self.jackknives) or not all(known):
            return False
        return True if known else None

    @property
    def word(self) -> str:
        """``YES``, ``NO`` or, without limits, ``NEEDS``."""
        return word_of(self.fits)

    @property
    def text(self) -> str:
        """The verdict over all legs as one line."""
        at = self.worst
        folded, result = self.jackknives[at], self.results[at]
        if folded is None:
            return verdict_line(result, self.verdicts[at], self.of(at))
        degrees = f"{np.degrees(folded.angle):.0f} degrees, beyond {np.degrees(folded.critical):.1f}"
        return worded(NO, f"{JACKKNIFE} at s = {folded.s:z.1f} m{self.of(at)}: {degrees} no steering helps")

    @property
    def title(self) -> str:
        """The verdict over all legs as a short title: vehicle, word and amount."""
        at = self.worst
        short = short_verdict(self.verdicts[at]) if self.jackknives[at] is None else f"{NO}, {JACKKNIFE}"
        return f"{self.name}: {short}"

    @property
    def name(self) -> str:
        """What is driven where."""
        return f"{self.results[0].drive.vehicle.name} on {self.legs.name}"

    @property
    def details(self) -> str:
        """What else is known of the leg that decides, as one line, and how askew the vehicle stands at last."""
        at = self.worst
        folded, result = self.jackknives[at], self.results[at]
        off, turned = (abs(value) for value in self.off_line(len(self.results) - 1))
        askew = f"; it ends {off:.2f} m and {np.degrees(turned):.0f} degrees off its line" if off > _OFF_M or turned > _TURNED else ""
        if folded is None:
            return verdict_details(result, self.verdicts[at], self.of(at)) + askew
        ahead, behind = (body_name(result.drive.vehicle, folded.coupling + later) for later in (0, 1))
        own = verdict_line(result, self.verdicts[at], self.of(at))
        return f"between the {ahead} and the {behind}, at x {folded.x:.1f}, y {folded.y:.1f}; apart from that {own}{askew}"

    @property
    def room(self) -> float:
        """The least room of any leg [m], infinite where nothing limits them, and none where a trailer folds."""
        if any(one is not None for one in self.jackknives):
            return float(-np.inf)
        return min((verdict.spare for verdict in self.verdicts if verdict.spare is not None), default=float(np.inf))

    def called(self, at: int) -> str:
        """Return what a leg is called, by its number from 0."""
        return f"leg {at + 1} ({self.legs.legs[at].direction})"

    def of(self, at: int) -> str:
        """Return what follows a place in a sentence, so that it is known on which leg it lies."""
        return f" of {self.called(at)}"

    def articulation(self, at: int) -> tuple[FloatArray, FloatArray]:
        """Return the articulations at which a leg begins and ends, in the order of driving, (couplings,) each [rad]."""
        return ends_of(self.results[at].drive, self.legs.legs[at])

    def off_line(self, at: int) -> tuple[float, float]:
        """Return how far off the end of a leg's line as drawn the axle on it stands, and is turned, left positive [m, rad]."""
        leg, drive = self.legs.legs[at], self.results[at].drive
        x, y, heading = leg.aim
        bodies = placed(drive, np.array([np.argmin(np.abs(drive.poses_s - leg.ends[1]))]))[0]
        axle = bodies[0 if leg.last_axle is None else -1]
        return float(np.hypot(axle["x"] - x, axle["y"] - y)), float(wrapped(np.arctan2(axle["sin"], axle["cos"]) - heading))

    def _rank(self, at: int) -> tuple[bool, bool, float]:
        verdict = self.verdicts[at]
        room = -verdict.half_width if verdict.spare is None else verdict.spare
        return self.jackknives[at] is None, verdict.spare is None, room


def ends_of(drive: Drive, leg: Leg) -> tuple[FloatArray, FloatArray]:
    """Return the articulations at which a leg begins and ends, in the order of driving, (couplings,) each [rad]."""
    low, high = drive.z[[0, -1], 2 : drive.vehicle.rigid_states]
    return (high, low) if leg.backward else (low, high)


def jackknife_of(drive: Drive) -> Jackknife | None:
    """Return where a drive folds a trailer furthest beyond its critical angle, as simulated; None where it does not."""
    angles = np.abs(drive.poses_z[:, 2 : drive.vehicle.rigid_states])
    critical = critical_angles(drive.vehicle)
    if not angles.size or not np.any(angles > critical + _ROUNDING):
        return None
    at, coupling = (int(number) for number in np.unravel_index(np.argmax(angles - critical), angles.shape))
    trailer = placed(drive, np.array([at]))[0, coupling + 1]
    x, y = (float(trailer[f"coupling_{axis}"]) for axis in "xy")
    return Jackknife(float(drive.poses_s[at]), x, y, coupling, float(angles[at, coupling]), float(critical[coupling]))
