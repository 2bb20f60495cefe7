from __future__ import annotations

import gzip
import json
import re
import shutil
import signal
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from hdvplan.bench.measuring.courses import cases_of
from hdvplan.bench.suite import suite_of
from tests.bench.conftest import TINY, Cli

SHORTEST = (*TINY, "--rounds", "1", "--schemes", "rti")
TABLES = ("timing", "envelope", "schemes", "summary")
KEY = ["road", "vehicle", "scheme", "solver", "limits"]


@pytest.fixture
def finished(finished_run: Path, tmp_path: Path) -> tuple[str, ...]:
    """Return the command of a finished run, a copy of which lies in ``run``."""
    shutil.copytree(finished_run, tmp_path / "run")
    return ("bench", "--roads", str(finished_run.parent / "short.csv"), *TINY, "--rounds", "3", "--schemes", "rti", "--out", "run")


def files_of(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_limits_that_plans_break_are_told_and_those_that_are_kept_are_not(cli: Cli, tmp_path: Path, short_road: str) -> None:
    for half_width, broken in (("0.1", True), ("3", False)):
        outcome = cli("bench", "--roads", short_road, *SHORTEST, "--half-width", half_width, "--out", half_width)
        assert outcome.code == 0
        for text in (outcome.out, (tmp_path / half_width / "summary.md").read_text(encoding="utf-8")):
            assert bool(re.search(r"bus, rti: plans break their limits by up to \d\.\d\d m", text)) == broken


def test_a_run_writes_every_file_of_the_contract_with_captions_that_tell_accuracy(cli: Cli, tmp_path: Path, short_road: str) -> None:
    outcome = cli("bench", "--roads", short_road, *TINY, "--out", "run")
    assert outcome.code == 0
    folder = tmp_path / "run"
    assert files_of(folder) == sorted(["run.json", "samples.csv.gz", *(f"{t}.{kind}" for t in TABLES for kind in ("csv", "md", "tex"))])
    timing, envelope, samples = (pd.read_csv(folder / name) for name in ("timing.csv", "envelope.csv", "samples.csv.gz"))
    for table in (timing, envelope):
        assert list(table.columns[:5]) == KEY
        assert len(table) == 4  # rti and sqp with riccati and piqp
    assert {"mean_ms", "p50_ms", "p95_ms", "p99_ms", "max_ms", "linearise_ms", "update_ms", "solve_ms", "check_ms"} <= set(timing)
    assert {"iterations_mean", "iterations_max", "failures", "primal_max", "status", "nonzeros"} <= set(timing)
    assert (timing["status"] == "ok").all()
    assert {"max_left_m", "max_right_m", "imbalance_m", "mean_abs_imbalance_m", "limit_violation_m", "path_difference_m"} <= set(envelope)
    # Solvers at 1e-8 agree far within the 1e-6 m that is asked of them.
    assert (envelope["path_difference_m"] < 1e-6).all()
    assert len(samples) == 4 * 2 * 12  # cells, rounds, steps
    assert list(samples.columns[:7]) == [*KEY, "round", "step"]
    warm = samples[samples["step"] > 0]
    # Samples are written with seven digits; the table is made from all of them.
    np.testing.assert_allclose(1e3 * warm.groupby(KEY, sort=False)["total_s"].mean(), timing["mean_ms"], rtol=1e-6)
    for name in TABLES:
        text = (tmp_path / "run" / f"{name}.md").read_text(encoding="utf-8")
        caption, rows_of_text, foot = text.split("\n\n")
        assert "riccati is fastest in" in foot
        assert "riccati 0.1.0, tolerance 1e-08" in foot
        assert "limits 0.5 m beyond the geometric half width" in caption
        lines = rows_of_text.strip().splitlines()
        assert len({line.count("|") for line in lines}) == 1
        rows = len(pd.read_csv(tmp_path / "run" / f"{name}.csv"))
        assert len(lines) == rows + 2
        tex = (tmp_path / "run" / f"{name}.tex").read_text(encoding="utf-8")
        assert tex.count("\\\\\n") == rows + 1  # rows and the heading
        assert f"tab:hdvplan-{name}" in tex
    caption = (tmp_path / "run" / "timing.md").read_text(encoding="utf-8").partition("\n\n")[0]
    assert "largest path difference from riccati (at 1e-08): piqp at 1e-08:" in caption


def test_run_json_says_what_was_measured_with_what_and_where(cli: Cli, tmp_path: Path, short_road: str) -> None:
    assert cli("bench", "--roads", short_road, *SHORTEST, "--pinch", "0.3", "--out", "run").code == 0
    record = json.loads((tmp_path / "run" / "run.json").read_text(encoding="utf-8"))
    assert record["settings"]["roads"] == [short_road]
    assert (record["settings"]["pinch"], record["settings"]["rounds"], record["settings"]["slack"]) == (0.3, 1, 0.5)
    assert {"hdvplan", "source", "behaviour", "packages"} <= set(record["software"])
    assert {"numpy", "piqp", "osqp"} <= set(record["software"]["packages"])
    assert {"processor", "cores", "governor", "python", "system"} <= set(record["machine"])
    cases = cases_of(suite_of(record["settings"]))
    assert record["cases"] == [json.loads(json.dumps(case.brief())) for case in cases]
    (session,) = record["sessions"]
    assert session["one_thread"] is True
    assert record["finished"] >= session["started"]


@pytest.mark.slow
def test_the_headline_fits_80_columns_and_json_is_json(cli: Cli, short_road: str) -> None:
    what = ("--roads", short_road, "--vehicles", "bus,tractor-trailer", "--solvers", "riccati,qpsolvers/piqp")
    arguments = ("bench", *what, "--in-process", "--horizon", "30", "--rounds", "1", "--out", "run")
    outcome = cli(*arguments)
    assert outcome.code == 0
    assert outcome.err.endswith("written to run/\n")
    assert "measuring" not in outcome.err  # no bar where there is no terminal
    assert max(len(line) for line in outcome.out.splitlines() if " fastest in " not in line) <= 80
    for words in ("bus, rti: one planning step [ms]", "tractor-trailer, sqp: one", "qpsolvers/piqp", "SQP / RTI"):
        assert words in outcome.out
    assert outcome.out.count("--accuracy 1e-4") == 1  # the mode that compares at an equal one
    answer = json.loads(cli(*arguments, "--json").out)
    assert len(answer["timing"]) == 8
    assert [one["winner"] for one in answer["verdict"]] == ["riccati"] * 4  # four to thirty times as fast: no machine's mood turns that
    assert len(re.findall(r"riccati is fastest in \d+ % of 11 steps", outcome.out)) == 4
    assert answer["timing"][0]["message"] is None


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
def test_a_run_that_is_ended_by_a_signal_says_how_to_go_on_too(
    cli: Cli, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], short_road: str
) -> None:
    monkeypatch.setattr("hdvplan.bench.measuring.measure.measure", lambda *_, **__: signal.raise_signal(signal.SIGTERM))
    with pytest.raises(SystemExit, match="143"):
        cli("bench", "--roads", short_road, *TINY, "--out", "run")
    assert capsys.readouterr().err == "0 of 8 drives are saved in run; the same command continues the run\n"


