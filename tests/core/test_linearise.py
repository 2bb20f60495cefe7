from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.centring.weights import CentringTable
from hdvplan.jit import FloatArray
from hdvplan.planning.linearise import advance, linearise_dynamics, linearise_objective, write_inputs
from hdvplan.planning.stations import Stations, stations_of
from hdvplan.road.road import Road
from hdvplan.vehicle.kinematics import derivative
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.chains import few, on_road, three_units, vehicles, winding
from tests.core.differences import differences

STEP = 0.5
STAGES = 40
FIRST = 40  # the first station of the linearised horizon: s = 20 m, where the road begins to bend
VEHICLES = [load_vehicle("bus"), load_vehicle("tractor-trailer"), three_units()]
each_vehicle = pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda v: v.name)
each_rule = pytest.mark.parametrize("midpoint", [True, False], ids=["midpoint", "euler"])


def prepared(vehicle: Vehicle) -> Stations:
    return stations_of(Road("winding", winding()), vehicle, CentringTable.of(vehicle), step=STEP, horizon=20.0)


def motion(vehicle: Vehicle, seed: int = 0) -> tuple[FloatArray, FloatArray]:
    """Return states and curvatures that satisfy nothing at all."""
    random = np.random.default_rng(seed)
    scale = np.array([1.0, 0.3, 0.6, 0.6])[: vehicle.states]
    return scale * random.uniform(-1.0, 1.0, (STAGES + 1, vehicle.states)), random.uniform(-0.1, 0.1, STAGES)


def horizon(stations: Stations) -> FloatArray:
    return stations.road[:, FIRST : FIRST + STAGES + 1]


def next_state(vehicle: Vehicle, k: float, k_between: float, z: FloatArray, kappa: float, *, midpoint: bool) -> FloatArray:
    out = np.empty(z.size)
    advance(vehicle.table(), k, k_between, STEP, midpoint, z, kappa, out, np.empty((2, z.size)))
    return out


def dynamics(
    vehicle: Vehicle, stations: Stations, z: FloatArray, kappa: FloatArray, *, midpoint: bool, parts: list[int]
) -> list[FloatArray]:
    n = vehicle.states
    A, B, c = np.zeros((STAGES, n + 1, n + 1)), np.zeros((STAGES, n + 1, 1)), np.zeros((STAGES, n + 1))
    A[:, n, n] = B[:, n, 0] = 1.0
    for begin in parts[-2::-1]:
        between = stations.curvature_between[FIRST : FIRST + STAGES + 1]
        linearise_dynamics(vehicle.table(), horizon(stations), between, STEP, midpoint, z, kappa, begin, A, B, c)
    return [A, B, c]


def objective(vehicle: Vehicle, stations: Stations, z: FloatArray, weights: FloatArray, parts: list[int]) -> list[FloatArray]:
    n, path, (lead, aux, target) = vehicle.states, stations.path, weights
    Q, q = np.zeros((STAGES + 1, n + 1, n + 1)), np.zeros((STAGES + 1, n + 1))
    feet = stations.s[FIRST : FIRST + STAGES + 1].copy()
    for begin, end in pairwise(parts):
        lost = linearise_objective(
            vehicle.table(), -1, path.coefficients, path.s_first, path.spacing, horizon(stations), z, lead, aux, target, feet,
            begin, end, Q, q,
        )  # fmt: skip
        assert lost == -1
    return [Q, q, feet]


@given(vehicle=vehicles(), k=st.floats(-0.1, 0.1), bend=st.floats(-0.01, 0.01), kappa=st.floats(-0.1, 0.1), draw=st.integers(0, 10**6))
@few
def test_advance_is_the_midpoint_rule_written_out(vehicle: Vehicle, k: float, bend: float, kappa: float, draw: int) -> None:
    z = np.random.default_rng(draw).uniform(-0.5, 0.5, vehicle.states)
    first, second = np.empty(z.size), np.empty(z.size)
    derivative(vehicle.table(), k, z, kappa, first)
    derivative(vehicle.table(), k + bend, z + 0.25 * first, kappa, second)
    assert np.allclose(next_state(vehicle, k, k + bend, z, kappa, midpoint=True), z + 0.5 * second, rtol=0.0, atol=1e-14)
    assert np.allclose(next_state(vehicle, k, k + bend, z, kappa, midpoint=False), z + 0.5 * first, rtol=0.0, atol=1e-14)


@each_rule
@each_vehicle
def test_linearised_dynamics_are_the_derivatives_of_advance(vehicle: Vehicle, midpoint: bool) -> None:
    stations, (z, kappa), n = prepared(vehicle), motion(vehicle), vehicle.states
    A, B, c = dynamics(vehicle, stations, z, kappa, midpoint=midpoint, parts=[0, STAGES])
    for i in (0, 7, 19, STAGES - 1):
        k, between = float(stations.road[4, FIRST + i]), float(stations.curvature_between[FIRST + i])

        def ahead(v: FloatArray, k: float = k, between: float = between) -> FloatArray:
            return next_state(vehicle, k, between, v[:n], float(v[n]), midpoint=midpoint)

        slope = differences(ahead, np.append(z[i], kappa[i]))
        assert np.allclose(A[i, :n], slope, rtol=0.0, atol=1e-10)  # five-point rule on smooth functions of size one
        assert np.allclose(B[i, :n, 0], slope[:, n], rtol=0.0, atol=1e-10)
        assert np.array_equal(A[i, n], np.eye(n + 1)[n])
        assert np.allclose(c[i, :n], ahead(np.append(z[i], kappa[i])) - z[i + 1], rtol=0.0, atol=1e-14)


