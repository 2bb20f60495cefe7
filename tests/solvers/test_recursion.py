"""The recursion's kernels against one dense solve of the same equations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.jit import FloatArray
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.residuals import residuals
from hdvplan.solvers.interior import steps_of
from hdvplan.solvers.recursion import adjoint, end_at, factorise, load_weights, recursion_of, sweep_ahead, sweep_back, weights_of
from tests.core.chains import few
from tests.core.programs import PARTS, dense, random_program, shape

WIDE = 1e6  # bounds that are never met


def free_program(sizes: StageShape, seed: int) -> StageQp:
    """Return a program whose inequalities are far away."""
    qp = random_program(sizes, seed)
    qp.h[:], qp.x_low[:], qp.x_high[:], qp.u_low[:], qp.u_high[:] = WIDE, -WIDE, WIDE, -WIDE, WIDE
    return qp


def linear_quadratic(qp: StageQp) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return states, inputs and multipliers without inequalities, from the optimality conditions as one dense system."""
    plain, s = dense(qp), qp.shape
    states, inputs = (s.stages + 1) * s.states, s.stages * s.inputs
    size = states + inputs
    P, E = plain.P[:size, :size], plain.E[:, :size]
    matrix = np.block([[P, E.T], [E, np.zeros((len(E), len(E)))]])
    solution = np.linalg.solve(matrix, np.concatenate([-plain.q[:size], plain.b]))
    shapes = ((s.stages + 1, s.states), (s.stages, s.inputs), (s.stages + 1, s.states))
    x, u, dynamics = np.split(solution, [states, size])
    return x.reshape(shapes[0]), u.reshape(shapes[1]), dynamics.reshape(shapes[2])


class Passes:
    """The memory of one factorisation and its sweeps."""

    def __init__(self, qp: StageQp) -> None:
        """Set up the last stage's cost-to-go."""
        self.work, self.weights, self.point = recursion_of(qp.shape), weights_of(qp.shape), StageSolution.empty(qp.shape)
        load_weights(qp.stages, self.weights)
        end_at(self.weights, self.work, qp.shape.stages)
        self.point.x[0] = qp.x_first

    @property
    def x(self) -> FloatArray:
        """Return the states."""
        return self.point.x

    @property
    def u(self) -> FloatArray:
        """Return the inputs."""
        return self.point.u

    def run(self, qp: StageQp) -> bool:
        """Solve the program without inequalities."""
        last = qp.shape.stages
        if not factorise(qp.stages, self.weights, self.work, last):
            return False
        sweep_back(qp.stages, self.weights, self.work, last, True)
        sweep_ahead(qp.stages, self.work, self.point.stages, 0, last, True)
        return True


Size = tuple[int, int, tuple[int, ...]]  # states, inputs and bounded states, for each of which kernels are compiled in seconds
SIZES: tuple[Size, ...] = ((1, 1, ()), (3, 2, ()), (4, 2, (1, 3)))  # the least, and those of other tests
MORE_SIZES: tuple[Size, ...] = ((1, 2, ()), (3, 1, ()), (6, 3, ()))


@given(size=st.sampled_from(SIZES), stages=st.integers(1, 12), seed=st.integers(0, 10**6))
@few
def test_the_passes_solve_the_optimality_conditions(size: Size, stages: int, seed: int) -> None:
    passes_solve(size, stages, seed)


@pytest.mark.slow
@given(size=st.sampled_from(MORE_SIZES), stages=st.integers(1, 12), seed=st.integers(0, 10**6))
@few
def test_the_passes_solve_the_optimality_conditions_of_more_sizes(size: Size, stages: int, seed: int) -> None:
    passes_solve(size, stages, seed)


def passes_solve(size: Size, stages: int, seed: int) -> None:
    states, inputs, bounded = size
    qp = random_program(StageShape(stages, states, inputs, 0, bounded), seed) if states > 1 else one_state(stages, inputs, seed)
    passes = Passes(qp)
    assert passes.run(qp)
    x, u, dynamics = linear_quadratic(qp)
    # rounding by the conditioning of random chains of a dozen stages
    near = 1e-8 * (1.0 + float(np.max(np.abs(dynamics))))
    assert np.max(np.abs(passes.x - x)) < near
    assert np.max(np.abs(passes.u - u)) < near
    adjoint(qp.stages, qp.rows, qp.bounded, passes.point.stages, passes.point.row_points)
    assert np.max(np.abs(passes.point.dynamics - dynamics)) < near


def one_state(stages: int, inputs: int, seed: int) -> StageQp:
    random, qp = np.random.default_rng(seed), StageQp.empty(StageShape(stages, 1, inputs, 0))
    qp.A[:], qp.B[:], qp.c[:], qp.x_first[:] = 0.9, random.normal(size=qp.B.shape), random.normal(size=qp.c.shape), 1.0
    qp.Q[:], qp.q[:], qp.R[:], qp.r[:] = 1.0, random.normal(size=qp.q.shape), np.eye(inputs), random.normal(size=qp.r.shape)
    return qp


