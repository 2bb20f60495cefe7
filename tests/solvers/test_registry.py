"""Names of solvers, and what happens when one is misspelt or missing."""

import subprocess
import sys

import pytest

from hdvplan.errors import SolverError
from hdvplan.qp.workspace import Status
from hdvplan.solvers import registry
from hdvplan.solvers.registry import DEFAULT, solver_infos, solver_named
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
    ("asked", "meant"), [("piqpp", "piqp"), ("ricatti", "riccati"), ("OSQP", None), ("qpsolver/daqp", "qpsolvers/daqp"), ("gurobi", None)]
)
def test_an_unknown_name_is_met_with_the_nearest_or_with_all(asked: str, meant: str | None) -> None:
    with pytest.raises(SolverError) as caught:
        solver_named(asked)
    assert str(caught.value) == f"unknown solver {asked!r}"
    hint = caught.value.hint or ""
    assert hint == f"did you mean {meant!r}?" if meant else hint.startswith("solvers: riccati, piqp")


def test_an_unknown_name_behind_qpsolvers_is_met_with_those_there_are() -> None:
    with pytest.raises(SolverError) as caught:
        solver_named("qpsolvers/gurobi")
    assert str(caught.value) == "unknown solver 'qpsolvers/gurobi'"
    assert "daqp" in (caught.value.hint or "")


def test_a_solver_that_is_not_installed_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    absent = registry._Generic("no-such-solver-here", "no_such_solver_here", "")
    monkeypatch.setitem(registry._GENERIC, "daqp", absent)
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