def test_the_midpoint_uses_the_roads_curvature_half_way() -> None:
    stations = prepared(VEHICLES[0])
    half_way = winding().at(stations.s[:150] + 0.25).curvature
    assert np.max(np.abs(stations.curvature_between[:150] - half_way)) < 1e-12  # same coefficients, other offsets


@each_vehicle
def test_the_objective_is_the_square_of_the_projected_offset_to_first_order(vehicle: Vehicle) -> None:
    stations, (z, _), n = prepared(vehicle), motion(vehicle), vehicle.states
    weights = np.random.default_rng(3).uniform(-2.0, 2.0, (3, STAGES + 1))
    Q, q, feet = objective(vehicle, stations, z, weights, [0, STAGES + 1])
    aux_point = [np.zeros((1, 2)) for _ in vehicle.units]
    if len(vehicle.units) == 1:
        aux_point = [np.array([[vehicle.lead.wheelbase, 0.0]])]  # a bus's front axle
    for i in (0, 11, 26, STAGES):
        s = float(stations.s[FIRST + i])

        def foot_and_offset(v: FloatArray, s: float = s) -> FloatArray:
            x, y = on_road(vehicle, stations.path, s, v, aux_point)[-1][0]
            return np.array(stations.path.project(x, y, s))

        lead, aux, target = weights[:, i]
        gradient = aux * differences(foot_and_offset, z[i])[1] + lead * np.eye(n)[0]
        residual = lead * z[i, 0] + aux * foot_and_offset(z[i])[1] - target
        assert abs(feet[i] - foot_and_offset(z[i])[0]) < 1e-9
        # offsets are exact to 1e-12 m by up to 20 m of lever arm, over a step of 1e-3
        assert np.allclose(q[i, :n], 2.0 * residual * gradient, rtol=0.0, atol=1e-7)
        assert np.allclose(Q[i, :n, :n], 2.0 * np.outer(gradient, gradient), rtol=0.0, atol=1e-7)
        assert np.all(Q[i, n] == 0.0)
        assert np.all(Q[i, :, n] == 0.0)
        assert q[i, n] == 0.0


@each_vehicle
def test_a_range_of_stages_gives_what_the_whole_horizon_gives(vehicle: Vehicle) -> None:
    stations, (z, kappa) = prepared(vehicle), motion(vehicle)
    weights = np.random.default_rng(3).uniform(-2.0, 2.0, (3, STAGES + 1))
    for whole, split in (
        (
            dynamics(vehicle, stations, z, kappa, midpoint=True, parts=[0, STAGES]),
            dynamics(vehicle, stations, z, kappa, midpoint=True, parts=[0, 1, 17, STAGES]),
        ),
        (objective(vehicle, stations, z, weights, [1, STAGES + 1]), objective(vehicle, stations, z, weights, [1, 2, 30, STAGES + 1])),
    ):
        for one, other in zip(whole, split, strict=True):
            assert np.array_equal(one, other)


def test_a_stage_whose_body_lies_beyond_the_centre_of_curvature_is_named() -> None:
    vehicle = VEHICLES[0]
    stations, (z, _) = prepared(vehicle), motion(vehicle)
    z[35] = 1.0 / 0.06 - 5.7, 0.5 * np.pi  # the front axle 0.3 m beyond the centre of the arc
    path, feet = stations.path, stations.s[FIRST : FIRST + STAGES + 1].copy()
    one = np.ones(STAGES + 1)
    lost = linearise_objective(
        vehicle.table(), -1, path.coefficients, path.s_first, path.spacing, horizon(stations), z, one, one, one, feet,
        1, STAGES + 1, np.zeros((STAGES + 1, 3, 3)), np.zeros((STAGES + 1, 3)),
    )  # fmt: skip
    assert lost == 35


@given(seed=st.integers(0, 10**6))
@few
def test_inputs_bound_and_weigh_the_curvature_and_its_change(seed: int) -> None:
    random = np.random.default_rng(seed)
    kappa, before, weight, most, change = random.uniform(-0.1, 0.1, 8), float(random.uniform(-0.1, 0.1)), 700.0, 0.1, 0.05
    R, r, x_low, x_high, u_low, u_high = (np.full(shape, np.nan) for shape in ((8, 1, 1), (8, 1), (8, 1), (8, 1), (8, 1), (8, 1)))
    write_inputs(kappa, before, most, change, weight, R, r, x_low, x_high, u_low, u_high)
    u = random.uniform(-0.05, 0.05, 8)  # moves of the changes; those of kappa are their sums
    moved = kappa + np.cumsum(u)

    def cost(values: FloatArray) -> float:
        return weight * float(np.sum(np.diff(np.concatenate([[before], values])) ** 2))

    quadratic = float(0.5 * np.sum(R[:, 0, 0] * u**2) + r[:, 0] @ u)
    assert abs(quadratic - (cost(moved) - cost(kappa))) < 1e-11  # rounding at cost 100
    assert np.allclose(x_low[:, 0] + kappa, -most, rtol=0.0, atol=1e-15)
    assert np.allclose(x_high[:, 0] + kappa, most, rtol=0.0, atol=1e-15)
    changes = np.diff(np.concatenate([[before], kappa]))
    assert np.allclose(u_low[:, 0] + changes, -change, rtol=0.0, atol=1e-15)
    assert np.allclose(u_high[:, 0] + changes, change, rtol=0.0, atol=1e-15)
