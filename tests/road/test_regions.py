"""Obstacles and kerbs: what they leave of a road, never too much and rarely too little."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hdvplan.arrays import FloatArray
from hdvplan.planning.bias import Bias
from hdvplan.planning.stations import limit_table
from hdvplan.road.cells import cells_of, stays_of
from hdvplan.road.path import ReferencePath, from_curvature, project_many
from hdvplan.road.regions import OPEN_M, Kind, Region, Side, distances
from hdvplan.road.road import Limits, Road

TABLE_M = 0.25  # of the planner's limit table
CELL_M = 0.05  # how much too early a limit of an obstacle may jump
CAUTION_M = 0.3  # the table's spacing and one cell: the same for a kerb's


def straight(*regions: Region, length: float = 100.0) -> Road:
    return Road("straight", from_curvature(np.array([0.0, length]), np.zeros(2)), regions=regions)


def box(x_from: float, y_from: float, x_to: float, y_to: float, kind: Kind = Kind.OBSTACLE) -> Region:
    return Region(kind, shapely.box(x_from, y_from, x_to, y_to))


def at(road: Road, *s: float) -> FloatArray:
    assert road.limits is not None
    return road.limits.table(np.array(s))


def ring(path: ReferencePath, s: FloatArray, low: float, high: float) -> shapely.Polygon:
    """Return the area between two offsets, with corners at every ``s``."""
    inner, outer = (np.stack(path.to_plane(s, offset), axis=1) for offset in (low, high))
    return shapely.Polygon(np.concatenate([inner, outer[::-1]]))


def test_an_obstacle_cuts_the_side_where_it_lies_a_little_longer_than_it_is() -> None:
    road = straight(box(40, 1, 46, 5)).with_limits(3.0, 2.0)
    inside, outside = (40.0, 40.01, 43.0, 45.99, 46.0), (0.0, 40.0 - 2.1 * CELL_M, 46.0 + 2.1 * CELL_M, 100.0)
    # 1e-6 m: the foot of a point is exact to 1e-9 m, a quintic's normals to 1e-9
    np.testing.assert_allclose(at(road, *inside), np.tile([[1.0], [-2.0]] * 2, 5), atol=1e-6)
    np.testing.assert_array_equal(at(road, *outside), np.tile([[3.0], [-2.0]] * 2, 4))  # the jump takes a cell of 5 cm


@pytest.mark.parametrize(("first", "last"), [(-5.0, 5.0), (95.0, 105.0), (40.0, 46.0)])
def test_the_middle_between_the_limits_is_known_wherever_the_obstacle_lies(first: float, last: float) -> None:
    limits = straight(box(first, 1, last, 5)).with_limits(3.0, 2.0).limits
    assert limits is not None
    assert np.all(np.diff(limits.s) > 0.0)
    within = 0.5 * (max(first, 0.0) + min(last, 100.0))
    assert Bias.between(limits).at(np.array([within]))[0] == pytest.approx(-0.5, abs=1e-6)  # of limits 1 and -2; 1e-6 m as above


@pytest.mark.parametrize(("low", "high", "cut"), [(-3.0, 0.5, [3.0, 0.5]), (-0.5, 5.0, [-0.5, -2.0]), (-1.8, 2.9, [-1.8, -2.0])])
def test_an_obstacle_on_the_centre_line_is_passed_where_it_leaves_more_room(low: float, high: float, cut: list[float]) -> None:
    road = straight(box(40, low, 46, high)).with_limits(3.0, 2.0)
    np.testing.assert_allclose(at(road, 43.0)[:2, 0], cut, atol=1e-6)


def test_the_side_is_one_for_the_whole_obstacle() -> None:
    # Beside its first half more room is left on the left, beside its second on the right, where the least is more.
    slanted = Region(Kind.OBSTACLE, shapely.Polygon([(40, -1.5), (60, 0.5), (60, 2.5), (40, 0.2)]))
    s = np.linspace(40.0, 60.0, 50)
    left, right, _, _ = at(straight(slanted).with_limits(3.0, 3.0), *s)
    np.testing.assert_array_equal(right, np.full(50, -3.0))
    assert np.all(left <= np.interp(s, [40, 60], [-1.5, 0.5]) + 1e-6)


def test_an_obstacle_that_blocks_the_road_leaves_limits_that_overlap() -> None:
    left, right = at(straight(box(40, -2.5, 46, 4)).with_limits(3.0, 2.0), 43.0)[:2, 0]
    assert left < right


def test_two_obstacles_leave_the_passage_between_them() -> None:
    road = straight(box(40, 1.5, 46, 5), box(42, -5, 50, 0.2)).with_limits(4.0, 4.0)
    np.testing.assert_allclose(at(road, 44.0)[:2, 0], [1.5, 0.2], atol=1e-6)  # the second crosses the centre, right of the first


def test_a_polygon_with_the_road_in_its_hole_leaves_the_centre_free() -> None:
    outline, hole = ((-50, -15, 150, 15), (-40, -3, 140, 4))
    around = Region(Kind.OBSTACLE, shapely.Polygon(shapely.box(*outline).exterior, [shapely.box(*hole).exterior]))
    np.testing.assert_allclose(at(straight(around).within(None), 0.0, 50.0, 100.0)[:2], [[4.0] * 3, [-3.0] * 3], atol=1e-6)


def test_overhangs_may_reach_over_a_kerb_that_joins_the_band_but_wheels_may_not() -> None:
    kerb = box(40, 3.02, 60, 3.6, Kind.SWEEPABLE)
    np.testing.assert_allclose(at(straight(kerb).with_limits(3.0, 2.0), 50.0)[:, 0], [3.0, -2.0, 3.6, -2.0], atol=1e-6)
    apart = box(40, 3.2, 60, 3.6, Kind.SWEEPABLE)
    np.testing.assert_allclose(at(straight(apart).with_limits(3.0, 2.0), 50.0)[:, 0], [3.0, -2.0, 3.0, -2.0], atol=1e-6)
    two = (box(40, 3.0, 60, 3.3, Kind.SWEEPABLE), box(30, 3.33, 60, 3.9, Kind.SWEEPABLE))
    np.testing.assert_allclose(at(straight(*two).with_limits(3.0, 2.0), 35.0, 50.0)[2], [3.0, 3.9], atol=1e-6)


def test_a_kerb_inside_the_band_keeps_wheels_off_and_a_post_on_it_keeps_off_everything() -> None:
    kerb, post = box(40, 2.5, 60, 3.5, Kind.SWEEPABLE), box(50, 2.9, 50.2, 3.1)
    table = at(straight(kerb, post).with_limits(3.0, 2.0), 45.0, 50.1)
    np.testing.assert_allclose(table, [[2.5, 2.5], [-2.0, -2.0], [3.5, 2.9], [-2.0, -2.0]], atol=1e-6)


def test_the_overhangs_limit_ends_before_the_kerb_does() -> None:
    kerb = box(40, 2.9, 60, 3.6, Kind.SWEEPABLE)
    sweep = at(straight(kerb).with_limits(3.0, 3.0), 40.24, 40.0 + CAUTION_M + 0.06, 59.94 - CAUTION_M, 59.76)[2]
    assert sweep[0] < 3.6 > sweep[3]
    np.testing.assert_allclose(sweep[1:3], [3.6, 3.6], atol=1e-6)


def test_without_widths_obstacles_alone_make_limits() -> None:
    road = straight(box(40, 1, 46, 5)).within(None)
    np.testing.assert_allclose(at(road, 20.0, 43.0)[:2], [[OPEN_M, 1.0], [-OPEN_M, -OPEN_M]], atol=1e-6)
    assert straight(box(40, 1, 46, 5, Kind.SWEEPABLE)).within(None).limits is None
    bend = Road("bend", from_curvature(np.array([0.0, 60.0]), np.array([0.1, 0.1])), regions=(box(0, -4, 1, -3),)).within(None)
    np.testing.assert_allclose(at(bend, 30.0)[:2, 0], [8.0, -OPEN_M])  # 0.8 of the radius of 10 m inside


def test_new_limits_replace_the_band_and_keep_the_obstacles() -> None:
    road = straight(box(40, 1, 46, 5), box(60, -2.6, 65, -2.4)).with_limits(2.0, 2.0)
    np.testing.assert_allclose(at(road.with_limits(3.0, 3.0), 43.0, 62.0)[:2], [[1.0, 3.0], [-3.0, -2.4]], atol=1e-6)


def test_an_obstacle_over_the_seam_of_a_closed_road_is_one() -> None:
    path = from_curvature(np.array([0.0, 40.0 * np.pi]), np.array([0.05, 0.05]))  # a circle of radius 20 m about (0, 20)
    path = ReferencePath(path.coefficients, path.s_first, path.spacing, path.length, closed=True)
    van = Region(Kind.OBSTACLE, shapely.box(-3, -2, 3, 0.5))
    road = Road("ring", path, regions=(van,)).with_limits(3.0, 3.0)
    left, right, _, _ = at(road, 0.0, 2.5, path.length - 2.5, path.length)
    np.testing.assert_array_equal(left, np.full(4, 3.0))
    # 2.5 m on, the circle stands 0.16 m higher; the limit holds 0.3 m around, where the circle's slope is 1 in 8
    np.testing.assert_allclose(right, [0.5, 0.5 - 0.16, 0.5 - 0.16, 0.5], atol=0.05)


@given(
    bend=st.floats(-0.1, 0.1), offset=st.floats(-6.0, 6.0), along=st.floats(10.0, 50.0), depth=st.floats(0.02, 3.0),
    slope=st.floats(-0.05, 0.05),
)  # fmt: skip
@settings(max_examples=25, deadline=None)
def test_a_smooth_edge_costs_no_more_than_centimetres(bend: float, offset: float, along: float, depth: float, slope: float) -> None:
    path = from_curvature(np.array([0.0, 10.0, 60.0]), np.array([0.0, bend, bend]))
    s = np.arange(along - 8.0, along + 8.0, 0.1)  # chords of 0.1 m: the edge's sagitta is below 0.2 mm
    edge = offset + slope * (s - along)
    inner, outer = (np.stack(path.to_plane(s, side), axis=1) for side in (edge, edge + np.copysign(depth, offset)))
    road = Road("edge", path, regions=(Region(Kind.OBSTACLE, shapely.Polygon(np.concatenate([inner, outer[::-1]]))),)).with_limits(7.0, 7.0)
    side = 0 if offset > 0.0 else 1
    if np.min(np.abs(edge)) == 0.0 or np.min(np.sign(edge)) != np.max(np.sign(edge)):
        return  # on the centre line: its far side may be the one to pass on
    within = (s > along - 7.0) & (s < along + 7.0)
    lost = (edge[within] - at(road, *s[within])[side]) * (1.0 - 2.0 * side)
    assert np.min(lost) >= -2e-4  # the sagitta
    assert np.max(lost) <= 2.2 * CELL_M * abs(slope) + 3e-4  # a cell more where a normal is not one of the cells'


polygons = st.lists(st.tuples(st.floats(-8.0, 8.0), st.floats(-6.0, 6.0)), min_size=3, max_size=7)


@given(
    bend=st.floats(-0.1, 0.1), places=st.lists(st.tuples(st.floats(5.0, 75.0), polygons), min_size=1, max_size=3),
    phase=st.floats(0.0, 1.0), width=st.sampled_from([None, 2.0, 5.0]),
)  # fmt: skip
@example(bend=0.0390625, places=[(62.75, [(0.0, 0.0), (0.0, 1.0), (2.703125, 2.984375)])], phase=0.0, width=None)
@settings(max_examples=25, deadline=None)
def test_no_point_of_any_obstacle_lies_within_the_limits_that_planning_uses(
    bend: float, places: list[tuple[float, list[tuple[float, float]]]], phase: float, width: float | None
) -> None:
    s_ends = np.array([0.0, 20.0, 30.0, 50.0, 60.0, 80.0])
    path = from_curvature(s_ends, np.array([0.0, 0.0, bend, bend, -bend, -bend]))
    hulls = [shapely.MultiPoint(np.stack(path.to_plane(s, 0.0), axis=-1) + np.array(corners)).convex_hull for s, corners in places]
    shapes = [hull for hull in hulls if isinstance(hull, shapely.Polygon) and hull.area > 1e-3]
    road = Road("any", path, regions=tuple(Region(Kind.OBSTACLE, shape) for shape in shapes))
    s = np.linspace(0.0, path.length, 37)  # a band with entries of its own, which must not open what obstacles close
    one = np.ones(37)
    band = None if width is None else Limits(s, width * one, -width * one, (width + 0.5) * one, -width * one)
    road = road.within(band)
    table = limit_table(road, path.extended(5.0 + phase, 5.0), 0.0)  # the phase moves the table's entries along s
    rng = np.random.default_rng(0)
    wide, nears = path.extended(20.0, 20.0), np.arange(0.0, 81.0, 10.0)
    entries = table.s_first + table.spacing * np.arange(table.values.shape[1])
    for shape in shapes:
        corners = shapely.get_coordinates(shape)
        weights = rng.dirichlet(np.full(len(corners), 0.3), 200)  # few corners dominate: points lie near the outline, too
        points = np.repeat(np.vstack([corners, weights @ corners]), len(nears), axis=0)
        near = np.tile(nears, len(points) // len(nears))
        s, e = project_many(wide, points[:, 0], points[:, 1], near)[:2]
        met = (s >= 0.0) & (s <= path.length) & (np.abs(e) < 6.0)  # NaN where there is no foot near by
        left, right = (np.interp(s[met], entries, table.values[row]) for row in (2, 3))
        # The foot's accuracy; and an edge along a bend bows between limits 5 cm apart, which the stations' margin covers.
        near_by = 1e-6 + abs(bend) * 0.05**2 / 8.0
        assert np.all((e[met] >= left - near_by) | (e[met] <= right + near_by))


def test_passing_on_the_other_side_moves_the_limits_there_and_leaves_the_rest() -> None:
    road = straight(box(40, -0.5, 46, 1), box(70, -1, 76, 0.5)).with_limits(4.0, 4.0)
    other = road.passing({0: Side.LEFT, 1: Side.RIGHT})
    np.testing.assert_allclose(at(road, 43.0, 73.0)[:2], [[-0.5, 4.0], [-4.0, 0.5]], atol=1e-6)
    np.testing.assert_allclose(at(other, 43.0, 73.0)[:2], [[4.0, -1.0], [1.0, -4.0]], atol=1e-6)
    assert other.edges is not None
    np.testing.assert_array_equal(other.edges.table(np.array([43.0, 73.0]))[:2], [[4.0, 4.0], [-4.0, -4.0]])
    np.testing.assert_array_equal(at(road, 10.0, 58.0), at(other, 10.0, 58.0))


def test_an_obstacle_beside_the_line_is_passed_on_its_far_side_where_that_is_given() -> None:
    road = straight(Region(Kind.OBSTACLE, shapely.box(40, 1, 46, 2), side=Side.LEFT)).with_limits(6.0, 2.0)
    np.testing.assert_allclose(at(road, 43.0)[:2, 0], [6.0, 2.0], atol=1e-6)


def test_the_room_beside_an_obstacle_ends_at_the_edge_or_at_the_next_obstacle() -> None:
    found = straight(box(40, -1, 46, 1), box(44, 2.5, 50, 5)).with_limits(4.0, 3.0).obstructed
    assert found is not None
    assert found.room(0, Side.LEFT, {}) == pytest.approx(3.0, abs=1e-6)
    assert found.room(0, Side.LEFT, {1: Side.RIGHT}) == pytest.approx(1.5, abs=1e-6)
    assert found.room(0, Side.RIGHT, {1: Side.RIGHT}) == pytest.approx(2.0, abs=1e-6)
    assert found.room(1, Side.LEFT, {}) == pytest.approx(-1.0, abs=1e-6)


def test_limits_of_a_stretch_are_those_of_the_road_there() -> None:
    road = straight(box(40, -0.5, 46, 1), box(70, -1, 76, 0.5)).with_limits(4.0, 4.0)
    found = road.obstructed
    assert found is not None
    s, values = found.limits({1: Side.LEFT}, 60.0, 80.0)
    whole, of_whole = found.limits({1: Side.LEFT})
    looked = np.linspace(60.0, 80.0, 401)
    for row, of_row in zip(values, of_whole, strict=True):
        np.testing.assert_array_equal(np.interp(looked, s, row), np.interp(looked, whole, of_row))


@pytest.mark.parametrize("closed", [False, True])
def test_a_stretch_of_a_path_goes_on_as_the_whole_path_does(closed: bool) -> None:
    path = from_curvature(np.array([0.0, 40.0 * np.pi]), np.array([0.05, 0.05]))
    path = ReferencePath(path.coefficients, path.s_first, path.spacing, path.length, closed=closed)
    whole = path.extended(40.0, 40.0)
    for s_from, s_to in ((30.2, 61.7), (0.0, 20.0), (-25.0, 0.0), (path.length - 20.0, path.length)):
        part = path.stretch(s_from, s_to, 10.0, 15.0)
        assert part.length == pytest.approx(s_to - s_from)
        s = np.linspace(-10.0, part.length + 15.0, 57)
        here, there = part.at(s), whole.at(s + s_from)
        np.testing.assert_allclose([here.x, here.y], [there.x, there.y], atol=1e-9)
        np.testing.assert_allclose(here.curvature, there.curvature, atol=1e-6)  # continuations are made again where a table ends


def scattered(path: ReferencePath, count: int) -> tuple[Region, ...]:
    """Return boxes of all sizes and directions on a circle of 20 m around (0, 20), then one over its start and one around most of it."""
    rng = np.random.default_rng(7)
    turn, off, size = rng.uniform(0.0, 2.0 * np.pi, count), rng.uniform(-6.0, 6.0, count), rng.uniform(0.1, 3.0, (2, count))
    x, y = (20.0 + off) * np.sin(turn), 20.0 - (20.0 + off) * np.cos(turn)
    corners = np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0]])[:, :, None] * size[:, None]
    turned = np.stack(
        [x + corners[0] * np.cos(turn) - corners[1] * np.sin(turn), y + corners[0] * np.sin(turn) + corners[1] * np.cos(turn)]
    )
    boxes = [Region(Kind.OBSTACLE, shapely.Polygon(one)) for one in turned.T]
    over_start, around = shapely.box(-1.0, -2.0, 1.0, 3.0), ring(path, np.linspace(5.0, 110.0, 300), 2.0, 3.0)
    return (*boxes, Region(Kind.OBSTACLE, over_start), Region(Kind.SWEEPABLE, around))


@pytest.mark.slow
@pytest.mark.parametrize("closed", [False, True])
def test_polygons_are_cut_together_as_they_are_one_by_one(closed: bool) -> None:
    path = from_curvature(np.array([0.0, 40.0 * np.pi]), np.array([0.05, 0.05]))
    path = ReferencePath(path.coefficients, path.s_first, path.spacing, path.length, closed=closed)
    cells, regions = cells_of(path), scattered(path, 200)  # 200 of 40 to 46 m: more than one group
    together = stays_of(cells, regions)
    alone = [(number, stay) for number, region in enumerate(regions) for stay in stays_of(cells, (region,))]
    assert [stay.region for stay in together] == [number for number, _ in alone]
    for one, (_, other) in zip(together, alone, strict=True):
        for column in ("cells", "low", "high", "left", "right", "on_centre"):
            np.testing.assert_array_equal(getattr(one, column), getattr(other, column))


def test_the_distance_of_regions_is_that_of_their_nearest_point() -> None:
    path = from_curvature(np.array([0.0, 40.0 * np.pi]), np.array([0.05, 0.05]))
    regions = (*scattered(path, 20), box(100.0, 100.0, 101.0, 101.0))
    s = np.linspace(0.0, path.length, 253)
    centre = shapely.LineString(np.stack(path.to_plane(s, 0.0), axis=1))
    np.testing.assert_array_equal(distances(path, regions), [shapely.distance(centre, region.polygon) for region in regions])
    assert distances(path, ()).shape == (0,)
