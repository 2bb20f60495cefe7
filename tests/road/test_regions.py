"""Obstacles and kerbs: what they leave of a road, never too much and rarely too little."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import example, given
from hypothesis import strategies as st

from hdvplan import api
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.judging.bodies import corners
from hdvplan.passing import options
from hdvplan.planning.bias import Bias
from hdvplan.road.passages import furthest, offsets_of
from hdvplan.road.path import ReferencePath, from_curvature, project_many
from hdvplan.road.regions import EDGE, OPEN_M, SPUR_M, Kind, Region, Side, called, without_spurs
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle

CELL_M = 0.05  # how much too early a limit of an obstacle may jump


def straight(*regions: Region, length: float = 100.0) -> Road:
    return Road("straight", from_curvature(np.array([0.0, length]), np.zeros(2)), regions=regions)


def box(x_from: float, y_from: float, x_to: float, y_to: float, kind: Kind = Kind.OBSTACLE) -> Region:
    return Region(kind, shapely.box(x_from, y_from, x_to, y_to))


def at(road: Road, *s: float) -> FloatArray:
    assert road.passable is not None
    return road.passable.table(np.array(s))


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
    limits = straight(box(first, 1, last, 5)).with_limits(3.0, 2.0).passable
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
    np.testing.assert_allclose(right, np.full(50, -3.0), atol=1e-9)  # kerbs at chords of a straight: rounding
    assert np.all(left <= np.interp(s, [40, 60], [-1.5, 0.5]) + 0.011)  # between normals 0.1 m apart, where the face rises 1 in 10


def test_an_obstacle_that_blocks_the_road_leaves_limits_that_overlap() -> None:
    left, right = at(straight(box(40, -2.5, 46, 4)).with_limits(3.0, 2.0), 43.0)[:2, 0]
    assert left < right


def test_a_polygon_with_the_road_in_its_hole_leaves_the_centre_free() -> None:
    outline, hole = ((-50, -15, 150, 15), (-40, -3, 140, 4))
    around = Region(Kind.OBSTACLE, shapely.Polygon(shapely.box(*outline).exterior, [shapely.box(*hole).exterior]))
    np.testing.assert_allclose(at(straight(around).within(None), 0.0, 50.0, 100.0)[:2], [[4.0] * 3, [-3.0] * 3], atol=1e-6)


@pytest.mark.parametrize("ahead", [-8.0, 103.0])
def test_a_polygon_over_the_line_beyond_its_end_is_passed_on_one_side(ahead: float) -> None:
    (passage,) = straight(box(ahead, -0.5, ahead + 5.0, 1.0)).with_limits(5.0, 5.0).passages
    assert (passage.on_line, passage.around, passage.usual) == (True, False, Side.RIGHT)
    hook = shapely.Polygon([(60, 2), (110, 2), (110, -2), (60, -2), (60, -3), (111, -3), (111, 3), (60, 3)])  # a dead end
    assert [one.around for one in straight(Region(Kind.OBSTACLE, hook)).with_limits(5.0, 5.0).passages] == [True, True]


def test_the_face_of_an_area_all_around_a_closed_road_has_no_walls_across_it() -> None:
    path = from_curvature(np.array([0.0, 24.0 * np.pi]), np.array([1.0, 1.0]) / 12.0)  # a circle about (0, 12)
    path = ReferencePath(path.coefficients, path.s_first, path.spacing, path.length, closed=True)
    centre = shapely.Point(0.0, 12.0)
    apron = shapely.Polygon(centre.buffer(10.0, quad_segs=64).exterior, [centre.buffer(7.0, quad_segs=16).exterior])
    road = Road("ring", path, regions=(Region(Kind.SWEEPABLE, apron),)).with_limits(4.0, 4.0)
    (face,) = road.passed
    np.testing.assert_allclose(np.hypot(*(face.points - [0.0, 12.0]).T), 10.0, atol=1e-2)  # chords of 1/256 of the circle
    assert road.kerbs is not None
    bodies = {kerb.left: kerb.points - [0.0, 12.0] for kerb in road.kerbs.kerbs if not kerb.wheels}
    np.testing.assert_allclose(np.hypot(*bodies[True].T), 7.0, atol=0.05)  # overhangs may use the apron: its inner edge has 64 sides
    np.testing.assert_allclose(np.hypot(*bodies[False].T), 16.0, atol=1e-3)


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


@pytest.mark.parametrize("side", list(Side))
def test_wheels_and_what_is_between_them_keep_off_an_island_over_which_overhangs_pass(side: Side) -> None:
    island = Region(Kind.SWEEPABLE, shapely.box(50, -1, 56, 1), side=side)
    driven = api.plan(Case(straight(island).with_limits(6.0, 6.0), load_vehicle("bus"))).drive
    wheels, bodies = (
        shapely.polygons(corners(driven, np.arange(len(driven.poses_s)), axles_only=only).reshape(-1, 4, 2)) for only in (True, False)
    )
    assert np.max(shapely.area(shapely.intersection(wheels, island.polygon))) < 0.01  # kept to 1 cm
    assert np.max(shapely.area(shapely.intersection(bodies, island.polygon))) > 0.1
    assert float(driven.z[106, 0]) * (1.0 if side is Side.LEFT else -1.0) > 2.2


@given(
    bend=st.floats(-0.05, 0.05), out=st.floats(0.2, 3.0), begin=st.floats(12.0, 30.0), long=st.floats(3.0, 25.0), into=st.floats(0.0, 1.0),
)  # fmt: skip
@example(bend=-0.01171875, out=1.0, begin=12.0, long=7.25, into=0.0)  # closing moves the kerb's end by 2 um: the area was dropped
def test_what_overhangs_may_use_is_street_and_area_together(bend: float, out: float, begin: float, long: float, into: float) -> None:
    path = from_curvature(np.array([0.0, 10.0, 70.0]), np.array([0.0, bend, bend]))
    area = ring(path, np.linspace(begin, begin + long, 100), 3.0 - into, 3.0 + out)
    road = Road("any", path, regions=(Region(Kind.SWEEPABLE, area),)).with_limits(3.0, 3.0)
    assert road.kerbs is not None
    (around,) = (kerb for kerb in road.kerbs.kerbs if kerb.left and not kerb.wheels)
    own = ring(path, np.linspace(0.0, 70.0, 281), 0.0, 3.0)
    ends = (np.stack(path.to_plane(s, 0.0), axis=-1) for s in np.linspace(70.0, 0.0, 281))
    found = shapely.Polygon(np.concatenate([around.points, list(ends)]))
    # The area's chords and the kerb's, 0.25 m long, and what closes the gaps between them.
    assert shapely.symmetric_difference(found, shapely.union(own, area)).area < 0.01 * (long + 60.0)


def test_without_widths_obstacles_alone_make_limits() -> None:
    road = straight(box(40, 1, 46, 5)).within(None)
    np.testing.assert_allclose(at(road, 20.0, 43.0)[:2], [[OPEN_M, 1.0], [-OPEN_M, -OPEN_M]], atol=1e-6)
    assert straight(box(40, 1, 46, 5, Kind.SWEEPABLE)).within(None).limits is None
    bend = Road("bend", from_curvature(np.array([0.0, 60.0]), np.array([0.1, 0.1])), regions=(box(0, -4, 1, -3),)).within(None)
    # 0.9 of the radius of 10 m inside; a kerb's points are left out to 1 mm
    np.testing.assert_allclose(at(bend, 30.0)[:2, 0], [9.0, -OPEN_M], atol=1e-3)


def test_an_obstacle_over_the_seam_of_a_closed_road_is_one() -> None:
    path = from_curvature(np.array([0.0, 40.0 * np.pi]), np.array([0.05, 0.05]))  # a circle of radius 20 m about (0, 20)
    path = ReferencePath(path.coefficients, path.s_first, path.spacing, path.length, closed=True)
    van = Region(Kind.OBSTACLE, shapely.box(-3, -2, 3, 0.5))
    road = Road("ring", path, regions=(van,)).with_limits(3.0, 3.0)
    left, right, _, _ = at(road, 0.0, 2.5, path.length - 2.5, path.length)
    np.testing.assert_allclose(left, np.full(4, 3.0), atol=1e-3)  # of kerbs in chords of 0.25 m: 0.4 mm
    # 2.5 m on, the circle stands 0.16 m higher; the limit holds 0.3 m around, where the circle's slope is 1 in 8
    np.testing.assert_allclose(right, [0.5, 0.5 - 0.16, 0.5 - 0.16, 0.5], atol=0.05)


@pytest.mark.slow
@given(
    bend=st.floats(-0.1, 0.1), offset=st.floats(-6.0, 6.0), along=st.floats(10.0, 50.0), depth=st.floats(0.02, 3.0),
    slope=st.floats(-0.05, 0.05),
)  # fmt: skip
def test_a_smooth_edge_costs_no_more_than_centimetres(bend: float, offset: float, along: float, depth: float, slope: float) -> None:
    path = from_curvature(np.array([0.0, 10.0, 60.0]), np.array([0.0, bend, bend]))
    s = np.arange(along - 8.0, along + 8.0, 0.1)  # chords of 0.1 m: the edge's sagitta is below 0.2 mm
    edge = offset + slope * (s - along)
    inner, outer = (np.stack(path.to_plane(s, side), axis=1) for side in (edge, edge + np.copysign(depth, offset)))
    road = Road("edge", path, regions=(Region(Kind.OBSTACLE, shapely.Polygon(np.concatenate([inner, outer[::-1]]))),)).with_limits(7.0, 7.0)
    if len(road.passages) > 1:
        return  # a road that comes by twice: where one passage ends and the other begins, a face leaves the edge by some mm
    side = 0 if offset > 0.0 else 1
    if np.min(np.abs(edge)) == 0.0 or np.min(np.sign(edge)) != np.max(np.sign(edge)):
        return  # on the centre line: its far side may be the one to pass on
    within = (s > along - 7.0) & (s < along + 7.0)
    lost = (edge[within] - at(road, *s[within])[side]) * (1.0 - 2.0 * side)
    assert np.min(lost) >= -2e-4  # the sagitta
    assert np.max(lost) <= 2.2 * CELL_M * abs(slope) + 3e-4  # a cell more where a normal is not one of the cells'


def metres(most: float) -> st.SearchStrategy[float]:
    """Return coordinates in tenths of a millimetre: shapely divides by zero at 1e-229 m."""
    return st.floats(-most, most).map(lambda value: round(value, 4))


polygons = st.lists(st.tuples(metres(8.0), metres(6.0)), min_size=3, max_size=7)


@given(
    bend=st.floats(-0.1, 0.1), places=st.lists(st.tuples(st.floats(5.0, 75.0), polygons), min_size=1, max_size=3),
    width=st.sampled_from([None, 2.0, 5.0]),
)  # fmt: skip
@example(bend=0.0390625, places=[(62.75, [(0.0, 0.0), (0.0, 1.0), (2.703125, 2.984375)])], width=None)
@example(bend=-0.09375, places=[(74.75, [(0.0, 0.0), (1.0, 0.0), (7.875, 5.5)])], width=None)  # a face beyond where normals meet
@example(bend=0.0, places=[(5.0, [(0.0, 0.0), (0.0, -3.0), (0.0625, 4.0)])], width=None)  # a sliver across the line
def test_no_point_of_any_obstacle_lies_before_its_face(
    bend: float, places: list[tuple[float, list[tuple[float, float]]]], width: float | None
) -> None:
    s_ends = np.array([0.0, 20.0, 30.0, 50.0, 60.0, 80.0])
    path = from_curvature(s_ends, np.array([0.0, 0.0, bend, bend, -bend, -bend]))
    hulls = [shapely.MultiPoint(np.stack(path.to_plane(s, 0.0), axis=-1) + np.array(corners)).convex_hull for s, corners in places]
    shapes = [hull for hull in hulls if isinstance(hull, shapely.Polygon) and hull.area > 1e-3]
    road = Road("any", path, regions=tuple(Region(Kind.OBSTACLE, shape) for shape in shapes))
    road = road.within(None) if width is None else road.with_limits(width, width)
    rng = np.random.default_rng(0)
    wide, nears = path.extended(20.0, 20.0), np.arange(0.0, 81.0, 10.0)
    for passage in road.passages:
        corners = shapely.get_coordinates(shapes[passage.region])
        weights = rng.dirichlet(np.full(len(corners), 0.3), 200)  # few corners dominate: points lie near the outline, too
        points = np.repeat(np.vstack([corners, weights @ corners]), len(nears), axis=0)
        near = np.tile(nears, len(points) // len(nears))
        s, e = project_many(wide, points[:, 0], points[:, 1], near)[:2]
        ends = max(passage.s_from, 0.0) + 0.01, min(passage.s_to, path.length) - 0.01  # feet lie on chords of 1 m
        met = (s >= ends[0]) & (s <= ends[1]) & (np.abs(e) < 6.0)  # NaN where there is no foot near by
        for side, (face,) in passage.faces.items():
            driven_on = offsets_of(path, face, s[met])
            sign = 1.0 if face.left else -1.0
            reach = furthest(-sign * path.at(s[met]).curvature)  # of normals, before they meet: a face may lie beyond that
            assert np.all(np.isfinite(driven_on) | (np.max(-sign * np.array([passage.low, passage.high])) > reach))
            beyond = sign * (e[met] - np.where(np.isfinite(driven_on), driven_on, -sign * reach))
            assert face.left is (side is Side.RIGHT)
            assert np.min(beyond, initial=0.0) >= -1e-6  # a foot's accuracy, and a face's that is met by a normal
    assert {passage.region for passage in road.passages} == set(range(len(shapes)))


def test_passing_on_the_other_side_moves_the_limits_there_and_leaves_the_rest() -> None:
    road = straight(box(40, -0.5, 46, 1), box(70, -1, 76, 0.5)).with_limits(4.0, 4.0)
    other = road.passing({0: Side.LEFT, 1: Side.RIGHT})
    np.testing.assert_allclose(at(road, 43.0, 73.0)[:2], [[-0.5, 4.0], [-4.0, 0.5]], atol=1e-6)
    np.testing.assert_allclose(at(other, 43.0, 73.0)[:2], [[4.0, -1.0], [1.0, -4.0]], atol=1e-6)
    np.testing.assert_array_equal(at(road, 10.0, 58.0), at(other, 10.0, 58.0))


def test_an_obstacle_beside_the_line_is_passed_on_its_far_side_where_that_is_given() -> None:
    road = straight(Region(Kind.OBSTACLE, shapely.box(40, 1, 46, 2), side=Side.LEFT)).with_limits(6.0, 2.0)
    np.testing.assert_allclose(at(road, 43.0)[:2, 0], [6.0, 2.0], atol=1e-6)


def test_the_room_beside_an_obstacle_ends_at_the_kerb_or_at_the_next_obstacle() -> None:
    road = straight(box(40, -1, 46, 1), box(44, 2.5, 50, 5), box(60, 6, 66, 8)).with_limits(4.0, 3.0)
    assert road.passages[0].rooms == pytest.approx({Side.LEFT: 3.0, Side.RIGHT: 2.0}, abs=1e-6)  # the kerbs' sampling on a straight
    spans = options.spans_of(road.passages)
    assert options._room(road, spans, 0, Side.LEFT, {1: Side.RIGHT}) == pytest.approx(1.5, abs=1e-6)
    assert options._room(road, spans, 0, Side.RIGHT, {1: Side.RIGHT}) == pytest.approx(2.0, abs=1e-6)
    assert [passage.rooms[Side.LEFT] for passage in road.passages[1:]] == [0.0, 0.0]  # it meets the kerb, and it lies beyond it


def test_what_an_edge_draws_out_and_back_on_itself_is_a_thin_wall() -> None:
    edge = np.array([[-10.0, 5.0], [50.0, 5.0], [50.0, 3.0], [52.0, 1.0], [51.0, 2.0], [50.0, 3.0], [50.0, 5.0], [50.0, 5.0], [130.0, 5.0]])
    left, walls = without_spurs(edge)
    np.testing.assert_array_equal(left, [[-10.0, 5.0], [50.0, 5.0], [130.0, 5.0]])
    spur = shapely.LineString([(50.0, 4.98), (50.0, 3.0), (52.0, 1.0)])
    assert len(walls) == 1
    assert shapely.within(spur, shapely.buffer(walls[0], 1e-9))  # rounding
    assert shapely.area(walls[0]) == pytest.approx(shapely.length(spur) * SPUR_M, rel=0.01)  # begins a thickness beside the edge


@pytest.mark.parametrize(
    "edge",
    [
        [(-10.0, 5.0), (50.0, 5.0), (50.0, 1.0), (50.02, 1.0), (50.02, 5.0), (130.0, 5.0)],  # as thin as it is, it has a width
        [(0.0, 0.0), (8.0, 0.0), (8.0, 8.0), (0.0, 0.0)],
    ],
)
def test_an_edge_without_spurs_is_kept(edge: list[tuple[float, float]]) -> None:
    left, walls = without_spurs(np.array(edge))
    np.testing.assert_array_equal(left, edge)
    assert walls == []


@pytest.mark.parametrize(
    "edge", [[(50.0, 1.0), (30.0, 1.0), (50.0, 1.0)], [(30.0, 1.0), (40.0, 1.0), (50.0, 1.0), (40.0, 1.0), (30.0, 1.0)]]
)
def test_an_edge_that_is_drawn_out_and_back_is_one_beside_another_kerb_too(edge: list[tuple[float, float]]) -> None:
    """It bounded nothing: a bus drove over it."""
    left, walls = without_spurs(np.array(edge))
    assert shapely.LineString(left).normalize().equals(shapely.LineString([(30.0, 1.0), (50.0, 1.0)]))
    assert (len(left) < len(edge), walls) == (True, [])


def test_what_an_edge_draws_twice_along_itself_is_no_wall() -> None:
    left, walls = without_spurs(np.array([[-10.0, 5.0], [60.0, 5.0], [40.0, 5.0], [130.0, 5.0]]))
    np.testing.assert_array_equal(left, [[-10.0, 5.0], [40.0, 5.0], [130.0, 5.0]])
    assert walls == []


@pytest.mark.parametrize(
    ("label", "said"),
    [
        ("", "an obstacle"),
        ("hedge", "the obstacle 'hedge'"),
        (EDGE, "the edge"),
        ("EDGE_LEFT", "the edge 'EDGE_LEFT'"),
        ("far kerb", "the kerb 'far kerb'"),
    ],
)
def test_what_bounds_legs_is_called_what_it_is(label: str, said: str) -> None:
    assert called(label) == said
