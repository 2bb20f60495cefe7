"""Solvers and objectives that users bring: named, as objects, offered by packages, and wrong in every way."""

import json
import pickle
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import hdvplan
from hdvplan import plugins
from hdvplan.cli.app import run
from hdvplan.errors import OptionError, SolverError
from hdvplan.planning.objectives import Goal, geometric, lead_axle, objective_named
from hdvplan.planning.stations import Stations
from hdvplan.plugins import identity_of, version_of
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, QpWorkspace
from hdvplan.record import record_of
from hdvplan.solvers.piqp import PiqpWorkspace
from hdvplan.solvers.registry import solver_infos, solver_named, tolerance_of
from hdvplan.vehicle.model import Vehicle
from tests.core.programs import random_program, shape

SOLVER = '''"""PIQP under another name."""
from hdvplan.solvers.piqp import PiqpWorkspace

class Mine(PiqpWorkspace):
    settings = "as PIQP"
'''
OBJECTIVE = '''"""As ``lead-axle``."""
from hdvplan.planning.objectives import lead_axle

def front(stations, vehicle):
    return lead_axle(stations, vehicle)
'''
CASE = hdvplan.Case(
    hdvplan.load_road("uturn").with_limits(4.0, 4.0), hdvplan.load_vehicle("bus"), settings=hdvplan.PlannerSettings(horizon=40.0)
)


@pytest.fixture(autouse=True)
def _in_a_folder_with_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(SOLVER, encoding="utf-8")
    Path("aims.py").write_text(OBJECTIVE, encoding="utf-8")


