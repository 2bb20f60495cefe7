"""A road that is planned in stretches, held against the same road planned whole."""

from __future__ import annotations

import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import hdvplan
from hdvplan.case import Case
from hdvplan.cli.lengthy import _exit_code
from hdvplan.errors import PlanError, RoadError
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.stretches.cutting import stretches_of_road
from hdvplan.stretches.joining import _breaches
from hdvplan.stretches.planning import plan_in_stretches, side_by_side
from tests.cli.conftest import Cli
from tests.stretches.test_cutting import ROAD, case_on

EXACT = (
    "road",
    "vehicle",
    "scheme",
    "solver",
    "objective",
    "status",
    "clearance_wanted_m",
    "plans",
    "notice",
    "settings",
    "bodies",
    "wheels",
)
MILLIMETRE = (
    "length_m", "max_left_m", "max_right_m", "imbalance_m", "mean_abs_imbalance_m", "expected_half_width_m", "needed_half_width_m",
    "min_clearance_m", "limit_violation_m",
)  # fmt: skip


def whole(case: Case, folder: Path) -> dict[str, Any]:
    result = hdvplan.plan(case)
    hdvplan.write_plan(result, folder)
    return hdvplan.summary_of(result)


@pytest.mark.parametrize(("vehicle", "half_width"), [("bus", 3.2), ("tractor-trailer", None)])
def test_the_files_of_a_plan_in_stretches_are_those_of_the_whole_plan_to_a_millimetre(
    tmp_path: Path, vehicle: str, half_width: float | None
) -> None:
    case = case_on(vehicle=vehicle, half_width=half_width)
    one = whole(case, tmp_path / "whole")
    joined = plan_in_stretches(stretches_of_road(case, core=500.0, run_in=200.0), tmp_path / "joined")
    assert joined["stretches"]["count"] == 4
    assert joined["stretches"]["apart_m"] < 1e-6  # over 200 m a plan forgets its beginning to 1e-9 m
    for name in ("path.csv", "envelope.csv", "profile.csv"):
        wanted, found = (pd.read_csv(tmp_path / folder / name) for folder in ("whole", "joined"))
        assert list(found) == list(wanted)
        np.testing.assert_allclose(found.to_numpy(float), wanted.to_numpy(float), atol=1e-3)  # what is promised; also of radians and 1/m
    steps = [pd.read_csv(tmp_path / folder / "steps.csv")["s"].to_numpy() for folder in ("whole", "joined")]
    np.testing.assert_array_equal(steps[0], steps[1])
    for key in EXACT:
        assert joined[key] == one[key], key
    for key in MILLIMETRE:
        assert joined[key] == (one[key] if one[key] is None else pytest.approx(one[key], abs=1e-3)), key  # as above
    assert set(one) <= set(joined)
    assert joined == json.loads((tmp_path / "joined" / "summary.json").read_text(encoding="utf-8"))


def test_the_place_that_decides_and_the_breaches_are_those_of_the_whole_road(tmp_path: Path) -> None:
    case = case_on("liechtenstein_planken", half_width=2.2)
    one = whole(case, tmp_path / "whole")
    joined = plan_in_stretches(stretches_of_road(case, core=800.0), tmp_path / "joined")
    assert one["breaches"]  # the hairpins are too narrow
    for key in ("fits", "side", "part", "unit"):
        assert joined["verdict"][key] == one["verdict"][key]
    for key in ("spare_m", "s_m", "lon", "lat"):
        assert joined["verdict"][key] == pytest.approx(one["verdict"][key], abs=1e-3)  # as above
    assert f"at s = {one['verdict']['s_m']:.1f} m" in joined["verdict"]["text"]
    assert len(joined["breaches"]) == len(one["breaches"])
    for there, here in zip(one["breaches"], joined["breaches"], strict=True):
        assert {key: here[key] for key in ("side", "unit", "part", "region")} == {
            key: there[key] for key in ("side", "unit", "part", "region")
        }
        assert here["depth_m"] == pytest.approx(there["depth_m"], abs=1e-3)  # as above
        assert here["s_deepest"] == pytest.approx(there["s_deepest"], abs=0.3)  # a flat deepest place may move by a station, 0.25 m


def test_obstacles_beside_a_cut_are_passed_and_told_once(tmp_path: Path) -> None:
    case = Case(hdvplan.load_road("parked_van"), hdvplan.load_vehicle("bus"))
    one = whole(case, tmp_path / "whole")
    van = one["obstacles"][0]["s_m"]
    joined = plan_in_stretches(stretches_of_road(case, core=van, run_in=100.0), tmp_path / "joined")
    assert joined["stretches"]["count"] > 1
    assert [near["name"] for near in joined["obstacles"]] == [near["name"] for near in one["obstacles"]]
    assert joined["obstacles"][0]["distance_m"] == pytest.approx(one["obstacles"][0]["distance_m"], abs=1e-3)  # as above
    assert (tmp_path / "joined" / "regions.json").read_bytes() == (tmp_path / "whole" / "regions.json").read_bytes()


def test_a_run_in_that_is_too_short_shows_in_how_far_stretches_lie_apart(tmp_path: Path) -> None:
    joined = plan_in_stretches(stretches_of_road(case_on("liechtenstein_planken"), core=800.0, run_in=10.0), tmp_path)
    assert joined["stretches"]["apart_m"] > 1e-3


