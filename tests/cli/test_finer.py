"""A plan that lacks little room, planned again with stations nearer together."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hdvplan
from hdvplan.case import Case
from hdvplan.judging.proof import Proof
from hdvplan.judging.result import Result, attempts_text
from hdvplan.judging.verdict import verdict_of
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Limits, Road
from hdvplan.vehicle.load import load_vehicle
from tests.cli.conftest import Cli

# A strip of constant width that swings 3 m to the side within 15 m: its limits slope by up to 0.31, which costs up to 0.16 m where
# stations are 0.5 m apart. A bus can just use 1.78 m to both sides of its middle.
S = np.arange(0.0, 120.1, 0.5)
ASIDE_M = np.interp(S, [0.0, 10.0, 40.0, 45.0, 60.0], [0.0, 0.0, -1.5, -1.5, 1.5])
MIDDLE = np.where((S > 45.0) & (S < 60.0), -1.5 * np.cos(np.pi * (S - 45.0) / 15.0), ASIDE_M)
ENOUGH_M, TOO_LITTLE_M, FAR_TOO_LITTLE_M, AMPLE_M = 1.78, 1.74, 1.5, 2.0


def shifted_strip(half_width: float) -> Result:
    left, right = MIDDLE + half_width, MIDDLE - half_width
    road = Road("strip", from_curvature(np.array([0.0, 120.0]), np.zeros(2))).within(Limits(S, left, right, left, right))
    return hdvplan.plan(Case(road, load_vehicle("bus")))


@pytest.fixture(scope="module")
def missed() -> Result:
    return shifted_strip(ENOUGH_M)


def test_nearer_stations_find_the_plan_that_was_missed(missed: Result) -> None:
    assert verdict_of(missed).fits is False
    found = hdvplan.replanned(missed)
    assert verdict_of(found).fits is True
    assert [attempt.step for attempt in found.attempts] == [0.5, 0.25, 0.1]
    assert [attempt.lacking > 0.0 for attempt in found.attempts] == [True, True, False]
    assert found.case.settings.step == 0.1
    assert attempts_text(found).endswith("with stations 0.1 m apart it fits, and that is the plan here")


def test_where_no_finer_plan_fits_the_first_one_stays_and_says_what_was_tried() -> None:
    narrow = shifted_strip(TOO_LITTLE_M)
    found = hdvplan.replanned(narrow)
    assert found.drive is narrow.drive
    assert [attempt.step for attempt in found.attempts] == [0.5, 0.25, 0.1]
    assert attempts_text(found).startswith("planned again with stations 0.25 m and 0.1 m apart: ")


def test_a_proved_no_one_that_lacks_much_and_a_yes_are_not_planned_again(missed: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    proved, fits = replace(missed, proof=Proof("motion", 40.0, 60.0, 0)), shifted_strip(AMPLE_M)
    much = shifted_strip(FAR_TOO_LITTLE_M)  # lacks more than half a metre per metre between stations
    monkeypatch.setattr("hdvplan.api.plan", lambda _: pytest.fail("planned again"))
    for result in (proved, fits, much):
        assert hdvplan.replanned(result) is result


def test_plan_tells_how_it_came_to_its_answer(cli: Cli, tmp_path: Path) -> None:
    rows = [f"{s:g},0,{ENOUGH_M + middle:.4f},{ENOUGH_M - middle:.4f}" for s, middle in zip(S, MIDDLE, strict=True)]
    (tmp_path / "strip.csv").write_text("\n".join(["s,kappa,left,right", *rows, ""]), encoding="utf-8")
    options = ("plan", "strip.csv", "--vehicle", "bus", "--no-plot", "--no-proof")
    found, coarse = cli(*options, "--json", "--out", "fine"), cli(*options, "--json", "--no-refine", "--out", "coarse")
    assert (found.code, coarse.code) == (0, 1)
    told = json.loads(found.out)
    assert [attempt["step_m"] for attempt in told["attempts"]] == [0.5, 0.25, 0.1]
    assert told["settings"]["step"] == 0.1
    assert json.loads(coarse.out)["attempts"] == []
    said = cli(*options, "--out", "again")
    assert "with stations 0.1 m apart it fits, and that is the plan here" in said.err
