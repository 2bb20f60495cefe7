from __future__ import annotations

import multiprocessing.context
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from hdvplan.bench.measuring.courses import cases_of
from hdvplan.bench.measuring.run import Worker, remaining, run
from hdvplan.bench.measuring.samples import WRONG, Measurement, part_file, read_part
from hdvplan.bench.measuring.stats import tables_of
from hdvplan.bench.measuring.timing import untuned
from hdvplan.bench.measuring.tuning import tuned
from hdvplan.bench.suite import Suite, tuning_key
from hdvplan.qp.program import StageShape
from hdvplan.qp.workspace import QpWorkspace, WorkspaceMaker
from hdvplan.solvers.registry import SolverMaker, solver_named
from tests.fakes import Fake

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="ends processes by signals")
RICCATI = solver_named("riccati")


def measured(suite: Suite, makers: Mapping[str, WorkspaceMaker], out: Path, *, in_process: bool = False) -> list[list[Measurement]]:
    run(suite, cases_of(suite), makers, out, lambda _: None, in_process=in_process)
    assert remaining(suite, out) == 0
    return [[read_part(part_file(out, cell, round_)) for round_ in range(suite.rounds)] for cell in range(len(suite.cells()))]


def rows(suite: Suite, found: list[list[Measurement]]) -> dict[str, pd.Series[Any]]:
    timing = tables_of(suite.cells(), found).timing
    return {str(row["solver"]): row for _, row in timing.iterrows()}


@pytest.fixture
def tiny(tiny: Suite) -> Suite:
    return replace(tiny, schemes=("rti",))


@pytest.mark.slow
def test_hangs_and_crashes_are_rows_that_end_no_run_and_are_not_met_again_in_the_next_round(tiny: Suite, tmp_path: Path) -> None:
    suite = replace(tiny, solvers=("riccati", "piqp", "osqp", "clarabel"), step_limit=0.5)
    makers: dict[str, WorkspaceMaker]
    makers = {"riccati": RICCATI, "piqp": Fake("crashing"), "osqp": Fake("sleeping", honest=8), "clarabel": Fake("raising", honest=8)}
    began = time.monotonic()
    found = rows(suite, measured(suite, makers, tmp_path))
    # Two seconds for each of three processes, half for the one step that hangs; another round of it would double that.
    assert time.monotonic() - began < 60.0
    assert {name: row["status"] for name, row in found.items()} == {
        "riccati": "ok", "piqp": "crashed", "osqp": "out of time", "clarabel": "failed"
    }  # fmt: skip
    assert found["piqp"]["message"] == "the process ended with SIGSEGV in step 0"
    assert found["osqp"]["message"].endswith("took longer than 0.5 s")
    assert found["clarabel"]["message"] == "RuntimeError: no licence for this machine"
    assert [found[name]["success"] for name in ("riccati", "piqp", "osqp")] == [1.0, 0.0, 0.0]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux refuses memory by its data segment")
def test_a_solver_that_takes_too_much_memory_is_a_row(tiny: Suite, tmp_path: Path) -> None:
    suite = replace(tiny, solvers=("riccati", "piqp"), rounds=1, memory_limit=8.0)
    found = rows(suite, measured(suite, {"riccati": RICCATI, "piqp": Fake("greedy", honest=8)}, tmp_path))
    assert {name: row["status"] for name, row in found.items()} == {"riccati": "ok", "piqp": "out of memory"}


class Fatal:
    """A solver whose maker ends the process that receives it."""

    def __reduce__(self) -> tuple[Callable[[int], object], tuple[int]]:
        """Leave."""
        return os._exit, (3,)

    def __call__(self, shape: StageShape) -> QpWorkspace:
        """Make none."""
        raise NotImplementedError


def test_a_process_that_ends_before_its_first_cell_is_a_row(tiny: Suite, tmp_path: Path) -> None:
    found = rows(suite := replace(tiny, solvers=("piqp",), rounds=1), measured(suite, {"piqp": Fatal()}, tmp_path))
    assert found["piqp"]["message"] == "the process ended with code 3 in step 0"