def test_an_executor_gives_the_same_files_in_any_number_of_workers(tmp_path: Path) -> None:
    case = case_on(half_width=3.5)
    plan_in_stretches(stretches_of_road(case, core=300.0), tmp_path / "one")
    with ThreadPoolExecutor(3) as executor:
        plan_in_stretches(stretches_of_road(case, core=300.0), tmp_path / "many", each=side_by_side(executor, 2))
    for name in ("path.csv", "envelope.csv", "profile.csv", "swept.geojson", "regions.json"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "many" / name).read_bytes()


def test_no_more_stretches_are_handed_out_than_asked_for() -> None:
    handed: list[int] = []

    def numbers() -> Iterator[int]:
        for number in range(10):
            handed.append(number)
            yield number

    with ThreadPoolExecutor(1) as executor:
        found = side_by_side(executor, 3)(lambda number: -number, numbers())
        assert next(iter(found)) == 0
        assert len(handed) <= 4


def test_an_error_in_what_comes_is_told_after_the_results_before_it() -> None:
    def numbers() -> Iterator[int]:
        yield from range(5)
        msg = "no sixth"
        raise RoadError(msg)

    with ThreadPoolExecutor(2) as executor:
        coming = iter(side_by_side(executor, 4)(lambda number: -number, numbers()))
        assert [next(coming) for _ in range(5)] == [0, -1, -2, -3, -4]
        with pytest.raises(RoadError, match="no sixth"):
            next(coming)


def test_a_breach_that_goes_on_over_a_cut_is_one() -> None:
    same = {"side": "left", "region": "drivable", "obstacle": None}
    before, after = {"s_from": 90.0, "s_to": 99.75, "depth_m": 0.1, "s_deepest": 95.0}, {
        "s_from": 100.0, "s_to": 104.0, "depth_m": 0.3, "s_deepest": 101.0,
    }  # fmt: skip
    assert _breaches([before | same, after | same]) == [same | {"s_from": 90.0, "s_to": 104.0, "depth_m": 0.3, "s_deepest": 101.0}]
    assert len(_breaches([before | same, after | same | {"side": "right"}])) == 2
    assert len(_breaches([before | same, after | same | {"s_from": 101.0}])) == 2


def test_where_no_plan_exists_the_place_is_that_on_the_whole_road(tmp_path: Path) -> None:
    bend = from_curvature(np.array([0.0, 600.0, 610.0, 640.0, 650.0, 800.0]), np.array([0.0, 0.0, 0.45, 0.45, 0.0, 0.0]))
    case = Case(Road("tight", bend), hdvplan.load_vehicle("bus"))
    with pytest.raises(PlanError) as of_whole:
        hdvplan.plan(case)
    with pytest.raises(PlanError, match="m along the road") as caught:
        plan_in_stretches(stretches_of_road(case, core=300.0), tmp_path)
    assert caught.value.s_m == pytest.approx(of_whole.value.s_m, abs=5.0)  # a plan's length
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def _long_roads_are_short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hdvplan.road.load.LONG_M", 1000.0)


@pytest.mark.usefixtures("_long_roads_are_short")
def test_a_long_road_is_planned_in_stretches_from_the_command_line(cli: Cli, tmp_path: Path) -> None:
    outcome = cli("plan", ROAD, "--vehicle", "bus", "--half-width", "3.5", "--workers", "1", "--out", "plan")
    assert outcome.code == 0
    assert outcome.out.startswith("YES")
    assert f"{ROAD} has 2 km: it is planned in stretches, without pictures" in outcome.err
    assert sorted(file.name for file in (tmp_path / "plan").iterdir()) == [
        "envelope.csv", "path.csv", "profile.csv", "regions.json", "run.json", "steps.csv", "summary.json", "swept.geojson",
    ]  # fmt: skip
    assert cli("report", "plan", "--out", "report.html").code == 0


@pytest.mark.usefixtures("_long_roads_are_short")
def test_a_long_road_that_is_too_narrow_is_told_with_exit_code_1(cli: Cli) -> None:
    outcome = cli("plan", ROAD, "--vehicle", "bus", "--half-width", "1.3", "--json", "--workers", "1", "--out", "plan")
    assert outcome.code == 1
    assert json.loads(outcome.out)["verdict"]["fits"] is False
    assert "error: the" in outcome.err
    assert "breaks the left limit by" in outcome.err


def test_an_error_on_a_long_road_names_the_obstacle_and_else_what_decides(capsys: pytest.CaptureFixture[str]) -> None:
    text = "NO: 0.20 m lacking of the 0.30 m to keep at s = 7.0 m"
    breach: dict[str, object] = {
        "s_deepest": 100.0,
        "depth_m": 0.3,
        "side": "left",
        "unit": "bus",
        "part": "front corner",
        "obstacle": "van",
    }
    cases: list[tuple[list[dict[str, object]], str]] = [
        ([breach], "the front corner of the bus enters the obstacle 'van' by 0.300 m at s = 100.0 m"),
        ([breach | {"obstacle": None}], "the front corner of the bus breaks the left limit by 0.300 m at s = 100.0 m"),
        ([], text[4:]),
    ]
    for breaches, said in cases:
        assert _exit_code({"verdict": {"fits": False, "text": text}, "breaches": breaches}) == 1
        assert capsys.readouterr().err.startswith(f"error: {said}\nhint: summary.json ")


@pytest.mark.usefixtures("_long_roads_are_short")
@pytest.mark.parametrize("option", [("--sheet", "a3"), ("--animate",), ("--format", "dxf"), ("--bias", "centre", "--half-width", "4")])
def test_what_long_roads_do_not_have_is_refused_in_one_line(cli: Cli, option: tuple[str, ...]) -> None:
    outcome = cli("plan", ROAD, "--vehicle", "bus", *option)
    assert outcome.code == 2
    assert "is not for roads of more than 1 km" in outcome.err
