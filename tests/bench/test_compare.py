from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from hdvplan.bench.comparing.compare import Comparison, compare, compare_counters
from hdvplan.bench.comparing.counters import Tolerance, counters_of, read_counters, write_counters
from hdvplan.bench.comparing.decision import GateVerdict, Rule
from hdvplan.bench.comparing.reports import junit_xml
from hdvplan.bench.comparing.sides import Side, read_side, times_of
from hdvplan.bench.comparing.words import comparison_markdown, verdict_line
from hdvplan.bench.measuring.samples import CRASHED, FAILED, OVER_BUDGET, Measurement
from hdvplan.bench.measuring.stats import envelope_table, samples_of, timing_table
from hdvplan.bench.suite import Cell
from hdvplan.errors import OptionError
from hdvplan.planning.settings import Scheme
from tests.bench.conftest import TINY, Cli, made_up

CELLS = (Cell("bend", "bus", Scheme.RTI, "riccati"), Cell("bend", "bus", Scheme.SQP, "riccati"))
KEY = ("bend", "bus", "rti", "riccati", "as set")
STEPS = [2e-3, 1e-3, 1.2e-3, 0.8e-3, 1.1e-3]
Change = Callable[[Measurement], Measurement]


@cache  # most tests compare with the same one
def side(*, slow: float = 1.0, processes: int = 3, rounds: int = 3, change: Change = lambda measured: measured) -> Side:
    """Return a side of two cells; ``slow`` and ``change`` concern the first."""
    random = np.random.default_rng(int(1000 * slow) + processes)
    found = []
    for _ in range(processes):
        measured: list[list[Measurement]] = []
        for factor in (slow, 1.0):
            drives = [made_up([factor * t * (1.0 + 0.02 * random.random()) for t in STEPS], iterations=3) for _ in range(rounds)]
            measured.append([change(drive) for drive in drives] if factor is slow and not measured else drives)
        found.append(measured)
    samples = [samples_of(CELLS, measured) for measured in found]
    envelope = envelope_table(CELLS, found[0])
    counters = counters_of(samples[0], timing_table(samples[0], CELLS, found[0], envelope), envelope)
    return Side(counters, tuple(times_of(table) for table in samples))


def held(base: Side, new: Side, *, expect_changes: bool = False) -> Comparison:
    return compare(base, new, Rule(), Tolerance(), expect_changes=expect_changes)


def more_iterations(measured: Measurement) -> Measurement:
    steps = measured.steps.copy()
    steps[3, 6] += 1
    return replace(measured, steps=steps)


def swept(measured: Measurement, **lengths: float) -> Measurement:
    assert measured.judgement is not None
    return replace(measured, judgement=replace(measured.judgement, **lengths))  # type: ignore[arg-type] # lengths only


def test_the_cold_start_does_not_count() -> None:
    def cold(measured: Measurement) -> Measurement:
        steps = measured.steps.copy()
        steps[0, 4] *= 10.0
        return replace(measured, steps=steps)

    assert held(side(), side(change=cold)).verdict is GateVerdict.FINE


def test_one_iteration_more_is_reported_by_cell_and_red() -> None:
    comparison = held(side(), side(change=more_iterations))
    assert comparison.verdict is GateVerdict.REGRESSED
    (change,) = comparison.changes
    assert (change.cell, change.counter, change.base, change.new) == (KEY, "iterations", "15", "16")
    assert held(side(), side(change=more_iterations), expect_changes=True).verdict is GateVerdict.FINE
    assert held(side(change=more_iterations), side()).verdict is GateVerdict.REGRESSED  # fewer may be less well solved


def test_the_same_sum_in_other_steps_is_a_change() -> None:
    def moved(measured: Measurement) -> Measurement:
        steps = more_iterations(measured).steps
        steps[1, 6] -= 1
        return replace(measured, steps=steps)

    (change,) = held(side(), side(change=moved)).changes
    assert (change.cell, change.counter) == (KEY, "step by step")


