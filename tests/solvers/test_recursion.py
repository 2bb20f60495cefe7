"""The recursion against one dense solve of the same equations."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hdvplan.arrays import FloatArray
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import residuals
from hdvplan.solvers.riccati import adjoint
from tests.core.programs import PARTS, dense, random_program, shape
from tests.solvers.passes import factorise, gains, motion_of, plain_recursion, recursion_of, sweep_ahead, sweep_back, weights_of

many = settings(max_examples=100, deadline=None, derandomize=True)
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
        """Copy the weights."""
        self.work, self.weights, self.point = recursion_of(qp.shape), weights_of(qp), StageSolution.empty(qp.shape)
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
        if not factorise(qp, self.weights, self.work, last):
            return False
        sweep_ahead(qp, self.work, self.point.stages, 0, last)
        return True


Size = tuple[int, int, tuple[int, ...]]  # states, inputs and bounded states; one input and 3 to 6 states are unrolled in the core
SIZES: tuple[Size, ...] = (
    (1, 1, ()), (3, 2, ()), (4, 2, (1, 3)), (1, 2, ()), (3, 1, ()), (4, 1, (3,)), (5, 1, ()), (6, 1, (5,)), (7, 1, ()), (6, 3, ()),
)  # fmt: skip


@given(size=st.sampled_from(SIZES), stages=st.integers(1, 12), seed=st.integers(0, 10**6))
@many
def test_the_passes_solve_the_optimality_conditions(size: Size, stages: int, seed: int) -> None:
    states, inputs, bounded = size
    qp = random_program(StageShape(stages, states, inputs, 0, bounded), seed) if states > 1 else one_state(stages, inputs, seed)
    passes = Passes(qp)
    assert passes.run(qp)
    x, u, dynamics = linear_quadratic(qp)
    # rounding by the conditioning of random chains of a dozen stages
    near = 1e-8 * (1.0 + float(np.max(np.abs(dynamics))))
    assert np.max(np.abs(passes.x - x)) < near
    assert np.max(np.abs(passes.u - u)) < near
    adjoint(qp, passes.point)
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
        sweep_ahead(qp, parts.work, parts.point.stages, begin, end)
    assert np.array_equal(parts.x, whole.x)
    assert np.array_equal(parts.u, whole.u)


def test_a_head_ends_in_the_cost_to_go_of_the_tail() -> None:
    qp = free_program(shape(), 9)
    whole, head = Passes(qp), Passes(qp)
    assert whole.run(qp)
    head.weights["Q"][4], head.weights["q"][4] = whole.work["P"][4], whole.work["p"][4]
    assert factorise(qp, head.weights, head.work, 4)
    for name in ("K", "k", "P", "p"):
        assert np.array_equal(head.work[name][:4], whole.work[name][:4])


def test_without_the_affine_part_the_dynamics_are_homogeneous() -> None:
    qp = free_program(shape(), 3)
    still, passes = StageQp(qp.shape, qp.buffer.copy()), Passes(qp)
    still.c[:] = 0.0
    plain = Passes(still)
    assert plain.run(still)
    assert factorise(qp, passes.weights, passes.work, 6, affine=False)
    steps = motion_of(qp.shape)
    steps["x"][0] = qp.x_first
    sweep_ahead(qp, passes.work, steps, 0, 6, affine=False)
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
    imbalance = adjoint(qp, point)
    inputs = qp.r + np.einsum("ijk,ik->ij", qp.R, point.u) + point.u_bounds - np.einsum("ikj,ik->ij", qp.B, point.dynamics[1:])
    qp.linear[:] = 1e3  # the rows' own condition is of no matter here
    assert residuals(qp, point).dual == pytest.approx(np.max(np.abs(inputs)), rel=1e-12)  # only inputs are left unbalanced
    most = max(np.max(np.abs(point.dynamics[1:])), np.max(np.abs(point.u_bounds)), 1.0)
    assert imbalance == pytest.approx(np.max(np.abs(inputs)) / most, rel=1e-12)  # rounding


@given(size=st.sampled_from(SIZES[1:3] + SIZES[4:]), seed=st.integers(0, 10**6))
@many
def test_the_passes_do_what_their_matrices_say(size: Size, seed: int) -> None:
    states, inputs, bounded = size
    qp = free_program(StageShape(5, states, inputs, 2, bounded), seed)
    passes = Passes(qp)
    passes.weights["q"], passes.weights["R"] = 1.5 * passes.weights["q"], 2.0 * passes.weights["R"]  # not the program's own
    assert passes.run(qp)
    for own, twin in zip(passes.work[:-1], plain_recursion(qp, passes.weights), strict=True):
        for found, other in zip((own["P"], own["p"], *gains(own)), twin, strict=True):
            assert np.max(np.abs(found - other)) < 1e-11 * (1.0 + np.max(np.abs(other)))  # rounding, by inputs that cost half at least


def test_a_sweep_back_takes_other_gradients_with_the_same_factors() -> None:
    qp, random = free_program(shape(), 3), np.random.default_rng(4)
    swept, again = Passes(qp), Passes(qp)
    assert factorise(qp, swept.weights, swept.work, 6, affine=False)
    for name in ("q", "r"):
        swept.weights[name] = again.weights[name] = random.normal(size=swept.weights[name].shape)
    sweep_back(qp, swept.weights, swept.work, 6)
    assert factorise(qp, again.weights, again.work, 6, affine=False)
    for name in ("P", "p", "K", "k", "L"):
        assert np.allclose(swept.work[name], again.work[name], rtol=1e-12, atol=1e-12)  # contracted multiply-adds
