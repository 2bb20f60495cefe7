"""What a report is made from: an executed drive, what it swept, and how it was planned."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray, running
from hdvplan.case import Case
from hdvplan.centring.stationary import Centring, CentringTable
from hdvplan.driving.drive import Drive
from hdvplan.judging.balance import KEPT_M, Balance, Gaps, balance_of, gaps_of
from hdvplan.judging.bodies import corners, outlines_of, swept_pieces, united
from hdvplan.judging.clearance import Approach, rooms_beside, touches_of
from hdvplan.judging.envelope import Envelope
from hdvplan.judging.fit import Fit, fit_of
from hdvplan.judging.tracking import Tracking, tracking_of
from hdvplan.planning.bias import shifted
from hdvplan.planning.objectives import Objective
from hdvplan.planning.planner import Plan
from hdvplan.road.regions import Region, Side
from hdvplan.solvers.registry import SolverClass
from hdvplan.vehicle.model import Vehicle


@dataclass(frozen=True)
class Trial:
    """What a plan of a stretch of road came to, as simulated [m]."""

    violation: float  # by how much the deepest place misses the clearance wanted; 0 when it is kept; infinite where no plan exists
    harm: float  # the square of what is missing anywhere, over the length of road where it is [m^3]
    clearance: float  # least room to edges and obstacles; negative where one is broken
    off_centre: float  # mean distance of the swept area's middle from where it is wanted
    cost: float  # mean over the stations of its square and of the weighted squared change of curvature, as planning weighs them [m^2]


@dataclass(frozen=True)
class Passed:
    """An obstacle, the side on which it is passed, and the plans of the road around it with either side.

    ``own`` and ``other`` are None where nothing was to be chosen; ``reason`` says why. ``crossed``: the line passes it on the other side.
    """

    obstacle: Region
    s_from: float  # [m]
    s_to: float
    side: Side
    forced: bool
    own: Trial | None
    other: Trial | None
    reason: str | None
    crossed: bool


@dataclass(frozen=True)
class Proof:
    """That no driving keeps a road's limits.

    ``kind`` is "place" where one body alone, ``unit``, fits between the limits at ``s_to`` in no pose; "motion" where the vehicle, up to
    ``unit``, fits everywhere from ``s_from`` to ``s_to`` [m], but nothing that fits at ``s_from`` can be driven to ``s_to``.
    """

    kind: str
    s_from: float
    s_to: float
    unit: int


NOT_PLANNED = "none"
_SIMPLER_M = 1e-3  # of swept areas: points are left out that would move no outline by more
_PAIR = ("tractor", "trailer")


class Attempt(NamedTuple):
    """A plan with stations a ``step`` apart and limits that give way, and the room that it lacks, 0 where it fits; all [m]."""

    step: float
    give_way: float
    lacking: float


@dataclass(frozen=True)
class Result:
    """A case's drive with its evaluation."""

    case: Case
    drive: Drive
    balance: Balance
    passed: tuple[Passed, ...] = ()  #: the obstacles in order of s, and their sides
    proof: Proof | None = None  #: that nothing keeps the limits; None if none was found or looked for
    attempts: tuple[Attempt, ...] = ()  #: every plan, if it was planned more than once; see ``hdvplan.replanned``
    most_clearance: float | None = None  #: the largest that a plan was found to keep [m]; None: none was looked for
    path: str = ""  #: the file of a given path, where it is known
    between: tuple[float, float] | None = None  #: of a given path's points how far apart they are, and how well that tells the room [m]

    def __repr__(self) -> str:
        """Return one line, for a notebook: all fields together have millions of signs."""
        least = self.balance.min_clearance
        room = f"half width {self.balance.half_width:.2f} m" if least is None else f"least room {least:.2f} m"
        return f"<{type(self).__name__} of {self.drive.vehicle.name} on {self.drive.road.name}: {self.status}, {room}>"

    @property
    def planned(self) -> bool:
        """Whether the drive was planned; else its path was given."""
        return bool(self.drive.plans)

    @property
    def scheme(self) -> str:
        """What users call the scheme; "none" of a given path, as for ``solver`` and ``objective``."""
        return str(self.case.settings.scheme) if self.planned else NOT_PLANNED

    @property
    def solver(self) -> str:
        """What users call the solver."""
        return self.case.solver_name if self.planned else NOT_PLANNED

    @property
    def objective(self) -> str:
        """What users call the objective."""
        return self.case.objective_name if self.planned else NOT_PLANNED

    @property
    def origin(self) -> str:
        """How the drive came about, for a title."""
        given = f"driven along a given path {self.path}".rstrip()
        return f"planned by {self.scheme.upper()}, {self.solver}, {self.objective}" if self.planned else given

    @property
    def envelope(self) -> Envelope:
        """How far the bodies reached to either side of the road's centre."""
        return self.balance.envelope

    @cached_property
    def expected(self) -> Centring:
        """The balanced driving at the envelope's arclengths."""
        curvature = shifted(self.drive.road.path.at(self.envelope.s).curvature, self.aim, self.envelope.s)
        return CentringTable.of(self.drive.vehicle).at(curvature)

    @cached_property
    def fit(self) -> Fit:
        """The forecast from stationary circles."""
        return fit_of(self.drive.road, self.drive.vehicle)

    @cached_property
    def gaps(self) -> Gaps:
        """The room that every body leaves to the street's kerbs, (units, n) [m], by side and region; empty without limits."""
        return gaps_of(self.balance.touches)

    @cached_property
    def clearance(self) -> FloatArray | None:
        """Least room to any limit at the envelope's arclengths, negative where one is broken, shape (n,) [m]; None without limits.

        It is that of a station and its neighbours: from pose to pose a corner may pass by the kerb beside a station.
        Obstacles count with their distance in the plane, as in ``approaches``.
        """
        if not self.gaps or self.balance.min_clearance is None:
            return None
        rooms = rooms_beside(self.drive, self.envelope.s)
        least = running(np.minimum, np.min([rooms, *np.concatenate([*self.gaps.values()])], axis=0), 1, 1)
        for near in self.approaches:
            if 0.0 <= near.s <= self.drive.road.path.length:
                at = int(np.argmin(np.abs(self.envelope.s - near.s)))
                least[at] = min(least[at], near.distance)
        return least

    @cached_property
    def wheel_room(self) -> float | None:
        """Least room that wheels, and what lies between a body's axles, leave to their limits, negative beyond them [m]; None without."""
        touches = touches_of(self.drive, self.envelope.s, wheels_only=True)
        return min((float(np.min(touch["gap"])) for touch in touches.values()), default=None)

    @cached_property
    def tracking(self) -> Tracking | None:
        """How far the driver may stray so that every body still keeps the street; None without limits, and where they are broken."""
        room = self.balance.min_clearance
        if room is None or room < -KEPT_M:
            return None
        return tracking_of(self.drive, self.balance, self.case.settings.tracking_length)

    @property
    def approaches(self) -> tuple[Approach, ...]:
        """Where the drive came nearest to each obstacle."""
        return self.balance.approaches

    @cached_property
    def outlines(self) -> shapely.STRtree:
        """The outlines of all bodies at all simulated poses; index i is body ``i % units`` at pose ``i // units``."""
        return shapely.STRtree(outlines_of(self.drive))

    @cached_property
    def swept(self) -> tuple[BaseGeometry, ...]:
        """The area that each body swept in the plane, also beyond the ends of the line, from each simulated pose to the next [m]."""
        outlines = np.moveaxis(corners(self.drive, np.arange(len(self.drive.poses_s))), 1, 0)
        return tuple(shapely.simplify(united(swept_pieces(of_body)), _SIMPLER_M) for of_body in outlines)

    @cached_property
    def approached(self) -> FloatArray:
        """Arclengths and distances of ``approaches``, shape (2, n) [m]."""
        return np.array([[near.s, near.distance] for near in self.approaches]).reshape(-1, 2).T

    @property
    def entered(self) -> tuple[Approach, ...]:
        """The obstacles before the road's start and beyond its end that a body entered; those beside the road are in the breaches."""
        length = self.drive.road.path.length
        return tuple(near for near in self.approaches if near.distance < -KEPT_M and not 0.0 <= near.s <= length)

    @property
    def failed(self) -> tuple[Plan, ...]:
        """The planning steps whose QP solution the recomputed residuals refused; the vehicle followed the last plan."""
        return tuple(plan for plan in self.drive.plans if not plan.usable)

    @property
    def rescued(self) -> tuple[Plan, ...]:
        """The planning steps in which another solver answered, because the one that was asked for had failed."""
        return tuple(plan for plan in self.drive.plans if plan.instead and plan.usable)

    @property
    def aim(self) -> FloatArray:
        """Where the middle of the swept envelope was wanted, at the envelope's arclengths [m]."""
        return self.drive.bias.at(self.envelope.s)

    @property
    def two_regions(self) -> bool:
        """Whether overhangs have separate limits, so that a breach must say which."""
        street = self.drive.road.kerbs
        return street is not None and street.two_regions

    @property
    def status(self) -> str:
        """What holds of the drive, the first of these.

        ``limits broken``, ``obstacle entered``, ``clearance not kept``, ``some steps not solved``, ``some steps by another solver``,
        ``ok``.
        """
        if self.balance.breaches:
            return "limits broken"
        if self.entered:
            return "obstacle entered"
        least, wanted = self.balance.min_clearance, self.case.settings.clearance
        if least is not None and wanted > 0.0 and least < wanted - KEPT_M:
            return "clearance not kept"
        if self.failed:
            return "some steps not solved"
        return "some steps by another solver" if self.rescued else "ok"


def result_of(drive: Drive, *, solver: str | SolverClass, objective: str | Objective, passed: tuple[Passed, ...] = ()) -> Result:
    """Evaluate an executed drive; ``solver`` and ``objective`` are those of its case, ``passed`` how its obstacles are passed."""
    case = Case(drive.road, drive.vehicle, objective, solver, drive.settings, drive.bias)
    return Result(case, drive, balance_of(drive), passed)


def body_name(vehicle: Vehicle, unit: int) -> str:
    """Return what users call body ``unit`` (from 0): its own name, or the vehicle's, tractor or trailer, or its number from 1."""
    if vehicle.units[unit].name:
        return vehicle.units[unit].name
    if len(vehicle.units) == 1:
        return vehicle.name
    return _PAIR[unit] if len(vehicle.units) == len(_PAIR) else f"unit {unit + 1}"
