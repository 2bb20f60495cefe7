"""A command of one's own is timed: the protocol, and whole comparisons of a small repository that has never heard of hdvplan."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from hdvplan.bench.comparing.against import REPORTS
from hdvplan.bench.comparing.compare import Comparison, compare
from hdvplan.bench.comparing.counters import Tolerance
from hdvplan.bench.comparing.decision import GateVerdict, Rule
from hdvplan.bench.comparing.processes import Ended
from hdvplan.bench.comparing.programs import Program, ProgramError, UnreachedError
from hdvplan.bench.comparing.sides import Side, own_changes, own_name, read_side
from hdvplan.bench.comparing.words import verdict_line
from hdvplan.bench.comparing.work import CommandWork, SuiteWork, command_words, steps_of
from hdvplan.errors import OptionError
from hdvplan.machine import machine_facts, machine_words
from tests.bench.conftest import Cli, git
from tests.docs.blocks import blocks_of
from tests.nightly import nightly

OURS = """
import json, random
random.seed()
steps = [[{slow} * (1 + number % 5) * 1e-5 * random.uniform(1.0, 1.002) for number in range(40)] for _ in range(3)]
print("some noise before")
about = {{"steps_s": steps, "s_m": [5.0 * i for i in range(40)], "counters": {{"iterations": {iterations}}}}}
print(json.dumps({{"cells": {{"depot": about}}}}))
"""


def test_the_least_is_a_list_of_times() -> None:
    (cell,) = steps_of({"cells": {"depot": [0.001, 0.002]}}).values()
    assert cell.steps.shape == (1, 2)
    assert cell.first.shape == (0,)


@pytest.mark.parametrize(
    "told",
    [
        {}, [], {"cells": {}}, {"cells": {"a": []}}, {"cells": {"a": [0.0]}}, {"cells": {"a": [-1.0]}}, {"cells": {"a": ["x"]}},
        {"cells": {"a": [[1.0], [1.0, 2.0]]}}, {"cells": {"a": [float("nan")]}}, {"cells": {"a": {"steps_s": [1.0], "s_m": [1.0, 2.0]}}},
        {"cells": {"a": {"steps_s": [1.0], "counters": 3}}}, {"cells": {"a": {"steps_s": None}}}, {"cells": {"a": [[[1.0]]]}},
        {"cells": {"a": [1.0, 1e-300]}}, {"benchmarks": []}, {"benchmarks": [{}]}, {"benchmarks": [{"fullname": "a", "stats": {}}]},
        {"benchmarks": ["a"]},
    ],
)  # fmt: skip
def test_what_is_no_list_of_times_is_refused(told: object) -> None:
    with pytest.raises(ValueError, match=r"."):
        steps_of(told)


@pytest.mark.parametrize(
    ("cell", "words"),
    [
        ({"steps_s": [1.0], "counter": {}}, "'counter' is none of"), ({"step_s": [1.0]}, "'step_s' is none"),
        ([[1.0], [1.0, 2.0]], "a: steps_s has rounds of 1 and of 2 steps"),
    ],
)  # fmt: skip
def test_a_cell_that_could_be_read_in_part_only_is_refused_with_what_is_wrong(cell: object, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        steps_of({"cells": {"a": cell}})


@pytest.mark.parametrize(
    "printed",
    [
        "", "hello\n", "{]\n", '{"cells": {"a": [0]}}\n', '{"cells": {"a": [1]}}\nhello\n', '{"cells": {"a": [1' + "0" * 400 + "]}}",
        '{"cells": {"a": {"steps_s": [1], "counters": {"gap": NaN}}}}\n', pytest.param('{"cells": ' + "[" * 100_000, id="nested"),
    ],
)  # fmt: skip
def test_a_command_that_prints_no_times_is_a_failed_program(printed: str, tmp_path: Path) -> None:
    with pytest.raises(ProgramError, match="ours prints no planning times") as caught:
        CommandWork(("ours",)).keep(Ended(0, printed, ""), tmp_path / "00")
    assert "steps_s" in str(caught.value.hint)
    assert len(caught.value.tail) < 300  # a comment quotes it; such a line may be kilobytes


def test_times_in_milliseconds_are_refused_as_more_than_the_process_ran(tmp_path: Path) -> None:
    for steps, ran in (([0.01, 0.01], 0.03), ([10.0, 10.0], 0.5)):
        ended = Ended(0, json.dumps({"cells": {"a": steps}}), "", {"ran_s": ran})
        with nullcontext() if steps[0] < ran else pytest.raises(ProgramError, match=r"add up to 20 s, and it ran for 0\.5 s: are they in"):
            CommandWork(("ours",)).keep(ended, tmp_path / "00")


@pytest.mark.parametrize(
    "printed",
    [
        '{"level": "info"}\n{"cells": {"a": [0.001]}}\n',
        "loading {\n" + '{"cells": {"a": [0.001]}}',
        '{\n "cells": {\n  "a": [0.001]\n }\n}\n',
    ],
)
def test_the_last_line_counts_whatever_a_log_says_before_and_json_may_have_several_lines(printed: str, tmp_path: Path) -> None:
    CommandWork(("ours",)).keep(Ended(0, printed, ""), tmp_path / "00")
    assert json.loads((tmp_path / "00" / "steps.json").read_text(encoding="utf-8")) == {"cells": {"a": [0.001]}}


PYTEST_BENCHMARK = {  # what --benchmark-json writes, without what describes the machine
    "benchmarks": [{"name": "test_depot", "fullname": "bench/test_plan.py::test_depot", "stats": {"min": 0.001, "data": [0.002, 0.001]}}]
}


def test_a_report_of_pytest_benchmark_is_read_from_the_file_that_the_command_names(tmp_path: Path) -> None:
    work, out = CommandWork(("pytest", "--benchmark-json={json}")), tmp_path / "00"
    _, option = work.command(Program("new"), out, warm=False)
    Path(option.partition("=")[2]).write_text(json.dumps(PYTEST_BENCHMARK, indent=4), encoding="utf-8")
    work.keep(Ended(0, "1 passed", ""), out)
    times = read_side(out).processes[0][own_name("bench/test_plan.py::test_depot")].total
    assert times.tolist() == [[0.002], [0.001]]  # two rounds of one step
    with pytest.raises(ProgramError, match="prints no planning times"):
        work.keep(Ended(0, "no tests ran", ""), out)  # the file is gone: it was of the run before


def test_two_reports_of_pytest_benchmark_are_compared(cli: Cli, tmp_path: Path) -> None:
    for name, slow in (("base", 1.0), ("same", 1.01), ("new", 2.0)):
        stats = {"data": [slow * (1e-3 + 1e-6 * (number % 7)) for number in range(50)]}
        (tmp_path / f"{name}.json").write_text(json.dumps({"benchmarks": [{"fullname": "depot", "stats": stats}]}), encoding="utf-8")
    base, same, new = (str(tmp_path / f"{name}.json") for name in ("base", "same", "new"))
    assert cli("compare", base, same, "--quiet").code == 0
    outcome = cli("compare", base, new, "--quiet")
    assert (outcome.code, outcome.out.split(";")[0]) == (3, "could not measure: 1 of 1 cells took longer, most depot: 2.00 times as long")


def side(*cells: dict[str, object], spent: Mapping[str, object] | None = None) -> Side:
    """Return a side of processes that told these cells, and took so much."""
    with tempfile.TemporaryDirectory() as name:
        for number, cell in enumerate(cells):
            folder = Path(name) / f"{number:02d}"
            folder.mkdir()
            (folder / "steps.json").write_text(json.dumps({"cells": {"depot": cell}}), encoding="utf-8")
            (folder / "process.json").write_text(json.dumps(dict(spent or {})), encoding="utf-8")
        return read_side(Path(name))


def told_steps(count: int = 10, slow: float = 1.0, **others: object) -> dict[str, object]:
    return {"steps_s": [[slow * 1e-3] * count] * 2, "s_m": [5.0 * step for step in range(count)], **others}


@pytest.mark.parametrize(
    ("cell", "words"),
    [
        (told_steps(11), "regressed: other work: depot takes 11 steps, not 10; no cell of 1 is slower"),
        (told_steps(11, 3.0), "regressed: other work: depot takes 11 steps, not 10; 1 of 1 cells slower, most depot: 3.00 times as long"),
        (told_steps(s_m=[4.0 * step for step in range(10)]), "regressed: counters changed in 1 cell"),
        (told_steps(first_s=[0.1]), "regressed: counters changed in 1 cell"),
        (told_steps(counters={"iterations": 3}), "regressed: counters changed in 1 cell"),
    ],
)
def test_changed_work_of_a_command_is_red_in_its_own_words(cell: dict[str, object], words: str) -> None:
    base, new = side(*[told_steps()] * 10), side(*[cell] * 10)
    comparison = compare(base, new, Rule(), Tolerance(), expect_changes=False)
    assert verdict_line(comparison, Rule()).startswith(words)
    assert compare(base, base, Rule(), Tolerance(), expect_changes=False).verdict is GateVerdict.FINE


def test_counters_that_the_base_does_not_repeat_say_nothing_and_those_that_only_the_new_side_does_not_are_changes() -> None:
    steady, flaky = [told_steps(counters={"n": 1})] * 3, [told_steps(counters={"n": number}) for number in range(3)]
    assert not own_changes(side(*flaky), side(*steady))
    (change,) = own_changes(side(*steady), side(*flaky))
    assert (change.counter, change.base, change.new) == ("n", "1", "0 or 1 or 2")
    renamed = replace(side(*steady), own=({own_name("yard"): {}},) * 3)
    assert [change.new for change in own_changes(side(*steady), renamed)] == ["missing", "measured"]


@pytest.mark.parametrize(
    ("spent", "name"),
    [
        ({"cpu_s": 1.5}, "CPU"), ({"import_s": 0.9}, "import"), ({"peak_bytes": 2e8}, "memory"), ({"ran_s": 1.5}, "start-up"),
        ({"ran_s": 1.5, "start_s": 0.9}, "unreported"), ({"ran_s": 1.5, "start_s": 1.2}, "start-up"),
    ],
)  # fmt: skip
def test_what_a_command_takes_beside_its_steps_is_red(spent: dict[str, float], name: str) -> None:
    usual = {"cpu_s": 1.0, "import_s": 0.4, "peak_bytes": 1e8, "ran_s": 1.0} | ({"start_s": 0.6} if "start_s" in spent else {})
    base, new = (side(*[told_steps()] * 10, spent=usual | more) for more in ({}, spent))
    comparison = compare(base, new, Rule(), Tolerance(), expect_changes=False)
    assert name in {one.quantity.name for one in comparison.found if one.is_worse}
    assert comparison.verdict is GateVerdict.REGRESSED


def test_the_machine_of_a_commands_processes_is_kept_so_that_those_of_two_are_told_apart() -> None:
    here, there = ({"machine": machine_facts() | more} for more in ({}, {"processor": "Another 9000"}))
    assert list(side(told_steps(), spent=here).machines) == [machine_words(machine_facts())]
    comparison = compare(side(told_steps(), spent=here), side(told_steps(), spent=there), Rule(), Tolerance(), expect_changes=False)
    assert comparison.elsewhere


def test_sides_of_two_comparisons_are_never_red_as_the_hour_may_differ_as_well() -> None:
    for name, verdict in (("one", GateVerdict.REGRESSED), ("other", GateVerdict.UNMEASURABLE)):
        base, new = (
            side(*[told_steps(slow=slow)] * 10, spent={"comparison": of}) for slow, of in ((1.0, "one"), (1.5, name))
        )  # fmt: skip
        comparison = compare(base, new, Rule(), Tolerance(), expect_changes=False)
        assert comparison.verdict is verdict
    assert "sides of two comparisons cannot tell a slower program from a slower hour" in verdict_line(comparison, Rule())


def test_what_hardly_takes_time_beside_the_steps_has_no_absurd_ratio_and_what_is_hidden_there_is_red() -> None:
    spent = {"ran_s": 0.6201, "start_s": 0.6}  # the steps take 20 ms
    for more, verdict in ((2e-6, GateVerdict.FINE), (0.2, GateVerdict.REGRESSED)):
        base, new = (side(*[told_steps()] * 10, spent=spent | {"ran_s": 0.6201 + one}) for one in (0.0, more))
        comparison = compare(base, new, Rule(), Tolerance(), expect_changes=False)
        (found,) = [one for one in comparison.found if one.quantity.name == "unreported"]
        assert (found.verdict, found.decision.ratio < 100.0) == (verdict, True)


def test_processes_with_an_empty_home_are_cells_of_their_own() -> None:
    warm, slow = side(*[told_steps()] * 10), side(*[told_steps(slow=3.0)] * 10)
    base, new = (replace(warm, cold=cold.processes, cold_about=cold.about) for cold in (warm, slow))
    comparison = compare(base, new, Rule(), Tolerance(), expect_changes=False)
    assert {entry.cell[0]: entry.verdict for entry in comparison.times} == {
        "depot": GateVerdict.FINE,
        "depot (cold)": GateVerdict.REGRESSED,
    }


def test_processor_time_decides_where_the_clock_cannot_if_the_steps_take_most_of_it_and_it_shows_enough() -> None:
    factors = (0.7, 0.8, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2, 1.3, 1.4)  # the middle is fine, the interval is not
    steady, uneven = side(*[told_steps()] * 10), side(*[told_steps(slow=factor) for factor in factors])
    even, scattered = 2e-3 * np.arange(10), np.linspace(-0.07, 0.07, 10)
    for cpu, start, more, verdict in (  # the steps take 20 ms
        (0.021, 0.001, even, GateVerdict.FINE), (0.2, 0.18, even, GateVerdict.UNMEASURABLE),
        (0.021, 0.02, even, GateVerdict.UNMEASURABLE),  # they wait
        (0.021, 0.001, scattered, GateVerdict.UNMEASURABLE),  # within the interval, but 8 % could hide
    ):  # fmt: skip
        base = replace(steady, about=({"cpu_s": cpu, "start_s": start, "load": 3.0},) * 10)
        new = replace(uneven, about=tuple({"cpu_s": cpu * (1.0 + one), "start_s": start, "load": 3.0} for one in more.tolist()))
        comparison = compare(base, new, Rule(), Tolerance(), expect_changes=False)
        (entry,) = comparison.times
        assert (comparison.verdict, entry.verdict, entry.by_cpu) == (verdict, verdict, verdict is GateVerdict.FINE)
    line = verdict_line(comparison, Rule())
    assert re.search(r"; 10 pairs would have shown a slowdown of \d+ %; load average 3\.0 on \d+ cores(;|$)", line)


def test_a_cell_that_took_longer_in_pairs_that_do_not_agree_is_told_so_and_not_that_nothing_could_be_seen() -> None:
    slower = (1.14, 1.15, 1.16, 1.13, 1.11, 1.145, 1.15, 1.14, 1.15, 0.773)  # a machine that was disturbed in the last pair
    comparison = compare(
        side(*[told_steps()] * 10), side(*[told_steps(slow=one) for one in slower]), Rule(), Tolerance(), expect_changes=False
    )
    line = verdict_line(comparison, Rule())
    assert "1 of 1 cells took longer, most depot: 1.1" in line
    assert "times as long, but the pairs do not agree well enough to prove it" in line
    assert "too uncertain" not in line


def test_a_suite_that_ends_well_without_a_benchmark_is_a_failed_program(tmp_path: Path) -> None:
    with pytest.raises(ProgramError, match="there is no benchmark in"):
        SuiteWork(tmp_path / "suite.toml").keep(Ended(0, "", ""), tmp_path / "00")


def test_words_are_split_as_a_shell_would_and_nothing_else_is_done() -> None:
    assert command_words("ours --road 'a b.csv' $(touch owned)") == ("ours", "--road", "a b.csv", "$(touch", "owned)")
    for text in ("", "'", "a\0b", "make && ours"):
        with pytest.raises(OptionError) as caught:
            command_words(text)
    assert caught.value.hint == "--command 'sh -c '\"'\"'make && ours'\"'\"''"


@pytest.fixture
def theirs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a repository with a planner of its own and nothing to install, and go there."""
    top = tmp_path / "theirs"
    top.mkdir()
    (top / "ours.py").write_text(OURS.format(slow=1.0, iterations=7), encoding="utf-8")
    git(tmp_path, "init", "--quiet", str(top))
    git(top, "add", ".")
    git(top, "commit", "--quiet", "--message", "one")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return top


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        (OURS.format(slow=1.0, iterations=7), 0, "fine: no cell of 1 is slower"),
        (OURS.format(slow=1.3, iterations=7), 1, "1 of 1 cells slower, most depot: 1.30 times as long"),
        nightly(OURS.format(slow=1.0, iterations=8), 1, "counters changed in 1 cell"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", 1, "the working tree ended with SIGSEGV"),
    ],
)
def test_a_planner_of_ones_own_is_guarded(
    cli: Cli, theirs: Path, monkeypatch: pytest.MonkeyPatch, change: str, code: int, words: str
) -> None:
    monkeypatch.chdir(theirs)
    (theirs / "ours.py").write_text(change, encoding="utf-8")
    command = ("bench", "--against", "HEAD", "--command", f"{sys.executable} ours.py", "--out", str(theirs.parent / "gate"))
    outcome = cli(*command, "--json")
    answer = json.loads(outcome.out)
    assert (outcome.code, answer["verdict"]) == (code, "regressed" if code else "fine")
    assert words in answer["summary"]
    assert "base: HEAD (" in outcome.err
    if answer["failure"] is None:
        times = read_side(theirs.parent / "gate" / "new").processes[0][own_name("depot")]
        assert (times.total.shape, times.s[1]) == ((3, 40), 5.0)


