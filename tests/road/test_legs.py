"""Legs from files: which lines they are, how they are joined, and in which street each of them lies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from ezdxf.filemanagement import new
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError
from hdvplan.legs import load_legs, past
from hdvplan.road.legs import Leg, Legs
from hdvplan.road.load import load_road
from hdvplan.road.load_csv import read_csv
from hdvplan.road.options import RoadOptions
from hdvplan.road.passages import Line
from hdvplan.road.regions import Kind, Side
from tests.road.drives import BAY, EAST, NORTH, PLACE, RADIUS, area_feature, drawn, leg, line_feature, three_point, turn_features, written

FORWARDS = ("forward", "backward", "forward")
LINES, POSES = three_point()


def end_of(one: Leg, which: int) -> tuple[float, float, float]:
    """Return x, y and heading where a leg begins (0) or ends (1), in the order of driving."""
    here = one.road.path.at(one.ends[which])
    return float(here.x) - EAST, float(here.y) - NORTH, float(here.heading)


def check_turn(legs: Legs, off: float = 0.03) -> None:
    """Check that legs are those of the turn in three moves; smoothing rounds the jumps of curvature within ``off`` [m]."""
    assert [one.direction for one in legs.legs] == list(FORWARDS)
    for one, before, after in zip(legs.legs, POSES, POSES[1:], strict=False):
        for which, pose in enumerate((before, after)):
            x, y, heading = end_of(one, which)
            np.testing.assert_allclose([x, y], pose[:2], atol=1e-6 + (off if off > 0.1 else 0.0))
            assert abs(np.angle(np.exp(1j * (heading - pose[2])))) < np.deg2rad(1.5)  # smoothing has no curvature's jump at the ends
    for one, other in zip(legs.legs, legs.legs[1:], strict=False):
        x, y, heading = end_of(one, 1)
        np.testing.assert_allclose(end_of(other, 0)[:2], (x, y), atol=1e-8)  # of coordinates of 6.6e6 m, 1e-9 is the last digit
        assert abs(np.angle(np.exp(1j * (heading - end_of(other, 0)[2])))) < 1e-9


def test_the_lines_of_a_turn_share_point_and_heading_at_its_cusps_and_point_as_the_vehicle_heads(tmp_path: Path) -> None:
    legs = load_legs(written(tmp_path, *turn_features()))
    check_turn(legs)
    assert legs.name == "turn"
    assert legs.legs[0].road.path.length == pytest.approx(4.0 + RADIUS * np.pi / 3.0, abs=0.02)


def test_the_order_is_that_of_the_numbers_and_numbers_may_be_words(tmp_path: Path) -> None:
    features = turn_features()
    for feature in features:
        feature["properties"]["leg"] = str(feature["properties"]["leg"])
    check_turn(load_legs(written(tmp_path, *reversed(features))))


def test_layers_of_a_drawing_say_number_and_direction(tmp_path: Path) -> None:
    document = new("R2010")
    document.header["$INSUNITS"] = 6
    for number, (line, direction) in enumerate(zip(LINES, FORWARDS, strict=True), start=1):
        document.modelspace().add_lwpolyline((line + PLACE).tolist(), dxfattribs={"layer": f"LEG_{number}_{direction.upper()}"})
    document.modelspace().add_lwpolyline([(EAST - 20.0, NORTH - 9.0), (EAST + 40.0, NORTH - 9.0)], dxfattribs={"layer": "KERB"})
    document.saveas(tmp_path / "turn.dxf")
    legs = load_legs(tmp_path / "turn.dxf")
    check_turn(legs)
    assert {region.label for region in legs.regions} == {"KERB"}
    assert legs.notes == ()  # no layer is called unread


def table_of(lines: list[FloatArray], cusps: str) -> str:
    """Return legs as a table whose cusps are there twice, or once with the sign of the leg before or of the leg after."""
    rows = ["x,y,direction"]
    for number, line in enumerate(lines):
        sign, own = -1 if number % 2 else 1, slice(None)
        if cusps == "before" and number > 0:
            own = slice(1, None)
        if cusps == "after" and number < len(lines) - 1:
            own = slice(None, -1)
        rows += [f"{x!r},{y!r},{sign}" for x, y in line[own].tolist()]
    return "\n".join(rows) + "\n"


@pytest.mark.parametrize("cusps", ["twice", "before", "after"])
def test_a_column_of_directions_cuts_a_table_at_its_cusps(tmp_path: Path, cusps: str) -> None:
    path = tmp_path / "turn.csv"
    path.write_text(table_of([line + PLACE for line in LINES], cusps), encoding="utf-8")
    check_turn(load_legs(path))


angles = st.floats(-0.6, 0.6)
drives = st.lists(st.lists(angles, min_size=2, max_size=6), min_size=2, max_size=5)


@given(turns=drives, cusps=st.sampled_from(["twice", "before", "after"]))
def test_any_table_of_legs_is_cut_where_its_line_turns_back(turns: list[list[float]], cusps: str) -> None:
    pose, lines = (0.0, 0.0, 0.0), []
    for number, own in enumerate(turns):
        line, pose = drawn(pose, [(2.0 * (-1.0 if number % 2 else 1.0), angle / 2.0) for angle in own], spacing=2.0)
        lines.append(line)
    raw = read_csv(table_of(lines, cusps), "turn.csv", RoadOptions(unit="m"))
    assert [one.backward for one in raw.legs] == [number % 2 == 1 for number in range(len(turns))]
    for one, line in zip(raw.legs, lines, strict=True):
        np.testing.assert_array_equal(one.raw.points, line)


def test_a_column_of_other_directions_is_not_read_and_one_without_a_cusp_is_a_road() -> None:
    degrees = read_csv("x,y,direction\n0,0,90\n60,0,91\n", "gps.csv")
    assert (degrees.legs, degrees.notes) == ((), ("gps.csv: column direction not read",))
    forwards = read_csv("x,y,direction\n0,0,1\n60,0,1\n", "road.csv")
    assert (forwards.legs, forwards.notes) == ((), ())


def test_a_single_leg_may_be_driven_backwards() -> None:
    raw = read_csv("x,y,direction\n60,0,-1\n0,0,-1\n", "dock.csv")
    assert [one.backward for one in raw.legs] == [True]


TURN = turn_features()
REFUSED: list[tuple[str, list[dict[str, Any]], str]] = [
    ("a missing number", [TURN[0], leg(3, "backward", LINES[1])], "legs are numbered 1, 2, ..., and leg 2 is missing"),
    ("a number twice", [TURN[0], leg(1, "backward", LINES[1])], "2 lines are leg 1"),
    ("from zero", [leg(0, "forward", LINES[0]), leg(1, "backward", LINES[1])], "legs are numbered 1, 2, ..., and one is 0"),
    ("a word", [leg("first", "forward", LINES[0])], "property leg must be a whole number from 1, not 'first'"),
    ("a fraction", [leg(1.5, "forward", LINES[0])], "property leg must be a whole number from 1, not 1.5"),
    ("no direction", [leg(1, None, LINES[0])], "leg 1 has no direction; it is forward or backward"),
    ("another direction", [leg(1, "reverse", LINES[0])], "leg 1 has the direction 'reverse'; it is forward or backward"),
    ("no number", [TURN[0], line_feature(LINES[1], direction="backward")], "a line is driven backward, but has no number"),
    ("a road", [TURN[0]], "a single leg that is driven forwards is a road"),
    ("two forwards", [TURN[0], leg(2, "forward", LINES[1])], "legs 1 and 2 are both driven forwards"),
    ("a gap", [TURN[0], leg(2, "backward", LINES[1] + [0.05, 0.0])], "leg 2 begins 0.05 m from the end of leg 1, which is at x "),
    (
        "ends where it begins",
        [leg(1, "backward", drawn((0.0, 0.0, 0.0), [(-2.0 * np.pi * RADIUS, 1.0 / RADIUS)])[0])],
        "leg 1: it ends where",
    ),
    ("too short", [TURN[0], leg(2, "backward", LINES[1][:2])], "leg 2: the road is 0.50 m long; at least 1 m are needed"),
]


@pytest.mark.parametrize(("features", "message"), [row[1:] for row in REFUSED], ids=[row[0] for row in REFUSED])
def test_legs_that_make_no_drive_are_refused(tmp_path: Path, features: list[dict[str, Any]], message: str) -> None:
    with pytest.raises(RoadError) as refused:
        load_legs(written(tmp_path, *features))
    assert message in str(refused.value)
    assert refused.value.hint or "at least 1 m" in message


@pytest.mark.parametrize(
    ("turn", "hint"), [(20.0, "draw the beginning of leg 2 back over the end of leg 1"), (175.0, "is a direction wrong?")]
)
def test_a_heading_that_breaks_at_a_cusp_is_refused_with_what_to_draw(tmp_path: Path, turn: float, hint: str) -> None:
    straight, corner = np.array([[0.0, 0.0], [30.0, 0.0]]), np.array([30.0, 0.0])
    away = np.deg2rad(180.0 - turn)
    back = corner + np.array([[0.0, 0.0], [20.0 * np.cos(away), 20.0 * np.sin(away)]])
    with pytest.raises(RoadError, match=f"heading changes by {turn:.0f} degrees from leg 1 to leg 2") as refused:
        load_legs(written(tmp_path, leg(1, "forward", straight), leg(2, "backward", back)))
    assert hint in str(refused.value.hint)


def test_a_cusp_that_smoothing_bends_is_refused_with_what_bends_less(tmp_path: Path) -> None:
    out = np.array([[-20.0, 4.5], [18.0, 4.5]])
    path = written(tmp_path, leg(1, "forward", out), leg(2, "backward", BAY))
    with pytest.raises(RoadError, match="heading changes by 17 degrees from leg 1 to leg 2") as refused:
        load_legs(path)
    assert refused.value.hint == "smoothing turned the drawn lines there: try --smooth 0.2"
    assert len(load_legs(path, RoadOptions(smooth=0.2)).legs) == 2


def test_lines_that_do_not_quite_meet_are_moved_half_way_and_the_street_stays(tmp_path: Path) -> None:
    corner, turn = np.array([40.0, 0.0]), np.deg2rad(6.0)
    out, away = np.array([[0.0, 0.0], [40.0, 0.0]]), np.array([np.cos(np.pi - turn), np.sin(np.pi - turn)])
    back = corner + np.array([0.0, 0.008]) + np.outer([0.0, 40.0], away)
    legs = load_legs(written(tmp_path, leg(1, "forward", out, width_m=6.0), leg(2, "backward", back, width_m=6.0)))
    first, second = legs.legs
    assert end_of(first, 1)[2] == pytest.approx(-0.5 * turn, abs=1e-9)
    np.testing.assert_allclose(end_of(first, 1), end_of(second, 0), atol=1e-8)
    np.testing.assert_allclose(end_of(first, 1)[:2], [40.0, 0.004], atol=1e-8)
    u = np.linspace(0.0, 1.0, 10_001)  # the quintic with slope 1 at 0, and no slope and curvature elsewhere, over 10 m
    most = 10.0 * np.tan(0.5 * turn) * np.max(u - 6.0 * u**3 + 8.0 * u**4 - 3.0 * u**5)
    y = first.road.path.at(np.linspace(0.0, first.road.path.length, 1000)).y - NORTH
    assert float(np.max(np.abs(y))) == pytest.approx(most, abs=0.008)  # the ends are moved by up to 4 mm more
    (note,) = legs.notes  # the second line is moved to the same side by both
    assert note == f"turn: the lines of legs 1 and 2 meet 0.8 cm apart and at 6.0 degrees: they are moved by up to {most + 0.004:.2f} m"
    limits = first.road.limits
    assert limits is not None
    left, right = limits.table(np.array([10.0]))[:2]  # where nothing was moved
    np.testing.assert_allclose([left[0], right[0]], [3.0, -3.0], atol=1e-3)
    assert first.road.drawn is not None
    for kerb in first.road.drawn:
        np.testing.assert_allclose(np.abs(kerb.points[:, 1] - NORTH), 3.0, atol=1e-9)  # the street is where it was drawn


def test_widths_are_beside_the_line_as_drawn_and_limits_beside_the_vehicle(tmp_path: Path) -> None:
    back = np.array([[40.0, 0.0], [0.0, 0.0]])
    (one,) = load_legs(written(tmp_path, leg(1, "backward", back, left_m=2.0, right_m=5.0))).legs
    assert one.road.limits is not None
    left, right = one.road.limits.table(np.array([20.0]))[:2]
    np.testing.assert_allclose([left[0], right[0]], [5.0, -2.0], atol=1e-6)  # it heads against the line
    assert end_of(one, 0)[0] == pytest.approx(40.0, abs=1e-6)


@pytest.mark.parametrize(("reach", "thick"), [(12.0, False), (40.0, True)], ids=["that ends", "that parts the place"])
def test_an_edge_ahead_of_a_leg_is_a_wall_cut_where_the_line_goes_on(tmp_path: Path, reach: float, thick: bool) -> None:
    straight = np.array([[0.0, 0.0], [30.0, 0.0]])
    wall = np.array([[38.0, -reach], [38.0, reach]])
    legs = load_legs(written(tmp_path, leg(1, "backward", straight[::-1]), line_feature(wall, edge="left", name="end")))
    (one,), (whole,) = legs.legs, legs.regions
    assert (whole.kind, whole.label) == (Kind.OBSTACLE, "end")
    assert shapely.distance(whole.polygon, shapely.Point(EAST + 30.0, NORTH)) == pytest.approx(8.0, abs=1e-9)
    assert whole.polygon.bounds[0] == pytest.approx(EAST + 38.0, abs=1e-9)  # it lies on the side away from the line
    deep = 12.0 if thick else 0.05  # as far as 20 m from the line, or a thin wall
    assert whole.polygon.bounds[2] == pytest.approx(EAST + 38.0 + deep, abs=1e-3)  # the place is round, of 16 chords a quarter
    own = one.road.regions
    assert len(own) == 2
    assert sum(region.polygon.area for region in own) == pytest.approx(whole.polygon.area, abs=deep * 0.003)  # less the cut of 2 mm
    assert not any(region.polygon.intersects(Line.of(one.road.path).endless) for region in own)
    sides = {passage.region: passage.usual for passage in one.road.passages}
    for number, region in enumerate(own):
        left = region.polygon.centroid.y > NORTH
        assert sides[number] is (Side.RIGHT if left else Side.LEFT)  # what lies left of the line is passed on its right


def test_a_polygon_around_the_street_bounds_every_leg(tmp_path: Path) -> None:
    box = np.array([(-10.0, -8.0), (45.0, -8.0), (45.0, 30.0), (-10.0, 30.0), (-10.0, -8.0)])
    legs = load_legs(written(tmp_path, *turn_features(), line_feature(box, edge="left")))
    beyond = shapely.union_all([region.polygon for region in legs.regions])
    street, near = shapely.Polygon(box + PLACE), shapely.buffer(shapely.MultiLineString([line + PLACE for line in LINES]), 15.0)
    assert shapely.intersection(street, beyond).area == pytest.approx(0.0, abs=1e-6)
    assert shapely.difference(near, shapely.union(street, beyond)).area == pytest.approx(0.0, abs=1e-6)  # all else is beyond
    for one in legs.legs:
        assert {passage.usual for passage in one.road.passages} == {Side.LEFT, Side.RIGHT}
        for passage in one.road.passages:
            assert passage.usual is (Side.RIGHT if passage.high > -passage.low else Side.LEFT)
            assert min(passage.high, -passage.low) < 0.05  # each part lies to one side: feet are found on chords of 1 m of the arc


def test_a_sweepable_area_takes_the_place_of_the_edge_that_it_joins(tmp_path: Path) -> None:
    straight, kerb = np.array([[0.0, 0.0], [60.0, 0.0]]), np.array([[-20.0, 4.0], [80.0, 4.0]])
    pavement = area_feature([(20.0, 4.0), (40.0, 4.0), (40.0, 5.5), (20.0, 5.5)], region="sweepable")
    legs = load_legs(written(tmp_path, leg(1, "backward", straight[::-1]), line_feature(kerb, edge="left"), pavement))
    walls = shapely.union_all([region.polygon for region in legs.regions if region.kind is Kind.OBSTACLE])
    for x, apart in ((10.0, 4.0), (30.0, 5.5), (50.0, 4.0)):
        ray = shapely.LineString([(EAST + x, NORTH), (EAST + x, NORTH + 9.0)])
        assert shapely.distance(shapely.Point(EAST + x, NORTH), shapely.intersection(ray, walls)) == pytest.approx(apart, abs=1e-9)


def test_what_lies_behind_several_edges_is_called_like_the_nearest(tmp_path: Path) -> None:
    straight, corner = np.array([[0.0, 0.0], [30.0, 0.0]]), (42.0, 4.0)
    sides = [
        line_feature(np.array([[-30.0, 4.0], corner]), edge="left", name="kerb"),
        line_feature(np.array([corner, (42.0, -30.0)]), edge="left", name="wall"),
    ]
    legs = load_legs(written(tmp_path, leg(1, "backward", straight[::-1]), *sides))
    (behind,) = legs.regions
    assert (behind.label, [edge.label for edge in behind.edges]) == ("kerb, wall", ["kerb", "wall"])
    for x, y, label in ((10.0, 4.1, "kerb"), (42.1, -3.0, "wall")):
        assert behind.at(EAST + x, NORTH + y).label == label


def test_an_edge_across_a_leg_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RoadError, match=r"an edge crosses the line of a leg at x 674002.0, y 6580000.0"):
        load_legs(written(tmp_path, *turn_features(), line_feature(np.array([[2.0, -5.0], [2.0, 5.0]]), edge="left")))


def test_a_file_of_legs_is_no_road_unless_one_line_is_chosen(tmp_path: Path) -> None:
    path = written(tmp_path, *turn_features(), line_feature(LINES[0], name="approach"))
    with pytest.raises(RoadError, match="turn holds the legs of a drive") as refused:
        load_road(path)
    assert "--name chooses one line" in str(refused.value.hint)
    assert load_road(path, RoadOptions(feature="approach")).path.length == pytest.approx(4.0 + RADIUS * np.pi / 3.0, abs=0.02)
    with pytest.raises(RoadError, match="turn holds a road, and no legs"):
        load_legs(path, RoadOptions(feature="approach"))
    with pytest.raises(RoadError, match="uturn is a road, and has no legs"):
        load_legs("uturn")


@pytest.mark.parametrize("option", [{"offset": 1.0}, {"reverse": True}])
def test_options_that_would_part_the_legs_are_refused(tmp_path: Path, option: dict[str, Any]) -> None:
    with pytest.raises(RoadError, match=f"has no use for --{next(iter(option))}"):
        load_legs(written(tmp_path, *turn_features()), RoadOptions(**option))


def test_a_curvature_profile_and_a_line_that_goes_on_cannot_turn_back() -> None:
    with pytest.raises(RoadError, match="a curvature profile cannot be driven backwards"):
        read_csv("s,kappa,direction\n0,0,1\n20,0,-1\n40,0,-1\n", "a.csv")
    with pytest.raises(RoadError, match=r"a.csv, line 4: the direction changes, but the line does not turn back there"):
        read_csv("x,y,direction\n0,0,1\n20,0,1\n40,0,-1\n60,0,-1\n", "a.csv")
    with pytest.raises(RoadError, match="a leg has one point alone"):
        read_csv("x,y,direction\n0,0,1\n20,0,1\n20,0,-1\n20,0,1\n0,0,1\n", "a.csv")


def test_legs_without_widths_have_none_after_their_cusps_were_moved(tmp_path: Path) -> None:
    van = area_feature([(2.0, 4.0), (6.0, 4.0), (6.0, 6.0), (2.0, 6.0)], region="obstacle")
    legs = load_legs(written(tmp_path, *turn_features(), van))
    for one in past(legs, np.array([1.0, 0.5])).legs:
        assert one.road.limits is None  # the bounds of an open place are planned in, and drawn nowhere
        assert one.road.given is not None
