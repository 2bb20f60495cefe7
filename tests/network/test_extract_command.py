"""``hdvplan roads extract`` as a user calls it."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from hdvplan.answers import NEEDS
from hdvplan.network.osm import Member, Relation
from tests.cli.conftest import Cli
from tests.network.maps import write_map
from tests.network.town import way

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
