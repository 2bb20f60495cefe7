from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.centering.weights import CenteringTable
from hdvplan.errors import QpDataError
from hdvplan.jit import FloatArray
from hdvplan.planning.objectives import geometric
from hdvplan.planning.planner import Planner, qp_shape
from hdvplan.planning.qp import StageQp, StageShape, StageSolution, residuals, view_shapes
from hdvplan.planning.settings import Discretisation, PlannerSettings
from hdvplan.planning.stations import stations_of
from hdvplan.road.road import Road
from hdvplan.solvers.registry import solver_named
from hdvplan.solvers.sparse import SparseQp
from hdvplan.solvers.workspace import QpWorkspace, Status
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.chains import few, three_units, winding
from tests.core.programs import dense, random_program, shape, staged
from tests.core.spying import Spy

WORKSPACES = {name: solver_named(name) for name in ("riccati", "piqp", "clarabel")}
each_workspace = pytest.mark.parametrize("make", WORKSPACES.values(), ids=WORKSPACES.keys())
AGREE = 1e-5  # two solvers at 1e-8 on strongly convex inputs agree to the square root of it, less conditioning


def random_point(sizes: StageShape, seed: int) -> StageSolution:
    point, random = StageSolution.empty(sizes), np.random.default_rng(seed)
    for values in vars(point).values():
        values[:] = random.normal(size=values.shape)
    return point


def patterned() -> StageShape:
    a, q, g = np.tril(np.ones((4, 4), bool)), np.zeros((4, 4), bool), np.array([True, True, False, True])
    q[:2, :2] = True
    return StageShape(5, 4, 2, 2, (0,), a_pattern=a, q_pattern=q, g_pattern=g)


def matches(sizes: StageShape, qp: StageQp) -> None:
    """Compare sparse with dense matrices after sorting variables alike."""
    form, plain = SparseQp.of(sizes, elastic=True), dense(qp)
    form.load(qp)
    order = np.concatenate([form.x_columns.ravel(), form.u_columns.ravel(), form.sigma_columns.ravel()])
    assert np.array_equal(np.sort(order), np.arange(len(form.q)))
    P = form.P.toarray()
    assert np.array_equal(P, np.triu(P))
    whole = P + np.triu(P, 1).T
    assert np.array_equal(whole[np.ix_(order, order)], plain.P)
    assert np.array_equal(form.q[order], plain.q)
    # the sparse rows read A x + B u - x_next = -c, the dense ones their negative, but for the given first state
    sign = np.where(np.arange(len(plain.b)) < sizes.states, 1.0, -1.0)
    assert np.array_equal(sign[:, None] * form.E.toarray()[:, order], plain.E)
    assert np.array_equal(sign * form.b, plain.b)
    rows = sizes.stages * sizes.rows
    assert np.array_equal(form.G.toarray()[:, order], plain.G[:rows])
    assert np.array_equal(form.h, plain.h[:rows])
    low, high = np.full(len(order), -np.inf), np.full(len(order), np.inf)
    for row, value in zip(plain.G[rows:], plain.h[rows:], strict=True):
        column = int(np.argmax(np.abs(row)))
        if row[column] > 0.0:
            high[column] = value
        else:
            low[column] = -value
    assert np.array_equal(form.low[order], low)
    assert np.array_equal(form.high[order], high)
    for matrix in (form.P, form.E, form.G):
        assert all(np.all(np.diff(matrix.indices[i:j]) > 0) for i, j in zip(matrix.indptr, matrix.indptr[1:], strict=False))


@given(seed=st.integers(0, 10**6), rows=st.integers(0, 3), stages=st.integers(1, 5))
@few
def test_sparse_matrices_are_the_dense_program_sorted_by_stage(seed: int, rows: int, stages: int) -> None:
    sizes = shape(rows=rows, stages=stages)
    matches(sizes, random_program(sizes, seed))


def test_patterns_drop_nothing_but_zeros() -> None:
    matches(patterned(), random_program(patterned(), 4))


