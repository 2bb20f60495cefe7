"""Cells on roads that are planned piece by piece: the same row as of a plan of the whole road."""

from __future__ import annotations

import json
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
from hdvplan.study.cells import SUMMARY, taken
from hdvplan.study.conduct import Results, run
from hdvplan.study.pools import outcome_of
from hdvplan.study.spec import study_of
from hdvplan.study.work import places_of
from tests.study.conftest import InHere

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