@pytest.mark.slow
def test_an_interrupted_run_says_how_to_go_on_and_does_not_repeat_what_it_has(
    cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, short_road: str
) -> None:
    import hdvplan.bench.measuring.measure  # noqa: PLC0415 - watched from here on

    real, calls = hdvplan.bench.measuring.measure.measure, []

    def measure(*arguments: object, **options: object) -> object:
        calls.append(arguments)
        if len(calls) == 4:
            raise KeyboardInterrupt
        return real(*arguments, **options)  # type: ignore[arg-type] # passed through as they came

    monkeypatch.setattr("hdvplan.bench.measuring.measure.measure", measure)
    command = ("bench", "--roads", short_road, *TINY, "--out", "run")
    outcome = cli(*command)
    assert outcome.code == 130
    assert outcome.err == "3 of 8 drives are saved in run; the same command continues the run\nerror: interrupted\n"
    assert not (tmp_path / "run" / "timing.csv").exists()
    assert cli(*command).code == 0
    assert len(calls) == 4 + 5
    record = json.loads((tmp_path / "run" / "run.json").read_text(encoding="utf-8"))
    assert len(record["sessions"]) == 2
    assert record["finished"]

    again = cli(*command)
    assert again.code == 0
    assert again.err.startswith("run already has this run")
    assert len(calls) == 9
    assert cli(*command, "--fresh").code == 0
    assert len(calls) == 17


