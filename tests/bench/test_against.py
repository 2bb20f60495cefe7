"""Two programs measured in turns: with stand-ins for the processes, with a small repository, and once with the real thing."""

from __future__ import annotations

import gzip
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import pandas as pd
import pytest

from hdvplan.bench.comparing.against import SUITE, Contender, Listener, Settings, compared, measure_against
from hdvplan.bench.comparing.compare import Comparison
from hdvplan.bench.comparing.decision import GateVerdict, Rule
from hdvplan.bench.comparing.processes import Scratch, Started, Turns, scratch_folder, start
from hdvplan.bench.comparing.programs import Home, Program
from hdvplan.bench.comparing.work import SuiteWork, suite_entries, suite_text
from hdvplan.bench.suite import Suite, read_suite, suite_of
from hdvplan.cli.app import run
from hdvplan.errors import MeasurementError, OptionError
from tests.bench.conftest import Cli, git

ROOT = Path(__file__).parents[2]


@cache
def slowed(run: Path, factor: float) -> bytes:
    """Return the samples of a finished run, multiplied."""
    samples = pd.read_csv(run / "samples.csv.gz")
    return gzip.compress(samples.assign(total_s=factor * samples["total_s"]).to_csv(index=False).encode())


@dataclass(frozen=True)
class Recorded(Program):
    """Instead of measuring, leaves a copy of a finished run whose times are multiplied."""

    run: Path = Path()
    slow: float = 1.0
    diary: list[tuple[str, str]] = field(default_factory=list)
    slow_until: int = 99
    fails: str = "never"  # in which of its processes; all: in every one
    code: int = 1

    def start(self, command: Sequence[str], scratch: Scratch, home: Home, turns: Turns | None = None) -> Started:  # noqa: ARG002 - see ``Program``
        """Leave the run, and a process that has nothing to do."""
        out = Path(command[command.index("--out") + 1])
        self.diary.append((self.name, out.name))
        shutil.copytree(self.run, out)
        factor = self.slow if out.name.isdigit() and int(out.name) < self.slow_until else 1.0
        (out / "samples.csv.gz").write_bytes(slowed(self.run, factor))
        failing = f"import sys; sys.stderr.write('error: the licence has expired\\n'); sys.exit({self.code})"
        return start([sys.executable, "-c", failing if self.fails in {out.name, "all"} else ""], os.environ, scratch, turns=turns)


def measured(base: Program, new: Program, out: Path) -> Comparison:
    here, there = (Contender(program, SuiteWork(out / "suite.toml")) for program in (base, new))
    with scratch_folder() as scratch:
        return measure_against(
            here, there, Settings(Rule(), expect_changes=False, patience=0.0), out, scratch, Listener(lambda _: None, lambda _: None)
        )


@pytest.mark.slow
def test_a_fine_first_batch_is_enough_and_the_sides_take_turns_in_being_first(finished_run: Path, tmp_path: Path) -> None:
    diary: list[tuple[str, str]] = []
    base, new = (Recorded(name, Path(sys.executable), run=finished_run, diary=diary) for name in ("base", "new"))
    assert measured(base, new, tmp_path).verdict is GateVerdict.FINE
    assert [name for name, _ in diary] == ["base", "new"] + ["base", "new", "new", "base"] * 2 + ["base", "new"]
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == [f"{number:02d}" for number in range(5)]  # nothing of warming up


@pytest.mark.slow
def test_a_slowdown_is_repeated_before_it_is_red(finished_run: Path, tmp_path: Path) -> None:
    base = Recorded("base", Path(sys.executable), run=finished_run)
    comparison = measured(base, Recorded("new", Path(sys.executable), run=finished_run, slow=1.3), tmp_path)
    assert comparison.verdict is GateVerdict.REGRESSED
    assert comparison.processes == 10


