import numpy as np
import pytest
from scipy.optimize import LinearConstraint, minimize

from hdvplan.arrays import FloatArray
from hdvplan.centring.stationary import CentringTable
from hdvplan.errors import OptionError, SolverError
from hdvplan.planning import planner as planner_module
from hdvplan.planning.objectives import geometric
from hdvplan.planning.planner import Plan, Planner
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.planning.stations import BETWEEN, Stations, stations_of
from hdvplan.qp.program import StageQp, StageSolution
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.solvers.riccati import RiccatiWorkspace
from hdvplan.vehicle.kinematics import axles_behind
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Unit, Vehicle
from tests.core.chains import differences, on_road, winding
from tests.core.programs import PARTS, Spy
from tests.core.rules import advance
from tests.core.twins.street import gaps, state_before

LIMIT = 3.4
TIGHT = {"bus": 2.19, "tractor-trailer": 1.84}  # 0.1 and 0.2 m less than the free plan's reach
VEHICLES = [load_vehicle("bus"), load_vehicle("tractor-trailer")]
each_vehicle = pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda v: v.name)


def stations_for(vehicle: Vehicle, settings: PlannerSettings, limit: float | None = LIMIT) -> Stations:
    road = Road("winding", winding())
    road = road if limit is None else road.with_limits(limit, limit)
    return stations_of(road, vehicle, CentringTable.of(vehicle), step=settings.step, horizon=settings.horizon)


def start(vehicle: Vehicle, e_y: float = 0.1) -> FloatArray:
    return np.concatenate([[e_y, 0.02], np.full(vehicle.states - 2, 0.03)])


def planned(vehicle: Vehicle, settings: PlannerSettings, limit: float | None = LIMIT) -> tuple[Planner, Spy, Stations]:
    spy, stations = Spy(RiccatiWorkspace), stations_for(vehicle, settings, limit)
    return Planner(vehicle, stations, geometric(stations, vehicle), settings, spy), spy, stations


@each_vehicle
@pytest.mark.parametrize("tight", [False, True])
def test_a_solver_is_given_multipliers_where_there_were_some(vehicle: Vehicle, tight: bool) -> None:
    planner, spy, _ = planned(vehicle, PlannerSettings(horizon=25.0), TIGHT[vehicle.name] if tight else LIMIT)
    plan = planner.plan(30, start(vehicle), 0.0)
    asked = len(spy.programs)
    planner.plan(40, plan.z[10], float(plan.kappa[9]))
    assert all(spy.guessed[asked:]) is tight


@each_vehicle
def test_a_rolling_plan_needs_exactly_one_program_after_the_first(vehicle: Vehicle) -> None:
    planner, spy, _ = planned(vehicle, PlannerSettings(horizon=25.0))
    plan = planner.plan(20, start(vehicle), 0.0)
    assert plan.qp_count == len(spy.programs) > 1  # the first has no predecessor to lean on
    for step in range(1, 5):
        asked = len(spy.programs)
        plan = planner.plan(20 + 10 * step, plan.z[10], float(plan.kappa[9]))
        assert plan.qp_count == 1
        assert len(spy.programs) == asked + 1


@each_vehicle
def test_sequential_programs_end_at_a_motion_that_follows_the_model_and_moves_no_more(vehicle: Vehicle) -> None:
    settings = PlannerSettings(scheme=Scheme.SQP, horizon=25.0, sqp_tolerance=1e-8)
    planner, _, stations = planned(vehicle, settings)
    plan = planner.plan(30, start(vehicle), 0.0)
    assert plan.moved < 1e-8
    assert plan.usable
    assert plan.violation < 1e-6
    for i in range(settings.stages):
        ahead = next_state(vehicle, stations, settings, 30 + i, plan.z[i], float(plan.kappa[i]))
        assert np.max(np.abs(ahead - plan.z[i + 1])) < 1e-9
    assert np.max(np.abs(plan.z[0] - start(vehicle))) < 1e-12  # given, up to what the solver leaves of zero
    assert np.max(np.abs(plan.kappa)) <= vehicle.max_curvature + 1e-9
    assert np.max(np.abs(np.diff(plan.kappa, prepend=0.0))) <= vehicle.max_curvature_rate * settings.step + 1e-9


@each_vehicle
def test_sequential_programs_find_one_optimum_from_different_guesses(vehicle: Vehicle) -> None:
    settings = PlannerSettings(scheme=Scheme.SQP, horizon=25.0, sqp_tolerance=1e-8)
    plans = []
    for detour in (None, -1.0, 1.2):
        planner, _, _ = planned(vehicle, settings)
        if detour is not None:
            planner.plan(30, start(vehicle, detour), 0.05)
        plans.append(planner.plan(30, start(vehicle), 0.0))
    for plan in plans[1:]:
        assert np.max(np.abs(plan.z - plans[0].z)) < 1e-6  # 1e-8 a state and step, and the solver's 1e-8 on its conditions
        assert np.max(np.abs(plan.kappa - plans[0].kappa)) < 1e-6