UNREADABLE = [  # a file of a finished run, what somebody made of it, the options that need it, and what is said
    ("run.json", b"[" * 200_000, (), "run.json is nested too deeply"),
    ("run.json", b"[]", (), "is not of a benchmark"),
    ("run.json", b'{"sessions": 5, "finished": null}', (), "is not of a benchmark"),
    ("timing.csv", b"", (), "timing.csv cannot be read"),
    ("timing.csv", b"a,b\n1,inf\n", ("--json",), "error: "),
    ("timing.csv", b"a,b\n1,2\n", ("--plot",), "cannot be shown"),
    ("summary.csv", None, (), "summary.csv cannot be read"),
    ("summary.csv", b"a,b\n1,2\n", (), "cannot be shown"),
    ("samples.csv.gz", b"no gzip", ("--plot",), "samples.csv.gz cannot be read"),
    ("samples.csv.gz", gzip.compress(b"a,b\n1,2\n", mtime=0), ("--plot",), "cannot be shown"),
]


@pytest.mark.parametrize(("file", "content", "options", "words"), UNREADABLE)
def test_a_finished_run_that_somebody_changed_is_refused(
    cli: Cli, tmp_path: Path, finished: tuple[str, ...], file: str, content: bytes | None, options: tuple[str, ...], words: str
) -> None:
    (tmp_path / "run" / file).unlink()
    if content is not None:
        (tmp_path / "run" / file).write_bytes(content)
    outcome = cli(*finished, *options)
    assert (outcome.code, outcome.err.count("error: "), outcome.err.count("hint: ")) == (2, 1, 1)
    assert words in outcome.err
    assert ": None" not in outcome.err


@pytest.mark.parametrize(
    ("change", "words"), [(("--rounds", "4"), "rounds was 3, is 4"), (("--solvers", "piqp"), "solvers was riccati,piqp")]
)
def test_a_folder_with_another_run_is_not_mixed_up(cli: Cli, finished: tuple[str, ...], change: tuple[str, str], words: str) -> None:
    outcome = cli(*finished, *change)
    assert outcome.code == 2
    assert outcome.err.startswith("error: run holds a run with other settings: ")
    assert words in outcome.err
    assert "hint: start over with --fresh" in outcome.err


