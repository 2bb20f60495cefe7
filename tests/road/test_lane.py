"""Sides of a road: driving beside the drawn line and the other way, and edges beside it that become limits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError
from hdvplan.road.limits import Limits
from hdvplan.road.line import offset_road, reversed_road
from hdvplan.road.load import load_road
from hdvplan.road.options import RoadOptions
from hdvplan.road.path import ReferencePath, from_curvature
from hdvplan.road.pieces import Kerb
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road, edge_reaches
from tests.road.drives import EAST, line_feature, written

S_BEND = from_curvature(np.array([0.0, 30.0, 45.0, 70.0, 100.0, 130.0]), np.array([0.0, 0.0, 0.08, 0.08, -0.1, 0.0]))


def limited() -> Road:
    s = np.array([0.0, 20.0, 60.0, 130.0])
    left, right = np.array([3.0, 4.0, 3.5, 5.0]), np.array([-6.0, -5.0, -6.0, -4.0])
    return Road("bend", S_BEND, Limits(s, left, right, left + 0.5, right - 0.2))


def edges(road: Road) -> list[FloatArray]:
    """Return the four limits as lines in the plane, shape (n, 2)."""
    assert road.limits is not None
    s = np.union1d(road.limits.s, np.linspace(0.0, road.path.length, 2000))
    return [np.stack(road.path.to_plane(s, offset), axis=1) for offset in road.limits.table(s)]


@pytest.mark.parametrize("offset", [1.75, -1.75, 0.3])
def test_an_offset_moves_the_reference_and_leaves_the_edges_where_they_are(offset: float) -> None:
    road = limited()
    moved = offset_road(road, offset)
    s = np.linspace(0.0, moved.path.length, 500)
    here = moved.path.at(s)
    foot, e = road.path.extended(1.0, 1.0).project(here.x, here.y, s)
    # knots of the moved line lie on the parallel; between them its quintics stray where k / (1 - offset k) bends
    np.testing.assert_allclose(e, offset, atol=1e-4)
    k = road.path.at(np.clip(foot, 0.0, road.path.length)).curvature
    np.testing.assert_allclose(here.curvature, k / (1.0 - offset * k), atol=1e-3)  # the ramps' ends lie between knots
    assert np.max(np.abs(np.diff(here.curvature))) < 0.01  # 0.26 m apart; the ramps' slope is 0.008 1/m^2 at most
    for old, new in zip(edges(road), edges(moved), strict=True):
        assert shapely.hausdorff_distance(shapely.LineString(old), shapely.LineString(new)) < 2e-3  # both drawn in pieces of 7 cm


def test_moving_there_and_back_is_no_change() -> None:
    road = offset_road(offset_road(limited(), 1.5), -1.5)
    assert road.path.length == pytest.approx(S_BEND.length, abs=1e-4)
    s = np.linspace(0.0, S_BEND.length - 1e-3, 300)
    np.testing.assert_allclose(np.stack(road.path.to_plane(s, 0.0)), np.stack(S_BEND.to_plane(s, 0.0)), atol=1e-3)


def test_an_offset_beyond_the_centre_of_curvature_is_refused_with_its_place() -> None:
    with pytest.raises(RoadError, match=r"offset of -9 m comes too near the centre of the bend at s = 100\.0 m, .* 10\.00 m") as caught:
        offset_road(replace(limited(), limits=None), -9.0)  # leaves 1 m of radius
    assert caught.value.s_m == pytest.approx(100.0)
    with pytest.raises(RoadError, match="too near the centre"):
        offset_road(replace(limited(), limits=None), -15.0)


def test_an_offset_beyond_a_limit_is_refused_with_its_place() -> None:
    with pytest.raises(RoadError, match=r"offset of 3.2 m lies beyond the road's own left limit at s = 0\.0 m"):
        offset_road(limited(), 3.2)


def test_the_other_way_left_is_right() -> None:
    road = limited()
    back = reversed_road(road)
    length = road.path.length
    s = np.linspace(0.0, length, 400)
    there, here = road.path.at(length - s), back.path.at(s)
    np.testing.assert_allclose([here.x, here.y, here.curvature], [there.x, there.y, -there.curvature], atol=1e-9)
    np.testing.assert_allclose(np.cos(here.heading - there.heading), -1.0, atol=1e-12)
    assert road.limits is not None
    assert back.limits is not None
    left, right, left_sweep, right_sweep = road.limits.table(length - s)
    np.testing.assert_allclose(back.limits.table(s), [-right, -left, -right_sweep, -left_sweep], atol=1e-9)


def test_a_closed_road_stays_closed() -> None:
    ring = load_road("neubrandenburg_ring")
    turned = load_road("neubrandenburg_ring", RoadOptions(reverse=True, offset=-1.75))
    assert turned.path.closed
    ends = turned.path.at(np.array([0.0, turned.path.length]))
    np.testing.assert_allclose(ends.x[0], ends.x[1], atol=1e-6)
    np.testing.assert_allclose(ends.curvature[0], ends.curvature[1], atol=1e-6)
    # once round, a line 1.75 m outside is 2 pi 1.75 m longer, one inside shorter
    assert abs(turned.path.length - ring.path.length) == pytest.approx(2.0 * np.pi * 1.75, abs=1e-3)


def test_regions_stay_where_they_are_and_are_cut_anew() -> None:
    van = Region(Kind.OBSTACLE, shapely.box(40.0, -3.0, 45.0, -1.0))
    road = Road("straight", from_curvature(np.array([0.0, 100.0]), np.zeros(2)), regions=(van,)).with_limits(3.5, 3.5)
    lane = offset_road(road, -1.75)  # the van now stands on the reference: it is passed on the left
    assert lane.regions == road.regions
    assert lane.passable is not None
    np.testing.assert_allclose(lane.passable.table(np.array([20.0, 42.0]))[:2], [[5.25, 5.25], [-1.75, 0.75]], atol=1e-6)
    back = reversed_road(road)
    assert back.passable is not None
    np.testing.assert_allclose(back.passable.table(np.array([20.0, 58.0]))[:2], [[3.5, 1.0], [-3.5, -3.5]], atol=1e-6)


def test_what_smoothing_did_is_told_at_its_new_place() -> None:
    drawn, turned = load_road("street_corner"), load_road("street_corner", RoadOptions(reverse=True, offset=1.0))
    assert drawn.smoothing is not None
    assert turned.smoothing is not None
    assert turned.smoothing.max_curvature == pytest.approx(
        np.max(np.abs(turned.path.at(samples(turned.path)).curvature)), rel=2e-3
    )  # knots lie elsewhere
    place = turned.path.at(turned.smoothing.max_deviation_s)
    there = drawn.path.at(drawn.smoothing.max_deviation_s)
    assert np.hypot(place.x - there.x, place.y - there.y) == pytest.approx(1.0, abs=0.01)  # the offset


def test_straights_over_gaps_of_kerbs_stay_where_they_are(tmp_path: Path) -> None:
    lines = {"way": ((0, 0), (100, 0)), "left": ((0, 4), (40, 4)), "left edge": ((60, 4), (100, 4)), "right": ((0, -4), (100, -4))}
    file = written(tmp_path, *(line_feature(np.array(points), name=name) for name, points in lines.items()))
    for options in (RoadOptions(feature="way"), RoadOptions(feature="way", reverse=True), RoadOptions(feature="way", offset=0.5)):
        (bridge,) = load_road(file, options).bridges
        assert sorted(bridge[:, 0] - EAST) == pytest.approx([40.0, 60.0], abs=0.1)


def samples(path: ReferencePath) -> FloatArray:
    return np.linspace(0.0, path.length, 4000)


STRAIGHT = from_curvature(np.array([0.0, 100.0]), np.zeros(2))
BEND = from_curvature(np.array([0.0, 100.0]), np.full(2, 0.05))  # radius 20 m, to the left, around (0, 20)


ANGLE = np.linspace(-0.2, 5.3, 2000)


def kerbs(*edges: tuple[FloatArray, FloatArray]) -> list[Kerb]:
    """Return lines as kerbs, each with the arclengths beside its points: on which side they are said to lie does not count."""
    return [Kerb(points, s, left=True) for points, s in edges]


def circle(radius: float) -> FloatArray:
    return np.stack([radius * np.sin(ANGLE), 20.0 - radius * np.cos(ANGLE)], axis=1)


def test_concentric_edges_are_equally_far_everywhere() -> None:
    _, reaches = edge_reaches(BEND, kerbs((circle(17.0), 20.0 * ANGLE), (circle(22.5), 20.0 * ANGLE)))
    np.testing.assert_allclose(reaches[0], 3.0, atol=3e-5)  # chords of 6 cm sag by 2.2e-5 m
    np.testing.assert_allclose(reaches[1], 2.5, atol=3e-5)


def test_an_oblique_edge_is_as_far_as_it_is_drawn_and_a_corner_counts_to_a_normal() -> None:
    edge = np.array([[-1.0, 2.0], [50.0, 2.0], [50.0, 4.0], [101.0, 5.0]])
    s, reaches = edge_reaches(STRAIGHT, kerbs((edge, edge[:, 0]), (edge * [1.0, -1.0], edge[:, 0])))
    np.testing.assert_allclose(reaches[0, s < 50.0], 2.0, atol=1e-9)
    np.testing.assert_allclose(reaches[1, s > 50.1], 4.0 + (s[s > 50.1] - 50.0) / 51.0, atol=1e-9)


def test_the_nearest_of_several_edges_counts_and_where_there_is_none_the_values_around_hold() -> None:
    kerb, wall = np.array([[19.95, 3.0], [80.05, 3.0]]), np.array([[-1.0, 6.0], [101.0, 6.0]])
    s, reaches = edge_reaches(STRAIGHT, kerbs((kerb, kerb[:, 0]), (wall, wall[:, 0])))
    beside = (s > 19.95) & (s < 80.05)  # normals stand 0.1 m apart
    np.testing.assert_allclose(reaches[0], np.where(beside, 3.0, 6.0))
    np.testing.assert_allclose(reaches[1], 20.0)
    _, reaches = edge_reaches(STRAIGHT, kerbs((kerb, kerb[:, 0]), (kerb * [1.0, -1.0], kerb[:, 0])))
    np.testing.assert_allclose(reaches, 3.0)


def test_an_edge_of_another_arm_of_the_road_does_not_count() -> None:
    near, far = np.array([[-1.0, 3.0], [101.0, 3.0]]), np.array([[-1.0, 2.0], [101.0, 2.0]])
    _, reaches = edge_reaches(STRAIGHT, kerbs((near, near[:, 0]), (far, 500.0 + far[:, 0])))
    np.testing.assert_allclose(reaches[0], 3.0)


def test_geojson_lines_that_are_called_edges_bound_the_line_that_is_not(tmp_path: Path) -> None:
    left, right = (np.array([(0.0, y), (100.0, y)]) for y in (3.0, -2.0))
    street, edges = np.array([(0.0, 0.0), (100.0, 0.0)]), [line_feature(left, edge="left"), line_feature(right, name="Right edge")]
    limits = load_road(written(tmp_path, line_feature(street, name="Street"), *edges)).limits
    assert limits is not None
    np.testing.assert_allclose(limits.table(np.array([10.0, 90.0])), [[3.0] * 2, [-2.0] * 2] * 2, atol=1e-6)
    spur = line_feature(np.array([(0.0, 3.0), (50.0, 3.0), (50.0, -1.0), (50.0, 3.0), (100.0, 3.0)]), edge="left")
    (wall,) = load_road(written(tmp_path, line_feature(street, name="Street"), spur, edges[1])).regions
    assert (wall.kind, wall.label) == (Kind.OBSTACLE, "edge")
    assert np.ptp(shapely.get_coordinates(wall.polygon), axis=0) == pytest.approx([0.01, 3.99], abs=1e-3)
    with pytest.raises(RoadError, match="has widths, and edges are drawn beside it"):
        load_road(written(tmp_path, line_feature(street, name="Street", width_m=7.0), *edges))


def test_notes_on_edges_are_of_the_way_that_is_driven(tmp_path: Path) -> None:
    ends = {"way": (0.0, 100.0), "left": (4.0, 100.0), "right": (-4.0, 70.0)}
    file = written(tmp_path, *(line_feature(np.array([(0.0, y), (x, y)]), name=name) for name, (y, x) in ends.items()))
    (drawn,), (turned,) = (load_road(file, RoadOptions(feature="way", reverse=reverse)).notes for reverse in (False, True))
    assert "no edge on the right from s = 70.0 to 100.0 m" in drawn
    assert "no edge on the left from s = 0.0 to 30.0 m" in turned
