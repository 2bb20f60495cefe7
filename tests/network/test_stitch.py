"""Routes: read from OpenStreetMap files, and their ways stitched: direction, circles, gaps, order, one-ways, roles."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.errors import RoadError
from hdvplan.network import osm
from hdvplan.network.osm import Member, Relation, Way, read_routes
from hdvplan.network.stitch import Trouble, one_way, stitched
from tests.network.town import EAST, NORTH, PLACES, RING, SOUTH, WEST, kinds, parts_of, stitch, way, write_map

LEFT, RIGHT = way(1, 401, 402, WEST), way(3, EAST, 406, 407)  # streets to and from the roundabout
CIRCLE, ROUNDABOUT = way(2, *RING), way(2, *RING, junction="roundabout")
A, C = way(1, 401, 402), way(4, 403, 404)  # two-way streets, and between them a one-way street for each direction
THERE, BACK = way(2, 402, 502, 503, 403, oneway="yes"), way(3, 403, 303, 302, 402, oneway="yes")

Order = tuple[int | tuple[int, str], ...]
Case = tuple[tuple[Way, ...], Order, list[tuple[int, ...]], list[Trouble]]  # ways, their order, nodes of the parts, what is wrong
CASES: dict[str, Case] = {
    "ways are turned so that each meets the next": (
        (way(1, 102, 101), way(2, 102, 103), way(3, 105, 104, 103)), (), [(101, 102, 103, 104, 105)], [],
    ),
    "a single way runs in its own direction": ((way(1, 101, 102),), ((1, "hail_and_ride"),), [(101, 102)], []),
    "a single way runs as its one-way allows": ((way(1, 101, 102, oneway="-1"),), (), [(102, 101)], []),
    "a single way runs as its role says": ((way(1, 101, 102),), ((1, "backward"),), [(102, 101)], []),
    "a route without any of its ways has no line": ((), (7, 8), [], [Trouble.MISSING]),
    "of a roundabout the arc from entry to exit is driven": ((LEFT, ROUNDABOUT, RIGHT), (), [(401, 402, WEST, SOUTH, EAST, 406, 407)], []),
    "the last exit takes three quarters of it": (
        (LEFT, ROUNDABOUT, way(3, NORTH, 504)), (), [(401, 402, WEST, SOUTH, EAST, NORTH, 504)], [],
    ),
    "a roundabout that is mapped clockwise is driven clockwise": (
        (LEFT, way(2, *RING[::-1], junction="roundabout"), way(3, NORTH, 504)), (), [(401, 402, WEST, NORTH, 504)], [],
    ),
    "a circle without one-way is driven the shorter way round": (
        (LEFT, CIRCLE, way(3, NORTH, 504)), (), [(401, 402, WEST, NORTH, 504)], [],
    ),
    "a role says which way round a circle is driven": (
        (LEFT, CIRCLE, way(3, NORTH, 504)), (1, (2, "forward"), 3), [(401, 402, WEST, SOUTH, EAST, NORTH, 504)], [],
    ),
    "roundabouts that touch are driven over the node that they share": (
        (LEFT, ROUNDABOUT, way(5, EAST, 405, 505, EAST, junction="roundabout"), way(6, 505, 605)), (),
        [(401, 402, WEST, SOUTH, EAST, 405, 505, 605)], [],
    ),
    "a turning circle at a terminus is driven once round": (
        (LEFT, ROUNDABOUT), (1, 2, 1), [(401, 402, WEST, SOUTH, EAST, NORTH, WEST, 402, 401)], [Trouble.ROUND],
    ),
    "a route that ends in a circle drives all of it": ((LEFT, CIRCLE), (), [(401, 402, WEST, SOUTH, EAST, NORTH, WEST)], [Trouble.ROUND]),
    "a line may cross itself at a node": (  # a P: through 203, round, and through it again
        (way(1, 103, 203), way(2, 203, 303, 304, 204, 203, 202)), (), [(103, 203, 303, 304, 204, 203, 202)], [],
    ),
    "driving against a role is told and cuts nothing": (
        (way(1, 101, 102), way(2, 103, 102), way(3, 103, 104)), (1, (2, "forward"), 3), [(101, 102, 103, 104)], [Trouble.ROLE],
    ),
    "ways that meet at both ends are driven there and back": (
        (A, way(2, 402, 502, 503, 403), way(3, 402, 302, 303, 403), way(4, 402, 501)), (),
        [(401, 402, 502, 503, 403, 303, 302, 402, 501)], [],
    ),
    "a way that is left where it is entered is not driven": (
        (way(1, 101, 102), way(2, 102, 202), way(3, 102, 103)), (), [(101, 102, 103)], [Trouble.LEFT_OUT],
    ),
    "of ways for both directions those of one are driven": (
        (A, THERE, BACK, C), (1, 3, 2, 4), [(401, 402, 502, 503, 403, 404)], [Trouble.OTHER],
    ),
    "the members the other way round give the way back": (
        (A, THERE, BACK, C), (4, 3, 2, 1), [(404, 403, 303, 302, 402, 401)], [Trouble.OTHER],
    ),
    "roles tell the directions of two-way streets apart": (
        (A, way(2, 402, 502, 503, 403), way(3, 402, 302, 303, 403), C), (1, (3, "backward"), (2, "forward"), 4),
        [(401, 402, 502, 503, 403, 404)], [Trouble.OTHER],
    ),
    "the halves of a roundabout that is split are told apart": (
        (LEFT, way(5, EAST, NORTH, WEST, junction="roundabout"), way(2, WEST, SOUTH, EAST, junction="roundabout"), RIGHT), (),
        [(401, 402, WEST, SOUTH, EAST, 406, 407)], [Trouble.OTHER],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_a_route_is_driven_as_its_map_says(case: Case) -> None:
    ways, order, parts, troubles = case
    found, findings = stitch(*ways, order=order)
    assert (found, kinds(findings)) == (parts, troubles)


CUT: dict[str, Case] = {  # the last entry is the text of what is wrong
    "way 2 follows way 1 and does not meet it: a gap of 76 m": (  # 0.001 deg of longitude at 47.1 deg north
        (way(1, 101, 102), way(2, 103, 104)), (), [(101, 102), (103, 104)], [Trouble.GAP],
    ),
    "way 3 follows way 1 and does not meet it; way 1 meets way 2, which is elsewhere in the route": (
        (way(1, 101, 102), way(2, 102, 103), way(3, 103, 104)), (1, 3, 2), [(101, 102), (104, 103, 102)], [Trouble.ORDER],
    ),
    "2 members are not in the map, after way 1 and before way 2": (  # though its neighbours meet
        (way(1, 101, 102), way(2, 102, 103)), (1, 7, 8, 2), [(101, 102), (102, 103)], [Trouble.MISSING],
    ),
    "way 2 continues way 2 with a turn of 180 degrees on the spot": (
        (way(1, 101, 102), way(2, 102, 103)), (1, 2, 2, 1), [(101, 102, 103), (103, 102, 101)], [Trouble.TURN],
    ),
    "way 2 is driven against its one-way direction": (
        (way(1, 101, 102), way(2, 103, 102, oneway="yes"), way(3, 103, 104)), (), [(101, 102, 103, 104)], [Trouble.ONE_WAY],
    ),
    "of way 1 only 151 of 227 m are driven: it is not split where the route leaves it": (
        (way(1, 101, 102, 103, 104), way(2, 103, 203)), (), [(101, 102, 103, 203)], [Trouble.IN_PART],
    ),
    "left out as part of the other direction: way 3": (
        (A, THERE, BACK, C), (), [(401, 402, 502, 503, 403, 404)], [Trouble.OTHER],
    ),
    "way 7 is not in the map, before way 1": ((way(1, 101, 102),), (7, 1), [(101, 102)], [Trouble.MISSING]),
}  # fmt: skip


@pytest.mark.parametrize("text", CUT)
def test_what_is_wrong_with_a_route_is_told_with_its_place(text: str) -> None:
    ways, order, parts, troubles = CUT[text]
    found, (finding,) = stitch(*ways, order=order)
    assert (found, [finding.trouble], finding.text) == (parts, troubles, text)
    assert finding.place in PLACES.values()


def test_every_segment_knows_its_way() -> None:
    (part,), _ = parts_of(way(1, 102, 101), way(2, 102, 103), way(3, 105, 104, 103))
    assert [one.id for one in part.ways] == [1, 2, 3, 3]


def test_a_one_way_that_leads_on_is_never_passed_over() -> None:
    parts, findings = stitch(way(1, 401, 402), way(2, 402, 403, oneway="yes"), way(3, 403, 404), way(4, 404, 504, 503, 403, 303))
    assert parts[0][:4] == (401, 402, 403, 404)
    assert Trouble.OTHER not in kinds(findings)


@pytest.mark.parametrize(
    ("tags", "kind", "direction"),
    [
        ({}, "bus", 0),
        ({"oneway": "-1"}, "bus", -1),
        ({"oneway": "no", "junction": "roundabout"}, "bus", 0),
        ({"highway": "motorway"}, "bus", 1),
        ({"oneway": "yes", "oneway:psv": "no"}, "bus", 0),
        ({"oneway": "yes", "busway": "opposite_lane"}, "bus", 0),
        ({"oneway": "reversible"}, "bus", 0),
        ({"oneway": "yes", "oneway:bus": "no"}, "truck", 1),
    ],
)
def test_the_direction_of_traffic_follows_the_tags_with_exceptions_for_buses(tags: dict[str, str], kind: str, direction: int) -> None:
    assert one_way(tags, kind) == direction


@given(st.lists(st.sampled_from([node for node in PLACES if node < 900]), min_size=3, max_size=30, unique=True), st.data())
def test_any_line_that_is_cut_into_ways_of_any_direction_is_found_again(line: list[int], data: st.DataObject) -> None:
    cuts = sorted({0, len(line) - 1, *data.draw(st.lists(st.integers(1, len(line) - 2)))})
    ways = []
    for number, (first, last) in enumerate(pairwise(cuts)):
        piece = line[first : last + 1]
        ways.append(way(number, *(piece[::-1] if data.draw(st.booleans()) else piece)))
    parts, findings = parts_of(*ways)
    joined = [parts[0].nodes[0], *(node for part in parts for node in part.nodes[1:])]
    assert joined == line or (len(ways) == 1 and joined == line[::-1])  # one way alone has no direction but its own
    assert set(kinds(findings)) <= {Trouble.TURN}  # a random line may turn sharply
    assert all(before.nodes[-1] == after.nodes[0] for before, after in pairwise(parts))


def test_points_that_lie_on_each_other_are_there_once() -> None:
    places = {1: (9.5, 47.1), 2: (9.501, 47.1), 3: (9.501, 47.1), 4: (9.502, 47.1)}
    (part,), _ = stitched([Member("w", 1)], {1: Way(1, (1, 2, 3, 4))}, places)
    assert [places[node] for node in part.nodes] == [(9.5, 47.1), (9.501, 47.1), (9.502, 47.1)]


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