def test_a_run_under_another_number_of_cores_says_how_to_have_as_many_again(
    cli: Cli, finished: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hdvplan.machine.usable_cores", lambda: 77)
    outcome = cli(*finished)
    assert outcome.code == 2
    assert "usable_cores was " in outcome.err
    assert "hint: continue on as many cores, such as by taskset -c 0,1, start over with --fresh, or" in outcome.err


def test_a_road_that_was_edited_meanwhile_is_another_run(cli: Cli, short_road: str) -> None:
    command = ("bench", "--roads", short_road, *SHORTEST, "--out", "run")
    assert cli(*command).code == 0
    with Path(short_road).open("a", encoding="utf-8") as road:
        road.write("65,0\n")
    outcome = cli(*command)
    assert outcome.code == 2
    assert f"other files: {short_road} was" in outcome.err


def test_parts_of_an_unknown_run_are_not_used(cli: Cli, tmp_path: Path, short_road: str) -> None:
    parts = tmp_path / "run" / "parts"
    parts.mkdir(parents=True)
    (parts / "00000.0.npz").write_bytes(b"from who knows where")
    assert cli("bench", "--roads", short_road, *SHORTEST, "--out", "run").code == 0


@pytest.mark.slow
@pytest.mark.parametrize(("profile", "words"), [("0,0\n20,0\n", "the drive has only one step")])
def test_a_road_of_which_nothing_can_be_sampled_is_a_row_and_ends_nothing(cli: Cli, tmp_path: Path, profile: str, words: str) -> None:
    (tmp_path / "road.csv").write_text(f"s,kappa\n{profile}", encoding="utf-8")
    assert (
        cli(
            "bench", "--roads", "road.csv", *SHORTEST, "--sample", "2", "--replan", "30", "--half-width", "3", "--out", "run", "--plot"
        ).code
        == 0
    )
    timing = pd.read_csv(tmp_path / "run" / "timing.csv")
    assert (timing["status"] == "nothing recorded").all()
    assert timing["message"].str.startswith("nothing was recorded: ").all()
    assert timing["message"].str.contains(words).all()


def test_a_finished_run_is_drawn_after_a_change_of_source_but_not_after_one_of_settings(
    cli: Cli, tmp_path: Path, finished: tuple[str, ...]
) -> None:
    record = json.loads((tmp_path / "run" / "run.json").read_text(encoding="utf-8"))
    record["software"]["source"] = "another"
    del record["settings"]["memory_limit"]  # as of a version before there was one
    (tmp_path / "run" / "run.json").write_text(json.dumps(record), encoding="utf-8")
    assert cli(*finished, "--plot").code == 0
    assert (tmp_path / "run" / "bench.png").is_file()
    measured = cli(*finished)
    assert measured.code == 2
    assert "memory_limit was not known, is None" in measured.err
    other = cli(*finished, "--slack", "0.7", "--plot")
    assert other.code == 2
    assert "slack was 0.5, is 0.7" in other.err


def test_fresh_deletes_only_what_a_benchmark_writes(cli: Cli, tmp_path: Path, finished: tuple[str, ...]) -> None:
    (tmp_path / "run" / "notes.txt").write_text("mine", encoding="utf-8")
    assert cli(*finished, "--rounds", "1", "--fresh", "--quiet").out == ""
    assert "notes.txt" in files_of(tmp_path / "run")


AGAINST = ("--against", "HEAD")
REFUSED = [
    (("--solvers", "osqpp"), "unknown solver 'osqpp'"),
    (("--roads", "nowhere"), "nowhere"),
    (("--vehicles", "tank"), "unknown vehicle 'tank'"),
    (("--schemes", "fast"), "unknown scheme 'fast'"),
    (("--rounds", "0"), "rounds must be"),
    (("--suite", "none.toml"), "cannot be read"),
    (("--no-limits", "--pinch", "1"), "without limits"),
    (("--no-limits", "--slack", "1"), "without limits"),
    (("--factor", "1.2"), "need --against"),
    (("--command", "true"), "need --against"),
    (("--expect-changes",), "need --against"),
    (("--renew",), "--renew needs --counters"),
    (("--format", "tap"), "--format must be"),
    (("--memory-limit", "5"), "need a process that can be ended"),
    (("--export-qps", "qps", *AGAINST), "so --against, --counters and --plot do not apply"),
    (("--export-qps", "qps", "--counters", "c.csv"), "so --against, --counters and --plot do not apply"),
    (("--export-qps", "qps", "--plot", "b.png"), "so --against, --counters and --plot do not apply"),
    ((*AGAINST, "--counters", "c.csv"), "not with a file"),
    (("--export-qps", "qps", "--strict"), "measures none"),
    (("--counters", "none.csv"), "counters none.csv cannot be read"),
    ((*AGAINST, "--command", "true"), "do not apply"),
    ((*AGAINST, "--roads", "nowhere"), "nowhere"),
    ((*AGAINST, "--solvers", "osqpp"), "unknown solver"),
    ((*AGAINST, "--factor", "1"), "must be above 1"),
    ((*AGAINST, "--time-limit", "0"), "--time-limit must be a positive number of seconds"),
]


@pytest.mark.parametrize(("arguments", "words"), REFUSED)
def test_a_wrong_request_ends_in_2_and_leaves_nothing(
    cli: Cli, tmp_path: Path, short_road: str, arguments: tuple[str, ...], words: str
) -> None:
    outcome = cli("bench", "--roads", short_road, *TINY, *arguments, "--out", "run")
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err.startswith("error: ")
    assert words in outcome.err
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(("command", "words"), [("'", "cannot be split"), (" ", "is empty")])
def test_a_command_of_no_words_is_refused(cli: Cli, command: str, words: str) -> None:
    outcome = cli("bench", *AGAINST, "--command", command)
    assert (outcome.code, words in outcome.err, "hint: " in outcome.err) == (2, True, True)


def test_over_budget_is_a_row_and_the_run_ends_well(cli: Cli, tmp_path: Path, short_road: str) -> None:
    outcome = cli("bench", "--roads", short_road, *TINY, "--budget", "1e-9", "--out", "run")
    assert outcome.code == 0
    timing = pd.read_csv(tmp_path / "run" / "timing.csv")
    assert (timing["status"] == "over budget").all()
    assert (timing["steps"] == 0).all()
    assert outcome.out.count("2 of 2 cells are not ok") == 2
    assert f"riccati, over budget in 2 of 2 cells; {short_road}, bus, rti: stopped after " in outcome.out
    told = " ".join(outcome.out.split())
    assert "the largest distance of e_y from the optimum: riccati at 1e-08:" in told
    assert "; piqp at 1e-08:" in told
    assert "bus, rti: no winner: no solver finished within its budget" in outcome.out
    again = cli("bench", "--roads", short_road, *TINY, "--budget", "1e-9", "--out", "run", "--strict")
    assert again.code == 1
    assert "error: 4 of 4 cells are not ok\nhint: run/timing.csv has each" in again.err


@pytest.mark.slow
def test_a_finished_run_is_drawn_by_the_same_command(cli: Cli, tmp_path: Path, short_road: str) -> None:
    command = ("bench", "--roads", short_road, *SHORTEST, "--out", "run", "--quiet")
    assert cli(*command, "--plot").code == 0
    assert (tmp_path / "run" / "bench.png").read_bytes().startswith(b"\x89PNG")
    for name, begin in (("a.pdf", b"%PDF"), ("b.svg", b"<?xml")):
        assert cli(*command, "--plot", name).code == 0
        assert (tmp_path / name).read_bytes().startswith(begin)
    outcome = cli(*command, "--plot", "c.tex")
    assert (outcome.code, outcome.err.splitlines()[0]) == (2, "error: the picture's ending must be png, pdf or svg, not 'tex'")
    assert cli(*command, "--plot", "no/where.png").code == 2


def test_every_printed_ratio_is_the_quotient_of_the_printed_times(cli: Cli, short_road: str) -> None:
    """Where both solvers did every step: else ``x best`` is over the steps that both did, as its foot says."""
    out = cli("bench", "--roads", short_road, *TINY, "--out", "run").out
    found = re.findall(r"^ *(\S+) +([\d.]+) +([\d.]+) +\d+% +100% ", out, flags=re.MULTILINE)
    rows = [(solver, float(step), float(ratio)) for solver, step, ratio in found]
    assert len(rows) == 4  # rti and sqp with two solvers
    for best, other in (rows[:2], rows[2:]):
        assert best[2] == 1.0
        quotient = other[1] / best[1]
        assert other[2] == pytest.approx(quotient, abs=0.05 + quotient * 5e-4 * (1 / best[1] + 1 / other[1]))  # halves of last digits


TIRED = """
from hdvplan.solvers.riccati import RiccatiWorkspace

class Tired(RiccatiWorkspace):
    def solve(self, qp, guess):
        raise RuntimeError("tired")
"""


@pytest.mark.parametrize(("solver", "code"), [("tired.py:Tired", 1), ("riccati", 0)])
def test_exported_programs_are_counted_and_a_drive_that_ended_early_is_told(
    cli: Cli, tmp_path: Path, short_road: str, solver: str, code: int
) -> None:
    (tmp_path / "tired.py").write_text(TIRED, encoding="utf-8")
    words = ("--vehicles", "bus", "--schemes", "rti", "--solvers", solver, "--export-qps", "qps", "--qp-format", "npz")
    outcome = cli("bench", "--roads", short_road, *words)
    (drive,) = json.loads((tmp_path / "qps" / "manifest.json").read_text(encoding="utf-8"))["sequences"]
    count, ended = len(drive["programs"]), drive["ended"]
    told = f"warning: {drive['name']} ended early, after {count} QPs: {ended}\n" if code else ""
    assert (outcome.code, outcome.err) == (code, f"wrote qps/, QPs: {count}, drives: 1\n{told}")
    assert (ended is not None) == bool(code) == (count < 2)


def test_counters_do_not_depend_on_where_a_benchmark_starts(cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "ci"
    folder.mkdir()
    monkeypatch.chdir(tmp_path)
    (folder / "depot.csv").write_text("x,y\n" + "".join(f"{x},0\n" for x in range(0, 41, 4)), encoding="utf-8")
    entries = 'roads = ["depot.csv"]\nvehicles = ["bus"]\nschemes = ["rti"]\nsolvers = ["riccati"]\nrounds = 1\nhorizon = 20\n'
    (folder / "gate.toml").write_text(entries, encoding="utf-8")
    options = ("--in-process", "--quiet", "--out", str(tmp_path / "out"), "--counters", str(tmp_path / "kept.csv"))
    assert cli("bench", "--suite", "ci/gate.toml", *options, "--renew").code == 0
    monkeypatch.chdir(folder)
    again = cli("bench", "--suite", "gate.toml", *options)  # it is the same run, which is there already
    assert (again.code, again.out) == (0, "fine: no counter changed\n")
