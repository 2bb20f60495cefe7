"""Road files of other programs and vehicles of one's own at the command line: what is chosen, what is noted, and what is not loaded."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from ezdxf.filemanagement import new

from tests.cli.conftest import Cli

OPENDRIVE = Path(__file__).parents[1] / "road" / "files" / "bendplatz.xodr"
KML = """<kml xmlns="http://www.opengis.net/kml/2.2"><Document>
<Folder><name>streets</name><Placemark><name>A</name><LineString><coordinates>11.95,57.7 11.951,57.7</coordinates></LineString></Placemark>
<Placemark><name>B</name><LineString><coordinates>11.95,57.71 11.952,57.71</coordinates></LineString></Placemark></Folder>
<Folder><name>site</name><Placemark><name>kerb</name><LineString><coordinates>11.95,57.70003 11.951,57.70003</coordinates></LineString>
</Placemark></Folder></Document></kml>"""


def test_layer_name_and_role_choose_in_a_file(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "a.kml").write_text(KML, encoding="utf-8")
    asked = cli("roads", "info", "a.kml")
    assert asked.code == 2
    assert "2 lines, and none is chosen: 'A', 'B'" in asked.err
    found = cli("roads", "info", "a.kml", "--layer", "streets", "--name", "A", "--json")
    assert found.code == 0
    assert json.loads(found.out)["narrowest_m"] is not None
    other = cli("roads", "info", "a.kml", "--name", "B", "--role", "kerb=sweepable", "--json")
    assert (other.code, json.loads(other.out)["kind"]) == (2, "RoadError")
    assert "with open ends: a sweepable area has an outline" in other.err
    refused = cli("roads", "info", "a.kml", "--role", "kerb")
    assert (refused.code, refused.out) == (2, "")


def test_notes_go_to_stderr_and_into_the_summary(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("X,Y,name\n0,0,A\n60,0,B\n", encoding="utf-8")
    note = "a.csv: column name not read"
    planned = cli("plan", "a.csv", "--vehicle", "bus", "--no-plot", "--json")
    assert planned.code == 0
    assert note in planned.err.splitlines()
    assert json.loads(planned.out)["notes"] == [note]
    assert note not in cli("plan", "a.csv", "--vehicle", "bus", "--no-plot", "--quiet").err


def test_a_lane_of_an_opendrive_file_is_planned_within_its_edges_or_says_where_not(cli: Cli) -> None:
    refused = cli("roads", "info", str(OPENDRIVE))
    assert refused.code == 2
    assert "16 roads, and none is chosen" in refused.err
    planned = cli("plan", str(OPENDRIVE), "--road-ids", "2,1", "--vehicle", "bus", "--no-plot", "--no-proof", "--no-refine", "--json")
    summary = json.loads(planned.out)
    assert planned.code == 1  # 2.5 to 3.6 m of lane are too narrow for a bus in a turn
    assert summary["limit_violation_m"] > 0.1
    straight = cli("plan", str(OPENDRIVE), "--road-ids=-1", "--vehicle", "bus", "--no-plot", "--json")
    assert straight.code == 0


def test_a_drawing_in_millimetres_has_the_verdict_of_the_one_in_metres(cli: Cli, tmp_path: Path) -> None:
    spare = []
    for name, code, factor in (("m.dxf", 6, 1.0), ("mm.dxf", 4, 1000.0), ("none.dxf", 0, 1000.0)):
        document = new()
        document.header["$INSUNITS"] = code
        for layer, y in (("AXIS", 0.0), ("LEFT_EDGE", 2.0), ("RIGHT_EDGE", -1.75), ("TREES", 5.0)):
            points = [(-20.0 * factor, y * factor), (80.0 * factor, y * factor)]
            document.modelspace().add_lwpolyline(points, dxfattribs={"layer": layer})
        document.saveas(tmp_path / name)
        unit = ("--unit", "mm") if code == 0 else ()
        planned = cli("plan", name, "--layer", "AXIS", *unit, "--vehicle", "bus", "--no-plot", "--json")
        assert planned.code == 0
        assert (
            f"{name}: NOT READ: layer 'TREES' (1 entity); --role \"TREES=edge\" or =obstacle or =sweepable reads it"
            in planned.err.splitlines()
        )
        spare.append(json.loads(planned.out)["verdict"]["spare_m"])
    assert 0.0 < spare[0] < 1.0  # of 1.75 m beside a bus of 2.55 m
    assert spare[1:] == pytest.approx([spare[0]] * 2, abs=1e-6)  # a product's rounding, through a solver that stops at 1e-8
    for command in (("need", "none.dxf", "--vehicle", "bus"), ("plan", "none.dxf", "--vehicle", "bus"), ("roads", "info", "none.dxf")):
        asked = cli(*command, "--layer", "AXIS")
        assert asked.code == 2
        first, second = asked.err.splitlines()[-2:]
        assert first == "error: none.dxf says no unit, and in metres the points of its line are 100 km apart, as of no street"
        assert second == "hint: say its unit: --unit mm, cm, m, ft or in"
    assert cli("roads", "info", "none.dxf", "--layer", "AXIS", "--unit", "mm").code == 0
    replaced = "m: the file's edges are not used: the limits that options give replace them"
    for words in ("plan --no-plot", "need --no-plot --no-proof", "judge m.bus/path.csv --no-plot", "roads info"):
        given = (*words.split(), "m.dxf", "--layer", "AXIS", *(() if words == "roads info" else ("--vehicle", "bus")))
        assert replaced not in cli(*given).err
        assert replaced in cli(*given, "--half-width", "2").err.splitlines()


CORNER = [[0.0, 0.0], [60.0, 0.0], [60.0, 60.0]]


def corner_file(folder: Path, **properties: object) -> str:
    """Write a right-angled street of 2 x 3.6 m as GeoJSON in metres, and return its name."""
    crs = {"type": "name", "properties": {"name": "EPSG:3006"}}
    points = [[600e3 + x, 6400e3 + y] for x, y in CORNER]
    line = {"type": "Feature", "properties": {"width_m": 7.2, **properties}, "geometry": {"type": "LineString", "coordinates": points}}
    (folder / "corner.geojson").write_text(json.dumps({"type": "FeatureCollection", "crs": crs, "features": [line]}), encoding="utf-8")
    return "corner.geojson"


def test_corners_are_read_told_and_decided_by_options_before_properties(cli: Cli, tmp_path: Path) -> None:
    spare, least = [], ("--vehicle", "citaro", "--no-plot", "--no-proof", "--no-refine")
    for properties, options, corners in (
        ({}, (), 1),
        ({"corners": "round"}, (), 0),
        ({"corners": "round"}, ("--corners", "sharp"), 1),
        ({"corner_radius_m": 4.0}, (), 1),
        ({"corner_radius_m": 1.0}, ("--corner-radius", "4"), 1),
    ):
        planned = cli("plan", corner_file(tmp_path, **properties), *least, *options, "--json")
        summary = json.loads(planned.out)
        assert len(summary["corners"]) == corners
        spare.append(summary["verdict"]["spare_m"])
    (corner,) = summary["corners"]
    assert (corner["x"], corner["y"]) == pytest.approx((600060.0, 6400000.0))
    assert corner["angle_deg"] == pytest.approx(90.0)
    assert corner["s_m"] == pytest.approx(0.5 * summary["length_m"], abs=0.1)  # the corner is in the middle, the knots are not
    assert spare[2] == spare[0] != spare[1]
    assert spare[4] == spare[3] != spare[0]
    told = cli("roads", "info", corner_file(tmp_path)).out
    assert "s = 59 m, the rest as a curve; --corners decides otherwise" in " ".join(told.split())


@pytest.mark.parametrize(
    ("properties", "words"),
    [
        ({"corners": "blunt"}, "property corners must be auto, sharp or round, not 'blunt'"),
        ({"corner_radius_m": "much"}, "property corner_radius_m must be a number of metres, not 'much'"),
    ],
)
def test_a_file_s_own_reading_of_corners_that_is_none_is_refused(
    cli: Cli, tmp_path: Path, properties: dict[str, object], words: str
) -> None:
    refused = cli("roads", "info", corner_file(tmp_path, **properties))
    assert (refused.code, f"error: corner.geojson: {words}" in refused.err) == (2, True)


@pytest.mark.slow
def test_tables_and_geojson_do_without_gdal(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("x,y\n0,0\n50,0\n", encoding="utf-8")
    (tmp_path / "a.geojson").write_text('{"type": "LineString", "coordinates": [[11.95, 57.7], [11.951, 57.7]]}', encoding="utf-8")
    code = "import sys; from hdvplan import load_road; load_road('a.csv'); load_road('a.geojson'); print('pyogrio' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)  # noqa: S603 - our own words
    assert done.stdout == "False\n"


FIVE = """
name = "road train"
source = "mine"

