from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from hdvplan.answers import NO, YES, room_text, worded
from hdvplan.case import Case
from hdvplan.errors import PlanError, SolverError
from hdvplan.judging import clearance
from hdvplan.planning.bias import Bias
from hdvplan.planning.settings import PlannerSettings
from hdvplan.report.compared import answer_texts
from hdvplan.road import limits
from hdvplan.road.load import load_road
from hdvplan.road.options import RoadOptions
from hdvplan.vehicle.load import load_vehicle
from tests.cli.conftest import Cli
from tests.road.drives import area_feature, line_feature, written

QUICK = ("--horizon", "30", "--no-plot")
VAN = ("parked_van", "--vehicle", "bus", "--no-plot")
CONTRACT = {
    "road", "vehicle", "scheme", "solver", "objective", "length_m", "plans", "max_left_m", "max_right_m", "imbalance_m",
    "mean_abs_imbalance_m", "expected_half_width_m", "min_clearance_m", "limit_violation_m", "sqp_iterations_mean",
    "sqp_iterations_max", "time_ms", "status", "version",
}  # fmt: skip


def test_a_plan_writes_every_file_and_prints_the_balance(cli: Cli, tmp_path: Path, short_road: str) -> None:
    outcome = cli("plan", short_road, "--vehicle", "bus", "--horizon", "30", "--half-width", "3")
    assert outcome.code == 0
    assert outcome.err == ""
    folder = tmp_path / "short.bus"
    assert sorted(path.name for path in folder.iterdir()) == [
        "envelope.csv",
        "limits.json",
        "path.csv",
        "plan.png",
        "profile.csv",
        "regions.json",
        "run.json",
        "steps.csv",
        "summary.json",
        "swept.geojson",
    ]
    assert (folder / "plan.png").read_bytes().startswith(b"\x89PNG")
    for words in ("max left", "mean |left + right|", "expected half width", "limits kept", "time per step", "short.bus/"):
        assert words in outcome.out
    verdict, more, *tables = outcome.out.splitlines()
    assert verdict.startswith(YES)
    assert "holds while the driver keeps" in more
    assert max(len(line) for line in tables) <= 80


@pytest.mark.slow
def test_a_plan_is_drawn_for_cad_maps_and_paper(cli: Cli, tmp_path: Path, short_road: str) -> None:
    command, folder = ("plan", short_road, "--vehicle", "bus", "--horizon", "30", "--half-width", "3"), tmp_path / "short.bus"
    assert cli(*command, "--format", "dxf,gpkg", "--sheet", "A4", "--scale", "1:500").code == 0
    assert {file.name for file in folder.iterdir()} >= {"plan.dxf", "plan.gpkg", "sheet.pdf"}
    assert not (folder / "plan.png").exists()
    assert (folder / "sheet.pdf").read_bytes().startswith(b"%PDF")
    assert (folder / "plan.gpkg").read_bytes().startswith(b"SQLite")
    assert cli(*command, "--no-plot").code == 0
    assert not {file.name for file in folder.iterdir()} & {"plan.dxf", "plan.gpkg", "sheet.pdf"}  # of the former plan


def test_summary_and_tables_agree_with_the_contract_and_with_each_other(cli: Cli, tmp_path: Path, short_road: str) -> None:
    assert cli("plan", short_road, "--vehicle", "tractor-trailer", *QUICK, "--left", "3", "--right", "3.5").code == 0
    folder = tmp_path / "short.tractor-trailer"
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary.keys() >= CONTRACT
    assert summary["time_ms"].keys() >= {"mean", "p50", "p95", "p99", "max"}
    assert (summary["status"], summary["limit_violation_m"]) == ("ok", 0)
    assert summary["min_clearance_m"] > 0
    assert summary["imbalance_m"] == pytest.approx(summary["max_left_m"] - summary["max_right_m"])
    assert summary["plans"] == 12  # 60 m, 5 m at a time
    path, envelope = pd.read_csv(folder / "path.csv"), pd.read_csv(folder / "envelope.csv")
    assert list(path.columns) == ["s", "x", "y", "heading", "e_y", "e_psi", "beta1", "kappa", "K"]
    contract = ["s", "left", "right", "left_limit", "right_limit", "expected_left", "expected_right"]
    assert list(envelope.columns) == [*contract, "needed_width"]
    assert envelope["left"].max() == pytest.approx(summary["max_left_m"], abs=5e-7)  # the table has six decimals
    assert -envelope["right"].min() == pytest.approx(summary["max_right_m"], abs=5e-7)
    assert (envelope["right_limit"] == -3.5).all()
    assert path["kappa"].iloc[-1] == path["kappa"].iloc[-2]
    turned = np.diff(path["heading"])
    travelled = np.hypot(np.diff(path["x"]), np.diff(path["y"]))
    # The lead rear axle turns by its curvature times the way it rolls; chord and arc of 0.5 m differ by 1e-6 of it.
    np.testing.assert_allclose(turned, path["kappa"][:-1] * travelled, atol=1e-6)


