"""Results kept by commit: made-up entries, their trends, tables and charts, and the commands around them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from hdvplan.bench.compare import CellTimes, Comparison, failed
from hdvplan.bench.gate import Decision, Rule, Verdict
from hdvplan.bench.history import Entry, entry_of, read_entries, work_words, write_entry
from hdvplan.bench.revisions import Revision
from hdvplan.bench.statistics import Found, statistics
from hdvplan.bench.suite import Suite
from hdvplan.bench.trend_report import titles_of, trend_figure, trend_json, trend_section, trend_tables
from hdvplan.bench.trends import LEVEL, Trend, trends_of
from hdvplan.bench.values import ALL_CELLS, STEP, Value, values_of
from hdvplan.bench.work import CommandWork
from hdvplan.errors import OptionError
from hdvplan.report.html import report_html
from tests.bench.conftest import Cli

pytest.importorskip("ruptures")
BASE = "b" * 40
MACHINE: Mapping[str, object] = {"processor": "Xeon", "usable_cores": 2, "platform": "Linux x86_64", "python_minor": "CPython 3.11"}


def entry(number: int, step: float, *, base: str = BASE, machine: Mapping[str, object] = MACHINE, piqp: str = "0.61") -> Entry:
    """Return an entry of a program that was measured on a machine whose condition differs from day to day."""
    day = np.exp(np.random.default_rng(number).normal(0.0, 0.3))
    noise = np.exp(np.random.default_rng([number, 1]).normal(0.0, 0.01))
    values = (
        Value("bend bus", STEP, "ms", 0.2 * day, 0.2 * day * step * noise, 1.02),
        Value(ALL_CELLS, "memory", "MB", 230.0, 230.0 * (1.0 + 1e-3 * noise)),
    )
    revision = Revision(f"{number:012x}{0:028x}", f"change {number}", f"2026-01-{1 + number // 24:02d}T{number % 24:02d}:00:00+01:00")
    work = {"suite": {"roads": ["bend"], "vehicles": ["bus"]}, "files": {}}
    return Entry(revision, "2026-02-01T00:00:00+00:00", base, machine, {"piqp": piqp}, work, "fine", values)


def slower_since(first: int, count: int = 40) -> list[Entry]:
    return [entry(number, 1.15 if number >= first else 1.0, piqp="0.62" if number >= first else "0.61") for number in range(count)]


def only(entries: list[Entry]) -> Trend:
    (trend,) = trends_of(entries)
    return trend


def test_an_entry_comes_back_as_it_was_kept_and_replaces_that_of_its_commit(tmp_path: Path) -> None:
    kept = entry(3, 1.0)
    file = write_entry(kept, tmp_path / "history")
    assert file == tmp_path / "history" / kept.file
    assert file.stat().st_size < 2000
    (read,) = read_entries(tmp_path / "history")
    assert json.dumps(asdict(read)) == json.dumps(asdict(kept))  # it has numbers that are NaN, which equal nothing
    write_entry(replace(kept, verdict="regressed"), tmp_path / "history")
    assert [one.verdict for one in read_entries(tmp_path / "history")] == ["regressed"]


def test_entries_come_by_date_of_commit_whatever_their_names(tmp_path: Path) -> None:
    for number in (5, 1, 30, 2):
        write_entry(entry(number, 1.0), tmp_path)
    east = replace(entry(9, 1.0), revision=Revision("e" * 40, "east", "2026-01-01T10:30:00+09:00"))  # 02:30 in the others' zone
    write_entry(east, tmp_path)
    (tmp_path / "README.md").write_text("ours", encoding="utf-8")
    (tmp_path / "notes.json").write_text("{", encoding="utf-8")
    assert [one.revision.subject for one in read_entries(tmp_path)] == ["change 1", "change 2", "east", "change 5", "change 30"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "Expecting"),
        ("[]", "cannot be read"),
        ("{}", "'format'"),
        ('{"format": 2}', "its format is 2"),
        ("\udcff", "cannot be read"),
    ],
)
def test_a_damaged_file_is_named(tmp_path: Path, text: str, words: str) -> None:
    write_entry(entry(1, 1.0), tmp_path)
    (tmp_path / entry(2, 1.0).file).write_text(text, encoding="utf-8", errors="surrogateescape")
    with pytest.raises(OptionError, match=words) as caught:
        read_entries(tmp_path)
    assert entry(2, 1.0).file in str(caught.value)


def test_a_time_without_a_zone_and_a_number_without_a_float_do_not_end_in_a_bug(tmp_path: Path) -> None:
    write_entry(entry(1, 1.0), tmp_path)
    other = entry(2, 1.0)
    file = write_entry(replace(other, revision=replace(other.revision, committed="2026-01-01T03:00:00")), tmp_path)
    assert [one.revision.subject for one in read_entries(tmp_path)] == ["change 1", "change 2"]
    told = json.loads(file.read_text(encoding="utf-8"))
    told["values"][0]["new"] = 10**400
    file.write_text(json.dumps(told), encoding="utf-8")
    with pytest.raises(OptionError, match="too large"):
        read_entries(tmp_path)


def test_versions_that_differ_between_the_sides_are_told(cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for side, numpy in (("base", "2.1"), ("new", "2.2")):
        folder = tmp_path / "out" / side / "00"
        folder.mkdir(parents=True)
        told = {"software": {"hdvplan": "0.1.0", "packages": {"numpy": numpy, "piqp": "0.61"}}}
        (folder / "run.json").write_text(json.dumps(told), encoding="utf-8")
    python = tmp_path / "python"
    python.touch(mode=0o755)
    monkeypatch.setattr("hdvplan.bench.guard._compared", lambda *_: of_one_cell())
    outcome = cli("bench", "--against", str(python), "--command", "ours", "--out", "out")
    assert (outcome.code, outcome.err) == (0, "versions differ: numpy 2.1 -> 2.2\n")


@pytest.mark.parametrize("name", ["revision", "measured", "machine", "values", "packages", "work", "base"])
def test_no_field_of_a_file_is_trusted(tmp_path: Path, name: str) -> None:
    file = write_entry(entry(1, 1.0), tmp_path)
    told = json.loads(file.read_text(encoding="utf-8"))
    for value in (None, 3, ["x"], "x\x1b[31m", {"commit": 1}):
        file.write_text(json.dumps(told | {name: value}), encoding="utf-8")
        try:
            found = read_entries(tmp_path)
        except OptionError:
            continue
        assert name in {"measured", "base", "machine", "packages", "work"}
        assert "\x1b" not in found[0].measured + found[0].base + titles_of(only(found))[0]


def test_a_folder_without_entries_is_refused(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "missing"):
        with pytest.raises(OptionError, match=r"holds no history|is no folder"):
            read_entries(folder)


def test_a_step_is_found_through_a_drifting_machine_with_what_changed_beside_it() -> None:
    trend = only(slower_since(25))
    step, memory = trend.series
    (change,) = step.changes
    assert step.entries[change.at].revision.subject == "change 25"
    assert change.ratio == pytest.approx(1.15, rel=0.02)  # medians of noise of 1 %
    assert change.versions == ("piqp 0.61 -> 0.62",)
    assert [begin for begin, _ in step.levels] == [0, 25]
    assert memory.changes == ()
    assert trend.base == BASE


def test_without_a_common_base_times_are_what_they_are() -> None:
    trend = only([replace(one, base=f"{number:040x}") for number, one in enumerate(slower_since(25))])
    assert trend.base is None
    assert np.array_equal(trend.series[0].shown, trend.series[0].values)


def test_machines_versions_of_python_and_work_are_never_mixed() -> None:
    entries = [entry(1, 1.0)]
    entries += [replace(entry(2, 1.0), machine={**MACHINE, name: "other"}) for name in MACHINE]
    entries += [replace(entry(3, 1.0), work={"command": ["other"]})]
    entries += [
        replace(entry(4, 1.0), machine={**MACHINE, "system": "another kernel"}, packages={"piqp": "0.62"})
    ]  # these are told instead
    assert sorted(len(trend.entries) for trend in trends_of(entries)) == [1, 1, 1, 1, 1, 2]


def test_a_change_too_small_to_matter_is_not_told() -> None:
    quiet = [
        replace(one, values=(replace(one.values[1], new=231.0 if number < 20 else 232.0),)) for number, one in enumerate(slower_since(99))
    ]
    (series,) = only(quiet).series
    assert len(series.levels) == 2
    assert series.changes == ()


def test_a_number_that_some_entries_lack_has_its_own_series() -> None:
    entries = slower_since(25)
    entries[3] = replace(entries[3], values=(replace(entries[3].values[0], base=np.nan), entries[3].values[1]))
    step, memory = only(entries).series
    assert (len(step.values), len(memory.values)) == (39, 40)
    assert step.entries[step.changes[0].at].revision.subject == "change 25"


def test_tables_chart_and_page_show_the_change() -> None:
    entries = [replace(one, revision=replace(one.revision, subject="<script>alert(1)</script>")) for one in slower_since(25)]
    trend = only(entries)
    series, changes = trend_tables(trend)
    assert (series.row_count, changes.row_count) == (2, 1)
    assert [str(cell) for cell in changes.columns[5].cells] == ["+15 %"]
    assert len(trend_tables(only(slower_since(99)))) == 1
    panel = trend_figure(trend).axes[0]
    assert [text.get_text() for text in panel.texts] == [f"+15 %\n{25:012x}"[:13]]
    section = trend_section(trend)
    assert section.picture == trend_section(trend).picture  # the same history gives the same file
    page = report_html([], "Planning times", [section])
    assert "data:image/svg+xml;base64," in page
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert" in page
    told = trend_json(trend)
    json.dumps(told, allow_nan=False)
    assert told["false_alarms"] == LEVEL


def test_outliers_stay_within_the_chart() -> None:
    entries = slower_since(99)
    entries[7] = replace(entries[7], values=(replace(entries[7].values[0], new=100.0 * entries[7].values[0].new), entries[7].values[1]))
    low, high = trend_figure(only(entries)).axes[0].get_ylim()
    assert 0.8 < low < high < 1.3


def of_one_cell(noise: float = 1.02) -> Comparison:
    cell = ("bend", "bus", "rti", "riccati", "as set")
    one = statistics(Rule())[0]
    times = CellTimes(cell, Decision(Verdict.FINE, 10, 1e-3, 1.1e-3, 1.1, 1.0, 1.2, noise))
    return Comparison((), (times,), Verdict.FINE, 10, (Found(one, 1.0, 1.1, 1.1, 10, 1.0, 1.2, Verdict.FINE),))


def test_what_is_kept_of_a_comparison_are_both_sides_of_each_number(tmp_path: Path) -> None:
    (tmp_path / "new" / "00").mkdir(parents=True)
    told = {"software": {"hdvplan": "0.1.0", "packages": {"piqp": "0.61"}}}
    (tmp_path / "new" / "00" / "run.json").write_text(json.dumps(told), encoding="utf-8")
    kept = entry_of(of_one_cell(), Revision("a" * 40, "x", "2026-01-01T00:00:00+00:00"), BASE, CommandWork(("ours",)), tmp_path)
    assert [(one.cell, one.what, one.base, one.new) for one in kept.values] == [
        ("bend bus rti riccati", STEP, 1.0, 1.1), (ALL_CELLS, "from outside", 1.0, 1.1)
    ]  # fmt: skip
    assert kept.packages == {"hdvplan": "0.1.0", "piqp": "0.61"}
    assert kept.work == {"command": ["ours"]}
    assert {"processor", "usable_cores", "platform", "python_minor"} <= set(kept.machine)
    assert values_of(failed("new", "it crashes", "")) == ()


def test_the_same_suite_is_the_same_work_until_a_file_of_it_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bend.csv").write_text("s,kappa\n0,0\n", encoding="utf-8")
    suite = Suite(roads=("bend.csv", "uturn"), horizon=50.0)
    before = work_words(suite)
    assert before["suite"] == {"roads": ["bend.csv", "uturn"], "horizon": 50.0}  # a later version's new settings change nothing
    Path("bend.csv").write_text("s,kappa\n0,1\n", encoding="utf-8")
    assert work_words(suite) != before


def test_the_command_prints_the_trend_and_draws_a_chart_for_each_machine(cli: Cli, tmp_path: Path) -> None:
    for one in slower_since(25):
        write_entry(one, tmp_path / "history")
    write_entry(
        replace(entry(1, 1.0), machine={**MACHINE, "processor": "other"}, measured="2026-01-01T00:00:00+00:00"), tmp_path / "history"
    )
    outcome = cli("history", "history")
    assert outcome.code == 0, outcome.err
    assert "40 commits: bend; bus; Xeon, CPython 3.11" in outcome.out
    assert "+15 % at" in outcome.out
    assert outcome.err == "chart in history/history.png\nchart in history/history-2.png\n"
    assert (tmp_path / "history" / "history-2.png").read_bytes().startswith(b"\x89PNG")
    outcome = cli("history", "history", "--out", "chart.svg", "--json")
    assert outcome.err == ""
    assert [len(trend["commits"]) for trend in json.loads(outcome.out)] == [40, 1]
    assert (tmp_path / "chart.svg").is_file()
    outcome = cli("report", "--history", "history", "--out", "report.html")
    assert (outcome.code, outcome.err.startswith("wrote report.html: 0 plans and a history")) == (0, True)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.count('class="trend"') == 2
    assert "<title>Planning time by commit</title>" in page


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("missing",), "error: missing is no folder"),
        (("history", "--out", "chart.gif"), "error: the chart's ending must be png, pdf or svg"),
        (("history", "--out", "missing/chart.png"), "error: cannot write missing/chart.png"),
    ],
)
def test_what_is_no_history_is_refused(cli: Cli, tmp_path: Path, arguments: tuple[str, ...], words: str) -> None:
    write_entry(entry(1, 1.0), tmp_path / "history")
    outcome = cli("history", *arguments, "--quiet")
    assert (outcome.code, outcome.err.startswith(words)) == (2, True)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_a_result_is_kept_only_where_it_is_of_a_commit(cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tests.bench.test_bisect import OURS, git  # noqa: PLC0415 - a repository as there

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    bench = ("bench", "--command", "python ours.py", "--quiet", "--out", str(tmp_path / "out"), "--history", str(tmp_path / "kept"))
    outcome = cli(*bench, "--against", "./python")
    assert outcome.code == 2
    top = tmp_path / "theirs"
    git(tmp_path, "init", "--quiet", str(top))
    (top / "ours.py").write_text(OURS.format(slow=1.0), encoding="utf-8")
    git(top, "add", ".")
    git(top, "commit", "--quiet", "--message", "one")
    monkeypatch.chdir(top)
    assert cli(*bench, "--against", "HEAD").code in {0, 3}
    (kept,) = read_entries(tmp_path / "kept")
    assert (kept.revision.subject, kept.revision.commit, kept.base) == ("one", git(top, "rev-parse", "HEAD"), git(top, "rev-parse", "HEAD"))
    assert {"depot"} <= {one.cell for one in kept.values}
    (top / "ours.py").write_text(OURS.format(slow=1.0) + "# changed", encoding="utf-8")
    shutil.rmtree(tmp_path / "kept")
    assert cli(*bench, "--against", "HEAD").code in {0, 3}
    assert not (tmp_path / "kept").exists()
