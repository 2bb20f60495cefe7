"""Kerbs: what parallel lines beside a line enclose, corners, loops, steps and all."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.arrays import BoolArray, FloatArray
from hdvplan.road.kerbs import Parallel, kerb_of

CHORD_M = 1e-3  # points of a kerb are left out where they move it by less


def street(*points: tuple[float, float]) -> tuple[FloatArray, FloatArray, BoolArray]:
    line = np.array(points, dtype=float)
    sharp = np.ones(len(line), dtype=bool)
    sharp[[0, -1]] = False
    return line, np.arange(len(line), dtype=float), sharp


def side(line: tuple[FloatArray, FloatArray, BoolArray], width: float, *, closed: bool = False, corner_radius: float = 0.0) -> Parallel:
    (kerb,) = kerb_of(*line, np.full(len(line[0]), width), closed=closed, corner_radius=corner_radius)
    return kerb


def dense(path: FloatArray, spacing: float) -> tuple[FloatArray, FloatArray, BoolArray]:
    line = shapely.segmentize(shapely.LineString(path), spacing)
    points = shapely.get_coordinates(line)
    return points, np.arange(len(points), dtype=float), np.zeros(len(points), dtype=bool)


def test_kerbs_of_a_right_angle_are_parallel_lines_with_a_corner_inside_and_the_mitre_outside() -> None:
    line = street((0.0, 0.0), (40.0, 0.0), (40.0, 40.0))
    left, right = side(line, 3.0), side(line, -4.0)
    np.testing.assert_allclose(left.points, [[0.0, 3.0], [37.0, 3.0], [37.0, 40.0]], atol=1e-9)  # rounding
    np.testing.assert_allclose(left.number, [0.0, 1.0, 2.0])
    np.testing.assert_allclose(right.points, [[0.0, -4.0], [44.0, -4.0], [44.0, 40.0]], atol=1e-9)
    np.testing.assert_allclose(right.number, [0.0, 1.0, 2.0])


def test_a_mitre_longer_than_twice_the_width_is_cut_square_there() -> None:
    turn = math.radians(150.0)
    corner = np.array([40.0, 0.0])
    kerb = side(street((0.0, 0.0), (40.0, 0.0), (40.0 + 40.0 * math.cos(turn), 40.0 * math.sin(turn))), -3.0)
    out = np.array([math.cos(0.5 * turn - 0.5 * math.pi), math.sin(0.5 * turn - 0.5 * math.pi)])
    furthest = (kerb.points - corner) @ out
    assert np.sum(furthest > 6.0 - 1e-9) == 2  # rounding; the two ends of the cut
    assert np.max(furthest) < 6.0 + 1e-9  # rounding


def quads(points: FloatArray, reach: FloatArray) -> shapely.Geometry:
    """Return what lies between a polyline and its offsets, with the wedges at the outside of corners."""
    parts = []
    unit = np.diff(points, axis=0) / np.hypot(*np.diff(points, axis=0).T)[:, None]
    normal = np.stack([-unit[:, 1], unit[:, 0]], axis=1)
    for i in range(len(unit)):
        a, b = points[i], points[i + 1]
        parts.append(shapely.Polygon([a, b, b + reach[i + 1] * normal[i], a + reach[i] * normal[i]]))
    for i in range(1, len(unit)):
        turn = math.atan2(unit[i - 1, 0] * unit[i, 1] - unit[i - 1, 1] * unit[i, 0], float(unit[i - 1] @ unit[i]))
        if turn * reach[i] < 0.0:
            out = normal[i - 1] + normal[i]
            mitre = points[i] + reach[i] * out / (1.0 + float(normal[i - 1] @ normal[i]))
            parts.append(shapely.Polygon([points[i], points[i] + reach[i] * normal[i - 1], mitre, points[i] + reach[i] * normal[i]]))
    return shapely.union_all([shapely.make_valid(part) for part in parts])


@given(
    turns=st.lists(st.tuples(st.floats(35.0, 100.0), st.sampled_from([-1, 1])), min_size=1, max_size=3),
    legs=st.lists(st.floats(15.0, 40.0), min_size=4, max_size=4),
    widths=st.lists(st.floats(1.5, 6.0), min_size=5, max_size=5),
    sign=st.sampled_from([-1.0, 1.0]),
)
def test_kerbs_of_corners_bound_the_union_of_what_lies_between_line_and_offsets(
    turns: list[tuple[float, int]], legs: list[float], widths: list[float], sign: float
) -> None:
    heading = np.cumsum([0.0, *(math.radians(angle) * way for angle, way in turns)])
    steps = np.array(legs[: len(heading)])[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    points = np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)])
    reach = sign * np.array(widths[: len(points)])
    (kerb,) = kerb_of(*street(*map(tuple, points)), reach, closed=False)
    assert np.all(np.diff(kerb.number) >= 0.0)
    line, own = shapely.LineString(points), shapely.LineString(kerb.points)
    enclosed = shapely.Polygon(np.vstack([points, kerb.points[::-1]]))
    if not (line.is_simple and own.is_simple and enclosed.is_valid) or own.intersects(line):
        return  # an arm crosses or comes close to another one: each keeps its own kerbs
    beyond = quads(points, -reach)  # inside a corner of more than 90 degrees one leg's width reaches over the other leg
    apart = shapely.symmetric_difference(enclosed, quads(points, reach), grid_size=1e-9)  # without it GEOS fails at some corners
    apart = shapely.difference(apart, beyond, grid_size=1e-9)
    assert shapely.area(apart.buffer(-CHORD_M)) == 0.0


def test_legs_shorter_than_the_width_are_cut_with_the_loop() -> None:
    line = street((0.0, 0.0), (40.0, 0.0), (41.0, 1.0), (41.0, 41.0))
    kerb = side(line, 5.0)
    np.testing.assert_allclose(kerb.points, [[0.0, 5.0], [36.0, 5.0], [36.0, 41.0]], atol=1e-9)  # rounding
    np.testing.assert_allclose(kerb.number, [0.0, 1.5, 3.0])


def test_a_hairpin_tighter_than_the_width_has_a_kerb_where_its_legs_kerbs_cross() -> None:
    angle = np.linspace(0.0, math.radians(150.0), 200)
    arc = 4.0 * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=1)
    leg = arc[-1] + 60.0 * np.array([math.cos(angle[-1]), math.sin(angle[-1])])
    kerb = side(dense(np.vstack([[-60.0, 0.0], arc, leg]), 0.5), 7.0)
    crossing = np.array([0.0, 4.0]) + 3.0 / math.cos(math.radians(75.0)) * np.array(
        [-math.sin(math.radians(75.0)), math.cos(math.radians(75.0))]
    )
    assert np.min(np.hypot(*(kerb.points - crossing).T)) < 1e-3  # the arc's points are 5 cm apart: its chords sag 0.1 mm
    assert shapely.LineString(kerb.points).is_simple
    assert len(kerb.points) == 3


def test_a_road_that_crosses_itself_keeps_the_kerbs_of_both_arms() -> None:
    angle = np.linspace(-0.5 * math.pi, math.pi, 400)
    arc = 12.0 * np.stack([np.cos(angle), 1.0 + np.sin(angle)], axis=1)
    line = dense(np.vstack([[-60.0, 0.0], arc, [-12.0, -50.0]]), 0.5)
    for width in (3.0, -3.0):
        kerb = shapely.LineString(side(line, width).points)
        true = shapely.LineString(
            np.vstack([[-60.0, width], (1.0 - width / 12.0) * (arc - [0.0, 12.0]) + [0.0, 12.0], [width - 12.0, -50.0]])
        )
        assert shapely.hausdorff_distance(kerb, true) < 1e-3  # the arc's points are 14 cm apart: its chords sag 0.2 mm
        assert not kerb.is_simple


def test_the_kerbs_of_a_closed_circle_are_circles() -> None:
    angle = np.linspace(0.0, 2.0 * math.pi, 401)
    line = 15.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    line[-1] = line[0]
    for width in (3.0, -3.0):
        (kerb,) = kerb_of(line, np.linspace(0.0, 8.0, 401), np.zeros(401, dtype=bool), np.full(401, width), closed=True)
        np.testing.assert_allclose(kerb.points[0], kerb.points[-1])
        assert (kerb.number[0], kerb.number[-1]) == (0.0, 8.0)
        assert np.all(np.diff(kerb.number) >= 0.0)
        outline = shapely.get_coordinates(shapely.segmentize(shapely.LineString(kerb.points), 0.1))
        np.testing.assert_allclose(np.hypot(*outline.T), 15.0 - width, atol=3e-3)


@pytest.mark.parametrize("first", range(4))
def test_the_kerbs_of_a_closed_square_have_its_corners_wherever_it_begins(first: int) -> None:
    corners = np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0]])
    line = np.vstack([np.roll(corners, -first, axis=0), corners[first]])
    for width, edge in ((3.0, 34.0), (-3.0, 46.0)):
        (kerb,) = kerb_of(line, np.arange(5.0), np.ones(5, dtype=bool), np.full(5, width), closed=True)
        np.testing.assert_allclose(kerb.points[0], kerb.points[-1], atol=1e-9)  # rounding
        np.testing.assert_allclose([kerb.number[0], kerb.number[-1]], [0.0, 4.0])
        polygon = shapely.Polygon(kerb.points)
        assert polygon.is_valid
        assert polygon.area == pytest.approx(edge**2)
        assert polygon.length == pytest.approx(4.0 * edge)


def test_a_kerb_inside_a_corner_is_rounded_with_the_radius_told() -> None:
    kerb = side(street((0.0, 0.0), (40.0, 0.0), (40.0, 40.0)), 3.0, corner_radius=6.0)
    arc = kerb.points[1:-1]
    np.testing.assert_allclose(np.hypot(*(arc - [31.0, 9.0]).T), 6.0, atol=1e-6)  # points of the arc itself, rounding
    np.testing.assert_allclose(arc[[0, -1]], [[31.0, 3.0], [37.0, 9.0]], atol=1e-6)
    assert np.all(np.diff(kerb.number) >= 0.0)
    np.testing.assert_allclose(side(street((0.0, 0.0), (40.0, 0.0), (40.0, 40.0)), -3.0, corner_radius=6.0).points[1], [43.0, -3.0])


def test_a_kerb_is_rounded_only_as_far_as_its_shorter_leg_allows() -> None:
    kerb = side(street((0.0, 0.0), (40.0, 0.0), (40.0, 7.0)), 3.0, corner_radius=6.0)
    np.testing.assert_allclose(kerb.points[1], [33.0, 3.0], atol=6e-3)  # the radius, 4 m, is found to a thousandth of 6 m


def test_a_point_that_is_given_twice_in_a_bend_leaves_the_kerb_as_it_is() -> None:
    angle = np.linspace(0.0, 1.0, 41)
    line, number = 20.0 * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=1), np.arange(41.0)
    twice = np.sort(np.append(np.arange(41), 17))
    for reach in (3.0, -3.0):
        (once,), (again,) = (
            kerb_of(line[at], number[at], np.zeros(len(at), bool), np.full(len(at), reach), closed=False) for at in (np.arange(41), twice)
        )
        np.testing.assert_array_equal(again.points, once.points)


def hairpin(leg: float, radius: float) -> FloatArray:
    """Return a straight, a half turn to the left and a straight back."""
    angle = np.linspace(0.0, math.pi, 65)
    turn = np.stack([leg + radius * np.sin(angle), radius * (1.0 - np.cos(angle))], axis=1)
    return np.vstack([[0.0, 0.0], turn, [0.0, 2.0 * radius]])


def test_a_street_wider_than_its_half_turn_has_no_kerb_inside_as_far_as_its_arms_are_looked_at_together() -> None:
    short, long = (dense(hairpin(leg, 8.0), 0.5) for leg in (60.0, 200.0))
    assert kerb_of(*short, np.full(len(short[0]), 10.0), closed=False) == []
    one, other = kerb_of(*long, np.full(len(long[0]), 10.0), closed=False)
    assert not one.whole
    assert not other.whole
    # from where it is further than 60 m, six times the width, to the turn; each beyond the road's end, for neither goes on by itself
    assert one.points[-1] == pytest.approx([140.0, 10.0], abs=0.6)
    assert other.points[0] == pytest.approx([140.0, 6.0], abs=0.6)
    assert max(one.points[0, 0], other.points[-1, 0]) == pytest.approx(-60.0)


def test_inside_a_corner_whose_last_leg_is_shorter_than_the_width_the_kerbs_meet_where_the_leg_would_go_on() -> None:
    kerb = side(street((0.0, 0.0), (40.0, 0.0), (40.0, 2.0)), 3.0)
    np.testing.assert_allclose(kerb.points[:2], [[0.0, 3.0], [37.0, 3.0]], atol=1e-9)  # rounding
    assert kerb.points[-1, 0] == pytest.approx(37.0)
    assert kerb.points[-1, 1] > 3.0


def test_between_half_turns_that_a_street_is_wider_than_the_kerb_outside_the_next_one_stays() -> None:
    angle, points = np.linspace(0.0, math.pi, 65), [np.zeros((1, 2))]
    for turn in range(4):  # to the left after the first leg, then to the right, and so on
        way, end = (1.0, 60.0) if turn % 2 == 0 else (-1.0, 0.0)
        points.append(np.stack([end + way * 6.0 * np.sin(angle), 12.0 * turn + 6.0 * (1.0 - np.cos(angle))], axis=1))
    line, number, sharp = dense(np.vstack([*points, [[60.0, 48.0]]]), 0.5)
    parts = kerb_of(line, number, sharp, np.full(len(line), 8.0), closed=False)
    assert len(parts) == 3  # two half turns to the left have no kerb inside
    assert np.min(parts[1].points[:, 0]) == pytest.approx(-14.0, abs=5e-3)  # a corner of the 64 chords lies 2 mm further out


def test_arms_between_which_a_wide_street_turns_once_around_have_kerbs_as_far_as_the_loop_that_are_not_one() -> None:
    angle = np.linspace(0.0, math.radians(350.0), 200)
    loop = np.stack([40.0 + 12.0 * np.sin(angle), 12.0 * (1.0 - np.cos(angle))], axis=1)
    line, number, sharp = dense(np.vstack([[0.0, 0.0], loop, loop[-1] + 60.0 * np.array([np.cos(angle[-1]), np.sin(angle[-1])])]), 0.5)
    for half_width in (12.0, 13.0):  # at 12 m its kerb is a point, at 13 m the arms' kerbs cross there
        one, other = kerb_of(line, number, sharp, np.full(len(line), half_width), closed=False)
        assert one.points[-1] == pytest.approx([28.0 - half_width, half_width], abs=0.3)  # where the loop's own street begins
        assert np.hypot(*(other.points[0] - [40.0, 12.0])) == pytest.approx(12.0 + half_width, abs=0.3)
