"""The largest reach as an objective: its rows, its optimum, and planning step by step with it."""

import numpy as np
import pytest

from hdvplan.api import drive_case
from hdvplan.arrays import FloatArray, Records
from hdvplan.case import Case
from hdvplan.centring.stationary import CentringTable
from hdvplan.errors import OptionError
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import OBJECTIVES, Goal, Objective, art_weighted, axle_max, body_max, geometric, objective_named
from hdvplan.planning.planner import Plan, Planner
from hdvplan.planning.settings import OBJECTIVE_NAMES, PlannerSettings, Scheme
from hdvplan.planning.stations import Stations, stations_of
from hdvplan.planning.terms.centring import Centring, Reach, Residual
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.solvers.registry import solver_named
from hdvplan.solvers.riccati import RiccatiWorkspace
from hdvplan.vehicle.kinematics import axle_points, axles_behind, edge_points
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.chains import differences, on_road, winding
from tests.core.programs import Spy
from tests.core.scenes import extended, horizon_at, move

VEHICLES = [load_vehicle("bus"), load_vehicle("tractor-trailer")]
each_vehicle = pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda v: v.name)
each_objective = pytest.mark.parametrize("objective", [axle_max, body_max])
FIRST = 40  # a station in front of the first bend


def stations_for(vehicle: Vehicle, settings: PlannerSettings, limit: float | None = None) -> Stations:
    road = Road("winding", winding())
    road = road if limit is None else road.with_limits(limit, limit)
    return stations_of(road, vehicle, CentringTable.of(vehicle), step=settings.step, horizon=settings.horizon)


def offsets(vehicle: Vehicle, stations: Stations, at: int, z: FloatArray, points: Records, half: FloatArray) -> FloatArray:
    """Return the offsets of the watched points: by unit, left edge before right, point by point."""
    local = [
        np.concatenate([np.column_stack([row["ahead"], np.full(len(row), side * width)]) for side in (1.0, -1.0)])
        for row, width in zip(points, half, strict=True)
    ]
    s = float(stations.s[at])
    places = np.concatenate(on_road(vehicle, stations.path, s, z, local))
    near = np.concatenate([s - behind + ahead[:, 0] for behind, ahead in zip(axles_behind(vehicle), local, strict=True)])
    _, found = stations.path.project(places[:, 0], places[:, 1], near)
    return found


def watched(vehicle: Vehicle, objective: Objective) -> tuple[Records, FloatArray]:
    half: FloatArray = vehicle.table()["half_width"]
    return (edge_points(vehicle), half) if objective is body_max else (axle_points(vehicle), 0.0 * half)


def reach(vehicle: Vehicle, stations: Stations, plan: Plan, objective: Objective) -> float:
    points, half = watched(vehicle, objective)
    return max(float(np.max(np.abs(offsets(vehicle, stations, plan.first + i, plan.z[i], points, half)))) for i in range(1, len(plan.z)))


def planned(vehicle: Vehicle, objective: Objective, settings: PlannerSettings, solver: str = "riccati") -> tuple[Plan, Stations]:
    stations = stations_for(vehicle, settings)
    planner = Planner(vehicle, stations, objective(stations, vehicle), settings, solver_named(solver))
    return planner.plan(FIRST, np.zeros(vehicle.states), 0.0), stations


@each_vehicle
@each_objective
def test_the_rows_are_the_offsets_and_their_derivatives(vehicle: Vehicle, objective: Objective) -> None:
    settings = PlannerSettings(horizon=6.0)
    stations, (points, half) = stations_for(vehicle, settings), watched(vehicle, objective)
    scene, parts = assemble(vehicle, stations, Goal((Reach(bodies=objective is body_max),)), settings)
    z = 0.1 * np.random.default_rng(1).uniform(-1.0, 1.0, (settings.stages + 1, vehicle.states))
    move(scene, z)
    extended(parts, horizon_at(scene, FIRST))
    G, h, t = scene.qp.G, scene.qp.h, vehicle.states + 1
    assert G.shape[1] == 2 * points.size
    sides = np.repeat(np.tile([1.0, -1.0], points.shape[0]), points.shape[1])
    for i in range(1, settings.stages + 1):

        def outwards(state: FloatArray, at: int = FIRST + i) -> FloatArray:
            return sides * offsets(vehicle, stations, at, state, points, half)

        assert np.max(np.abs(h[i - 1] + outwards(z[i]))) < 1e-9  # both projections are exact to that
        # five-point differences of a projection: its 1e-9 over a step of 1e-3
        assert np.max(np.abs(G[i - 1, :, : vehicle.states] - differences(outwards, z[i]))) < 1e-5
        assert np.all(G[i - 1, :, vehicle.states] == 0.0)  # curvature moves nobody
        assert np.all(G[i - 1, :, t] == -1.0)  # t moves both limits outwards
    furthest = max(float(np.max(np.abs(offsets(vehicle, stations, FIRST + i, z[i], points, half)))) for i in range(1, len(z)))
    assert parts[-1].price(horizon_at(scene, FIRST)) == pytest.approx(settings.stages * furthest**2, rel=1e-8)


@each_vehicle
@each_objective
def test_the_largest_reach_becomes_smaller_than_any_other_objective_leaves_it(vehicle: Vehicle, objective: Objective) -> None:
    settings = PlannerSettings(scheme=Scheme.SQP, horizon=50.0)
    own, stations = planned(vehicle, objective, settings)
    assert own.usable
    assert own.moved < settings.sqp_tolerance
    for other in (geometric, axle_max if objective is body_max else body_max):
        plan, _ = planned(vehicle, other, settings)
        # the light second term may cost the reach some millimetres
        assert reach(vehicle, stations, own, objective) < reach(vehicle, stations, plan, objective) + 0.005


