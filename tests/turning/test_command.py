"""``hdvplan turn``, and ``hdvplan need`` with its templates, as users run them."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import shapely
from ezdxf.filemanagement import readfile
from matplotlib.text import Annotation
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar  # type: ignore[import-untyped] # Matplotlib types only its core
from pypdf import PdfReader

from hdvplan.answers import NEEDS, NO, YES, worded
from hdvplan.report.manoeuvre_plots import reversal_figure, turn_figure
from hdvplan.turning.reversing.answer import reversing
from hdvplan.turning.reversing.options import SiteOptions, Template
from hdvplan.turning.turn import load_template, turn
from hdvplan.vehicle.load import load_vehicle
from tests.cli.conftest import Cli, cli  # noqa: F401 - a fixture
from tests.report.pdf import strokes
from tests.report.test_drawings import notes, polylines
from tests.turning.reversals import REFUSE

KEYS = {
    "vehicle", "template", "radius_m", "angle_deg", "min_inside_radius_m", "max_outside_radius_m", "swept_width_m", "off_tracking_m",
    "tail_swing_m", "frontal_swing_m", "articulation_deg",
}  # fmt: skip
TEMPLATE = """
name = "depot gate"
source = "our own"
length_unit = "ft"
[manoeuvre]
radius = 45
angle = 90
ramp = 10
[limits]
swept_width = 20
"""


@pytest.mark.slow
def test_a_vehicle_that_complies_ends_in_0_with_its_figures(cli: Cli, tmp_path: Path) -> None:  # noqa: F811 - the fixture
    outcome = cli("turn", "--vehicle", "tractor-semitrailer", "--template", "eu-circle")
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.startswith(worded(YES, "tractor-semitrailer complies with eu-circle: "))
    assert "inside radius 5.346 m (at least 5.30), 0.046 m " in outcome.out.splitlines()[0]
    assert max(len(line) for line in outcome.out.splitlines()[1:]) <= 80
    folder = tmp_path / "eu-circle.tractor-semitrailer"
    assert {path.name for path in folder.iterdir()} == {"poses.csv", "width.csv", "turn.json", "turn.png"}


def test_a_vehicle_that_does_not_comply_ends_in_1_and_says_by_how_much(cli: Cli) -> None:  # noqa: F811
    outcome = cli("turn", "--vehicle", "citaro-le-mu", "--template", "eu-circle", "--no-plot")
    assert outcome.code == 1
    assert outcome.out.startswith(worded(NO, "citaro-le-mu does not comply"))
    assert outcome.err == "error: the inside radius of the citaro-le-mu is 5.137 m, 0.163 m below 5.300 m\n"


def test_a_radius_that_cannot_be_driven_ends_in_1_with_the_least_one(cli: Cli, tmp_path: Path) -> None:  # noqa: F811
    outcome = cli("turn", "--vehicle", "bus", "--template", "eu-circle")
    assert (outcome.code, outcome.out) == (1, "")
    assert "least radius 14.64 m, 2.14 m more" in outcome.err.splitlines()[0]
    options = outcome.err.splitlines()[1].split(": ")[2].split()
    assert not list(tmp_path.iterdir())
    assert cli("turn", "--vehicle", "bus", *options, "--no-plot", "--quiet").code == 0


def test_the_circle_of_a_vehicle_s_own_radius_has_its_wheels_at_their_stop(cli: Cli) -> None:  # noqa: F811
    bus = load_vehicle("bus")
    outcome = cli("turn", "--vehicle", "bus", "--radius", "vehicle", "--angle", "steady", "--json", "--no-plot")
    assert json.loads(outcome.out)["radius_m"] == pytest.approx(float(np.hypot(1.0 / bus.max_curvature, bus.lead.wheelbase)), abs=1e-9)


def test_json_has_the_agreed_names_and_nothing_else_is_said(cli: Cli) -> None:  # noqa: F811
    outcome = cli("turn", "--vehicle", "wb-62", "--radius", "15", "--angle", "90", "--json", "--no-plot")
    assert (outcome.code, outcome.err) == (0, "")
    found = json.loads(outcome.out)
    assert set(found) >= KEYS
    assert (found["vehicle"], found["template"], found["radius_m"], found["angle_deg"]) == ("WB-62", None, 15.0, 90.0)
    assert len(found["articulation_deg"]) == 1
    assert found["swept_width_m"] < found["max_outside_radius_m"] - found["min_inside_radius_m"]
    assert found["off_tracking_m"] == max(found["off_tracking_axles_m"])


def test_the_list_names_every_template_in_a_terminal_s_width(cli: Cli) -> None:  # noqa: F811
    table = cli("turn", "--list").out
    assert max(len(line) for line in table.splitlines()) <= 80
    listed = json.loads(cli("turn", "--list", "--json").out)
    assert all(template["name"] in table and template["source"] for template in listed)


@pytest.mark.slow
def test_a_circle_whose_centre_is_within_a_body_ends_in_1(cli: Cli) -> None:  # noqa: F811
    outcome = cli("turn", "--vehicle", "b-double", "--radius", "13.47", "--angle", "steady", "--guide", "front-corner")
    assert (outcome.code, outcome.out) == (1, "")
    assert "the b-double reaches around the circle's centre" in outcome.err.splitlines()[0]


def test_the_tables_hold_the_drive_and_its_width(cli: Cli, tmp_path: Path) -> None:  # noqa: F811
    (tmp_path / "gate.toml").write_text(TEMPLATE.replace("swept_width = 20", "outside_radius = 60"), encoding="utf-8")
    assert cli("turn", "--vehicle", "WB-40", "--template", "gate.toml", "--no-plot", "--quiet").out == ""
    folder = tmp_path / "depot-gate.WB-40"
    summary = json.loads((folder / "turn.json").read_text(encoding="utf-8"))
    width = pd.read_csv(folder / "width.csv")
    assert width["width"].max() == pytest.approx(summary["swept_width_m"], abs=1e-6)  # the file's digits
    poses = pd.read_csv(folder / "poses.csv")
    assert np.rad2deg(poses["beta1"].abs().max()) == pytest.approx(summary["articulation_deg"][0], abs=1e-6)


def test_a_turn_is_drawn_for_cad_with_the_figures_that_are_told(cli: Cli, tmp_path: Path) -> None:  # noqa: F811
    (tmp_path / "gate.toml").write_text("[manoeuvre]\nradius = 14\nangle = 90\n[limits]\ninside_radius = 6.5\noutside_radius = 18\n")
    asked = ("turn", "--vehicle", "tractor-semitrailer", "--template", "gate.toml", "--no-plot", "--out", "out")
    outcome = cli(*asked, "--format", "png,dxf")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"poses.csv", "width.csv", "turn.json", "turn.dxf"}
    drawing = readfile(tmp_path / "out" / "turn.dxf")
    assert drawing.header["$INSUNITS"] == 6  # metres
    assert not drawing.audit().errors
    counts = {
        "GUIDED_PATH": 1, "LIMITS": 2, "WHEEL_TRACKS": 6, "ENVELOPE_1_TRACTOR": 1, "ENVELOPE_2_SEMITRAILER": 1,
        "VEHICLE_OUTLINES_1_TRACTOR": 3, "VEHICLE_OUTLINES_2_SEMITRAILER": 3,
    }  # fmt: skip
    lines = {layer: polylines(drawing, layer) for layer in counts}
    assert {layer: len(found) for layer, found in lines.items()} == counts
    limits = [shapely.LineString(ring) for ring in lines["LIMITS"]]
    centre = limits[0].envelope.centroid
    assert sorted(shapely.hausdorff_distance(ring, centre) for ring in limits) == pytest.approx([6.5, 18.0], abs=1e-3)  # chords for arcs
    told = json.loads((tmp_path / "out" / "turn.json").read_text(encoding="utf-8"))
    swept = shapely.union_all([shapely.Polygon(ring) for name in lines if name.startswith("ENVELOPE") for ring in lines[name]])
    assert shapely.distance(swept, centre) == pytest.approx(told["min_inside_radius_m"], abs=1e-3)  # as above
    assert swept.buffer(0.01).covers(shapely.MultiLineString(lines["WHEEL_TRACKS"]))  # wheels run inside the body's outline
    assert notes(drawing).startswith(outcome.out.splitlines()[0])
    assert "mirror it for one to the right" in notes(drawing)
    cli(*asked)
    assert not (tmp_path / "out" / "turn.dxf").exists()  # a drawing that is not asked for again does not stay


@pytest.mark.slow
def test_the_picture_is_to_scale_and_its_title_is_the_verdict() -> None:
    figure = turn_figure(turn(load_vehicle("tractor-semitrailer"), load_template("eu-circle")))
    assert figure.get_suptitle().replace("\n", " ").startswith(worded(YES, "tractor-semitrailer complies with eu-circle"))
    plane = figure.axes[0]
    assert plane.get_aspect() == 1.0
    legend = plane.get_legend()
    assert legend is not None
    words = {text.get_text() for text in legend.get_texts()}
    assert {"outside radius 12.50 m, at most", "inside radius 5.30 m, at least", "path of the front corner"} <= words
    assert any(isinstance(child, AnchoredSizeBar) for child in plane.get_children())


@pytest.fixture
def refuse_file(tmp_path: Path) -> str:
    (tmp_path / "refuse.toml").write_text(REFUSE, encoding="utf-8")
    return "refuse.toml"


def test_a_manoeuvre_that_fits_ends_in_0_with_its_files(cli: Cli, tmp_path: Path, refuse_file: str) -> None:  # noqa: F811 - the fixture
    outcome = cli("turn", "--vehicle", refuse_file, "--template", "three-point", "--width", "14", "--format", "png,dxf")
    assert (outcome.code, outcome.err) == (0, "")
    first, second = outcome.out.splitlines()[:2]
    assert first.startswith(worded(YES, "the refuse turns round in 3 legs in 14.00 m of street width, 0."))
    assert len(first) <= 100
    assert "less may do" in second
    folder = tmp_path / "three-point.refuse"
    assert {path.name for path in folder.iterdir()} == {"poses.csv", "legs.geojson", "turn.json", "turn.png", "turn.dxf"}
    told = json.loads((folder / "turn.json").read_text(encoding="utf-8"))
    assert [leg["direction"] for leg in told["legs"]] == ["forward", "backward", "forward"]
    assert told["least_room_m"] >= 0.0
    lines = [one for one in json.loads((folder / "legs.geojson").read_text(encoding="utf-8"))["features"] if "leg" in one["properties"]]
    assert [(line["properties"]["leg"], line["properties"]["direction"]) for line in lines] == [
        (1, "forward"), (2, "backward"), (3, "forward"),
    ]  # fmt: skip
    for line, following in pairwise(lines):
        assert line["geometry"]["coordinates"][-1] == following["geometry"]["coordinates"][0]
    layers = {layer.dxf.name for layer in readfile(folder / "turn.dxf").layers}
    assert {"ROAD_FORWARD", "ROAD_BACKWARD", "OBSTACLES"} <= layers


@pytest.mark.slow
def test_the_poses_tell_leg_and_direction_and_go_on_at_the_cusps(cli: Cli, tmp_path: Path, refuse_file: str) -> None:  # noqa: F811
    cli("turn", "--vehicle", refuse_file, "--template", "three-point", "--no-plot", "--quiet")
    poses = pd.read_csv(tmp_path / "three-point.refuse" / "poses.csv")
    assert poses.groupby("leg")["direction"].first().tolist() == [1, -1, 1]
    ends, begins = poses[poses["leg"].diff(-1) == -1.0], poses[poses["leg"].diff() == 1.0]
    assert np.allclose(ends[["x", "y", "heading"]], begins[["x", "y", "heading"]], atol=1e-8)  # nine decimals are written
    assert poses["heading"].iloc[-1] == pytest.approx(np.pi, abs=1e-8)


@pytest.mark.parametrize(
    ("template", "options", "over"),
    [
        (Template.DOCK_90, SiteOptions(), 0.0),
        (Template.DOCK_90, SiteOptions(apron=45.0), 0.0),  # its far side was out of view
        (Template.THREE_POINT, SiteOptions(width=14.0, overhang=0.5), 0.5),
    ],
)
def test_the_picture_has_the_size_as_a_dimension_and_tells_kerbs_from_walls(template: Template, options: SiteOptions, over: float) -> None:
    vehicle = load_vehicle("tractor-semitrailer" if template.docks else "citaro-k")
    answer = reversing(vehicle, template, options, starts=1)
    (axes,) = reversal_figure(answer).axes
    words = [one.get_text() for one in axes.texts]
    text = words.index(f"{template.words} {answer.size:.2f} m")
    arrow = axes.texts[text - 1]
    assert isinstance(arrow, Annotation)
    assert np.hypot(*np.subtract(arrow.xy, arrow.xyann)) == pytest.approx(answer.size)
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    assert np.all((np.array([arrow.xy, arrow.xyann]) > low) & (np.array([arrow.xy, arrow.xyann]) < high))
    labels = [label for label in axes.get_legend_handles_labels()[1] if label.startswith(("kerb", "wall"))]
    assert labels == ([f"kerb, bodies may reach {over:.2f} m over it"] if over else ["wall, parked vehicle"])


@pytest.mark.slow
def test_the_sheet_has_the_site_to_scale_with_its_size_the_cusps_and_the_stamps(cli: Cli, tmp_path: Path, refuse_file: str) -> None:  # noqa: F811
    options = ("--width", "14", "--overhang", "0.5", "--sheet", "a3", "--scale", "200", "--stamp", "project=Depot 7", "--no-plot")
    outcome = cli("turn", "--vehicle", refuse_file, "--template", "three-point", *options)
    (page,) = PdfReader(tmp_path / "three-point.refuse" / "sheet.pdf").pages
    level = [np.ptp(line[:, 0]) for line in strokes(page) if len(line) == 2 and line[0, 1] == line[1, 1]]
    assert min(abs(length - 100.0) for length in level) < 1e-3  # the bar of 20 m
    text = " ".join(page.extract_text().split())
    first, second = outcome.out.splitlines()[:2]
    for words in (first, second, "street width 14.00 m", "1:200 on A3", "cusp 1 1:100", "kerb, bodies may reach 0.50 m over it", "Depot 7"):
        assert words in text


@pytest.mark.slow
def test_blocks_out_of_view_are_no_areas_of_the_road_file(cli: Cli, tmp_path: Path) -> None:  # noqa: F811
    """The neighbours of a dock askew stand apart; `plan` refused the areas without a point that were written for them."""
    cli("turn", "--vehicle", "WB-62", "--template", "dock-45", "--no-plot", "--quiet")
    file = tmp_path / "dock-45.WB-62" / "legs.geojson"
    areas = [one for one in json.loads(file.read_text(encoding="utf-8"))["features"] if "region" in one["properties"]]
    assert areas
    assert all(area["geometry"]["coordinates"] for area in areas)
    assert cli("plan", str(file), "--vehicle", "WB-62", "--no-plot").code in {0, 1}


@pytest.mark.slow
def test_what_does_not_fit_ends_in_1_and_says_what_does(cli: Cli, refuse_file: str) -> None:  # noqa: F811
    outcome = cli("turn", "--vehicle", refuse_file, "--template", "three-point", "--width", "9.5", "--no-plot")
    assert outcome.code == 1
    assert outcome.out.startswith(worded(NO, "no way was found for the refuse in 9.50 m of street width; "))
    assert "less than the least that was found to do" in outcome.err
    assert "cannot" not in outcome.out + outcome.err


@pytest.mark.slow
def test_what_nearly_fits_is_sought_as_long_as_need_seeks(cli: Cli, refuse_file: str, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: F811
    """It was a NO by a few searches where `need` told a smaller site."""
    monkeypatch.setattr("hdvplan.cli.turn._STARTS", 1)  # finds 13.87 m
    outcome = cli("turn", "--vehicle", refuse_file, "--template", "three-point", "--width", "13", "--no-plot")
    assert outcome.out.startswith(worded(YES, "the refuse turns round in 5 legs in 13.00 m"))


@pytest.mark.slow
def test_need_tells_the_least_size_in_5_cm_and_how_far_its_starts_are_apart(cli: Cli, tmp_path: Path, refuse_file: str) -> None:  # noqa: F811
    outcome = cli("need", "--template", "three-point", "--vehicle", refuse_file)
    assert outcome.code == 0
    assert all(line.startswith("looking for a manoeuvre of refuse: ") for line in outcome.err.splitlines())  # every ten seconds
    assert outcome.out.startswith(NEEDS)
    assert outcome.out.splitlines()[0].endswith("in 3 legs; 13.00 m in 5")
    told = json.loads((tmp_path / "three-point.refuse.need" / "need.json").read_text(encoding="utf-8"))
    assert told["fits_with_m"] == pytest.approx(round(20.0 * told["fits_with_m"]) / 20.0)
    assert 0.0 <= told["fits_with_m"] - told["needed_m"] < 0.05 + 1e-6
    assert [tried["legs"] for tried in told["tried"]] == [1, 3, 5]
    assert len(told["tried"][1]["found_m"]) == told["tried"][1]["starts"] == 9


def test_the_list_names_manoeuvres_that_reverse(cli: Cli) -> None:  # noqa: F811
    names = {"three-point", "hammerhead", "side-head", "dock-90", "dock-45"}
    table = cli("turn", "--list").out
    assert all(name in table for name in names)
    assert {one["name"] for one in json.loads(cli("turn", "--list", "--json").out) if one.get("reverses")} == names


@pytest.mark.slow
def test_legs_beside_which_a_body_is_at_no_kerb_are_planned(cli: Cli, tmp_path: Path) -> None:  # noqa: F811
    """The least half width of a leg of 4.2 m was moved in to less than none, and `plan` refused it."""
    cli("turn", "--vehicle", "bus", "--template", "three-point", "--no-plot", "--quiet")
    outcome = cli("plan", str(tmp_path / "three-point.bus" / "legs.geojson"), "--vehicle", "bus", "--no-plot")
    assert (outcome.code, outcome.out[:3]) == (1, "NO:")
