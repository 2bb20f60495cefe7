"""Balancing the measured envelope: what it measures, its derivative, its optimum, and what it gains as driven."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from hdvplan.arrays import FloatArray
from hdvplan.bench.measuring.courses import with_limits
from hdvplan.bench.suite import Suite
from hdvplan.case import Case
from hdvplan.centring.stationary import CentringTable
from hdvplan.judging.result import Result
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import Goal, Objective, balanced, geometric
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.planning.stations import Stations, stations_of
from hdvplan.planning.terms.balance import BalancePart, EnvelopeBalance, tracing_points
from hdvplan.planning.terms.term import Part, Scene
from hdvplan.reproduce.study import predicted, unevenness, whole_manoeuvre
from hdvplan.reproduce.study import swept as swept_by
from hdvplan.road.road import Road
from hdvplan.road.scenarios import Scenario, sturn_profile, turn_profile
from hdvplan.vehicle.kinematics import axles_behind
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.scenes import extended, horizon_at, move, part_of

VEHICLES = [load_vehicle("bus"), load_vehicle("tractor-trailer")]
each_vehicle = pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda v: v.name)
ROAD = Scenario("sturn", sturn_profile(0.05, 0.01))()
RTI = PlannerSettings()


def swept(road: Road, vehicle: Vehicle, objective: Objective, settings: PlannerSettings) -> Result:
    return swept_by(Case(road, vehicle, "mine", settings=settings), objective)


def with_fields(rounds: int = 10, **changes: float) -> Objective:
    def objective(stations: Stations, vehicle: Vehicle) -> Goal:
        (term,) = balanced(stations, vehicle).terms
        assert isinstance(term, EnvelopeBalance)
        return Goal((replace(term, **changes),), rounds)  # type: ignore[arg-type] # names of fields that are numbers

    return objective


@cache
def on_s_turn(name: str, *, even: bool, scheme: Scheme = Scheme.RTI) -> Result:
    return swept(ROAD, load_vehicle(name), balanced if even else geometric, PlannerSettings(scheme=scheme))


def mean_imbalance(found: Result) -> float:
    return float(np.mean(np.abs(unevenness(found))))


@dataclass(frozen=True)
class Memory:
    """A program that balances all of a road, and the plan that was made of it."""

    scene: Scene
    parts: tuple[Part, ...]

    @property
    def balance(self) -> BalancePart:
        """Return the term."""
        return part_of(self.parts, BalancePart)

    @property
    def reach(self) -> FloatArray:
        """Return the measured reach to the left and to the right at every place, outwards."""
        reach: FloatArray = self.balance.measured.reached["reach"]
        return reach

    @property
    def places(self) -> int:
        """Return the last place that is balanced."""
        return self.balance.window.places

    @property
    def stages(self) -> int:
        """Return the last stage whose cost is the balance."""
        return self.balance.window.stages


def whole(vehicle: Vehicle) -> tuple[Result, Memory, FloatArray]:
    """Return the geometric plan of the whole S-turn, a memory that balances all of it, and the plan's states."""
    settings = whole_manoeuvre(ROAD, 0.5)
    found = swept(ROAD, vehicle, geometric, settings)
    stations = stations_of(ROAD, vehicle, CentringTable.of(vehicle), step=settings.step, horizon=settings.horizon)
    goal = with_fields(ahead=np.inf, share=0.0, relaxation=1.0)(stations, vehicle)
    scene, parts = assemble(vehicle, stations, goal, settings)
    return found, Memory(scene, parts), found.drive.plans[0].z.copy()


