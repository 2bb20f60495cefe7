"""Cells: a key for each content, and the same row of a road that is planned piece by piece as of a plan of the whole."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shapely

import hdvplan
from hdvplan.api import drive_case
from hdvplan.case import Case
from hdvplan.driving.drive import Drive
from hdvplan.errors import PlanError
from hdvplan.report.summary import summary_of
from hdvplan.road.options import RoadOptions
from hdvplan.study.cells import SUMMARY, cells_of, taken
from hdvplan.study.conduct import Results, run
from hdvplan.study.inputs import road_digest
from hdvplan.study.pools import outcome_of
from hdvplan.study.spec import study_of
from hdvplan.study.work import places_of
from tests.study.conftest import InHere
from tests.study.test_spec import OBJECTIVE

Entries = dict[str, object]
EXACT = ("fits", "side", "unit", "part", "region", "plans", "breaches", "step_m")
MILLIMETRE = ("spare_m", "x", "y", "verdict_half_width_m", "max_left_m", "max_right_m", "needed_half_width_m", "min_clearance_m")
SHORT = {"horizon": 30, "step": 1, "replan": 10}  # sees little, and is quick


def wave(length: float) -> str:
    """Return a wavy road near Vaduz, 3 m to either side, with two narrow places: at 2 km, and 1 km before its end."""
    x = np.arange(0.0, length, 25.0)
    lon, lat = 9.3 + x / 75_900.0, 47.14 + 10.0 * np.sin(x / 100.0) / 111_200.0
    reach = np.where((np.abs(x - 2000.0) < 40.0) | (np.abs(x - length + 1000.0) < 40.0), 1.0, 3.0).tolist()
    line = {"type": "LineString", "coordinates": np.column_stack([lon, lat]).tolist()}
    return json.dumps({"type": "Feature", "properties": {"left_m": reach, "right_m": reach}, "geometry": line})


@pytest.fixture
def long_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with a road of 8 km, which is planned in two pieces."""
    monkeypatch.setattr("hdvplan.road.line.LONG_M", 1000.0)
    (folder / "wave.geojson").write_text(wave(8000.0), encoding="utf-8")
    return folder


def _run(folder: Path, entries: Entries) -> Results:
    engine = InHere(instead=outcome_of)  # what is patched here is in no key
    return run(study_of({"roads": ["wave.geojson"]} | entries, folder), folder / "out", engine)


@pytest.mark.slow
def test_a_cell_on_a_long_road_tells_what_a_plan_of_the_whole_road_tells(long_folder: Path) -> None:
    results = _run(long_folder, {"vehicles": ["P"], "settings": SHORT})
    (row,) = results.cells().to_dict("records")
    vehicle = hdvplan.load_vehicle("P")
    road = hdvplan.load_road(long_folder / "wave.geojson", RoadOptions().followed_by(vehicle.max_curvature))
    whole = hdvplan.plan(hdvplan.Case(road, vehicle, settings=hdvplan.PlannerSettings(horizon=30.0, step=1.0, replan=10.0)))
    assert (row["outcome"], row["stretches"]) == ("planned", 2)
    told = taken(summary_of(whole), SUMMARY)
    for name in EXACT:
        assert row[name] == told[name], name
    for name in MILLIMETRE:
        assert row[name] == pytest.approx(told[name], abs=1e-3), name  # as above
    breaches = results.places().query("kind == 'breach'")
    assert len(breaches) == row["breaches"] > 1
    assert breaches["depth_m"].tolist() == pytest.approx([breach.depth for breach in whole.balance.breaches], abs=1e-3)  # as above
    assert breaches["s_to_m"].tolist() == pytest.approx([breach.s_to for breach in whole.balance.breaches], abs=0.01)  # lines 1 mm apart
    line = shapely.from_wkb(row["geometry"])
    assert line.distance(shapely.points(row["lon"], row["lat"])) < 1e-4  # degrees: 10 m


