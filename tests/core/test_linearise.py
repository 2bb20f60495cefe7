from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.centering.weights import CenteringTable
from hdvplan.jit import FloatArray
from hdvplan.planning.linearise import (
    ROWS_PER_EDGE,
    advance,
    limit_at,
    linearise_dynamics,
    linearise_limits,
    linearise_objective,
    write_inputs,
)
from hdvplan.planning.motion import axles_behind
from hdvplan.planning.stations import Stations, stations_of
from hdvplan.road.road import Limits, Road
from hdvplan.vehicle.body import axis_points, edge_points
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


def varying_limits() -> Limits:
    """Return limits with slopes of up to 0.2 on all four lines; their corners lie on the planner's 0.25 m grid."""
    s = np.array([0.0, 20.0, 30.0, 45.0, 60.0, 110.0])
    left = np.array([3.0, 2.0, 4.0, 3.0, 5.0, 5.0])
    return Limits(s, left, -left[::-1] - 0.3, left + np.array([0.0, 1.0, 0.5, 2.0, 0.0, 1.0]), -left[::-1] - 0.9)


def prepared(vehicle: Vehicle) -> Stations:
    return stations_of(Road("winding", winding(), varying_limits()), vehicle, CenteringTable.of(vehicle), step=STEP, horizon=20.0)


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


def rows(vehicle: Vehicle, stations: Stations, z: FloatArray, margin: float, parts: list[int]) -> list[FloatArray]:
    path, limits, points = stations.path, stations.limits, edge_points(vehicle)
    count = 2 * ROWS_PER_EDGE * len(vehicle.units)
    G, h = np.zeros((STAGES, count, vehicle.states + 1)), np.zeros((STAGES, count))
    axis = axis_points(vehicle)
    unscreened = np.full((4, STAGES + 1), -np.inf)  # no body is far from limits this narrow: every point is looked at
    axis_feet = stations.s[FIRST : FIRST + STAGES + 1, None, None] + axis - axles_behind(vehicle)[:, None]
    feet = stations.s[FIRST : FIRST + STAGES + 1, None, None, None] + (points[:, :, :1] - axles_behind(vehicle)[:, None, None])
    feet = np.ascontiguousarray(np.broadcast_to(feet, (STAGES + 1, *points.shape[:2], 2)))
    gaps = np.full(feet.shape, np.inf)
    for begin, end in pairwise(parts):
        lost = linearise_limits(
            vehicle.table(), points, axis, path.coefficients, path.s_first, path.spacing, horizon(stations), limits.values,
            limits.s_first, limits.spacing, unscreened, margin, z, axis_feet, feet, gaps, begin, end, G, h,
        )  # fmt: skip
        assert lost == -1
    return [G, h, feet, gaps]


def true_gaps(vehicle: Vehicle, stations: Stations, i: int, z: FloatArray) -> FloatArray:
    """Return the clearance of every edge point, shape (units, points, 2), from the road's own limits."""
    points = edge_points(vehicle)
    s = float(stations.s[FIRST + i])
    local = [
        np.concatenate([np.column_stack([row[:, 0], np.full(len(row), side * 0.5 * unit.width)]) for side in (1.0, -1.0)])
        for unit, row in zip(vehicle.units, points, strict=True)
    ]
    found = []
    for row, places, behind in zip(points, on_road(vehicle, stations.path, s, z, local), axles_behind(vehicle), strict=True):
        foot, offset = stations.path.project(places[:, 0], places[:, 1], s - behind + np.tile(row[:, 0], 2))
        left, right, left_sweep, right_sweep = varying_limits().table(foot)
        over = np.tile(row[:, 1] > 0.0, 2)
        gap = np.where(over, left_sweep, left) - offset
        gap[len(row) :] = (offset - np.where(over, right_sweep, right))[len(row) :]
        found.append(gap.reshape(2, -1).T)
    return np.stack(found)


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
def test_the_gap_of_every_edge_point_is_that_to_the_roads_own_limit(vehicle: Vehicle) -> None:
    stations, (z, _) = prepared(vehicle), motion(vehicle)
    _, _, _, gaps = rows(vehicle, stations, z, 0.1, [1, STAGES + 1])
    assert np.all(np.isinf(gaps[0]))  # the first stage is given
    for i in (1, 9, 22, STAGES):
        assert np.allclose(gaps[i], true_gaps(vehicle, stations, i, z[i]), rtol=0.0, atol=1e-9)  # accuracy of projection


