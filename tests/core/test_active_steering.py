"""Axles that the plan steers: kinematics against wheels rolling in the plane, their part of the program, and what they gain."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hdvplan.arrays import FloatArray
from hdvplan.centring.stationary import CentringTable, stationary
from hdvplan.driving.drive import Drive, drive, simulate
from hdvplan.judging.envelope import Envelope
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import Goal, Objective, body_max, geometric
from hdvplan.planning.settings import Discretisation, PlannerSettings
from hdvplan.planning.stations import Stations, stations_of
from hdvplan.planning.terms.steering import Steering
from hdvplan.planning.terms.term import Columns
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.solvers.registry import solver_named
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.chains import differences, few, linearised, rates, three_units
from tests.core.rules import gap
from tests.core.scenes import extended, horizon_at, move
from tests.core.test_steering import PROFILE_K, PROFILE_S, plane_rates

STEP = 0.5
SCALE = np.array([2.0, 0.5, 1.2, 1.2, 0.6, 0.6])


def active(rate: float = 0.1, most: float = 0.6) -> Vehicle:
    """Return three units: a lead axle under a law, and both axles behind it steered by the plan."""
    lead, *behind = three_units().units
    steered = [replace(unit, steering_ratio=0.5, max_steering_angle=most, max_steering_rate=rate) for unit in behind]
    return Vehicle("active", (replace(lead, steering_ratio=0.2, max_steering_angle=0.1), *steered))


def one_active() -> Vehicle:
    """Return three units whose dolly alone is steered by the plan, and whose last axle is under a law."""
    lead, dolly, last = active().units
    return Vehicle("one active", (lead, dolly, replace(last, max_steering_rate=0.0)))


CHAINS = [load_vehicle("semitrailer-active"), active()]
each_chain = pytest.mark.parametrize("vehicle", [*CHAINS, one_active()], ids=lambda v: v.name)
boxes = st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6)


def scaled(vehicle: Vehicle, draw: FloatArray | list[float]) -> FloatArray:
    places = [*range(vehicle.rigid_states), *range(4, 4 + len(vehicle.active))]
    return np.asarray((SCALE * draw)[places], float)


@each_chain
@given(draw=boxes, kappa=st.floats(-0.02, 0.02), k=st.floats(-0.2, 0.2))  # within the stops of the lead axle's law
@few
def test_the_jacobian_is_the_derivative_by_wheel_angles_too(vehicle: Vehicle, draw: list[float], kappa: float, k: float) -> None:
    z = scaled(vehicle, draw)
    if vehicle.name == "one active":
        z[3] *= 0.9 * 0.6 / 0.5 / SCALE[3]  # within the stops of the last axle's law
    f, a, b = linearised(vehicle, k, z, kappa)
    assert np.allclose(f, rates(vehicle, k, z, kappa), rtol=0.0, atol=1e-13)
    # fifth derivatives of tan reach a few thousand at 1.2 rad of heading and wheels: 1e-12 / 30 times that
    assert np.allclose(a, differences(lambda v: rates(vehicle, k, v, kappa), z), rtol=0.0, atol=1e-8)
    by_kappa = differences(lambda v: rates(vehicle, k, z, float(v[0])), np.array([kappa]), step=1e-4)[:, 0]
    assert np.allclose(b, by_kappa, rtol=0.0, atol=1e-8)


def test_an_active_axle_at_its_laws_angle_moves_as_under_the_law() -> None:
    steered, law = load_vehicle("semitrailer-active"), load_vehicle("semitrailer-steered")
    z = np.array([0.3, 0.1, 0.4, -0.5 * 0.4])  # the law's ratio is 0.5
    assert np.allclose(rates(steered, 0.03, z, 0.05)[:3], rates(law, 0.03, z[:3], 0.05), rtol=0.0, atol=1e-15)


@each_chain
def test_the_simulation_agrees_with_turning_wheels_rolling_in_the_plane(vehicle: Vehicle) -> None:
    count, rigid = 60, vehicle.rigid_states
    kappa = 0.02 * np.sin(0.11 * np.arange(count)) + 0.005 * (-1.0) ** np.arange(count)  # held over each step, and jumping
    wheels = 0.3 * np.sin(0.2 * np.arange(count + 1)[:, None] + np.arange(len(vehicle.active)))  # turning evenly over each step
    z = np.concatenate([[0.4, -0.1, 0.2, -0.1][:rigid], wheels[0]])

    def motion(s: float, y: FloatArray, i: int) -> FloatArray:
        k, tangent = float(np.interp(s, PROFILE_S, PROFILE_K)), np.array([np.cos(y[2]), np.sin(y[2])])
        offset, part = float((y[3:5] - y[:2]) @ [-tangent[1], tangent[0]]), s / STEP - i
        beta = y[5:-1] - y[6:]
        turns = np.append(np.arctan(vehicle.lead.wheelbase * kappa[i]), beta)
        off = np.array(
            [-np.clip(u.steering_ratio * t, -u.max_steering_angle, u.max_steering_angle) for u, t in zip(vehicle.units, turns, strict=True)]
        )
        off[list(vehicle.active)] = (1.0 - part) * wheels[i] + part * wheels[i + 1]
        own = plane_rates(vehicle, y[3:], np.array([*tangent, 1.0 - k * offset]), float(kappa[i]), off)
        return np.concatenate([tangent, np.array([k]), own])

    headings = z[1] - np.concatenate([[0.0], np.cumsum(z[2:rigid])])
    y, expected = np.concatenate([[0.0, 0.0, 0.0, 0.0, z[0]], headings]), [z[:rigid]]
    for i in range(count):
        y = solve_ivp(motion, (i * STEP, (i + 1) * STEP), y, "DOP853", args=(i,), rtol=1e-9, atol=1e-10).y[:, -1]
        e_y = float((y[3:5] - y[:2]) @ [-np.sin(y[2]), np.cos(y[2])])
        expected.append(np.array([e_y, y[5] - y[2], *(y[5:-1] - y[6:])]))
    found = simulate(vehicle.table(), from_curvature(PROFILE_S, PROFILE_K), 0.0, STEP, z, kappa, 1, wheels)
    assert np.array_equal(found[:, rigid:], wheels)  # driven exactly
    # the road's curvature between its knots is good to 1e-7; a wheel that meets its stop inside one of our steps costs some 1e-6
    assert np.max(np.abs(found[:, :rigid] - np.array(expected))) < 1e-5


@pytest.mark.parametrize("rule", list(Discretisation))
@each_chain
def test_linearised_dynamics_are_newtons_step_by_state_curvature_and_change_of_angle(vehicle: Vehicle, rule: Discretisation) -> None:
    """By the derivatives of the gap to the rule: 0 = gap + by_z dz + by_change d change + by_kappa d kappa + by_ahead dz_next."""
    stages, n, rigid, random = 9, vehicle.states, vehicle.rigid_states, np.random.default_rng(3)
    z = 0.3 * np.array([scaled(vehicle, random.uniform(-1.0, 1.0, 6)) for _ in range(stages + 1)])
    kappa, bends = random.uniform(-0.02, 0.02, stages), random.uniform(-0.05, 0.05, (2, stages + 1))
    settings = PlannerSettings(horizon=STEP * stages, replan=STEP, discretisation=rule)
    scene, parts = assemble(vehicle, straight_stations(vehicle, settings), Goal(()), settings)
    qp, horizon = scene.qp, horizon_at(scene, 0)
    horizon.road["curvature"], horizon.road["curvature_between"] = bends
    move(scene, z, kappa)
    extended(parts, horizon)
    for i in range(stages):

        def left(v: FloatArray, i: int = i) -> FloatArray:
            """Return the gap, written out; ``v`` holds the state, every wheel's change until the next, the curvature, the next state."""
            change, held, ahead = np.concatenate([np.zeros(rigid), v[n : 2 * n - rigid]]), float(v[-n - 1]), v[-n:].copy()
            if rule is Discretisation.GAUSS:
                ahead[rigid:] = v[rigid:n] + change[rigid:]  # wheels follow their inputs

            def here(state: FloatArray) -> FloatArray:
                return rates(vehicle, bends[0, i], state, held)

            def between(state: FloatArray) -> FloatArray:
                return rates(vehicle, bends[1, i], state, held)

            return gap(rule, here, between, STEP, v[:n], change, ahead)

        at = np.concatenate([z[i], z[i + 1, rigid:] - z[i, rigid:], [kappa[i]], z[i + 1]])
        slope = differences(left, at)[:rigid]
        by_ahead, own = slope[:, -n:][:, :rigid], np.column_stack([slope[:, :-n], left(at)[:rigid]])
        solved = np.linalg.solve(-by_ahead, own)
        assert np.allclose(qp.A[i, :rigid, :n], solved[:, :n], rtol=0.0, atol=1e-10)  # five-point rule on smooth functions of size one
        assert np.allclose(qp.A[i, :rigid, n], solved[:, -2], rtol=0.0, atol=1e-9)  # fifth derivatives of atan(5 m kappa) reach 1e4
        assert np.allclose(qp.B[i, :rigid, 0], solved[:, -2], rtol=0.0, atol=1e-9)
        assert np.allclose(qp.B[i, :rigid, 1:], solved[:, n:-2], rtol=0.0, atol=1e-10)
        assert np.allclose(qp.c[i, :rigid], solved[:, -1], rtol=0.0, atol=1e-10)
        if rule is not Discretisation.GAUSS:
            assert np.allclose(qp.c[i, :rigid], left(at)[:rigid], rtol=0.0, atol=1e-14)  # nothing to solve: rounding alone
        wheels = np.eye(n + 1)[rigid:n]
        assert np.array_equal(qp.A[i, rigid:n], wheels)  # they stay where they are, but for their inputs
        assert np.array_equal(qp.B[i, rigid:n], np.eye(n - rigid, n - rigid + 1, 1))
        assert np.all(qp.c[i, rigid:n] == 0.0)
        pattern = qp.shape.a_pattern
        assert pattern is not None
        assert not np.any(qp.A[i][~pattern])  # general solvers see no other entries


