"""Edges beside a path become limits: true distances along its normals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError
from hdvplan.road.load import load_road
from hdvplan.road.options import RoadOptions
from hdvplan.road.path import from_curvature
from hdvplan.road.pieces import Kerb
from hdvplan.road.regions import Kind
from hdvplan.road.road import edge_reaches
from tests.road.drives import line_feature, written

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
