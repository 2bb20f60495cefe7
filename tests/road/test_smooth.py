"""The smoothing: what it leaves alone, where lines are rounded, what it bounds, and what it refuses."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError
from hdvplan.road.arcs import rounded, wrapped
from hdvplan.road.path import ReferencePath
from hdvplan.road.scenarios import roundabout, uturn
from hdvplan.road.smooth import SmoothedLine, smooth_line, smoothing_of
from hdvplan.road.splines import path_through

MAX_CURVATURE = 0.125


def smoothed(points: FloatArray, *, closed: bool = False, deviation: float = 5.0) -> SmoothedLine:
    return smooth_line(points, closed=closed, max_deviation=deviation, max_curvature=MAX_CURVATURE)


def circle(radius: float, spacing: float, angle: float) -> FloatArray:
    turned = np.linspace(0.0, angle, round(radius * angle / spacing) + 1)
    return radius * np.stack([np.cos(turned), np.sin(turned)], axis=1)


def corner(degrees: float, arm: float = 60.0) -> FloatArray:
    angle = np.deg2rad(degrees)
    return np.array([[-arm, 0.0], [0.0, 0.0], [arm * np.cos(angle), arm * np.sin(angle)]])


def samples(path: ReferencePath) -> FloatArray:
    return np.linspace(0.0, path.length, 2000)


@pytest.mark.parametrize("closed", [False, True])
def test_a_dense_circle_stays_where_it_is(closed: bool) -> None:
    points = circle(20.0, 1.0, 2.0 * np.pi if closed else 4.5)
    line = smoothed(points, closed=closed)
    curvature = line.path.at(samples(line.path)).curvature
    assert line.path.closed is closed
    assert line.smoothing.max_deviation < 1e-3  # the stations' spline represents the circle to 0.1 mm
    np.testing.assert_allclose(curvature, 1.0 / 20.0, atol=2e-4)  # R = 20 m at 1 m stations: (h k)^2/12 of 0.05
    np.testing.assert_allclose(line.path.length, points_length(points) * 1.0001, rtol=3e-4)  # arc over chord: (h k)^2/24


def points_length(points: FloatArray) -> float:
    return float(np.sum(np.hypot(*np.diff(points, axis=0).T)))


def test_clothoids_of_the_papers_move_by_less_than_a_centimetre() -> None:
    for road in (uturn(), roundabout()):
        given_points = road.path.at(np.arange(0.0, road.path.length, 1.0))
        line = smoothed(np.stack([given_points.x, given_points.y], axis=1))
        assert line.smoothing.max_deviation < 0.01  # the brief moment where a ramp begins is all that is rounded


def test_a_straight_line_with_one_far_vertex_stays_straight() -> None:
    line = smoothed(np.array([[0.0, 0.0], [727.0, 0.0], [727.011, 0.0], [1000.0, 0.0]]))
    assert line.smoothing.duplicates == 1
    assert line.smoothing.max_deviation < 1e-9  # nothing to smooth: rounding only
    assert line.smoothing.max_curvature < 1e-9


def test_an_open_road_starts_and_ends_in_the_given_points() -> None:
    points = np.array([[0.0, 0.0], [20.0, 5.0], [45.0, -4.0], [70.0, 20.0]])
    path = smoothed(points).path
    ends = path.at(np.array([0.0, path.length]))
    np.testing.assert_allclose(np.stack([ends.x, ends.y], axis=1), points[[0, -1]], atol=1e-6)  # pinned; a table's rounding


def test_a_right_angle_is_rounded_within_both_bounds() -> None:
    line = smoothed(corner(90.0))
    arms = line.path.at(np.array([5.0, line.path.length - 5.0]))
    assert line.smoothing.max_deviation < 3.0  # R = 8 m fits a right angle with 1.4 m; the smoother one takes twice that
    assert line.smoothing.max_curvature <= 1.01 * MAX_CURVATURE  # promised to 1 %
    assert abs(float(arms.y[0])) < 0.01  # 55 m before the corner the straight knows nothing of it
    assert abs(float(arms.x[1])) < 0.01


def test_a_corner_that_does_not_fit_says_where_and_how_much_it_needs() -> None:
    with pytest.raises(RoadError, match=r"corner at s = \d+ m .* radius of 8.0 m within 1.00 m; it needs") as caught:
        smoothed(corner(98.0), deviation=1.0)
    assert caught.value.s_m == pytest.approx(60.0, abs=0.1)  # the corner itself, on the given line
    hint = str(caught.value.hint)
    line = smoothed(corner(98.0), deviation=float(hint.removeprefix("--smooth ")))
    assert line.smoothing.max_curvature <= 1.01 * MAX_CURVATURE
    needed = re.search(r"needs ([\d.]+) m", str(caught.value))
    assert needed is not None
    with pytest.raises(RoadError):
        smoothed(corner(98.0), deviation=float(needed[1]) - 0.1)  # so the number is not far above the least


def test_the_least_deviation_of_a_corner_matches_elementary_geometry() -> None:
    """Without a bend outwards a circle in a corner of angle a passes its vertex at R (1/cos(a/2) - 1)."""
    inscribed = 8.0 * (1.0 / np.cos(np.deg2rad(30.0)) - 1.0)
    with pytest.raises(RoadError) as caught:
        smoothed(corner(60.0), deviation=0.3 * inscribed)
    needed = re.search(r"needs ([\d.]+) m", str(caught.value))
    assert needed is not None
    # swinging out before and after splits the error to both sides: the circle moves outwards by what it swings
    assert 0.3 * inscribed < float(needed[1]) < 0.6 * inscribed


def test_lengths_outside_the_useful_range_are_refused() -> None:
    with pytest.raises(RoadError, match=r"4\.00 m long; at least 5 m"):
        smoothed(np.array([[0.0, 0.0], [4.0, 0.0]]))
    with pytest.raises(RoadError, match="at most 200 km"):
        smoothed(np.array([[0.0, 0.0], [1e6, 0.0]]))


def test_ten_centimetres_of_noise_do_not_blow_up_the_curvature() -> None:
    rng = np.random.default_rng(1)
    x = np.arange(0.0, 200.0, 1.0)
    line = smoothed(np.stack([x, rng.normal(0.0, 0.1, len(x))], axis=1))
    assert line.smoothing.max_curvature < 0.02  # raw vertices have 0.5 1/m
    assert line.smoothing.max_deviation < 0.4  # the largest of 200 draws is 3 sigma


def test_the_arclengths_of_the_given_points_increase_and_meet_them() -> None:
    points = np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 0.01], [60.0, 10.0], [60.005, 10.0]])
    line = smoothed(points)
    foot = line.path.at(line.s_points)
    assert np.all(np.diff(line.s_points) >= 0.0)
    assert line.smoothing.duplicates == 2
    assert np.all(np.hypot(foot.x - points[:, 0], foot.y - points[:, 1]) <= line.smoothing.max_deviation + 0.02)  # 2 cm: duplicates


steps = st.lists(
    st.tuples(st.floats(0.005, 60.0), st.floats(-2.2, 2.2)),
    min_size=1,
    max_size=8,
)


@settings(suppress_health_check=[HealthCheck.too_slow])
@given(steps=steps, closed=st.booleans(), deviation=st.sampled_from([0.1, 1.0, 5.0]))
def test_any_polyline_keeps_the_promised_bounds_or_is_refused(steps: list[tuple[float, float]], closed: bool, deviation: float) -> None:
    length, turn = np.array(steps).T
    heading = np.cumsum(turn)
    points = np.vstack([[0.0, 0.0], np.cumsum(length[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)])
    if closed:
        points = np.vstack([points, points[:1]])
    try:
        line = smooth_line(points, closed=closed, max_deviation=deviation, max_curvature=MAX_CURVATURE)
    except RoadError:
        return
    assert line.smoothing.max_deviation <= deviation + 0.002  # 1 mm promised, and the final table's rounding
    assert line.smoothing.max_curvature <= 1.01 * MAX_CURVATURE  # promised to 1 %


U = np.linspace(0.0, 20.0, 81)


def pieces(turn: float, step: float, radius: float = np.inf) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a straight of 20 m and one of 20 m, or an arc, that goes on beside its end, at an angle."""
    first = np.stack([U, np.zeros(81)], axis=1)
    angle = U / radius
    second = np.stack([U, np.zeros(81)], axis=1) if np.isinf(radius) else radius * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=1)
    cos, sin = np.cos(turn), np.sin(turn)
    second = second @ np.array([[cos, sin], [-sin, cos]]) + np.array([20.0, step])
    heading = np.concatenate([np.zeros(81), turn + angle])
    return np.concatenate([first, second]), heading, np.concatenate([np.zeros(81), np.full(81, 1.0 / radius)])


