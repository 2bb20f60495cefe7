"""Obstacles, kerbs, lanes and the fit check, from the command line."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from hdvplan.errors import RoadError
from hdvplan.road.load import load_road
from tests.cli.conftest import Cli
from tests.road.drives import area_feature, line_feature, written

QUICK = ("--vehicle", "bus", "--horizon", "40", "--no-plot")
ONCE = (*QUICK, "--no-proof", "--no-refine")  # where it does not matter what else is looked for after a NO


def row(file: Path, s: float) -> dict[str, float]:
    table = pd.read_csv(file)
    return {str(name): float(value) for name, value in table[table["s"] == s].iloc[0].items()}


def test_a_passage_too_narrow_is_said_and_planned_all_the_same(cli: Cli, tmp_path: Path) -> None:
    outcome = cli("plan", "parked_van_tight", *QUICK)
    assert outcome.code == 1
    expected = "warning: too narrow for the bus from s = 78.0 to 83.5 m: limits are 2.39 m apart, needs 2.54 m"
    assert expected in outcome.err.splitlines()
    summary = json.loads((tmp_path / "parked_van_tight.bus" / "summary.json").read_text(encoding="utf-8"))
    (finding,) = summary["fit"]
    assert (finding["trouble"], round(finding["needed"] - finding["available"], 2)) == ("width", 0.15)
    assert summary["obstacles"][0]["name"] == "parked van"
    proof = summary["verdict"]["proof"]
    assert (proof["kind"], proof["unit"]) == ("place", "bus")
    assert 78.0 - 9.34 < proof["s_from_m"] == proof["s_to_m"] < 83.5 + 2.66  # of the rear axle, while the bus is beside the van
    assert summary["limit_violation_m"] > 0.05  # at best, half of the missing 0.15 m on either side
    features = json.loads((tmp_path / "parked_van_tight.bus" / "swept.geojson").read_text(encoding="utf-8"))["features"]
    (van,) = (feature for feature in features if feature["properties"]["kind"] == "region")
    assert (van["properties"]["region"], van["properties"]["name"]) == ("obstacle", "parked van")
    lon, lat = van["geometry"]["coordinates"][0][0]
    assert (round(lon, 2), round(lat, 2)) == (15.0, 60.0)


@pytest.mark.parametrize("command", ["plan {} --vehicle bus --no-plot", "need {} --vehicle bus --no-plot --no-proof", "roads info {}"])
def test_a_region_too_far_away_to_count_is_said_and_one_that_is_somewhere_else_refused(cli: Cli, tmp_path: Path, command: str) -> None:
    road = {
        "type": "Feature",
        "properties": {"width_m": 9.0},
        "geometry": {"type": "LineString", "coordinates": [[12.0, 57.0], [12.002, 57.0]]},
    }
    for name, (x, y) in {"far": (12.0, 57.001), "swapped": (57.0, 12.0)}.items():
        corners = [[x, y], [x + 1e-4, y], [x + 1e-4, y + 1e-4], [x, y]]
        van = {"type": "Feature", "properties": {"region": "obstacle"}, "geometry": {"type": "Polygon", "coordinates": [corners]}}
        (tmp_path / f"{name}.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [road, van]}), encoding="utf-8")
    far, swapped = (cli(*command.format(f"{name}.geojson").split(), "--json") for name in ("far", "swapped"))
    assert far.code == 0
    assert far.err.startswith("warning: 1 of 1 regions lie further than 20 m from the road and do not count, the nearest of them 111 m")
    if command.startswith("roads"):
        assert json.loads(far.out)["regions"][0]["distance_m"] == pytest.approx(111.0, abs=1.0)  # a thousandth of a degree
    assert swapped.code == 2
    assert re.match(r"error: the 1 regions lie \d{4} km from the road, or further\nhint: are their coordinates swapped", swapped.err)
    assert len(load_road(tmp_path / "far.geojson").regions) == 1
    with pytest.raises(RoadError, match="regions lie"):
        load_road(tmp_path / "swapped.geojson")


@pytest.mark.parametrize("x", [-30.0, 78.0])
def test_an_obstacle_hit_before_the_start_or_beyond_the_end_of_the_road_is_an_error(cli: Cli, tmp_path: Path, x: float) -> None:
    rings = [[[x, y], [x + 4.0, y], [x + 4.0, y + 3.5], [x, y + 3.5], [x, y]] for y in (1.0, -4.5)]  # 2 m between them, 2.54 m needed
    line = {"type": "LineString", "coordinates": [[-25.0, 0.0], [75.0, 0.0]]}
    features = [{"type": "Feature", "properties": {"width_m": 9.0}, "geometry": line}]
    for ring in rings:
        geometry = {"type": "Polygon", "coordinates": [ring]}
        features.append({"type": "Feature", "properties": {"region": "obstacle", "name": "wall"}, "geometry": geometry})
    (tmp_path / "ends.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8")
    outcome = cli("plan", "ends.geojson", *ONCE, "--crs", "EPSG:3006", "--quiet")
    assert outcome.code == 1
    # 1.27 m to the side, less 1 m, all along the wall: rounding says where. The bus reaches 2.66 m back, 9.34 m ahead.
    # The place may lie at any part that was inside: on a straight none is deeper than another.
    first, last = (-2.66, -1.0) if x < 0.0 else (103.0, 107.0)
    found = re.match(r"error: the .+ of the bus enters the obstacle 'wall' by 0\.27. m at s = (.+) m\n", outcome.err)
    assert found
    assert first <= float(found[1]) <= last
    summary = json.loads((tmp_path / "ends.bus" / "summary.json").read_text(encoding="utf-8"))
    assert (summary["status"], summary["breaches"]) == ("obstacle entered", [])


def test_a_station_that_no_axle_has_reached_is_no_reason_to_warn(cli: Cli) -> None:
    # Its rear axle starts at s = 0 but for rounding, and the wheels have limits of their own there.
    outcome = cli("plan", "street_corner", "--reverse", "--vehicle", "bus", "--horizon", "40", "--quiet")  # with its picture
    assert (outcome.code, outcome.err) == (0, "")


def test_quiet_warns_of_nothing_and_a_fitting_vehicle_neither(cli: Cli) -> None:
    assert "warning" not in cli("plan", "parked_van_tight", *ONCE, "--quiet").err
    assert "warning" not in cli("plan", "parked_van", *ONCE).err


def test_widths_from_options_replace_the_file_s_and_obstacles_still_cut(cli: Cli, tmp_path: Path) -> None:
    assert cli("plan", "parked_van_tight", *ONCE, "--left", "3.6", "--right", "2").code in {0, 1}
    file = tmp_path / "parked_van_tight.bus" / "envelope.csv"
    assert (row(file, 40.0)["left_limit"], row(file, 40.0)["right_limit"]) == pytest.approx((3.6, -2.0), abs=1e-4)  # the file's digits
    assert row(file, 80.0)["right_limit"] == pytest.approx(0.5, abs=1e-3)  # the file's digits
    assert row(file, 80.0)["needed_width"] == pytest.approx(2.54, abs=1e-3)  # straight but for rounding


def test_a_plan_is_made_beside_the_line_and_the_other_way(cli: Cli, tmp_path: Path) -> None:
    assert cli("plan", "parked_van", *ONCE, "--reverse", "--offset", "0.2").code in {0, 1}
    file = tmp_path / "parked_van.bus" / "envelope.csv"
    # going back, left is the van's side: 3.0 m - 0.2 m; its 0.5 m over the centre are to the right of the reference now
    assert row(file, 40.0)["left_limit"] == pytest.approx(2.8, abs=1e-3)
    assert row(file, 80.0)["left_limit"] == pytest.approx(-0.7, abs=1e-3)
    assert row(file, 80.0)["right_limit"] == pytest.approx(-3.39, abs=1e-3)
    assert cli("plan", "parked_van", *QUICK, "--offset", "5").err.startswith("error: an offset of 5 m lies beyond the road's own")
    assert cli("plan", "uturn", *QUICK, "--offset", "nan").code == 2


def test_info_lists_the_places_to_plan_and_says_neither_yes_nor_no(cli: Cli) -> None:
    outcome = cli("roads", "info", "kerb_bend_wall")
    assert (outcome.code, outcome.err) == (0, "")
    assert "1 narrow" in outcome.out
    assert "places to plan, by circles as tight as the road" in outcome.out
    assert not re.search(r"\b(yes|no:|fits?)\b", outcome.out, flags=re.IGNORECASE)  # a plan may say otherwise
    assert max(len(line) for line in outcome.out.splitlines()) <= 80
    vehicles = json.loads(cli("roads", "info", "kerb_bend", "--json").out)["vehicles"]
    bus = next(vehicle for vehicle in vehicles if vehicle["vehicle"] == "bus")
    assert (bus["fits"], bus["findings"]) == (True, [])
    assert re.search(r"\bbus .* none\b", cli("roads", "info", "kerb_bend").out)


def test_info_writes_the_needed_widths_as_csv(cli: Cli, tmp_path: Path) -> None:
    assert cli("roads", "info", "uturn", "--half-width", "3.5", "--csv", "needs.csv").code == 0
    table = pd.read_csv(tmp_path / "needs.csv")
    assert table["needed_width_bus"].max() == pytest.approx(2.0 * 2.486, abs=2e-3)  # the published expectation's digits
    assert (table["left"] == 3.5).all()
    assert cli("roads", "info", "uturn", "--csv", "no/such/folder.csv").code == 2


def obstacles_on_a_road(tmp_path: Path, *given: str | None) -> str:
    """Write a straight road with obstacles on its line, 15 m apart: changing sides between them is too much for a bus."""
    places = ((97.0, 100.0, -1.5, 1.4), (115.0, 118.0, -1.4, 1.5))
    features = [line_feature(np.array([(0.0, 0.0), (200.0, 0.0)]), width_m=9.2)]
    for number, (x_from, x_to, low, high) in enumerate(places):
        side = {"pass": given[number]} if number < len(given) and given[number] else {}
        corners = [(x_from, low), (x_to, low), (x_to, high), (x_from, high)]
        features.append(area_feature(corners, region="obstacle", name=f"o{number}", **side))
    return written(tmp_path, *features, name="stagger.geojson").name


def test_the_sides_of_obstacles_are_found_and_told_with_what_the_others_would_have_cost(cli: Cli, tmp_path: Path) -> None:
    road = obstacles_on_a_road(tmp_path)
    outcome = cli("plan", road, *QUICK, "--json", "--quiet")
    assert (outcome.code, outcome.err) == (0, "")
    summary = json.loads(outcome.out)
    first, second = summary["passed"]
    assert (first["name"], second["name"]) == ("o0", "o1")
    assert first["side"] == second["side"]
    for passed in (first, second):
        assert passed["forced"] is False
        assert passed["clearance_m"] > -0.01
        assert passed["other_violation_m"] == pytest.approx(-passed["other_clearance_m"])
        assert passed["other_violation_m"] > 0.2
    assert first["s_m"] == pytest.approx(98.5, abs=0.1)
    assert summary["verdict"]["fits"] is True


def test_a_side_without_room_or_of_no_such_name_is_bad_input(cli: Cli, tmp_path: Path) -> None:
    road = obstacles_on_a_road(tmp_path)
    narrow = cli("plan", road, *QUICK, "--pass", "left", "--left", "3.5", "--right", "4.6")
    assert narrow.code == 2
    assert narrow.err.splitlines()[-2:] == [
        "error: the obstacle 'o0' at s = 98.5 m cannot be passed on the left: 2.10 m to the left of it, 2.54 m needed, 0.44 m missing",
        "hint: give no side, to pass it where there is more room",
    ]
    assert cli("plan", road, *QUICK, "--pass", "both").code == 2
    wrong = cli("plan", obstacles_on_a_road(tmp_path, "up"), "--crs", "EPSG:3006", *QUICK)
    assert (wrong.code, "region 'o0' has pass = 'up'" in wrong.err) == (2, True)


@pytest.mark.slow
def test_a_side_that_nothing_takes_is_a_warning(cli: Cli, tmp_path: Path) -> None:
    said = "warning: --pass left has no effect: no obstacle lies on the line, or each has a side of its own"
    for given, told in ((("right", "right"), True), (("right",), False)):
        outcome = cli("plan", obstacles_on_a_road(tmp_path, *given), "--crs", "EPSG:3006", *QUICK, "--pass", "left")
        assert (said in outcome.err.splitlines()) is told
    assert said in cli("plan", "uturn", *QUICK, "--pass", "left").err.splitlines()


@pytest.mark.parametrize(
    ("given", "options", "width", "side"),
    [(None, (), 12.0, None), ("right", (), 12.0, "right"), (None, ("--pass", "left"), 12.0, "left"), ("right", (), None, "right")],
)
def test_wheels_pass_an_island_on_the_line_on_the_side_that_is_told(
    cli: Cli, tmp_path: Path, given: str | None, options: tuple[str, ...], width: float | None, side: str | None
) -> None:
    line = line_feature(np.array([(0.0, 0.0), (120.0, 0.0)]), **({} if width is None else {"width_m": width}))
    told = {} if given is None else {"pass": given}
    island = area_feature([(58.0, -0.8), (64.0, -0.8), (64.0, 0.8), (58.0, 0.8)], region="sweepable", name="refuge", **told)
    written(tmp_path, line, island, name="island.geojson")
    outcome = cli("plan", "island.geojson", *QUICK, "--json", "--quiet", *options)
    assert outcome.code == 0
    summary = json.loads(outcome.out)
    (passed,) = summary["passed"]
    assert (passed["name"], passed["forced"]) == ("refuge", side is not None)
    assert passed["side"] == side or side is None
    assert summary["verdict"]["fits"] is True
    assert (summary["verdict"]["region"], abs(summary["verdict"]["spare_m"]) < 0.01) == ("drivable", True)  # wheels run along its edge


def test_the_middle_between_limits_is_that_of_the_sides_found(cli: Cli, tmp_path: Path) -> None:
    road = obstacles_on_a_road(tmp_path)
    outcome = cli("plan", road, *QUICK, "--json", "--quiet", "--bias", "centre")
    summary = json.loads(outcome.out)
    assert outcome.code == 0
    (side,) = {passed["side"] for passed in summary["passed"]}
    assert np.sign(summary["mean_bias_m"]) == (1.0 if side == "left" else -1.0)