[[unit]]
wheelbase = 4.2
front_overhang = 1.4
rear_overhang = 1.0
width = 2.5
hitch_offset = -0.4

[[unit]]
wheelbase = 7.0
front_overhang = 1.2
rear_overhang = 2.0
width = 2.5
hitch_offset = 1.5
steering_ratio = 0.4
max_steering_angle = 0.3

[[unit]]
name = "dolly"
wheelbase = 3.5
front_overhang = -2.4
length = 2.0
width = 2.4
hitch_offset = 0

[[unit]]
wheelbase = 6.0
front_overhang = 1.2
rear_overhang = 2.0
width = 2.5
hitch_offset = 1.5

[[unit]]
wheelbase = 5.0
front_overhang = -0.5
rear_overhang = 1.5
width = 2.3
steered = true
steering_ratio = 1.0
"""


@pytest.fixture
def five(tmp_path: Path) -> str:
    (tmp_path / "five.toml").write_text(FIVE, encoding="utf-8")
    return "five.toml"


@pytest.mark.slow  # kernels are compiled for five units
def test_five_units_are_planned_drawn_and_described(cli: Cli, five: str, tmp_path: Path) -> None:
    outcome = cli("plan", "roundabout", "--vehicle", five, "--half-width", "6", "--out", "plan", "--json")
    assert outcome.code == 0, outcome.err
    summary = json.loads(outcome.out)
    assert summary["status"] == "ok"
    assert summary["vehicle"] == "road train"
    path = pd.read_csv(tmp_path / "plan" / "path.csv")
    assert list(path.columns) == ["s", "x", "y", "heading", "e_y", "e_psi", "beta1", "beta2", "beta3", "beta4", "kappa", "K"]
    assert (tmp_path / "plan" / "plan.png").is_file()
    swept = json.loads((tmp_path / "plan" / "swept.geojson").read_text(encoding="utf-8"))
    swept_by = [feature["properties"]["unit"] for feature in swept["features"] if feature["properties"]["kind"] == "swept area"]
    assert swept_by == ["unit 1", "unit 2", "dolly", "unit 4", "unit 5"]
    described = json.loads(cli("vehicles", "show", five, "--json").out)
    assert described["length_m"] == pytest.approx(5.6 - 0.4 + 7.0 + 1.5 + 3.5 + 6.0 + 1.5 + 5.0 + 1.5)
    assert described["units"][4]["steering_ratio"] == 1.0
    assert cli("vehicles", "show", five, "--plot").code == 0


@pytest.mark.slow  # kernels are compiled for five units and two of these wheels
def test_wheels_that_the_plan_steers_are_written_with_the_path(cli: Cli, tmp_path: Path) -> None:
    """The dolly by the plan, the trailer behind it by a law, the last one by the plan again."""
    active = 'steered = "active"\nmax_steering_angle = 0.3\nmax_steering_rate = 0.05\n'
    text = FIVE.replace("width = 2.4\n", "width = 2.4\n" + active).replace("steered = true\nsteering_ratio = 1.0\n", active)
    (tmp_path / "active.toml").write_text(text, encoding="utf-8")
    outcome = cli("plan", "roundabout", "--vehicle", "active.toml", "--half-width", "6", "--out", "plan", "--json")
    assert outcome.code == 0, outcome.err
    path = pd.read_csv(tmp_path / "plan" / "path.csv")
    assert list(path.columns)[6:] == ["beta1", "beta2", "beta3", "beta4", "steering1", "steering2", "kappa", "K"]
    steering = path[["steering1", "steering2"]]
    assert (steering.abs().max() <= 0.3 + 1e-6).all()  # a solver may leave 1e-7 of a bound
    assert (steering.diff().abs().max() <= 0.05 * 0.5 + 1e-6).all()
    assert (steering.abs().max() > 0.05).all()
    assert cli("report", "plan").code == 0


def test_a_vehicle_that_hardly_steers_is_told_so_and_not_to_smooth_the_road(cli: Cli, tmp_path: Path) -> None:
    slow = "[[unit]]\nwheelbase = 6\nfront_overhang = 3\nrear_overhang = 3\nwidth = 2.5\nmax_curvature = 0.1\nmax_curvature_rate = 1e-9\n"
    (tmp_path / "slow.toml").write_text(slow, encoding="utf-8")
    outcome = cli("plan", "goteborg_lindholmsallen_uturn", "--vehicle", "slow.toml", "--no-plot", "--quiet", "--no-refine")
    assert outcome.code == 1
    assert outcome.err.splitlines()[1:] == [
        "hint: the slow steers too slowly for any way along the line: max_curvature_rate = 1e-09 1/m^2, per metre travelled"
    ]


@pytest.mark.parametrize("command", [("plan", "uturn", "--vehicle", "fleet/b.toml"), ("study", "study.toml", "--out", "out")])
def test_a_vehicle_that_is_refused_is_told_with_its_file(cli: Cli, five: str, command: tuple[str, ...]) -> None:
    """In a fleet of files the name inside, of a copy often another's, says little."""
    Path("fleet").mkdir()
    Path("fleet/a.toml").write_text(Path(five).read_text(encoding="utf-8"), encoding="utf-8")
    Path("fleet/b.toml").write_text(FIVE.replace("wheelbase = 4.2", "wheelbase = -4.2"), encoding="utf-8")
    Path("study.toml").write_text('roads = ["uturn"]\nvehicles = ["fleet/*.toml"]\n', encoding="utf-8")
    outcome = cli(*command)
    assert outcome.code == 2
    (line, _) = outcome.err.splitlines()
    assert line.startswith(f"error: {Path('fleet/b.toml')}: vehicle 'road train', unit 1: wheelbase = -4.2")