def straight_stations(vehicle: Vehicle, settings: PlannerSettings) -> Stations:
    road = Road("straight", from_curvature(np.array([0.0, 60.0]), np.zeros(2)))
    return stations_of(road, vehicle, CentringTable.of(vehicle), step=settings.step, horizon=settings.horizon)


def test_the_wheels_part_of_the_program_is_its_cost_and_its_bounds() -> None:
    lead, dolly, last = active().units
    vehicle = Vehicle("unlike", (lead, dolly, replace(last, max_steering_angle=0.4, max_steering_rate=0.08)))
    settings = PlannerSettings(horizon=10.0)
    stages, n, rigid, random, first = settings.stages, vehicle.states, vehicle.rigid_states, np.random.default_rng(5), 7
    most, largest = np.array([0.6, 0.4]), np.array([0.05, 0.04])
    scene, _ = assemble(vehicle, straight_stations(vehicle, settings), Goal(()), settings)
    part, horizon, qp, z = Steering().part(scene, Columns(0, 0, 0)), horizon_at(scene, first), scene.qp, np.empty((stages + 1, n))
    part.kept[0][:] = random.uniform(-0.3, 0.3, part.kept[0].shape)
    z[:] = random.uniform(-0.2, 0.2, z.shape)
    move(scene, z)
    extended([part], horizon)
    d = np.zeros_like(z)
    d[1:, rigid:] = random.uniform(-0.1, 0.1, (stages, 2))
    u = np.diff(d[:, rigid:], axis=0)
    model = np.sum(qp.q[:, :n] * d) + 0.5 * np.einsum("ij,ijk,ik", d, qp.Q[:, :n, :n], d)
    model += np.sum(qp.r[:, 1:] * u) + 0.5 * np.einsum("ij,ijk,ik", u, qp.R[:, 1:, 1:], u)
    before = part.price(horizon)
    move(scene, z + d)
    assert model == pytest.approx(part.price(horizon) - before, rel=1e-12)  # a quadratic is its own model
    for bound, sign in ((qp.x_low, -1.0), (qp.x_high, 1.0)):
        assert np.allclose(z[1:, rigid:] + bound[:, 1:], sign * most, rtol=0.0, atol=1e-15)
    for bound, sign in ((qp.u_low, -1.0), (qp.u_high, 1.0)):
        assert np.allclose(np.diff(z[:, rigid:], axis=0) + bound[:, 1:], sign * largest, rtol=0.0, atol=1e-15)


