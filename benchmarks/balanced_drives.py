"""How benchmarks/balanced.py drives: the family of S-turns, the objective with other values, and the rule that it replaces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.ndimage import gaussian_filter1d

from hdvplan.api import drive_case
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.judging.result import Result, result_of
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import Goal, Objective, balanced, geometric
from hdvplan.planning.planner import Plan
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.balance import BalancePart, EnvelopeBalance
from hdvplan.planning.terms.centring import Centring, CentringPart, Residual
from hdvplan.planning.terms.term import Columns, Horizon, Needs, Scene
from hdvplan.reproduce.study import swept, unevenness
from hdvplan.road.road import Road
from hdvplan.road.scenarios import Scenario, sturn_profile
from hdvplan.vehicle.model import Vehicle

VEHICLES = ("bus", "tractor-trailer")
CURVATURES = (0.03, 0.045, 0.06, 0.08)  # [1/m]
SHARPNESSES = (0.005, 0.01, 0.02)  # [1/m^2]
EXAMPLE = (0.06, 0.01)
RTI, SQP = PlannerSettings(), PlannerSettings(scheme=Scheme.SQP)

# The deferred correction that the method replaces: K e_y + e_aux - c(s), c lowered by a share of the low-passed imbalance.
CRUDE_GAIN = 0.35
CRUDE_LOW_PASS_M = 2.0


def balanced_with(**changes: float) -> Objective:
    """Return the objective with other values in the place of its defaults."""
    return partial(_changed, changes)


def _changed(changes: Mapping[str, float], stations: Stations, vehicle: Vehicle) -> Goal:
    goal, of_term = balanced(stations, vehicle), {name: value for name, value in changes.items() if name != "rounds"}
    term = replace(_balance_of(goal), **of_term)  # type: ignore[arg-type] # names of fields that are numbers
    return Goal((term,), int(changes["rounds"]) if "rounds" in changes else goal.rounds)


def _balance_of(goal: Goal) -> EnvelopeBalance:
    (term,) = (term for term in goal.terms if isinstance(term, EnvelopeBalance))
    return term


def _residual_of(goal: Goal) -> Residual:
    (term,) = (term for term in goal.terms if isinstance(term, Centring))
    return term.residual


def case_of(road: Road, vehicle: Vehicle, objective: Objective, settings: PlannerSettings) -> Case:
    """Return a run by an objective that need not have a name that users know."""
    if not isinstance(objective, partial):
        return Case(road, vehicle, getattr(objective, "__name__", "unnamed"), settings=settings)
    changes = ", ".join(f"{name}={value:g}" for name, value in objective.args[0].items())
    return Case(road, vehicle, f"balanced: {changes}", settings=settings)


def run(road: Road, vehicle: Vehicle, objective: Objective, settings: PlannerSettings, driven: list[Case]) -> Result:
    """Drive and measure; what was driven is added to ``driven``."""
    driven.append(case_of(road, vehicle, objective, settings))
    return swept(driven[-1], objective)


def case_road(curvature: float, sharpness: float) -> Road:
    """Return one S-turn of the family."""
    return Scenario("sturn", sturn_profile(curvature, sharpness))()


def numbers(found: Result) -> dict[str, float]:
    """Return what a drive is judged by; lengths in metres."""
    kappa, imbalance = found.drive.kappa, np.abs(unevenness(found))
    return {
        "mean_abs_imbalance_m": float(np.mean(imbalance)),
        "max_abs_imbalance_m": float(np.max(imbalance)),
        "furthest_m": found.balance.half_width,
        "sum_squared_changes": float(np.sum(np.diff(kappa) ** 2)),
        "max_kappa_per_m": float(np.max(np.abs(kappa))),
        "programs": float(np.mean([plan.qp_count for plan in found.drive.plans[1:]] or [1])),
    }


class Deferred:
    """The crude rule in receding horizon: a term like centring, whose target c every plan corrects for the next ones."""

    def __init__(self, vehicle: Vehicle, settings: PlannerSettings) -> None:
        self._settings = settings
        self._middle = round(0.5 * (vehicle.reach_ahead - vehicle.reach_behind) / settings.step)

    def objective(self, stations: Stations, vehicle: Vehicle) -> Goal:
        """Return the geometric residual with a target that ``correct`` changes."""
        self._residual = _residual_of(geometric(stations, vehicle))
        measured = Goal((replace(_balance_of(balanced(stations, vehicle)), ahead=np.inf),))
        self._measured, (self._dynamics, *others) = assemble(vehicle, stations, measured, self._settings)
        (self._balance,) = (part for part in others if isinstance(part, BalancePart))
        return Goal((self,))

    def needs(self, vehicle: Vehicle) -> Needs:
        """Return nothing: see ``Term``."""
        return Centring(self._residual).needs(vehicle)

    def part(self, scene: Scene, columns: Columns) -> CentringPart:
        """Return centring as part of the program: see ``Term``."""
        self._centring = Centring(self._residual).part(scene, columns)
        return self._centring

    def correct(self, plan: Plan) -> None:
        """Lower c by the gain times the low-passed imbalance of this plan, taken at the middle of the vehicle."""
        scene, balance, targets = self._measured, self._balance, self._centring.coefficients["target"]
        horizon = Horizon(plan.first, scene.stations.points[plan.first : plan.first + self._settings.stages + 1], 0.0, 0, binding=True)
        scene.motion.z[:], scene.motion.kappa[:] = plan.z, plan.kappa
        self._dynamics.extend(horizon, 1)
        balance.centring.extend(horizon, 1)
        balance.linearise(horizon)
        reach = balance.measured.reached["reach"]
        here = np.arange(max(plan.first - balance.window.before, 0), plan.first + balance.window.places)
        measured = reach[0, here] - reach[1, here]
        smooth = gaussian_filter1d(np.where(np.isfinite(measured), measured, 0.0), CRUDE_LOW_PASS_M / self._settings.step, mode="nearest")
        stage = here - self._middle
        inside = (stage >= plan.first) & (stage < len(targets))
        weight = self._residual.lead[stage[inside]]
        targets[stage[inside]] -= CRUDE_GAIN * 0.5 * (1.0 + weight) * smooth[inside]


def deferred(road: Road, vehicle: Vehicle, settings: PlannerSettings, driven: list[Case]) -> Result:
    """Drive with the crude rule."""
    rule = Deferred(vehicle, settings)
    driven.append(Case(road, vehicle, "deferred correction", settings=settings))
    done = drive_case(driven[-1], rule.objective, on_plan=rule.correct)
    return result_of(done, solver=driven[-1].solver, objective=driven[-1].objective)


def corrected(case: Case, target: FloatArray | None) -> tuple[Result, FloatArray]:
    """Plan the whole manoeuvre to convergence with the target c, and return the next one by the crude rule."""

    def objective(stations: Stations, vehicle: Vehicle) -> Goal:
        residual = _residual_of(geometric(stations, vehicle))
        return Goal((Centring(residual if target is None else replace(residual, target=target)),))

    found, vehicle = swept(case, objective), case.vehicle
    stations = found.drive.stations
    middle = 0.5 * (vehicle.reach_ahead - vehicle.reach_behind)
    smooth = gaussian_filter1d(unevenness(found), CRUDE_LOW_PASS_M / 0.25, mode="nearest")
    seen = np.interp(stations.s + middle, found.envelope.s, smooth, right=0.0)
    residual = _residual_of(objective(stations, vehicle))
    return found, residual.target - CRUDE_GAIN * 0.5 * (1.0 + residual.lead) * seen
