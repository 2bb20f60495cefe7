"""``hdvplan study`` as its users start it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from hdvplan.answers import NO, YES
from hdvplan.study.conduct import run as run_study
from hdvplan.study.spec import read_study
from hdvplan.study.store import KEPT
from tests.nightly import nightly
from tests.road.drives import line_feature, written
from tests.study.conftest import Cli, InHere, kept_in
from tests.study.test_engines import FAULTY
from tests.study.test_run import exact

STUDY = 'roads = ["bend.csv", "lane.geojson"]\nvehicles = ["bus"]\nhalf_widths = [1.55, 3.5]\nsettings = { horizon = 30, refine = false }\n'


@pytest.fixture
def study_file(folder: Path) -> Path:
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    return folder / "study.toml"


@pytest.mark.slow
def test_a_study_ends_in_0_with_its_files_and_a_sentence(cli: Cli, study_file: Path) -> None:
    outcome = cli("study", "study.toml", "--out", "out", "--workers", "2")
    assert outcome.code == 0
    assert outcome.out.startswith("4 cells: 2 YES, 2 NO\n")
    assert "places that need the least widening" in outcome.out
    assert outcome.out.endswith("written to out/\n")
    assert {path.name for path in Path("out").iterdir()} == {
        "cells.parquet", "cells.csv", "places.parquet", "ranking.csv", "straying.csv", "map.html", "table.xlsx", "study.json", KEPT
    }  # fmt: skip
    again = cli("study", str(study_file), "--out", "out", "--json")
    assert json.loads(again.out) == {"out": "out", "cells": 4, "outcomes": {"planned": 4}, "fits": {YES: 2, NO: 2}}
    assert again.err == ""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
def test_cells_without_an_answer_end_in_1(cli: Cli, study_file: Path) -> None:
    Path("faulty.py").write_text(FAULTY, encoding="utf-8")
    study_file.write_text(
        STUDY.replace("[1.55, 3.5]", "[3.5]").replace("settings", 'solvers = ["faulty.py:Killing"]\nsettings'), encoding="utf-8"
    )
    outcome = cli("study", "study.toml", "--out", "out", "--workers", "1", "--retries", "0", "--quiet")
    assert (outcome.code, outcome.out) == (1, "")
    said = outcome.err.splitlines()
    assert (said[0], len(said)) == ("error: 2 cells without an answer", 3)
    assert said[1].startswith("2 killed: ")
    assert said[2].endswith("the same command tries again those that failed, hung or were killed")


def test_what_is_noted_of_roads_is_said_with_its_cells(cli: Cli, study_file: Path) -> None:
    """A layer that is not read decides the answer: a plan said so, a study did not."""
    edge, line = (np.array([(0.0, y), (60.0, y)]) for y in (3.0, 0.0))
    written(study_file.parent, line_feature(line), line_feature(edge, edge="left"), name="half.geojson")
    study_file.write_text('roads = ["half.geojson"]\nvehicles = ["bus", "citaro"]\nsettings = { horizon = 30 }\n', encoding="utf-8")
    outcome = cli("study", "study.toml", "--out", "out", "--workers", "1")
    assert (outcome.code, outcome.err) == (0, "2 cells: half: no edge on the right: it is open to 20 m\n")


def test_a_study_may_fail_where_a_vehicle_does_not_fit(cli: Cli, study_file: Path) -> None:
    """Do all our vehicles still fit all our roads? As ``hdvplan plan`` answers it, by an exit code."""
    run_study(read_study(study_file), "out", InHere())
    assert cli("study", "study.toml", "--out", "out", "--quiet").code == 0
    outcome = cli("study", "study.toml", "--out", "out", "--quiet", "--fail-on-no")
    assert (outcome.code, outcome.out) == (1, "")
    error, *told, hint = outcome.err.splitlines()
    assert (error, hint) == ("error: 2 cells whose vehicle does not fit", "hint: cells.csv has all, word NO")
    words = [line.partition(" m lacking")[0][:-4] for line in told]  # of what varies, once
    assert words == ["bend, bus, half_width_m 1.55: NO: ", "lane, bus, half_width_m 1.55: NO: "]
    study_file.write_text(STUDY.replace("1.55, ", ""), encoding="utf-8")
    assert cli("study", "study.toml", "--out", "out", "--fail-on-no").code == 0


def test_cells_that_another_solver_planned_are_counted(cli: Cli, study_file: Path) -> None:
    Path("faulty.py").write_text(FAULTY, encoding="utf-8")
    study_file.write_text(STUDY.replace("settings", 'solvers = ["riccati", "faulty.py:Raising"]\nsettings'), encoding="utf-8")
    outcome = cli("study", "study.toml", "--out", "out", "--workers", "1", "--json")
    assert outcome.code == 0
    assert outcome.err == "warning: 4 cells with steps that the solver failed at and another one planned: column rescued_steps\n"


def test_refused_cells_have_no_answer_and_say_why(cli: Cli, study_file: Path) -> None:
    Path("negative.csv").write_text("x,y,left,right\n0,0,3,-3\n30,0,3,-3\n60,0,3,-3\n", encoding="utf-8")
    study_file.write_text('roads = ["negative.csv"]\nvehicles = ["bus"]\n', encoding="utf-8")
    for _ in range(2):  # the second plans nothing: it says the same
        outcome = cli("study", "study.toml", "--out", "out", "--workers", "1")
        assert (outcome.code, outcome.out) == (1, "1 cell: 1 refused\nwritten to out/\n")
        error, reason, hint = outcome.err.splitlines()
        assert error == "error: 1 cell without an answer"
        assert reason.startswith("1 refused: ")
        assert hint == "hint: the column reason of cells.csv has every reason"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("none.toml", "--out", "out"), "study none.toml cannot be read"),
        (("study.toml", "--out", "out", "--workers", "0"), "--workers must be a positive number"),
        (("study.toml", "--out", "out", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1"), "a cluster has its own"),
        (("study.toml", "--out", "bend.csv"), "is a file, not a folder"),
        (("study.toml",), "missing option '--out'"),
    ],
)
def test_a_mistake_ends_in_2_with_one_line(cli: Cli, study_file: Path, arguments: tuple[str, ...], words: str) -> None:
    assert study_file.exists()
    outcome = cli("study", *arguments)
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err.startswith("error: ")
    assert words in outcome.err.splitlines()[0]


def _told(page: str) -> dict[str, Any]:
    """Return the data of a page."""
    (data,) = [part for part in page.split("<script") if 'id="data"' in part]
    told: dict[str, Any] = json.loads(data.partition(">")[2].partition("</script>")[0])
    return told


def test_the_page_is_whole_offline_and_takes_names_for_text(folder: Path) -> None:
    (folder / "lane.geojson").rename(folder / "<script>alert(1)<.geojson")
    (folder / "study.toml").write_text(STUDY.replace("lane.geojson", "*.geojson"), encoding="utf-8")
    run_study(read_study(folder / "study.toml"), folder / "out", InHere())
    page = (folder / "out" / "map.html").read_text(encoding="utf-8")
    assert "<script>alert" not in page
    assert "http" not in page.replace("http-equiv", "")
    told = _told(page)
    assert [road["name"] for road in told["roads"]] == ["<script>alert(1)<"]
    assert told["places"]
    assert "<td>0 of 2</td><td>2 of 2</td>" in page


def test_the_page_holds_no_more_lines_than_it_shows(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hdvplan.study.map_page.MOST_ROADS", 1)
    (folder / "other.geojson").write_text((folder / "lane.geojson").read_text(encoding="utf-8"), encoding="utf-8")
    (folder / "study.toml").write_text(STUDY.replace("lane.geojson", "*.geojson"), encoding="utf-8")
    run_study(read_study(folder / "study.toml"), folder / "out", InHere())
    page = (folder / "out" / "map.html").read_text(encoding="utf-8")
    assert [road["name"] for road in _told(page)["roads"]] == ["lane"]
    assert "Without a place on the Earth: 1 road, in the table" in page
    assert "Not shown: 1 road and 0 places" in page


@pytest.mark.parametrize("limits", ["half_widths = [1.625]", "left = [1.625]\nright = [1.5]", ""], ids=["even", "uneven", "own"])
def test_places_on_the_page_have_one_of_the_widths_to_choose_from(folder: Path, limits: str) -> None:
    lane = json.loads((folder / "lane.geojson").read_text(encoding="utf-8"))
    lane["properties"] |= {"left_m": 1.3, "right_m": 1.3}
    (folder / "lane.geojson").write_text(json.dumps(lane), encoding="utf-8")
    (folder / "study.toml").write_text(
        STUDY.replace("half_widths = [1.55, 3.5]", limits).replace('"bus"', '"tractor-trailer"'), encoding="utf-8"
    )
    run_study(read_study(folder / "study.toml"), folder / "out", InHere())
    told = _told((folder / "out" / "map.html").read_text(encoding="utf-8"))
    assert told["places"]
    assert {place["width"] for place in told["places"]} <= set(told["widths"])


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
@pytest.mark.parametrize("number", [signal.SIGKILL, nightly(signal.SIGINT), nightly(signal.SIGTERM)])
def test_a_study_that_is_ended_goes_on_from_there(study_file: Path, number: signal.Signals, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(study_file.parent)
    widths = ", ".join(f"{1.6 + 0.02 * step:.2f}" for step in range(60))
    study_file.write_text(STUDY.replace("1.55, 3.5", widths), encoding="utf-8")
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\nfrom hdvplan.cli.entry import main; main()"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-c", code, "study", "study.toml", "--out", "out", "--workers", "1"]
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:  # noqa: S603
        until = time.monotonic() + 120.0  # takes some seconds; a machine with other work takes longer
        while not kept_in(Path("out")) and time.monotonic() < until:
            time.sleep(0.05)
        process.send_signal(number)
        said = process.communicate(timeout=60.0)[1]
    assert process.returncode == {signal.SIGKILL: -9, signal.SIGTERM: 143, signal.SIGINT: 130}[number]
    assert number == signal.SIGKILL or "cells are kept in out; the same command continues the study" in said
    kept = kept_in(Path("out"))
    assert 0 < kept < 120
    rest = InHere()
    resumed = run_study(read_study(study_file), "out", rest)
    assert len(rest.worked) == 120 - kept
    whole = run_study(read_study(study_file), "whole", InHere())
    pd.testing.assert_frame_equal(exact(resumed.cells()), exact(whole.cells()))
    pd.testing.assert_frame_equal(resumed.places(), whole.places())
