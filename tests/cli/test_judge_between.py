"""``hdvplan judge`` of points that are far apart, and with ``--loop`` of a path that a simulated driver follows."""

from __future__ import annotations

import json
import re
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import hdvplan
from hdvplan.answers import YES
from hdvplan.arrays import FloatArray
from hdvplan.driving.given import GivenPath
from hdvplan.loop import LoopSettings
from tests.cli.conftest import Cli

_STRAIGHT_M = 45.0  # before a bend of 90 degrees, and after it
_OFF_M = 0.035  # by which the room to spare may be wrong: a bend begins within half a metre


def bend(radius: float, spacing: float, phase: float) -> FloatArray:
    """Return points (n, 2) [m] on straight, arc and straight, exactly."""
    arc = 0.5 * np.pi * radius
    s = np.arange(phase * spacing, 2.0 * _STRAIGHT_M + arc, spacing)
    turned, after = np.clip((s - _STRAIGHT_M) / radius, 0.0, 0.5 * np.pi), np.maximum(s - _STRAIGHT_M - arc, 0.0)
    return np.column_stack([np.minimum(s, _STRAIGHT_M) + radius * np.sin(turned), radius * (1.0 - np.cos(turned)) + after])


def road_of(radius: float) -> str:
    """Write the road of such a bend."""
    begin, end = _STRAIGHT_M, _STRAIGHT_M + 0.5 * np.pi * radius
    rows = [(0.0, 0.0), (begin, 0.0), (begin + 1e-6, 1.0 / radius), (end, 1.0 / radius), (end + 1e-6, 0.0), (end + _STRAIGHT_M, 0.0)]
    Path("bend.csv").write_text("s,kappa\n" + "\n".join(f"{s:.7f},{kappa:.9f}" for s, kappa in rows), encoding="utf-8")
    return "bend.csv"


@pytest.mark.parametrize("radius", [14.0, 18.0, 30.0])
def test_the_room_of_sparse_points_is_that_of_dense_ones_to_what_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, radius: float
) -> None:
    monkeypatch.chdir(tmp_path)
    case = hdvplan.Case(hdvplan.load_road(road_of(radius)).with_limits(4.0, 4.0), hdvplan.load_vehicle("citaro"))
    dense = hdvplan.judge(case, GivenPath(bend(radius, 0.1, 0.0)))
    assert dense.between is None
    for spacing in (2.0, 6.0, 0.5 * radius):  # the last: 29 degrees a point
        for phase in (0.0, 0.35, 0.7):
            points = bend(radius, spacing, phase)
            found = hdvplan.judge(case, GivenPath(points))
            assert found.between is not None
            apart, known = found.between
            off = abs(found.balance.min_clearance - dense.balance.min_clearance)  # type: ignore[operator] # there are limits
            assert apart == pytest.approx(spacing, rel=0.02)  # chords
            assert off < min(_OFF_M, known + 0.01)
            assert known < 0.35 * spacing**2 / radius  # the sagitta of two chords is 0.5 of it


def test_it_is_told_how_well_sparse_points_tell_the_room(cli: Cli) -> None:
    arguments = (road_of(18.0), "--vehicle", "citaro", "--half-width", "3.17", "--no-plot", "--no-proof", "--out", "judged")
    told = {}
    for spacing in (0.5, 6.0):
        np.savetxt("own.csv", bend(18.0, spacing, 0.35), delimiter=",", header="x,y", comments="")
        told[spacing] = cli("judge", "own.csv", *arguments)
        assert told[spacing].out.startswith(f"{YES}: 0.04 m")
        assert ("points are up to 6.0 m apart: between them, what is swept is known to within 0.1" in told[spacing].err) == (spacing > 1.0)
        assert ("warning: with points up to 6.0 m apart the answer may be the other one" in told[spacing].err) == (spacing > 1.0)
    assert "give one every 0.5 to 1 m" in json.loads(Path("judged/summary.json").read_text(encoding="utf-8"))["notes"][-2]


