"""What every solver owes its caller, whoever wrote it."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.bench import contract
from hdvplan.bench.contract import CONTRACT, Rule, distance
from hdvplan.bench.measuring.recording import Recorded
from hdvplan.errors import QpDataError
from hdvplan.qp.program import NAMES, StageQp, StageShape
from hdvplan.qp.workspace import Status, residuals
from tests.core.chains import few
from tests.core.programs import copied, dense, random_program, shape
from tests.nightly import nightly
from tests.solvers.workspaces import GENERIC, NATIVE, generic, native, optimum

each_native = pytest.mark.parametrize("name", NATIVE)


# States, inputs and how many states have bounds: the first are those of vehicles of one and three units, and those of ``shape``.
SIZES = ((3, 1, 1), (4, 2, 2), (5, 1, 1))
MORE_SIZES = ((2, 1, 2), (5, 2, 5), (5, 3, 2), (6, 1, 3), (6, 3, 0))


@st.composite
def shapes(draw: st.DrawFn, sizes: tuple[tuple[int, int, int], ...] = SIZES) -> StageShape:
    states, inputs, bounds = draw(st.sampled_from(sizes))
    bounded = draw(st.permutations(range(states)))[:bounds]
    return StageShape(draw(st.integers(1, 6)), states, inputs, draw(st.integers(0, 6)), tuple(sorted(bounded)))


@each_native
@given(sizes=shapes(), seed=st.integers(0, 10**6), tightness=st.sampled_from([1.0, 0.3, 0.0, -0.5]))
@few
def test_programs_of_many_sizes_are_solved_as_by_another_solver(name: str, sizes: StageShape, seed: int, tightness: float) -> None:
    solver, qp = native(name), random_program(sizes, seed, tightness=tightness)
    qp.x_low[:], qp.x_high[:] = -30.0, 30.0  # of no matter, so that a point that keeps them exists
    result = solver.make(sizes).solve(qp, None)
    judged = residuals(qp, result.point)
    assert result.status is Status.SOLVED
    assert result.iterations >= 1
    assert judged.primal < 1e-4  # osqp stops at 1e-5, before its own scaling
    assert distance(result.point, optimum(qp)) < solver.agree * (1.0 + float(np.max(np.abs(result.point.x))))


def equal_rows(qp: StageQp) -> None:
    qp.G[:, 1], qp.h[:, 1] = qp.G[:, 0], qp.h[:, 0]


def empty_rows(qp: StageQp) -> None:
    qp.G[:, 0], qp.h[:, 0] = 0.0, 0.0
    qp.G[:, 1], qp.h[:, 1] = 0.0, 0.2


def equalities(qp: StageQp) -> None:
    qp.G[:, 1], qp.h[:, 1] = -qp.G[:, 0], -qp.h[:, 0]


def narrow_bounds(qp: StageQp) -> None:
    qp.u_low[:] = 0.1
    qp.u_high[:] = 0.1 + 1e-7


def pinned_inputs(qp: StageQp) -> None:
    qp.u_low[:] = qp.u_high[:] = 0.05


def broken_at_the_start(qp: StageQp) -> None:
    qp.h[0] = qp.G[0] @ (qp.A[0] @ qp.x_first + qp.c[0]) - 1.0


def contradictions(qp: StageQp) -> None:
    qp.G[:, 1], qp.h[:, 1] = -qp.G[:, 0], -qp.h[:, 0] - 1.0  # a gap of a metre between what both ask for


DEGENERATE = [equal_rows, empty_rows, equalities, narrow_bounds, pinned_inputs, broken_at_the_start, contradictions]


@each_native
@pytest.mark.parametrize("spoil", DEGENERATE, ids=lambda f: f.__name__)
@pytest.mark.parametrize("price", [nightly(None), 1e3])
def test_degenerate_programs_are_solved_as_by_another_solver(name: str, spoil: Callable[[StageQp], None], price: float | None) -> None:
    solver = native(name)
    for seed in range(3):
        qp = random_program(shape(), seed)
        qp.x_low[:], qp.x_high[:] = -30.0, 30.0
        if price is not None:
            qp.linear[:], qp.quadratic[:] = price, 0.0  # exact penalties: hard rows wherever they can be kept
        spoil(qp)
        result, other = solver.make(shape()).solve(qp, None), optimum(qp)
        if name == "proxqp" and result.status is not Status.SOLVED:
            continue  # it gives some of these up, and says so
        assert residuals(qp, result.point).primal < 1e-4
        assert distance(result.point, other) < solver.agree
        if spoil is contradictions:
            assert np.all(result.point.sigma[:, 0] + result.point.sigma[:, 1] > 1.0 - 1e-4)


@each_native
def test_elastic_rows_cost_nothing_while_a_feasible_point_exists(name: str) -> None:
    solver, qp = native(name), random_program(shape(), 3, tightness=0.3)
    qp.linear[:], qp.quadratic[:] = 1e4, 0.0
    result = solver.make(shape()).solve(qp, None)
    hard = dense(qp)
    free = (qp.shape.stages + 1) * 4 + qp.shape.stages * 2
    hard.h[qp.shape.stages * 3 : 2 * qp.shape.stages * 3] = 1e-12  # slacks no larger than this: the rows are hard
    hard.P[:, free:], hard.P[free:], hard.q[free:] = 0.0, 0.0, 0.0
    pinned = np.zeros((hard.P.shape[0] - free, hard.P.shape[0]))
    pinned[:, free:] = np.eye(pinned.shape[0])
    equal, right = np.vstack([hard.E, pinned]), np.concatenate([hard.b, np.zeros(len(pinned))])
    other = type(hard)(hard.P, hard.q, equal, right, hard.G, hard.h).solve()[0]
    assert np.max(result.point.sigma) < 1e-6
    assert np.max(result.point.rows) > 1.0  # some row binds
    assert np.max(np.abs(result.point.x.ravel() - other[: result.point.x.size])) < solver.agree


@each_native
def test_elastic_rows_are_broken_no_more_than_they_must(name: str) -> None:
    sizes = shape(rows=1, stages=4)
    qp = StageQp.empty(sizes)  # of its states and inputs the first alone are used
    qp.x_low[:], qp.x_high[:], qp.R[:] = -1.0, 1.0, np.eye(2)
    qp.A[:, 0, 0], qp.B[:, 0, 0], qp.G[:, 0, 0], qp.h[:] = 1.0, 1.0, 1.0, -2.0  # x must come down to -2 ...
    qp.u_low[:], qp.u_high[:], qp.linear[:] = -0.75, 0.75, 1e4  # ... by 0.75 a stage
    qp.q[:, 0] = -1.0  # ... and would rather go up: every row that is kept binds
    point, near = native(name).make(sizes).solve(qp, None).point, 0.1 * NATIVE[name]
    assert np.allclose(point.sigma[:, 0], [1.25, 0.5, 0.0, 0.0], rtol=0.0, atol=near)
    assert np.allclose(point.x[:, 0], [0.0, -0.75, -1.5, -2.0, -2.0], rtol=0.0, atol=near)


@cache
def recorded() -> tuple[Recorded, ...]:
    """Return random programs as of a drive, of which a solver with hard rows solves some in another form than others."""
    programs = [random_program(shape(), seed, tightness=0.3 if seed % 4 else 30.0) for seed in range(20)]
    for seed, qp in enumerate(programs):
        qp.linear[:], qp.quadratic[:] = 50.0, 0.0 if seed % 2 else 1.0
    return tuple(Recorded(qp, None, optimum(qp), 0, 0) for qp in programs)


@each_native
@pytest.mark.parametrize("rule", CONTRACT, ids=lambda rule: rule.__name__)
def test_every_solver_keeps_the_contract_on_random_programs(name: str, rule: Rule, monkeypatch: pytest.MonkeyPatch) -> None:
    solver = native(name)
    monkeypatch.setattr(contract, "AGREE_M", solver.agree)
    finding = rule(solver.make, recorded())
    assert finding.kept, finding.said


@each_native
def test_a_guess_saves_iterations_of_those_that_start_warm_alone(name: str) -> None:
    make, each = native(name).make, recorded()[1]
    cold, warm = (make(shape()).solve(each.qp, guess) for guess in (None, copied(each.point)))
    assert (warm.iterations < cold.iterations) is make(shape()).starts_warm


@pytest.mark.parametrize("part", NAMES)
def test_what_is_not_finite_is_named(part: str) -> None:
    wrong = random_program(shape(), 2)
    getattr(wrong, part).flat[-1] = np.nan
    with pytest.raises(QpDataError, match=f"'{part}'"):
        wrong.check()


@pytest.mark.parametrize("name", GENERIC)
@pytest.mark.parametrize("price", [None, 100.0], ids=["cheap", "exact"])
def test_a_generic_solver_is_right_where_it_says_so(name: str, price: float | None) -> None:
    solver = generic(name)
    workspace = solver.make(shape())
    solved = 0
    for seed in range(4):
        qp = random_program(shape(), seed, tightness=0.3)
        qp.Q[:] += 0.1 * np.eye(4)  # cvxopt finds nothing where the Hessian is only semidefinite
        if price is not None:
            qp.linear[:], qp.quadratic[:] = price, 0.0
        result = workspace.solve(qp, None)
        if result.status is Status.SOLVED:
            solved += 1
            assert residuals(qp, result.point).primal < 1e-3
            assert distance(result.point, optimum(qp)) < solver.agree
    assert workspace.name == solver.name
    assert solved == 4


def test_a_generic_solver_that_throws_has_failed_with_its_reason_and_its_point_is_no_number(monkeypatch: pytest.MonkeyPatch) -> None:
    def throws(*_arguments: object, **_options: object) -> None:
        msg = "matrix P is not positive definite"
        raise ValueError(msg)

    monkeypatch.setattr("qpsolvers.solve_problem", throws)
    solver, qp = generic("clarabel"), random_program(shape(), 1)
    result = solver.make(shape()).solve(qp, None)
    assert result.status is Status.FAILED
    assert result.reason == "ValueError: matrix P is not positive definite"
    assert np.isnan(residuals(qp, result.point).primal)


def test_a_generic_solver_without_rows_is_handed_none() -> None:
    solver, sizes = generic("clarabel"), StageShape(5, 3, 1, 0, (2,))
    qp = random_program(sizes, 2)
    assert distance(solver.make(sizes).solve(qp, None).point, optimum(qp)) < solver.agree
