"""How each library's own words and habits become the one protocol, and names that are misspelt or missing."""

import pickle
import subprocess
import sys
from collections.abc import Callable

import clarabel
import numpy as np
import osqp
import piqp
import pytest

from hdvplan.errors import SolverError
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, QpWorkspace, Status, residuals
from hdvplan.solvers import catalogue
from hdvplan.solvers import clarabel as clarabel_adapter
from hdvplan.solvers import osqp as osqp_adapter
from hdvplan.solvers import piqp as piqp_adapter
from hdvplan.solvers.clarabel import ClarabelWorkspace
from hdvplan.solvers.guards import hard_first
from hdvplan.solvers.osqp import OsqpWorkspace
from hdvplan.solvers.piqp import PiqpWorkspace
from hdvplan.solvers.registry import DEFAULT, settings_of, solver_infos, solver_named, tolerance_of
from tests.core.programs import random_program, shape
from tests.solvers.workspaces import optimum

ADAPTERS: list[Callable[..., QpWorkspace]] = [PiqpWorkspace, ClarabelWorkspace, OsqpWorkspace]
each_adapter = pytest.mark.parametrize("adapter", ADAPTERS, ids=lambda a: a.__name__)


def contradictory() -> StageQp:
    qp = random_program(shape(), 2)
    qp.G[3, 1], qp.h[3, 1] = -qp.G[3, 0], -qp.h[3, 0] - 1.0
    return qp


@each_adapter
def test_hard_rows_that_contradict_are_infeasible_and_elastic_ones_are_not(adapter: Callable[..., QpWorkspace]) -> None:
    qp = contradictory()
    hard = adapter(qp.shape, elastic=False).solve(qp, None)
    # PIQP's own detection is weak: it runs into its iteration limit as often
    assert hard.status in ({Status.INFEASIBLE, Status.ITERATION_LIMIT} if adapter is PiqpWorkspace else {Status.INFEASIBLE})
    assert adapter(qp.shape, elastic=True).solve(qp, None).status is Status.SOLVED


@each_adapter
def test_multipliers_carry_the_signs_of_the_lagrangian(adapter: Callable[..., QpWorkspace]) -> None:
    qp = random_program(shape(), 5, tightness=0.2)
    point = adapter(qp.shape, elastic=True).solve(qp, None).point
    judged = residuals(qp, point)
    assert judged.dual < 1e-4  # osqp stops at 1e-5 in its own scaling
    assert np.max(point.rows) > 0.1
    assert np.min(point.u_bounds) < -0.1 < 0.1 < np.max(point.u_bounds)


def test_every_word_of_piqp_is_understood() -> None:
    unsaid = {piqp.PIQP_UNSOLVED, piqp.PIQP_INVALID_SETTINGS}  # of a call that never ran
    words = {getattr(piqp, name) for name in dir(piqp) if name.startswith("PIQP_")}
    assert words - unsaid == set(piqp_adapter._STATUS)


def test_every_word_of_clarabel_is_understood() -> None:
    words = {name for name in dir(clarabel.SolverStatus) if not name.startswith("_")}
    assert words - {"Unsolved", "CallbackTerminated"} == set(clarabel_adapter._STATUS)


def test_every_word_of_osqp_is_understood() -> None:
    unsaid = {osqp.SolverStatus.OSQP_UNSOLVED, osqp.SolverStatus.OSQP_SIGINT}
    assert set(osqp.SolverStatus) - unsaid == set(osqp_adapter._STATUS)


@pytest.mark.parametrize("words", [piqp_adapter._STATUS, clarabel_adapter._STATUS, osqp_adapter._STATUS])
def test_only_a_full_solution_is_called_solved(words: dict[object, Status]) -> None:
    assert sum(status is Status.SOLVED for status in words.values()) == 1


def test_osqp_stops_at_its_iteration_limit_and_says_so() -> None:
    qp = random_program(shape(), 5, tightness=0.2)
    result = OsqpWorkspace(qp.shape, elastic=True, iterations=25).solve(qp, None)
    assert (result.status, result.iterations) == (Status.ITERATION_LIMIT, 25)