def test_a_broken_limit_ends_in_1_and_says_which_where_and_by_how_much(cli: Cli, tmp_path: Path) -> None:
    outcome = cli("plan", "uturn", "--vehicle", "tractor-trailer-24m", "--half-width", "3.2", "--no-plot", "--horizon", "60", "--no-proof")
    assert outcome.code == 1
    summary = json.loads((tmp_path / "uturn.tractor-trailer-24m" / "summary.json").read_text(encoding="utf-8"))
    deepest = max(summary["breaches"], key=lambda breach: breach["depth_m"])
    assert summary["status"] == "limits broken"
    assert summary["limit_violation_m"] == deepest["depth_m"] > 0.01
    lines = [line for line in outcome.err.splitlines() if not line.startswith("planning again")]  # how far it is, every ten seconds
    again, *notes, warning, first, hint = lines
    lacking = f"{deepest['depth_m']:.3f} m are lacking at best: that is the plan here"
    assert again.endswith(f"{lacking}; --no-refine shows the first")
    assert warning.startswith("warning: too narrow for the tractor-trailer-24m from s = ")
    assert all(line.startswith("warning: the plan ") for line in notes)
    assert first == (
        f"error: the {deepest['part']} of the {deepest['unit']} breaks the {deepest['side']} limit"
        f" by {deepest['depth_m']:.3f} m at s = {deepest['s_deepest']:.1f} m"
    )
    assert hint.startswith("hint: ")
    assert "broken limits" in outcome.out
    verdict = summary["verdict"]
    assert outcome.out.splitlines()[0] == verdict["text"]
    assert verdict["text"].startswith(worded(NO, f"{room_text(verdict['spare_m'], fits=False)} at s = {verdict['s_m']:.1f} m, "))
    assert (verdict["fits"], -verdict["spare_m"]) == (False, deepest["depth_m"])