def measure(memory: Memory, z: FloatArray, *, fixed: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the measured imbalance of a first plan, NaN where a side was not swept, and the program's Q and q."""
    scene, horizon = memory.scene, horizon_at(memory.scene, 0, fixed=fixed)
    move(scene, z)
    extended(memory.parts, horizon)
    left, right = np.where(np.isfinite(memory.reach), memory.reach, np.nan)
    return left - right, scene.qp.Q.copy(), scene.qp.q.copy()


def penalty(imbalance: FloatArray, rounding: float) -> float:
    return float(np.nansum(2.0 * rounding**2 * (np.sqrt(1.0 + (imbalance / rounding) ** 2) - 1.0)))


def smooth_change(z: FloatArray, size: float) -> FloatArray:
    """Return a change of every state that varies slowly along the road, as plans do."""
    s = 0.5 * np.arange(len(z))
    waves = [np.sin(0.05 * (1 + j) * s + j) for j in range(z.shape[1])]
    return size * np.stack([waves[0], 0.05 * waves[1], *(0.05 * wave for wave in waves[2:])], axis=1)


@each_vehicle
def test_the_points_that_trace_are_each_bodys_corners_and_its_edges_beside_the_axle(vehicle: Vehicle) -> None:
    behind = axles_behind(vehicle)
    for points, unit, axle in zip(tracing_points(vehicle, behind, 0.5), vehicle.units, behind, strict=True):
        assert sorted(set(points["ahead"])) == sorted({-unit.rear_overhang, 0.0, unit.front})
        assert set(np.abs(points["left"])) == {0.5 * unit.width}
        assert np.all(np.abs(0.5 * points["start"] - (points["ahead"] - axle)) <= 0.25)  # the nearest station
        assert np.all(points["left"][::2] > 0.0)  # the core tells the sides by the point's number


@each_vehicle
def test_the_planner_measures_what_the_evaluation_measures(vehicle: Vehicle) -> None:
    found, memory, z = whole(vehicle)
    measure(memory, z)
    envelope = predicted(found).envelope
    at = np.arange(30, memory.places)  # places that the body covers at the start are not traced by its points
    for mine, theirs in ((memory.reach[0], envelope.reach_left), (-memory.reach[1], envelope.reach_right)):
        # tracks 0.5 m apart are straight between stages: 0.5^2 / 8 times a relative curvature below 0.15 1/m
        assert np.max(np.abs(mine[at] - np.interp(0.5 * at, envelope.s, theirs))) < 0.005


@each_vehicle
def test_the_gradient_is_that_of_the_measured_imbalance(vehicle: Vehicle) -> None:
    _, memory, z = whole(vehicle)
    rounding = float(memory.balance.data["rounding"][0])
    window, part, horizon = slice(0, memory.places), memory.balance, horizon_at(memory.scene, 0)
    imbalance, _, q = measure(memory, z)
    price = part.price(horizon) - part.beside.price(horizon)
    assert price == pytest.approx(penalty(imbalance[window], rounding), rel=1e-9)  # sums in another order
    change = smooth_change(z, 1.0)
    # no row of their own: the first stage, which is given, and places whose other side lies beyond the last stage
    change[0] = change[memory.stages - 40 :] = 0.0
    expected = float(np.sum(q[:, : z.shape[1]] * change))
    size = 1e-4
    found = [penalty(measure(memory, z + sign * size * change)[0][window], rounding) for sign in (1.0, -1.0)]
    # each place's reach belongs to the stage nearest to it instead of to the two around it: up to a quarter of a metre of a wave of 60 m
    assert (found[0] - found[1]) / (2.0 * size) == pytest.approx(expected, rel=0.05)


@each_vehicle
def test_the_program_never_underrates_what_a_step_costs(vehicle: Vehicle) -> None:
    _, memory, z = whole(vehicle)
    before, Q, q = measure(memory, z)
    window = slice(0, memory.places)
    rounding, n = float(memory.balance.data["rounding"][0]), z.shape[1]
    level = penalty(before[window], rounding)
    for size in (0.05, 0.2, 0.5):
        change = smooth_change(z, size)
        change[0] = change[memory.stages - 40 :] = 0.0
        modelled = float(np.sum(q[:, :n] * change) + 0.5 * np.einsum("ij,ijk,ik", change, Q[:, :n, :n], change))
        actual = penalty(measure(memory, z + change)[0][window], rounding) - level
        assert actual <= modelled + 0.02 * (abs(modelled) + level)  # points take places over, which linear tracks do not know


@each_vehicle
def test_a_circle_is_swept_as_the_stationary_geometry_says(vehicle: Vehicle) -> None:
    road = Scenario("circle", turn_profile(0.04, 10.0, 150.0, lead_in=20.0, lead_out=20.0))()
    found = swept(road, vehicle, balanced, RTI)
    expected = CentringTable.of(vehicle).at(np.array([0.04]))
    middle = (found.envelope.s > 100.0) & (found.envelope.s < 130.0)
    # tracks 0.5 m apart cut the corner's circle by 1.3 mm, and the plan balances what it measures
    assert np.max(np.abs(found.envelope.reach_left[middle] - expected.half_width[0])) < 0.005
    assert np.max(np.abs(-found.envelope.reach_right[middle] - expected.half_width[0])) < 0.005
    stations = found.drive.stations.s[:-1][: len(found.drive.kappa)]
    kappa = found.drive.kappa[(stations > 100.0) & (stations < 130.0)]
    assert np.max(np.abs(kappa - expected.kappa[0])) < 2e-4


@pytest.mark.parametrize(("name", "gain"), [("bus", 0.2), ("tractor-trailer", 0.75)])
@pytest.mark.parametrize("scheme", list(Scheme))
def test_an_s_turn_is_swept_far_more_evenly_at_hardly_more_reach(name: str, gain: float, scheme: Scheme) -> None:
    base, even = on_s_turn(name, even=False, scheme=scheme), on_s_turn(name, even=True, scheme=scheme)
    assert mean_imbalance(even) < (1.0 - gain) * mean_imbalance(base)
    assert even.balance.half_width < 1.05 * base.balance.half_width


def test_real_time_iterations_solve_one_program_a_step() -> None:
    plans = on_s_turn("tractor-trailer", even=True).drive.plans
    assert {plan.qp_count for plan in plans[1:]} == {1}
    assert plans[0].qp_count <= 10


def test_more_programs_leave_less_imbalance_and_then_stand_still() -> None:
    vehicle = VEHICLES[1]
    settings = replace(whole_manoeuvre(ROAD, 0.5), horizon=whole_manoeuvre(ROAD, 0.5).horizon + 50.0)
    left = [mean_imbalance(swept(ROAD, vehicle, with_fields(ahead=np.inf, rounds=rounds), settings)) for rounds in (2, 4, 10, 20)]
    assert left[0] > left[1] > left[2]
    assert left[3] == pytest.approx(left[2], rel=0.05)  # after ten programs nothing but points taking places from each other moves
    assert left[3] < 0.15 * mean_imbalance(swept(ROAD, vehicle, geometric, settings))


def test_a_horizon_shorter_than_the_vehicle_leaves_the_stationary_residual() -> None:
    settings = PlannerSettings(horizon=15.0)
    base, even = (swept(ROAD, VEHICLES[1], objective, settings) for objective in (geometric, balanced))
    assert np.array_equal(base.drive.kappa, even.drive.kappa)


def test_limits_hold_beside_the_balance() -> None:
    vehicle = VEHICLES[1]
    free = swept(ROAD, vehicle, balanced, RTI).balance.half_width
    road = with_limits(ROAD, vehicle, Suite(half_width=free - 0.03))
    assert swept(road, vehicle, balanced, RTI).balance.half_width < free - 0.02  # kept to 1 cm, as everywhere
