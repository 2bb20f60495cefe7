"""Stage programs, and the active set and the interior point of the core against the same on dense matrices."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.arrays import FloatArray
from hdvplan.errors import QpDataError
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import residuals
from hdvplan.solvers.riccati import InteriorWorkspace, RiccatiWorkspace
from hdvplan.solvers.sparse import SparseQp
from tests.core.chains import few
from tests.core.programs import PARTS, copied, dense, random_program, shape, staged
from tests.core.twins import step as twin


def random_point(sizes: StageShape, seed: int) -> StageSolution:
    point, random = StageSolution.empty(sizes), np.random.default_rng(seed)
    for name in PARTS:
        getattr(point, name)[:] = random.normal(size=getattr(point, name).shape)
    return point


def patterned() -> StageShape:
    a, q, g = np.tril(np.ones((4, 4), bool)), np.zeros((4, 4), bool), np.array([True, True, False, True])
    q[:2, :2] = True
    return StageShape(5, 4, 2, 2, (0, 2), a_pattern=a, q_pattern=q, g_pattern=g)


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
    for name in PARTS:
        assert np.array_equal(getattr(back, name), getattr(point, name))


def plain_residuals(qp: StageQp, point: StageSolution) -> FloatArray:
    """Return primal and dual residual and gap, from the dense program."""
    plain, s = dense(qp), qp.shape
    v = np.concatenate([point.x.ravel(), point.u.ravel(), point.sigma.ravel()])
    bounds = np.concatenate([point.x_bounds.ravel(), point.u_bounds.ravel()])
    slack = (qp.linear + qp.quadratic * point.sigma - point.rows).ravel()  # makes the slacks' gradient zero
    inequality = np.concatenate([point.rows.ravel(), slack, np.maximum(bounds, 0.0), np.maximum(-bounds, 0.0)])
    over = plain.G @ v - plain.h
    gradient = plain.P @ v + plain.q + plain.E.T @ point.dynamics.ravel() + plain.G.T @ inequality
    apart = np.concatenate([(qp.x_high - qp.x_low).ravel(), (qp.u_high - qp.u_low).ravel()])
    near = np.maximum(1.0, 0.04 / np.maximum(apart, 1e-3))  # beside narrow bounds a violation counts by its share of them
    counted = over * np.concatenate([np.ones(2 * s.stages * s.rows), near, near])
    primal = max(float(np.max(np.abs(plain.E @ v - plain.b))), float(np.max(counted)))
    dual = max(float(np.max(np.abs(gradient))), float(np.max(-inequality)))
    own = 2 * s.stages * s.rows  # rows and slacks count with the positive part of their multipliers
    inequality[:own] = np.maximum(inequality[:own], 0.0)
    return np.array([primal, dual, np.sum(np.abs(inequality * over))])


@given(seed=st.integers(0, 10**6), rows=st.integers(0, 3), near=st.sampled_from([np.inf, 0.02, 1e-3, 0.0]))
@few
def test_residuals_are_the_optimality_conditions_of_the_dense_program(seed: int, rows: int, near: float) -> None:
    sizes = shape(rows=rows)
    qp, point = random_program(sizes, seed), random_point(sizes, seed + 1)
    qp.u_high[:] = np.minimum(qp.u_high, qp.u_low + near)  # as of a slow steering
    found = residuals(qp, point)
    assert np.allclose([found.primal, found.dual, found.gap], plain_residuals(qp, point), rtol=1e-12, atol=1e-12)  # order of sums


@pytest.mark.parametrize("tightness", [1.0, 0.1, -0.5])
def test_residuals_vanish_at_another_solvers_solution(tightness: float) -> None:
    qp = random_program(shape(), 11, tightness=tightness)
    found = residuals(qp, staged(qp, *dense(qp).solve()))
    assert max(found.primal, found.dual) < 1e-7  # the other solver's tolerance of 1e-11, relative to its scaling
    assert found.gap < 1e-6  # a sum over more than a hundred inequalities


@pytest.mark.parametrize("name", PARTS)
def test_a_point_that_is_not_a_number_is_not_judged_good(name: str) -> None:
    qp = random_program(shape(), 11)
    point = staged(qp, *dense(qp).solve())
    getattr(point, name)[:] = np.nan
    found = residuals(qp, point)
    if name in {"x", "u", "sigma"}:
        assert not found.primal <= 1e-3
    else:
        assert not found.dual <= 1e-3


@pytest.mark.parametrize("sizes", [(0, 2, 1, 0), (1, 41, 1, 0), (1, 2, 21, 0), (1, 2, 1, 0, (2,)), (1, 2, 1, 0, (-1,))])
def test_a_shape_without_stages_or_beyond_the_core_s_memory_is_refused(sizes: tuple[Any, ...]) -> None:
    with pytest.raises(QpDataError):
        StageShape(*sizes)


tight = st.sampled_from([0.1, 0.5, 1.0])  # nearly all programs have active, violated and inactive rows, and active bounds


def flat(point: StageSolution) -> FloatArray:
    """Return x, u and sigma in the order of ``dense``."""
    return np.concatenate([point.x.ravel(), point.u.ravel(), point.sigma.ravel()])


def multipliers(qp: StageQp, point: StageSolution) -> FloatArray:
    """Return the multipliers of all inequalities in the order of ``dense``."""
    both = np.concatenate([point.x_bounds.ravel(), point.u_bounds.ravel()])
    of_sigma = (qp.linear + qp.quadratic * point.sigma - point.rows).ravel()
    return np.concatenate([point.rows.ravel(), of_sigma, np.maximum(both, 0.0), np.maximum(-both, 0.0)])


@given(seed=st.integers(0, 10**6), tightness=tight)
@few
def test_the_interior_point_ends_where_dense_iterations_end(seed: int, tightness: float) -> None:
    qp = random_program(shape(), seed, tightness=tightness)
    found = InteriorWorkspace(qp.shape).solve(qp, None).point
    v, z = twin.interior(dense(qp))
    np.testing.assert_allclose(flat(found), v, rtol=0.0, atol=1e-4)  # products of 1e-8 leave their root where a row hardly binds
    np.testing.assert_allclose(multipliers(qp, found), z, rtol=0.0, atol=1e-3)  # times curvatures of up to 10


@given(seed=st.integers(0, 10**6), tightness=tight)
@few
def test_a_settled_active_set_solves_its_equalities_and_keeps_all_other_inequalities(seed: int, tightness: float) -> None:
    qp, program = random_program(shape(), seed, tightness=tightness), dense(random_program(shape(), seed, tightness=tightness))
    workspace = RiccatiWorkspace(qp.shape)
    cold = copied(workspace.solve(qp, None).point)
    result = workspace.solve(qp, cold)
    found = multipliers(qp, result.point)
    v, z = twin.at_active_set(program, found > 1e-6)
    np.testing.assert_allclose(flat(result.point), v, rtol=0.0, atol=1e-6)  # inequalities are kept to 1e-7
    np.testing.assert_allclose(found, z, rtol=0.0, atol=1e-4)  # and balanced to 1e-6 of the largest multiplier
    assert np.all(program.G @ v <= program.h + 1e-6)
    assert np.all(z >= -1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_a_guess_that_is_right_settles_in_fewer_factorisations_than_the_interior_point_takes(seed: int) -> None:
    qp = random_program(shape(), seed, tightness=0.1)
    workspace = RiccatiWorkspace(qp.shape)
    first = workspace.solve(qp, None)
    assert workspace.solve(qp, copied(first.point)).iterations < first.iterations // 2