def next_state(vehicle: Vehicle, stations: Stations, settings: PlannerSettings, at: int, z: FloatArray, kappa: float) -> FloatArray:
    """Return the state that the model predicts one station after ``at``."""
    point, out = stations.points[at], np.empty(z.size)
    k, between = float(point["curvature"]), float(point["curvature_between"])
    advance(settings.discretisation.code, vehicle.table(), k, between, settings.step, z, kappa, out)
    return out


def rolled_out(
    vehicle: Vehicle, stations: Stations, settings: PlannerSettings, first: int, z0: FloatArray, kappa: FloatArray
) -> list[FloatArray]:
    """Return the states of the motion that ``kappa`` drives."""
    z = [z0]
    for i in range(settings.stages):
        z.append(next_state(vehicle, stations, settings, first + i, z[-1], float(kappa[i])))
    return z


def cost(vehicle: Vehicle, stations: Stations, settings: PlannerSettings, first: int, z0: FloatArray, kappa: FloatArray) -> float:
    """Return the objective of the motion that ``kappa`` drives, from geometry."""
    aux = [np.empty((0, 2)) for _ in vehicle.units]
    aux[-1] = np.array([[vehicle.lead.wheelbase if len(vehicle.units) == 1 else 0.0, 0.0]])
    total = settings.smoothness * float(np.sum(np.diff(kappa, prepend=0.0) ** 2))
    for at, z in enumerate(rolled_out(vehicle, stations, settings, first, z0, kappa)[1:], first + 1):
        s = float(stations.s[at])
        place = on_road(vehicle, stations.path, s, z, aux)[-1]
        _, offset = stations.path.project(place[:, 0], place[:, 1], np.array([s - axles_behind(vehicle)[-1] + aux[-1][0, 0]]))
        total += float((stations.centring.weight[at] * z[0] + offset[0]) ** 2)
    return total


def least_room(vehicle: Vehicle, stations: Stations, settings: PlannerSettings, first: int, z0: FloatArray, kappa: FloatArray) -> float:
    """Return the least gap beyond the margin, in all poses that a plan may look at, of the motion that ``kappa`` drives."""
    z, backs = rolled_out(vehicle, stations, settings, first, z0, kappa), settings.step * np.arange(BETWEEN) / BETWEEN
    stages = range(1, settings.stages + 1)
    states = [state_before(vehicle, stations, first + i, np.append(z[i], kappa[i - 1]), float(back)) for i in stages for back in backs]
    after = slice(first + 1, first + 1 + settings.stages)
    found = gaps(vehicle, stations, (stations.s[after, None] - backs).ravel(), np.stack(states)).reshape(settings.stages, -1)
    return float(np.min(found - stations.points["margin"][after, None]))


@pytest.mark.slow
@each_vehicle
def test_the_plan_is_the_optimum_of_the_nonlinear_program(vehicle: Vehicle) -> None:
    """Where limits do not bind; where they do, the exact programs of the benchmarks say so."""
    settings = PlannerSettings(scheme=Scheme.SQP, horizon=10.0, sqp_tolerance=1e-9)
    planner, _, stations = planned(vehicle, settings, 20.0)
    first, z0 = 40, start(vehicle, 0.3)
    plan = planner.plan(first, z0, 0.0)
    assert plan.violation < 1e-6

    def own(kappa: FloatArray) -> float:
        return cost(vehicle, stations, settings, first, z0, kappa)

    change = np.eye(settings.stages) - np.eye(settings.stages, k=-1)
    most = vehicle.max_curvature_rate * settings.step
    found = minimize(  # type: ignore[call-overload] # the stubs know no jac of plain callables
        own,
        np.zeros(settings.stages),
        jac=lambda kappa: differences(own, kappa)[0],
        method="SLSQP",
        bounds=[(-vehicle.max_curvature, vehicle.max_curvature)] * settings.stages,
        constraints=(LinearConstraint(change, -most, most),),
        tol=1e-15,
    )
    assert own(plan.kappa) <= found.fun + 1e-8
    # a flat optimum: costs agree to 1e-12 relative, so states agree to about its root
    assert np.max(np.abs(plan.kappa - found.x)) < 1e-6