@pytest.mark.parametrize(
    ("change", "counters"),
    [
        (lambda m: replace(m, nonzeros=101), {"nonzeros"}),
        (lambda m: replace(m, statuses=("solved",) * 4 + ("max_iterations",)), {"unsolved"}),
        (lambda m: replace(m, outcome=FAILED, message="lost"), {"status"}),
        (lambda m: swept(m, max_left=2.0002), {"max_left_m"}),
        (lambda m: swept(m, min_clearance=0.3), {"min_clearance_m"}),
        (lambda m: replace(m, judgement=None), {"max_left_m", "max_right_m", "mean_abs_imbalance_m", "limit_violation_m"}),
        (lambda m: replace(m, steps=m.steps[:4], statuses=m.statuses[:4]), {"steps", "qps", "iterations"}),
    ],
)
def test_every_counter_is_watched(change: Change, counters: set[str]) -> None:
    comparison = held(side(), side(change=change))
    assert {found.counter for found in comparison.changes} == counters
    assert {found.cell for found in comparison.changes} == {KEY}
    assert comparison.verdict is GateVerdict.REGRESSED


def test_an_envelope_that_moved_alone_is_told_apart_from_counters() -> None:
    comparison = held(side(), side(change=lambda m: swept(m, max_left=2.0002)))
    assert verdict_line(comparison, Rule()).startswith("regressed: the envelope alone changed in 1 cell")


def test_an_envelope_that_moved_by_less_than_the_tolerance_is_the_same() -> None:
    new = side(change=lambda m: swept(m, max_left=2.00005))
    assert not held(side(), new).changes  # 0.05 mm of 0.1 mm


@pytest.mark.parametrize("status", ["wrong optimum", "wrong path", "failed"])
def test_no_change_that_is_expected_makes_a_wrong_answer_fine(status: str) -> None:
    new = side()
    new = replace(new, counters=new.counters.assign(status=[status, *new.counters["status"][1:]]))
    comparison = held(side(), new, expect_changes=True)
    assert comparison.verdict is GateVerdict.REGRESSED
    assert verdict_line(comparison, Rule()).startswith("regressed: no right plan in 1 cell where there was one")


def test_sides_that_take_other_steps_are_red_and_timed_over_the_steps_that_both_have() -> None:
    def shorter(measured: Measurement) -> Measurement:
        return replace(measured, steps=measured.steps[:4], statuses=measured.statuses[:4])

    comparison = held(side(), side(change=shorter))
    assert comparison.verdict is GateVerdict.REGRESSED
    assert verdict_line(comparison, Rule()).startswith("regressed: other work: bend bus rti riccati takes 4 steps, not 5; ")
    assert held(side(), side(change=shorter), expect_changes=True).verdict is GateVerdict.FINE
    slower = held(side(), side(slow=3.0, change=shorter), expect_changes=True)
    assert slower.verdict is GateVerdict.REGRESSED
    assert slower.times[0].decision.ratio == pytest.approx(3.0, rel=0.02)  # the steps differ by 2 % at most


def test_a_cell_that_fails_at_once_on_both_sides_has_not_changed_and_is_told() -> None:
    """It was left out of all that is said: the gate was fine, and nobody saw that it guards less."""
    failed = side(change=lambda m: replace(m, steps=m.steps[:0], statuses=(), outcome=FAILED, judgement=None))
    comparison = held(failed, failed)
    assert not comparison.changes
    assert [entry.cell[2] for entry in comparison.times] == ["sqp"]
    told = "; not ok on both sides: bend bus rti riccati: failed"
    assert verdict_line(comparison, Rule()).endswith(told)
    assert verdict_line(compare_counters(failed.counters, failed.counters), Rule()).endswith(told)
    wrong = replace(side(), counters=side().counters.assign(status="wrong path"))
    assert verdict_line(held(wrong, wrong), Rule()).endswith("bend bus rti riccati: wrong path, and 1 more")
    assert "not ok" not in verdict_line(held(side(), side()), Rule())
    assert next(change.counter for change in held(side(), failed).changes) == "status"


@pytest.mark.slow
def test_how_far_a_cell_came_within_its_budget_is_no_counter() -> None:
    def ended(steps: int) -> Side:
        return side(change=lambda m: replace(m, steps=m.steps[:steps], statuses=m.statuses[:steps], outcome=OVER_BUDGET, judgement=None))

    comparison = held(ended(4), ended(3))
    assert not comparison.changes
    assert comparison.verdict is GateVerdict.FINE  # over the steps that both have
    assert held(side(), ended(3)).verdict is GateVerdict.REGRESSED  # it used to reach the end