def test_wheels_are_wanted_at_the_angles_of_the_road_beside_their_axles() -> None:
    vehicle, settings = active(), PlannerSettings(horizon=10.0)
    road = Road("bend", from_curvature(np.array([0.0, 30.0, 40.0, 80.0]), np.array([0.0, 0.0, 0.03, 0.03])))
    stations = stations_of(road, vehicle, CentringTable.of(vehicle), step=STEP, horizon=settings.horizon)
    scene, _ = assemble(vehicle, stations, Goal(()), settings)
    aim, wanted = Steering().part(scene, Columns(0, 0, 0)).kept[0], stations.centring.steering
    for axle, behind in enumerate((6.2, 14.1)):  # the chain's own lengths
        at = np.arange(40, 140)
        assert np.allclose(aim[at, axle], np.interp(stations.s[at] - behind, stations.s, wanted[:, axle]), rtol=0.0, atol=1e-12)
    assert np.max(np.abs(aim)) > 0.05


@cache
def driven(
    name: str, scenario: str = "uturn", half_width: float = 0.0, solver: str = "riccati", objective: Objective = geometric,
    rate: float = 0.1, most: float = 0.35, ratio: float = 0.6,
) -> Drive:  # fmt: skip
    vehicle, road = load_vehicle(name), replace(SCENARIOS[scenario](), limits=None)
    if name != "tractor-semitrailer":
        trailer = replace(vehicle.units[1], steering_ratio=ratio, max_steering_angle=most)
        trailer = replace(trailer, max_steering_rate=rate) if trailer.active else trailer
        vehicle = replace(vehicle, units=(vehicle.units[0], trailer))
    road = road.with_limits(half_width, half_width) if half_width else road
    return drive(road, vehicle, objective, solver_named(solver), PlannerSettings())