def rolled(qp: StageQp, u: float) -> StageSolution:
    """Return a point that satisfies the program's dynamics and rows with every input equal to ``u`` within its bounds."""
    point = StageSolution.empty(qp.shape)
    point.x[0] = qp.x_first
    for i in range(qp.shape.stages):
        free = np.clip(point.x[i, -1] + u, qp.x_low[i, 0], qp.x_high[i, 0]) - point.x[i, -1]
        point.u[i] = np.clip(free, qp.u_low[i], qp.u_high[i])
        point.x[i + 1] = qp.A[i] @ point.x[i] + qp.B[i] @ point.u[i] + qp.c[i]
        if qp.shape.rows:
            point.sigma[i] = np.maximum(qp.G[i] @ point.x[i + 1] - qp.h[i], 0.0)
    return point


def test_a_step_that_leaves_the_models_domain_is_shortened() -> None:
    vehicle = Vehicle("nimble", (Unit(2.0, 0.5, 0.5, 1.5),), max_curvature=1.0, max_curvature_rate=1.0)
    settings = PlannerSettings(horizon=25.0)
    planner, spy, stations = planned(vehicle, settings, None)
    first, z0 = 40, np.array([0.1, 0.0])
    plan = planner.plan(first, z0, 0.0)
    asked: list[StageSolution] = []

    def reckless(qp: StageQp) -> StageSolution:
        asked.append(rolled(qp, 0.5))
        return asked[-1]

    spy.answer = reckless
    bold = planner.plan(first, z0, 0.0)
    step = asked[0].x
    assert np.max(np.abs(plan.z[:, 1] + step[:, 1])) > 0.5 * np.pi  # the whole step would turn the vehicle round
    assert bold.usable
    here = stations.curvature[first : first + settings.stages + 1]
    assert np.all(np.abs(bold.z[:, 1]) < 0.5 * np.pi)
    assert np.all(1.0 - bold.z[:, 0] * here > 0.0)
    part = np.linalg.norm(bold.z - plan.z) / np.linalg.norm(step[:, :2])
    assert 0.0 < part <= 0.5
    assert np.allclose(bold.z, plan.z + part * step[:, :2], rtol=0.0, atol=1e-12)
    assert np.allclose(bold.kappa, plan.kappa + part * step[1:, 2], rtol=0.0, atol=1e-12)


def wrong_point(qp: StageQp) -> StageSolution:
    point = StageSolution.empty(qp.shape)
    point.x[:] = 3.0
    return point


def test_a_first_plan_that_cannot_be_solved_is_an_error_with_the_solvers_word() -> None:
    planner, spy, _ = planned(VEHICLES[0], PlannerSettings(horizon=25.0))
    spy.answer = wrong_point
    with pytest.raises(SolverError) as caught:
        planner.plan(20, start(VEHICLES[0]), 0.0)
    assert caught.value.status == "solved"  # a claim that the residuals refuted
    spy.answer = None
    assert planner.plan(20, start(VEHICLES[0]), 0.0).usable


def test_a_later_failure_keeps_the_shifted_plan_and_says_so() -> None:
    vehicle = VEHICLES[1]
    planner, spy, _ = planned(vehicle, PlannerSettings(horizon=25.0))
    plan = planner.plan(20, start(vehicle), 0.0)
    spy.answer = wrong_point
    kept = planner.plan(30, plan.z[10], float(plan.kappa[9]))
    assert not kept.usable
    assert np.array_equal(kept.kappa[:-10], plan.kappa[10:])
    assert np.array_equal(kept.z[:-10], plan.z[10:])
    spy.answer = None
    assert planner.plan(40, kept.z[10], float(kept.kappa[9])).usable


def test_a_solver_that_returns_nan_is_not_driven() -> None:
    vehicle = VEHICLES[0]
    planner, spy, _ = planned(vehicle, PlannerSettings(horizon=25.0), None)
    plan = planner.plan(20, start(vehicle), 0.0)

    def nothing(qp: StageQp) -> StageSolution:
        point = StageSolution.empty(qp.shape)
        for name in PARTS:
            getattr(point, name)[:] = np.nan
        return point

    spy.answer = nothing
    kept = planner.plan(30, plan.z[10], float(plan.kappa[9]))
    assert not kept.usable
    assert np.all(np.isfinite(kept.kappa))


