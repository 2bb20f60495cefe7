"""The street in the plane: kerbs beside a line, drawn kerbs, and the pieces that the core takes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import assume, example, given
from hypothesis import strategies as st

from hdvplan.arrays import FloatArray, Records
from hdvplan.errors import RoadError
from hdvplan.road.drawn import drawn_kerbs
from hdvplan.road.given import given_line
from hdvplan.road.limits import About, Limits
from hdvplan.road.line import Line, RawRoad, smoothed
from hdvplan.road.options import RoadOptions
from hdvplan.road.path import ReferencePath, from_curvature
from hdvplan.road.pieces import Kerb, pieces_of
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.road.street import Street, rooms_of
from tests.core.chains import arc

EAST = np.array([[1.0, 0.0], [1.0, 0.0]])
BEND = arc(0.05, 100.0)  # radius 20 m, to the left, around (0, 20)


def straight(y: float, *, first: float = 0.0, last: float = 100.0, left: bool = True, goes_on: bool = True) -> Kerb:
    s = np.array([first, 0.5 * (first + last), last])
    return Kerb(np.stack([s, np.full(3, y)], axis=1), s, left, goes_on=goes_on)


def pieces(*kerbs: Kerb, closed: bool = False, s_from: float = 0.0, s_to: float = 100.0, length: float = 100.0) -> Records:
    return Street(kerbs, length, closed, EAST).pieces(s_from, s_to).pieces


def ends_of(found: Records) -> tuple[FloatArray, FloatArray]:
    """Return where pieces begin and end, (n, 2) each."""
    begin = np.stack([found["x"], found["y"]], axis=1)
    return begin, begin + found["length"][:, None] * np.stack([found["cos"], found["sin"]], axis=1)


def ring(radius: float = 20.0) -> ReferencePath:
    return replace(arc(1.0 / radius, 2.0 * np.pi * radius), closed=True)


def test_every_piece_has_the_street_on_its_left() -> None:
    found = pieces(straight(3.0), straight(-2.0, left=False))
    begin, end = ends_of(found)
    for piece, one, other in zip(found, begin, end, strict=True):
        across = piece["cos"] * (0.0 - one[1]) - piece["sin"] * (50.0 - one[0])  # of the line's middle
        assert across == pytest.approx(3.0 if piece["left"] else 2.0)
        assert piece["length"] == pytest.approx(np.hypot(*(other - one)))
        np.testing.assert_allclose([piece["s_begin"], piece["s_end"]], [one[0], other[0]])
        assert piece["s_low"] <= min(one[0], other[0]) + 1e-9  # rounding
        assert piece["s_high"] >= max(one[0], other[0]) - 1e-9
    assert np.all(np.diff(found["s_low"]) >= 0.0)


def test_the_reach_of_pieces_never_falls_short_of_any_before() -> None:
    street = Street((straight(3.0), straight(-2.0, first=20.0, last=60.0, left=False)), 100.0, False, EAST).pieces(0.0, 100.0)
    assert all(street.reach[i] == np.max(street.pieces["s_high"][: i + 1]) for i in range(len(street.pieces)))


def test_every_piece_is_in_one_block_of_its_kerb_as_it_is() -> None:
    kerbs = straight(3.0), replace(straight(-2.0, first=20.0, last=60.0, left=False), wheels=True), straight(5.0, first=30.0, goes_on=False)
    x = np.arange(0.0, 100.0, 0.7)
    bent = Kerb(np.stack([x, 4.0 + np.sin(x)], axis=1), x, left=True)
    street = Street((*kerbs, bent), 100.0, False, EAST).pieces(0.0, 100.0)
    seen = []
    for block in street.blocks:
        numbers = block["numbers"][: block["count"]]
        own = street.pieces[numbers]
        assert np.all(np.diff(numbers) > 0)
        for name in ("x", "y", "cos", "sin", "length"):
            np.testing.assert_array_equal(block[name], np.append(own[name], np.full(len(block[name]) - len(own), own[name][-1])))
        for name in ("kerb", "left", "wheels"):
            assert np.all(own[name] == block[name])
        assert (block["s_low"], block["s_high"]) == (np.min(own["s_low"]), np.max(own["s_high"]))
        assert [block["corners"] >> place & 1 for place in range(16)] == [*own["corner"], *np.zeros(16 - len(own))]
        seen += list(numbers)
    assert sorted(seen) == list(range(len(street.pieces)))
    assert np.all(np.diff(street.blocks["s_low"]) >= 0.0)
    np.testing.assert_array_equal(street.block_reach, np.maximum.accumulate(street.blocks["s_high"]))


def test_an_open_road_s_kerb_goes_on_straight_but_one_of_several_does_not() -> None:
    on, short = straight(3.0), straight(5.0, first=20.0, last=60.0, goes_on=False)
    begin, end = ends_of(pieces(on, short))
    places = np.vstack([begin, end])
    own, other = places[places[:, 1] == 3.0], places[places[:, 1] == 5.0]
    assert own[:, 0].min() < -500.0
    assert own[:, 0].max() > 600.0
    assert (other[:, 0].min(), other[:, 0].max()) == (20.0, 60.0)


def test_a_kerb_goes_on_in_the_direction_of_the_line_s_end_not_its_own() -> None:
    slanted = Kerb(np.array([[0.0, 3.0], [100.0, 6.0]]), np.array([0.0, 100.0]), left=False)
    begin, end = ends_of(pieces(slanted))
    places = np.vstack([begin, end])
    assert places[np.argmax(places[:, 0]), 1] == pytest.approx(6.0)
    assert places[np.argmin(places[:, 0]), 1] == pytest.approx(3.0)


def test_beyond_the_ends_of_widths_kerbs_go_on_as_the_line_that_was_given_however_it_was_moved() -> None:
    line = np.array([[0.0, 0.0], [0.0, 10.0], [60.0, 10.0], [60.0, 0.0]])
    kerbs = smoothed(Line("bay", RawRoad(line, np.full((4, 4), 3.0)), RoadOptions()))[0].kerbs
    assert kerbs is not None
    found = kerbs.pieces(-50.0, 200.0).pieces
    far = found[found["length"] > 500.0]
    assert len(far) == 4
    np.testing.assert_allclose(far["cos"], 0.0, atol=1e-12)  # rounding


def test_the_kerb_outside_a_hairpin_is_no_wall_however_short_the_line_beside_it_is() -> None:
    path = from_curvature(np.array([0.0, 30.0, 31.0, 49.0, 50.0, 80.0]), np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0]) / 6.0)
    assert not np.any(
        Street.along(path, About.smooth(path).kerbs(Limits.constant(30.0, 30.0, path.length))).pieces(0.0, 80.0).pieces["wall"]
    )


@pytest.mark.parametrize("left", [True, False])
def test_what_protrudes_into_the_street_is_a_corner_and_what_recedes_is_none(left: bool) -> None:
    sign = 1.0 if left else -1.0
    s = np.array([0.0, 30.0, 40.0, 50.0, 100.0])
    nose = Kerb(np.stack([s, sign * np.array([3.0, 3.0, 2.0, 3.0, 3.0])], axis=1), s, left)
    found = pieces(nose)
    assert sorted(float(piece["x"]) for piece in found if piece["corner"]) == [40.0, 100.0]  # and the road's end


@pytest.mark.parametrize("left", [True, False])
def test_points_along_a_straight_kerb_are_no_corners_however_they_are_rounded(left: bool) -> None:
    along = np.linspace(0.0, 100.0, 41)
    for degrees in range(0, 90, 7):  # in some of these directions rounding turns some of the joints inwards
        way = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
        kerb = Kerb(np.array([6e5, 6.4e6]) + along[:, None] * way, along, left)
        found = Street((kerb,), 100.0, closed=False, ends=np.stack([way, way])).pieces(0.0, 100.0).pieces
        assert set(found["s_begin"][found["corner"] > 0]) <= {100.0}  # the road's end


@pytest.mark.parametrize("left", [True, False])
def test_the_direction_before_a_piece_is_that_of_its_neighbour(left: bool) -> None:
    s = np.array([0.0, 30.0, 40.0, 100.0])
    found = pieces(Kerb(np.stack([s, np.array([3.0, 3.0, 4.0, 4.0])], axis=1), s, left))
    begin, end = ends_of(found)
    firsts = 0
    for piece, at in zip(found, begin, strict=True):
        before = np.flatnonzero(np.hypot(*(end - at).T) < 1e-9)
        firsts += piece["ends"]
        if not piece["ends"]:
            (own,) = before
            assert (piece["before_cos"], piece["before_sin"]) == (found["cos"][own], found["sin"][own])
    assert firsts == 1


@pytest.mark.parametrize("left", [True, False])
@pytest.mark.parametrize("fold", [[[0.0, 0.004]], [[-0.004, 0.0005]], [[-0.003, 0.002]], [[0.0005, 0.004], [0.001, 0.0]]])
def test_a_fold_back_of_a_few_millimetres_is_no_side_of_a_kerb(left: bool, fold: list[list[float]]) -> None:
    kink = np.array([30.0, 3.0])  # the kerb turns there, and goes back on itself
    ends = [[0.0, 3.0]], [[60.0, 13.0]]
    folded, plain = (
        pieces_of([Kerb(points, points[:, 0], left)])
        for points in (np.vstack([ends[0], middle, ends[1]]) for middle in ([kink, *(kink + fold), [30.0, 3.0004]], [kink]))
    )
    s, angle = np.full(36, 30.0), np.radians(np.arange(0.0, 360.0, 10.0))
    rooms = [rooms_of(street, s, 30.0 + np.cos(angle), 3.0 + np.sin(angle))[int(not left)] for street in (folded, plain)]
    np.testing.assert_allclose(rooms[0], rooms[1], atol=0.005)  # a fold has two sides of 3 to 4 mm


def test_a_closed_road_has_every_kerb_in_every_lap_without_a_gap() -> None:
    path = ring()
    street = Street.along(path, About.smooth(path).kerbs(Limits.constant(3.0, 2.0, path.length)))
    found = street.pieces(-30.0, path.length + 30.0).pieces
    assert np.min(found["s_low"]) <= -30.0
    assert np.max(found["s_high"]) >= path.length + 30.0
    begin, end = ends_of(found)
    np.testing.assert_allclose(np.hypot(begin[:, 0], begin[:, 1] - 20.0), np.where(found["left"] == 1, 17.0, 22.0), atol=1e-3)  # chords
    for left in (0, 1):
        own = found["left"] == left
        joints = np.hypot(*(begin[own][:, None] - end[own][None]).transpose(2, 0, 1)).min(axis=1)
        assert np.max(joints[found["ends"][own] == 0]) < 1e-3  # of the seam: where the kerb's ends meet
        assert np.sum(found["ends"][own]) == 1


@pytest.mark.parametrize("curvature", [0.0, 0.05, -0.05])
def test_kerbs_beside_a_smooth_line_lie_at_its_widths_on_their_side(curvature: float) -> None:
    path = arc(curvature, 60.0)
    limits = Limits(np.array([0.0, 60.0]), np.array([3.0, 4.0]), -np.array([2.0, 2.5]), np.array([3.5, 4.5]), -np.array([2.0, 2.5]))
    kerbs = About.smooth(path).kerbs(limits)
    assert [(kerb.left, kerb.wheels) for kerb in kerbs] == [(True, False), (False, False), (True, True), (False, True)]
    for kerb in kerbs:
        assert np.all(np.diff(kerb.s) >= 0.0)
        assert (kerb.s[0], kerb.s[-1]) == pytest.approx((0.0, 60.0))
        foot, offset = path.extended(5.0, 5.0).project(kerb.points[:, 0], kerb.points[:, 1], kerb.s)
        row = limits.table(foot)[(0 if kerb.left else 1) + (0 if kerb.wheels else 2)]
        assert np.max(np.abs(offset - row)) < 2e-3  # points beside chords of 0.25 m; a width that changes by 1 in 60
        assert np.max(np.abs(foot - kerb.s)) < 0.04  # the ends lie beside a chord, which turns by 0.4 degrees from its arc's end


@pytest.mark.parametrize("curvature", [0.02, 0.06, -0.06])
@pytest.mark.parametrize("jump", [1e-6, 0.01, 0.05])
def test_a_width_that_jumps_in_a_bend_leaves_the_kerb_whole(curvature: float, jump: float) -> None:
    path = arc(curvature, 60.0)
    for place in (9.99, 10.0, 10.1, 10.24, 29.99, 30.0, 30.1, 30.24, 50.0, 50.24):
        for widths in (np.array([3.0, 3.0, 4.0, 4.0]), np.array([4.0, 4.0, 3.0, 3.0])):
            nodes = np.array([0.0, place, place + jump, 60.0])
            for kerb in About.smooth(path).kerbs(Limits(nodes, widths, -widths, widths, -widths)):
                line = shapely.LineString(kerb.points)
                for s in (1.0, 4.0, 20.0, 40.0, 57.0, 59.0):
                    x, y = path.to_plane(s, 0.0)
                    # points beside chords of 0.25 m; so far from the step nothing else is nearer
                    assert line.distance(shapely.Point(float(x), float(y))) == pytest.approx(np.interp(s, nodes, widths), abs=2e-3), (
                        place,
                        kerb.left,
                        s,
                    )


def test_widths_count_from_the_points_as_given() -> None:
    points = np.array([[0.0, 0.0], [60.0, 0.0], [60.0, 60.0]])
    about = About.given(given_line(points, closed=False), np.array([0.0, 57.0, 114.0]))  # on a path that cuts the corner
    left, right = about.kerbs(Limits.constant(3.0, 2.0, 114.0))
    np.testing.assert_allclose(left.points, [[0.0, 3.0], [57.0, 3.0], [57.0, 60.0]], atol=1e-9)  # rounding
    np.testing.assert_allclose(right.points[[0, -1]], [[0.0, -2.0], [62.0, 60.0]], atol=1e-9)
    assert shapely.LineString(right.points).distance(shapely.Point(62.0, -2.0)) < 1e-9
    assert (left.left, right.left) == (True, False)
    for kerb in (left, right):
        assert kerb.s[[0, -1]] == pytest.approx([0.0, 114.0])
        assert np.interp(57.0, kerb.s, kerb.points[:, 0]) > 56.0  # beside the corner


def test_a_kerb_is_replaced_by_parts_of_another_one_where_they_are() -> None:
    own = straight(3.0)
    parts = [
        Kerb(np.array([[a, 3.0], [a, 1.0], [b, 1.0], [b, 3.0]]), np.array([a, a, b, b]), left=True) for a, b in ((20.0, 30.0), (60.0, 70.0))
    ]
    street = Street((own,), 100.0, False, np.array([[1.0, 0.0], [1.0, 0.0]]), None)
    kerb = street.replaced(own, parts)
    assert np.all(np.diff(kerb.s) >= 0.0)
    one, other = (part.points for part in parts)
    np.testing.assert_array_equal(kerb.points, np.vstack([own.points[:1], one, own.points[1:2], other, own.points[2:]]))
    assert street.replaced(own, []) is own
    over = straight(4.0)
    assert street.replaced(own, [over]).points.tolist() == over.points.tolist()


def test_the_face_of_an_obstacle_is_a_kerb_and_only_in_planning() -> None:
    van = Region(Kind.OBSTACLE, shapely.box(40.0, 1.0, 46.0, 5.0))
    road = Road("straight", arc(0.0, 100.0), regions=(van,)).with_limits(3.0, 2.0)
    assert road.kerbs is not None
    assert road.street is not None
    *kerbs, face = road.street.kerbs
    assert tuple(kerbs) == road.kerbs.kerbs
    assert (face.left, face.wheels, face.goes_on) == (True, False, False)
    # around the van from its far side, with walls to where no body comes: 0.1 m, as it reaches over the kerb
    drawn = shapely.LineString([(40.0, 5.1), (40.0, 1.0), (46.0, 1.0), (46.0, 5.1)])
    assert shapely.hausdorff_distance(shapely.LineString(face.points), drawn) < 1e-6  # feet on a straight of quintics


def lines(kerbs: tuple[Kerb, ...], *, left: bool) -> list[Kerb]:
    return [kerb for kerb in kerbs if kerb.left is left]


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("swapped", [False, True])
def test_neither_the_order_nor_the_direction_of_drawn_lines_matters(turned: bool, swapped: bool) -> None:
    path = arc(0.0, 100.0)
    upper, lower = np.array([[-5.0, 3.0], [50.0, 4.0], [105.0, 3.0]]), np.array([[-5.0, -2.0], [105.0, -2.0]])
    edges = tuple(edge[::-1] if turned else edge for edge in ((lower, upper) if swapped else (upper, lower)))
    kerbs, _, notes = drawn_kerbs(path, edges)
    assert not notes
    ((left,), (right,)) = lines(kerbs, left=True), lines(kerbs, left=False)
    for kerb, edge in ((left, upper), (right, lower)):
        assert np.all(np.diff(kerb.s) >= 0.0)
        np.testing.assert_allclose(kerb.s, kerb.points[:, 0], atol=1e-6)  # feet on a straight of quintics
        assert shapely.hausdorff_distance(shapely.LineString(kerb.points), shapely.LineString(edge)) < 1e-9
        assert kerb.goes_on


@pytest.mark.parametrize("first", range(4))
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("beyond", [0.0, 0.8, 10.0])
def test_a_polygon_s_caps_close_the_street_but_those_that_the_line_ends_on(first: int, turned: bool, beyond: float) -> None:
    low, high = -beyond, 100.0 + beyond
    ring_ = np.roll(np.array([[low, -2.0], [high, -2.0], [high, 3.0], [low, 3.0]]), first, axis=0)
    ring_ = np.vstack([ring_, ring_[:1]])
    kerbs, _, notes = drawn_kerbs(arc(0.0, 100.0), (ring_[::-1] if turned else ring_,))
    sides, caps = [kerb for kerb in kerbs if kerb.goes_on], [kerb for kerb in kerbs if not kerb.goes_on]
    assert sorted(kerb.left for kerb in sides) == [False, True]
    for kerb in sides:
        assert np.ptp(kerb.points[:, 1]) == 0.0  # no piece of a cap
        assert (kerb.points[:, 0].min(), kerb.points[:, 0].max()) == (low, high)
    if beyond <= 1.0:
        assert not caps
        assert sorted(notes) == [f"an edge closes the street where the line {at}: it is taken as open there" for at in ("ends", "starts")]
        return
    assert sorted(notes) == [f"an edge closes the street 10.0 m {at}" for at in ("before the line starts", "beyond the end of the line")]
    for kerb in caps:
        begin, end = (place[0] for place in ends_of(pieces_of([kerb]).pieces[:1]))
        assert (end[0] - begin[0]) * (0.0 - begin[1]) - (end[1] - begin[1]) * (50.0 - begin[0]) > 0.0  # the line's middle is on the left
        assert kerb.points[0, 0] == kerb.points[-1, 0]
        assert sorted(kerb.points[[0, -1], 1]) == [-2.0, 3.0]
    assert sorted(kerb.points[0, 0] for kerb in caps) == [low, high]


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("turned", [False, True])
def test_a_kerb_round_a_side_street_inside_a_bend_is_beside_the_road_where_it_comes_back(way: float, turned: bool) -> None:
    """Feet in the side street lie far ahead: what follows it belonged to a place that a body had not reached, and was not judged."""
    path = from_curvature([0.0, 30.0, 31.0, 62.0, 63.0, 90.0], [0.0, 0.0, way / 20.0, way / 20.0, 0.0, 0.0])

    def beside(s: FloatArray) -> FloatArray:
        return np.stack(path.to_plane(s, 3.0 * way), axis=1)

    mouth = beside(np.array([31.0, 35.0]))
    ahead = np.array([0.0, 25.0 * way])  # beyond the bend's centre
    inner = np.vstack([beside(np.arange(0.0, 31.0)), mouth[:1] + ahead, mouth[1:] + ahead, beside(np.arange(35.0, 91.0))])
    outer = np.stack(path.to_plane(np.arange(0.0, 91.0), -3.0 * way), axis=1)
    kerbs, *_ = drawn_kerbs(path, (inner[::-1] if turned else inner, outer))
    (kerb,) = (kerb for kerb in kerbs if kerb.left is (way > 0.0))
    along = np.array([kerb.s[np.argmin(np.hypot(*(kerb.points - place).T))] for place in inner[33:]])
    np.testing.assert_allclose(along, np.arange(35.0, 91.0), atol=1.0)  # a quarter of the window in which kerbs are looked for
    assert np.all(np.diff(kerb.s) >= 0.0)


@pytest.mark.parametrize("kind", list(Kind))
def test_an_alley_into_an_area_inside_a_bend_leaves_what_follows_beside_its_own_place(kind: Kind) -> None:
    """As with drawn kerbs: what follows was neither planned nor, beside a sweepable area, judged."""
    path = from_curvature([0.0, 30.0, 31.0, 62.0, 63.0, 90.0], [0.0, 0.0, 0.05, 0.05, 0.0, 0.0])

    def beside(*s: float) -> FloatArray:
        return np.stack(path.to_plane(np.array(s), 3.0), axis=1)

    mouth, ahead, after = beside(31.0, 35.0), np.array([0.0, 25.0]), np.arange(35.0, 81.0)
    alley = np.stack([mouth[0], mouth[0] + ahead, mouth[1] + ahead, mouth[1]])
    block = np.vstack([beside(*np.arange(10.0, 31.0)), alley, beside(*after), [[10.0, 45.0]]])
    polygon = shapely.Polygon(block if kind is Kind.OBSTACLE else alley)
    road = Road("bend", path, regions=(Region(kind, polygon),)).with_limits(3.0, 3.0)
    assert road.bounds is not None
    kerbs = road.passed if kind is Kind.OBSTACLE else road.bounds.kerbs
    kerb = max((kerb for kerb in kerbs if kerb.left and not kerb.wheels), key=lambda kerb: len(kerb.s))
    assert shapely.distance(shapely.LineString(kerb.points), shapely.Point(mouth[1] + 0.9 * ahead)) < 0.1  # it goes round the alley
    places = np.stack(path.to_plane(after[1:26], 3.0), axis=1)
    along = np.array([kerb.s[len(kerb.s) - 1 - np.argmin(np.hypot(*(kerb.points[::-1] - place).T))] for place in places])
    np.testing.assert_allclose(along, after[1:26], atol=1.5)  # points of the kerb of a width stand up to a metre apart
    assert np.all(np.diff(kerb.s) >= 0.0)


@pytest.mark.parametrize("turned", [False, True])
def test_a_kerb_from_one_side_street_to_another_inside_a_bend_is_directed_as_the_road_is(turned: bool) -> None:
    """The outline of a block: feet of its first places lie beyond those of its last ones."""
    path = from_curvature([0.0, 30.0, 31.0, 62.0, 63.0, 90.0], [0.0, 0.0, 0.05, 0.05, 0.0, 0.0])
    x, y = path.to_plane(np.arange(33.0, 61.0), 3.0)
    corner = np.stack([x, y], axis=1)
    edge = np.vstack([corner[:1] + np.array([0.0, 26.0]), corner, corner[-1:] - np.array([26.0, 0.0])])
    outer = np.stack(path.to_plane(np.arange(0.0, 91.0), -3.0), axis=1)
    kerbs, *_ = drawn_kerbs(path, (edge[::-1] if turned else edge, outer))
    (kerb,) = (kerb for kerb in kerbs if kerb.left)
    first, last = (int(np.argmin(np.hypot(*(kerb.points - corner[end]).T))) for end in (0, -1))
    assert first < last
    np.testing.assert_allclose(kerb.s[[first, last]], [33.0, 60.0], atol=1.0)  # as above


OPEN_THERE = [f"an edge closes the street where the line {at}: it is taken as open there" for at in ("ends", "starts")]


def at_roundabout(turn: float) -> ReferencePath:
    """Return a line through a roundabout that comes eastwards, and goes on so many degrees to its left."""
    arcs = np.radians([-45.0, turn + 90.0, -45.0]) * [-15.0, 12.0, -15.0]
    begins = np.cumsum([40.0, *arcs])
    knots = np.sort(np.concatenate([begins - 0.5, begins + 0.5]))
    curvature = np.repeat([0.0, -1.0 / 15.0, 1.0 / 12.0, -1.0 / 15.0, 0.0], 2)
    return from_curvature([0.0, *knots, begins[-1] + 40.0], curvature)


@pytest.mark.parametrize("turned", [1, -1])
@pytest.mark.parametrize("first", [None, *range(0, 140, 20)])
def test_a_kerb_between_the_arms_that_a_turn_at_a_roundabout_comes_from_and_goes_to_is_beside_both(first: int | None, turned: int) -> None:
    """It was beside the first of them alone: the street was refused as closed, or the other arm had no kerb."""
    path = at_roundabout(90.0)
    (x, y), right = np.stack(path.to_plane(path.length, 0.0)), np.stack(path.to_plane(np.arange(path.length), -3.0), axis=1)
    ends = np.stack(path.to_plane(path.length, np.array([-3.0, 7.0])), axis=1)
    corner = np.array([[0.0, 7.0], [x - 7.0, 7.0], ends[1]])
    around = np.vstack([right, ends[:1], corner[::-1]])
    outline = np.roll(around, -(first or 0), axis=0)
    drawn = (corner, np.vstack([right, ends[:1]])) if first is None else (np.vstack([outline, outline[:1]]),)
    kerbs, bridges, notes = drawn_kerbs(path, tuple(edge[::turned] for edge in drawn))
    assert not bridges
    assert sorted(notes) == ([] if first is None else OPEN_THERE)
    (left,) = (kerb for kerb in kerbs if kerb.left)
    assert shapely.hausdorff_distance(shapely.LineString(left.points), shapely.LineString(corner)) < 1e-9
    comes, goes = left.points[:, 0] <= 30.0, left.points[:, 1] >= y - 30.0
    np.testing.assert_allclose(left.s[comes], left.points[comes, 0], atol=1e-6)
    np.testing.assert_allclose(left.s[goes], path.length - y + left.points[goes, 1], atol=1e-6)


@pytest.mark.parametrize("turned", [1, -1])
@pytest.mark.parametrize("first", range(0, 160, 20))
def test_the_outline_around_a_u_turn_is_its_right_kerb_and_open_at_both_ends(first: int, turned: int) -> None:
    path = at_roundabout(180.0)
    around = np.stack(path.to_plane(np.append(np.arange(path.length), path.length), -3.0), axis=1)
    outline = np.roll(around, -first, axis=0)
    kerbs, _, notes = drawn_kerbs(path, (np.vstack([outline, outline[:1]])[::turned],))
    assert sorted(notes) == [*OPEN_THERE, "no edge on the left: it is open to 20 m"]
    (right,) = (kerb for kerb in kerbs if not kerb.left)
    assert shapely.hausdorff_distance(shapely.LineString(right.points), shapely.LineString(around)) < 1e-9


def test_over_a_gap_a_kerb_is_straight_and_it_is_told() -> None:
    upper = (np.array([[-5.0, 3.0], [30.0, 3.0]]), np.array([[40.0, 4.0], [105.0, 4.0]]))
    kerbs, (bridge,), notes = drawn_kerbs(arc(0.0, 100.0), (*upper, np.array([[-5.0, -2.0], [105.0, -2.0]])))
    (left,) = lines(kerbs, left=True)
    np.testing.assert_array_equal(bridge, [[30.0, 3.0], [40.0, 4.0]])
    assert shapely.LineString(left.points).distance(shapely.Point(35.0, 3.5)) < 1e-9
    where = "from s = 30.0 to 40.0 m, x 30.0, y 3.0 to x 40.0, y 4.0"
    assert notes == (f"no edge on the left for 10.0 m {where}: it is straight there; if not so, draw it",)


@pytest.mark.parametrize(("begin", "end"), [(30.0, 105.0), (10.0, 85.0)])  # with the seam in what is drawn, or in the gap
def test_a_gap_in_the_kerb_around_a_closed_road_is_bridged_and_told(begin: float, end: float) -> None:
    path = ring(100.0 / (2.0 * np.pi))
    drawn = np.stack(path.extended(0.0, 20.0).to_plane(np.arange(begin, end + 1.0), 3.0), axis=1)
    around = np.stack(path.to_plane(np.linspace(0.0, 100.0, 101), -3.0), axis=1)
    _, (bridge,), (note,) = drawn_kerbs(path, (drawn, around))
    np.testing.assert_allclose(bridge, [drawn[-1], drawn[0]], atol=1e-9)
    assert f"from s = {end % 100.0:.1f} to {begin:.1f} m, " in note


@pytest.mark.parametrize("turned", [False, True])
def test_kerbs_of_a_side_street_are_joined_at_its_mouth_and_at_its_end_however_they_are_drawn(turned: bool) -> None:
    """The wall went from one corner of the mouth to the far end of the arm, and nothing told it."""
    stem, near, bar = [[0.0, 3.5], [54.0, 3.5]], [[60.0, 40.0], [60.0, 9.0]], [[67.0, 40.0], [67.0, -90.0]]
    path = from_curvature([0.0, 52.0, 54.0, 68.0, 70.0, 140.0], [0.0, 0.0, -0.0982, -0.0982, 0.0, 0.0])
    edges = (np.array(bar), np.array(near[::-1] if turned else near), np.array(stem))
    kerbs, bridges, notes = drawn_kerbs(path, edges)
    (left,) = (kerb for kerb in kerbs if kerb.left)
    assert left.goes_on
    assert np.all(np.diff(left.s) >= 0.0)
    assert shapely.hausdorff_distance(shapely.LineString(left.points), shapely.LineString([*stem, *near[::-1], *bar])) < 1e-9
    np.testing.assert_array_equal(bridges[:2], [[stem[1], near[1]], [near[0], bar[0]]])
    assert [note.split(" m ")[0] for note in notes[:2]] == ["no edge on the left for 8.1", "no edge on the left for 7.0"]


@pytest.mark.parametrize("turned", [1, -1])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_piece_that_ends_just_within_the_road_is_a_kerb_however_it_is_drawn(turned: int, way: float) -> None:
    """One of its points lay beside the road: drawn backwards it had the street on its other side, and 5 m were lacking."""
    ends = np.array([(-5.0, 99.0), (99.5, 108.0)]) if way > 0.0 else np.array([(1.0, 105.0), (-8.0, 0.5)])
    right = [np.array([[begin, -2.0], [end, -2.0]])[::step] for (begin, end), step in zip(ends, (1, turned), strict=True)]
    kerbs, *_ = drawn_kerbs(arc(0.0, 100.0), (np.array([[-5.0, 3.0], [105.0, 3.0]]), *right))
    (kerb,) = (kerb for kerb in kerbs if not kerb.left)
    assert np.all(np.diff(kerb.points[:, 0]) >= 0.0)


def test_a_kerb_goes_on_from_the_one_before_it_and_not_from_a_lay_by() -> None:
    pieces = [[-5.0, 4.0], [50.0, 4.0]], [[30.0, 2.5], [45.0, 2.5]], [[50.0, 4.0], [105.0, 4.0]]
    _, bridges, _ = drawn_kerbs(arc(0.0, 100.0), (*map(np.array, pieces), np.array([[-5.0, -2.0], [105.0, -2.0]])))
    assert bridges == ()


def test_two_walls_beside_a_whole_kerb_are_no_kerb_of_their_own() -> None:
    """The straight between them was a kerb across the street of a bend."""
    s = np.arange(0.0, 70.1, 0.5)
    edges = [np.stack(BEND.to_plane(s, offset), axis=1) for offset in (4.0, -4.0)]
    walls = [np.stack(BEND.to_plane(np.array(along), np.array([-3.0, -2.0])), axis=1) for along in ([10.0, 12.0], [50.0, 51.0])]
    kerbs, bridges, _ = drawn_kerbs(BEND, (*edges, *walls))
    assert bridges == ()
    assert [kerb.goes_on for kerb in lines(kerbs, left=False)] == [True, False, False]


SLIVERS = [
    [(49.7, 3.1), (51.9, 3.6), (57.2, 3.2)],
    [(50.0, 2.5), (51.0, 8.9), (51.0, 6.6)],
    [(50.0, 2.0), (46.0, 3.0), (44.0, 8.0), (43.0, 9.0)],
]


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("turned", [1, -1])
@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("corners", SLIVERS)
def test_a_closed_edge_beside_a_bend_bounds_what_is_beside_it_from_outside(
    corners: list[tuple[float, float]], way: float, turned: int, closed: bool
) -> None:
    """Past it, or where its sides run alike, only one behind it was seen, and lacked metres."""
    path = replace(arc(0.05, 40.0 * np.pi), closed=True) if closed else BEND
    s, aside = np.array([*corners, corners[0]])[::turned].T
    drawn = np.stack(path.to_plane(s, way * aside), axis=1)
    along = np.linspace(0.0, path.length, 200)
    edges = [np.stack(path.to_plane(along, offset), axis=1) for offset in (10.0, -10.0)]
    kerbs = tuple(kerb for kerb in drawn_kerbs(path, (*edges, drawn))[0] if not kerb.goes_on)
    middle = np.stack(path.to_plane(along, 0.0))
    room = rooms_of(Street.along(path, kerbs).pieces(-20.0, 120.0), along, *middle)[int(way < 0.0)]
    seen = np.isfinite(room)
    assert np.count_nonzero(seen) > 10
    np.testing.assert_allclose(room[seen], shapely.distance(shapely.points(middle.T[seen]), shapely.LineString(drawn)), atol=1e-6)


def test_a_side_without_any_edge_is_open_and_told() -> None:
    kerbs, (undrawn,), notes = drawn_kerbs(arc(0.0, 100.0), (np.array([[-5.0, 3.0], [105.0, 3.0]]),))
    np.testing.assert_allclose(undrawn[:, 1], -20.0)  # drawings show it as such
    assert notes == ("no edge on the right: it is open to 20 m",)
    (right,) = lines(kerbs, left=False)
    np.testing.assert_allclose(right.points[:, 1], -20.0, atol=1e-6)  # a straight of quintics


def test_lines_beside_each_other_are_kerbs_each() -> None:
    inner, outer = np.array([[30.0, 2.5], [60.0, 2.5]]), np.array([[-5.0, 4.0], [105.0, 4.0]])
    kerbs, *_ = drawn_kerbs(arc(0.0, 100.0), (outer, inner, np.array([[-5.0, -2.0], [105.0, -2.0]])))
    wide, short = sorted(lines(kerbs, left=True), key=lambda kerb: kerb.s[0])
    assert shapely.hausdorff_distance(shapely.LineString(wide.points), shapely.LineString(outer)) < 1e-9  # rounding
    assert shapely.hausdorff_distance(shapely.LineString(short.points), shapely.LineString(inner)) < 1e-9
    assert not short.goes_on


def test_the_outer_of_two_lines_goes_on_beyond_the_road() -> None:
    """A short line beside a long one, such as that of a lay-by, does not open the street at its ends."""
    inner, outer = np.array([[30.0, 2.5], [60.0, 2.5]]), np.array([[0.0, 4.0], [100.0, 4.0]])
    kerbs, *_ = drawn_kerbs(arc(0.0, 100.0), (outer, inner, np.array([[0.0, -2.0], [100.0, -2.0]])))
    street = Street.along(arc(0.0, 100.0), kerbs).pieces(0.0, 100.0).pieces
    begin, end = ends_of(street[street["left"] == 1])
    assert max(begin[:, 0].max(), end[:, 0].max()) > 110.0


def test_edges_beyond_the_ends_belong_to_the_street() -> None:
    upper = np.array([[-20.0, 3.0], [-3.0, 3.0], [-2.0, 1.0], [-1.0, 3.0], [102.0, 3.0], [104.0, 1.0], [120.0, 3.0]])
    kerbs, *_ = drawn_kerbs(arc(0.0, 100.0), (upper, upper * [1.0, -1.0]))
    for kerb in kerbs:
        line = shapely.LineString(kerb.points)
        for x in (-2.0, 104.0):
            assert line.distance(shapely.Point(x, 1.0 if kerb.left else -1.0)) < 1e-9
        assert np.interp(104.0, kerb.s, np.abs(kerb.points[:, 1])) == pytest.approx(1.0, abs=1e-6)  # its place of the line


@pytest.mark.parametrize("begin", [0.0, 1.0, 6.0])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_line_on_an_island_of_a_closed_road_is_a_kerb_there_alone_also_over_the_seam(begin: float, way: float) -> None:
    def circle(radius: float, first: float, last: float) -> FloatArray:
        angle = way * np.linspace(first, last, 241)
        return np.stack([radius * np.sin(angle), 20.0 - radius * np.cos(angle)], axis=1)

    path, full = ring(), 2.0 * np.pi
    kerbs, _, notes = drawn_kerbs(path, (circle(17.0, begin, begin + full), circle(19.0, -0.2, 0.3), circle(22.5, begin, begin + full)))
    assert not notes
    assert all(kerb.s[0] >= 0.0 and kerb.s[-1] <= path.length for kerb in kerbs)
    found = Street.along(path, kerbs).pieces(-path.length, 2.0 * path.length).pieces
    at = np.stack(ends_of(found)).mean(axis=0)
    radius, angle = np.hypot(at[:, 0], at[:, 1] - 20.0), way * np.arctan2(at[:, 0], 20.0 - at[:, 1])
    island = np.abs(radius - 19.0) < 0.01
    np.testing.assert_allclose(radius[~island], np.where(found["left"][~island] == 1, 17.0, 22.5), atol=0.01)  # chords of 0.6 m
    assert np.all(found["left"][island] == 1)
    assert (angle[island].min(), angle[island].max()) == pytest.approx((-0.2, 0.3), abs=0.01)
    assert np.sum(found["length"][island]) == pytest.approx(3 * 0.5 * 19.0, abs=1e-3)  # in three laps; chords


def test_the_edges_of_a_road_that_crosses_itself_follow_their_own_arm() -> None:
    path = from_curvature(np.array([0.0, 60.0, 60.1, 60.1 + 18.0 * np.pi, 60.2 + 18.0 * np.pi, 180.0]),
                          np.array([0.0, 0.0, 1.0 / 12.0, 1.0 / 12.0, 0.0, 0.0]))  # fmt: skip
    s = np.linspace(0.0, 180.0, 181)
    edges = tuple(np.stack(path.to_plane(s, offset), axis=1) for offset in (3.0, -3.0))
    kerbs, _, notes = drawn_kerbs(path, edges)
    assert not notes
    assert sorted(kerb.left for kerb in kerbs) == [False, True]
    for kerb in kerbs:
        own = edges[0] if kerb.left else edges[1]
        assert (
            shapely.hausdorff_distance(shapely.LineString(kerb.points), shapely.LineString(own)) < 1e-6
        )  # the same points and some between
        foot, _ = path.extended(5.0, 5.0).project(kerb.points[:, 0], kerb.points[:, 1], kerb.s)
        np.testing.assert_allclose(kerb.s, foot, atol=1e-6)
        np.testing.assert_allclose([kerb.s[0], kerb.s[-1]], [0.0, 180.0], atol=0.01)


LAP = 120.0


@st.composite
def kerbs_of_closed_roads(draw: st.DrawFn) -> Kerb:
    """Return a kerb of a closed road, all around or along a part of the lap."""
    goes_on = draw(st.booleans())
    nodes = sorted(draw(st.lists(st.integers(0, 60), min_size=3, max_size=8, unique=True)))
    s = LAP / 60.0 * np.array([0, *nodes[1:-1], 60] if goes_on else nodes)
    angle, radius = 2.0 * np.pi * s / LAP, 20.0 + np.sin(4.0 * np.pi * s / LAP)
    return Kerb(np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1), s, left=True, goes_on=goes_on)


@pytest.mark.slow
@example(kerb=Kerb(np.array([[20.0, 0.0], [19.96, 4.243], [20.0, 0.0]]), np.array([0.0, 4.0, LAP]), left=True), begin=1.0, length=3.00001)
@given(kerb=kerbs_of_closed_roads(), begin=st.floats(-2.0 * LAP, LAP), length=st.floats(1.0, LAP - 1.0))
def test_a_kerb_with_a_part_of_it_put_back_is_the_same_kerb_also_over_the_seam(kerb: Kerb, begin: float, length: float) -> None:
    street = Street((kerb,), LAP, True, EAST)
    part = street.part(kerb, begin, begin + length)
    laps = LAP * np.arange(-3.0, 4.0)
    beside = np.minimum(kerb.s[-1] + laps, begin + length) - np.maximum(kerb.s[0] + laps, begin)
    assume(np.min(np.abs(beside)) > 1e-6)  # rounding
    assert (len(part.s) > 0) == bool(np.any(beside > 0.0))
    if np.sum(beside > 0.0) == 1:  # points nearer than 1 um are one, at either end
        near = 2e-6 * np.max(np.diff(kerb.s) / np.hypot(*np.diff(kerb.points, axis=0).T))
        assert np.ptp(part.s) == pytest.approx(np.max(beside), abs=near)
    thirds = [street.part(kerb, begin + share * length, begin + (share + 1.0 / 3.0) * length) for share in (0.0, 2.0 / 3.0)]
    for back in (street.replaced(kerb, [part]), street.replaced(kerb, thirds)):
        assert np.all(np.diff(back.s) >= 0.0)
        np.testing.assert_allclose(back.s[[0, -1]], kerb.s[[0, -1]])
        for one, other in ((kerb, back), (back, kerb)):
            for axis in (0, 1):
                np.testing.assert_allclose(np.interp(one.s, other.s, other.points[:, axis]), one.points[:, axis], atol=1e-9)  # rounding


def test_the_kerb_inside_a_ring_that_its_width_fills_bounds_nothing() -> None:
    path = ring(5.0)
    street = Street.along(path, About.smooth(path).kerbs(Limits.constant(6.0, 3.0, path.length)))
    assert not np.any(street.pieces(-path.length, 2.0 * path.length).pieces["left"])


def test_edges_far_from_everywhere_are_refused_rather_than_an_open_street() -> None:
    """As a file has them whose edges have their coordinates swapped."""
    far = np.array([[0.0, 5.0e6], [100.0, 5.0e6]])
    with pytest.raises(RoadError, match="the edges lie 5000 km from the road") as refused:
        drawn_kerbs(arc(0.0, 100.0), (far,))
    assert "coordinates swapped" in (refused.value.hint or "")
    *_, notes = drawn_kerbs(arc(0.0, 100.0), (far, np.array([[0.0, 3.0], [100.0, 3.0]])))  # some are of another street
    assert notes == ("no edge on the right: it is open to 20 m",)