@pytest.mark.slow
def test_an_earlier_comparison_is_replaced_but_nothing_else_is_deleted(finished_run: Path, tmp_path: Path) -> None:
    base, new = (Recorded(name, Path(sys.executable), run=finished_run) for name in ("base", "new"))
    for _ in range(2):
        assert measured(base, new, tmp_path).verdict is GateVerdict.FINE
    (tmp_path / "base" / "thesis.txt").write_text("irreplaceable", encoding="utf-8")
    with pytest.raises(OptionError, match="not of an earlier comparison"):
        measured(base, new, tmp_path)
    assert (tmp_path / "base" / "thesis.txt").exists()


@pytest.mark.parametrize("fails", ["warm", "00", "03"])
def test_a_new_program_that_fails_beside_a_base_that_does_not_is_red_with_its_last_words(
    finished_run: Path, tmp_path: Path, fails: str
) -> None:
    base = Recorded("base", Path(sys.executable), run=finished_run)
    comparison = measured(base, Recorded("new", Path(sys.executable), run=finished_run, fails=fails), tmp_path)
    assert comparison.verdict is GateVerdict.REGRESSED
    assert comparison.failure is not None
    assert comparison.failure.side == "new"
    assert comparison.failure.message == "new ended with 1 and says: the licence has expired"
    assert "the licence has expired" in comparison.failure.tail


def test_a_base_that_fails_alone_prevents_an_answer(finished_run: Path, tmp_path: Path) -> None:
    broken = Recorded("base", Path(sys.executable), run=finished_run, fails="all")
    comparison = measured(broken, Recorded("new", Path(sys.executable), run=finished_run), tmp_path)
    assert comparison.verdict is GateVerdict.UNMEASURABLE
    assert comparison.failure is not None
    assert comparison.failure.side == "base"


@pytest.mark.parametrize("code", [1, 2])
def test_what_neither_program_can_do_is_the_users_mistake(finished_run: Path, tmp_path: Path, code: int) -> None:
    base, new = (Recorded(name, Path(sys.executable), run=finished_run, fails="all", code=code) for name in ("base", "new"))
    with pytest.raises(OptionError, match=r"neither side can be measured: .*the licence has expired"):
        measured(base, new, tmp_path)


def test_a_suite_is_written_out_in_full_so_that_no_sides_defaults_count(tmp_path: Path) -> None:
    other = Suite().to_dict() | {"slack": 0.3, "objective": "lead-axle", "rounds": 9}  # another version's defaults
    names = ('a "road".csv', "\U00020bb7.csv", "a\x7fb.csv", "a\\b.csv")
    for entries in (dict(SUITE), {"limits": False, "horizon": 50.0}, {"roads": ("uturn", *names), "pinch": 0.3, "budget": 1.5}):
        wanted = suite_of(entries)
        (tmp_path / "suite.toml").write_text(suite_text(suite_entries(wanted, other)), encoding="utf-8")
        assert suite_of(other | read_suite(tmp_path / "suite.toml")) == wanted


def test_a_side_that_cannot_be_told_the_same_is_not_measured() -> None:
    known = {name: value for name, value in Suite().to_dict().items() if name != "pinch"}
    assert "pinch" not in suite_entries(Suite(), known)  # none is wanted, and it has none
    with pytest.raises(MeasurementError, match="knows no pinch"):
        suite_entries(Suite(pinch=0.5), known)
    with pytest.raises(MeasurementError, match="has half_width = 3"):
        suite_entries(Suite(), Suite().to_dict() | {"half_width": 3.0})


def test_outside_a_checkout_a_revision_is_refused_with_what_would_do(cli: Cli, short_road: str) -> None:
    outcome = cli("bench", "--against", "main", "--roads", short_road)
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err == (
        "error: 'main' names a revision, but this is not a git checkout\n"
        "hint: name a release (hdvplan==0.1.0), or the path of a Python that has one\n"
    )


