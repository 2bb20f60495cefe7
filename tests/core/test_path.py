import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import fsolve

from hdvplan.arrays import FloatArray
from hdvplan.errors import ProjectionError, RoadError
from hdvplan.road.path import ReferencePath, evaluate_many, from_curvature, from_samples, project_many
from tests.core.chains import arc, differences, few, winding


def closed_circle(radius: float = 20.0, cells: int = 240) -> ReferencePath:
    angle = np.linspace(0.0, 2.0 * np.pi, cells + 1)
    spacing = 2.0 * np.pi * radius / cells
    return from_samples(
        radius * np.sin(angle), radius * (1.0 - np.cos(angle)), angle, np.full(cells + 1, 1.0 / radius), spacing, closed=True
    )


def loop() -> ReferencePath:
    """Return a road that turns left by 270 degrees and crosses its own start at a right angle."""
    turn = 1.5 * np.pi / 0.06 - 10.0
    return from_curvature(np.cumsum([0.0, 50.0, 10.0, turn, 10.0, 50.0]), np.array([0.0, 0.0, 0.06, 0.06, 0.0, 0.0]))


def foot_of(path: ReferencePath, x: float, y: float, near: float) -> FloatArray:
    """Return s, offset, cos(psi), sin(psi), curvature at the foot of one point."""
    return project_many(path, *np.array([[x], [y], [near]]))[:, 0]


def test_a_clothoid_agrees_with_its_fresnel_integrals() -> None:
    sharpness = 0.004
    path = from_curvature(np.array([0.0, 30.0]), np.array([0.0, 30.0 * sharpness]))
    for s in (0.0, 0.13, 7.5, 18.77, 29.99, 30.0):  # knots and places between them
        point = path.at(s)
        x, _ = quad(lambda r: np.cos(0.5 * sharpness * r * r), 0.0, s, epsabs=1e-13)
        y, _ = quad(lambda r: np.sin(0.5 * sharpness * r * r), 0.0, s, epsabs=1e-13)
        assert abs(float(point.x) - x) < 1e-9  # the promise for knots 0.5 m apart
        assert abs(float(point.y) - y) < 1e-9
        assert abs(float(point.heading) - 0.5 * sharpness * s * s) < 1e-8  # one order of the spacing less than positions
        assert abs(float(point.curvature) - sharpness * s) < 1e-6  # two orders less


def test_a_profile_with_kinks_between_knots_is_followed_to_a_micrometre() -> None:
    s, k = np.array([0.0, 10.3, 16.1, 30.2, 36.9, 50.0]), np.array([0.0, 0.0, 0.08, 0.08, 0.0, 0.0])
    path = from_curvature(s, k)
    heading = np.concatenate([[0.0], np.cumsum(0.5 * (k[1:] + k[:-1]) * np.diff(s))])

    def psi(r: float) -> float:
        i = min(int(np.searchsorted(s, r, side="right")) - 1, len(s) - 2)
        d = r - s[i]
        return float(heading[i] + k[i] * d + 0.5 * (k[i + 1] - k[i]) / (s[i + 1] - s[i]) * d * d)

    for at in (16.0, 33.3, 50.0):
        x, _ = quad(lambda r: np.cos(psi(r)), 0.0, at, points=list(s[1:-1]), epsabs=1e-12, limit=200)
        y, _ = quad(lambda r: np.sin(psi(r)), 0.0, at, points=list(s[1:-1]), epsabs=1e-12, limit=200)
        point = path.at(at)
        # a kink inside a quadrature cell of 0.5 m costs about (change of slope) * 0.5^3 / 100
        assert np.hypot(float(point.x) - x, float(point.y) - y) < 2e-5


def test_an_arc_stays_on_its_circle() -> None:
    path = arc(0.2, 40.0)  # the tightest road that the knot spacing is meant for
    s = np.linspace(0.0, 40.0, 333)
    point = path.at(s)
    assert np.max(np.abs(np.hypot(point.x, point.y - 5.0) - 5.0)) < 1e-9
    assert np.max(np.abs(np.exp(1j * point.heading) - np.exp(0.2j * s))) < 1e-8
    assert np.max(np.abs(point.curvature - 0.2)) < 1e-6


@given(s=st.floats(0.5, 109.5))
@few
def test_heading_and_curvature_are_the_derivatives_of_position(s: float) -> None:
    path = winding()
    at = np.array([s])
    tangent = differences(lambda v: evaluate_many(path, v)[:2, 0], at)[:, 0]
    _, _, cos, sin, curvature = evaluate_many(path, at)[:, 0]
    # a jump of the third derivative at a knot inside the stencil costs up to 1e-3^2 times it
    assert np.max(np.abs(tangent - [cos, sin])) < 1e-8
    bent = differences(lambda v: evaluate_many(path, v)[2:4, 0], at)[:, 0]
    assert np.max(np.abs(bent - curvature * np.array([-sin, cos]))) < 1e-5  # knots: first order in the stencil's width


