"""``hdvplan judge --loop``: a path that a simulated driver follows, told, written and judged."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pandas as pd
import pytest

from tests.cli.conftest import Cli

ROAD = ("short.csv", "--vehicle", "bus", "--no-plot")


def test_the_command_tells_and_writes_what_runs_did(cli: Cli, short_road: str) -> None:
    assert cli("plan", *ROAD, "--half-width", "3", "--out", "plan").code == 0
    judged = cli("judge", "plan/path.csv", short_road, *ROAD[1:], "--half-width", "3", "--loop", "driver", "--out", "judged")
    assert judged.code == 0
    assert judged.out.splitlines()[2].startswith("YES: in a closed loop 12 of 12 runs keep the street")
    assert len(pd.read_csv("judged/loop.csv")) == 12


def test_a_street_that_a_path_keeps_and_its_driver_does_not_is_exit_code_1_and_the_worst_run_can_be_judged(
    cli: Cli, short_road: str
) -> None:
    assert cli("plan", *ROAD, "--half-width", "1.8", "--out", "plan").code == 0
    arguments = (short_road, *ROAD[1:], "--half-width", "1.8")
    judged = cli("judge", "plan/path.csv", *arguments, "--loop", "pure-pursuit", "--runs", "2", "--noise", "3", "--out", "judged")
    assert judged.code == 1
    assert [line.partition(":")[0] for line in judged.out.splitlines()[:2]] == ["NO", "YES"]  # what does not hold is read first
    looped = json.loads(Path("judged/summary.json").read_text(encoding="utf-8"))["loop"]
    assert (looped["fits"], looped["runs"], looped["text"]) == (False, 6, judged.out.splitlines()[0])
    assert json.loads(cli("judge", "plan/path.csv", *arguments, "--loop", "driver", "--runs", "1", "--json").out)["loop"]["runs"] == 3
    assert re.search(r"error: in a closed loop \d of 6 runs keep the street; run \d is the worst, 0\.\d\d m lacking", judged.err)
    worst = cli("judge", "judged/loop_worst.csv", *arguments, "--json", "--out", "worst")
    least = pd.read_csv("judged/loop.csv")["spare_m"].min()
    assert looped["worst"]["spare_m"] == pytest.approx(least, abs=1e-6)  # rounded in the table
    assert f'"min_clearance_m": {least:.4f}'[:-2] in worst.out


def test_runs_that_lose_the_path_are_told_as_such_and_in_the_picture(cli: Cli, short_road: str) -> None:
    assert cli("plan", *ROAD, "--half-width", "3", "--out", "plan").code == 0
    Path("me.py").write_text("def steer(track, seen):\n    return 5.0 * seen.offset\n", encoding="utf-8")
    own = ("--half-width", "3", "--loop", "me.py:steer", "--runs", "1", "--out", "judged", "--format", "svg")
    judged = cli("judge", "plan/path.csv", short_road, "--vehicle", "bus", *own)
    assert judged.code == 1
    assert judged.out.startswith(
        "NO: in a closed loop 0 of 3 runs keep the street; 3 lose the path: they were 10 m beside it or turned by 90"
    )
    assert "strays by" not in judged.err  # how far they went is where they were stopped
    assert judged.err.endswith("hint: loop.csv has all runs; loop_worst.csv is where the worst one was\n")
    assert list(pd.read_csv("judged/loop.csv")["lost"]) == [True] * 3
    assert "in a closed loop 0 of 3 runs keep the street" in Path("judged/plan.svg").read_text(encoding="utf-8")


def test_what_a_follower_of_one_s_own_does_wrong_names_it_once(cli: Cli, short_road: str) -> None:
    assert cli("plan", *ROAD, "--out", "plan").code == 0
    Path("me.py").write_text("def steer(track, seen):\n    return 0.0\n", encoding="utf-8")
    wrong = cli("judge", "plan/path.csv", short_road, *ROAD[1:], "--loop", "me.py:steer", "--quiet")
    assert wrong.code == 2
    assert wrong.err.splitlines() == [
        "error: follower 'me.py:steer' returns an array that cannot be steered by",
        "hint: one finite angle [rad] for each of 12 runs",
    ]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--delay", "1"), "--delay is of a closed loop, and none was asked for"),
        (("--loop", "me"), "unknown follower 'me'"),
        (("--loop", "me.py:me"), "there is no file 'me.py'"),
        (("--loop", "driver", "--runs", "0"), "runs must be"),
    ],
)
def test_what_is_no_closed_loop_is_refused(cli: Cli, short_road: str, options: tuple[str, ...], words: str) -> None:
    Path("path.csv").write_text("x,y\n0,0\n60,0\n", encoding="utf-8")
    outcome = cli("judge", "path.csv", short_road, "--vehicle", "bus", *options)
    assert (outcome.code, outcome.out) == (2, "")
    assert words in outcome.err