def test_the_cost_to_go_is_the_cost_of_the_best_rest() -> None:
    qp = free_program(StageShape(7, 3, 2, 0), 5)
    passes = Passes(qp)
    assert passes.run(qp)

    def rest(first: FloatArray) -> float:
        tail = StageQp.empty(StageShape(4, 3, 2, 0))
        for name in ("A", "B", "c", "Q", "q", "R", "r"):
            getattr(tail, name)[:] = getattr(qp, name)[3:]
        tail.x_first[:] = first
        x, u, _ = linear_quadratic(tail)
        pairs = ((tail.Q, tail.q, x), (tail.R, tail.r, u))
        return float(
            sum(0.5 * v @ H @ v + g @ v for matrices, slopes, values in pairs for H, g, v in zip(matrices, slopes, values, strict=True))
        )

    def promised(first: FloatArray) -> float:
        return float(0.5 * first @ passes.work["P"][3] @ first + passes.work["p"][3] @ first)

    zero = rest(np.zeros(3))
    for first in np.random.default_rng(1).normal(size=(5, 3)):
        assert abs(rest(first) - zero - promised(first)) < 1e-10 * (1.0 + abs(zero))  # rounding


def test_sweeps_go_on_from_where_they_are_told_to() -> None:
    qp = free_program(shape(), 9)
    whole, parts = Passes(qp), Passes(qp)
    assert whole.run(qp)
    parts.work[:] = whole.work
    for begin, end in ((0, 2), (2, 2), (2, 6)):
        sweep_ahead(qp.stages, parts.work, parts.point.stages, begin, end, True)
    assert np.array_equal(parts.x, whole.x)
    assert np.array_equal(parts.u, whole.u)


def test_a_head_ends_in_the_cost_to_go_of_the_tail() -> None:
    qp = free_program(shape(), 9)
    whole, head = Passes(qp), Passes(qp)
    assert whole.run(qp)
    head.work["P"][4], head.work["p"][4] = whole.work["P"][4], whole.work["p"][4]
    assert factorise(qp.stages, qp.stages, head.work, 4)
    sweep_back(qp.stages, qp.stages, head.work, 4, True)
    for name in ("K", "k", "P", "p"):
        assert np.array_equal(head.work[name][:4], whole.work[name][:4])


def test_without_the_affine_part_the_dynamics_are_homogeneous() -> None:
    qp = free_program(shape(), 3)
    still, passes = StageQp(qp.shape, qp.buffer.copy()), Passes(qp)
    still.c[:] = 0.0
    plain = Passes(still)
    assert plain.run(still)
    assert factorise(qp.stages, passes.weights, passes.work, 6)
    sweep_back(qp.stages, passes.weights, passes.work, 6, False)
    steps = steps_of(qp.shape)
    steps["x"][0] = qp.x_first
    sweep_ahead(qp.stages, passes.work, steps, 0, 6, False)
    assert np.array_equal(steps["x"], plain.x)
    assert np.array_equal(steps["u"][:-1], plain.u)


def test_an_input_without_curvature_is_refused() -> None:
    qp = free_program(shape(), 3)
    qp.R[2], qp.B[2] = 0.0, 0.0
    assert not Passes(qp).run(qp)


def test_two_inputs_that_do_the_same_share_the_work() -> None:
    qp = free_program(StageShape(5, 3, 2, 0), 4)
    qp.B[:, :, 1] = qp.B[:, :, 0]
    qp.R[:] = 1e-15 * np.eye(2)  # what tells them apart is lost in rounding
    qp.r[:] = 0.0
    passes = Passes(qp)
    assert passes.run(qp)
    single = free_program(StageShape(5, 3, 1, 0), 4)
    for name in ("A", "c", "x_first", "Q", "q"):
        getattr(single, name)[:] = getattr(qp, name)
    single.B[:], single.R[:], single.r[:] = qp.B[:, :, :1], 5e-16, 0.0
    x, _, _ = linear_quadratic(single)
    assert np.max(np.abs(passes.x - x)) < 1e-6  # nothing holds the inputs back: gains are as large as the chain is stiff


def test_the_adjoint_makes_every_state_stationary() -> None:
    qp, random = random_program(shape(), 8), np.random.default_rng(2)
    point = StageSolution.empty(qp.shape)
    for part in PARTS:
        getattr(point, part)[:] = random.uniform(0.0, 1.0, getattr(point, part).shape)
    adjoint(qp.stages, qp.rows, qp.bounded, point.stages, point.row_points)
    inputs = qp.r + np.einsum("ijk,ik->ij", qp.R, point.u) + point.u_bounds - np.einsum("ikj,ik->ij", qp.B, point.dynamics[1:])
    qp.linear[:] = 1e3  # the rows' own condition is of no matter here
    assert residuals(qp, point).dual == pytest.approx(np.max(np.abs(inputs)), rel=1e-12)  # only inputs are left unbalanced


def test_compiled_kernels_do_what_their_python_says() -> None:
    qp = free_program(shape(rows=2, stages=3), 6)
    fast, slow = Passes(qp), Passes(qp)
    assert fast.run(qp)
    stages, weights, work, points = (array.view(np.recarray) for array in (qp.stages, slow.weights, slow.work, slow.point.stages))
    assert factorise.py_func(stages, weights, work, 3)  # type: ignore[attr-defined] # numba adds it
    sweep_back.py_func(stages, weights, work, 3, True)  # type: ignore[attr-defined]
    sweep_ahead.py_func(stages, work, points, 0, 3, True)  # type: ignore[attr-defined]
    for name in ("K", "L", "P", "p", "k"):
        assert np.allclose(fast.work[name], slow.work[name], rtol=1e-12, atol=1e-12)  # contracted multiply-adds
    assert np.allclose(fast.x, slow.x, rtol=1e-12, atol=1e-12)
    assert np.allclose(fast.u, slow.u, rtol=1e-12, atol=1e-12)
