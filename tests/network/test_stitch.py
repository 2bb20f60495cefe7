"""Stitching the ways of a route: direction, circles, gaps, order, one-ways, roles."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.network.osm import Member, Way
from hdvplan.network.stitch import Trouble, one_way, stitched
from tests.network.town import EAST, NORTH, PLACES, RING, SOUTH, WEST, kinds, parts_of, stitch, way

LEFT, RIGHT = way(1, 401, 402, WEST), way(3, EAST, 406, 407)  # streets to and from the roundabout


def ring(**tags: str) -> Way:
    return way(2, *RING, **tags)


def test_ways_are_turned_so_that_each_meets_the_next() -> None:
    parts, findings = stitch(way(1, 102, 101), way(2, 102, 103), way(3, 105, 104, 103))
    assert parts == [(101, 102, 103, 104, 105)]
    assert findings == []


def test_every_segment_knows_its_way() -> None:
    (part,), _ = parts_of(way(1, 102, 101), way(2, 102, 103), way(3, 105, 104, 103))
    assert [one.id for one in part.ways] == [1, 2, 3, 3]


@pytest.mark.parametrize(
    ("only", "role", "nodes"),
    [
        (way(1, 101, 102), "", (101, 102)),
        (way(1, 101, 102, oneway="-1"), "", (102, 101)),
        (way(1, 101, 102), "backward", (102, 101)),
        (way(1, 101, 102), "hail_and_ride", (101, 102)),
    ],
)
def test_a_single_way_is_driven_in_the_direction_that_is_allowed(only: Way, role: str, nodes: tuple[int, ...]) -> None:
    assert stitch(only, order=((1, role),)) == ([nodes], [])


def test_a_gap_cuts_the_line_and_is_measured() -> None:
    parts, (finding,) = stitch(way(1, 101, 102), way(2, 103, 104))
    assert parts == [(101, 102), (103, 104)]
    assert finding.trouble is Trouble.GAP
    assert finding.text == "way 2 follows way 1 and does not meet it: a gap of 76 m"  # 0.001 deg of longitude at 47.1 deg north
    assert finding.place == PLACES[102]


def test_ways_in_the_wrong_order_are_told_from_a_gap_and_nothing_is_sorted() -> None:
    parts, findings = stitch(way(1, 101, 102), way(2, 102, 103), way(3, 103, 104), order=(1, 3, 2))
    assert parts == [(101, 102), (104, 103, 102)]
    assert kinds(findings) == [Trouble.ORDER]
    assert "way 1 meets way 2, which is elsewhere in the route" in findings[0].text


def test_a_way_that_the_map_lacks_cuts_the_line_even_where_its_neighbours_meet() -> None:
    parts, (finding,) = stitch(way(1, 101, 102), way(2, 102, 103), order=(1, 7, 8, 2))
    assert parts == [(101, 102), (102, 103)]
    assert (finding.trouble, finding.text) == (Trouble.MISSING, "2 members are not in the map, after way 1 and before way 2")


def test_ways_that_are_missing_at_the_ends_are_told_and_cut_nothing() -> None:
    parts, findings = stitch(way(1, 101, 102), order=(7, 1, 8))
    assert parts == [(101, 102)]
    assert [finding.text for finding in findings] == ["way 7 is not in the map, before way 1", "way 8 is not in the map, after way 1"]


def test_a_route_without_any_of_its_ways_has_no_line() -> None:
    parts, findings = stitch(order=(7, 8))
    assert parts == []
    assert kinds(findings) == [Trouble.MISSING]


def test_of_a_roundabout_only_the_arc_from_entry_to_exit_is_driven_along_its_one_way() -> None:
    parts, findings = stitch(LEFT, ring(junction="roundabout"), RIGHT)
    assert parts == [(401, 402, WEST, SOUTH, EAST, 406, 407)]
    assert findings == []


def test_the_last_exit_of_a_roundabout_takes_three_quarters_of_it() -> None:
    parts, _ = stitch(LEFT, ring(junction="roundabout"), way(3, NORTH, 504))
    assert parts == [(401, 402, WEST, SOUTH, EAST, NORTH, 504)]


def test_a_roundabout_that_is_mapped_clockwise_is_driven_clockwise() -> None:
    parts, _ = stitch(LEFT, way(2, *RING[::-1], junction="roundabout"), way(3, NORTH, 504))
    assert parts == [(401, 402, WEST, NORTH, 504)]


def test_a_circle_without_one_way_is_driven_the_shorter_way_round() -> None:
    parts, findings = stitch(LEFT, ring(), way(3, NORTH, 504))
    assert parts == [(401, 402, WEST, NORTH, 504)]
    assert findings == []


def test_a_role_says_which_way_round_a_circle_is_driven() -> None:
    parts, _ = stitch(LEFT, ring(), way(3, NORTH, 504), order=(1, (2, "forward"), 3))
    assert parts == [(401, 402, WEST, SOUTH, EAST, NORTH, 504)]


def test_two_roundabouts_that_touch_are_driven_over_the_node_that_they_share() -> None:
    far = way(5, EAST, 405, 505, EAST, junction="roundabout")
    parts, _ = stitch(LEFT, ring(junction="roundabout"), far, way(6, 505, 605))
    assert parts == [(401, 402, WEST, SOUTH, EAST, 405, 505, 605)]


def test_a_turning_circle_at_a_terminus_is_driven_once_round() -> None:
    parts, findings = stitch(LEFT, ring(junction="roundabout"), order=(1, 2, 1))
    assert parts == [(401, 402, WEST, SOUTH, EAST, NORTH, WEST, 402, 401)]
    assert kinds(findings) == [Trouble.ROUND]


def test_a_route_that_ends_or_begins_in_a_circle_drives_all_of_it() -> None:
    assert stitch(LEFT, ring())[0] == [(401, 402, WEST, SOUTH, EAST, NORTH, WEST)]
    assert stitch(ring(), RIGHT)[0] == [(EAST, NORTH, WEST, SOUTH, EAST, 406, 407)]
    assert stitch(ring())[0] == [RING]


def test_a_route_that_turns_back_on_its_way_is_cut_where_no_turning_is_mapped() -> None:
    parts, (finding,) = stitch(way(1, 101, 102), way(2, 102, 103), order=(1, 2, 2, 1))
    assert parts == [(101, 102, 103), (103, 102, 101)]
    assert finding.trouble is Trouble.TURN
    assert finding.place == PLACES[103]


def test_a_line_may_cross_itself_at_a_node() -> None:
    loop = way(2, 203, 303, 304, 204, 203, 202)  # a P: through 203, round, and through it again
    parts, findings = stitch(way(1, 103, 203), loop)
    assert parts == [(103, 203, 303, 304, 204, 203, 202)]
    assert findings == []


def test_driving_against_a_one_way_is_told_and_cuts_nothing() -> None:
    parts, findings = stitch(way(1, 101, 102), way(2, 103, 102, oneway="yes"), way(3, 103, 104))
    assert parts == [(101, 102, 103, 104)]
    assert [(finding.trouble, finding.text) for finding in findings] == [(Trouble.ONE_WAY, "way 2 is driven against its one-way direction")]


def test_driving_against_a_role_is_told_and_cuts_nothing() -> None:
    parts, findings = stitch(way(1, 101, 102), way(2, 103, 102), way(3, 103, 104), order=(1, (2, "forward"), 3))
    assert parts == [(101, 102, 103, 104)]
    assert kinds(findings) == [Trouble.ROLE]


def test_two_ways_that_meet_at_both_ends_are_driven_there_and_back() -> None:
    there, back = way(2, 402, 502, 503, 403), way(3, 402, 302, 303, 403)
    parts, findings = stitch(way(1, 401, 402), there, back, way(4, 402, 501))
    assert parts == [(401, 402, 502, 503, 403, 303, 302, 402, 501)]
    assert findings == []


def test_a_way_that_is_left_at_a_node_in_it_is_driven_in_part() -> None:
    parts, findings = stitch(way(1, 101, 102, 103, 104), way(2, 103, 203))
    assert parts == [(101, 102, 103, 203)]
    assert [finding.text for finding in findings] == ["of way 1 only 151 of 227 m are driven: it is not split where the route leaves it"]


def test_a_way_that_is_left_where_it_is_entered_is_told_and_not_driven() -> None:
    parts, findings = stitch(way(1, 101, 102), way(2, 102, 202), way(3, 102, 103))
    assert parts == [(101, 102, 103)]
    assert kinds(findings) == [Trouble.LEFT_OUT]


A, C = way(1, 401, 402), way(4, 403, 404)  # two-way streets, and between them a one-way street for each direction
THERE, BACK = way(2, 402, 502, 503, 403, oneway="yes"), way(3, 403, 303, 302, 402, oneway="yes")


@pytest.mark.parametrize("order", [(1, 2, 3, 4), (1, 3, 2, 4)])
def test_where_a_route_is_mapped_for_both_directions_only_the_ways_of_one_are_driven(order: tuple[int, ...]) -> None:
    parts, findings = stitch(A, THERE, BACK, C, order=order)
    assert parts == [(401, 402, 502, 503, 403, 404)]
    assert [(finding.trouble, finding.text) for finding in findings] == [(Trouble.OTHER, "left out as part of the other direction: way 3")]


def test_the_members_the_other_way_round_give_the_way_back() -> None:
    parts, findings = stitch(A, THERE, BACK, C, order=(4, 3, 2, 1))
    assert parts == [(404, 403, 303, 302, 402, 401)]
    assert kinds(findings) == [Trouble.OTHER]


def test_roles_tell_the_directions_of_two_way_streets_apart() -> None:
    there, back = way(2, 402, 502, 503, 403), way(3, 402, 302, 303, 403)
    parts, findings = stitch(A, there, back, C, order=(1, (3, "backward"), (2, "forward"), 4))
    assert parts == [(401, 402, 502, 503, 403, 404)]
    assert kinds(findings) == [Trouble.OTHER]


def test_the_halves_of_a_roundabout_that_is_split_are_told_apart() -> None:
    south, north = way(2, WEST, SOUTH, EAST, junction="roundabout"), way(5, EAST, NORTH, WEST, junction="roundabout")
    parts, findings = stitch(LEFT, north, south, RIGHT)
    assert parts == [(401, 402, WEST, SOUTH, EAST, 406, 407)]
    assert kinds(findings) == [Trouble.OTHER]


def test_a_one_way_that_leads_on_is_never_passed_over() -> None:
    parts, findings = stitch(way(1, 401, 402), way(2, 402, 403, oneway="yes"), way(3, 403, 404), way(4, 404, 504, 503, 403, 303))
    assert parts[0][:4] == (401, 402, 403, 404)
    assert Trouble.OTHER not in kinds(findings)


@pytest.mark.parametrize(
    ("tags", "direction"),
    [
        ({}, 0),
        ({"oneway": "yes"}, 1),
        ({"oneway": "-1"}, -1),
        ({"oneway": "no", "junction": "roundabout"}, 0),
        ({"junction": "circular"}, 1),
        ({"highway": "motorway"}, 1),
        ({"oneway": "yes", "oneway:bus": "no"}, 0),
        ({"oneway": "yes", "oneway:psv": "no"}, 0),
        ({"oneway": "yes", "busway": "opposite_lane"}, 0),
        ({"oneway": "reversible"}, 0),
    ],
)
def test_the_direction_of_traffic_follows_the_tags_for_buses(tags: dict[str, str], direction: int) -> None:
    assert one_way(tags) == direction


def test_an_exception_for_buses_is_none_for_other_routes() -> None:
    assert one_way({"oneway": "yes", "oneway:bus": "no"}, "truck") == 1


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
