"""Terms that users write, in Python as docs/extending.md shows them, the same in C, and wrong in every way."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hdvplan
from hdvplan.cli.app import run
from hdvplan.errors import OptionError
from hdvplan.planning.objectives import Goal, geometric
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.balance import EnvelopeBalance
from hdvplan.planning.terms.centring import Centring, Residual
from hdvplan.planning.terms.term import Columns, CorePart, Scene, Term, core_functions
from hdvplan.vehicle.model import Vehicle
from tests.docs.blocks import blocks_of
from tests.fakes import Fake

BLOCKS = blocks_of((Path(__file__).parents[2] / "docs" / "extending.md").read_text(encoding="utf-8"))
(MODULE,) = (block.body for block in BLOCKS if block.body.startswith('"""Small articulation'))
SOURCE = Path(__file__).with_name("articulation.c")
CASE = hdvplan.Case(
    hdvplan.load_road("uturn").with_limits(2.2, 2.2),
    hdvplan.load_vehicle("semitrailer-active"),
    settings=hdvplan.PlannerSettings(horizon=40.0),
)


def with_term(term: Term) -> Callable[[Stations, Vehicle], Goal]:
    """Return the geometric objective with one term more."""
    return lambda stations, vehicle: Goal((*geometric(stations, vehicle).terms, term))


@pytest.fixture(scope="module")
def articulation() -> type:
    """Return the term of the page."""
    names: dict[str, Any] = {"__name__": __name__}
    exec(compile(MODULE, "articulation.py", "exec", dont_inherit=True), names)  # noqa: S102 - our own document
    found: type = names["Articulation"]
    return found


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
def test_a_term_in_c_plans_what_the_same_term_in_python_plans(articulation: type, tmp_path: Path) -> None:
    library, headers = tmp_path / "articulation.so", Path(hdvplan.__file__).parent / "core"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-shared", "-fPIC", f"-I{headers}"]
    subprocess.run(["cc", *flags, str(SOURCE), "-o", str(library)], check=True)  # noqa: S603, S607 - the compiler
    functions = core_functions("articulation", ctypes.CDLL(str(library)))

    class Compiled(articulation):  # type: ignore[misc] # made by the page
        def part(self, scene: Scene, columns: Columns) -> CorePart:  # noqa: ARG002 - a protocol's method
            return CorePart(scene, functions, np.array([(self.weight,)], [("weight", float)]))

    drives = [hdvplan.plan(replace(CASE, objective=with_term(term))).drive for term in (articulation(10.0), Compiled(10.0))]
    without = hdvplan.plan(CASE).drive
    assert abs(drives[0].z - without.z).max() > 1e-3  # the term changes the plan
    assert abs(drives[0].z - drives[1].z).max() < 1e-9  # sums in another order, over a drive's steps
    merits = [[plan.merit for plan in drive.plans if plan.merit is not None] for drive in drives]
    assert merits[0]  # limits bind: steps are judged by the price
    assert merits[0] == pytest.approx(merits[1], rel=1e-9)  # as above


WRONG = """
import numpy as np
from hdvplan.planning.objectives import Goal, geometric


class WrongPart(ArticulationPart):
    {of_part}


class Wrong(Articulation):
    def part(self, scene, columns):
        return {part}

    {of_term}


def wrong(stations, vehicle):
    return Goal((*geometric(stations, vehicle).terms, Wrong(10.0)))
"""
PART = "WrongPart(scene, self.weight)"
FAULTS = [  # what the part does, what it is, what the term does, and what is said
    ("pass", PART, "def needs(self, vehicle): raise RuntimeError('no\\nneeds')", "Wrong raises RuntimeError: no"),
    ("pass", PART, "def needs(self, vehicle): return 3", "Wrong raises TypeError: needs returned something of type int, not Needs"),
    ("pass", "None", "pass", "Wrong raises AttributeError: 'NoneType' object has no attribute 'memory'"),
    ("pass", "WrongPart(scene, 1.0, memory=(np.zeros((3, 2)),))", "pass", "Wrong raises ValueError: not a contiguous array of any kind"),
    ("pass", "WrongPart(scene, 1.0, violation='deep')", "pass", "WrongPart raises ValueError: could not convert string to float: 'deep'"),
    ("def extend(self, horizon, begin): return 1 / 0", PART, "pass", "WrongPart raises ZeroDivisionError: division by zero"),
    ("def extend(self, horizon, begin): return None", PART, "pass", "WrongPart raises TypeError: 'NoneType' object cannot be interpreted"),
    ("def price(self, horizon): return 'much'", PART, "pass", "WrongPart raises ValueError: could not convert string to float: 'much'"),
]


