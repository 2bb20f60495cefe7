"""The line as given: points of a bend are samples of a curve, points that turn by themselves are corners."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.arrays import FloatArray
from hdvplan.road.given import GivenLine, given_line
from hdvplan.road.options import Corners

CHORD_M = 2.1e-4  # of dense points, as promised, and rounding
STEP_M = 0.002  # of the exact curves


def circle(number: int, radius: float) -> FloatArray:
    angle = np.linspace(0.0, 2.0 * math.pi, number + 1)
    points = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points[-1] = points[0]
    return points


def curve(*parts: tuple[float, float, float]) -> tuple[FloatArray, FloatArray]:
    """Return arclengths and points of parts of a length [m] whose curvature goes linearly from one value to another [1/m]."""
    curvature = np.concatenate([np.linspace(first, last, round(length / STEP_M)) for length, first, last in parts])
    heading = np.cumsum(curvature) * STEP_M - 0.5 * curvature * STEP_M
    steps = STEP_M * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    return np.linspace(0.0, STEP_M * len(steps), len(steps) + 1), np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)])


def largest_deviation(parts: list[tuple[float, float, float]], spacing: float, phase: float) -> float:
    """Return how far the line through samples of a curve is off: both ends of the straights, and points a ``spacing`` apart in between."""
    s, exact = curve(*parts)
    between = np.arange(parts[0][0] + phase * spacing, s[-1] - parts[-1][0], spacing)
    at = np.concatenate([[0.0], between, s[-1:]])
    points = np.stack([np.interp(at, s, exact[:, axis]) for axis in (0, 1)], axis=1)
    line = given_line(points, closed=False)
    assert line.corners == ()
    true = shapely.LineString(np.vstack([exact[::20], exact[-1:]]))
    shapely.prepare(true)
    return float(np.max(shapely.distance(shapely.points(line.points), true)))


def check(line: GivenLine, points: FloatArray) -> None:
    """Check what holds for every reading."""
    assert len(line.points) == len(line.number) == len(line.sharp)
    assert (line.number[0], line.number[-1]) == (0.0, len(points) - 1.0)
    assert np.all(np.diff(line.number) >= 0.0)
    here = [np.interp(np.arange(len(points)), line.number, line.points[:, axis]) for axis in (0, 1)]
    np.testing.assert_allclose(np.stack(here, axis=1), points, atol=1e-6)  # rounding of places and numbers


@pytest.mark.parametrize("number", [8, 10, 12, 24, 60])
def test_points_of_a_circle_are_read_as_the_circle(number: int) -> None:
    points = circle(number, 15.6)
    for line, given_points in ((given_line(points, closed=True), points), (given_line(points[:-2], closed=False), points[:-2])):
        outline = shapely.get_coordinates(shapely.segmentize(shapely.LineString(line.points), 0.02))
        np.testing.assert_allclose(np.hypot(*outline.T), 15.6, atol=CHORD_M)
        assert line.corners == ()
        assert not np.any(line.sharp)
        check(line, given_points)


bends = {
    "per_circle": st.floats(8.0, 40.0),
    "spacing": st.floats(1.0, 12.0),
    "samples": st.floats(3.5, 8.0),
    "phase": st.floats(0.0, 1.0),
    "way": st.sampled_from([-1.0, 1.0]),
}


@given(**bends)
def test_samples_of_an_arc_between_straights_are_read_as_arc_and_tangents(
    per_circle: float, spacing: float, samples: float, phase: float, way: float
) -> None:
    k = way * 2.0 * math.pi / (per_circle * spacing)
    length = min(samples, 0.7 * per_circle) * spacing
    # the exact curve has steps of 2 mm and is drawn with chords of 4 cm
    assert largest_deviation([(30.0, 0.0, 0.0), (length, k, k), (45.0, 0.0, 0.0)], spacing, phase) < 5e-3


@pytest.mark.slow
@given(**bends)
def test_samples_of_an_s_bend_of_clothoids_are_read_as_a_curve(
    per_circle: float, spacing: float, samples: float, phase: float, way: float
) -> None:
    k = way * 2.0 * math.pi / (per_circle * spacing)
    length = min(samples, 0.5 * per_circle) * spacing
    parts = [(30.0, 0.0, 0.0), (length, k, k), (length, k, -k), (length, -k, -k), (45.0, 0.0, 0.0)]
    # what a clothoid is off goes with the chord's sagitta, 1.2 m for eight points 12 m apart
    assert largest_deviation(parts, spacing, phase) < 0.005 + 0.12 * spacing * math.pi / (4.0 * per_circle)


@given(
    turns=st.lists(st.tuples(st.floats(35.0, 100.0), st.sampled_from([-1, 1])), min_size=1, max_size=5),
    legs=st.lists(st.floats(15.0, 60.0), min_size=6, max_size=6),
    between=st.sampled_from([100.0, 10.0, 7.0, 5.0]),
)
def test_corners_between_straights_are_sharp_with_and_without_points_on_the_straights(
    turns: list[tuple[float, int]], legs: list[float], between: float
) -> None:
    turn = np.array([math.radians(angle) * way for angle, way in turns])
    heading = np.cumsum([0.0, *turn])
    unit = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    corners = np.vstack([[0.0, 0.0], np.cumsum(np.array(legs[: len(unit)])[:, None] * unit, axis=0)])
    counts = [max(1, int(leg / between)) for leg in legs[: len(unit)]]
    parts = [corners[i] + np.linspace(0.0, 1.0, n, endpoint=False)[:, None] * (corners[i + 1] - corners[i]) for i, n in enumerate(counts)]
    points = np.vstack([*parts, corners[-1:]])
    line = given_line(points, closed=False)
    assert [at for at, _ in line.corners] == np.cumsum(counts)[:-1].tolist()
    np.testing.assert_allclose([angle for _, angle in line.corners], turn, atol=1e-9)  # rounding
    np.testing.assert_allclose(line.points, points, atol=1e-9)
    assert np.sum(line.sharp) == len(turns)


def test_two_corners_of_45_degrees_40_m_apart_are_corners_and_12_m_apart_a_bend() -> None:
    for leg, corners in ((40.0, [1, 2]), (12.0, [])):
        half = leg * math.sqrt(0.5)
        line = given_line(np.array([[-60.0, 0.0], [0.0, 0.0], [half, half], [half, half + 60.0]]), closed=False)
        assert [at for at, _ in line.corners] == corners


def test_a_small_kink_stays_sharp_and_is_not_told() -> None:
    line = given_line(np.array([[0.0, 0.0], [50.0, 0.0], [100.0, 9.0]]), closed=False)
    assert line.corners == ()
    assert line.sharp.tolist() == [False, True, False]


def test_a_long_straight_stays_one_before_a_bend_whose_tangent_does_not_reach_its_other_end() -> None:
    approach = np.array([[0.0, 0.0], [0.0, 38.0], [1.5, 46.0], [2.85, 51.645], [3.624, 52.244]])
    for points in (approach, approach[::-1]):
        line = given_line(points, closed=False)
        beside = line.points[line.points[:, 1] < 38.0]
        np.testing.assert_allclose(beside[:, 0], 0.0, atol=1e-9)  # rounding


@pytest.mark.parametrize("turn", [17.0, -17.0])
def test_a_point_beside_a_bend_that_turns_by_itself_stays_sharp(turn: float) -> None:
    """Roads of maps have such points; the chord between was bowed towards it by 2.7 m."""
    length, turns = 60.0, np.radians([0.0, 1.0, 1.0, turn, 0.0])
    heading = np.cumsum(turns)
    drawn = length * np.cumsum(np.vstack([[0.0, 0.0], np.stack([np.cos(heading), np.sin(heading)], axis=1)]), axis=0)
    for points in (drawn, drawn[::-1]):
        line = given_line(points, closed=False)
        away = shapely.distance(shapely.points(line.points), shapely.LineString(points))
        assert np.max(away) < length * turns[1] / 4.0  # the bend itself, which runs out beside
        assert line.points[line.sharp].tolist() == [drawn[3].tolist()]


def test_a_closed_line_may_have_its_corner_where_it_begins() -> None:
    square = np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0], [0.0, 0.0]])
    line = given_line(square, closed=True)
    assert [at for at, _ in line.corners] == [0, 1, 2, 3]
    np.testing.assert_allclose([angle for _, angle in line.corners], 0.5 * math.pi)
    assert line.sharp.tolist() == [True] * 5
    check(line, square)


def test_sharp_takes_the_polyline_and_tells_every_corner() -> None:
    points = circle(8, 15.6)
    line = given_line(points, closed=True, corners=Corners.SHARP)
    np.testing.assert_allclose(line.points, points, atol=1e-9)  # rounding
    assert [at for at, _ in line.corners] == list(range(8))


def test_round_has_no_corner_and_stays_near_the_polyline() -> None:
    points = np.array([[0.0, 0.0], [60.0, 0.0], [60.0, 50.0], [110.0, 50.0], [110.0, 62.0]])
    line = given_line(points, closed=False, corners=Corners.ROUND)
    assert line.corners == ()
    assert not np.any(line.sharp)
    check(line, points)
    assert shapely.hausdorff_distance(shapely.LineString(line.points), shapely.LineString(points)) < 1.25  # the largest sagitta of a bend
    heading = np.unwrap(np.arctan2(*np.diff(line.points, axis=0).T[::-1]))
    assert np.max(np.abs(np.diff(heading))) < 0.1  # 0.2 mm of a circle of 0.3 m


@pytest.mark.slow
@given(noise=st.lists(st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)), min_size=5, max_size=40), spacing=st.floats(1.0, 12.0))
def test_noise_stays_in_the_line_without_overshoot(noise: list[tuple[float, float]], spacing: float) -> None:
    points = np.array(noise) + spacing * np.stack([np.arange(len(noise)), np.zeros(len(noise))], axis=1)
    for corners in Corners:
        line = given_line(points, closed=False, corners=corners)
        check(line, points)
        length = np.hypot(*np.diff(points, axis=0).T)
        assert shapely.hausdorff_distance(shapely.LineString(line.points), shapely.LineString(points)) < 0.25 * np.max(length)


def test_points_in_one_place_keep_their_numbers() -> None:
    points = np.array([[0.0, 0.0], [20.0, 0.0], [20.01, 0.0], [20.0, 30.0], [20.0, 30.01]])
    line = given_line(points, closed=False)
    assert line.number.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    np.testing.assert_allclose(line.points, points, atol=0.02)  # as near as points are one
    assert [at for at, _ in line.corners] == [1]