@pytest.fixture
def outsider(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Install a package with two entry points."""
    site = tmp_path / "site"
    (site / "outsider-3.1.dist-info").mkdir(parents=True)
    (site / "outsider.py").write_text(SOLVER + OBJECTIVE, encoding="utf-8")
    (site / "outsider-3.1.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: outsider\nVersion: 3.1\n", encoding="utf-8")
    points = "[hdvplan.solvers]\nhers = outsider:Mine\npiqp = outsider:Missing\n[hdvplan.objectives]\nfront = outsider:front\n"
    (site / "outsider-3.1.dist-info" / "entry_points.txt").write_text(points, encoding="utf-8")
    monkeypatch.syspath_prepend(str(site))
    yield
    sys.modules.pop("outsider", None)


@pytest.mark.parametrize("name", ["mine.py:Mine", "./mine.py:Mine", "hdvplan.solvers.piqp:PiqpWorkspace"])
def test_a_solver_is_found_by_file_or_module_and_takes_a_tolerance(name: str) -> None:
    qp = random_program(shape(), 1)
    workspace = solver_named(name, 1e-3)(shape())
    assert workspace.name == f"{name}(tolerance=0.001)"
    ours = solver_named("piqp", 1e-3)(shape()).solve(qp, None)
    assert np.array_equal(workspace.solve(qp, None).point.x, ours.point.x)
    assert tolerance_of(name) == tolerance_of("piqp")


def test_a_plan_with_a_solver_and_an_objective_from_files_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [
        "--solver",
        "mine.py:Mine",
        "--objective",
        "aims.py:front",
        "--half-width",
        "4",
        "--horizon",
        "40",
        "--no-plot",
        "--out",
        "out",
        "--json",
    ]
    assert run(["plan", "uturn", "--vehicle", "bus", *arguments]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["solver"], summary["objective"]) == ("mine.py:Mine", "aims.py:front")
    record = json.loads(Path("out/run.json").read_text(encoding="utf-8"))
    assert record["cases"][0]["solver"] == "mine.py:Mine"
    assert {"mine.py:Mine", "aims.py:front"} <= set(record["software"]["packages"])
    ours = hdvplan.plan(replace(CASE, objective="lead-axle", solver="piqp"))
    assert summary["max_left_m"] == ours.balance.max_left


@pytest.mark.usefixtures("outsider")
def test_what_an_installed_package_offers_is_listed_and_planned_with(capsys: pytest.CaptureFixture[str]) -> None:
    (info,) = (info for info in solver_infos() if info.name == "hers")
    assert (info.version, info.note) == ("3.1", "offered by outsider:Mine")
    assert "outsider" not in sys.modules  # until it is asked for
    assert sum(info.name == "piqp" for info in solver_infos()) == 1  # our own names stay ours
    result = hdvplan.plan(replace(CASE, solver="hers", objective="front"))
    assert (result.solver, result.objective) == ("hers", "front")
    packages = record_of([result.case])["software"]
    assert isinstance(packages, dict)
    assert packages["packages"]["hers"] == packages["packages"]["front"] == "3.1"
    assert run(["solvers"]) == 0
    assert "hers" in capsys.readouterr().out
    with pytest.raises(SolverError, match="unknown solver") as caught:
        solver_named("herss")
    assert caught.value.hint == "did you mean 'hers'?"
    with pytest.raises(OptionError, match="unknown objective") as unknown:
        objective_named("fronts")
    assert unknown.value.hint == "did you mean 'front'?"


BROKEN = """
class Raises:
    name, starts_warm = "r", False
    def __init__(self, shape):
        raise RuntimeError("no licence\\nfor this machine")
    def solve(self, qp, guess): ...

class Lacks:
    def __init__(self, shape): ...

class NoMethod(Lacks):
    name, starts_warm, solve = "m", False, 3

class Late(Lacks):
    name, starts_warm = "l", False
    def solve(self, qp, guess):
        return 1 / 0

class Nothing(Late):
    def solve(self, qp, guess): ...

THING = 3
def nothing(stations, vehicle): ...
def late(stations, vehicle):
    return 1 / 0
"""
WRONG = [
    ("--solver", "broken.py:Raises", 2, "cannot be made: RuntimeError: no licence"),
    ("--solver", "broken.py:Lacks", 2, "is no QpWorkspace: AttributeError"),
    ("--solver", "broken.py:NoMethod", 2, "solve is no method"),
    ("--solver", "broken.py:THING", 2, "cannot be called: it is of type int"),
    ("--solver", "broken.py:Absent", 2, "has no Absent\nhint: it has Raises, Lacks, NoMethod, Late, Nothing, ..."),
    ("--solver", "broken.py:LATER", 2, "has no LATER\nhint: did you mean 'Late' or 'late'?"),
    ("--solver", "broken.py", 2, "hint: name the solver in the file, too: broken.py:NAME"),
    ("--objective", "broken.py", 2, "hint: name the objective in the file, too: broken.py:NAME"),
    ("--solver", "absent.py:X", 2, "cannot be loaded: there is no file 'absent.py'"),
    ("--solver", "absent.package:X", 2, "cannot be loaded: ModuleNotFoundError"),
    ("--solver", "syntax.py:X", 2, "cannot be loaded: SyntaxError"),
    ("--solver", "exits.py:X", 2, "cannot be loaded: SystemExit: 3"),
    ("--objective", "broken.py:nothing", 2, "returns something of type NoneType, not a Goal"),
    ("--objective", "broken.py:late", 2, "raises ZeroDivisionError"),
    ("--objective", "absent.package:x", 2, "cannot be loaded: ModuleNotFoundError"),
]


@pytest.mark.parametrize(("option", "name", "code", "said"), WRONG, ids=lambda value: str(value).partition(" ")[0])
def test_another_s_mistake_is_one_line(option: str, name: str, code: int, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("broken.py").write_text(BROKEN, encoding="utf-8")
    Path("syntax.py").write_text("class X(:\n", encoding="utf-8")
    Path("exits.py").write_text("raise SystemExit(3)\n", encoding="utf-8")
    assert run(["plan", "uturn", "--vehicle", "bus", "--horizon", "40", "--no-plot", "--quiet", "--out", "out", option, name]) == code
    told = capsys.readouterr().err
    assert re.match(f"error: (unknown )?{option.removeprefix('--')} {name!r}", told)
    assert said in told
    assert len(told.splitlines()) <= 2


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Late", "raises ZeroDivisionError: division by zero"),
        ("Nothing", "returns something of type NoneType, not a QpResult"),
    ],
)
def test_a_plan_survives_another_s_solver_and_says_so(name: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("broken.py").write_text(BROKEN, encoding="utf-8")
    asked = f"broken.py:{name}"
    assert run(["plan", "uturn", "--vehicle", "bus", "--horizon", "40", "--no-plot", "--out", "out", "--solver", asked]) == 0
    (warning,) = [line for line in capsys.readouterr().err.splitlines() if asked in line]
    assert warning.startswith(f"warning: {asked} failed in 35 of 35 planning steps, first at s = 0.0 m: solver {asked!r} {said}")
    assert warning.endswith("; solved by riccati")


def middle(stations: Stations, vehicle: Vehicle, weight: float = 0.5) -> Goal:
    """Centre a point between a bus's axles: an objective in a module."""
    assert 0.0 <= weight <= 1.0
    return geometric(stations, vehicle)


@dataclass(frozen=True)
class Weighted:
    """An objective that is an object."""

    weight: float

    def __call__(self, stations: Stations, vehicle: Vehicle) -> Goal:
        """Return the goal."""
        return middle(stations, vehicle, self.weight)


def test_a_case_takes_objects_pickles_and_has_a_key() -> None:
    case = replace(CASE, objective=middle, solver=PiqpWorkspace)
    assert (case.objective_name, case.solver_name) == ("tests.test_plugins:middle", "hdvplan.solvers.piqp:PiqpWorkspace")
    again = pickle.loads(pickle.dumps(case))  # noqa: S301 - our own
    assert again == case
    result, named = hdvplan.plan(again), hdvplan.plan(replace(CASE, solver="piqp"))
    assert np.array_equal(result.drive.z, named.drive.z)
    assert case.described()["solver"] == case.solver_name
    assert hdvplan.summary_of(result)["objective"] == "tests.test_plugins:middle"


def test_a_key_tells_what_is_brought_by_its_content() -> None:
    from_file = replace(CASE, solver="mine.py:Mine")
    before, here = from_file.key, replace(CASE, solver=str(Path("mine.py").resolve()) + ":Mine").key
    assert before == here  # wherever the file lies
    Path("mine.py").write_text(SOLVER + "# changed\n", encoding="utf-8")
    assert replace(from_file).key != before
    objects: list[Callable[[Stations, Vehicle], Goal]] = [
        middle, lead_axle, partial(middle, weight=0.2), partial(middle, weight=0.3), Weighted(0.2), Weighted(0.3)
    ]  # fmt: skip
    assert len({replace(CASE, objective=one).key for one in objects}) == len(objects)
    assert replace(CASE, solver=hdvplan.solver("piqp")).key == replace(CASE, solver="piqp").key
    assert replace(CASE, solver=hdvplan.solver("piqp", 1e-5)).key != replace(CASE, solver="piqp").key
    assert replace(CASE, objective=partial(middle, weight=0.2)).objective_name == "tests.test_plugins:middle(weight=0.2)"


def test_a_key_is_refused_where_it_could_not_tell_objects_apart() -> None:
    def inner(stations: Stations, vehicle: Vehicle) -> Goal:
        return geometric(stations, vehicle)

    with pytest.raises(OptionError, match="defined inside a function"):
        _ = replace(CASE, objective=inner).key
    assert hdvplan.plan(replace(CASE, objective=inner)).status == "ok"  # planning needs none


def test_a_file_is_executed_once_for_each_content() -> None:
    first = solver_named("mine.py:Mine").loaded()
    assert first is not None
    kinds = [type(solver_named("mine.py:Mine")(shape())) for _ in range(2)]
    assert kinds[0] is kinds[1]
    Path("mine.py").write_text(SOLVER.replace("as PIQP", "changed"), encoding="utf-8")
    assert sum(name.startswith("hdvplan_file_mine_") for name in sys.modules) >= 1
    assert solver_named("mine.py:Mine")(shape()).solve(random_program(shape(), 1), None).iterations > 0


class Own:
    """A workspace that is told by no name."""

    name, starts_warm = "own", False

    def __init__(self, sizes: StageShape) -> None:
        """Keep one of ours."""
        self._ours: QpWorkspace = solver_named("riccati")(sizes)

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve as ours."""
        return self._ours.solve(qp, guess)


def test_what_a_workspace_returns_must_have_the_program_s_shape() -> None:
    class Small(Own):
        def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
            return super().solve(qp, guess)._replace(point=StageSolution.empty(StageShape(1, 1, 1, 0)))

    class Scattered(Own):
        def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
            result = super().solve(qp, guess)
            return result._replace(point=StageSolution(np.repeat(result.point.stages, 2)[::2], result.point.row_points))

    for kind in (Small, Scattered):  # the core needs numbers that lie together
        with pytest.raises(SolverError, match="a point of another shape"):
            solver_named(kind)(shape()).solve(random_program(shape(), 1), None)


def test_a_file_imports_what_lies_beside_it_and_the_path_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was told to put its folder into PYTHONPATH; its neighbour was no part of what it is."""
    monkeypatch.setattr(sys, "path", [entry for entry in sys.path if entry])  # where this folder is not
    files = {"a": "VALUE = 1", "b": "VALUE = 2"}
    for folder, text in files.items():
        Path(folder).mkdir()
        Path(folder, "its_neighbour.py").write_text(text, encoding="utf-8")
        Path(folder, "mine.py").write_text(f"# {folder}\nfrom its_neighbour import VALUE\ndef mine(): return VALUE", encoding="utf-8")
    before, ways = [*sys.path], [*sys.meta_path]
    loaded = plugins.load(plugins.OBJECTIVE, "a/mine.py:mine")
    assert loaded is not None
    assert loaded() == 1
    with pytest.raises(OptionError, match=r"imports its_neighbour.* of .*/a, not .*/b: give one of them another name"):
        plugins.load(plugins.OBJECTIVE, "b/mine.py:mine")
    sys.modules.pop("its_neighbour")
    assert (sys.path, sys.meta_path) == (before, ways)
    kinds = set()
    for value in ("3", "4"):
        Path("b/its_neighbour.py").write_text(f"VALUE = {value}", encoding="utf-8")
        plugins._digest_of_package.cache_clear()
        kinds.add((identity_of("b/mine.py:mine"), version_of(plugins.OBJECTIVE, "b/own_of_mine.py:mine")))
    assert len(kinds) == 2


def test_what_a_file_imports_is_part_of_what_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A study kept its cells, and a benchmark its run, when a module beside the plugin changed."""
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "own_package").mkdir()  # without __init__.py
    texts = {"own": "import json, numpy, own_helper, __main__, gone", "own_helper": "import own_package", "own_package/part": "X = 1"}
    for name, text in texts.items():
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    kinds, reference = set(), f"{tmp_path}/own.py:mine"
    for file in ("own", "own_helper", "own_package/part", "own_package/other"):
        plugins._digest_of_package.cache_clear()
        kinds.add((identity_of(reference), identity_of("own_helper:mine"), version_of(plugins.SOLVER, reference)))
        with (tmp_path / f"{file}.py").open("a", encoding="utf-8") as written:
            written.write("\nY = 2\n")
    plugins._digest_of_package.cache_clear()
    kinds.add((identity_of(reference), identity_of("own_helper:mine"), version_of(plugins.SOLVER, reference)))
    assert len({one for one, _, _ in kinds}) == len({one for _, _, one in kinds}) == 5
    assert len({one for _, one, _ in kinds}) == 4  # of which the file itself is no part