def test_loading_a_second_program_leaves_nothing_of_the_first_and_the_pattern_as_it_was() -> None:
    form, first, second = SparseQp.of(shape(), elastic=True), random_program(shape(), 1), random_program(shape(), 2)
    form.load(first)
    pattern = [(matrix.indices.copy(), matrix.indptr.copy()) for matrix in (form.P, form.E, form.G)]
    second.Q[:] = 0.0  # zeros stay in the pattern
    form.load(second)
    fresh = SparseQp.of(shape(), elastic=True)
    fresh.load(second)
    for name in ("P", "E", "G"):
        assert np.array_equal(getattr(form, name).toarray(), getattr(fresh, name).toarray())
    for name in ("q", "b", "h", "low", "high"):
        assert np.array_equal(getattr(form, name), getattr(fresh, name))
    for matrix, (indices, pointer) in zip((form.P, form.E, form.G), pattern, strict=True):
        assert np.array_equal(matrix.indices, indices)
        assert np.array_equal(matrix.indptr, pointer)


def test_stages_follow_each_other_in_the_variables() -> None:
    form = SparseQp.of(shape(), elastic=True)
    stage = np.zeros(len(form.q))
    for i in range(1, 6):
        stage[form.x_columns[i]] = stage[form.u_columns[i]] = stage[form.sigma_columns[i - 1]] = i
    stage[form.x_columns[6]] = stage[form.sigma_columns[5]] = 6
    assert np.all(np.diff(stage) >= 0.0)


@given(seed=st.integers(0, 10**6))
@few
def test_flattening_a_point_and_sorting_it_back_changes_nothing(seed: int) -> None:
    form, point, back = SparseQp.of(shape(), elastic=True), random_point(shape(), seed), StageSolution.empty(shape())
    form.point(*form.flatten(point), back)
    for name, values in vars(point).items():
        assert np.array_equal(getattr(back, name), values)


def plain_residuals(qp: StageQp, point: StageSolution) -> FloatArray:
    """Return primal and dual residual and gap, from the dense program."""
    plain, s = dense(qp), qp.shape
    v = np.concatenate([point.x.ravel(), point.u.ravel(), point.sigma.ravel()])
    bounds = np.concatenate([point.x_bounds.ravel(), point.u_bounds.ravel()])
    slack = (qp.linear + qp.quadratic * point.sigma - point.rows).ravel()  # makes the slacks' gradient zero
    inequality = np.concatenate([point.rows.ravel(), slack, np.maximum(bounds, 0.0), np.maximum(-bounds, 0.0)])
    over = plain.G @ v - plain.h
    gradient = plain.P @ v + plain.q + plain.E.T @ point.dynamics.ravel() + plain.G.T @ inequality
    primal = max(float(np.max(np.abs(plain.E @ v - plain.b))), float(np.max(over)))
    dual = max(float(np.max(np.abs(gradient))), float(np.max(-inequality)))
    own = 2 * s.stages * s.rows  # rows and slacks count with the positive part of their multipliers
    inequality[:own] = np.maximum(inequality[:own], 0.0)
    return np.array([primal, dual, np.sum(np.abs(inequality * over))])


@given(seed=st.integers(0, 10**6), rows=st.integers(0, 3))
@few
def test_residuals_are_the_optimality_conditions_of_the_dense_program(seed: int, rows: int) -> None:
    sizes = shape(rows=rows)
    qp, point = random_program(sizes, seed), random_point(sizes, seed + 1)
    found = residuals(qp, point)
    assert np.allclose([found.primal, found.dual, found.gap], plain_residuals(qp, point), rtol=1e-12, atol=1e-12)  # order of sums


@pytest.mark.parametrize("tightness", [1.0, 0.1, -0.5])
def test_residuals_vanish_at_another_solvers_solution(tightness: float) -> None:
    qp = random_program(shape(), 11, tightness=tightness)
    found = residuals(qp, staged(qp, *dense(qp).solve()))
    assert max(found.primal, found.dual) < 1e-7  # the other solver's tolerance of 1e-11, relative to its scaling
    assert found.gap < 1e-6  # a sum over more than a hundred inequalities


