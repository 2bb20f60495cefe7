"""Our own solver: screening, the interior point around the recursion, and planning's programs."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan import core
from hdvplan.arrays import FloatArray
from hdvplan.bench.contract import distance
from hdvplan.driving.drive import drive
from hdvplan.errors import PlanError, QpDataError
from hdvplan.planning.objectives import geometric
from hdvplan.planning.settings import PlannerSettings
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import Status, residuals
from hdvplan.road.limits import Limits
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.solvers.clarabel import ClarabelWorkspace
from hdvplan.solvers.piqp import PiqpWorkspace
from hdvplan.solvers.riccati import RiccatiWorkspace, adjoint
from hdvplan.vehicle.load import load_vehicle
from tests.core.chains import few
from tests.core.programs import PARTS, Spy, copied, dense, random_program, shape
from tests.nightly import nightly
from tests.solvers.test_workspaces import MORE_SIZES, SIZES, shapes
from tests.solvers.workspaces import optimum

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


def test_a_guess_looks_at_no_status_that_it_has_not_written() -> None:
    qp = free_program(shape(rows=3), 1)
    workspace = RiccatiWorkspace(qp.shape)
    workspace._memory[core.record("hdv_solver").itemsize :] = 0xFF  # what another method, or nobody, has left there
    result = workspace.solve(qp, StageSolution.empty(qp.shape))
    assert (result.iterations, result.leaves_guess) == (1, False)  # no inequality is guessed to be active


@pytest.mark.parametrize("rows", [0, 3])
def test_a_program_whose_limits_are_far_is_its_linear_quadratic_problem_after_one_factorisation(rows: int) -> None:
    qp = free_program(shape(rows=rows), 1)
    result = RiccatiWorkspace(qp.shape).solve(qp, None)
    x, u, dynamics = linear_quadratic(qp)
    assert (result.status, result.iterations) == (Status.SOLVED, 1)
    assert np.allclose(result.point.x, x, rtol=0.0, atol=1e-11)  # rounding
    assert np.allclose(result.point.u, u, rtol=0.0, atol=1e-11)
    assert np.allclose(result.point.dynamics, dynamics, rtol=0.0, atol=1e-10)
    for values in (result.point.sigma, result.point.rows, result.point.x_bounds, result.point.u_bounds):
        assert not np.any(values)


def test_limits_that_are_touched_are_kept_and_those_that_are_broken_are_not_screened_away() -> None:
    qp = free_program(shape(), 1)
    x, _, _ = linear_quadratic(qp)
    qp.x_high[2, 1] = x[3, 3] + 1e-9
    assert RiccatiWorkspace(qp.shape).solve(qp, None).iterations == 1
    qp.x_high[2, 1] = x[3, 3] - 1e-3
    result = RiccatiWorkspace(qp.shape).solve(qp, None)
    assert result.iterations > 1
    assert abs(result.point.x[3, 3] - qp.x_high[2, 1]) < 1e-6  # 1e-8 by a multiplier of some hundredths
    assert result.point.x_bounds[2, 1] > 0.0


@pytest.mark.parametrize("where", [0, 1, 2, 3, 4, 5])
def test_one_broken_row_anywhere_leaves_the_rest_of_the_horizon_to_the_first_pass(where: int) -> None:
    qp = free_program(shape(), 1)
    qp.linear[:], qp.quadratic[:] = 1e3, 0.0
    x, _, _ = linear_quadratic(qp)
    qp.h[where, 1] = qp.G[where, 1] @ x[where + 1] - 0.2
    result = RiccatiWorkspace(qp.shape).solve(qp, None)
    assert result.status is Status.SOLVED
    assert distance(result.point, optimum(qp)) < 1e-6
    assert np.count_nonzero(result.point.rows > 1e-6) == 1


@pytest.mark.slow
@given(sizes=shapes(SIZES + MORE_SIZES), seed=st.integers(0, 10**6), tightness=st.floats(-0.5, 1.0), price=st.floats(-1.0, 5.0))
@few
def test_random_programs_are_solved_as_by_another_solver(sizes: StageShape, seed: int, tightness: float, price: float) -> None:
    qp = random_program(sizes, seed, tightness=tightness)
    qp.linear[:] *= 10.0**price
    qp.x_low[:], qp.x_high[:] = -30.0, 30.0
    result = RiccatiWorkspace(sizes).solve(qp, None)
    judged, other = residuals(qp, result.point), optimum(qp)
    # several inputs against as many active inequalities: what is left of their curvature drowns in the weights' rounding
    assert result.status in ({Status.SOLVED} if sizes.inputs == 1 else {Status.SOLVED, Status.INACCURATE})
    assert judged.primal < 1e-7
    # both are optimal to 1e-8 on the cost; a state that the cost hardly feels may differ by the root of that
    assert distance(result.point, other) < 1e-4 * (1.0 + float(np.max(np.abs(other.x))))


@pytest.mark.parametrize("price", [1e4, 1e6])
def test_large_multipliers_do_not_blunt_it(price: float) -> None:
    qp = random_program(shape(), 4, tightness=0.2)
    qp.linear[:], qp.quadratic[:] = price, 0.0
    qp.h[3] = qp.G[3] @ np.ones(4)
    qp.h[4, :2] = -3.0, 1.0  # some of these cannot be kept: their multipliers are the price
    result = RiccatiWorkspace(qp.shape).solve(qp, None)
    assert result.status is Status.SOLVED
    assert np.max(result.point.rows) == pytest.approx(price, rel=1e-6)
    assert distance(result.point, optimum(qp)) < 1e-5


def test_a_warm_start_ends_in_a_point_as_balanced_as_it_promises() -> None:
    quick = 0
    for seed in range(30):
        qp = random_program(shape(), seed, tightness=0.2)
        qp.x_low[:], qp.x_high[:] = -30.0, 30.0
        workspace = RiccatiWorkspace(qp.shape)
        cold = workspace.solve(qp, None)
        count, guess = cold.iterations, copied(cold.point)
        warm = workspace.solve(qp, guess)
        scale = max(1.0, float(np.max(np.abs(warm.point.dynamics))), float(np.max(np.abs(warm.point.u_bounds))))
        # stiff quadratics turn rounding into multipliers: beyond a millionth the interior point must find them
        assert residuals(qp, warm.point).dual < 1e-6 * scale
        assert np.min(warm.point.rows) >= 0.0
        quick += warm.iterations < count
    assert quick > 20


def test_a_wrong_guess_of_every_status_ends_in_the_same_point() -> None:
    for seed in range(12):
        qp = random_program(shape(), seed, tightness=0.3)
        qp.x_low[:], qp.x_high[:], qp.linear[:] = -30.0, 30.0, 50.0
        workspace, other = RiccatiWorkspace(qp.shape), optimum(qp)
        guess = copied(workspace.solve(qp, None).point)
        for rows, sigma, bounds in ((40.0, 0.0, 0.0), (60.0, 1.0, 0.0), (0.0, 0.0, 5.0), (40.0, 0.5, -5.0)):
            guess.rows[:], guess.sigma[:], guess.u_bounds[:], guess.x_bounds[:] = rows, sigma, bounds, 0.0
            found = workspace.solve(qp, guess)
            assert found.status is Status.SOLVED
            assert np.min(found.point.rows) >= 0.0
            assert residuals(qp, found.point).dual < 1e-5
            assert distance(found.point, other) < 1e-5


def test_of_a_run_of_broken_rows_the_deepest_are_enough() -> None:
    sizes = StageShape(60, 2, 1, 1)
    qp, ahead = StageQp.empty(sizes), np.arange(1.0, 61.0)
    qp.A[:], qp.B[:, 0, 0], qp.B[:, 1, 0], qp.R[:] = [[1.0, 1.0], [0.0, 1.0]], 0.5, 1.0, 100.0
    qp.Q[:, 0, 0], qp.q[:, 0], qp.G[:, 0, 0], qp.x_first[0] = 1.0, -1.0, 1.0, 1.0  # would stay at 1 ...
    qp.h[:, 0] = 1.0 - 0.4 * np.exp(-(((ahead - 30.0) / 5.0) ** 2))  # ... but must get round an obstacle
    qp.u_low[:], qp.u_high[:], qp.linear[:], qp.quadratic[:] = -1.0, 1.0, 1e4, 1e5
    workspace, guess = RiccatiWorkspace(sizes), StageSolution.empty(sizes)
    right = copied(workspace.solve(qp, None).point)
    guess.rows[50] = 1.0  # a guess that knows nothing of it
    found = workspace.solve(qp, guess)
    assert found.iterations == 5  # where all broken rows become active it never settles: 20 with the interior point
    assert residuals(qp, found.point).gap < 1e-9
    assert distance(found.point, right) < 1e-4  # of the interior point, whose products are 1e-8


def test_the_corrector_saves_factorisations() -> None:
    programs = [random_program(shape(), seed) for seed in range(30)]
    assert sum(RiccatiWorkspace(qp.shape).solve(qp, None).iterations for qp in programs) < 500  # measured: 460, without its product 585


def test_rows_that_cost_nothing_to_begin_with_start_with_multipliers_too() -> None:
    programs = [random_program(shape(), seed, tightness=0.2) for seed in range(30)]
    for qp in programs:
        qp.linear[:], qp.quadratic[:] = 0.0, 10.0
    assert sum(RiccatiWorkspace(qp.shape).solve(qp, None).iterations for qp in programs) < 550  # measured: 501, from zero 622


def test_a_starting_point_far_outside_its_bounds_comes_in() -> None:
    sizes = shape(rows=0, stages=30)
    qp = StageQp.empty(sizes)  # the bounded states and the first input alone are used
    qp.A[:, 1, 1], qp.A[:, 1, 3], qp.A[:, 3, 3], qp.B[:, 3, 0] = 1.2, 0.5, 1.1, 1.0
    qp.R[:], qp.q[:, 1] = 1e-3 * np.eye(2), -1.0  # runs away, and is paid for it
    qp.x_low[:], qp.x_high[:], qp.u_low[:], qp.u_high[:] = -1.0, 1.0, -2.0, 2.0
    result = RiccatiWorkspace(sizes).solve(qp, None)
    assert result.status is Status.SOLVED
    assert residuals(qp, result.point).primal < 1e-7
    assert distance(result.point, optimum(qp)) < 1e-6


def test_a_program_of_another_shape_is_refused() -> None:
    with pytest.raises(QpDataError, match="another shape"):
        RiccatiWorkspace(shape()).solve(random_program(shape(stages=7), 1), None)


def test_an_input_without_curvature_is_numerical_trouble() -> None:
    qp = random_program(shape(), 2)
    qp.R[3], qp.B[3] = 0.0, 0.0
    result = RiccatiWorkspace(qp.shape).solve(qp, None)
    assert (result.status, result.iterations) == (Status.NUMERICAL, 0)


def test_a_program_that_overflows_is_not_called_solved() -> None:
    qp = random_program(shape(), 2)
    qp.A[:] = 1e200
    result = RiccatiWorkspace(qp.shape).solve(qp, None)
    assert result.status is not Status.SOLVED
    assert not residuals(qp, result.point).primal <= 1e-3


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


# A bus needs 2.49 m on either side of this U-turn, a tractor-trailer 2.79 m.
COURSES = (("bus", 2.6), ("bus", 2.48), ("bus", 2.2), ("tractor-trailer", 2.9), ("tractor-trailer", 2.7))
PINCHED = (("bus", 3.2), ("tractor-trailer", 3.8))


def pinched(half_width: float) -> Road:
    """Return the U-turn with 1.5 m less on the right over six metres in its bend."""
    road = SCENARIOS["uturn"]()
    s = np.array([0.0, 89.75, 90.0, 96.0, 96.25, road.path.length])
    left = np.full(s.size, half_width)
    right = -left + 1.5 * np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
    return replace(road, limits=Limits(s, left, right, left, right))


def uturn(half_width: float) -> Road:
    """Return the U-turn of the first paper between parallel limits."""
    return SCENARIOS["uturn"]().with_limits(half_width, half_width)


def record(road: Road, vehicle: str, settings: PlannerSettings | None = None) -> list[StageQp]:
    """Return every program of a drive; one that ends early has recorded what it had to solve until there."""
    spy = Spy(RiccatiWorkspace)
    try:
        drive(road, load_vehicle(vehicle), geometric, spy, settings or PlannerSettings())
    except PlanError:
        assert spy.programs
    return spy.programs


@cache
def programs(vehicle: str, half_width: float, *, pinch: bool) -> list[StageQp]:
    return record(pinched(half_width) if pinch else uturn(half_width), vehicle)


EVERY = [(vehicle, half_width, pinch) for pinch, courses in ((False, COURSES), (True, PINCHED)) for vehicle, half_width in courses]
EACH = [course if course in {("bus", 2.2, False), ("tractor-trailer", 3.8, True)} else nightly(*course) for course in EVERY]


@pytest.mark.slow
@pytest.mark.parametrize(("vehicle", "half_width", "pinch"), EACH)
def test_on_recorded_drives_it_finds_what_piqp_finds(vehicle: str, half_width: float, pinch: bool) -> None:
    kept, witness, bound = None, None, 0
    for qp in programs(vehicle, half_width, pinch=pinch)[::5]:
        kept, witness = kept or RiccatiWorkspace(qp.shape), witness or PiqpWorkspace(qp.shape, elastic=True, tolerance=5e-9)
        mine, other = kept.solve(qp, None), witness.solve(qp, None)
        # less than 5e-9 cannot be asked of piqp: multipliers of 4e4 leave a dual residual of 4e-9, which is their rounding
        assert mine.status is other.status is Status.SOLVED
        assert residuals(qp, mine.point).primal < 1e-9
        # a product of 1e-8 leaves a bound with a multiplier of four thousandths 2.5 micrometres of slack
        assert np.max(np.abs(mine.point.x - other.point.x)) < 3e-6
        assert mine.iterations <= 40  # of 100; the most that these drives took was 30
        bound += bool(np.any(mine.point.rows > 1e-3))
    assert bound > 0 or half_width in {2.6, 2.9, 3.8}  # limits bind unless there is room


@pytest.mark.slow
@pytest.mark.parametrize(("vehicle", "half_width"), [nightly("bus", 1.5), ("tractor-trailer", 1.75)])
def test_a_horizon_of_eight_hundred_metres_is_solved_like_any_other(vehicle: str, half_width: float) -> None:
    s = np.arange(0.0, 901.0, 20.0)
    road = Road("long", from_curvature(s, 0.02 * np.sin(s / 37.0))).with_limits(half_width, half_width)
    asked = record(road, vehicle, PlannerSettings(horizon=800.0, replan=450.0))
    assert asked[0].shape.stages == 1600
    for qp in (asked[0], asked[-1]):
        mine = RiccatiWorkspace(qp.shape).solve(qp, None)
        # PIQP needs more iterations than it has. Multipliers of 1.5e4 leave Clarabel 1e-9 at best, where its last steps are rounding.
        other = ClarabelWorkspace(qp.shape, elastic=True, tolerance=1e-8).solve(qp, None)
        assert mine.status is other.status is Status.SOLVED
        assert np.count_nonzero(mine.point.rows > 1e-3) > 10
        assert np.max(np.abs(mine.point.x - other.point.x)) < 1e-5