def furthest(run: Drive) -> float:
    envelope = Envelope(run)
    return float(max(np.max(envelope.reach_left), -np.min(envelope.reach_right)))


def test_what_is_driven_is_the_planned_steering() -> None:
    run = driven("semitrailer-active")
    for plan in run.plans:
        last = min(plan.first + run.settings.executed, len(run.kappa))
        assert np.array_equal(run.steering[plan.first : last + 1], plan.z[: last - plan.first + 1, 3:])
    assert np.max(np.abs(run.steering)) > 0.1
    assert np.max(np.abs(run.steering[:20])) < 0.01  # a straight leaves the wheels straight


@pytest.mark.parametrize("half_width", [0.0, 2.2])
def test_wheels_keep_their_largest_angle_and_rate(half_width: float) -> None:
    run = driven("semitrailer-active", "roundabout", half_width, rate=0.02, most=0.13)
    assert np.max(np.abs(run.steering)) <= 0.13 + 1e-6  # a solver may leave 1e-7 of a bound
    assert np.max(np.abs(np.diff(run.steering, axis=0))) <= 0.02 * STEP + 1e-6
    assert np.max(np.abs(run.steering)) > 0.13 - 1e-4  # both bind
    assert np.max(np.abs(np.diff(run.steering, axis=0))) > 0.02 * STEP - 1e-4


@pytest.mark.parametrize("scenario", ["uturn", "roundabout"])
def test_active_steering_reaches_less_far_than_a_law_and_much_less_than_a_rigid_axle(scenario: str) -> None:
    rigid, law, own = (driven(name, scenario) for name in ("tractor-semitrailer", "semitrailer-steered", "semitrailer-active"))
    assert furthest(own) < furthest(rigid) - 0.4
    assert furthest(own) < furthest(law) + 0.01  # where the circle decides; where the tail swings out it is better
    balance = [float(np.mean(np.abs(Envelope(run).reach_left + Envelope(run).reach_right))) for run in (law, own)]
    assert balance[1] < 0.7 * balance[0]


def test_active_steering_keeps_limits_that_a_law_cannot() -> None:
    law, own = (driven(name, "roundabout", 1.95) for name in ("semitrailer-steered", "semitrailer-active"))
    assert furthest(law) > 1.95 + 0.01
    assert furthest(own) <= 1.95
    assert furthest(own) < stationary(own.vehicle, np.array([1.0 / 17.88])).half_width[0] - 0.01  # more than its aim, on purpose


def test_the_largest_reach_as_objective_steers_too() -> None:
    own = driven("semitrailer-active", objective=body_max)
    assert all(plan.usable for plan in own.plans)
    assert furthest(own) < furthest(driven("semitrailer-active")) - 0.01