@given(s=st.floats(2.0, 108.0), offset=st.floats(-8.0, 8.0), guess=st.floats(-3.0, 3.0))
@few
def test_projection_undoes_placing_to_a_nanometre(s: float, offset: float, guess: float) -> None:
    path = winding().extended(10.0, 10.0)
    x, y = path.to_plane(s, offset)
    found, distance = path.project(x, y, s + guess)
    assert abs(float(found) - s) < 1e-9
    assert abs(float(distance) - offset) < 1e-9


@given(angle=st.floats(0.3, 2.2), radius=st.floats(3.0, 30.0))
@few
def test_the_foot_on_an_arc_is_the_polar_angle(angle: float, radius: float) -> None:
    path = arc(0.05, 50.0)  # centre (0, 20)
    x, y = radius * np.sin(angle), 20.0 - radius * np.cos(angle)
    s, offset, cos, sin, curvature = foot_of(path, x, y, 20.0 * angle + 1.0)
    assert abs(s - 20.0 * angle) < 1e-9
    assert abs(offset - (20.0 - radius)) < 1e-9
    assert abs(np.arctan2(sin, cos) - angle) < 1e-9
    assert abs(curvature - 0.05) < 1e-7  # second derivative of a quintic through knots 0.5 m apart


def test_a_search_that_starts_next_to_its_foot_is_exact_after_one_step() -> None:
    path = arc(0.1, 30.0)
    x, y = (float(value) for value in path.to_plane(12.3, -2.0))
    away = foot_of(path, x, y, 12.3 + 1.6e-5)
    here = foot_of(path, x, y, 12.3)
    assert np.max(np.abs(away - here)[:4]) < 2e-12  # second order of 1.6e-5 m in the heading, third in the offset


def test_an_arclength_off_the_table_is_refused_with_its_number() -> None:
    with pytest.raises(RoadError) as caught:
        winding().at(np.array([1.0, 111.0]))
    assert caught.value.s_m == 111.0


def test_a_point_beyond_the_centre_of_curvature_has_no_foot() -> None:
    path = arc(0.1, 30.0)  # centre (0, 10)
    with pytest.raises(ProjectionError) as caught:
        path.project(np.array([0.0, 0.0]), np.array([1.0, 10.5]), np.array([0.0, 5.0]))
    assert caught.value.s_m == 5.0
    assert caught.value.offset_m == pytest.approx(np.hypot(10.0 * np.sin(0.5), 0.5 + 10.0 * np.cos(0.5)), abs=1e-9)


@pytest.mark.parametrize("end", [0.0, 30.0])
def test_a_foot_within_rounding_of_an_end_is_the_end(end: float) -> None:
    path = arc(0.1, 30.0)
    out = np.array([1.0, -1.0]) * (0.9e-3 if end else -0.9e-3)  # beyond, and inside
    x, y = path.extended(1.0, 1.0).to_plane(end + out, 0.3)
    s, offset = path.project(x, y, near=abs(end - 0.5))
    np.testing.assert_allclose(s, [end, end - out[0]], atol=1e-9)
    np.testing.assert_allclose(offset, 0.3, atol=1e-6)


@pytest.mark.parametrize(("s", "words"), [(-0.2, "0.20 m before the beginning"), (30.4, "0.40 m beyond the end")])
def test_a_point_off_an_end_is_refused_with_its_distance_from_the_end(s: float, words: str) -> None:
    path = arc(0.1, 30.0)
    x, y = path.extended(1.0, 1.0).to_plane(s, 0.3)
    with pytest.raises(ProjectionError, match=f"a point lies {words} of the path, at s = ") as caught:
        path.project(x, y, near=float(np.clip(s, 0.5, 29.5)))
    assert caught.value.s_m == np.clip(s, 0.0, 30.0)
    assert caught.value.offset_m == pytest.approx(0.3, abs=1e-6)


def test_the_search_does_not_leave_its_neighbourhood() -> None:
    path = arc(0.1, 60.0)
    with pytest.raises(ProjectionError):
        path.project(-1.0, 12.0, 15.0)  # beyond the centre (0, 10): its only foot is on the far side of the circle