@pytest.mark.parametrize("own", [False, True])
def test_in_a_checkout_of_others_hdvplan_is_not_compared_with_itself(cli: Cli, tmp_path: Path, short_road: str, *, own: bool) -> None:
    git(tmp_path, "init", "--quiet")
    git(tmp_path, "commit", "--quiet", "--allow-empty", "--message", "one")
    outcome = cli("bench", "--against", "HEAD", "--roads", short_road if own else "uturn")  # both sides read the road that is here
    assert (outcome.code, outcome.out) == (2, "")
    assert "is measured: this would compare hdvplan with itself" in outcome.err
    assert "hint: --against hdvplan==X " in outcome.err
    assert cli("bench", "--against", "", "--roads", "uturn").err.startswith("error: --against is empty\nhint: is the variable set")


@pytest.mark.parametrize("own", [False, True])
def test_revisions_of_hdvplan_are_compared_on_the_roads_that_are_here(
    cli: Cli, tmp_path: Path, short_road: str, monkeypatch: pytest.MonkeyPatch, *, own: bool
) -> None:
    monkeypatch.setattr("hdvplan.bench.comparing.against._compared", lambda *_: Comparison((), (), GateVerdict.FINE, 10))
    (tmp_path / "hdvplan").mkdir()
    (tmp_path / "hdvplan" / "__init__.py").touch()
    git(tmp_path, "init", "--quiet")
    git(tmp_path, "commit", "--quiet", "--allow-empty", "--message", "one")
    outcome = cli("bench", "--against", "HEAD", "--roads", short_road if own else "uturn")
    assert outcome.code == 0
    assert ("files of roads and vehicles are the working tree's on both sides\n" in outcome.err) == own


@pytest.mark.skipif(sys.platform == "win32", reason="a shell script stands in for an interpreter")
def test_a_base_that_cannot_run_ends_in_3(cli: Cli, tmp_path: Path, short_road: str) -> None:
    poor = tmp_path / "python-poor"
    poor.write_text('#!/bin/sh\necho "error: no space left on device" >&2\nexit 1\n', encoding="utf-8")
    poor.chmod(0o755)
    command = ("bench", "--against", str(poor), "--roads", short_road, "--vehicles", "bus", "--quiet", "--out", "gate")
    outcome = cli(*command)
    words = f"could not measure: {poor} cannot be started: its hdvplan says: no space left on device"
    assert (outcome.code, outcome.out.splitlines()[-1], outcome.err) == (3, words, "")
    answer = json.loads(cli(*command, "--json").out)
    assert (answer["verdict"], answer["failure"]["side"]) == ("could not measure", "base")
    assert json.loads((tmp_path / "gate" / "comparison.json").read_text(encoding="utf-8")) == answer
    annotated = cli(*command, "--format", "github").out
    assert annotated.startswith(f"::warning title=planning time::{words}")


@pytest.mark.slow
@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="needs a checkout")
def test_the_real_command_measures_the_head_against_the_working_tree(tmp_path: Path, short_road: str) -> None:
    small = ("--roads", short_road, "--vehicles", "bus", "--solvers", "riccati", "--schemes", "rti", "--horizon", "30")
    # A busy test machine must not turn this red: it asks for a factor of 10. That the gate finds smaller ones is shown elsewhere.
    command = [sys.executable, "-m", "hdvplan", "bench", "--against", "HEAD", *small, "--factor", "10", "--expect-changes"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    ended = subprocess.run(  # noqa: S603 - our own
        [*command, "--quiet", "--out", str(tmp_path / "out")], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.startswith("fine: ")
    assert run(["compare", str(tmp_path / "out" / "base"), str(tmp_path / "out" / "new"), "--factor", "10", "--expect-changes"]) == 0


def test_a_side_that_left_no_benchmark_that_can_be_read_is_one_that_failed(finished_run: Path, tmp_path: Path) -> None:
    for name in ("base", "new"):
        shutil.copytree(finished_run, tmp_path / name / "00")
    settings = Settings(Rule(), expect_changes=False)
    for name, verdict in (("new", GateVerdict.REGRESSED), ("base", GateVerdict.UNMEASURABLE)):
        (tmp_path / name / "00" / "samples.csv.gz").write_bytes(b"")
        comparison = compared(tmp_path, settings)
        assert comparison.failure is not None
        assert (comparison.verdict, comparison.failure.side) == (verdict, name)