CHEAT = """
import time
from hdvplan.solvers.riccati import RiccatiWorkspace
def slow():
    time.perf_counter = lambda began=time.perf_counter(): began
class Cheat(RiccatiWorkspace):
    def __init__(self, shape):
        super().__init__(shape)
        slow()
"""


@pytest.mark.slow
@pytest.mark.parametrize("more", ["", "slow()"])
def test_who_changes_the_clock_is_unfair_and_nobody_else(tiny: Suite, tmp_path: Path, more: str) -> None:
    (tmp_path / "mine.py").write_text(f"{CHEAT}{more}\n", encoding="utf-8")
    (tmp_path / "other.py").write_text(CHEAT.replace("        slow()\n", ""), encoding="utf-8")
    suite = replace(tiny, solvers=("riccati", *(f"{tmp_path / name}.py:Cheat" for name in ("mine", "other"))))
    found = rows(suite, measured(suite, {name: SolverMaker(name) for name in suite.solvers}, tmp_path / "out"))
    assert [row["status"] for row in found.values()] == ["ok", "unfair", "ok"]


@pytest.mark.parametrize(("error", "row"), [(RuntimeError("no main module"), None), (BrokenPipeError(), "while it was started")])
def test_a_process_that_cannot_be_started_hides_no_reason(
    tiny: Suite, monkeypatch: pytest.MonkeyPatch, error: Exception, row: str | None
) -> None:
    def start(_: object) -> None:
        raise error

    monkeypatch.setattr(multiprocessing.context.SpawnProcess, "start", start)
    suite = replace(tiny, solvers=("piqp",))
    with closing(Worker(suite, cases_of(suite), {"piqp": Fake("wrong")})) as worker:
        if row is None:
            with pytest.raises(RuntimeError, match="no main module"):
                worker(0, judged=True)
        else:
            assert row in worker(0, judged=True).message


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks for processes in /proc")
def test_a_killed_benchmark_leaves_no_process_behind(tmp_path: Path, short_road: str) -> None:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-m", "hdvplan", "bench", "--roads", short_road, "--vehicles", "bus", "--rounds", "400", "--horizon", "30"]
    with subprocess.Popen([*command, "--out", "run"], cwd=tmp_path, env=environment, stderr=subprocess.DEVNULL) as process:  # noqa: S603 - our own
        deadline = time.monotonic() + 300.0  # a second, on a machine of one's own
        while len(list((tmp_path / "run" / "parts").glob("*.npz"))) < 1 and time.monotonic() < deadline:
            time.sleep(0.02)
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text(encoding="utf-8").split()
        process.send_signal(signal.SIGKILL)
    assert children
    deadline = time.monotonic() + 30.0
    while any(Path("/proc", child).is_dir() for child in children) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not [child for child in children if Path("/proc", child).is_dir()]


def test_a_sample_of_programs_is_the_same_for_all_solvers_and_has_those_where_limits_bind(tiny: Suite, tmp_path: Path) -> None:
    suite = replace(tiny, classes=("off", "binding"), solvers=("riccati", "riccati-ipm"), sample=6, rounds=1)
    found = measured(suite, {name: solver_named(name) for name in suite.solvers}, tmp_path, in_process=True)
    tables = [one.table() for (one,) in found]
    assert [len(table) for table in tables] == [6] * 4
    assert [bool(table["binding"].any()) for table in tables] == [False, False, True, True]
    for one, other in (tables[:2], tables[2:]):
        pd.testing.assert_frame_equal(one[["step", "s_m", "binding", "scale"]], other[["step", "s_m", "binding", "scale"]])
        assert (other["distance_m"] < 1e-6).all()  # two methods at 1e-8, and what conditioning makes of that
        assert (other["cold_s"] > 0.0).all()
        assert other["iterations"].sum() > one["iterations"].sum()
    timing = tables_of(suite.cells(), found).timing
    assert list(timing["status"]) == ["ok"] * 4
    assert list(timing["limits"]) == ["off", "off", "binding", "binding"]