# Takes turns as the documents say, and keeps a diary of its rounds outside of both trees.
TAKES_TURNS = """
import json, os, time
turns = os.environ.get("HDVPLAN_TURNS")
def take_turn():
    if turns:
        os.write(int(turns), b"?")
        os.read(int(turns), 1)
for round_ in range(3):
    take_turn()
    with open({diary!r}, "a") as file:
        file.write(f"{{os.getpid()}} {{round_}}\\n" if turns else "")
    time.sleep(0.01)
take_turn()
print(json.dumps({{"cells": {{"depot": [0.001, 0.002]}}}}))
"""


# Its worst step is four times as long in every second pair or so, on either side.
UNEVEN = """
import json, pathlib
diary = pathlib.Path({diary!r})
with diary.open("a") as file:
    file.write("x")
worst = 0.001 if diary.stat().st_size % 8 in (1, 2, 4, 7) else 0.004
print(json.dumps({{"cells": {{"depot": [[0.001] * 9 + [worst], [0.001] * 10]}}}}))
"""


@pytest.mark.slow
def test_what_could_not_be_seen_is_no_answer_where_it_is_asked_for_strictly(
    cli: Cli, theirs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(theirs)
    (theirs / "ours.py").write_text(UNEVEN.format(diary=str(theirs.parent / "diary")), encoding="utf-8")
    git(theirs, "commit", "--quiet", "--all", "--message", "two")
    command = ("--command", f"{sys.executable} ours.py", "--patience", "0", "--json", "--out", str(theirs.parent / "gate"))
    for strict, code, verdict in (((), 0, "fine"), (("--strict",), 3, "could not measure")):
        outcome = cli("bench", "--against", "HEAD", *command, *strict)
        told = json.loads(outcome.out)
        assert (outcome.code, told["verdict"], "--strict" in told["again"]) == (code, verdict, bool(strict)), outcome.err
        assert "could not see a change of typical, first round, p99, worst" in told["summary"]


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="turns are given by descriptors that a process inherits")
def test_a_command_of_ones_own_can_take_turns(cli: Cli, theirs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(theirs)
    diary = theirs.parent / "diary"
    (theirs / "ours.py").write_text(TAKES_TURNS.format(diary=str(diary)), encoding="utf-8")
    git(theirs, "commit", "--quiet", "--all", "--message", "two")
    outcome = cli("bench", "--against", "HEAD", "--command", f"{sys.executable} ours.py", "--quiet", "--out", str(theirs.parent / "gate"))
    assert outcome.code == 0, outcome.err
    lines = [line.split() for line in diary.read_text(encoding="utf-8").splitlines()]
    pairs = [lines[first : first + 6] for first in range(0, len(lines), 6)]
    assert len(pairs) == 5
    for pair in pairs:
        assert [round_ for _, round_ in pair] == ["0", "0", "1", "1", "2", "2"]
        assert all(one[0] != other[0] for one, other in pairwise(pair))  # never the same process twice


@pytest.mark.parametrize(
    ("error", "sides", "code"),
    [(UnreachedError, ("the working tree",), 3), (ProgramError, ("the working tree",), 1), (ProgramError, ("HEAD", "the working tree"), 2)],
)
def test_a_new_program_that_cannot_be_installed_without_an_index_is_no_regression(
    cli: Cli, theirs: Path, monkeypatch: pytest.MonkeyPatch, error: type[ProgramError], sides: tuple[str, ...], code: int
) -> None:
    def install(_source: Path, _folder: Path, name: str, *_: object, **_again: object) -> None:
        if name.startswith(sides):
            raise error(name)

    monkeypatch.chdir(theirs)
    (theirs / "pyproject.toml").write_text('[project]\nname = "theirs"\nversion = "1"\n', encoding="utf-8")
    git(theirs, "add", ".")
    git(theirs, "commit", "--quiet", "--message", "two")
    monkeypatch.setattr("hdvplan.bench.comparing.environment.install", install)
    outcome = cli("bench", "--against", "HEAD", "--command", "python ours.py", "--quiet", "--out", str(theirs.parent / "gate"))
    assert outcome.code == code


@pytest.mark.slow
def test_a_side_that_hangs_is_named(cli: Cli, theirs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(theirs)
    hangs = "import time\ntime.sleep(1e6)\n"
    command = ("bench", "--against", "HEAD", "--command", f"{sys.executable} ours.py", "--quiet", "--out", str(theirs.parent / "gate"))
    (theirs / "ours.py").write_text(hangs, encoding="utf-8")
    outcome = cli(*command, "--time-limit", "2")
    assert (outcome.code, outcome.out) == (1, "regressed: the working tree did not end within 2 s\n")
    git(theirs, "commit", "--quiet", "--all", "--message", "two")
    outcome = cli(*command, "--time-limit", "2")
    assert outcome.code == 2  # both do
    assert "error: neither side can be measured: HEAD (" in outcome.err


CACHES = """
import json, pathlib
kept = pathlib.Path.home() / "table"
cold = not kept.exists()
kept.touch()
print(json.dumps({"cells": {"depot": [0.003 if cold else 0.001] * 10}}))
"""


@pytest.mark.slow
def test_a_planner_that_is_slow_without_its_cache_is_seen(cli: Cli, theirs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(theirs)
    command = ("bench", "--against", "HEAD", "--command", f"{sys.executable} ours.py", "--quiet", "--out", str(theirs.parent / "gate"))
    (theirs / "ours.py").write_text('print(\'{"cells": {"depot": [0.001, 0.001, 0.001, 0.001, 0.001]}}\')', encoding="utf-8")
    git(theirs, "commit", "--quiet", "--all", "--message", "two")
    (theirs / "ours.py").write_text(CACHES.replace("* 10", "* 5"), encoding="utf-8")
    outcome = cli(*command)
    assert outcome.code == 1
    assert "1 of 2 cells slower, most depot (cold): 3.00 times as long" in outcome.out
    assert not (Path.home() / "table").exists()


@pytest.mark.skipif(os.name != "posix", reason="folders are locked by flock")
def test_a_second_comparison_is_kept_out_of_the_folder_of_the_first(cli: Cli, theirs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import fcntl  # noqa: PLC0415 - not on Windows

    monkeypatch.chdir(theirs)
    out = theirs.parent / "gate"
    out.mkdir()
    (out / "junit.xml").write_text("of the first", encoding="utf-8")
    first = os.open(out, os.O_RDONLY)
    fcntl.flock(first, fcntl.LOCK_EX)
    outcome = cli("bench", "--against", "HEAD", "--command", "python ours.py", "--out", str(out))
    os.close(first)
    assert outcome.code == 2
    assert "another comparison measures into" in outcome.err
    assert (out / "junit.xml").read_text(encoding="utf-8") == "of the first"


def test_reports_of_an_earlier_comparison_are_not_taken_for_those_of_one_that_was_ended(
    cli: Cli, theirs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def ended(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.chdir(theirs)
    monkeypatch.setattr("hdvplan.bench.comparing.against._compared", ended)
    out = theirs.parent / "gate"
    out.mkdir()
    for name in REPORTS:
        (out / name).write_text("fine", encoding="utf-8")
    (out / "notes.txt").write_text("ours", encoding="utf-8")
    outcome = cli("bench", "--against", "HEAD", "--command", "python ours.py", "--out", str(out), "--json")
    assert (outcome.code, json.loads(outcome.out)["error"]) == (130, "interrupted")
    assert [path.name for path in out.iterdir()] == ["notes.txt"]


@pytest.mark.skipif(sys.platform == "win32", reason="a process between would say so")
def test_a_command_that_neither_side_has_is_the_users_mistake(cli: Cli, theirs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(theirs)
    outcome = cli("bench", "--against", "HEAD", "--command", "no-such-planner", "--quiet", "--out", str(theirs.parent / "gate"))
    assert outcome.code == 2
    assert "says: no-such-planner cannot be started: No such file or directory" in outcome.err


def test_versions_that_differ_between_the_sides_are_told(cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for side, numpy in (("base", "2.1"), ("new", "2.2")):
        folder = tmp_path / "out" / side / "00"
        folder.mkdir(parents=True)
        told = {"software": {"hdvplan": "0.1.0", "packages": {"numpy": numpy, "piqp": "0.61"}}}
        (folder / "run.json").write_text(json.dumps(told), encoding="utf-8")
    python = tmp_path / "python"
    python.touch(mode=0o755)
    monkeypatch.setattr("hdvplan.bench.comparing.against._compared", lambda *_: Comparison((), (), GateVerdict.FINE, 10))
    outcome = cli("bench", "--against", str(python), "--command", "ours", "--out", "out")
    assert (outcome.code, outcome.err) == (0, "versions differ: numpy 2.1 -> 2.2\n")


@pytest.mark.slow
def test_git_finds_the_first_slower_commit_by_the_lines_in_the_documents(theirs: Path) -> None:
    git(theirs, "tag", "v1.0")
    for number in range(2, 7):
        slow = 1.3 if number >= 4 else 1.0
        (theirs / "ours.py").write_text(f"{OURS.format(slow=slow, iterations=7)}# {number}\n", encoding="utf-8")
        git(theirs, "commit", "--quiet", "--all", "--message", f"change {number}")
        git(theirs, "tag", f"v{number}")
    guide = (Path(__file__).parents[2] / "docs" / "guarding-timing.md").read_text(encoding="utf-8")
    (lines,) = (block.body for block in blocks_of(guide) if "git bisect run" in block.body)
    found = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = os.environ | {"PATH": found}
    ran = subprocess.run(["sh", "-ec", lines], cwd=theirs, env=environment, capture_output=True, text=True, check=True)  # noqa: S603, S607 - ours
    assert f"{git(theirs, 'rev-parse', 'v4')} is the first bad commit" in ran.stdout


def test_the_last_words_of_pytest_name_the_test_that_failed_and_its_output_is_kept() -> None:
    said = "E   assert 1 == 2\n=== short test summary info ===\nFAILED bench/test_depot.py::test_drive - assert 1 == 2\n1 failed in 0.1s\n"
    ended = Ended(1, said, "Wrote benchmark data in: out.json\n")
    assert ended.words == "FAILED bench/test_depot.py::test_drive - assert 1 == 2"
    assert "E   assert 1 == 2" in ended.tail
    assert ended.tail.endswith("Wrote benchmark data in: out.json")


def test_what_is_slower_by_less_than_the_floor_is_told_with_the_floor() -> None:
    for long, longer, words in (
        (0.005, 0.00575, "fine: no cell of 1 is slower by more than a factor of 1.08 and 0.001 ms"),
        (0.05, 0.055, "regressed: 1 of 1 cells slower, most depot: 1.10 times as long"),
    ):
        base, new = (side(*[told_steps(slow=slow)] * 10) for slow in (long, longer))
        comparison = compare(base, new, Rule(), Tolerance(), expect_changes=False)
        assert verdict_line(comparison, Rule()).startswith(words)
