"""Units of files without a coordinate reference system: one street in each of them, and what no street can be."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from ezdxf.filemanagement import new

from hdvplan.arrays import FloatArray
from hdvplan.errors import OptionError, RoadError
from hdvplan.road.load import load_road
from hdvplan.road.load_csv import read_csv
from hdvplan.road.options import RoadOptions

INSUNITS = {"mm": 4, "cm": 5, "m": 6, "in": 1, "ft": 2}
METRES = {"mm": 0.001, "cm": 0.01, "m": 1.0, "in": 0.0254, "ft": 0.3048}
BEND = [(25.0 * np.sin(a), 25.0 * (1.0 - np.cos(a))) for a in np.linspace(0.0, 0.5 * np.pi, 10)]
LINE = np.array([(-40.0, 0.0), (-20.0, 0.0), *BEND, (25.0, 45.0), (25.0, 65.0)])
MAP = np.array([318_000.0, 6_399_000.0])
ROUNDED_M = 1e-6  # a double's 16 digits of 6.4e6 m are 1e-9 m; smoothing stops at about 1e-8 m


def beside(reach: float) -> FloatArray:
    """Return the line's points moved to the left [m], along its bisectors."""
    steps = np.diff(LINE, axis=0)
    normals = np.stack([-steps[:, 1], steps[:, 0]], axis=1) / np.hypot(*steps.T)[:, None]
    mean = np.concatenate([normals[:1], normals[1:] + normals[:-1], normals[-1:]])
    return np.asarray(LINE + reach * mean / np.hypot(*mean.T)[:, None])


def drawing(
    path: Path,
    unit: str,
    code: int | None = None,
    *,
    version: str = "R2018",
    fmt: str = "asc",
    near: bool = False,
    layers: dict[str, FloatArray] | None = None,
) -> Path:
    """Write a street as a CAD program does: in ``unit``, as INSUNITS ``code`` says, on a map or ``near`` the origin."""
    document = new(version)
    document.header["$INSUNITS"] = INSUNITS[unit] if code is None else code
    halves = {"AXIS": LINE[:6], "AXIS ": LINE[5:] + np.array([0.003, 0.0])}  # drawn with a gap of 3 mm
    for layer, points in {**halves, "EDGE_LEFT": beside(4.0), "EDGE_RIGHT": beside(-4.5), **(layers or {})}.items():
        placed = (points + (0.0 if near else MAP)) / METRES[unit]
        space = document.modelspace()
        draw = space.add_polyline2d if version == "R12" else space.add_lwpolyline
        draw(placed.tolist(), dxfattribs={"layer": layer.strip()})
    document.saveas(path, fmt=fmt)
    return path


ON_AXIS = RoadOptions(layer="AXIS")


@pytest.mark.parametrize("unit", INSUNITS)
@pytest.mark.parametrize("fmt", ["asc", "bin"])
def test_a_drawing_is_the_same_road_in_every_unit(tmp_path: Path, unit: str, fmt: str) -> None:
    expected = load_road(drawing(tmp_path / "metres.dxf", "m"), ON_AXIS)
    road = load_road(drawing(tmp_path / "other.dxf", unit, fmt=fmt), ON_AXIS)
    s = np.linspace(0.0, expected.path.length - ROUNDED_M, 50)
    assert road.path.length == pytest.approx(expected.path.length, abs=ROUNDED_M)
    np.testing.assert_allclose(road.path.at(s).x, expected.path.at(s).x, rtol=0.0, atol=ROUNDED_M)
    assert road.limits is not None
    assert expected.limits is not None
    np.testing.assert_allclose(road.limits.table(s), expected.limits.table(s), rtol=0.0, atol=ROUNDED_M)
    said = [note for note in road.notes if "INSUNITS" in note]
    assert len(said) == (unit != "m")


def test_obstacles_of_a_drawing_are_in_its_unit_too(tmp_path: Path) -> None:
    van = LINE[1] + np.array([(0.0, 1.0), (6.0, 1.0), (6.0, 3.0), (0.0, 3.0), (0.0, 1.0)])
    (region,) = load_road(drawing(tmp_path / "a.dxf", "mm", layers={"HINDER": van}), ON_AXIS).regions
    assert region.polygon.area == pytest.approx(12.0, abs=10.0 * ROUNDED_M)  # along sides of 6 m and 2 m


