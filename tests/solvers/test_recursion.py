"""The recursion's kernels against one dense solve of the same equations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.jit import FloatArray
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.residuals import residuals
from hdvplan.solvers.recursion import adjoint, factorise, sweep_ahead, sweep_back
from tests.core.chains import few
from tests.core.programs import dense, random_program, shape

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
        N, n, m = qp.shape.stages, qp.shape.states, qp.shape.inputs
        self.gain, self.root = np.zeros((N, m, n)), np.zeros((N, m, m))
        self.value, self.slope, self.feed = np.zeros((N + 1, n, n)), np.zeros((N + 1, n)), np.zeros((N, m))
        self.value[N], self.slope[N] = qp.Q[N], qp.q[N]
        self.x, self.u = np.zeros((N + 1, n)), np.zeros((N, m))
        self.x[0] = qp.x_first

    def run(self, qp: StageQp) -> bool:
        """Solve the program without inequalities."""
        N = qp.shape.stages
        if not factorise(qp.A, qp.B, N, qp.Q, qp.R, self.gain, self.root, self.value):
            return False
        sweep_back(qp.A, qp.B, qp.c, True, N, self.gain, self.root, self.value, qp.q, qp.r, self.slope, self.feed)
        sweep_ahead(qp.A, qp.B, qp.c, True, 0, N, self.gain, self.feed, self.x, self.u)
        return True


@given(states=st.integers(1, 6), inputs=st.integers(1, 3), stages=st.integers(1, 12), seed=st.integers(0, 10**6))
@few
def test_the_passes_solve_the_optimality_conditions(states: int, inputs: int, stages: int, seed: int) -> None:
    qp = random_program(StageShape(stages, states, inputs, 0), seed) if states > 1 else one_state(stages, inputs, seed)
    passes = Passes(qp)
    assert passes.run(qp)
    x, u, dynamics = linear_quadratic(qp)
    # rounding by the conditioning of random chains of a dozen stages
    near = 1e-8 * (1.0 + float(np.max(np.abs(dynamics))))
    assert np.max(np.abs(passes.x - x)) < near
    assert np.max(np.abs(passes.u - u)) < near
    found = np.zeros_like(dynamics)
    none, nothing = np.empty((stages, 0)), np.empty((stages, 0, states))
    adjoint(qp.A, qp.Q, qp.q, nothing, np.empty(0, np.int64), passes.x, none, none, found)
    assert np.max(np.abs(found - dynamics)) < near


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
        return float(0.5 * first @ passes.value[3] @ first + passes.slope[3] @ first)

    zero = rest(np.zeros(3))
    for first in np.random.default_rng(1).normal(size=(5, 3)):
        assert abs(rest(first) - zero - promised(first)) < 1e-10 * (1.0 + abs(zero))  # rounding


def test_sweeps_go_on_from_where_they_are_told_to() -> None:
    qp = free_program(shape(), 9)
    whole, parts = Passes(qp), Passes(qp)
    assert whole.run(qp)
    parts.gain, parts.feed = whole.gain, whole.feed
    for begin, end in ((0, 2), (2, 2), (2, 6)):
        sweep_ahead(qp.A, qp.B, qp.c, True, begin, end, parts.gain, parts.feed, parts.x, parts.u)
    assert np.array_equal(parts.x, whole.x)
    assert np.array_equal(parts.u, whole.u)


def test_a_head_ends_in_the_cost_to_go_of_the_tail() -> None:
    qp = free_program(shape(), 9)
    whole, head = Passes(qp), Passes(qp)
    assert whole.run(qp)
    head.value[4], head.slope[4] = whole.value[4], whole.slope[4]
    assert factorise(qp.A, qp.B, 4, qp.Q, qp.R, head.gain, head.root, head.value)
    sweep_back(qp.A, qp.B, qp.c, True, 4, head.gain, head.root, head.value, qp.q, qp.r, head.slope, head.feed)
    for name in ("gain", "feed", "value", "slope"):
        assert np.array_equal(getattr(head, name)[:4], getattr(whole, name)[:4])


def test_without_the_affine_part_the_dynamics_are_homogeneous() -> None:
    qp = free_program(shape(), 3)
    still, passes = StageQp(qp.shape, qp.buffer.copy()), Passes(qp)
    still.c[:] = 0.0
    plain = Passes(still)
    assert plain.run(still)
    assert factorise(qp.A, qp.B, 6, qp.Q, qp.R, passes.gain, passes.root, passes.value)
    sweep_back(qp.A, qp.B, qp.c, False, 6, passes.gain, passes.root, passes.value, qp.q, qp.r, passes.slope, passes.feed)
    sweep_ahead(qp.A, qp.B, qp.c, False, 0, 6, passes.gain, passes.feed, passes.x, passes.u)
    assert np.array_equal(passes.x, plain.x)


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
    for values in vars(point).values():
        values[:] = random.uniform(0.0, 1.0, values.shape)
    adjoint(qp.A, qp.Q, qp.q, qp.G, np.array(qp.shape.bounded_states), point.x, point.rows, point.x_bounds, point.dynamics)
    inputs = qp.r + np.einsum("ijk,ik->ij", qp.R, point.u) + point.u_bounds - np.einsum("ikj,ik->ij", qp.B, point.dynamics[1:])
    qp.linear[:] = 1e3  # the rows' own condition is of no matter here
    assert residuals(qp, point).dual == pytest.approx(np.max(np.abs(inputs)), rel=1e-12)  # only inputs are left unbalanced


def test_compiled_kernels_do_what_their_python_says() -> None:
    qp = free_program(StageShape(3, 3, 2, 2, (1,)), 6)
    fast, slow = Passes(qp), Passes(qp)
    assert fast.run(qp)
    assert factorise.py_func(qp.A, qp.B, 3, qp.Q, qp.R, slow.gain, slow.root, slow.value)  # type: ignore[attr-defined] # numba adds it
    sweep_back.py_func(qp.A, qp.B, qp.c, True, 3, slow.gain, slow.root, slow.value, qp.q, qp.r, slow.slope, slow.feed)  # type: ignore[attr-defined]
    sweep_ahead.py_func(qp.A, qp.B, qp.c, True, 0, 3, slow.gain, slow.feed, slow.x, slow.u)  # type: ignore[attr-defined]
    for name in ("gain", "root", "value", "slope", "feed", "x", "u"):
        assert np.allclose(getattr(fast, name), getattr(slow, name), rtol=1e-12, atol=1e-12)  # contracted multiply-adds