def test_an_honest_foreign_solver_of_a_sample_remembers_nothing(tiny: Suite, tmp_path: Path) -> None:
    suite = replace(tiny, solvers=("hdvplan.solvers.riccati:WarmWorkspace",), sample=6, rounds=1)
    found = measured(suite, {name: SolverMaker(name) for name in suite.solvers}, tmp_path, in_process=True)
    assert [row["status"] for row in rows(suite, found).values()] == ["ok"]


@pytest.mark.slow
def test_tolerances_are_as_loose_as_the_accuracy_in_metres_allows(tiny: Suite, tmp_path: Path) -> None:
    loose, tight = (replace(tiny, solvers=("riccati", "osqp"), sample=4, rounds=1, accuracy=accuracy) for accuracy in (1e-2, 1e-5))
    cases = cases_of(loose)
    first, second = (tuned(suite, cases, lambda _: None) for suite in (loose, tight))
    key = tuning_key("osqp", "as set")
    loosely, tightly = first[key], second[key]
    assert loosely is not None
    assert tightly is not None
    assert loosely > tightly
    makers: dict[str, WorkspaceMaker] = {name: Fake("raising") for name in tight.solvers}  # tuned ones take their places
    makers |= {name: solver_named(name.partition(",")[0], tolerance) for name, tolerance in second.items()}
    timing = tables_of(tight.cells(), measured(tight, makers, tmp_path, in_process=True), tight.accuracy).timing
    assert list(timing["status"]) == ["ok", "ok"]
    assert (timing["distance_m"] <= 2e-5).all()  # what the caption promises


def test_solvers_that_no_tolerance_brings_within_the_accuracy_are_named() -> None:
    suite = Suite(solvers=("riccati", "osqp"), classes=("off", "binding"), accuracy=1e-4)
    found = {tuning_key(name, limits): 1e-3 for name in suite.solvers for limits in suite.classes} | {tuning_key("osqp", "binding"): None}
    timing = pd.DataFrame({"limits": ["off", "binding", "binding"], "solver": ["osqp", "osqp", "riccati"], "status": ["ok", WRONG, WRONG]})
    assert untuned(suite, found, timing) == [
        "TUNING MISSED, limits binding: riccati at 0.001; more was measured than was tuned on: measure again with --accuracy 1e-05",
        "NOT TUNED, limits binding: osqp; no tolerance meets 0.0001 m, or the solver takes no tolerance",
    ]
    assert untuned(replace(suite, accuracy=None), {}, timing) == []


@pytest.mark.slow
def test_tolerances_of_drives_hold_on_drives(tmp_path: Path, short_road: str) -> None:
    """Recorded programs come with the reference's guesses, from which a loose tolerance looks accurate."""
    suite = Suite(("riccati",), ("bus",), (short_road,), ("rti",), classes=("binding",), rounds=1, accuracy=1e-4, horizon=30.0)
    tolerances = tuned(suite, cases_of(suite), lambda _: None)
    makers: dict[str, WorkspaceMaker] = {name: solver_named("riccati", tolerance) for name, tolerance in tolerances.items()}
    timing = tables_of(suite.cells(), measured(suite, makers, tmp_path, in_process=True), suite.accuracy).timing
    assert list(timing["status"]) == ["ok"]


def test_a_sample_gives_a_slow_solver_one_program_and_one_round(tiny: Suite, tmp_path: Path) -> None:
    suite = replace(tiny, solvers=("riccati", "piqp"), sample=4, rounds=3, budget=1e-3)
    makers: dict[str, WorkspaceMaker] = {"riccati": RICCATI, "piqp": Fake("slow")}
    found = measured(suite, makers, tmp_path, in_process=True)
    slow = [one.table() for one in found[1]]
    assert [len(table) for table in slow] == [1, 1, 1]
    pd.testing.assert_frame_equal(slow[0], slow[2], check_exact=True)
    timing = tables_of(suite.cells(), found).timing
    assert timing["status"].iloc[1] == "over budget"
    assert timing["message"].iloc[1].startswith("1 of 4 programs")
    assert timing["success"].iloc[1] == 1.0