def test_a_crossing_is_projected_on_the_branch_that_the_search_starts_from() -> None:
    path = loop()

    def apart(at: np.ndarray) -> np.ndarray:
        points = path.at(np.clip(at, 0.0, path.length))
        return np.array([points.x[0] - points.x[1], points.y[0] - points.y[1]])

    s = np.linspace(0.0, 40.0, 41)
    ahead, back = path.at(s), path.at(path.length - s)
    i, j = np.unravel_index(np.argmin(np.hypot(ahead.x[:, None] - back.x, ahead.y[:, None] - back.y)), (41, 41))
    first, second = fsolve(apart, np.array([s[i], path.length - s[j]]), xtol=1e-12)
    assert second - first > 50.0
    x, y = float(path.at(first).x), float(path.at(first).y)
    for near, foot in ((first - 4.0, first), (first + 4.0, first), (second - 4.0, second), (second + 4.0, second)):
        s, offset = path.project(x, y, near)
        assert abs(float(s) - foot) < 1e-8  # fsolve's own accuracy
        assert abs(float(offset)) < 1e-8


def test_an_extension_leaves_the_road_as_it_was_and_its_curvature_continuous() -> None:
    path = from_curvature(np.array([0.0, 20.0, 50.0]), np.array([0.04, 0.04, -0.06]))
    longer = path.extended(23.3, 31.7)
    assert longer.s_first <= -23.3
    assert longer.s_last >= path.length + 31.7
    assert longer.length == path.length
    s = np.linspace(0.0, path.length, 401)
    before, after = path.at(s), longer.at(s)
    for name in ("x", "y", "heading", "curvature"):
        assert np.max(np.abs(getattr(before, name) - getattr(after, name))) < 1e-11  # the same coefficients, other offsets
    # the promised fade: linear to zero over 10 m, then straight; the quintics' curvature is good to 1e-6
    out = np.array([0.0, 2.5, 5.0, 10.0, 15.0, 20.0])
    fade = np.clip(1.0 - out / 10.0, 0.0, 1.0)
    assert np.max(np.abs(longer.at(path.length + out).curvature + 0.06 * fade)) < 1e-5  # a kink at 10 m
    assert np.max(np.abs(longer.at(-out).curvature - 0.04 * fade)) < 1e-5
    # headings turn by the area under the curvature
    end, start = float(path.at(path.length).heading), float(path.at(0.0).heading)
    assert abs(float(longer.at(path.length + 20.0).heading) - (end - 0.5 * 10.0 * 0.06)) < 1e-7
    assert abs(float(longer.at(-20.0).heading) - (start - 0.5 * 10.0 * 0.04)) < 1e-7


def test_an_extended_path_is_parametrised_by_arclength() -> None:
    path = from_curvature(np.array([0.0, 30.0]), np.array([0.05, -0.06])).extended(25.0, 25.0)
    s = np.linspace(path.s_first, path.s_last, 4001)
    point = path.at(s)
    chords = np.hypot(np.diff(point.x), np.diff(point.y))
    assert np.max(np.abs(chords - np.diff(s))) < 1e-7  # chord against arc: k^2 ds^3 / 24 = 3e-10, and the quintics


def test_extending_twice_adds_nothing_that_is_there_already() -> None:
    once = winding().extended(20.0, 20.0)
    assert once.extended(10.0, 20.0) is once


def test_a_closed_road_is_wound_on() -> None:
    path = closed_circle()
    wound = path.extended(30.0, 200.0)
    assert wound.closed
    assert wound.length == path.length
    assert wound.s_first <= -30.0
    assert wound.s_last >= path.length + 200.0
    s = np.linspace(0.0, path.length, 97)
    for lap in (-path.length, path.length):
        inside = s[(s + lap >= wound.s_first) & (s + lap <= wound.s_last)]
        here, there = path.at(inside), wound.at(inside + lap)
        assert np.max(np.hypot(here.x - there.x, here.y - there.y)) < 1e-9
        assert np.max(np.abs(here.curvature - there.curvature)) < 1e-9
    again = wound.extended(300.0, 10.0).at(-290.0)
    assert abs(float(again.x) + 20.0 * np.sin(14.5)) < 1e-9
    assert abs(float(again.y) - 20.0 * (1.0 - np.cos(14.5))) < 1e-9


def test_a_vehicle_that_laps_keeps_the_arclength_of_its_lap() -> None:
    path = closed_circle().extended(10.0, 140.0)
    x, y = path.to_plane(3.0, 1.5)
    for near in (2.0, 2.0 + path.length):
        s, offset = path.project(x, y, near)
        assert abs(float(s) - (near + 1.0)) < 1e-9
        assert abs(float(offset) - 1.5) < 1e-9


def test_a_point_past_the_end_of_the_table_has_no_foot() -> None:
    path = arc(0.05, 50.0)  # the last quintic, continued 8 m beyond its 0.5 m, is no road
    with pytest.raises(RoadError):
        path.project(20.0 * np.sin(2.9), 20.0 * (1.0 - np.cos(2.9)), 49.0)