@pytest.mark.parametrize("name", ["x", "u", "sigma", "dynamics", "rows", "x_bounds", "u_bounds"])
def test_a_point_that_is_not_a_number_is_not_judged_good(name: str) -> None:
    qp = random_program(shape(), 11)
    point = staged(qp, *dense(qp).solve())
    getattr(point, name)[:] = np.nan
    found = residuals(qp, point)
    if name in {"x", "u", "sigma"}:
        assert not found.primal <= 1e-3
    else:
        assert not found.dual <= 1e-3


@each_workspace
@pytest.mark.parametrize("tightness", [1.0, 0.1, -0.5])
def test_a_workspace_finds_the_same_optimum_as_another_solver(make: Callable[[StageShape], QpWorkspace], tightness: float) -> None:
    qp = random_program(shape(), 5, tightness=tightness)
    result = make(qp.shape).solve(qp, None)
    other = staged(qp, *dense(qp).solve())
    judged = residuals(qp, result.point)
    assert result.status is Status.SOLVED
    assert result.iterations >= 0
    assert max(judged.primal, judged.dual, judged.gap) < 1e-5  # asked for 1e-8, per inequality
    assert np.max(np.abs(result.point.u - other.u)) < AGREE
    assert np.max(np.abs(result.point.x - other.x)) < AGREE


@each_workspace
def test_updating_a_workspace_equals_making_it_anew(make: Callable[[StageShape], QpWorkspace]) -> None:
    kept = make(shape())
    for seed in range(8):
        qp = random_program(shape(), seed, tightness=0.3)
        here, fresh = kept.solve(qp, None).point, make(shape()).solve(qp, None).point
        assert np.max(np.abs(here.u - fresh.u)) < AGREE
        assert np.max(np.abs(here.x - fresh.x)) < AGREE


@each_workspace
def test_elastic_rows_cost_nothing_while_a_feasible_point_exists(make: Callable[[StageShape], QpWorkspace]) -> None:
    qp = random_program(shape(), 3, tightness=0.3)
    qp.linear[:], qp.quadratic[:] = 1e4, 0.0
    result = make(shape()).solve(qp, None)
    hard = dense(qp)
    free = (qp.shape.stages + 1) * 4 + qp.shape.stages * 2
    hard.h[qp.shape.stages * 3 : 2 * qp.shape.stages * 3] = 1e-12  # slacks no larger than this: the rows are hard
    hard.P[:, free:], hard.P[free:], hard.q[free:] = 0.0, 0.0, 0.0
    pinned = np.zeros((hard.P.shape[0] - free, hard.P.shape[0]))
    pinned[:, free:] = np.eye(pinned.shape[0])
    other = type(hard)(
        hard.P, hard.q, np.vstack([hard.E, pinned]), np.concatenate([hard.b, np.zeros(len(pinned))]), hard.G, hard.h
    ).solve()[0]
    assert np.max(result.point.sigma) < 1e-6
    assert np.max(result.point.rows) > 1.0  # some row binds
    assert np.max(np.abs(result.point.x.ravel() - other[: result.point.x.size])) < AGREE


@each_workspace
def test_elastic_rows_are_broken_no_more_than_they_must(make: Callable[[StageShape], QpWorkspace]) -> None:
    sizes = StageShape(4, 1, 1, 1)
    qp = StageQp.empty(sizes)
    qp.A[:], qp.B[:], qp.R[:], qp.G[:], qp.h[:] = 1.0, 1.0, 1.0, 1.0, -2.0  # x must come down to -2 ...
    qp.u_low[:], qp.u_high[:], qp.linear[:] = -0.75, 0.75, 1e4  # ... by 0.75 a stage
    qp.q[:] = -1.0  # ... and would rather go up: every row that is kept binds
    point = make(sizes).solve(qp, None).point
    assert np.allclose(point.sigma[:, 0], [1.25, 0.5, 0.0, 0.0], rtol=0.0, atol=1e-6)  # tolerance 1e-8 against a price of 1e4
    assert np.allclose(point.x[:, 0], [0.0, -0.75, -1.5, -2.0, -2.0], rtol=0.0, atol=1e-6)


