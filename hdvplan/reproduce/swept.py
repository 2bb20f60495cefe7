"""Drives of cases, and what they sweep to either side: the common ground of all studies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd

from hdvplan.api import drive_case
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.judging.result import Result, result_of
from hdvplan.planning.objectives import Objective
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.road.road import Road

REFERENCE_STEP_M = 0.5  # [GEO]'s


def swept(case: Case, objective: Objective | None = None) -> Result:
    """Drive a case and judge what it sweeps; see ``drive_case`` and ``result_of`` for the errors.

    ``objective`` is what ``case.objective`` calls it where that is no name that users know.
    """
    return result_of(drive_case(case, objective), solver=case.solver, objective=case.objective)


def unevenness(found: Result) -> FloatArray:
    """Return how much further a drive reaches to the left than to the right, over the envelope's arclengths, shape (n,) [m]."""
    return found.envelope.reach_left + found.envelope.reach_right


def area_difference(found: Result) -> float:
    """Return the area swept to the left less that to the right, in the road-aligned frame [m^2]."""
    return float(np.trapezoid(unevenness(found), found.envelope.s))


def sides_of(found: Mapping[str, Result]) -> pd.DataFrame:
    """Return over the s of the first drive the reaches of all, a column a side, left positive [m]."""
    columns = {"s": next(iter(found.values())).envelope.s}
    for name, one in found.items():
        columns |= {f"{name}_left": one.envelope.reach_left, f"{name}_right": one.envelope.reach_right}
    return pd.DataFrame(columns)


def predicted(planned: Result) -> Result:
    """Return what the first plan of a drive predicted that it would sweep: its own states in the place of the simulation.

    The drive must have been planned in one horizon.
    """
    plan, driven = planned.drive.plans[0], planned.drive
    believed = replace(driven, z=plan.z, poses_s=driven.stations.s[: len(plan.z)], poses_z=plan.z)
    return result_of(believed, solver=planned.case.solver, objective=planned.case.objective)


def whole_manoeuvre(road: Road, step: float) -> PlannerSettings:
    """Return the settings that plan all of ``road`` in one horizon, to convergence.

    The smoothness weight is that of the same continuous problem: sums of squares scale with 1 / step, sums of squared curvature
    changes with step.
    """
    length = step * float(np.ceil(road.path.length / step - 1e-9))
    smoothness = PlannerSettings().smoothness * (REFERENCE_STEP_M / step) ** 2
    return PlannerSettings(scheme=Scheme.SQP, horizon=length, replan=length, step=step, smoothness=smoothness)