def test_where_a_piece_has_no_plan_the_cell_has_the_place_on_the_whole_road(long_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def ends(case: Case, *, after: Drive | None = None) -> Drive:
        if after is None:
            return drive_case(case)
        msg = "no further"
        raise PlanError(msg, s_m=6000.0 - after.road.path.length)

    monkeypatch.setattr("hdvplan.pieces.drive_case", ends)
    results = _run(long_folder, {"vehicles": ["P"], "settings": SHORT})
    (row,), (place,) = results.cells().to_dict("records"), results.places().to_dict("records")
    assert (row["outcome"], row["s_m"]) == ("no plan", 6000.0)
    assert row["reason"].startswith("no further; this s counts from 4000 m")
    assert not row["fits"]
    assert (place["kind"], place["s_m"]) == ("no plan", 6000.0)
    assert place["lon"] == pytest.approx(9.3 + 6000.0 / 75_900.0, abs=2e-3)  # waves are longer than their chord


@pytest.mark.parametrize(("setting", "value"), [("bias", "centre"), ("clearance", "max")])
def test_what_needs_the_whole_road_is_refused_on_long_roads(long_folder: Path, setting: str, value: str) -> None:
    (row,) = _run(long_folder, {"vehicles": ["bus"], "half_widths": [3.5], "settings": {setting: value}}).cells().to_dict("records")
    assert row["outcome"] == "refused"
    assert row["reason"].startswith(f"{setting} {value} is not for roads of more than")


def test_of_obstacles_those_that_are_entered_beyond_the_road_s_ends_are_places() -> None:
    told = {"s_m": -4.0, "s_from_m": -5.0, "s_to_m": -3.0, "x": 1.0, "y": 2.0, "unit": "bus", "side": "left", "part": "rear corner"}
    post = told | {"name": "a post", "distance_m": -0.2}
    obstacles = [post, post | {"s_m": 102.0}, post | {"distance_m": 0.3}]  # what is entered beside the road is among its breaches
    verdict = dict.fromkeys(("s_m", "x", "y", "lon", "lat", "spare_m", "side", "unit", "part", "region", "obstacle"))
    summary = {"verdict": verdict, "breaches": [], "obstacles": obstacles, "length_m": 200.0}
    _, place = places_of(summary, hdvplan.load_road("uturn"))
    assert (place["kind"], place["obstacle"], place["depth_m"], place["s_from_m"]) == ("breach", "a post", 0.2, -5.0)


BASE: dict[str, object] = {"roads": ["bend.csv"], "vehicles": ["bus"], "half_widths": [3.5]}


def _key(folder: Path, entries: dict[str, object]) -> str:
    (cell,) = cells_of(study_of(entries, folder))
    return cell.key


SETTINGS = {"horizon": 30, "reverse": True, "offset": 0.5, "smooth": 1.0, "corners": "sharp", "unit": "ft", "proof": True, "refine": False}
CHANGES: list[tuple[str, object]] = [
    *(("settings", {name: value}) for name, value in SETTINGS.items()),
    *(("half_widths", [3.6]), ("schemes", ["sqp"]), ("solvers", ["piqp"]), ("objectives", ["lead-axle"]), ("need", True)),
    *(("vary", {"bus.wheelbase": [5.5]}), ("roads", ["lane.geojson"])),
]


@pytest.mark.parametrize(("name", "value"), CHANGES)
def test_whatever_changes_a_row_changes_its_key(folder: Path, name: str, value: object) -> None:
    assert _key(folder, BASE | {name: value}) != _key(folder, BASE)


def test_a_file_that_changes_changes_its_key_and_one_that_moves_does_not(folder: Path) -> None:
    before = _key(folder, BASE)
    (folder / "elsewhere").mkdir()
    moved = (folder / "bend.csv").rename(folder / "elsewhere" / "bend.csv")
    assert _key(folder, BASE | {"roads": ["elsewhere/bend.csv"]}) == before
    moved.write_text(moved.read_text(encoding="utf-8") + "70,0\n", encoding="utf-8")
    assert _key(folder, BASE | {"roads": ["elsewhere/bend.csv"]}) != before


def test_a_file_of_one_s_own_code_counts_with_its_content(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    (folder / "mine.py").write_text(OBJECTIVE, encoding="utf-8")
    before = _key(folder, BASE | {"objectives": ["mine.py:mine"]})
    assert before == _key(folder, BASE | {"objectives": ["mine.py:mine"]})
    (folder / "mine.py").write_text(OBJECTIVE + "# changed\n", encoding="utf-8")
    assert before != _key(folder, BASE | {"objectives": ["mine.py:mine"]})


def test_a_study_keeps_its_keys_while_its_files_change(folder: Path) -> None:
    (folder / "mine.py").write_text(OBJECTIVE, encoding="utf-8")
    study = study_of(BASE | {"objectives": ["mine.py:mine"]}, folder)
    before = [cell.key for cell in cells_of(study)]
    (folder / "mine.py").write_text(OBJECTIVE + "# changed\n", encoding="utf-8")
    assert [cell.key for cell in cells_of(study)] == before


def test_a_key_is_the_same_in_every_process(folder: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from hdvplan.study.cells import cells_of; from hdvplan.study.spec import study_of; "
        f"print(next(cells_of(study_of({BASE!r}, Path(sys.argv[1])))).key)"
    )
    other = subprocess.run([sys.executable, "-c", code, str(folder)], capture_output=True, text=True, check=True)  # noqa: S603 - our own
    assert other.stdout.strip() == _key(folder, BASE)


@pytest.mark.parametrize(
    ("name", "part"), [("line.shp", "line.dbf"), ("line[1].shp", "line[1].dbf"), ("line.TAB", "line.MAP"), ("line.mif", "line.mid")]
)
def test_the_parts_of_a_road_in_several_files_count_together(tmp_path: Path, name: str, part: str) -> None:
    for file in (name, part):
        (tmp_path / file).write_bytes(b"1")
    before = road_digest(str(tmp_path / name))
    (tmp_path / part).write_bytes(b"2")
    assert road_digest(str(tmp_path / name)) != before


def test_obstacles_are_counted_that_are_passed_on_the_other_side_than_the_line_passes_them() -> None:
    row = taken({"passed": [{"crossed": True}, {"crossed": False}, {"crossed": True}], "breaches": [{}]}, SUMMARY)
    assert (row["crossed_sides"], row["breaches"], row["corners"]) == (2, 1, None)
