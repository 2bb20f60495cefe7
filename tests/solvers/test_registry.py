"""Names of solvers, and what happens when one is misspelt or missing."""

import pickle
import subprocess
import sys

import pytest

from hdvplan.errors import SolverError
from hdvplan.qp.workspace import Status, residuals
from hdvplan.solvers import catalogue
from hdvplan.solvers.registry import DEFAULT, settings_of, solver_infos, solver_named, tolerance_of
from tests.core.programs import random_program, shape


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