def test_a_cell_that_one_side_lacks_is_a_change() -> None:
    whole = side()
    without = Side(whole.counters.iloc[:1], tuple({KEY: process[KEY]} for process in whole.processes))
    (change,) = held(whole, without).changes
    assert (change.cell[2], change.counter, change.base, change.new) == ("sqp", "cell", "measured", "missing")
    assert held(whole, without).verdict is GateVerdict.REGRESSED
    assert verdict_line(held(whole, without), Rule()).startswith("regressed: 1 cell of the base was not measured")


def test_a_cell_that_the_base_lacks_is_told_and_not_red_and_changed_work_beside_it_is() -> None:
    whole = side()
    base = Side(whole.counters.iloc[:1], tuple({KEY: process[KEY]} for process in whole.processes))
    comparison = held(base, whole)
    assert [(change.counter, change.base, change.new) for change in comparison.changes] == [("cell", "missing", "measured")]
    assert comparison.verdict is GateVerdict.FINE
    assert verdict_line(comparison, Rule()).startswith("fine: new, with nothing to compare: bend bus sqp riccati; no cell of 1 is slower")
    assert b'failures="0"' in junit_xml(comparison, Rule())
    changed = held(base, side(change=more_iterations))
    assert changed.verdict is GateVerdict.REGRESSED
    assert "counters changed in 1 cell; new, with nothing to compare" in verdict_line(changed, Rule())


def test_a_cell_that_crashes_in_one_process_of_several_is_a_lost_plan_and_never_left_out() -> None:
    whole = side()
    others = {name: steps for name, steps in whole.processes[2].items() if name != KEY}
    flaky = replace(whole, processes=(*whole.processes[:2], others), lost={KEY: CRASHED})
    for expect_changes in (False, True):
        comparison = held(whole, flaky, expect_changes=expect_changes)
        assert comparison.verdict is GateVerdict.REGRESSED
        (change,) = comparison.changes
        assert (change.cell, change.counter, change.base, change.new) == (KEY, "status", "ok", "crashed")
    for base, new in ((flaky, whole), (flaky, flaky)):  # which says nothing about the new program
        comparison = held(base, new)
        assert comparison.verdict is GateVerdict.UNMEASURABLE
        assert sorted(entry.decision.pairs for entry in comparison.times) == [0, 3]


def test_runs_without_a_cell_in_common_are_no_regression_but_refused(cli: Cli, two_runs: tuple[Path, Path]) -> None:
    new = two_runs[1]
    for file in ("timing.csv", "samples.csv.gz", "envelope.csv"):
        table = pd.read_csv(new / file)
        table.assign(road=table["road"] + "2").to_csv(new / file, index=False)
    outcome = cli("compare", "base", "new")
    assert outcome.code == 2
    assert "no cell is in both: the base has" in outcome.err


def test_a_crash_in_a_later_process_is_read(two_runs: tuple[Path, Path], tmp_path: Path) -> None:
    for number in range(3):
        shutil.copytree(two_runs[0], tmp_path / "runs" / f"{number:02d}")
    last = tmp_path / "runs" / "02"
    timing = pd.read_csv(last / "timing.csv")
    crashed = timing["solver"] == "piqp"
    timing.assign(status=timing["status"].where(~crashed, CRASHED)).to_csv(last / "timing.csv", index=False)
    rewrite(last, lambda samples: samples[samples["solver"] != "piqp"])
    found = read_side(tmp_path / "runs")
    ((cell, status),) = found.lost.items()
    assert (cell[3], status) == ("piqp", "crashed")
    assert cell in found.processes[0]
    assert read_side(two_runs[0]).lost == {}


def test_a_plan_that_is_lost_says_its_last_words_in_every_format(cli: Cli, two_runs: tuple[Path, Path]) -> None:
    new = two_runs[1]
    timing = pd.read_csv(new / "timing.csv")
    failed, words = timing["solver"] == "piqp", "solver 'piqp' raises AttributeError: no\x1b[2J attribute"
    timing.assign(status=timing["status"].where(~failed, FAILED), message=np.where(failed, words, "")).to_csv(
        new / "timing.csv", index=False
    )
    rewrite(new, lambda samples: samples[samples["solver"] != "piqp"])
    line = cli("compare", "base", "new", "--reports", "reports").out.splitlines()[-1]
    assert line.startswith("regressed: no right plan in 1 cell where there was one (solver 'piqp' raises AttributeError: no")
    assert "\x1b" not in line
    change = json.loads(Path("reports/comparison.json").read_text(encoding="utf-8"))["changes"][0]
    assert (change["counter"], change["why"].split(":")[0]) == ("status", "solver 'piqp' raises AttributeError")
    for report in ("junit.xml", "summary.md"):
        assert "raises AttributeError" in Path("reports", report).read_text(encoding="utf-8")
    annotations = cli("compare", "base", "new", "--format", "github").out.splitlines()
    assert all("raises AttributeError" in line for line in annotations if line.startswith("::error"))


