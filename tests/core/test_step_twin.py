"""Whole planning steps of the core, whose memory is a window of the drive, against the same in Python, which shifts its memory."""

from collections.abc import Iterator
from dataclasses import fields

import numpy as np
import pytest

from hdvplan.centring.stationary import CentringTable
from hdvplan.planning import planner as planner_module
from hdvplan.planning.objectives import Objective, balanced, body_max, geometric
from hdvplan.planning.planner import Planner
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.planning.stations import stations_of
from hdvplan.qp.program import StageQp
from hdvplan.qp.workspace import largest_multiplier
from hdvplan.road.limits import Limits
from hdvplan.road.path import ReferencePath, from_curvature
from hdvplan.road.road import Road
from hdvplan.solvers.riccati import RiccatiWorkspace
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.chains import three_units, varying_limits
from tests.core.twins.step import Planned, Step
from tests.nightly import nightly

VEHICLES = [load_vehicle("bus"), load_vehicle("tractor-trailer"), three_units(), load_vehicle("semitrailer-active")]
each_vehicle = pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda v: v.name)
ENDS = np.array([0.0, 110.0])
LIMITS = {
    "wide": Limits.constant(5.0, 5.0, 110.0),
    "regions": Limits(ENDS, *np.outer([2.1, -2.0, 2.4, -2.6], [1.0, 1.0])),
    "varying": varying_limits(),
    "too tight": Limits.constant(1.4, 1.3, 110.0),
}
FINE, _, FAR = range(3)  # enum hdv_judgement
N = 40  # stages of 0.5 m: the window, with room for two horizons, is moved back at every fifth step of 10
# Along the drive; again at the same station; from further back; by one stage and by nearly all; beyond the horizon, and back.
ALONG = [30, 40, 50, 60, 70, 80, 80, 81, 83, 93, 60, 70, 109, 110, 20, 61, 102, 30, 34]


def winding() -> ReferencePath:
    """Return a road of bends of up to 0.04 1/m to both sides."""
    s = np.cumsum([0.0, 20.0, 15.0, 10.0, 25.0, 10.0, 10.0, 20.0])
    return from_curvature(s, np.array([0.0, 0.0, 0.04, 0.04, -0.04, -0.04, 0.0, 0.0]))


def steps(vehicle: Vehicle, limits: Limits | None, objective: Objective, settings: PlannerSettings) -> Iterator[tuple[Planned, Planned]]:
    """Plan at all stations, each from near where the last plan has led to; yield the core's plans and those of the twin."""
    road, random = Road("winding", winding(), limits), np.random.default_rng(1)
    stations = stations_of(road, vehicle, CentringTable.of(vehicle), step=settings.step, horizon=settings.horizon)
    goal = objective(stations, vehicle)
    planner, twin = Planner(vehicle, stations, goal, settings, RiccatiWorkspace), Step(vehicle, stations, goal, settings, RiccatiWorkspace)
    z, kappa, last = np.zeros(vehicle.states), 0.0, ALONG[0]
    for first in ALONG:
        plan, expected = planner.plan(first, z, kappa), twin.plan(first, z, kappa)
        yield Planned(**{field.name: getattr(plan, field.name) for field in fields(Planned)}), expected
        by = ALONG[(ALONG.index(first) + 1) % len(ALONG)] - first if first == last else 10
        last = first + by if 0 <= by <= N else first
        z = plan.z[np.clip(by, 0, N)] + 0.005 * random.uniform(-1.0, 1.0, vehicle.states)
        kappa = float(plan.kappa[by - 1]) if 0 < by <= N else kappa


def assert_same(found: Planned, expected: Planned) -> None:
    """Compare all that two plans tell: both have called the same functions of the core with the same numbers."""
    for field in fields(Planned):
        np.testing.assert_array_equal(getattr(found, field.name), getattr(expected, field.name), err_msg=field.name)


@each_vehicle
@pytest.mark.parametrize(
    ("scheme", "name"),
    [*((Scheme.RTI, name) for name in LIMITS), *((Scheme.SQP, name) for name in ("wide", "too tight")),
     *(nightly(Scheme.SQP, name) for name in ("regions", "varying"))],
)  # fmt: skip
def test_plans_in_a_window_of_the_drive_are_those_of_shifted_memory(vehicle: Vehicle, scheme: Scheme, name: str) -> None:
    settings = PlannerSettings(scheme=scheme, horizon=0.5 * N, replan=5.0, sqp_iterations=8)
    for found, expected in steps(vehicle, LIMITS[name], geometric, settings):
        assert_same(found, expected)


@pytest.mark.parametrize("objective", [body_max, balanced])
@pytest.mark.parametrize("vehicle", VEHICLES[:2], ids=lambda v: v.name)
def test_plans_for_terms_that_remember_more_are_the_same(vehicle: Vehicle, objective: Objective) -> None:
    for found, expected in steps(vehicle, LIMITS["regions"], objective, PlannerSettings(horizon=0.5 * N, replan=5.0)):
        assert_same(found, expected)


def test_a_first_plan_is_the_same_whatever_was_planned_before() -> None:
    vehicle, settings = VEHICLES[2], PlannerSettings(horizon=0.5 * N, replan=5.0)
    stations = stations_of(Road("winding", winding(), LIMITS["regions"]), vehicle, CentringTable.of(vehicle), step=0.5, horizon=0.5 * N)
    goal, z = geometric(stations, vehicle), np.full(vehicle.states, 0.02)
    planner, other = (Planner(vehicle, stations, goal, settings, RiccatiWorkspace) for _ in range(2))
    for first in (50, 65, 90):
        planner.plan(first, z, 0.0)
    again, alone = planner.plan(40, z, 0.0), other.plan(40, z, 0.0)
    assert np.array_equal(again.z, alone.z)
    assert again.qp_iterations == alone.qp_iterations


def test_multipliers_of_what_is_in_no_program_do_not_hide_a_point_far_from_the_optimum() -> None:
    vehicle, settings = VEHICLES[0], PlannerSettings(horizon=0.5 * N, replan=5.0)
    stations = stations_of(Road("winding", winding(), LIMITS["regions"]), vehicle, CentringTable.of(vehicle), step=0.5, horizon=0.5 * N)
    planner = Planner(vehicle, stations, geometric(stations, vehicle), settings, RiccatiWorkspace)
    planner.plan(40, np.zeros(vehicle.states), 0.0)
    planner_module._begin(planner._address, 40, 0.0)
    point = RiccatiWorkspace(planner._program.shape).solve(window_of(planner), None).point
    assert planner_module._judge(planner._address, point.address_for(planner._program.shape)) == FINE
    point.dynamics[5] += 10.0 * largest_multiplier(point)
    assert planner_module._judge(planner._address, point.address_for(planner._program.shape)) == FAR
    for unused in (point.stages["x_bounds"][0], point.row_points["multiplier"][0], point.stages["u_bounds"][-1]):
        unused[:] = 1e9
    assert planner_module._judge(planner._address, point.address_for(planner._program.shape)) == FAR


def window_of(planner: Planner) -> StageQp:
    """Return a copy of the program that a planner is about to solve."""
    program, at = planner._program, int(planner._scene.record["at"][0])
    program.stages[:], program.rows[:] = (array[at : at + N + 1] for array in (planner._scene.qp.stages, planner._scene.qp.rows))
    return program
