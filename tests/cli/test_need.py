"""``hdvplan need``, and proofs as users meet them: in the verdict and in files."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pyogrio
import pytest
import shapely
from ezdxf.entities.lwpolyline import LWPolyline
from ezdxf.entities.mtext import MText
from ezdxf.filemanagement import readfile
from pypdf import PdfReader

from hdvplan.answers import NO
from tests.cli.conftest import Cli
from tests.road.drives import area_feature, line_feature, written

NEAR_M = 0.05  # what the coarse cells of a proof cost, and by how much the best plan tried takes more than the least
FIELDS = {"tolerance_m", "proved_below_m", "proof", "s_m", "lon", "lat", "unit", "part", "side", "widening_m2"}


@pytest.fixture
def bend(tmp_path: Path) -> str:
    (tmp_path / "bend.csv").write_text("s,kappa\n0,0\n20,0\n28,0.06\n45,0.06\n53,0\n80,0\n", encoding="utf-8")
    return "bend.csv"


@pytest.mark.slow
def test_the_least_half_width_is_told_written_and_true(cli: Cli, tmp_path: Path, bend: str) -> None:
    outcome = cli("need", bend, "--vehicle", "bus")
    assert outcome.code == 0
    folder = tmp_path / "bend.bus.need"
    assert sorted(path.name for path in folder.iterdir()) == ["need.json", "need.png", "run.json"]
    told = json.loads((folder / "need.json").read_text(encoding="utf-8"))
    assert told.keys() >= FIELDS | {"half_width_m"}
    assert outcome.out.startswith(
        f"NEEDS {told['half_width_m']:.2f} m to both sides of the line for the bus: decided at s = {told['s_m']:.1f}"
    )
    assert (told["fits"], told["widening_m2"], told["tolerance_m"]) == (None, None, 0.01)
    below, proof = told["proved_below_m"], told["proof"]
    assert told["half_width_m"] - NEAR_M < below < told["half_width_m"]
    said = f"between s = {proof['s_from_m']:.1f} and {proof['s_to_m']:.1f} m nothing that this vehicle can drive keeps the limits"
    assert outcome.out.splitlines()[0].endswith(f"; {below:.2f} m is proved to be too little: {said}")
    narrow = cli("plan", bend, "--vehicle", "bus", "--half-width", f"{below:.4f}", "--no-plot", "--json")
    assert json.loads(narrow.out)["verdict"]["proved"] is True
    width = f"{told['half_width_m'] + 0.01:.3f}"
    assert cli("plan", bend, "--vehicle", "bus", "--half-width", width, "--no-plot", "--quiet").code == 0


@pytest.mark.parametrize(
    ("limits", "words"),
    [(("--half-width", "4"), "4.00 m to either side"), (("--left", "4", "--right", "3.5"), "4.00 m to the left and 3.50 m to the right")],
)
def test_limits_that_options_gave_are_not_called_the_road_s_own(cli: Cli, bend: str, limits: tuple[str, ...], words: str) -> None:
    outcome = cli("need", bend, "--vehicle", "bus", *limits, "--no-plot")
    assert outcome.out.startswith(f"YES: the bus fits within {words}; ")


def test_json_is_all_that_stdout_gets(cli: Cli, bend: str) -> None:
    outcome = cli("need", bend, "--vehicle", "bus", "--fix", "left", "--left", "2", "--json", "--no-plot", "--no-proof")
    told = json.loads(outcome.out)
    assert outcome.code == 0
    assert told.keys() >= FIELDS | {"right_m"}
    assert told["right_m"] > 2.0
    assert (told["proved_below_m"], told["proof"]) == (None, None)


@pytest.mark.slow
def test_several_vehicles_are_answered_together(cli: Cli, bend: str) -> None:
    arguments = ("need", bend, "--fix", "left", "--left", "2", "--no-plot", "--no-proof")
    outcome = cli(*arguments, "--vehicle", "bus,citaro-k", "--out", "both")
    assert outcome.code == 0
    table, alone = pd.read_csv("both/needs.csv"), cli(*arguments, "--vehicle", "bus", "--json")
    right = dict(zip(table["vehicle"], table["right_m"], strict=True))
    assert right["bus"] == json.loads(alone.out)["right_m"]
    assert right["citaro-k"] < right["bus"]
    for vehicle, room in right.items():
        line = next(line for line in outcome.out.splitlines() if line.split()[:1] == [vehicle])
        assert f" {room:.2f} " in line
        assert (Path("both") / vehicle / "need.json").is_file()


@pytest.mark.slow
def test_a_half_width_is_of_another_street_where_the_road_has_edges_of_its_own(cli: Cli, tmp_path: Path) -> None:
    rows = "\n".join(f"{x},0,{2.5 + 0.01 * x},2.5" for x in range(0, 61, 5))
    (tmp_path / "widening.csv").write_text(f"x,y,left_m,right_m\n{rows}\n", encoding="utf-8")
    told = cli("need", "widening.csv", "--vehicle", "bus", "--no-proof").out.splitlines()[1]
    assert " m to both sides of the line for the bus, were the street as wide as that throughout: decided at s = " in told


@pytest.mark.slow
def test_a_road_too_narrow_is_a_no_with_the_kerb_to_take_away(cli: Cli, tmp_path: Path, bend: str) -> None:
    wanted = ("--format", "dxf,gpkg", "--sheet", "a4", "--stamp", "project=Line 18")
    outcome = cli("need", bend, "--vehicle", "bus", "--half-width", "2.1", "--out", "out", "--no-proof", *wanted)
    assert outcome.code == 0
    (page,) = PdfReader(tmp_path / "out" / "sheet.pdf").pages
    drawn = " ".join(page.extract_text().split())
    (least,) = re.findall(r"widening the road by ([0-9.]+ m2)", outcome.out)
    assert "NO: the bus does not fit" in drawn
    assert least in drawn
    assert "to be widened (least area found)" in drawn
    assert "to widen s = " in drawn
    assert "Line 18" in drawn
    told = json.loads((tmp_path / "out" / "need.json").read_text(encoding="utf-8"))
    assert outcome.out.startswith(f"NO: the bus does not fit; widening the road by {told['widening_m2']:.1f} m2 would do, ")
    assert told["fits"] is False
    for name, kind in (("widening.geojson", "least_area"), ("widening_least_depth.geojson", "least_depth")):
        places = json.loads((tmp_path / "out" / name).read_text(encoding="utf-8"))["features"]
        said = told["widening"][kind]
        assert said["fits_then"] is True
        assert [place["properties"]["area_m2"] for place in places] == pytest.approx(
            [place["area_m2"] for place in said["places"]], abs=5e-4
        )
    assert "least area" in outcome.out
    assert "least depth found" in outcome.out
    drawing, said = readfile(tmp_path / "out" / "need.dxf"), told["widening"]["least_area"]["places"]
    areas = [line for line in drawing.modelspace().query('LWPOLYLINE[layer=="WIDENING"]') if isinstance(line, LWPolyline)]
    assert sum(shapely.Polygon(line.vertices()).area for line in areas) == pytest.approx(told["widening_m2"], abs=1e-3)
    assert len(drawing.modelspace().query('TEXT[layer=="WIDENING"]')) == len(said)
    assert not drawing.modelspace().query('*[layer=="CONFLICTS"]')  # they lie in the areas that are to be widened
    (notes,) = drawing.modelspace().query("MTEXT")
    assert isinstance(notes, MText)
    assert notes.text.startswith("NO: the bus does not fit; widening the road by ")
    layers = {name for name, _ in pyogrio.list_layers(tmp_path / "out" / "need.gpkg")}
    assert {"road", "limits", "envelope", "widening", "widening_least_depth"} <= layers
    meta, _, shapes, fields = pyogrio.raw.read(tmp_path / "out" / "need.gpkg", layer="widening")
    assert len(shapes) == len(said)
    columns = dict(zip(meta["fields"], fields, strict=True))
    for name, key in (("depth_m", "depth_m"), ("area_m2", "area_m2"), ("s_m", "s_deepest")):
        assert columns[name] == pytest.approx([place[key] for place in said])


@pytest.mark.slow
def test_a_held_edge_that_cannot_be_kept_is_a_no_with_what_it_takes(cli: Cli, tmp_path: Path) -> None:
    # An edge 0.9 m outside of a half turn of 10.5 m: no long vehicle turns so tightly, however wide the road is inside.
    (tmp_path / "turn.csv").write_text("s,kappa\n0,0\n20,0\n26,-0.095\n61,-0.095\n67,0\n95,0\n", encoding="utf-8")
    outcome = cli("need", "turn.csv", "--vehicle", "tractor-trailer-24m", "--fix", "left", "--left", "0.9", "--json", "--no-plot")
    assert outcome.code == 1
    told = json.loads(outcome.out)
    assert told["right_m"] is None
    assert told["least_left_m"] > 0.9
    assert told["proved_below_m"] is None  # the proof knows no bound for a side that is open
    assert f"; one was found with the left edge {told['least_left_m']:.2f} m off, decided at s = " in outcome.err


@pytest.mark.slow
def test_beside_a_held_edge_that_is_nearer_than_half_the_vehicle_it_stands_aside_from_the_start(cli: Cli, bend: str) -> None:
    held = ("--left", "0.9", "--no-plot", "--no-proof")
    told = json.loads(cli("need", bend, "--vehicle", "bus", "--fix", "left", *held, "--json").out)
    assert told["right_m"] is not None
    for more, code in ((0.01, 0), (-0.15, 1)):
        assert cli("plan", bend, "--vehicle", "bus", *held, "--right", f"{told['right_m'] + more:.3f}", "--quiet").code == code


@pytest.mark.slow
def test_what_no_width_cures_is_not_blamed_on_an_obstacle(cli: Cli, bend: str) -> None:
    outcome = cli("need", bend, "--vehicle", "bus", "--half-width", "4", "--clearance", "14.5", "--no-plot")
    assert outcome.code == 1
    assert "at any half width up to 15 m, 14.50 m of clearance included" in outcome.err
    assert "obstacle" not in outcome.out + outcome.err


@pytest.mark.slow
def test_an_obstacle_that_is_passed_on_the_other_side_than_the_line_passes_it_is_told(cli: Cli, tmp_path: Path) -> None:
    """A lorry went behind a lamp post over the footway, and nothing said so."""
    line = line_feature(np.array([(0.0, 0.0), (100.0, 0.0)]), left_m=3.0, right_m=1.9)
    mast = area_feature([(60.1, 0.5), (66.8, 0.5), (66.8, 2.0), (60.1, 2.0)], region="obstacle", name="MAST")
    written(tmp_path, line, mast, name="street.geojson")
    outcome = cli("need", "street.geojson", "--vehicle", "bus", "--fix", "right", "--no-plot", "--no-proof")
    assert re.search(r"warning: the obstacle 'MAST' at s = 63\.\d m is passed on the left, the line passes it on the right: ", outcome.err)
    (passed,) = json.loads((tmp_path / "street.bus.need" / "need.json").read_text(encoding="utf-8"))["passed"]
    assert (passed["name"], passed["side"], passed["crossed"]) == ("MAST", "left", True)


BEND = ("tight_bend.csv", "--vehicle", "bus", "--no-plot")
TOO_LITTLE_M, ENOUGH_M = "2.2", "2.4"  # the bus needs 2.36 m here: `hdvplan need`


@pytest.fixture
def tight_bend(tmp_path: Path) -> Path:
    (tmp_path / "tight_bend.csv").write_text("s,kappa\n0,0\n20,0\n28,0.06\n45,0.06\n53,0\n80,0\n", encoding="utf-8")
    return tmp_path


@pytest.mark.slow
def test_a_bus_that_cannot_pass_gets_a_proof_with_its_stretch(cli: Cli, tight_bend: Path) -> None:
    outcome = cli("plan", *BEND, "--half-width", TOO_LITTLE_M, "--out", "out")
    assert outcome.code == 1
    summary = json.loads((tight_bend / "out" / "summary.json").read_text(encoding="utf-8"))
    verdict, proof = summary["verdict"], summary["verdict"]["proof"]
    assert (verdict["fits"], verdict["proved"]) == (False, True)
    assert (proof["kind"], proof["unit"]) == ("motion", "bus")
    assert 0.0 <= proof["s_from_m"] < proof["s_to_m"] <= summary["length_m"]
    said = f"proved: between s = {proof['s_from_m']:.1f} and {proof['s_to_m']:.1f} m nothing that this vehicle can drive keeps the limits"
    assert outcome.out.splitlines()[0] == verdict["text"]
    assert verdict["text"].startswith(NO)
    assert verdict["details"].endswith(f"; {said}")
    without = json.loads(cli("plan", *BEND, "--half-width", TOO_LITTLE_M, "--json", "--no-proof").out)["verdict"]
    assert (without["proved"], without["proof"], without["spare_m"]) == (False, None, verdict["spare_m"])  # it changes nothing of the plan


def test_a_proof_says_which_clearance_it_is_about(cli: Cli, tight_bend: Path) -> None:
    assert tight_bend.is_dir()
    verdict = json.loads(cli("plan", *BEND, "--half-width", ENOUGH_M, "--clearance", "0.6", "--json").out)["verdict"]
    assert verdict["proved"]
    assert verdict["details"].endswith(" m nothing that this vehicle can drive stays 0.60 m off the limits")


def test_a_bad_plan_where_a_better_one_fits_is_not_called_proved(cli: Cli, tight_bend: Path) -> None:
    assert tight_bend.is_dir()
    options = (*BEND, "--half-width", ENOUGH_M, "--json")
    assert json.loads(cli("plan", *options).out)["verdict"]["fits"] is True
    short_sighted = cli("plan", *options, "--horizon", "12")  # it sees the tight_bend too late to swing out
    verdict = json.loads(short_sighted.out)["verdict"]
    assert short_sighted.code == 1
    assert (verdict["fits"], verdict["proved"], verdict["proof"]) == (False, False, None)
    assert verdict["details"].endswith("; no plan was found, and none is excluded")