@each_objective
@pytest.mark.parametrize("solver", ["piqp", "clarabel"])
def test_every_solver_finds_the_same_plan(objective: Objective, solver: str) -> None:
    settings = PlannerSettings(scheme=Scheme.SQP, horizon=40.0, sqp_tolerance=1e-6)
    plan, _ = planned(VEHICLES[1], objective, settings)
    other, _ = planned(VEHICLES[1], objective, settings, solver)
    assert other.usable
    # a flat optimum where the reach is free: complementarity of 1e-8 leaves about its root
    assert np.max(np.abs(plan.z - other.z)) < 1e-3


@each_objective
def test_the_extra_state_is_the_largest_reach_and_the_rows_give_way_nowhere(objective: Objective) -> None:
    vehicle, settings = VEHICLES[1], PlannerSettings(scheme=Scheme.SQP, horizon=40.0, sqp_tolerance=1e-7)
    stations, spy = stations_for(vehicle, settings), Spy(RiccatiWorkspace)
    planner = Planner(vehicle, stations, objective(stations, vehicle), settings, spy)
    plan = planner.plan(FIRST, np.zeros(vehicle.states), 0.0)
    program = spy.programs[-1]
    point = RiccatiWorkspace(program.shape).solve(program, None).point
    t = vehicle.states + 1
    assert np.max(np.abs(point.x[1:, t] - point.x[1, t])) < 1e-9  # one number over the horizon
    assert abs(point.x[1, t] - reach(vehicle, stations, plan, objective)) < 1e-5  # the SQP's tolerance, and the solver's on an active row
    assert np.max(point.sigma) < 1e-6
    assert np.max(program.linear) > np.max(point.rows)  # no multiplier comes near the price of breaking a row


@each_objective
def test_limits_hold_beside_the_largest_reach(objective: Objective) -> None:
    vehicle, settings = VEHICLES[0], PlannerSettings(scheme=Scheme.SQP, horizon=40.0, sqp_tolerance=1e-6)
    free, _ = planned(vehicle, objective, settings)
    stations = stations_for(vehicle, settings)
    reached = reach(vehicle, stations, free, body_max)
    tight = stations_for(vehicle, settings, max(reached - 0.02, 2.0) if objective is axle_max else reached + 0.05)
    plan = Planner(vehicle, tight, objective(tight, vehicle), settings, solver_named("riccati")).plan(FIRST, np.zeros(vehicle.states), 0.0)
    assert plan.usable
    assert plan.violation < 1e-5  # rows bind to the solver's tolerance


@each_vehicle
@each_objective
def test_one_program_a_step_ends_where_a_fresh_start_does(vehicle: Vehicle, objective: Objective) -> None:
    settings = PlannerSettings(horizon=40.0)
    stations = stations_for(vehicle, settings)
    planner = Planner(vehicle, stations, objective(stations, vehicle), settings, solver_named("riccati"))
    plan = planner.plan(FIRST, np.zeros(vehicle.states), 0.0)
    for step in range(1, 4):
        plan = planner.plan(FIRST + 2 * step, plan.z[2], float(plan.kappa[1]))
        assert plan.qp_count == 1
    fresh = Planner(vehicle, stations, objective(stations, vehicle), settings, solver_named("riccati"))
    again = fresh.plan(plan.first, plan.z[0], plan.kappa_before)
    assert abs(reach(vehicle, stations, plan, objective) - reach(vehicle, stations, again, objective)) < 0.01  # one QP against many


def residual(goal: Goal) -> Residual:
    """Return what a goal of one term centres."""
    (term,) = goal.terms
    assert isinstance(term, Centring)
    return term.residual


def test_the_weighted_objective_is_the_geometric_one_scaled_at_the_tightest_place() -> None:
    stations = stations_for(VEHICLES[1], PlannerSettings())
    found, balanced = residual(art_weighted(stations, VEHICLES[1])), residual(geometric(stations, VEHICLES[1]))
    assert np.allclose(found.lead + found.aux, 1.0)
    tightest = int(np.argmax(np.abs(stations.curvature)))
    assert found.lead[0] / found.aux[0] == pytest.approx(balanced.lead[tightest])


def test_a_weight_can_be_given_with_the_name() -> None:
    stations = stations_for(VEHICLES[1], PlannerSettings())
    found = residual(objective_named("art-weighted:0.3")(stations, VEHICLES[1]))
    assert np.all(found.aux == 0.3)
    assert np.all(found.lead == 0.7)
    assert objective_named("art-weighted") is art_weighted


def test_every_name_that_is_accepted_has_an_objective() -> None:
    assert set(OBJECTIVES) == set(OBJECTIVE_NAMES)


@pytest.mark.parametrize("name", ["art-weighted:1.5", "art-weighted:-0.1", "art-weighted:much", "art-weighted:nan", "lead-axle:0.4"])
def test_weights_that_are_none_are_refused(name: str) -> None:
    with pytest.raises(OptionError) as caught:
        objective_named(name)
    assert caught.value.hint or "from 0 to 1" in str(caught.value)


@each_objective
def test_a_point_beyond_the_centre_of_curvature_ends_no_plan(objective: Objective) -> None:
    """The trailer of this vehicle cuts a bend of 6 m across its centre."""
    vehicle, settings = load_vehicle("tractor-trailer-24m"), PlannerSettings(horizon=50.0)
    road = Road("tight", from_curvature([0.0, 30.0, 36.0, 46.0, 52.0, 110.0], [0.0, 0.0, 0.16, 0.16, 0.0, 0.0]))
    drive = drive_case(Case(road, vehicle, objective=objective, settings=settings))
    assert np.all(np.isfinite(drive.z))
