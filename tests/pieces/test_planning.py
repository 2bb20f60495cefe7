"""A road that is planned piece by piece, held against the same road planned whole."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import shapely

import hdvplan
from hdvplan.answers import NO, YES, worded
from hdvplan.case import Case
from hdvplan.cli.outcome import long_exit_code, warn_of_steps
from hdvplan.errors import HdvplanError, OptionError, PlanError, RoadError
from hdvplan.judging.result import Result
from hdvplan.pieces import pieces_of, planned
from hdvplan.report.joined import _breaches, _verdict, write_pieces
from hdvplan.road.load import Found
from hdvplan.road.path import from_curvature
from hdvplan.road.regions import Kind, Region, Side
from hdvplan.road.road import Road
from tests.cli.conftest import Cli
from tests.pieces.lanes import found_of, lane_with_a_post
from tests.pieces.test_cutting import ROAD, case_on

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


def in_pieces(case: Case, folder: Path, length: float, found: Found | None = None) -> dict[str, Any]:
    """Plan a case on its road, or on one that is only found, in pieces of a length [m], and return the summary."""
    pieces = pieces_of(found or found_of(case.road), case.vehicle, case.settings, length=length)
    return write_pieces(planned(pieces, lambda road: replace(case, road=road)), folder)


@pytest.mark.parametrize(("vehicle", "half_width"), [("bus", 3.2), ("tractor-trailer", None)])
def test_the_files_of_a_plan_in_pieces_are_those_of_the_whole_plan_to_a_millimetre(
    tmp_path: Path, vehicle: str, half_width: float | None
) -> None:
    case = case_on(vehicle=vehicle, half_width=half_width)
    one = whole(case, tmp_path / "whole")
    joined = in_pieces(case, tmp_path / "joined", 500.0)
    assert joined["stretches"]["count"] == 4
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


@pytest.mark.slow
def test_the_place_that_decides_and_the_breaches_are_those_of_the_whole_road(tmp_path: Path) -> None:
    case = case_on("liechtenstein_planken", half_width=2.2)
    one = whole(case, tmp_path / "whole")
    joined = in_pieces(case, tmp_path / "joined", 1100.0)  # cut where limits are kept: elsewhere more than one plan may exist
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
    joined = in_pieces(case, tmp_path / "joined", van)
    assert joined["stretches"]["count"] > 1
    assert [near["name"] for near in joined["obstacles"]] == [near["name"] for near in one["obstacles"]]
    assert joined["obstacles"][0]["distance_m"] == pytest.approx(one["obstacles"][0]["distance_m"], abs=1e-3)  # as above
    assert [(one["side"], one["crossed"]) for one in joined["passed"]] == [(one["side"], one["crossed"]) for one in one["passed"]]
    assert (tmp_path / "joined" / "regions.json").read_bytes() == (tmp_path / "whole" / "regions.json").read_bytes()


def test_a_breach_that_goes_on_over_a_cut_is_one() -> None:
    same = {"side": "left", "region": "drivable", "obstacle": None}
    before, after = {"s_from": 90.0, "s_to": 99.75, "depth_m": 0.1, "s_deepest": 95.0}, {
        "s_from": 100.0, "s_to": 104.0, "depth_m": 0.3, "s_deepest": 101.0,
    }  # fmt: skip
    assert _breaches([before | same, after | same]) == [same | {"s_from": 90.0, "s_to": 104.0, "depth_m": 0.3, "s_deepest": 101.0}]
    assert len(_breaches([before | same, after | same | {"side": "right"}])) == 2
    for apart, count in ((1.9, 1), (2.1, 2)):  # as the judge tells them apart
        assert len(_breaches([before | same, after | same | {"s_from": 99.75 + apart}])) == count


def test_where_no_plan_exists_the_place_is_that_on_the_whole_road(tmp_path: Path) -> None:
    bend = from_curvature(np.array([0.0, 600.0, 610.0, 640.0, 650.0, 800.0]), np.array([0.0, 0.0, 0.45, 0.45, 0.0, 0.0]))
    case = Case(Road("tight", bend), hdvplan.load_vehicle("bus"))
    with pytest.raises(PlanError) as of_whole:
        hdvplan.plan(case)
    with pytest.raises(PlanError, match="m along the road") as caught:
        in_pieces(case, tmp_path, 300.0)
    assert caught.value.s_m == pytest.approx(of_whole.value.s_m, abs=5.0)  # a plan's length
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_an_obstacle_decides_on_a_road_that_has_no_limits_elsewhere(tmp_path: Path) -> None:
    found = lane_with_a_post(tmp_path, None)
    case = Case(found(), hdvplan.load_vehicle("bus"))
    one: dict[str, Any] = hdvplan.summary_of(hdvplan.plan(case))
    joined = in_pieces(case, tmp_path / "joined", 500.0, found)
    assert one["verdict"]["obstacle"] == "post"
    for key in ("fits", "obstacle", "side", "part"):
        assert joined["verdict"][key] == one["verdict"][key], key
    assert joined["verdict"]["spare_m"] == pytest.approx(one["verdict"]["spare_m"], abs=1e-3)  # what is promised


def test_a_no_is_told_whatever_other_stretches_need() -> None:
    def said(fits: bool | None, spare: float | None, half_width: float, wheels: float | None = None) -> dict[str, Any]:
        verdict = {"fits": fits, "spare_m": spare, "half_width_m": half_width, "wheels_spare_m": wheels}
        return {"verdict": verdict, "needed_half_width_m": half_width}

    needs, no, yes = said(None, None, 4.0), said(False, -0.4, 3.0, 0.1), said(True, 0.2, 2.0)
    assert _verdict([needs, no, yes]) == {"fits": False, "spare_m": -0.4, "half_width_m": 4.0, "wheels_spare_m": 0.1}
    assert _verdict([no, said(False, -0.2, 3.0, -0.1)])["wheels_spare_m"] == -0.1
    assert _verdict([yes, needs]) == {"fits": True, "spare_m": 0.2, "half_width_m": 4.0, "wheels_spare_m": None}
    assert _verdict([needs, said(None, None, 3.0)]) == needs["verdict"]


def test_an_obstacle_without_room_on_its_side_is_told_with_its_place_on_the_whole_road(tmp_path: Path) -> None:
    path = from_curvature(np.array([0.0, 1200.0]), np.zeros(2))
    x, y = path.to_plane(np.array([900.0, 901.0, 901.0, 900.0]), np.array([-1.0, -1.0, 3.4, 3.4]))
    wall = Region(Kind.OBSTACLE, shapely.Polygon(np.column_stack([x, y])), "wall", Side.LEFT)
    case = Case(Road("lane", path, regions=(wall,)).with_limits(3.5, 3.5), hdvplan.load_vehicle("bus"))
    with pytest.raises(RoadError, match=r"cannot be passed on the left.*this s counts from .* m along the road") as caught:
        in_pieces(case, tmp_path, 300.0)
    assert caught.value.s_m == pytest.approx(900.5, abs=1.0)  # the middle of the wall, in cells of half a metre


@pytest.mark.parametrize(
    ("error", "s_m"),
    [(PlanError("at s = 7.0 m a body is lost", s_m=7.0), 607.0), (OptionError("a bias leaves no road at s = 7.0 m"), None)],
    ids=["plan", "option"],
)
def test_what_is_found_when_a_piece_is_judged_counts_from_its_begin(
    monkeypatch: pytest.MonkeyPatch, error: HdvplanError, s_m: float | None
) -> None:
    def refused(*_: object, **__: object) -> Result:
        raise error

    monkeypatch.setattr("hdvplan.pieces.result_of", refused)
    case = Case(Road("lane", from_curvature(np.array([0.0, 900.0]), np.zeros(2))), hdvplan.load_vehicle("bus"))
    *_, last = pieces_of(found_of(case.road), case.vehicle, case.settings, length=300.0)
    assert last.begins + last.s_from == 600.0
    with pytest.raises(type(error), match=r"at s = 7\.0 m.*this s counts from 600 m along the road") as caught:
        list(planned([last], lambda road: replace(case, road=road)))
    assert getattr(caught.value, "s_m", None) == s_m


@pytest.fixture
def _long_roads_are_short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hdvplan.road.line.LONG_M", 1000.0)


@pytest.mark.usefixtures("_long_roads_are_short")
@pytest.mark.parametrize("road", [ROAD, "profile"])
def test_a_long_road_is_planned_piece_by_piece_from_the_command_line(cli: Cli, tmp_path: Path, road: str) -> None:
    if road == "profile":
        (tmp_path / "profile.csv").write_text("s,kappa\n0,0\n900,0.01\n1800,0\n", encoding="utf-8")
    outcome = cli("plan", ROAD if road == ROAD else "profile.csv", "--vehicle", "bus", "--half-width", "3.5", "--out", "plan")
    assert outcome.code == 0
    assert outcome.out.startswith(YES)
    assert f"{road} has 2 km: it is planned in stretches, without pictures" in outcome.err
    assert sorted(file.name for file in (tmp_path / "plan").iterdir()) == [
        "envelope.csv", "limits.json", "path.csv", "profile.csv", "regions.json", "run.json", "steps.csv", "summary.json", "swept.geojson",
    ]  # fmt: skip
    assert cli("report", "plan", "--out", "report.html").code == 0


@pytest.mark.slow
@pytest.mark.usefixtures("_long_roads_are_short")
def test_a_long_road_that_is_too_narrow_is_told_with_exit_code_1(cli: Cli) -> None:
    outcome = cli("plan", ROAD, "--vehicle", "bus", "--half-width", "1.3", "--json", "--out", "plan")
    assert outcome.code == 1
    assert json.loads(outcome.out)["verdict"]["fits"] is False
    assert "error: the" in outcome.err
    assert "breaks the left limit by" in outcome.err


def test_an_error_on_a_long_road_names_the_obstacle_and_else_what_decides(capsys: pytest.CaptureFixture[str]) -> None:
    kept = "0.20 m lacking of the 0.30 m to keep at s = 7.0 m"
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
        ([], kept),
    ]
    for breaches, said in cases:
        assert long_exit_code({"verdict": {"fits": False, "text": worded(NO, kept)}, "breaches": breaches}) == 1
        assert capsys.readouterr().err.startswith(f"error: {said}\nhint: summary.json ")


@pytest.mark.usefixtures("_long_roads_are_short")
@pytest.mark.parametrize("option", [("--sheet", "a3"), ("--animate",), ("--format", "dxf"), ("--bias", "centre", "--half-width", "4")])
def test_what_long_roads_do_not_have_is_refused_in_one_line(cli: Cli, option: tuple[str, ...]) -> None:
    outcome = cli("plan", ROAD, "--vehicle", "bus", *option)
    assert outcome.code == 2
    assert "is not for roads of more than 1 km" in outcome.err


@pytest.mark.usefixtures("_long_roads_are_short")
@pytest.mark.parametrize(
    ("options", "words"),
    [(("--half-width", "1"), "limits are 2.00 m apart"), (("--bias", "50"), "--bias 50 leads 50 m off the road's centre")],
    ids=["limits", "bias"],
)
def test_what_is_refused_on_a_short_road_is_refused_on_a_long_one(cli: Cli, options: tuple[str, str], words: str) -> None:
    outcome = cli("plan", ROAD, "--vehicle", "bus", *options)
    assert outcome.code == 2
    assert words in outcome.err.splitlines()[0]


def test_an_obstacle_that_is_entered_is_no_limit_and_steps_without_a_plan_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    breach = {"part": "front left corner", "unit": "bus", "side": "left", "depth_m": 0.25, "s_deepest": 60_000.0, "obstacle": "van"}
    assert long_exit_code({"verdict": {"fits": False}, "breaches": [breach], "status": "limits broken"}) == 1
    assert "enters the obstacle 'van' by 0.250 m at s = 60000.0 m" in capsys.readouterr().err
    steps = {"rescued_steps": [{"s_m": 5.0, "why": "it raised"}], "failed_steps": [7.0, 9.0], "plans": 10, "solver": "osqp"}
    warn_of_steps(steps, quiet=False)
    assert capsys.readouterr().err.splitlines() == [
        "warning: osqp failed in 1 of 10 planning steps, first at s = 5.0 m: it raised",
        "warning: 2 of 10 planning steps were not solved, first at s = 7.0 m: the vehicle followed the last plan",
    ]