@pytest.mark.parametrize(("of_part", "part", "of_term", "words"), FAULTS)
def test_whatever_a_term_in_python_does_wrong_is_one_error(
    of_part: str, part: str, of_term: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(MODULE + WRONG.format(of_part=of_part, part=part, of_term=of_term), encoding="utf-8")
    arguments = ["--vehicle", "tractor-trailer", "--half-width", "2.2", "--horizon", "40", "--no-plot", "--out", "out"]
    assert run(["plan", "uturn", "--objective", "mine.py:wrong", *arguments]) == 2
    said = capfd.readouterr().err
    (line,) = (line for line in said.splitlines() if line.startswith("error: "))
    assert line.startswith(f"error: objective 'mine.py:wrong': term {words}")
    assert "Traceback" not in said
    assert "Exception ignored" not in said  # of what a callback returns


def test_coefficients_of_too_few_stations_are_refused() -> None:
    short = np.ones(3)
    words = r"^objective '.*with_term.*': a residual has one coefficient a station, in arrays of shape \(\d+,\), not \(3,\)"
    with pytest.raises(OptionError, match=words):
        hdvplan.plan(replace(CASE, objective=with_term(Centring(Residual(short, short, short)))))
    with pytest.raises(OptionError, match=r"not \(\), \(\), \(\)"):
        hdvplan.plan(replace(CASE, objective=with_term(Centring(Residual(1.0, 0.0, 0.0)))))  # type: ignore[arg-type] # what people write


@pytest.mark.parametrize("bias", [None, 0.1])  # a biased residual looks at the axle's place before the program does
@pytest.mark.parametrize("axle", [-2, 2, 1.5])
def test_an_axle_that_the_vehicle_does_not_have_is_refused(axle: float, bias: float | None) -> None:
    def objective(stations: Stations, vehicle: Vehicle) -> Goal:
        residual = Residual(stations.centring.lead, stations.centring.aux, stations.centring.target, axle)  # type: ignore[arg-type]
        return Goal((Centring(residual if bias is None else residual.about(stations, vehicle)),))

    with pytest.raises(OptionError, match=rf"axle {axle}: the vehicle has units 0 and 1"):
        hdvplan.plan(replace(CASE, objective=objective))


def test_an_aim_that_is_no_number_is_refused() -> None:
    def objective(stations: Stations, vehicle: Vehicle) -> Goal:  # noqa: ARG001 - every objective receives both
        own = stations.centring
        return Goal((EnvelopeBalance(Residual(own.lead, own.aux, own.target), np.nan * stations.bias),))

    with pytest.raises(OptionError, match="the aim of a balance is not finite"):
        hdvplan.plan(replace(CASE, objective=objective))


@pytest.mark.parametrize(
    ("weight", "solver", "words"),
    [
        (np.nan, "riccati", "the QP holds a value that is not finite in 'Q'"),
        (np.nan, "piqp", "the QP holds a value that is not finite in 'Q'"),
        (-100.0, "riccati", "its terms are not convex: Q has the eigenvalue -"),  # where piqp finds a point that is stationary
    ],
)
def test_an_objective_that_solvers_fail_at_is_named_and_no_solver_is_blamed(
    articulation: type, weight: float, solver: str, words: str
) -> None:
    with pytest.raises(OptionError, match=rf"^objective '.*', in the plan at s = \d+\.\d m: {words}") as raised:
        hdvplan.plan(replace(CASE, objective=with_term(articulation(weight)), solver=solver))
    assert "no solver" in str(raised.value.hint)


def test_a_solver_that_fails_at_a_convex_objective_of_one_s_own_is_rescued(articulation: type) -> None:
    found = hdvplan.plan(replace(CASE, objective=with_term(articulation(1.0)), solver=Fake("raising")))
    assert len(found.rescued) == len(found.drive.plans)