@pytest.mark.slow
def test_one_process_a_side_is_never_red_by_its_times_as_the_hour_may_differ() -> None:
    assert held(side(processes=1), side(processes=1, slow=1.0001)).verdict is GateVerdict.FINE
    slower = held(side(processes=1), side(processes=1, slow=1.8))  # so much did one busy hour cost an unchanged program
    assert slower.verdict is GateVerdict.UNMEASURABLE
    line = verdict_line(slower, Rule())
    assert line.startswith("could not measure: 1 of 2 cells took longer, most bend bus rti riccati: 1.80 times")
    assert line.endswith("`hdvplan bench --against REV` can")
    assert held(side(processes=1), side(processes=1, change=more_iterations)).verdict is GateVerdict.REGRESSED  # work is work at any hour
    assert held(side(processes=1, rounds=2), side(processes=1, rounds=2, slow=1.3)).verdict is GateVerdict.UNMEASURABLE


def test_a_baseline_leaves_room_for_another_machine_but_not_for_more_work(tmp_path: Path) -> None:
    counters = side().counters
    write_counters(counters, tmp_path / "counters.csv")
    baseline = read_counters(tmp_path / "counters.csv")
    assert "step by step" not in baseline
    assert compare_counters(baseline, counters).verdict is GateVerdict.FINE
    for iterations, verdict in (
        (1020, GateVerdict.FINE),
        (980, GateVerdict.FINE),
        (1021, GateVerdict.REGRESSED),
        (979, GateVerdict.REGRESSED),
    ):
        old, new = baseline.assign(iterations=1000), counters.assign(iterations=iterations)
        found = compare_counters(old, new)
        assert found.verdict is verdict  # 2 %
        assert ("Changed by at most 2 %" in comparison_markdown(found, Rule())) is (verdict is GateVerdict.FINE)
        assert compare_counters(old, new, exact=True).verdict is GateVerdict.REGRESSED
    assert compare_counters(baseline.assign(nonzeros=99), counters).verdict is GateVerdict.REGRESSED
    assert compare_counters(baseline.iloc[:1], counters).verdict is GateVerdict.FINE  # a cell is new
    assert compare_counters(baseline, counters.iloc[:1]).verdict is GateVerdict.REGRESSED  # one is gone


NO_BASELINES = {
    "nothing there": (None, "No such file"), "empty": (b"", "cannot be read"), "columns": (b"road,vehicle\na,b\n", "no column 'scheme'"),
    "encoding": (b"\xff", "cannot be read"), "packed": (b"\x1f\x8b\x08\x00PK\x03\x04", "cannot be read"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "words"), NO_BASELINES.values(), ids=NO_BASELINES)
def test_a_baseline_that_is_none_is_refused_with_a_hint(tmp_path: Path, content: bytes | None, words: str) -> None:
    if content is not None:
        (tmp_path / "counters.csv.gz").write_bytes(content)
    with pytest.raises(OptionError, match=words) as caught:
        read_counters(tmp_path / "counters.csv.gz")
    assert "--renew" in str(caught.value.hint)


@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        *((lambda table, one=one: table.assign(qps=one), "column qps has values that are not finite") for one in (np.nan, np.inf)),
        (lambda table: table.assign(iterations=np.nan), "column iterations has values that are not finite"),
        (lambda table: table.assign(nonzeros="many"), "column nonzeros has values that are not numbers"),
        (lambda table: pd.concat([table] * 2), "a cell is there twice"),
    ],
)
def test_a_baseline_from_which_nothing_or_no_one_thing_differs_is_refused(
    tmp_path: Path, spoilt: Callable[[pd.DataFrame], pd.DataFrame], words: str
) -> None:
    write_counters(spoilt(side().counters), tmp_path / "counters.csv")
    with pytest.raises(OptionError, match=words):
        read_counters(tmp_path / "counters.csv")


