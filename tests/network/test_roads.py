"""Parts of routes as road files: widths from tags, stretches, and that hdvplan loads them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hdvplan.errors import OptionError
from hdvplan.network.osm import Relation, Way
from hdvplan.network.roads import Position, RouteRoad, Widths, road_of_part
from hdvplan.road.load import load_road
from tests.network.town import PLACES, parts_of, way

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
