"""Parts of routes as road files, and ``hdvplan roads extract`` as a user calls it."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hdvplan.answers import NEEDS
from hdvplan.errors import OptionError
from hdvplan.network.osm import Member, Relation, Way
from hdvplan.network.roads import Position, RouteRoad, Widths, road_of_part
from hdvplan.road.load import load_road
from tests.cli.conftest import Cli
from tests.network.town import PLACES, parts_of, way, write_map

ROUTE = Relation(77, {"type": "route", "route": "bus", "ref": "11", "name": "Bus 11: A => B", "from": "A", "to": "B"})


def road(*ways: Way) -> RouteRoad:
    (part,), _ = parts_of(*ways)
    return road_of_part(ROUTE, part, Position(), PLACES, Widths(), "town.osm")


def properties(made: RouteRoad) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(made.content())["properties"]
    return found


@pytest.mark.parametrize(
    ("tags", "half", "source"),
    [
        ({"width": "6,5 m"}, 3.25, "width"),
        ({"width": "20'"}, 3.048, "width"),
        ({"width": "7", "lanes": "3"}, 3.5, "width"),
        ({"width": "wide", "lanes": "2"}, 3.25, "lanes"),
        ({"width": "0.5", "lanes": "2"}, 3.25, "lanes"),
        ({"lanes": "1.5"}, 2.4375, "lanes"),
        ({"lanes": "0"}, None, ""),
        ({}, None, ""),
    ],
)
def test_half_a_width_is_that_of_the_tag_or_that_of_the_lanes(tags: dict[str, str], half: float | None, source: str) -> None:
    found, told = Widths().half_of(tags)
    assert told == source
    assert found == (half if half is None else pytest.approx(half, abs=1e-9))  # rounding


def test_options_say_how_wide_lanes_and_untagged_ways_are() -> None:
    assert Widths(lane=3.0).half_of({"lanes": "2"}) == (3.0, "lanes")
    assert Widths(half_width=2.8).half_of({}) == (2.8, "option")
    for wrong in (0.0, -1.0, float("nan"), 100.0):
        with pytest.raises(OptionError, match="must be a positive number of metres"):
            Widths(lane=wrong)


def test_a_road_file_tells_its_route_and_what_the_map_says_along_it() -> None:
    told = properties(road(way(1, 101, 102, highway="primary", lanes="2", maxspeed="50"), way(2, 102, 103, surface="asphalt")))
    assert {key: told[key] for key in ("relation", "ref", "name", "from", "to", "part", "parts")} == {
        "relation": 77, "ref": "11", "name": "Bus 11: A => B", "from": "A", "to": "B", "part": 1, "parts": 1,
    }  # fmt: skip
    first, second = told["stretches"]
    assert [first[name] for name in ("way", "highway", "maxspeed", "half_width_from")] == [1, "primary", "50", "lanes"]
    assert (second["way"], second["surface"], second["half_width_m"], second["half_width_from"]) == (2, "asphalt", None, "")
    assert first["s_from_m"] == 0.0
    assert first["s_to_m"] == second["s_from_m"]
    assert second["s_to_m"] == told["length_m"]


def test_without_a_width_somewhere_a_road_has_no_limits() -> None:
    made = road(way(1, 101, 102, width="6"), way(2, 102, 103))
    assert "left_m" not in properties(made)
    assert made.with_limits == pytest.approx(0.5 * made.length, abs=0.01)  # both ways are as long


def test_limits_change_where_the_ways_do(tmp_path: Path) -> None:
    made = road(way(1, 101, 102, 103, width="6"), way(2, 103, 104, lanes="2"), way(3, 104, 105, 106, width="6.5"))
    (tmp_path / made.file).write_bytes(made.content())
    loaded = load_road(tmp_path / made.file)
    assert loaded.limits is not None
    at = made.length * np.array([0.1, 0.39, 0.41, 0.9])  # the widths change at two fifths
    np.testing.assert_allclose(loaded.limits.table(at)[:2], [[3.0, 3.0, 3.25, 3.25], [-3.0, -3.0, -3.25, -3.25]], atol=1e-9)  # as given
    assert properties(made)["left_m"] == [3.0, 3.0, 3.0, 3.25, 3.25, 3.25, 3.25]


def test_the_attribution_that_the_licence_asks_for_travels_with_the_road(tmp_path: Path) -> None:
    made = road(way(1, 101, 102))
    (tmp_path / made.file).write_bytes(made.content())
    assert load_road(tmp_path / made.file).notice == "© OpenStreetMap contributors, ODbL 1.0"


@pytest.mark.parametrize(
    ("ref", "at", "name"),
    [
        ("11", Position(), "bus-11-77.geojson"),
        ("11", Position(2, 3, back=True), "bus-11-77-back-2.geojson"),
        ("", Position(back=True), "bus-77-back.geojson"),
        ("../../etc/x", Position(), "bus-etc_x-77.geojson"),
        ("a b/ü" + 60 * "x", Position(), "bus-a_b_ü" + 35 * "x" + "-77.geojson"),
    ],
)
def test_files_are_named_by_kind_ref_and_relation(ref: str, at: Position, name: str) -> None:
    (part,), _ = parts_of(way(1, 101, 102))
    relation = Relation(77, {"route": "bus", "ref": ref})
    assert road_of_part(relation, part, at, PLACES, Widths(), "m").file == name


def test_the_way_back_ends_where_the_route_begins() -> None:
    (part,), _ = parts_of(way(1, 101, 102))
    told = properties(road_of_part(ROUTE, part, Position(back=True), PLACES, Widths(), "m"))
    assert (told["from"], told["to"], told["direction"]) == ("B", "A", "back")


FILES = Path(__file__).parent / "files"
WAYS = (way(1, 101, 102, lanes="2"), way(2, 102, 103, lanes="2"), way(3, 104, 105, lanes="2"))


def town(path: Path) -> Path:
    tags = {"type": "route", "route": "bus", "ref": "11", "name": "=A to B"}
    whole = Relation(1, tags, (Member("w", 1), Member("w", 2)))
    gap = Relation(2, tags, (Member("w", 1), Member("w", 2), Member("w", 3)))
    return write_map(path, WAYS, [whole, gap])


def test_a_map_becomes_a_folder_of_roads_with_a_report(cli: Cli, tmp_path: Path) -> None:
    outcome = cli("roads", "extract", str(town(tmp_path / "town.osm")), "--out", "roads")
    assert outcome.code == 0
    assert "1 of 2 whole" in outcome.out
    assert outcome.out.split("────\n")[1].splitlines()[:2] == [
        "        1    11   =A to B       1      0.2", "        2    11   =A to B       2      0.2      1"
    ]  # fmt: skip
    assert "warning: relation 2 (ref 11): way 3 follows way 2 and does not meet it: a gap of 76 m" in outcome.err
    folder = tmp_path / "roads"
    assert sorted(file.name for file in folder.iterdir()) == [
        "bus-11-1.geojson", "bus-11-2-1.geojson", "bus-11-2-2.geojson", "extract.json", "report.csv",
    ]  # fmt: skip
    rows = list(csv.DictReader((folder / "report.csv").read_text(encoding="utf-8").splitlines()))
    assert [(row["relation"], row["whole"], row["roads"], row["gaps"]) for row in rows] == [("1", "yes", "1", "0"), ("2", "no", "2", "1")]
    assert rows[0]["name"] == "'=A to B"  # no formula in a spreadsheet


def test_json_is_the_record_and_nothing_else(cli: Cli, tmp_path: Path) -> None:
    outcome = cli("roads", "extract", str(town(tmp_path / "town.osm")), "--json", "--quiet")
    assert (outcome.code, outcome.err) == (0, "")
    told = json.loads(outcome.out)
    assert [route["whole"] for route in told["hdvplan_routes"]] == [True, False]
    assert told == json.loads((tmp_path / "town.bus" / "extract.json").read_text(encoding="utf-8"))


def test_extracting_again_takes_away_roads_that_are_no_longer_there(cli: Cli, tmp_path: Path) -> None:
    path = town(tmp_path / "town.osm")
    cli("roads", "extract", str(path), "--out", "roads")
    write_map(path, WAYS, [Relation(1, {"type": "route", "route": "bus", "ref": "11"}, (Member("w", 1),))])
    assert cli("roads", "extract", str(path), "--out", "roads").code == 0
    assert [file.name for file in (tmp_path / "roads").glob("*.geojson")] == ["bus-11-1.geojson"]


def test_files_of_others_are_not_replaced(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "roads").mkdir()
    (tmp_path / "roads" / "report.csv").write_text("mine", encoding="utf-8")
    outcome = cli("roads", "extract", str(town(tmp_path / "town.osm")), "--out", "roads")
    assert outcome.code == 2
    assert "holds a file report.csv that hdvplan did not write" in outcome.err


def test_a_record_that_names_files_elsewhere_takes_none_of_them_away(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "roads").mkdir()
    (tmp_path / "mine.geojson").write_text("{}", encoding="utf-8")
    routes = [{"roads": [{"file": "../mine.geojson"}, {"file": 3}]}]
    (tmp_path / "roads" / "extract.json").write_text(json.dumps({"hdvplan_routes": routes}), encoding="utf-8")
    assert cli("roads", "extract", str(town(tmp_path / "town.osm")), "--out", "roads").code == 0
    assert (tmp_path / "mine.geojson").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("missing.osm.pbf",), "error: map missing.osm.pbf cannot be read: No such file or directory"),
        (("town.osm", "--lane-width", "-3"), "error: a lane's width must be a positive number of metres"),
        (("town.osm", "--out", "town.osm"), "error: --out town.osm is a file, not a folder"),
    ],
)
def test_mistakes_are_told_in_one_line(cli: Cli, tmp_path: Path, arguments: tuple[str, ...], said: str) -> None:
    town(tmp_path / "town.osm")
    outcome = cli("roads", "extract", *arguments)
    assert outcome.code == 2
    assert outcome.err.splitlines()[0].startswith(said)


def test_routes_none_of_whose_ways_are_in_the_map_are_refused(cli: Cli, tmp_path: Path) -> None:
    write_map(tmp_path / "m.osm", (), [Relation(1, {"type": "route", "route": "bus"}, (Member("w", 1),))])
    outcome = cli("roads", "extract", "m.osm")
    assert outcome.code == 2
    assert "none of the 1 routes has a way in it" in outcome.err


@pytest.mark.slow
def test_a_bus_drives_a_road_of_a_real_map(cli: Cli, tmp_path: Path) -> None:
    assert cli("roads", "extract", str(FILES / "planken.osm.pbf"), "--out", "roads", "--quiet").code == 0
    road = min((tmp_path / "roads").glob("*.geojson"))
    outcome = cli("plan", str(road), "--vehicle", "bus", "--no-plot", "--out", "plan")
    assert outcome.out.startswith(NEEDS)
    assert (
        json.loads((tmp_path / "plan" / "summary.json").read_text(encoding="utf-8"))["notice"] == "© OpenStreetMap contributors, ODbL 1.0"
    )


@pytest.mark.slow
def test_the_map_that_ships_has_its_sixteen_bus_routes(cli: Cli, tmp_path: Path) -> None:
    outcome = cli("roads", "extract", "liechtenstein", "--json")
    routes = json.loads(outcome.out)["hdvplan_routes"]
    assert len(routes) == 16
    whole = {route["ref"] for route in routes if route["whole"]}
    assert whole >= {"22", "40"}  # looked at on a map: one chain of ways, in order
    assert sum(route["missing"] for route in routes) == 354  # counted by their members; of several routes the same ways lie abroad
    warnings = [line for line in outcome.err.splitlines() if line.startswith("warning:")]
    findings = sum(len(route["findings"]) for route in routes)
    assert len(warnings) == 11
    assert warnings[-1] == f"warning: {findings - 10} more remarks on routes are in liechtenstein.bus/extract.json"
    files = {road["file"] for route in routes for road in route["roads"]}
    assert files == {file.name for file in (tmp_path / "liechtenstein.bus").glob("*.geojson")}


def test_the_way_back_is_a_road_where_no_other_relation_of_the_line_has_it(cli: Cli, tmp_path: Path) -> None:
    ways = (way(1, 401, 402), way(2, 402, 502, 503, 403, oneway="yes"), way(3, 403, 303, 302, 402, oneway="yes"), way(4, 403, 404))
    members = tuple(Member("w", number) for number in (1, 2, 3, 4))
    both = Relation(1, {"type": "route", "route": "bus", "ref": "11"}, members)
    other = Relation(2, {"type": "route", "route": "bus", "ref": "11"}, (members[3], members[2], members[0]))
    cli("roads", "extract", str(write_map(tmp_path / "m.osm", ways, [both])), "--out", "alone", "--quiet")
    assert sorted(file.name for file in (tmp_path / "alone").glob("*.geojson")) == ["bus-11-1-back.geojson", "bus-11-1.geojson"]
    cli("roads", "extract", str(write_map(tmp_path / "m.osm", ways, [both, other])), "--out", "two", "--quiet")
    assert sorted(file.name for file in (tmp_path / "two").glob("*.geojson")) == ["bus-11-1.geojson", "bus-11-2.geojson"]