@pytest.fixture
def two_runs(tmp_path: Path, finished_run: Path) -> tuple[Path, Path]:
    """Return two runs of which the second has the first's times, so that nothing depends on the machine's mood."""
    for name in ("base", "new"):
        shutil.copytree(finished_run, tmp_path / name)
    return tmp_path / "base", tmp_path / "new"


def rewrite(folder: Path, change: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
    file = folder / "samples.csv.gz"
    change(pd.read_csv(file)).to_csv(file, index=False)


def retold(folder: Path, **entries: dict[str, object]) -> dict[str, Any]:
    """Change entries within tables of a run's record; return the record as it was."""
    record: dict[str, Any] = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    changed = {name: record.get(name, {}) | entry for name, entry in entries.items()}
    (folder / "run.json").write_text(json.dumps(record | changed), encoding="utf-8")
    return record


def slowed(samples: pd.DataFrame) -> pd.DataFrame:
    return samples.assign(total_s=samples["total_s"].where(samples["solver"] != "piqp", 1.3 * samples["total_s"]))


def iterated(samples: pd.DataFrame) -> pd.DataFrame:
    return samples.assign(iterations=samples["iterations"] + (samples["solver"] == "piqp") * (samples["step"] == 3))


def test_two_runs_are_compared_in_one_line_with_their_exit_code(cli: Cli, two_runs: tuple[Path, Path]) -> None:
    outcome = cli("compare", "base", "new")
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.splitlines()[-1] == "fine: no cell of 2 is slower by more than a factor of 1.08"
    assert max(len(line) for line in outcome.out.splitlines()) <= 80 + len(str(two_runs[0]))  # the road's name is a path here
    assert cli("compare", "base", "new", "--quiet").out == "fine: no cell of 2 is slower by more than a factor of 1.08\n"

    rewrite(two_runs[1], slowed)
    outcome = cli("compare", "base", "new")
    assert outcome.code == 3  # one process a side
    assert outcome.out.splitlines()[-1].startswith("could not measure: 1 of 2 cells took longer, most ")
    assert "bus rti piqp: 1.30 times as long; one process a side" in outcome.out.splitlines()[-1]
    assert "unclear" in outcome.out
    assert cli("compare", "base", "new", "--factor", "1.5").code == 0
    assert cli("compare", "base", "new", "--floor", "100").code == 0
    assert cli("compare", "new", "base").code == 0

    rewrite(two_runs[1], lambda samples: samples[samples["round"] < 2])
    outcome = cli("compare", "base", "new")
    assert outcome.code == 3
    assert outcome.out.splitlines()[-1] == "could not measure: times need at least 3 rounds or processes a side, not 2"


def test_changed_counters_are_red_in_every_format(
    cli: Cli, tmp_path: Path, two_runs: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    rewrite(two_runs[1], iterated)
    outcome = cli("compare", "base", "new")
    assert outcome.code == 1
    assert "counters changed" in outcome.out
    assert outcome.out.splitlines()[-1].startswith("regressed: counters changed in 1 cell; no cell of 2 is slower")
    assert cli("compare", "base", "new", "--expect-changes").code == 0

    answer = json.loads(cli("compare", "base", "new", "--json").out)
    assert answer["verdict"] == "regressed"
    assert [(change["solver"], change["counter"]) for change in answer["changes"]] == [("piqp", "iterations")]
    assert {"base_ms", "new_ms", "ratio", "low", "high", "noise", "pairs", "verdict"} <= set(answer["times"][0])

    summary = tmp_path / "summary.md"
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary))
    outcome = cli("compare", "base", "new", "--format", "github")
    assert outcome.code == 1
    (line,) = outcome.out.splitlines()
    assert line.startswith("::error title=planning time::regressed: counters changed")
    text = summary.read_text(encoding="utf-8")
    assert text.startswith("**regressed: counters changed in 1 cell")
    assert text.count("rti piqp ") == text.count("| piqp ") == 1  # among the changes and among the times
    cli("compare", "base", "base", "--format", "github")
    assert "**fine: " in summary.read_text(encoding="utf-8")  # appended: other steps write there as well
    monkeypatch.delenv("GITHUB_STEP_SUMMARY")
    outcome = cli("compare", "base", "base", "--format", "github")
    assert outcome.out.startswith("::notice title=planning time::fine: ")
    assert "**fine: " in outcome.out