def test_a_line_without_kinks_stays_as_it_is() -> None:
    points, heading, curvature = pieces(0.0, 0.0, 15.0)  # curvature may jump: the line itself does not
    assert rounded(points, heading, curvature) is points


@pytest.mark.parametrize(("turn", "step"), [(0.1, 0.0), (0.0, 0.1), (-0.05, 0.2), (0.02, 0.0)])
@pytest.mark.parametrize("radius", [np.inf, 20.0])
def test_kinks_and_gaps_are_rounded_near_them_alone(turn: float, step: float, radius: float) -> None:
    points, heading, curvature = pieces(turn, step, radius)
    line = rounded(points, heading, curvature)
    moved = np.hypot(*(line - points).T)
    far = np.abs(points[:, 0] - 20.0) > 5.0  # no rounding is longer
    assert np.max(moved[far]) == 0.0
    assert 0.0 < np.max(moved) < max(step, 10.0 * turn**2)  # a kink of 0.1 rad over 2 m to either side: some 5 cm
    dense = path_through(line, 0.125)
    assert dense is not None
    path, s = dense
    fine = path.at(np.linspace(0.0, path.length, 2000)).curvature
    assert np.max(np.abs(fine)) < 1.0 / radius + 0.13  # what a kink and a gap add at the most, together
    assert 0.5 * np.max(moved) < smoothing_of(path, points, s).max_deviation <= np.max(moved) + 1e-6  # along the normal, not to the point


def test_a_line_that_is_too_tight_is_left_to_smoothing() -> None:
    points, _, _ = pieces(0.0, 0.0, 5.0)
    assert path_through(points, 0.125) is None


def test_angles_are_wrapped_to_half_a_turn() -> None:
    np.testing.assert_allclose(wrapped(np.array([0.5, 4.0, -4.0])), [0.5, 4.0 - 2.0 * np.pi, 2.0 * np.pi - 4.0])
