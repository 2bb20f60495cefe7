"""``hdvplan plan`` on files of several legs, and with ``--beside``: what it prints and writes, and what it refuses."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pandas as pd
import pyogrio
import pytest
import shapely
from shapely.geometry import shape
from shapely.geometry.base import BaseGeometry

from hdvplan.answers import NEEDS, NO, YES, without_word, worded
from hdvplan.report.summary import TRACKING
from hdvplan.vehicle.load import load_vehicle
from tests.cli.conftest import Cli
from tests.road.drives import BAY, EAST, NORTH, drawn, leg, line_feature, turn_features, written

VEHICLE = "citaro-k"
QUICK = ("--vehicle", VEHICLE, "--horizon", "40")
WIDE = np.array([(-20.0, -12.0), (50.0, -12.0), (50.0, 30.0), (-20.0, 30.0), (-20.0, -12.0)])


def summary_of(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    return found


@pytest.mark.slow
def test_a_turn_in_three_moves_is_planned_judged_told_and_written(cli: Cli, tmp_path: Path) -> None:
    written(tmp_path, *turn_features(), line_feature(WIDE, edge="left"))
    outcome = cli("plan", "turn.geojson", *QUICK, "--format", "png,svg,dxf,gpkg", "--sheet", "a4", "--animate")
    assert (outcome.code, outcome.err) == (0, "")
    verdict, more, *table = outcome.out.splitlines()
    assert verdict.startswith(YES)
    assert any(
        f" of leg {number} ({direction}), " in verdict for number, direction in enumerate(("forward", "backward", "forward"), start=1)
    )
    assert len(verdict) <= 100
    assert "at 59.3" in more
    assert [row.split()[0] for row in table if row.split()[:1] in (["1"], ["2"], ["3"])] == ["1", "2", "3"]
    folder = tmp_path / f"turn.{VEHICLE}"
    assert {path.name for path in folder.iterdir()} == {
        "drive.gif", "envelope.csv", "path.csv", "plan.dxf", "plan.gpkg", "plan.png", "plan.svg", "profile.csv", "regions.json", "run.json",
        "sheet.pdf", "steps.csv", "summary.json", "swept.geojson",
    }  # fmt: skip
    assert (folder / "plan.png").read_bytes().startswith(b"\x89PNG")
    drawing = (folder / "plan.svg").read_text(encoding="utf-8")
    for words in ("swept forward", "swept backward", "cusp 1", "cusp 2", "start", "end", "way driven [m]"):
        assert words in drawing
    layers = {layer.dxf.name for layer in ezdxf.readfile(folder / "plan.dxf").layers}  # type: ignore[attr-defined] # ezdxf does not re-export it
    assert {"ROAD_FORWARD", "ROAD_BACKWARD", "KERBS"} <= layers
    assert set(pyogrio.read_info(folder / "plan.gpkg", layer="road")["fields"]) >= {"leg", "direction"}
    features = json.loads((folder / "swept.geojson").read_text(encoding="utf-8"))["features"]
    swept = [one["properties"] for one in features if one["properties"]["kind"] == "swept area"]
    assert [(one["leg"], one["direction"]) for one in swept] == [(1, "forward"), (2, "backward"), (3, "forward")]


def test_the_summary_has_what_a_road_s_has_of_every_leg(cli: Cli, tmp_path: Path) -> None:
    written(tmp_path, *turn_features(), line_feature(WIDE, edge="left"))
    outcome = cli("plan", "turn.geojson", *QUICK, "--no-plot", "--json", "--out", "out")
    summary = summary_of(tmp_path / "out")
    assert json.loads(outcome.out) == summary
    assert [(one["leg"], one["direction"]) for one in summary["legs"]] == [(1, "forward"), (2, "backward"), (3, "forward")]
    worst = min(summary["legs"], key=lambda one: one["verdict"]["spare_m"])
    assert summary["verdict"]["leg"] == worst["leg"]
    assert summary["verdict"]["spare_m"] == worst["verdict"]["spare_m"] == pytest.approx(summary["min_clearance_m"])
    assert summary["length_m"] == pytest.approx(sum(one["length_m"] for one in summary["legs"]))
    for one in summary["legs"]:
        assert one["status"] == "ok"
        assert one["jackknife"] is None
        assert one["articulation_begin_deg"] == one["articulation_end_deg"] == []
        assert one["plans"] > 0
        assert [one[name] for name in TRACKING] == [None] * len(TRACKING)  # its bound holds along one line, driven forwards
    assert summary["settings"]["horizon"] == 40.0


def test_the_path_s_rows_are_in_the_order_of_driving_and_move_as_their_direction_says(cli: Cli, tmp_path: Path) -> None:
    written(tmp_path, *turn_features())
    assert cli("plan", "turn.geojson", *QUICK, "--no-plot", "--out", "out").code == 0
    path = pd.read_csv(tmp_path / "out" / "path.csv")
    assert list(path.columns) == ["leg", "direction", "s", "x", "y", "heading", "e_y", "e_psi", "kappa", "K"]
    assert path.groupby("leg")["direction"].first().tolist() == [1, -1, 1]
    ends = []
    for _, rows in path.groupby("leg"):
        sign = rows["direction"].iloc[0]
        step = np.diff(rows[["x", "y"]].to_numpy(), axis=0)
        heading = rows["heading"].to_numpy()
        middle = 0.5 * (heading[1:] + heading[:-1])
        along = step[:, 0] * np.cos(middle) + step[:, 1] * np.sin(middle)
        across = step[:, 1] * np.cos(middle) - step[:, 0] * np.sin(middle)
        assert np.all(sign * along > 0.0)
        assert np.all(np.diff(rows["s"]) * sign > 0.0)
        assert float(np.max(np.abs(across))) < 1e-5  # an arc's chord has the mean of its ends' headings; six decimals are written
        turned = along * rows["kappa"].to_numpy()[:-1]
        np.testing.assert_allclose(np.diff(heading), turned, atol=2e-4)  # chord against arc: (0.5 m)^3 (0.11 1/m)^3 / 24
        ends.append(rows.iloc[[0, -1]][["x", "y", "heading"]].to_numpy())
    for before, after in pairwise(ends):
        np.testing.assert_allclose(before[1][:2], after[0][:2], atol=2e-6)  # a cusp: the state is handed on, to six decimals
        assert abs(np.angle(np.exp(1j * (before[1][2] - after[0][2])))) < 1e-6


@pytest.mark.slow
def test_a_street_that_is_too_narrow_is_a_no_with_its_leg(cli: Cli, tmp_path: Path) -> None:
    walls = [
        line_feature(np.array([[-30.0, y], [50.0, y]]), edge="left", name=name) for name, y in (("south wall", -7.0), ("north wall", 10.0))
    ]
    written(tmp_path, *turn_features(), *walls)
    outcome = cli("plan", "turn.geojson", *QUICK, "--no-plot")
    assert outcome.code == 1
    verdict = outcome.out.splitlines()[0]
    assert verdict.startswith(NO)
    assert " of leg " in verdict
    assert " wall'" in outcome.out.splitlines()[1]  # the first line has no room for it
    assert outcome.err.splitlines()[-2] == f"error: {without_word(verdict, NO)}"
    assert "no proof is looked for on legs" in outcome.err


def test_without_anything_beside_the_legs_the_answer_is_what_they_need(cli: Cli, tmp_path: Path) -> None:
    written(tmp_path, *turn_features())
    outcome = cli("plan", "turn.geojson", *QUICK, "--no-plot")
    assert outcome.code == 0
    assert outcome.out.startswith(NEEDS)
    assert cli("plan", "turn.geojson", *QUICK, "--no-plot", "--half-width", "5").out.startswith(YES)


@pytest.mark.parametrize(("smooth", "moved", "turned"), [("1", "0.73", True), ("0.2", "0.20", False)])
def test_how_far_smoothing_moved_a_leg_is_told_and_that_it_parks_askew(
    cli: Cli, tmp_path: Path, smooth: str, moved: str, turned: bool
) -> None:
    written(tmp_path, leg(1, "backward", BAY), name="bay.geojson")
    outcome = cli("plan", "bay.geojson", *QUICK, "--no-plot", "--half-width", "9", "--smooth", smooth)
    assert outcome.code == 0
    assert moved in outcome.out.split()
    assert ("warning: smoothing turned the end of the last leg by" in outcome.err) is turned


def test_the_line_of_the_last_axle_leads_the_semitrailer_onto_a_dock(cli: Cli, tmp_path: Path) -> None:
    rear, _ = drawn((0.0, 0.0, 0.0), [(-30.0, 0.0), (-15.0, -0.02), (-20.0, 0.0)])
    written(tmp_path, leg(1, "backward", np.vstack([rear, rear[-1:]])), name="dock.geojson")  # an end drawn twice
    outcome = cli("plan", "dock.geojson", "--vehicle", "tractor-semitrailer", "--leg-line", "last-axle", "--no-plot", "--out", "out")
    assert outcome.code == 0
    path = pd.read_csv(tmp_path / "out" / "path.csv")
    end = path.iloc[-1]
    tractor, trailer = load_vehicle("tractor-semitrailer").units
    behind, along = end["heading"] - end["beta1"], np.array([np.cos(end["heading"]), np.sin(end["heading"])])
    kingpin = np.array([end["x"], end["y"]]) - tractor.hitch_offset * along
    apart = np.hypot(*(kingpin - trailer.wheelbase * np.array([np.cos(behind), np.sin(behind)]) - rear[-1] - [EAST, NORTH]))
    assert apart < 0.25  # of the drawn end, which is the trailer's axle's
    told = summary_of(tmp_path / "out")["legs"][-1]
    assert told["off_line_end_m"] == pytest.approx(apart, abs=1e-3)  # path.csv is rounded
    assert abs(told["off_line_end_deg"]) < 3.0
    assert abs(end["beta1"]) < np.deg2rad(3.0)  # on the straight before the dock the vehicle is stretched again


@pytest.mark.slow
def test_where_walls_lead_out_of_the_model_a_plan_without_them_is_judged(cli: Cli) -> None:
    outcome = cli("plan", "three_point_turn", "--vehicle", "tractor-semitrailer", "--no-plot", "--no-refine")
    assert outcome.code == 1
    assert outcome.out.startswith(worded(NO, "jack-knife at s = "))


def _swept(folder: Path) -> BaseGeometry:
    features = json.loads((folder / "swept.geojson").read_text(encoding="utf-8"))["features"]
    return shapely.union_all([shape(one["geometry"]) for one in features if one["properties"]["kind"] == "swept area"])


def _meeting(cli: Cli, road: str, half: float) -> tuple[int, str]:
    """Drive a road with kerbs ``half`` to either side of its line [m] on the right, and then back, beside what was swept."""
    own = ("plan", road, "--vehicle", "bus", "--offset", "-1.75", "--left", f"{half + 1.75}", "--right", f"{half - 1.75}", "--no-plot")
    assert cli(*own, "--quiet", "--out", "there").code == 0
    back = cli(*own, "--reverse", "--beside", "there", "--no-proof", "--no-refine", "--out", "back")
    return back.code, back.out.splitlines()[0]


def test_two_vehicles_meet_where_the_street_is_wide_enough(cli: Cli, tmp_path: Path, short_road: str) -> None:
    code, line = _meeting(cli, short_road, 3.8)
    assert (code, line[:3]) == (0, "YES")
    first, second = _swept(tmp_path / "there"), _swept(tmp_path / "back")
    assert shapely.distance(first, second) > 0.0  # in one plane, whichever way the line was driven
    told = json.loads((tmp_path / "back" / "summary.json").read_text(encoding="utf-8"))
    (met,) = told["obstacles"]
    assert met["name"] == "bus, plan there"
    assert met["distance_m"] == pytest.approx(shapely.distance(first, second), abs=0.02)  # files round to 1 mm, outlines have chords
    assert [(one["name"], one["side"]) for one in told["passed"]] == [("bus, plan there", "right")]


@pytest.mark.slow
def test_where_they_cannot_meet_the_place_is_told(cli: Cli, short_road: str) -> None:
    code, line = _meeting(cli, short_road, 3.05)
    assert code == 1
    assert line.startswith("NO: ")
    own = (short_road, "--vehicle", "bus", "--offset", "-1.75", "--left", "4", "--right", "0.1", "--no-plot")
    again = cli("plan", *own, "--reverse", "--beside", "there", "--no-refine", "--out", "proved")
    assert "that keeps the limits beside the plan in there; passes" in again.out.splitlines()[1]
    assert again.err.splitlines()[-1] == "hint: the plan in there takes its share: --meeting FROM:TO lets the two meet elsewhere"


@pytest.mark.slow
def test_two_that_cannot_meet_in_the_bend_may_where_one_waits(cli: Cli, tmp_path: Path) -> None:
    own = ("plan", "uturn", "--vehicle", "bus", "--offset", "-1.75", "--left", "5.05", "--right", "1.55", "--no-plot", "--no-proof")
    cli(*own, "--quiet", "--no-refine", "--out", "there")
    back = (*own, "--reverse", "--no-refine", "--beside", "there", "--out", "back")
    assert cli(*back).code == 1
    assert cli(*back, "--meeting", "0:30").out.startswith("YES")
    condition = "holds beside the plan in there, which stays between s = 0.0 and 30.0 m until this one has passed"
    assert condition in json.loads((tmp_path / "back" / "summary.json").read_text(encoding="utf-8"))["verdict"]["details"]
    met = json.loads((tmp_path / "back" / "summary.json").read_text(encoding="utf-8"))["obstacles"]
    assert [one["name"] for one in met] == ["bus, plan there"]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        pytest.param(("--meeting", "0:30"), "--meeting needs --beside DIR", id="nobody"),
        pytest.param(("--beside", "there", "--meeting", "30"), "two places of the road in metres", id="one place"),
        pytest.param(("--beside", "there", "--meeting", "30:10"), "the first one before the other", id="backwards"),
        pytest.param(("--beside", "there", "--meeting", "20:31"), "the other vehicle is 12.0 m long", id="shorter than a bus"),
        pytest.param(("--beside", "there", "--meeting", "900:950"), "and the road is ", id="beyond the road"),
        pytest.param(("--beside", "there", "--meeting", "a:b"), "such as 20:60, not 'a:b'", id="words"),
    ],
)
def test_a_meeting_is_a_stretch_beside_somebody(cli: Cli, short_road: str, given: tuple[str, ...], told: str) -> None:
    own = ("plan", short_road, "--vehicle", "bus", "--half-width", "6", "--no-plot", "--no-refine", "--no-proof")
    cli(*own, "--out", "there", "--quiet")
    outcome = cli(*own, *given)
    assert outcome.code == 2
    assert told in outcome.err


def test_a_meeting_needs_to_know_how_long_the_other_vehicle_is(cli: Cli, tmp_path: Path, short_road: str) -> None:
    own = ("plan", short_road, "--vehicle", "bus", "--half-width", "6", "--no-plot", "--no-refine", "--no-proof")
    cli(*own, "--out", "there", "--quiet")
    for content in (None, "{", '{"bodies": []}', '{"bodies": 1}'):
        (tmp_path / "there" / "summary.json").unlink()
        if content is not None:
            (tmp_path / "there" / "summary.json").write_text(content, encoding="utf-8")
        outcome = cli(*own, "--beside", "there", "--meeting", "0:30", "--out", "back")
        assert outcome.code == 2
        assert "says how long the other vehicle is" in outcome.err
        (tmp_path / "there" / "summary.json").touch()


def test_a_vehicle_that_does_not_keep_its_own_street_is_no_silent_company(cli: Cli, short_road: str) -> None:
    own = ("plan", short_road, "--vehicle", "bus", "--no-plot", "--no-proof", "--no-refine")
    assert cli(*own, "--half-width", "1.3", "--offset", "4", "--out", "there").code == 1
    back = cli(*own, "--reverse", "--half-width", "6", "--beside", "there", "--out", "back")
    assert "warning: the plan in there does not keep its own limits: NO: " in back.err
    assert json.loads(Path("back/summary.json").read_text(encoding="utf-8"))["notes"][-1].startswith("the plan in there does not keep")


def test_what_is_no_plan_or_lies_elsewhere_is_refused(cli: Cli, tmp_path: Path, short_road: str) -> None:
    own = ("plan", short_road, "--vehicle", "bus", "--half-width", "3", "--no-plot")
    none = cli(*own, "--beside", "nowhere")
    assert (none.code, none.err.splitlines()[0]) == (2, "error: nowhere has no swept.geojson with the area that a plan swept")
    (tmp_path / "swept.geojson").write_text('{"features": [{"properties": null}]}', encoding="utf-8")
    assert cli(*own, "--beside", ".").code == 2
    cli("plan", "goteborg_lindholmsallen_uturn", "--vehicle", "bus", "--no-plot", "--quiet", "--out", "earth")
    apart = cli(*own, "--beside", "earth")
    assert apart.code == 2
    assert "swept is in degrees, and short is not" in apart.err
    cli(*own, "--quiet", "--out", "near")
    (tmp_path / "far.csv").write_text("x,y\n0,500\n60,500\n", encoding="utf-8")
    far = cli("plan", "far.csv", "--vehicle", "bus", "--half-width", "3", "--no-plot", "--beside", "near")
    assert far.code == 2
    assert "swept lies more than 20 m from far" in far.err