def test_a_refusal_is_an_annotation_too_and_a_summary_that_cannot_be_written_changes_no_verdict(
    cli: Cli, tmp_path: Path, two_runs: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    outcome = cli("compare", "base", "missing", "--format", "github")
    assert outcome.code == 2
    assert outcome.out == "::error title=planning time::missing is not a folder of hdvplan bench\n"
    assert outcome.err == "error: missing is not a folder of hdvplan bench\n"
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path))  # a folder
    outcome = cli("compare", *(path.name for path in two_runs), "--format", "github")
    assert outcome.code == 0
    assert outcome.out.startswith("::notice title=planning time::fine: ")
    assert outcome.err == f"warning: cannot write the step summary {tmp_path}: Is a directory\n"


@pytest.mark.parametrize("told", [f'{{"import_s": {"9" * 400}}}', '{"import_s": 1e300, "peak_bytes": 1e-300}', "[]"])
def test_impossible_numbers_about_a_process_are_not_known(two_runs: tuple[Path, Path], told: str) -> None:
    (two_runs[0] / "process.json").write_text(told, encoding="utf-8")
    assert read_side(two_runs[0]).about == ({},)


def test_several_runs_in_a_folder_are_processes_of_one_side(cli: Cli, tmp_path: Path, two_runs: tuple[Path, Path]) -> None:
    for number in range(4):
        for name in ("base", "new"):
            shutil.copytree(two_runs[0], tmp_path / f"{name}s" / f"{number:02d}")
    assert len(read_side(tmp_path / "bases").processes) == 4
    outcome = cli("compare", "bases", "news")
    assert outcome.code == 0
    assert "with the middle ratio of 4, the interval" in " ".join(outcome.out.split())


def test_times_of_another_machine_do_not_count(cli: Cli, tmp_path: Path, two_runs: tuple[Path, Path]) -> None:
    rewrite(two_runs[1], lambda samples: samples.assign(total_s=1.5 * samples["total_s"], outer_s=1.5 * samples["outer_s"]))
    retold(two_runs[1], machine={"processor": "Another 9000"})
    for number in range(5):
        for name in ("base", "new"):
            shutil.copytree(tmp_path / name, tmp_path / f"{name}s" / f"{number:02d}")
    outcome = cli("compare", "bases", "news", "--reports", "told")
    assert outcome.code == 3
    words = "the sides were measured on different machines, so their times do not count"
    assert outcome.out.splitlines()[-1] == f"could not measure: {words}"
    told = json.loads((tmp_path / "told" / "comparison.json").read_text(encoding="utf-8"))
    assert "; new: news (Another 9000, " in told["compared"]
    assert "Another 9000" in (tmp_path / "told" / "summary.md").read_text(encoding="utf-8")
    for number in range(5):
        rewrite(tmp_path / "news" / f"{number:02d}", lambda samples: samples.assign(iterations=2 * samples["iterations"]))
    assert cli("compare", "bases", "news").code == 1  # counters still do


def test_another_python_is_no_other_machine(cli: Cli, two_runs: tuple[Path, Path]) -> None:
    """As where `bench --against` has another Python's path for its base."""
    retold(two_runs[1], machine={"python": "CPython 4.0.0"})
    assert cli("compare", "base", "new", "--quiet").out == "fine: no cell of 2 is slower by more than a factor of 1.08\n"


def test_runs_with_other_settings_or_on_a_road_that_has_changed_are_no_same_cells(cli: Cli, two_runs: tuple[Path, Path]) -> None:
    before = retold(two_runs[1], settings={"horizon": 50.0, "rounds": 9})["settings"]  # which rounds there are is no such setting
    outcome = cli("compare", "base", "new")
    assert outcome.code == 2
    assert f"these are not the same cells: horizon was {before['horizon']}, is 50.0\n" in outcome.err
    retold(two_runs[1], settings=before)
    for folder, digest in zip(two_runs, ("1", "2"), strict=True):
        retold(folder, files={"road.csv": digest, folder.name: digest})
    outcome = cli("compare", "base", "new")
    assert outcome.code == 2
    assert "these are not the same cells: road.csv has another content\n" in outcome.err


