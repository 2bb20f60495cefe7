"""What is found besides slower steps, and where: comparisons of made-up processes, made worse in one way each."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import fromstring

import numpy as np
import pandas as pd
import pytest

from hdvplan.arrays import FloatArray
from hdvplan.bench.comparing.compare import Comparison, compare, failed
from hdvplan.bench.comparing.counters import COUNTS, IN_STEPS, LENGTHS, WORK, Change, Tolerance
from hdvplan.bench.comparing.decision import GateVerdict, Rule
from hdvplan.bench.comparing.reports import comparison_json, github_annotation, junit_xml, write_reports
from hdvplan.bench.comparing.sides import IMPORT, PEAK, Name, Side, Steps
from hdvplan.bench.comparing.words import comparison_markdown, comparison_tables, quantity_words, verdict_line, wrong_rows
from hdvplan.bench.suite import KEY, cell_words

CELLS: tuple[Name, ...] = tuple((road, vehicle, "rti", "riccati", "as set") for road in ("bend", "ring") for vehicle in ("bus", "truck"))
ROUNDS, STEPS = 6, 40
Worse = Callable[[Steps, np.random.Generator], Steps]
NO_COUNTERS = pd.DataFrame(columns=[*KEY, "status", *COUNTS, *WORK, *LENGTHS, IN_STEPS])


def unchanged(steps: Steps, _: np.random.Generator) -> Steps:
    return steps


def side(seed: int, change: Worse = unchanged, pairs: int = 10, about: Mapping[str, float] | None = None) -> Side:
    """Return a side of processes that differ by a percent or so; ``change`` concerns all cells."""
    random = np.random.default_rng(seed)
    usual = {name: np.random.default_rng(7 + number).uniform(1e-4, 4e-4, STEPS) for number, name in enumerate(CELLS)}
    processes, starts = [], []
    for _ in range(pairs):
        speed = np.exp(random.normal(0.0, 0.013))
        cells = {}
        for name in CELLS:
            total = speed * usual[name] * np.exp(np.abs(random.normal(0.0, 0.03, (ROUNDS, STEPS))))
            steps = Steps(total, total + 2e-5, speed * np.full(ROUNDS, 8e-3), np.linspace(5.0, 5.0 * STEPS, STEPS))
            cells[name] = change(steps, random)
        processes.append(cells)
        more = about or {}
        starts.append({IMPORT: 0.9 * speed + more.get(IMPORT, 0.0), PEAK: 2.3e8 * (1.0 + 1e-3 * random.random()) + more.get(PEAK, 0.0)})
    return Side(NO_COUNTERS, tuple(processes), tuple(starts))


def held(new: Side, pairs: int = 10) -> Comparison:
    return compare(side(0, pairs=pairs), new, Rule(), Tolerance(), expect_changes=False)


def added(steps: Steps, more: FloatArray) -> Steps:
    return replace(steps, total=steps.total + more, outer=steps.outer + more)


def half(steps: Steps, random: np.random.Generator) -> Steps:
    return added(steps, steps.total * random.choice([0.0, 1.0], steps.total.shape))


def rare(steps: Steps, random: np.random.Generator) -> Steps:
    return added(steps, np.asarray(random.choice([0.0, 5e-3], steps.total.shape, p=[0.95, 0.05]), np.float64))


def outside(steps: Steps, _: np.random.Generator) -> Steps:
    return replace(steps, outer=steps.outer + 0.25 * steps.total)


def remembering(steps: Steps, _: np.random.Generator) -> Steps:
    kept = np.append(2.0, np.full(len(steps.total) - 1, 1e-3))[:, None]  # times as long, by round
    return replace(steps, total=kept * steps.total, outer=kept * steps.outer)


def first(steps: Steps, _: np.random.Generator) -> Steps:
    return replace(steps, first=2.0 * steps.first)


def names(comparison: Comparison) -> set[str]:
    return {quantity_words(one) for one in comparison.found if one.is_worse}


@pytest.mark.parametrize("seed", range(1, 6))
@pytest.mark.parametrize(
    ("change", "about", "found"),
    [
        (half, {}, {"typical"}),
        (rare, {}, {"p99"}),
        (outside, {}, {"from outside", "typical"}),
        (first, {}, {"first plan"}),
        (remembering, {}, {"first round"}),
        (unchanged, {IMPORT: 0.5}, {"import"}),
        (unchanged, {PEAK: 1e8}, {"memory"}),
    ],
)
def test_what_the_fastest_rounds_do_not_show_is_found(change: Worse, about: Mapping[str, float], found: set[str], seed: int) -> None:
    comparison = held(side(seed, change, about=about))
    assert comparison.verdict is GateVerdict.REGRESSED
    assert found <= names(comparison)
    assert names(comparison) <= {*found, "p99", "worst", "typical", "first round"}


def test_the_same_program_is_fine_in_all_of_them_and_the_report_says_what_would_have_been_seen() -> None:
    for seed in range(1, 21):
        comparison = held(side(seed))
        assert comparison.verdict is GateVerdict.FINE
        assert not names(comparison)
    seen = {quantity_words(one): one.decision.detectable for one in comparison.found}
    assert 1.08 <= seen["from outside"] < 1.12
    assert 1.08 < seen["memory"] < 1.1  # the floor of 20 MB
    assert all(1.0 < entry.decision.detectable < 1.12 for entry in comparison.times)


def uneven(steps: Steps, random: np.random.Generator) -> Steps:
    return replace(steps, outer=steps.outer * np.exp(random.normal(0.0, 0.15)))  # around the planner, in each process otherwise


def halves(seed: int, pairs: int, *, stalls: bool) -> Comparison:
    """Return the comparison of two cells of ten steps in three rounds: the second becomes 100 times as fast, the first may stall."""
    random = np.random.default_rng(seed)
    depot, yard = CELLS[:2]

    def process(*, new: bool) -> dict[Name, Steps]:
        speed = np.exp(random.normal(0.0, 0.013))
        total = speed * 1e-3 * np.exp(np.abs(random.normal(0.0, 0.03, (2, 3, 10))))
        stalled = np.where(random.random((3, 10)) < 0.1, 0.06, 0.0) if new and stalls else 0.0
        return {depot: Steps(total[0] + stalled, np.empty((0, 0))), yard: Steps(total[1] / (100.0 if new else 1.0), np.empty((0, 0)))}

    base, new = (Side(NO_COUNTERS, tuple(process(new=new) for _ in range(pairs))) for new in (False, True))
    return compare(base, new, Rule(), Tolerance(), expect_changes=False)


def test_a_faster_cell_does_not_pay_for_the_stalls_of_another() -> None:
    found = [halves(seed, 10, stalls=True) for seed in range(20)]
    caught = [comparison for comparison in found if comparison.verdict is GateVerdict.REGRESSED]
    assert len(caught) >= 18  # one process in 25 has no stall in its 30 steps; where two of ten have none, more pairs are needed
    assert not [comparison for comparison in found if comparison.verdict is GateVerdict.FINE]
    for comparison in caught:
        assert {one.cell for one in comparison.found if one.is_worse} == {CELLS[0]}
        assert "1 of 2 cells slower in p99, most bend bus rti riccati: " in verdict_line(comparison, Rule())
        assert {row[:2] for row in wrong_rows(comparison)} >= {("bend bus rti riccati", "p99 [ms]")}
        told = comparison_json(comparison, Rule())["statistics"]
        assert isinstance(told, list)
        assert {one["cell"] for one in told if one["verdict"] == "regressed"} == {"bend bus rti riccati"}
        suite = fromstring(junit_xml(comparison, Rule()))  # noqa: S314 - our own
        red = {(case.get("classname"), case.get("name")) for case in suite.iter("testcase") if case.find("failure") is not None}
        assert ("p99", "bend bus rti riccati") in red
        assert "p99 of bend bus rti riccati [ms]" in comparison_markdown(comparison, Rule()).replace("\\", "")
    assert all(halves(seed, pairs, stalls=False).verdict is GateVerdict.FINE for pairs in (5, 10) for seed in range(20))


def stalling(steps: Steps, random: np.random.Generator) -> Steps:
    return added(steps, np.asarray(random.choice([0.0, 5e-3], steps.total.shape, p=[0.99, 0.01]), np.float64))


@pytest.mark.slow
def test_programs_that_both_stall_now_and_then_are_called_worse_in_at_most_one_comparison_of_a_hundred() -> None:
    found = []
    for seed in range(300):
        base, new = (side(2 * seed + 1000 + number, stalling) for number in (0, 1))
        found.append(compare(base, new, Rule(), Tolerance(), expect_changes=False).verdict)
    assert found.count(GateVerdict.FINE) >= 270  # some leave a doubt that more pairs settle
    assert (
        found.count(GateVerdict.REGRESSED) <= 5
    )  # 1.5 are expected at the look after ten pairs; 5 is three standard deviations of a count more


@pytest.mark.parametrize("pairs", [10, 20])  # five leave a doubt
def test_what_could_not_be_seen_is_not_called_fine(pairs: int) -> None:
    quiet, noisy = (
        compare(side(0, change, pairs), side(1, change, pairs), Rule(), Tolerance(), expect_changes=False) for change in (unchanged, uneven)
    )
    assert not any(one.decision.unseen for one in quiet.found)
    assert noisy.verdict is GateVerdict.FINE  # by the planner's own clock, and nothing was found
    unseen = {quantity_words(one) for one in noisy.found if one.decision.unseen}
    assert {"from outside", "typical"} <= unseen
    assert not {"import", "memory"} & unseen  # their processes are as before
    told = comparison_json(noisy, Rule())["statistics"]
    assert isinstance(told, list)
    assert {one["statistic"] for one in told if one["verdict"] == "could not see"} == unseen
    assert re.search(r"could hide in the noise, from outside \+8 %, typical \+8 %(, [^.]+)? and more\.", comparison_markdown(noisy, Rule()))
    told_last = ", ".join(dict.fromkeys(quantity_words(one) for one in noisy.found if one.decision.unseen))
    assert verdict_line(noisy, Rule()).endswith(f"; could not see a change of {told_last}")
    assert "could not" not in verdict_line(quiet, Rule())
    shown = comparison_tables(noisy, "gate/summary.md")
    rest = comparison_markdown(noisy, Rule()).partition("Whole processes:")[2].count("\n|") - 2  # without heading and rule
    assert not any("whole processes" in str(table.title) for table in shown)
    assert str(shown[-1].caption).endswith(f" Whole processes: {rest} other rows, which decide nothing: gate/summary.md.")
    strictly = [
        compare(side(0, change, pairs), side(1, change, pairs), Rule(), Tolerance(), expect_changes=False, strict=True)
        for change in (unchanged, uneven)
    ]
    assert [(one.verdict, one.is_settled) for one in strictly] == [(GateVerdict.FINE, True), (GateVerdict.UNMEASURABLE, False)]
    *_, decides = comparison_tables(strictly[1], "gate/summary.md")
    assert decides.row_count == sum(one.decision.unseen for one in strictly[1].found)
    assert verdict_line(strictly[1], Rule()) == verdict_line(noisy, Rule()).replace("fine", "could not measure", 1)
    suite = fromstring(junit_xml(noisy, Rule()))  # noqa: S314 - our own
    skipped = [case for case in suite.iter("testcase") if case.find("skipped") is not None]
    assert unseen == {case.get("name") if case.get("classname") == "whole processes" else case.get("classname") for case in skipped}


def test_what_is_hardly_more_than_counts_is_not_shown_as_what_counts() -> None:
    quiet = compare(side(0), side(1), Rule(), Tolerance(), expect_changes=False)
    for shown, told in ((1.0, "+8 %"), (1.0801, "+8.1 %"), (1.2, "+20 %")):
        times = tuple(replace(one, decision=replace(one.decision, counting=1.08, shown=shown)) for one in quiet.times)
        assert comparison_markdown(replace(quiet, times=times), Rule()).count(f" {told} |") >= len(times)


def test_a_doubt_beside_what_is_slower_names_its_cell() -> None:
    red = held(side(1, half))
    doubt = next(one for one in red.found if one.is_of_cell and quantity_words(one) == "typical")
    doubted = replace(doubt, decision=replace(doubt.decision, verdict=GateVerdict.UNMEASURABLE))
    found = tuple(doubted if one is doubt else one for one in red.found)
    assert f"too few processes to be sure of typical of {cell_words(doubt.cell)}" in verdict_line(replace(red, found=found), Rule())


def test_what_was_found_was_seen() -> None:
    noisy = compare(side(0), side(1), Rule(), Tolerance(), expect_changes=False)
    assert all(replace(one.decision, shown=10.0).unseen for one in noisy.found)
    assert not any(replace(one.decision, verdict=GateVerdict.REGRESSED, shown=10.0).unseen for one in noisy.found)


def test_few_pairs_leave_a_doubt_that_a_repeat_settles() -> None:
    assert held(side(1, half, pairs=5), pairs=5).verdict is GateVerdict.UNMEASURABLE
    assert held(side(1, pairs=5), pairs=5).verdict is GateVerdict.FINE


def test_what_is_slower_is_told_the_worst_first() -> None:
    def slower(steps: Steps, _: np.random.Generator) -> Steps:
        return added(steps, np.where(steps.s <= 80.0, 5e-4, 0.0) * np.ones_like(steps.total))

    comparison = held(side(1, slower))
    rows = [row for row in wrong_rows(comparison) if row[1] == "mean step [ms]"]
    assert len(rows) == len(CELLS)
    assert [float(row[4]) for row in rows] == sorted((float(row[4]) for row in rows), reverse=True)
    assert verdict_line(comparison, Rule()) in comparison_markdown(comparison, Rule(), "again").replace("\\", "")


def test_every_printed_ratio_is_the_quotient_of_the_printed_numbers_and_lies_in_its_interval() -> None:
    text = comparison_markdown(held(side(1, lambda steps, _: added(steps, 0.2 * steps.total))), Rule())
    rows = [[field.strip() for field in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
    numbers = [row[-6:-2] for row in rows if row[-3:-2] and "-" in row[-3] and row[-3][0].isdigit()]
    assert len(numbers) >= len(CELLS) + 5
    for base, new, ratio, interval in numbers:
        low, high = map(float, interval.split("-"))
        assert float(new) / float(base) == pytest.approx(float(ratio), abs=6e-4)  # half a unit of the ratio, and of five digits
        assert low - 5e-3 <= float(ratio) <= high + 5e-3  # which has two decimals


def test_every_form_says_the_same_of_a_failure(tmp_path: Path) -> None:
    comparison = failed("new", "new ended with SIGSEGV and says: <nothing> & \x00", "Traceback\nSIGSEGV")
    write_reports(comparison, Rule(), "hdvplan bench --against HEAD", tmp_path)
    told = json.loads((tmp_path / "comparison.json").read_text(encoding="utf-8"))
    assert (told["verdict"], told["failure"]["side"], told["again"]) == ("regressed", "new", "hdvplan bench --against HEAD")
    suite = fromstring((tmp_path / "junit.xml").read_text(encoding="utf-8"))  # noqa: S314 - our own
    assert (suite.get("errors"), suite.get("failures"), suite.get("tests")) == ("1", "0", "1")
    assert "Traceback" in (tmp_path / "summary.md").read_text(encoding="utf-8")
    line = github_annotation(comparison, Rule())
    assert line.startswith("::error ")
    assert "%0ATraceback%0ASIGSEGV" in line
    assert json.loads((tmp_path / "benchmark.json").read_text(encoding="utf-8")) == []
    broken = failed("base", "base cannot be installed", "")
    assert broken.verdict is GateVerdict.UNMEASURABLE
    assert fromstring(junit_xml(broken, Rule())).get("skipped") == "1"  # noqa: S314 - our own


def test_dashboards_get_the_numbers_of_the_new_side(tmp_path: Path) -> None:
    comparison = held(side(1, about={PEAK: 1e8}))
    write_reports(comparison, Rule(), None, tmp_path)
    rows = json.loads((tmp_path / "benchmark.json").read_text(encoding="utf-8"))
    for row in rows:  # customSmallerIsBetter: three entries, and a range in words
        assert {name: type(value) for name, value in row.items() if name != "range"} == {"name": str, "unit": str, "value": float}
        assert isinstance(row.get("range", ""), str)
    memory = next(row for row in rows if row["name"] == "all cells: memory")
    assert (memory["unit"], memory["value"]) == ("MB", pytest.approx(330.0, rel=0.01))
    bencher = json.loads((tmp_path / "bencher.json").read_text(encoding="utf-8"))
    assert list(bencher) == [row["name"] for row in rows]
    for name, measures in bencher.items():  # Bencher Metric Format: benchmark, measure, value, perhaps with bounds
        assert len(name) <= 1024  # longer names are refused
        for measure, metric in measures.items():
            assert len(measure) <= 64  # as above
            assert {"value"} <= set(metric) <= {"value", "lower_value", "upper_value"}
            assert all(type(value) is float for value in metric.values())
    step = bencher["bend bus rti riccati: mean step"]["mean step [ms]"]
    assert step["lower_value"] < step["value"] < step["upper_value"]
    suite = fromstring((tmp_path / "junit.xml").read_text(encoding="utf-8"))  # noqa: S314 - our own
    assert suite.get("failures") == "1"
    assert suite.get("tests") == str(1 + len(CELLS) + len(comparison.found))


def test_counters_that_were_expected_to_change_are_no_failures_beside_what_is_slower() -> None:
    slower = replace(held(side(1, lambda steps, _: added(steps, 0.3 * steps.total))), found=())
    changed = replace(slower, changes=(Change(CELLS[0], "iterations", "3", "4"), Change(CELLS[1], "status", "ok", "crashed")))
    for expected, failures in ((False, 2), (True, 1)):
        comparison = replace(changed, expected=expected)
        suite = fromstring(junit_xml(comparison, Rule()))  # noqa: S314 - our own
        cases = [case for case in suite.iter("testcase") if case.get("classname") == "counters"]
        assert sum(case.find("failure") is not None for case in cases) == failures
    assert compare(side(0), side(1), Rule(), Tolerance(), expect_changes=True).expected