@pytest.mark.parametrize(
    ("unit", "code", "version", "said"),
    [
        ("mm", 0, "R2018", "says no unit, and in metres its line is 1[0-9.]+ km long"),
        ("mm", 4, "R12", "says no unit"),  # it has no INSUNITS
        ("cm", 0, "R2018", "says no unit, and in metres its edges are more than 250 m from its line"),
        ("mm", 9, "R2018", "says no unit"),  # mils, in which nobody draws streets
        ("mm", 6, "R2018", r"says metres \(INSUNITS 6\), and in these"),
        ("m", 4, "R2018", r"says millimetres \(INSUNITS 4\), and in these its line is 0\.\d+ m long"),
        ("m", 1, "R2018", r"says inches \(INSUNITS 1\), and in these its line is [34]\.\d+ m long"),
    ],
)
def test_a_drawing_of_no_street_is_asked_for_its_unit_and_read_with_it(
    tmp_path: Path, unit: str, code: int, version: str, said: str
) -> None:
    file = drawing(tmp_path / "a.dxf", unit, code, version=version, near=True)
    with pytest.raises(RoadError, match=r"^a\.dxf " + said) as caught:
        load_road(file, ON_AXIS)
    asked, named = str(caught.value.hint).split("--unit ")
    assert asked == "say its unit: "
    assert unit in re.split(r", | or ", named)  # of those with which it is as long as a road
    road = load_road(file, RoadOptions(layer="AXIS", unit=unit))
    expected = load_road(drawing(tmp_path / "metres.dxf", "m", near=True), ON_AXIS)
    assert road.path.length == pytest.approx(expected.path.length, abs=ROUNDED_M)
    assert not [note for note in road.notes if "unit" in note or "INSUNITS" in note]


@pytest.mark.parametrize(
    ("metres", "options", "said", "hint"),
    [
        (
            1e-3,
            RoadOptions(),
            "in metres its line is 0.2 m long",
            "if these are kilometres, write them in metres",
        ),
        (1.0, RoadOptions(unit="mm"), "with --unit mm the road is 0.2 m long", "are its coordinates as --unit mm says?"),
        (1e3, RoadOptions(unit="m"), "the line is 200 km long", "are its coordinates as --unit m says?"),
        (1e-5, RoadOptions(crs="EPSG:3006"), "the coordinates look like degrees, but EPSG:3006 is not in degrees", "leave it out"),
    ],
)
def test_a_unit_or_a_system_that_makes_no_road_is_named(tmp_path: Path, metres: float, options: RoadOptions, said: str, hint: str) -> None:
    file = tmp_path / "a.csv"
    file.write_text("".join(["x,y\n", *(f"{metres * x:.7g},{metres * 50.0:.7g}\n" for x in range(0, 201, 10))]), encoding="utf-8")
    with pytest.raises(RoadError, match=re.escape(said)) as caught:
        load_road(file, options)
    assert hint in str(caught.value.hint)


def test_a_drawing_far_from_the_origin_is_asked_for_its_unit_too(tmp_path: Path) -> None:
    with pytest.raises(RoadError, match="too far out for a position") as caught:
        load_road(drawing(tmp_path / "a.dxf", "mm", 0), ON_AXIS)
    assert "--unit" in str(caught.value.hint)


def test_edges_that_lie_in_the_line_are_those_of_no_street(tmp_path: Path) -> None:
    long = {"AXIS": 20.0 * LINE[:6], "AXIS ": 20.0 * LINE[5:], "EDGE_LEFT": 20.0 * LINE + 0.5, "EDGE_RIGHT": 20.0 * LINE - 0.5}
    file = drawing(tmp_path / "a.dxf", "m", INSUNITS["in"], layers=long)
    with pytest.raises(RoadError, match=r"in these its edges are within 0\.25 m of its line"):
        load_road(file, ON_AXIS)


def test_the_system_that_is_given_says_the_unit(tmp_path: Path) -> None:
    road = load_road(drawing(tmp_path / "a.dxf", "m", 4), RoadOptions(layer="AXIS", crs="EPSG:3006"))
    assert road.path.length == pytest.approx(load_road(drawing(tmp_path / "b.dxf", "m"), ON_AXIS).path.length, abs=ROUNDED_M)
    assert "a.dxf says millimetres (INSUNITS 4); its coordinates are read as those of EPSG:3006" in road.notes


FEET = "x_ft,y_ft,left_ft,right_ft\n0,0,10,12\n500,0,10,12\n"


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        (FEET, None),
        (FEET.replace("left_ft,right_ft", "left,right"), None),  # in the unit of the positions
        (FEET.replace("_ft", " [ft]"), None),
        (FEET.replace("_ft", " (feet)"), None),
        (FEET.replace("_ft", ""), "ft"),
        ("x,y,left_m,right_m\n0,0,3.048,3.6576\n500,0,3.048,3.6576\n", "ft"),
        ("x_cm;y_cm;left_in;right_in\n0;0;120;144\n15240;0;120;144\n", None),
    ],
)
def test_tables_may_be_in_feet_and_other_units(text: str, unit: str | None) -> None:
    raw = read_csv(text, "f", RoadOptions(unit=unit))
    np.testing.assert_allclose(raw.points, [[0.0, 0.0], [152.4, 0.0]], rtol=1e-15)  # a product's rounding
    assert raw.reaches is not None
    np.testing.assert_allclose(raw.reaches[:, 1], [3.048, 3.6576] * 2, rtol=1e-15)
    assert not raw.notes


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("s,kappa,left,right\n0,0.003048,10,12\n500,0,10,12\n", "ft"),
        ("s_ft,kappa,left,right\n0,0.003048,10,12\n500,0,10,12\n", None),
        ("s [ft],kappa [1/m],left,right\n0,0.01,10,12\n500,0,10,12\n", None),
        ("s,kappa [1/m],left_m,right_m\n0,0.01,3.048,3.6576\n500,0,3.048,3.6576\n", "ft"),
        ("s_m,kappa [1/ft],left,right\n0,0.003048,3.048,3.6576\n152.4,0,3.048,3.6576\n", None),
    ],
)
def test_profiles_may_be_in_feet_and_curvatures_per_foot(text: str, unit: str | None) -> None:
    raw = read_csv(text, "f", RoadOptions(unit=unit))
    assert raw.is_profile
    np.testing.assert_allclose(raw.points, [[0.0, 0.01], [152.4, 0.0]], rtol=1e-15)  # as above
    assert raw.reaches is not None
    np.testing.assert_allclose(raw.reaches[:, 1], [3.048, 3.6576] * 2, rtol=1e-15)