@each_workspace
@pytest.mark.parametrize("name", sorted(view_shapes(shape())))
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_values_that_are_not_finite_are_refused_by_name_and_the_next_program_is_solved(
    make: Callable[[StageShape], QpWorkspace], name: str, value: float
) -> None:
    workspace, good, wrong = make(shape()), random_program(shape(), 1), random_program(shape(), 2)
    workspace.solve(random_program(shape(), 3), None)
    getattr(wrong, name).flat[-1] = value
    with pytest.raises(QpDataError, match=f"'{name}'"):
        workspace.solve(wrong, None)
    assert np.max(np.abs(workspace.solve(good, None).point.x - make(shape()).solve(good, None).point.x)) < AGREE


@each_workspace
@pytest.mark.parametrize(("low", "high"), [("x_low", "x_high"), ("u_low", "u_high")])
def test_crossed_bounds_are_refused_and_the_next_program_is_solved(make: Callable[[StageShape], QpWorkspace], low: str, high: str) -> None:
    workspace, good, wrong = make(shape()), random_program(shape(), 1), random_program(shape(), 2)
    getattr(wrong, low)[2, 1] = getattr(wrong, high)[2, 1] + 1e-6
    with pytest.raises(QpDataError, match="lower bound above"):
        workspace.solve(wrong, None)
    assert np.max(np.abs(workspace.solve(good, None).point.x - make(shape()).solve(good, None).point.x)) < AGREE


@each_workspace
def test_an_unsolvable_program_is_judged_so_and_the_next_one_is_solved(make: Callable[[StageShape], QpWorkspace]) -> None:
    workspace, good, wrong = make(shape()), random_program(shape(), 1), random_program(shape(), 2)
    wrong.x_low[-1], wrong.x_high[-1] = 500.0, 501.0  # out of reach of the inputs
    result = workspace.solve(wrong, None)
    assert result.status is not Status.SOLVED
    assert not residuals(wrong, result.point).primal <= 1e-3
    assert np.max(np.abs(workspace.solve(good, None).point.x - make(shape()).solve(good, None).point.x)) < AGREE


@each_workspace
def test_a_result_stays_as_it_is_until_the_next_solve(make: Callable[[StageShape], QpWorkspace]) -> None:
    workspace, other, qp = make(shape()), make(shape()), random_program(shape(), 1)
    result = workspace.solve(qp, None)
    kept = {name: values.copy() for name, values in vars(result.point).items()}
    qp.buffer[:] = 0.0
    for seed in range(2, 6):
        other.solve(random_program(shape(), seed), None)
    del workspace
    for name, values in vars(result.point).items():
        assert np.array_equal(values, kept[name])


def test_a_shape_without_stages_is_refused() -> None:
    with pytest.raises(QpDataError):
        StageShape(0, 2, 1, 0)


@pytest.mark.parametrize("discretisation", list(Discretisation))
@pytest.mark.parametrize("vehicle", [load_vehicle("bus"), load_vehicle("tractor-trailer"), three_units()], ids=lambda v: v.name)
def test_the_zero_pattern_of_planning_covers_every_value_that_is_not_zero(vehicle: Vehicle, discretisation: Discretisation) -> None:
    settings = PlannerSettings(horizon=20.0, discretisation=discretisation)
    road = Road("winding", winding()).with_limits(3.5, 3.5)
    stations = stations_of(road, vehicle, CenteringTable.of(vehicle), step=0.5, horizon=20.0)
    spy = Spy(solver_named("piqp"))
    z = np.concatenate([[0.2, 0.05], np.full(vehicle.states - 2, 0.1)])
    Planner(vehicle, stations, geometric(stations), settings, spy).plan(30, z, 0.01)
    sizes = qp_shape(vehicle, settings, limited=True)
    assert sizes.a_pattern is not None
    assert sizes.q_pattern is not None
    assert sizes.g_pattern is not None
    for qp in spy.programs:
        assert np.all(qp.A[:, ~sizes.a_pattern] == 0.0)
        assert np.all(qp.Q[:, ~sizes.q_pattern] == 0.0)
        assert np.all(qp.G[:, :, ~sizes.g_pattern] == 0.0)
    seen = np.any(spy.programs[-1].A != 0.0, axis=0)
    if discretisation is Discretisation.MIDPOINT:
        assert np.array_equal(seen, sizes.a_pattern)  # and drops no zero too few