def test_after_an_error_the_next_plan_is_a_first_plan() -> None:
    vehicle, settings = VEHICLES[0], PlannerSettings(horizon=25.0)
    planner, spy, _ = planned(vehicle, settings)
    plan = planner.plan(30, start(vehicle), 0.0)

    def breaks(_: StageQp) -> StageSolution:
        msg = "gone"
        raise SolverError(msg)

    spy.answer = breaks
    with pytest.raises(SolverError, match="gone"):
        planner.plan(40, plan.z[10], float(plan.kappa[9]))
    spy.answer = None
    again = planner.plan(50, plan.z[20], float(plan.kappa[19]))
    fresh = planned(vehicle, settings)[0].plan(50, plan.z[20], float(plan.kappa[19]))
    assert again.qp_count == fresh.qp_count > 1
    assert np.max(np.abs(again.z - fresh.z)) < 1e-9  # feet found from another start


def test_a_bend_tighter_than_the_vehicle_is_planned_all_the_same() -> None:
    vehicle = VEHICLES[1]
    sharp = from_curvature(np.array([0.0, 40.0, 42.0, 52.0, 54.0, 90.0]), np.array([0.0, 0.0, 0.8, 0.8, 0.0, 0.0]))
    settings = PlannerSettings(horizon=25.0)
    stations = stations_of(Road("sharp", sharp).with_limits(3.0, 3.0), vehicle, CentringTable.of(vehicle), step=0.5, horizon=25.0)
    planner = Planner(vehicle, stations, geometric(stations, vehicle), settings, RiccatiWorkspace)
    plan = planner.plan(70, start(vehicle), 0.0)
    assert plan.usable
    assert plan.violation > 0.1


@pytest.mark.parametrize(("name", "limit"), [("bus", 1.9), ("bus", 2.1), ("tractor-trailer", 1.3)])
def test_where_limits_cannot_be_kept_steps_are_shortened_until_they_gain_nothing(
    name: str, limit: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicle, settings = load_vehicle(name), PlannerSettings(scheme=Scheme.SQP, horizon=25.0)
    planner, _, _ = planned(vehicle, settings, limit)
    plan, steps = planner.plan(50, start(vehicle), 0.0), list[int]()
    planner, _, _ = planned(vehicle, settings, limit)
    accept = planner_module._accept

    def watched(*arguments: int) -> int:
        stop = accept(*arguments)
        steps.append(int(planner._own["halvings"]) - sum(steps))
        return int(stop)

    monkeypatch.setattr(planner_module, "_accept", watched)
    again = planner.plan(50, start(vehicle), 0.0)
    assert np.array_equal(again.z, plan.z)
    assert max(steps) <= 5  # a step of 1/32 is taken whatever it does
    assert plan.halvings == sum(steps) > 0
    assert plan.qp_count == len(steps) <= 10
    assert plan.moved > settings.sqp_tolerance  # it would have gone on for long


def test_a_plan_that_breaks_a_limit_gets_as_many_programs_more_as_are_allowed() -> None:
    vehicle, counts = VEHICLES[1], []
    for repairs in (0, 2, 3):
        planner, _, _ = planned(vehicle, PlannerSettings(horizon=25.0, rti_repairs=repairs), 1.6)
        plan = planner.plan(50, start(vehicle), 0.0)
        plan = planner.plan(60, plan.z[10] + 0.05, float(plan.kappa[9]))
        assert plan.violation > 0.1
        counts.append(plan.qp_count)
    assert counts == [1, 3, 4]


def test_a_margin_keeps_that_much_further_from_the_limit() -> None:
    vehicle, plans = VEHICLES[0], list[Plan]()
    for margin in (0.0, 0.1):
        settings = PlannerSettings(scheme=Scheme.SQP, horizon=10.0, clearance=margin, sqp_tolerance=1e-8)
        planner, _, stations = planned(vehicle, settings, 2.25)
        plans.append(planner.plan(40, start(vehicle), 0.0))
        room = least_room(vehicle, stations, settings, 40, start(vehicle), plans[-1].kappa)
        assert abs(room - margin) < 1e-5  # it binds; the solver's tolerance on an active row
    assert plans[0].violation < 1e-5


@pytest.mark.parametrize(
    "wrong",
    [
        {"horizon": 0.0}, {"step": float("nan")}, {"replan": -1.0}, {"smoothness": 0.0}, {"clearance": -0.1},
        {"elastic_weight": float("inf")},
        {"horizon": 10.2}, {"replan": 5.3}, {"replan": 200.0}, {"horizon": 0.5, "replan": 0.5}, {"sqp_iterations": 0},
    ],
    ids=str,
)  # fmt: skip
def test_settings_out_of_range_or_in_contradiction_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(OptionError):
        PlannerSettings(**wrong)  # type: ignore[arg-type]


def test_settings_count_their_steps() -> None:
    settings = PlannerSettings(horizon=0.3, step=0.1, replan=0.2)  # decimals that are not whole in binary
    assert (settings.stages, settings.executed) == (3, 2)