@pytest.mark.parametrize(
    "text", ["x_m,y_m\n0,0\n40000,0\n80000,0\n", "x,y,left,right\n0,0,0,6\n50,0,0,6\n", "x,y,left,right\n0,0,3,1000\n50,0,3,1000\n"]
)
def test_tables_that_say_metres_or_may_be_streets_are_read_as_they_are(text: str) -> None:
    assert read_csv(text, "f").points[-1, 0] in {50.0, 80000.0}


@pytest.mark.parametrize(
    ("name", "content", "crs", "said"),
    [
        ("a.csv", "lon,lat\n11,57\n11.01,57\n", None, "a.csv: positions in degrees has no use"),
        ("a.csv", "x,y\n11.97,57.70\n11.971,57.701\n11.972,57.702\n", None, "a.csv: positions in degrees has no use"),
        ("a.csv", FEET, None, "a.csv: a table that says its unit, as x_ft, y_ft, has no use"),
        ("a.csv", "s_ft,kappa\n0,0\n50,0\n", None, "a.csv: a table that says its unit, as s_ft, kappa, has no use"),
        ("a.csv", "x,y\n0,0\n50,0\n", "EPSG:3006", "a.csv: a file in EPSG:3006 has no use"),
        ("a.csv", 'wkt\n"LINESTRING (11.97 57.7, 11.971 57.701)"\n', None, "a.csv: a line in degrees has no use"),
        ("a.geojson", '{"type": "LineString", "coordinates": [[11, 57], [11.1, 57]]}', None, "a.geojson: a GeoJSON file, .* has no use"),
        ("a.json", '{"elements": []}', None, "a.json: a file of OpenStreetMap has no use"),
        ("a.xodr", "<OpenDRIVE/>", None, "a.xodr: an OpenDRIVE file has no use"),
        ("uturn", None, None, "the scenario uturn has no use"),
    ],
)
def test_a_unit_is_refused_where_it_says_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, content: str | None, crs: str | None, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    if content is not None:
        Path(name).write_text(content, encoding="utf-8")
    with pytest.raises(RoadError, match=said + " for --unit\n") as caught:
        load_road(name, RoadOptions(unit="ft", crs=crs))
    assert caught.value.hint == "leave --unit out"


def test_feet_have_no_place_in_a_system_in_metres_and_units_have_names() -> None:
    with pytest.raises(RoadError, match="columns x_ft, y_ft have a unit of their own, and EPSG:3006 has its"):
        read_csv(FEET, "f", RoadOptions(crs="EPSG:3006"))
    with pytest.raises(OptionError, match="unit must be mm, cm, m, ft or in, not 'km'"):
        RoadOptions(unit="km")


def test_layers_that_are_not_read_are_noted_with_the_role_that_would_read_them(tmp_path: Path) -> None:
    file = drawing(tmp_path / "site.dxf", "m", layers={"KERB_OLD": beside(3.0), "TREES": beside(6.0)})
    listed = "NOT READ: layers 'KERB_OLD' (1 entity), 'TREES' (1 entity)"
    nearer = "'KERB_OLD' lies nearer the line, 3.0 m, than all that is read, 4.0 m"
    note = f'site.dxf: {listed}; {nearer}; --role "KERB_OLD=edge" or =obstacle or =sweepable reads one'
    assert load_road(file, ON_AXIS).notes == (note,)
    behind, note = load_road(file, RoadOptions(layer="AXIS", roles=("KERB_OLD=edge",))).notes
    assert behind == "site.dxf: 1 edge left out where behind others"
    assert note.startswith("site.dxf: NOT READ: layer 'TREES' (1 entity); --role")
    many = {f"LAYER_{i}": beside(5.0 + i) for i in range(40)}
    (note,) = load_road(drawing(tmp_path / "many.dxf", "m", layers=many), ON_AXIS).notes
    assert "'LAYER_7' (1 entity) and 32 more; --role" in note