def test_a_run_whose_record_is_damaged_is_refused_as_nothing_tells_how_it_was_planned(cli: Cli, two_runs: tuple[Path, Path]) -> None:
    (two_runs[0] / "run.json").write_bytes((two_runs[0] / "run.json").read_bytes()[:300])
    outcome = cli("compare", "base", "new")
    assert outcome.code == 2
    assert f"{Path('base') / 'run.json'} cannot be read: " in outcome.err


def changed(name: str, column: str, value: str) -> Callable[[Path], None]:
    """Return what writes a value into a whole column of a table."""
    return lambda folder: pd.read_csv(folder / name, dtype=str).assign(**{column: value}).to_csv(folder / name, index=False)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (shutil.rmtree, "is not a folder of hdvplan bench"),
        (lambda folder: (folder / "run.json").unlink(), "holds no benchmark"),
        (lambda folder: (folder / "samples.csv.gz").unlink(), "is without samples.csv.gz"),
        (lambda folder: (folder / "samples.csv.gz").write_bytes(b"\x1f\x8bnonsense"), "cannot be read"),
        (lambda folder: (folder / "timing.csv").write_text("a,b\n1,2\n"), "are not those of hdvplan bench"),
        (lambda folder: ((folder / "parts").mkdir(), (folder / "timing.csv").unlink()), "is not finished"),
        (changed("envelope.csv", "max_left_m", "x"), "are not those of hdvplan bench"),
        (changed("envelope.csv", "min_clearance_m", "9" * 400), "are not those of hdvplan bench"),
        (changed("timing.csv", "nonzeros", "x"), "are not those of hdvplan bench"),
        (changed("samples.csv.gz", "qp_count", "1e300"), "are not those of hdvplan bench"),
        (changed("samples.csv.gz", "total_s", "1e-300"), "are not those of hdvplan bench"),
        (changed("samples.csv.gz", "outer_s", "inf"), "are not those of hdvplan bench"),
    ],
)
def test_what_is_no_run_is_refused(cli: Cli, two_runs: tuple[Path, Path], spoil: Callable[[Path], object], words: str) -> None:
    spoil(two_runs[1])
    outcome = cli("compare", "base", "new")
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err.startswith("error: new")
    assert words in outcome.err


@pytest.mark.slow
def test_a_run_is_held_to_committed_counters_and_renews_them_with_one_command(cli: Cli, tmp_path: Path, short_road: str) -> None:
    command = ("bench", "--roads", short_road, *TINY, "--rounds", "1", "--out", "run", "--counters", "counters.csv")
    missing = cli(*command)
    assert missing.code == 2
    assert "--renew" in missing.err
    assert cli(*command, "--renew").code == 0
    outcome = cli(*command)
    assert outcome.code == 0
    assert outcome.out == "fine: no counter changed\n"
    table = pd.read_csv(tmp_path / "counters.csv")
    table.assign(iterations=table["iterations"] * 1.01).to_csv(tmp_path / "counters.csv", index=False)
    *rows, line = cli(*command).out.splitlines()
    assert line == "fine: no counter changed by more than 2 %; 4 sums of QPs or iterations changed by at most 2 %"
    iterations = int(table["iterations"][0])
    assert sum("iterations" in row for row in rows) == 4
    assert any(row.split()[-3:] == ["iterations", str(1.01 * iterations), str(iterations)] for row in rows)
    exact = cli(*command, "--strict")
    assert (exact.code, exact.out.splitlines()[-1]) == (1, "regressed: counters changed in 4 cells")
    table.assign(iterations=table["iterations"] * 1.01, steps=table["steps"] + 1).to_csv(tmp_path / "counters.csv", index=False)
    assert cli(*command).out.endswith("; 4 sums of QPs or iterations changed by at most 2 %\n")
    table.assign(qps=table["qps"] + 1).to_csv(tmp_path / "counters.csv", index=False)
    outcome = cli(*command)
    assert outcome.code == 1
    assert outcome.out.splitlines()[-1] == "regressed: counters changed in 4 cells"
    assert len(json.loads(cli(*command, "--json").out)["changes"]) == 4
    assert cli(*command, "--renew").code == 0
    assert cli(*command).code == 0