def test_of_a_straight_nothing_hangs_on_what_lies_between(tmp_path: Path) -> None:
    file = tmp_path / "straight.csv"
    file.write_text("s,kappa\n0,0\n200,0\n", encoding="utf-8")
    road, vehicle = hdvplan.load_road(file), hdvplan.load_vehicle("bus")
    x = np.linspace(0.0, 200.0, 21)
    assert hdvplan.judge(hdvplan.Case(road, vehicle), GivenPath(np.column_stack([x, 0.0 * x]))).between == pytest.approx((10.0, 0.0))


@pytest.mark.parametrize(("spacing", "hint"), [(2.0, "keep one every 5 to 10 m"), (9.0, "smooth it, as by a moving mean")])
def test_a_track_that_scatters_is_refused_with_its_turn_and_what_helps(cli: Cli, spacing: float, hint: str) -> None:
    road = road_of(60.0)
    points = bend(60.0, spacing, 0.0) + np.random.default_rng(1).normal(0.0, 0.25 * spacing, (len(bend(60.0, spacing, 0.0)), 2))
    np.savetxt("own.csv", points, delimiter=",", header="x,y", comments="")
    outcome = cli("judge", "own.csv", road, "--vehicle", "citaro")
    assert outcome.code == 2
    assert "turns too sharply for a curve through its points, by" in outcome.err
    assert " degrees within " in outcome.err
    assert hint in outcome.err


def test_a_bend_near_full_lock_is_judged_and_it_is_told_that_a_spline_would_be_refused(cli: Cli) -> None:
    radius = 1.02 / hdvplan.load_vehicle("citaro").max_curvature
    np.savetxt("own.csv", bend(radius, 2.0, 0.35), delimiter=",", header="x,y", comments="")
    outcome = cli("judge", "own.csv", road_of(radius), "--vehicle", "citaro", "--no-plot")
    assert outcome.code == 0
    assert "points are up to 2.0 m apart: between them, nothing tells how well it is known" in outcome.err
    assert "the answer may be the other one" not in outcome.err  # where a spline is too tight by little, the curve may well be right


def test_over_a_gap_in_which_a_bend_begins_nothing_tells_what_is_swept(cli: Cli) -> None:
    points = bend(60.0, 0.5, 0.35)
    np.savetxt("own.csv", np.delete(points, np.s_[60:100], axis=0), delimiter=",", header="x,y", comments="")
    outcome = cli("judge", "own.csv", road_of(60.0), "--vehicle", "citaro", "--half-width", "5", "--no-plot")
    assert "points are up to 20.5 m apart: between them, nothing tells how well it is known" in outcome.err
    assert "warning: with points up to 20.5 m apart the answer may be the other one" in outcome.err


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
    driving = ("--loop", "pure-pursuit", "--runs", "2", "--noise", "3", "--seed", "1")
    judged = cli("judge", "plan/path.csv", *arguments, *driving, "--out", "judged")
    assert judged.code == 1
    assert [line.partition(":")[0] for line in judged.out.splitlines()[:2]] == ["NO", "YES"]  # what does not hold is read first
    looped = json.loads(Path("judged/summary.json").read_text(encoding="utf-8"))["loop"]
    assert (looped["fits"], looped["runs"], looped["text"]) == (False, 6, judged.out.splitlines()[0])
    assert json.loads(cli("judge", "plan/path.csv", *arguments, "--loop", "driver", "--runs", "1", "--json").out)["loop"]["runs"] == 3
    assert looped["settings"] == asdict(LoopSettings(runs=2, noise=3.0, seed=1))
    assert looped["follower"] == "pure-pursuit"
    assert re.search(r"keep the street; run \d is the worst, 0\.\d\d m lacking", judged.out)
    assert re.search(r"error: \d of 6 runs of the closed loop do not keep the street\n", judged.err)  # what is printed is not told twice
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
        (("--loop", "driver", "--seed", "-1"), "seed must be zero or a positive number"),
    ],
)
def test_what_is_no_closed_loop_is_refused(cli: Cli, short_road: str, options: tuple[str, ...], words: str) -> None:
    Path("path.csv").write_text("x,y\n0,0\n60,0\n", encoding="utf-8")
    outcome = cli("judge", "path.csv", short_road, "--vehicle", "bus", *options)
    assert (outcome.code, outcome.out) == (2, "")
    assert words in outcome.err
