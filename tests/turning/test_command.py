"""``hdvplan turn`` as users run it."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import shapely
from ezdxf.filemanagement import readfile
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar  # type: ignore[import-untyped] # Matplotlib types only its core

from hdvplan.answers import NO, YES, worded
from hdvplan.report.manoeuvre_plots import turn_figure
from hdvplan.turning.turn import load_template, turn
from hdvplan.vehicle.load import load_vehicle
from tests.cli.conftest import Cli, cli  # noqa: F401 - a fixture
from tests.report.test_drawings import notes, polylines

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