@each_vehicle
def test_body_rows_are_the_derivatives_of_the_two_tightest_gaps_of_every_edge(vehicle: Vehicle) -> None:
    stations, (z, _), n = prepared(vehicle), motion(vehicle), vehicle.states
    margin = 0.1
    G, h, feet, _ = rows(vehicle, stations, z, margin, [1, STAGES + 1])
    sloped = 0
    for i in (1, 5, 9, 13, 22, 31, STAGES):
        gaps = true_gaps(vehicle, stations, i, z[i])

        def flat_gaps(v: FloatArray, i: int = i) -> FloatArray:
            return true_gaps(vehicle, stations, i, v).ravel()

        slope = differences(flat_gaps, z[i]).reshape(*gaps.shape, n)
        row = 0
        for unit in range(len(vehicle.units)):
            for side in range(2):
                for point in np.argsort(gaps[unit, :, side])[:ROWS_PER_EDGE]:
                    assert abs(h[i - 1, row] - (gaps[unit, point, side] - margin)) < 1e-9
                    assert G[i - 1, row, n] == 0.0
                    knot = np.round(feet[i, unit, point, side] / 5.0) * 5.0  # the limits' corners are multiples of 5 m
                    if abs(feet[i, unit, point, side] - knot) > 0.05:
                        # the road's third derivative jumps a little at its knots, some of them inside the stencil
                        assert np.allclose(G[i - 1, row, :n], -slope[unit, point, side], rtol=0.0, atol=1e-6)
                        sloped += 1
                    row += 1
        assert row == h.shape[1]
    assert sloped > 5 * row  # hardly any foot fell on a corner


def test_the_slope_of_a_limit_matters_to_its_row() -> None:
    vehicle = VEHICLES[0]
    stations, (z, _) = prepared(vehicle), motion(vehicle)
    with_slope = rows(vehicle, stations, z, 0.0, [1, STAGES + 1])[0]
    values = stations.limits.values.copy()
    values[:] = values[:, :1]
    flat = replace(stations, limits=replace(stations.limits, values=values))
    without = rows(vehicle, flat, z, 0.0, [1, STAGES + 1])[0]
    assert np.max(np.abs(with_slope - without)) > 0.05


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
        (rows(vehicle, stations, z, 0.0, [1, STAGES + 1]), rows(vehicle, stations, z, 0.0, [1, 2, 30, STAGES + 1])),
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


def test_a_limit_is_linear_between_its_entries_and_held_beyond_them() -> None:
    table = np.array([[1.0, 2.0, 0.0], [5.0, 5.0, 5.0]])
    for s, value, slope in ((10.0, 1.0, 4.0), (10.125, 1.5, 4.0), (10.25, 2.0, -8.0), (10.375, 1.0, -8.0)):
        assert limit_at(table, 10.0, 0.25, 0, s) == pytest.approx((value, slope), abs=1e-12)
    assert limit_at(table, 10.0, 0.25, 0, 9.0)[0] == 1.0
    assert limit_at(table, 10.0, 0.25, 0, 30.0)[0] == 0.0


def test_a_limit_that_is_held_has_no_slope() -> None:
    table = np.array([[1.0, 2.0, 0.0]])
    assert limit_at(table, 10.0, 0.25, 0, 9.0)[1] == 0.0
    assert limit_at(table, 10.0, 0.25, 0, 30.0)[1] == 0.0


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


@each_vehicle
def test_a_body_is_screened_only_where_every_point_keeps_its_distance(vehicle: Vehicle) -> None:
    stations = prepared(vehicle)
    z, _ = motion(vehicle)
    path, limits, points, axis = stations.path, stations.limits, edge_points(vehicle), axis_points(vehicle)
    s = stations.s[FIRST : FIRST + STAGES + 1]
    count = 2 * ROWS_PER_EDGE * len(vehicle.units)
    screened = 0
    for wide in (0.0, 2.0, 6.0):  # metres of room added: nothing, some and everything is screened
        G, h = np.zeros((STAGES, count, vehicle.states + 1)), np.zeros((STAGES, count))
        feet = np.ascontiguousarray(
            np.broadcast_to(
                s[:, None, None, None] + (points[:, :, :1] - axles_behind(vehicle)[:, None, None]), (STAGES + 1, *points.shape[:2], 2)
            )
        )
        bounds, around = (
            np.full(feet.shape, np.inf),
            stations.around[:, FIRST : FIRST + STAGES + 1] + wide * np.array([[1.0], [1.0], [0.0], [0.0]]),
        )
        values = limits.values + wide * np.array([[1.0], [-1.0], [1.0], [-1.0]])
        lost = linearise_limits(
            vehicle.table(), points, axis, path.coefficients, path.s_first, path.spacing, horizon(stations), values, limits.s_first,
            limits.spacing, around, 0.0, z, s[:, None, None] + axis - axles_behind(vehicle)[:, None], feet, bounds, 1, STAGES + 1, G, h,
        )  # fmt: skip
        assert lost == -1
        for i in range(1, STAGES + 1):
            # limits are tabulated every 0.25 m and interpolated; the road's own bend between the table's entries by < 1e-3 m
            assert np.all(bounds[i] <= true_gaps(vehicle, stations, i, z[i]) + wide + 1e-3)
        screened += int(np.sum(np.all(G == 0.0, axis=2)))
    assert screened > 0