class Scripted:
    """A workspace that answers as it is told and counts how often it is asked."""

    name, starts_warm = "scripted", True

    def __init__(self, status: Status, point: StageSolution) -> None:
        """Remember the answer."""
        self.status, self.point, self.guesses = status, point, list[StageSolution | None]()

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Give it."""
        assert qp.shape.sizes[0] == len(self.point.u)
        self.guesses.append(guess)
        return QpResult(self.status, self.point, 7, 1.0, 2.0)


def two_sided(hard: Scripted, elastic: Scripted) -> tuple[QpWorkspace, list[bool]]:
    made: list[bool] = []

    def make(sizes: StageShape, columns: bool) -> QpWorkspace:
        assert sizes == shape()
        made.append(columns)
        return elastic if columns else hard

    return hard_first(make)(shape()), made


def exact(seed: int) -> StageQp:
    qp = random_program(shape(), seed)
    qp.linear[:], qp.quadratic[:] = 1e4, 0.0
    return qp


def test_where_hard_rows_can_be_kept_no_elastic_program_is_made() -> None:
    qp = exact(1)
    hard, elastic = Scripted(Status.SOLVED, optimum(qp)), Scripted(Status.SOLVED, StageSolution.empty(shape()))
    workspace, made = two_sided(hard, elastic)
    guess = StageSolution.empty(shape())
    for status in (Status.SOLVED, Status.INACCURATE):
        hard.status = status
        result = workspace.solve(qp, guess)
        assert (result.point is hard.point, result.iterations, result.solve_time) == (True, 7, 2.0)
    assert made == [False]
    assert hard.guesses == [guess, guess]
    assert (workspace.name, workspace.starts_warm) == ("scripted", True)


@pytest.mark.parametrize("status", [Status.INFEASIBLE, Status.ITERATION_LIMIT, Status.NUMERICAL, Status.FAILED])
def test_where_hard_rows_fail_the_elastic_program_is_solved_and_both_count(status: Status) -> None:
    qp = exact(1)
    hard, elastic = Scripted(status, optimum(qp)), Scripted(Status.SOLVED, StageSolution.empty(shape()))
    workspace, made = two_sided(hard, elastic)
    for _ in range(2):
        result = workspace.solve(qp, StageSolution.empty(shape()))
        assert result.point is elastic.point
        assert (result.iterations, result.update_time, result.solve_time) == (14, 2.0, 4.0)
    assert made == [False, True]  # the second is kept
    assert elastic.guesses == [None, None]  # a guess of the hard program is none of the other


@pytest.mark.parametrize("lie", [0.01, np.nan])
def test_a_claim_that_residuals_refute_counts_as_failure(lie: float) -> None:
    qp = exact(1)
    wrong = optimum(qp)
    wrong.x[3] += lie
    workspace, made = two_sided(Scripted(Status.SOLVED, wrong), Scripted(Status.SOLVED, optimum(qp)))
    assert residuals(qp, workspace.solve(qp, None).point).primal < 1e-6
    assert made == [False, True]


def test_rows_that_cost_nothing_at_first_are_elastic_from_the_start() -> None:
    qp = exact(1)
    qp.linear[2, 1], qp.quadratic[2, 1] = 0.0, 1.0
    hard = Scripted(Status.SOLVED, optimum(qp))
    workspace, made = two_sided(hard, Scripted(Status.SOLVED, optimum(qp)))
    workspace.solve(qp, None)
    assert made == [False, True]
    assert hard.guesses == []


def test_a_row_that_is_held_at_more_than_its_price_is_relaxed() -> None:
    qp = exact(1)
    dear = optimum(qp)
    dear.rows[2, 1] = 1.001 * qp.linear[2, 1]
    workspace, made = two_sided(Scripted(Status.SOLVED, dear), Scripted(Status.SOLVED, optimum(qp)))
    workspace.solve(qp, None)
    assert made == [False, True]


def test_without_rows_there_is_nothing_to_relax() -> None:
    sizes = StageShape(3, 2, 1, 0)
    failing = Scripted(Status.INFEASIBLE, StageSolution.empty(sizes))
    made: list[bool] = []

    def make(asked: StageShape, columns: bool) -> QpWorkspace:
        assert asked == sizes
        made.append(columns)
        return failing

    assert hard_first(make)(sizes).solve(StageQp.empty(sizes), None).status is Status.INFEASIBLE
    assert made == [False]


def test_the_default_comes_first_and_solves() -> None:
    assert solver_infos()[0].name == DEFAULT
    assert solver_named(DEFAULT)(shape()).solve(random_program(shape(), 1), None).status is Status.SOLVED


def test_every_installed_solver_can_be_made_under_its_own_name() -> None:
    for info in solver_infos():
        if info.version is None:
            with pytest.raises(SolverError, match="not installed"):
                solver_named(info.name)
            continue
        workspace = solver_named(info.name)(shape())
        assert workspace.name == info.name
        assert workspace.starts_warm is info.warm_start
        assert info.native is not info.name.startswith("qpsolvers/")


@pytest.mark.parametrize(
    ("asked", "meant"), [("piqpp", "piqp"), ("ricatti", "riccati"), ("OSQP", "osqp"), ("qpsolver/daqp", "qpsolvers/daqp"), ("gurobi", None)]
)
def test_an_unknown_name_is_met_with_the_nearest_or_with_all(asked: str, meant: str | None) -> None:
    with pytest.raises(SolverError) as caught:
        solver_named(asked)
    assert str(caught.value) == f"unknown solver {asked!r}"
    hint = caught.value.hint or ""
    assert hint == f"did you mean {meant!r}?" if meant else hint.startswith("solvers: riccati, riccati-ipm, riccati-warm, piqp")


def test_an_unknown_name_behind_qpsolvers_is_met_with_those_there_are() -> None:
    with pytest.raises(SolverError) as caught:
        solver_named("qpsolvers/gurobi")
    assert str(caught.value) == "unknown solver 'qpsolvers/gurobi'"
    assert "daqp" in (caught.value.hint or "")


def test_a_solver_that_is_not_installed_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    absent = catalogue.Generic("no-such-solver-here", "no_such_solver_here", "")
    monkeypatch.setitem(catalogue.GENERIC, "daqp", absent)
    (info,) = (info for info in solver_infos() if info.name == "qpsolvers/daqp")
    assert info.version is None
    with pytest.raises(SolverError, match="'qpsolvers/daqp' is not installed") as caught:
        solver_named("qpsolvers/daqp")
    assert caught.value.hint == "pip install no-such-solver-here"


def test_listing_solvers_loads_none_of_them() -> None:
    code = (
        "import sys; from hdvplan.solvers.registry import solver_infos, solver_named; solver_infos(); solver_named('riccati'); "
        "print([name for name in ('piqp', 'osqp', 'clarabel', 'qpsolvers') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603 - our own interpreter
    assert done.stdout.strip() == "[]"


_UNABLE = {"daqp", "qpsolvers/qpax", "qpsolvers/jaxopt_osqp"}  # an active set is exact; JAX compiles for seconds, and tells no iterations
_TUNED = [info.name for info in solver_infos() if info.version is not None and info.name not in _UNABLE and tolerance_of(info.name)]


@pytest.mark.parametrize("name", _TUNED)
def test_a_looser_tolerance_takes_fewer_iterations_and_leaves_more(name: str) -> None:
    qp = random_program(shape(), 1, tightness=0.2)
    usual, loose = (solver_named(name, tolerance)(shape()).solve(qp, None) for tolerance in (None, 1e-2))
    assert loose.iterations < usual.iterations
    assert max(residuals(qp, loose.point)) > max(residuals(qp, usual.point))


def test_a_solver_without_a_tolerance_refuses_one() -> None:
    names = {info.name for info in solver_infos() if info.version is not None}
    if "qpsolvers/quadprog" not in names:
        pytest.skip("quadprog is not installed")
    with pytest.raises(SolverError, match="no tolerance that could be set"):
        solver_named("qpsolvers/quadprog", 1e-3)


def test_settings_name_version_and_tolerance() -> None:
    assert settings_of("piqp").startswith("piqp 0.")
    assert ", tolerance 1e-08, sparse_ldlt_cond" in settings_of("piqp")
    assert settings_of("qpsolvers/osqp").endswith(", eps_abs 1e-05, eps_rel 0, max_iter 20000")
    assert settings_of("qpsolvers/clarabel").endswith(", defaults")


def test_what_makes_a_named_solver_pickles() -> None:
    solver = pickle.loads(pickle.dumps(solver_named("piqp", 1e-6)))  # noqa: S301 - our own
    assert solver == solver_named("piqp", 1e-6)
    assert solver(shape()).solve(random_program(shape(), 1), None).status is Status.SOLVED


@pytest.mark.parametrize(
    ("name", "constant", "words"),
    [
        ("hpipm", "_START", "mu0 {:g},"),
        ("acados", "_START", "mu0 {:g},"),
        ("daqp", "_ITERATIONS", "iter_limit {},"),
        ("proxqp", "_ITERATIONS", "max_iter {},"),
        ("osqp", "_ADAPTED", "every {} iterations"),
        ("clarabel", "_RELATIVE", "cost {:g} of it"),
    ],
)
def test_settings_name_the_constants_that_solvers_run_with(name: str, constant: str, words: str) -> None:
    module = pytest.importorskip(f"hdvplan.solvers.{name}")
    assert words.format(getattr(module, constant)) in settings_of(name)