def test_a_verdict_stands_where_no_half_width_about_a_line_that_goes_back_and_forth_is_found(
    cli: Cli, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for module in (limits, clearance):  # as of a line of which none is found up to 250 m
        monkeypatch.setattr(module, "WIDEST_M", 3.25, raising=False)
    options = ("--vehicle", "tractor-trailer-24m", "--no-plot", "--no-proof", "--horizon", "60", "--no-refine")
    broken = cli("plan", "uturn", *options, "--half-width", "3.2")
    assert (broken.code, broken.out[:3]) == (1, f"{NO}:")
    assert broken.err.splitlines()[-1].startswith("hint: `hdvplan need")
    bend = written(tmp_path, line_feature(np.array([(0.0, 0.0), (30.0, 0.0), (45.0, 15.0), (45.0, 45.0)])))
    without = cli("plan", str(bend), *options)
    assert (without.code, without.out) == (2, "")
    assert "no half width about the line as given is found" in without.err


def test_a_clearance_that_is_not_kept_ends_in_1_although_no_limit_is_broken(cli: Cli, tmp_path: Path, short_road: str) -> None:
    outcome = cli("plan", short_road, "--vehicle", "bus", *QUICK, "--half-width", "2", "--clearance", "0.5", "--no-proof", "--no-refine")
    assert outcome.code == 1
    assert outcome.out.startswith(NO)
    assert "error: only 0." in outcome.err
    summary = json.loads((tmp_path / "short.bus" / "summary.json").read_text(encoding="utf-8"))
    assert (summary["status"], summary["limit_violation_m"], summary["clearance_wanted_m"]) == ("clearance not kept", 0, 0.5)
    assert cli("plan", short_road, "--vehicle", "bus", *QUICK, "--half-width", "3", "--clearance", "0.5").code == 0


def test_a_plan_that_comes_near_its_limits_tells_the_largest_clearance(cli: Cli, tmp_path: Path) -> None:
    told = re.search(r"as near as limits allow; --clearance max finds one that keeps (0\.\d\d) m", cli("plan", *VAN).out)
    assert told is not None
    summary = json.loads((tmp_path / "parked_van.bus" / "summary.json").read_text(encoding="utf-8"))
    assert f"{summary['largest_clearance_m']:.2f}" == told[1]
    assert told[0] in summary["verdict"]["details"]
    assert cli("plan", *VAN, "--clearance", "max").out.startswith(f"YES: the {told[1]} m to keep are kept")
    tight = ("uturn", "--vehicle", "bus", "--half-width", "2.48", "--no-plot")
    assert "; the plan comes as near as limits allow; --clearance max finds none that keeps more" in cli("plan", *tight).out
    assert "as near as" not in cli("plan", *VAN, "--no-refine").out


def test_a_plan_of_a_long_road_that_comes_near_its_limits_says_what_asks_for_room(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hdvplan.api.LONG_M", 10.0)
    hint = "the plan comes as near as limits allow; --clearance M keeps it away from them"
    assert hint in cli("plan", *VAN).err
    assert "as near as" not in cli("plan", *VAN, "--clearance", "0.2").err


def test_the_record_beside_the_summary_holds_the_case_that_was_planned(cli: Cli, tmp_path: Path, short_road: str) -> None:
    options = ("--half-width", "3", "--objective", "balanced", "--bias", "0.2", "--solver", "piqp")
    assert cli("plan", short_road, "--vehicle", "bus", *QUICK, *options).code == 0
    record = json.loads((tmp_path / "short.bus" / "run.json").read_text(encoding="utf-8"))
    bus = load_vehicle("bus")
    road = load_road(short_road, RoadOptions(max_curvature=1.25 * bus.max_curvature)).with_limits(3.0, 3.0)
    case = Case(road, bus, "balanced", "piqp", PlannerSettings(horizon=30.0), Bias.constant(0.2))
    assert record["cases"] == [json.loads(json.dumps(case.described()))]
    assert record["software"]["packages"].keys() >= {"numpy", "piqp"}


def test_json_is_the_summary_and_nothing_else(cli: Cli, tmp_path: Path, short_road: str) -> None:
    outcome = cli("plan", short_road, "--vehicle", "bus", *QUICK, "--json")
    assert outcome.err == ""
    assert json.loads(outcome.out) == json.loads((tmp_path / "short.bus" / "summary.json").read_text(encoding="utf-8"))


def test_quiet_leaves_only_the_files(cli: Cli, tmp_path: Path, short_road: str) -> None:
    outcome = cli("plan", short_road, "--vehicle", "bus", *QUICK, "--quiet", "--out", "a/b")
    assert (outcome.code, outcome.out, outcome.err) == (0, "", "")
    assert (tmp_path / "a" / "b" / "summary.json").is_file()


def test_every_planning_option_reaches_the_planner(cli: Cli, short_road: str) -> None:
    options = ("--scheme", "sqp", "--objective", "lead-axle", "--step", "1", "--replan", "10", "--curvature-weight", "500")
    outcome = cli("plan", short_road, "--vehicle", "bus", *QUICK, *options, "--discretisation", "euler", "--solver", "piqp", "--json")
    summary = json.loads(outcome.out)
    assert (summary["scheme"], summary["objective"], summary["solver"]) == ("sqp", "lead-axle", "piqp")
    settings = summary["settings"]
    assert (settings["step"], settings["replan"], settings["smoothness"], settings["horizon"]) == (1, 10, 500, 30)
    assert settings["discretisation"] == "euler"
    assert summary["sqp_iterations_max"] > 1


@pytest.mark.parametrize(
    "error",
    [
        PlanError("at s = 31.0 m the road bends too tightly", s_m=31.0),
        SolverError("the first plan could not be solved", status="infeasible"),
    ],
)
def test_a_road_that_cannot_be_planned_ends_in_1(cli: Cli, monkeypatch: pytest.MonkeyPatch, short_road: str, error: Exception) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("hdvplan.api.driven", fail)
    outcome = cli("plan", short_road, "--vehicle", "bus", *QUICK)
    assert (outcome.code, outcome.out) == (1, "")
    assert outcome.err == f"error: {error}\n"


def test_a_shipped_road_is_placed_on_the_map_with_its_attribution(cli: Cli, tmp_path: Path) -> None:
    assert cli("plan", "goteborg_lindholmsallen_uturn", "--vehicle", "bus", *QUICK).code == 0
    folder = tmp_path / "goteborg_lindholmsallen_uturn.bus"
    swept = json.loads((folder / "swept.geojson").read_text(encoding="utf-8"))
    assert all("OpenStreetMap" in feature["properties"]["attribution"] for feature in swept["features"])
    lon, lat = swept["features"][-1]["geometry"]["coordinates"][0]
    assert 11.5 < lon < 12.5  # Gothenburg
    assert 57.5 < lat < 58.0
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["smoothing"]["points"] > 2


def test_a_plan_can_be_balanced_about_a_bias(cli: Cli, tmp_path: Path, short_road: str) -> None:
    (tmp_path / "bias.csv").write_text("s,bias\n0,0.3\n60,0.3\n", encoding="utf-8")
    middles = []
    for bias in ("0.3", "bias.csv", "centre"):
        options = ("--objective", "balanced", "--bias", bias, "--left", "3.3", "--right", "2.7", "--horizon", "50", "--no-plot")
        assert cli("plan", short_road, "--vehicle", "bus", *options).code == 0
        summary = json.loads((tmp_path / "short.bus" / "summary.json").read_text(encoding="utf-8"))
        assert summary["objective"] == "balanced"
        assert summary["mean_abs_off_bias_m"] < 0.03  # the ends of a short road are not balanced yet
        table = pd.read_csv(tmp_path / "short.bus" / "envelope.csv")
        assert np.allclose(0.5 * (table["expected_left"] + table["expected_right"]), 0.3)
        middles.append(0.5 * (table["left"] + table["right"]))
    assert np.allclose(middles[0], middles[1])
    assert np.allclose(middles[0], middles[2])
    assert float(middles[0].mean()) == pytest.approx(0.3, abs=0.03)


@pytest.mark.slow
def test_several_vehicles_are_compared_and_answered_as_each_by_itself(cli: Cli, short_road: str) -> None:
    outcome = cli("plan", short_road, "--vehicle", "bus, a-double", "--half-width", "1.7", "--out", "both")
    assert outcome.code == 1
    assert outcome.out.startswith(worded(NO, "1 of 2 vehicles does not fit: a-double\n"))
    assert outcome.err.count("error: ") == 1
    table = pd.read_csv("both/compared.csv").set_index("vehicle")
    assert table["answer"].to_dict() == {"bus": YES, "a-double": NO}
    assert ("; with --clearance max the table says" in outcome.err) == (table["spare_m"]["bus"] < 0.05)
    wide = cli("plan", short_road, "--vehicle", "bus,a-double", "--half-width", "9", "--out", "wide", "--no-plot")
    assert "; with --clearance max" not in wide.err
    for name in table.index:
        cli("plan", short_road, "--vehicle", name, "--half-width", "1.7", "--out", "alone", "--no-plot")
        alone = json.loads(Path("alone/summary.json").read_text(encoding="utf-8"))["verdict"]
        assert json.loads(Path("both", name, "summary.json").read_text(encoding="utf-8"))["verdict"] == alone
        assert (table["spare_m"][name], table["s_m"][name], table["proved"][name]) == (alone["spare_m"], alone["s_m"], alone["proved"])
    cli("plan", "parked_van", "--vehicle", "bus,citaro", "--half-width", "6", "--out", "van", "--no-plot")
    assert pd.read_csv("van/compared.csv")["decides"].str.endswith("the obstacle 'parked van'").all()
    assert Path("both/compared.png").read_bytes().startswith(b"\x89PNG")


def test_a_comparison_tells_proofs_and_places_at_the_road_s_start() -> None:
    """A column was left out where all of its numbers were 0."""
    numbers = {"spare_m": [0.0, np.nan], "clearance_m": [0.0, 0.0], "half_width_m": [np.nan, np.nan], "s_m": [0.0, 0.0]}
    answers = {"answer": [NO, NO], "proved": [False, True]}
    shown = answer_texts(pd.DataFrame({"vehicle": ["bus", "car"], **answers, "decides": ["", ""], **numbers}))
    assert [*shown] == ["vehicle", "answer", "to spare [m]", "at s [m]", "what decides"]
    assert [*shown["to spare [m]"]] == ["0.00", "-"]
    assert [*shown["answer"]] == ["NO", "NO, proved"]
    least = {"spare_m": [-0.001, np.nan], "clearance_m": [0.0, 0.0], "answer": [YES, YES]}
    yes = answer_texts(pd.DataFrame({"vehicle": ["bus", "car"], **numbers, **answers, **least, "decides": ["", ""]}))
    assert [*yes["to spare [m]"]] == ["0.00", "-"]  # it said YES, and -0.001
    numbers |= {"spare_m": [-0.01, np.nan], "clearance_m": [0.388, 0.388]}  # as --clearance max keeps it, to 1 cm
    shown = answer_texts(pd.DataFrame({"vehicle": ["bus", "car"], **answers, "decides": ["", ""], **numbers}))
    assert [*shown["kept [m]"]] == ["0.38", "-"]
    assert [*shown["asked [m]"]] == ["0.39", "0.39"]
    assert "to spare [m]" not in shown


def test_of_several_vehicles_each_is_told_that_it_passes_an_obstacle_on_the_other_side(cli: Cli, tmp_path: Path) -> None:
    ring = [(60.0, 0.5), (66.0, 0.5), (66.0, 2.0), (60.0, 2.0)]  # right of it 2.4 m: too little for a bus with that clearance
    line = line_feature(np.array([(0.0, 0.0), (120.0, 0.0)]), left_m=9.0, right_m=1.9)
    written(tmp_path, line, area_feature(ring, region="obstacle", name="van"), name="van.geojson")
    outcome = cli("plan", "van.geojson", "--vehicle", "bus,citaro", "--clearance", "0.2", "--no-plot", "--no-proof", "--no-refine")
    for name in ("bus", "citaro"):
        assert f"{name}: the obstacle 'van' at s = 63.0 m is passed on the left, the line passes it on the right" in outcome.err


def test_vehicles_on_a_road_without_limits_are_compared_by_what_they_need(cli: Cli, short_road: str) -> None:
    outcome = cli("plan", short_road, "--vehicle", "bus,a-double", "--no-plot")
    assert outcome.code == 0
    assert re.match(r"NEEDS \d\.\d\d m to both sides for the a-double, the widest of 2\n", outcome.out)
    assert not Path("short.compared/compared.png").exists()
    both = json.loads(cli("plan", short_road, "--vehicle", "bus,a-double", "--no-plot", "--json").out)
    assert [one["vehicle"] for one in both] == ["bus", "a-double"]


@pytest.mark.parametrize("road", ["uturn", "three_point_turn"])
def test_a_scale_without_room_is_refused_before_anything_is_planned(cli: Cli, monkeypatch: pytest.MonkeyPatch, road: str) -> None:
    for planned in ("hdvplan.api.plan", "hdvplan.legs.plan_legs"):
        monkeypatch.setattr(planned, lambda *_, **__: pytest.fail("it was planned"))
    outcome = cli("plan", road, "--vehicle", "bus", "--sheet", "a4", "--scale", "1:10")
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err.splitlines()[-2].startswith("error: at 1:10 the sheet has no room for the ")


def test_limits_that_leave_the_smoothed_line_are_told_with_what_helps(cli: Cli) -> None:
    Path("bends.csv").write_text("x,y\n0,0\n40,0\n54,-6\n66,-15\n160,-48\n", encoding="utf-8")
    arguments = ("plan", "bends.csv", "--vehicle", "bus", "--offset", "-1.6", "--half-width", "1.5", "--no-plot", "--no-proof")
    told = "lie beside the smoothed line: try --corners sharp or round, or draw the edges"
    assert told in cli(*arguments).err
    assert told not in cli(*arguments, "--corners", "sharp").err


def test_a_weight_that_would_outweigh_the_limits_is_refused(cli: Cli) -> None:
    refused = cli("plan", "uturn", "--vehicle", "bus", "--half-width", "3", "--curvature-weight", "1e15")
    assert (refused.code, refused.out) == (2, "")
    assert "smoothness must be above 0 and at most 1e+09, not 1e+15" in refused.err
