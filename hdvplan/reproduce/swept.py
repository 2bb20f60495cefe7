"""An executed drive with what it swept: the common ground of all studies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from hdvplan.api import drive_case
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.centring.stationary import Centring
from hdvplan.centring.weights import CentringTable
from hdvplan.driving.drive import Drive
from hdvplan.judging.envelope import Envelope, envelope_of
from hdvplan.planning.objectives import Objective
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.road.scenarios import Profile

REFERENCE_STEP_M = 0.5  # [GEO]'s


@dataclass(frozen=True)
class Swept:
    """A case's drive, and its envelope measured on the exact simulation."""

    case: Case
    drive: Drive
    envelope: Envelope

    @property
    def left(self) -> FloatArray:
        """Reach to the left over the envelope's arclengths, shape (n,) [m]."""
        return self.envelope.reach_left

    @property
    def right(self) -> FloatArray:
        """Reach to the right, positive, shape (n,) [m]."""
        return -self.envelope.reach_right

    @property
    def reaches(self) -> tuple[float, float]:
        """The largest reach to the left and to the right [m]."""
        return float(np.max(self.left)), float(np.max(self.right))

    @property
    def furthest(self) -> float:
        """The larger of the two [m]."""
        return max(self.reaches)

    @property
    def area_difference(self) -> float:
        """The area swept to the left less that to the right, in the road-aligned frame [m^2]."""
        return float(np.trapezoid(self.left - self.right, self.envelope.s))

    @property
    def expected(self) -> Centring:
        """The balanced geometry at the envelope's arclengths."""
        return CentringTable.of(self.drive.vehicle).at(self.drive.road.path.at(self.envelope.s).curvature)


def swept(case: Case, objective: Objective | None = None) -> Swept:
    """Drive a case and measure what it sweeps; see ``drive_case`` and ``envelope_of`` for the errors.

    ``objective`` is what ``case.objective`` calls it where that is no name that users know.
    """
    driven = drive_case(case, objective)
    return Swept(case, driven, envelope_of(driven))


def sides_of(found: Mapping[str, Swept]) -> pd.DataFrame:
    """Return over the s of the first drive the reaches of all, a column a side, left positive [m]."""
    columns = {"s": next(iter(found.values())).envelope.s}
    for name, one in found.items():
        columns |= {f"{name}_left": one.left, f"{name}_right": -one.right}
    return pd.DataFrame(columns)


def predicted(planned: Swept) -> Swept:
    """Return what the first plan of a drive predicted that it would sweep: its own states in the place of the simulation.

    The drive must have been planned in one horizon.
    """
    plan, driven = planned.drive.plans[0], planned.drive
    believed = replace(driven, z=plan.z, poses_s=driven.stations.s[: len(plan.z)], poses_z=plan.z)
    return Swept(planned.case, believed, envelope_of(believed))


def whole_manoeuvre(road: Road, step: float) -> PlannerSettings:
    """Return the settings that plan all of ``road`` in one horizon, to convergence.

    The smoothness weight is that of the same continuous problem: sums of squares scale with 1 / step, sums of squared curvature
    changes with step.
    """
    length = step * float(np.ceil(road.path.length / step - 1e-9))
    smoothness = PlannerSettings().smoothness * (REFERENCE_STEP_M / step) ** 2
    return PlannerSettings(scheme=Scheme.SQP, horizon=length, replan=length, step=step, smoothness=smoothness)


def road_of(name: str, profile: Profile) -> Road:
    """Return the road of a curvature profile."""
    return Road(name, from_curvature(*profile))
