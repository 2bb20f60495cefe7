"""Reading routes from OpenStreetMap files, and what is no such file."""

from __future__ import annotations

from pathlib import Path

import pytest

from hdvplan.errors import RoadError
from hdvplan.network import osm
from hdvplan.network.osm import Member, Relation, read_routes
from tests.network.maps import write_map
from tests.network.town import PLACES, way

WAYS = (way(1, 101, 102, highway="residential"), way(2, 102, 103), way(3, 103, 104))
BUS = {"type": "route", "route": "bus"}
FILES = Path(__file__).parent / "files"


def route(number: int, *members: Member, **tags: str) -> Relation:
    return Relation(number, BUS | tags, members)


def test_routes_come_with_their_ways_and_the_places_of_their_nodes(tmp_path: Path) -> None:
    path = write_map(tmp_path / "town.osm", WAYS, [route(9, Member("w", 2), Member("w", 1, "forward"), ref="11")])
    found = read_routes(path, "bus")
    assert found.relations == (route(9, Member("w", 2), Member("w", 1, "forward"), ref="11"),)
    assert dict(found.ways) == {1: WAYS[0], 2: WAYS[1]}
    assert found.places == {node: pytest.approx(PLACES[node], abs=1e-7) for node in (101, 102, 103)}  # maps keep seven decimals


def test_stops_and_platforms_are_no_part_of_a_route(tmp_path: Path) -> None:
    members = (Member("n", 101, "stop"), Member("w", 1), Member("w", 3, "platform_exit_only"), Member("n", 102))
    assert read_routes(write_map(tmp_path / "m.osm", WAYS, [route(9, *members)]), "bus").relations[0].members == (Member("w", 1),)


def test_a_relation_in_a_route_is_replaced_by_its_members_in_their_order(tmp_path: Path) -> None:
    inner = Relation(7, {"type": "route_part"}, (Member("w", 2), Member("n", 102, "stop"), Member("w", 3)))
    path = write_map(tmp_path / "m.osm", WAYS, [inner, route(9, Member("w", 1), Member("r", 7), Member("r", 5))])
    assert read_routes(path, "bus").relations[0].members == (Member("w", 1), Member("w", 2), Member("w", 3), Member("r", 5))


def test_relations_that_hold_each_other_end_where_they_come_again(tmp_path: Path) -> None:
    inner = Relation(7, {}, (Member("w", 2), Member("r", 9)))
    path = write_map(tmp_path / "m.osm", WAYS, [inner, route(9, Member("w", 1), Member("r", 7), Member("r", 9))])
    assert read_routes(path, "bus").relations[0].members == (Member("w", 1), Member("w", 2))


def test_relations_that_double_with_each_other_are_refused(tmp_path: Path) -> None:
    doubling = [Relation(number, {}, (Member("r", number + 1), Member("r", number + 1))) for number in range(20, 60)]
    path = write_map(tmp_path / "m.osm", WAYS, [route(9, Member("r", 20)), *doubling, Relation(60, {})])
    with pytest.raises(RoadError, match="relation 9 has more than 100000 members"):
        read_routes(path, "bus")


def test_a_way_of_which_nodes_are_missing_is_missing(tmp_path: Path) -> None:
    path = write_map(tmp_path / "m.osm", WAYS, [route(9, *(Member("w", number) for number in (1, 2, 3, 4)))], without={101})
    assert set(read_routes(path, "bus").ways) == {2, 3}


def test_lines_are_chosen_by_their_numbers(tmp_path: Path) -> None:
    path = write_map(tmp_path / "m.osm", WAYS, [route(number, Member("w", 1), ref=str(number)) for number in (11, 12, 13)])
    assert [one.id for one in read_routes(path, "bus", ("13", "11")).relations] == [11, 13]
    with pytest.raises(RoadError, match=r"m\.osm has no route=bus with ref=112") as caught:
        read_routes(path, "bus", ("112",))
    assert caught.value.hint == "did you mean '11' or '12'?"


def test_a_route_master_is_no_route(tmp_path: Path) -> None:
    master = Relation(8, {"type": "route_master", "route": "bus", "route_master": "bus"}, (Member("r", 9),))
    assert [one.id for one in read_routes(write_map(tmp_path / "m.osm", WAYS, [master, route(9, Member("w", 1))]), "bus").relations] == [9]


def test_a_kind_that_the_map_lacks_is_refused_with_those_that_it_has(tmp_path: Path) -> None:
    path = write_map(tmp_path / "m.osm", WAYS, [route(9, Member("w", 1)), Relation(10, {"type": "route", "route": "hiking"})])
    with pytest.raises(RoadError, match=r"m\.osm has no route relation with route=tram") as caught:
        read_routes(path, "tram")
    assert caught.value.hint == "there are routes of other kinds: bus (1), hiking (1)"


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("empty.osm.pbf", b""),
        ("words.osm", b"this is no map"),
        ("cut.osm", b'<?xml version="1.0"?><osm version="0.6"><relation id="1"><member type="way"'),
        ("bad_id.osm", b'<osm version="0.6"><relation id="x"><tag k="route" v="bus"/></relation></osm>'),
        ("bomb.osm", b'<!DOCTYPE l [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><osm version="0.6"><relation id="1">&b;</relation></osm>'),
        ("unnamed", b"<osm/>"),
    ],
)
def test_what_is_no_map_is_refused_in_one_line(tmp_path: Path, name: str, content: bytes) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(RoadError) as caught:
        read_routes(path, "bus")
    assert "\n" not in str(caught.value)
    assert name in str(caught.value)


@pytest.mark.parametrize("share", [0.05, 0.999])
def test_a_map_that_is_cut_off_is_refused_or_lacks_what_was_cut(tmp_path: Path, share: float) -> None:
    whole = (FILES / "planken.osm.pbf").read_bytes()
    path = tmp_path / "cut.osm.pbf"
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(RoadError, match=r"cut\.osm\.pbf"):
        read_routes(path, "bus")


def test_a_file_that_is_not_there_or_is_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RoadError, match="cannot be read: No such file"):
        read_routes(tmp_path / "m.osm.pbf", "bus")
    with pytest.raises(RoadError, match="cannot be read: Is a directory"):
        read_routes(tmp_path, "bus")


def test_without_osmium_the_message_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "osmium", None)
    with pytest.raises(RoadError, match="maps are read by osmium, which cannot be loaded") as caught:
        osm.read_routes(tmp_path / "m.osm", "bus")
    assert caught.value.hint == "pip install 'hdvplan[osm]'"
