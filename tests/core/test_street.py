"""How near bodies are to kerbs, against shapely; and how the gap changes as a body moves."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from hdvplan.arrays import FloatArray, Records
from hdvplan.road.pieces import Kerb
from hdvplan.road.street import rooms_of
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Unit, Vehicle
from tests.core.chains import few, units
from tests.core.twins.street import TO_JUDGE, TO_PLAN, deepest, dense, look, outline, protruding, signed, standing, street_of
from tests.nightly import nightly

NEAR = 1e-9  # rounding of coordinates of a kilometre, where kerbs go on, is 1e-13; shapely's distances square them
BUS = load_vehicle("bus")


@st.composite
def kerbs(draw: st.DrawFn) -> FloatArray:
    """Return a kerb of pieces of 0.3 to 6 m, within 1.5 m of a straight line eastwards, steep ones among them; 60 m long."""
    steps = draw(st.lists(st.tuples(st.floats(0.3, 6.0), st.floats(-1.5, 1.5)), min_size=3, max_size=25))
    x = np.concatenate([[-20.0], -20.0 + np.cumsum([step for step, _ in steps])])
    y = np.concatenate([[0.0], [offset for _, offset in steps]])
    inside = x < 40.0
    return np.stack([np.append(x[inside], 40.0), np.append(y[inside], 0.0)], axis=1)


@st.composite
def walls(draw: st.DrawFn) -> FloatArray:
    """Return a straight kerb of 60 m with a wall that stands into the street, up to 29 degrees from square to it, however thin."""
    turn, long, thick = draw(st.floats(-0.5, 0.5)), draw(st.floats(0.5, 8.0)), draw(st.one_of(st.floats(1e-5, 0.3), st.just(1e-3)))
    foot, tip = np.array([10.0, 0.0]), np.array([10.0 + long * np.sin(turn), -long * np.cos(turn)])
    wide = np.array([thick / np.cos(turn), 0.0])
    return np.array([[-20.0, 0.0], foot, tip, tip + wide, foot + wide, [40.0, 0.0]])


def beyond(points: FloatArray) -> shapely.Polygon:
    """Return the area to the left of a kerb eastwards that goes on at both ends."""
    far = np.array([[points[-1, 0] + 500.0, points[-1, 1]], [points[-1, 0] + 500.0, 300.0], [points[0, 0] - 500.0, 300.0]])
    return shapely.Polygon(np.vstack([[points[0, 0] - 500.0, points[0, 1]], points, far]))


def longer(points: FloatArray) -> FloatArray:
    return np.vstack([points[0] - [500.0, 0.0], points, points[-1] + [500.0, 0.0]])


def mirrored(points: FloatArray) -> FloatArray:
    return points * [1.0, -1.0]


poses = st.tuples(st.floats(-5.0, 20.0), st.floats(-5.0, 1.5), st.floats(-0.5, 0.5))
either = st.booleans()


def found_gaps(
    points: FloatArray, unit: Unit, pose: tuple[float, float, float], how: int, *, left: bool = True, wheels: bool = False
) -> FloatArray:
    """Return the gaps of a body's sections on both sides; on the right the whole scene is mirrored."""
    x, y, heading = pose
    kerb = Kerb(points if left else mirrored(points), points[:, 0], left, wheels)
    one = standing(x, y if left else -y, heading if left else -heading)
    found = look(street_of(kerb), Vehicle("one", (unit,)), np.array([x]), one, how)
    gaps: FloatArray = found["at"]["gap"][0, 0]
    return gaps


@given(points=st.one_of(kerbs(), walls()), unit=units(), pose=poses, left=either, wheels=either)
@few
def test_a_body_is_as_near_to_a_kerb_or_as_deep_beyond_it_as_shapely_finds(
    points: FloatArray, unit: Unit, pose: tuple[float, float, float], left: bool, wheels: bool
) -> None:
    gaps = found_gaps(points, unit, pose, TO_JUDGE, left=left, wheels=wheels)
    corners, whole = outline(unit, standing(*pose)[0, 0], wheels=wheels), longer(points)
    expected = deepest(corners, whole, left=True, beyond=beyond(points), stands=protruding(whole, left=True))
    assert np.min(gaps[0 if left else 1]) == pytest.approx(expected, abs=NEAR)
    assert np.all(np.isinf(gaps[1 if left else 0]))  # there is no other kerb
    body, line = shapely.Polygon(corners), shapely.LineString(whole)
    if not body.intersects(line) and expected > 0.0:
        apart = shapely.distance(body, line)
        ends = shapely.MultiLineString([corners[[1, 2]], corners[[3, 0]]])
        assert expected >= apart - NEAR
        assert expected == pytest.approx(apart, abs=NEAR) or shapely.distance(ends, line) == pytest.approx(apart, abs=NEAR)
    elif body.intersects(line):
        assert expected <= NEAR  # whatever overlaps is found


@pytest.mark.parametrize("left", [True, False])
def test_a_thin_wall_is_as_deep_in_a_body_in_thousands_of_pieces_as_in_few(left: bool) -> None:
    points = np.array([[-20.0, 2.0], [3.0, 2.0], [3.0, -2.0], [3.02, -2.0], [3.02, 2.0], [40.0, 2.0]])
    at = np.linspace(0.0, 5.0, 5 * 400 + 1)
    fine = np.stack([np.interp(at, np.arange(6), column) for column in points.T], axis=1)
    for y in (0.0, -1.0):
        few, many = (np.min(found_gaps(each, BUS.lead, (0.0, y, 0.0), TO_JUDGE, left=left)) for each in (points, fine))
        assert few == pytest.approx(-min(y + 2.0 + 0.5 * BUS.width, BUS.width), abs=NEAR)
        assert many == pytest.approx(few, abs=0.01)  # its points are 1 cm apart


@given(points=kerbs(), unit=units(), pose=poses, left=either)
@few
def test_planning_keeps_a_body_from_a_kerb_by_its_corners_on_that_side_and_the_kerb_s_own(
    points: FloatArray, unit: Unit, pose: tuple[float, float, float], left: bool
) -> None:
    steep = np.abs(np.diff(points[:, 1])) > np.diff(points[:, 0])
    assume(not np.any(steep))  # no walls
    corners, line = outline(unit, standing(*pose)[0, 0]), shapely.LineString(longer(points))
    gaps = list(signed(line, beyond(points), corners[2:]))
    x, y, heading = pose
    for place in protruding(longer(points), left=True)[0] - [x, y]:
        ahead, beside = place @ [np.cos(heading), np.sin(heading)], place @ [-np.sin(heading), np.cos(heading)]
        if -unit.rear_overhang <= ahead <= unit.front:
            gaps.append(beside - 0.5 * unit.width)
    found = found_gaps(points, unit, pose, TO_PLAN, left=left)
    assert np.min(found[0 if left else 1]) == pytest.approx(min(gaps), abs=NEAR)


@pytest.mark.parametrize("how", [TO_PLAN, TO_JUDGE])
@pytest.mark.parametrize("wheels", [False, True])
def test_a_kerb_is_as_near_in_thousands_of_pieces_as_in_few(how: int, wheels: bool) -> None:
    """Few are one block, thousands more blocks than are remembered."""
    rng = np.random.default_rng(4)
    for _ in range(25):
        x = np.linspace(-20.0, 40.0, 13)
        points = np.stack([x, rng.uniform(-1.0, 1.0, len(x))], axis=1)
        at = np.linspace(0.0, 12.0, 12 * 350 + 1)
        fine = np.stack([np.interp(at, np.arange(13), column) for column in points.T], axis=1)
        pose, left = (rng.uniform(-5.0, 20.0), rng.uniform(-4.0, 0.0), rng.uniform(-0.3, 0.3)), bool(rng.integers(2))
        few, many = (found_gaps(each, BUS.lead, pose, how, left=left, wheels=wheels) for each in (points, fine))
        np.testing.assert_allclose(np.clip(few, -1.5, 1.5), np.clip(many, -1.5, 1.5), atol=NEAR)  # further away a window ends
        assert np.min(few) < 4.0


@given(points=kerbs(), unit=units(), pose=poses, left=either, wheels=either)
@few
def test_the_gap_of_a_contact_grows_as_its_point_moves_along_its_direction(
    points: FloatArray, unit: Unit, pose: tuple[float, float, float], left: bool, wheels: bool
) -> None:
    step = 1e-6
    points = points if left else mirrored(points)
    street, vehicle = street_of(Kerb(points, points[:, 0], left, wheels)), Vehicle("one", (unit,))

    def seen(*at: float) -> Records:
        found: Records = look(street, vehicle, np.array([pose[0]]), standing(*at), TO_PLAN)[0, 0]["at"][0 if left else 1]
        return found

    here = (pose[0], pose[1] if left else -pose[1], pose[2])
    for section, contact in enumerate(seen(*here)):
        if contact["piece"] < 0 or abs(contact["gap"]) < 1e-3:  # so near to a kerb's corner directions turn within the step
            continue
        assert np.hypot(contact["along_x"], contact["along_y"]) == pytest.approx(1.0, abs=1e-12)  # rounding
        cos, sin = np.cos(here[2]), np.sin(here[2])
        arm = contact["ahead"] * np.array([cos, sin]) + contact["left"] * np.array([-sin, cos])
        along = np.array([contact["along_x"], contact["along_y"]])
        expected = [*along, along @ [-arm[1], arm[0]]]
        for number, rate in enumerate(expected):
            near = [seen(*(np.array(here) + sign * step * np.eye(3)[number]))[section] for sign in (-1.0, 1.0)]
            same = all(other["piece"] == contact["piece"] and abs(other["ahead"] - contact["ahead"]) < 1e-3 for other in near)
            if same:  # no other contact has become the tightest
                # rounding of 100 m over the step is 1e-8, and a direction to a corner 1 mm away turns by 1e-6 / 1e-3
                assert (near[1]["gap"] - near[0]["gap"]) / (2.0 * step) == pytest.approx(rate, abs=1e-4)


@given(points=kerbs(), unit=units(), pose=poses)
@few
def test_the_contact_names_the_point_of_the_body_and_the_place_of_the_kerb(
    points: FloatArray, unit: Unit, pose: tuple[float, float, float]
) -> None:
    kerb = Kerb(points, points[:, 0], left=True)
    for contact in look(street_of(kerb), Vehicle("one", (unit,)), np.array([pose[0]]), standing(*pose), TO_PLAN)[0, 0]["at"][0]:
        if contact["piece"] >= 0 and abs(contact["gap"]) > NEAR:
            cos, sin = np.cos(pose[2]), np.sin(pose[2])
            at = np.array(pose[:2]) + contact["ahead"] * np.array([cos, sin]) + contact["left"] * np.array([-sin, cos])
            on_kerb = at - contact["gap"] * np.array([contact["along_x"], contact["along_y"]])
            assert shapely.distance(shapely.LineString(longer(points)), shapely.Point(on_kerb)) < 1e-8  # as above, through a product
            assert contact["s"] == pytest.approx(on_kerb[0], abs=1e-6)  # s is x; a direction over a distance of a nanometre


@given(points=kerbs(), y=st.floats(-4.0, 1.0), x=st.floats(-5.0, 25.0))
@few
def test_the_room_beside_a_line_is_its_signed_distance_from_either_kerb(points: FloatArray, x: float, y: float) -> None:
    right = points - [0.0, 6.0]
    street = street_of(Kerb(points, points[:, 0], left=True), Kerb(right, points[:, 0], left=False))
    turns = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    around = 0.2 * np.stack([np.cos(turns), np.sin(turns)], axis=1)  # corners of kerbs are nearest in a wedge on one side of them
    for side, kerb, sign in ((0, points, 1.0), (1, right, -1.0)):
        at = np.vstack([[x, y], *(corner + around for corner in kerb[1:-1])])
        rooms = rooms_of(street, at[:, 0], at[:, 0], at[:, 1])[side]
        np.testing.assert_allclose(rooms, sign * signed(shapely.LineString(longer(kerb)), beyond(kerb), at), rtol=0.0, atol=NEAR)


@pytest.mark.parametrize("half_width", [nightly(3.0), 6.0, nightly(10.0)])
def test_inside_a_corner_of_a_wide_road_a_body_is_as_near_to_both_legs_as_it_is(half_width: float) -> None:
    """A body that cuts the corner is nearer to the other leg's kerb than the line is long between the two."""
    corner, unit = np.array([100.0 - half_width, half_width]), BUS.lead
    legs = np.array([[0.0, half_width], corner, [100.0 - half_width, 100.0]])
    s = np.arange(0.0, 201.0)
    bend = np.where(np.abs(s - 100.0) < 15.0, 0.5 * np.pi, 0.0)  # of a line with a right angle at s = 100
    line = np.stack([s, np.minimum(s, 100.0), np.maximum(s - 100.0, 0.0), 0.5 * np.pi * (s > 100.0), bend])
    street = street_of(Kerb(legs, np.array([0.0, 100.0, 200.0]), left=True), length=200.0, line=line)
    area = shapely.Polygon([*legs, (0.0, 100.0)])
    for x in np.arange(80.0, 100.0, 0.5):
        for y in np.arange(0.0, half_width, 0.5):
            for heading in np.arange(-0.3, 1.0, 0.3):
                one = standing(x, y, heading)
                expected = deepest(outline(unit, one[0, 0]), legs, left=True, beyond=area, stands=np.array([[corner], [(-1.0, 1.0)]]))
                if expected < 0.5:
                    found = np.min(look(street, BUS, np.array([x]), one, TO_JUDGE)["at"]["gap"])
                    assert found == pytest.approx(expected, abs=NEAR), (x, y, heading)


def test_another_arm_of_the_road_is_no_neighbour() -> None:
    wall = np.array([[10.0, -50.0], [10.0, 50.0]])  # across the body, but beside the line 200 m on
    other = Kerb(wall, np.array([200.0, 300.0]), left=True)
    own = Kerb(np.array([[-50.0, 3.0], [50.0, 3.0]]), np.array([-50.0, 50.0]), left=True)
    one = standing(5.0, 0.0, 0.0)
    for how in (TO_PLAN, TO_JUDGE):
        gaps = look(street_of(own, replace(other, goes_on=False)), BUS, np.array([5.0]), one, how)["at"]["gap"]
        assert np.min(gaps) == pytest.approx(3.0 - 0.5 * BUS.width, abs=NEAR)


def test_overhangs_are_measured_from_the_kerbs_that_wheels_must_keep() -> None:
    points = np.array([[-50.0, 2.0], [50.0, 2.0]])
    wheels, whole = Kerb(points, points[:, 0], left=True, wheels=True), Kerb(points + np.array([0.0, 0.5]), points[:, 0], left=True)
    found = look(street_of(wheels, whole), BUS, np.array([0.0]), standing(0.0, 0.0, 0.1))[0, 0]
    unit, half = BUS.lead, 0.5 * BUS.width
    reached = np.array([-unit.rear_overhang, unit.front]) * np.sin(0.1) + half * np.cos(0.1)
    np.testing.assert_allclose(found["overhang"]["gap"][0], 2.0 - reached, atol=NEAR)
    axle = 2.0 - min(unit.wheelbase, unit.front) * np.sin(0.1) - half * np.cos(0.1)
    assert np.min(found["at"]["gap"][0]) == pytest.approx(min(axle, 2.5 - reached[1]), abs=NEAR)
    assert np.all(np.isinf(found["overhang"]["gap"][1]))


def test_a_wall_across_the_street_leads_a_plan_nowhere_but_is_judged() -> None:
    """Where the street narrows at once, the wall's face would push a body back; its corner pushes aside."""
    step = np.array([[-50.0, 3.0], [8.0, 3.0], [8.0, 1.0], [50.0, 1.0]])
    street = street_of(Kerb(step, np.array([-50.0, 8.0, 8.0, 50.0]), left=True))
    one = standing(0.0, 0.2, 0.0)  # the front 1.34 m beyond the wall, the side 0.47 m
    unit = BUS.lead
    plan, judge = (look(street, BUS, np.array([0.0]), one, how)[0, 0]["at"][0] for how in (TO_PLAN, TO_JUDGE))
    deep = 0.2 + 0.5 * unit.width - 1.0
    assert np.min(plan["gap"]) == pytest.approx(-deep, abs=NEAR)
    assert plan["along_y"][np.argmin(plan["gap"])] == pytest.approx(-1.0)
    assert np.min(judge["gap"]) == pytest.approx(-min(deep, unit.front - 8.0), abs=NEAR)


@pytest.mark.parametrize("left", [True, False])
def test_a_plan_is_led_back_from_behind_a_kerb_s_corner_and_never_from_the_street_before_it(left: bool) -> None:
    """The kerb outside a hairpin ends where that of the next arm begins; a body there turns its other side to the corner."""
    points, s = np.array([[57.0, -20.0], [57.0, 12.0], [120.0, 12.0]]), np.array([0.0, 32.0, 95.0])
    sign = -1.0 if left else 1.0
    street = street_of(Kerb(points * [1.0, sign], s, left))
    for x, y, led in ((4.0, 12.0, False), (62.0, 10.0, True)):
        one = standing(x, sign * y, -sign * 0.5 * np.pi)
        gap = np.min(look(street, Vehicle("one", (BUS.lead,)), np.array([30.0]), one, TO_PLAN)["at"]["gap"])
        assert bool(gap < 0.0) is led


def test_a_body_that_leaves_the_road_keeps_beside_its_side_what_is_left_of_the_kerb() -> None:
    slanted = np.array([[-50.0, 3.0], [59.0, 1.4], [61.0, 1.0], [200.0, 1.0]])  # at the end, x = 60, 1.2 m from the line
    street = street_of(Kerb(slanted, slanted[:, 0], left=True), length=60.0)
    for how in (TO_PLAN, TO_JUDGE):
        found = look(street, BUS, np.array([62.0]), standing(62.0, 0.0, 0.0), how)[0, 0]["at"][0]
        assert np.min(found["gap"]) == pytest.approx(1.2 - 0.5 * BUS.width, abs=NEAR)


def test_both_ends_of_a_kerb_that_does_not_go_on_are_seen_beside_a_body_and_before_its_corners() -> None:
    half, ahead = 0.5 * BUS.width, BUS.lead.front
    for sign, left in ((1.0, True), (-1.0, False)):
        for x, y, expected in (
            (2.0, half - 0.1, -0.1),  # beside
            (ahead - 0.5, half + 0.2, 0.2),  # reaching beyond its front
            (ahead + 0.3, half + 0.4, 0.5),  # before its corner
            (-BUS.lead.rear_overhang - 1.3, half + 0.4, 0.5),  # behind: the end is nearest
        ):
            for last in (x + 1.0, x + 0.01):
                stub = Kerb(np.array([[x, sign * y], [last, sign * y]]), np.array([x, last]), left, goes_on=False)
                found = look(street_of(stub), BUS, np.array([0.0]), standing(0.0, 0.0, 0.0), TO_JUDGE)["at"]["gap"]
                nearest = expected if x > 0.0 else np.hypot(-BUS.lead.rear_overhang - last, y - half)
                assert np.min(found) == pytest.approx(nearest, abs=NEAR)


def least_of_bus(x: float, how: int, *kerbs: Kerb, clearance: float = 0.0) -> FloatArray:
    """Return the gaps of the bus's sections to both sides, eastwards on the line with its axle at x."""
    street = street_of(*kerbs)
    street.record["clearance"] = clearance
    gaps: FloatArray = look(street, Vehicle("one", (BUS.lead,)), np.array([x]), standing(x, 0.0, 0.0), how)["at"]["gap"][0, 0]
    return gaps


@pytest.mark.parametrize("how", [TO_PLAN, TO_JUDGE])
@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("wheels", [True, False])
def test_of_more_kerbs_than_are_looked_at_together_the_tightest_counts(how: int, first: bool, wheels: bool) -> None:
    """A body lies 0.5 m beyond one kerb, and twenty short ones on the same side are nearer to its corners."""
    half = 0.5 * BUS.width
    crossed = [dense([(0.0, half - 0.5), (60.0, half - 0.5)])]
    near = [dense([(27.0 + 0.6 * number, half + 0.1), (27.3 + 0.6 * number, half + 0.1)]) for number in range(20)]
    kerbs = [replace(kerb, wheels=wheels) for kerb in (crossed + near if first else near + crossed)]
    np.testing.assert_allclose(least_of_bus(30.0, how, *kerbs)[0], -0.5, atol=NEAR)
    assert rooms_of(street_of(*kerbs), np.full(1, 30.0), np.full(1, 30.0), np.full(1, half))[0] == pytest.approx(-0.5, abs=NEAR)


@pytest.mark.parametrize("how", [TO_PLAN, TO_JUDGE])
def test_of_two_kerbs_on_a_side_the_tightest_counts_also_where_the_other_is_nearer(how: int) -> None:
    half = 0.5 * BUS.width
    kerbs = [dense([(0.0, y), (60.0, y)]) for y in (half + 0.2, half - 0.5)]
    np.testing.assert_allclose(least_of_bus(30.0, how, *kerbs)[0], -0.5, atol=NEAR)


@pytest.mark.parametrize("ahead", [1.0, 0.2, -0.05, -0.5])
@pytest.mark.parametrize("clearance", [0.0, 0.3])
@pytest.mark.parametrize("narrows", [True, False])
def test_a_wall_across_the_street_counts_near_it_alone_and_on_both_sides_alike(ahead: float, clearance: float, narrows: bool) -> None:
    points = np.array(
        [[0.0, 3.0], [20.0, 3.0], [20.0, 1.0], [60.0, 1.0]] if narrows else [[0.0, 1.0], [20.0, 1.0], [20.0, 3.0], [60.0, 3.0]]
    )
    x = 20.0 - ahead - BUS.lead.front if narrows else 20.0 + ahead + BUS.lead.rear_overhang  # so far is its end before the wall
    left, right = (Kerb(points * [1.0, sign], points[:, 0], left=sign > 0.0) for sign in (1.0, -1.0))
    gaps = least_of_bus(x, TO_PLAN, left, right, clearance=clearance)
    np.testing.assert_allclose(gaps[0], gaps[1], atol=NEAR)
    inside = gaps[0, 1 if narrows else 0]
    if ahead > clearance:
        assert inside == np.inf
    else:
        assert inside == pytest.approx(1.0 - 0.5 * BUS.width, abs=NEAR)  # back beside the wall, not away from it


@pytest.mark.parametrize("heading", [0.5, 0.7])
def test_a_kerb_that_is_straight_but_for_jitter_leads_a_side_no_further_than_the_bodys_corner(heading: float) -> None:
    x = np.arange(-30.0, 30.0, 0.1)
    jitter = np.random.default_rng(1).uniform(-0.004, 0.004, len(x))
    pose = standing(0.0, 2.0 - BUS.lead.front * np.sin(heading), heading)  # its front corners about a metre beyond the kerb at most
    streets = (street_of(Kerb(np.stack([x, 2.0 + y], axis=1), x, left=True)) for y in (0.0 * x, jitter))
    plain, torn = (float(np.min(look(street, BUS, np.zeros(1), pose)["at"]["gap"][..., 0, :])) for street in streets)
    assert plain < 0.0
    assert plain - 0.005 - 0.06 * abs(plain) < torn < plain + 0.005  # a side is led at up to 18 degrees to the kerb


def test_a_kerb_of_few_pieces_that_comes_by_again_counts_beside_its_own_stretch_of_line_alone() -> None:
    points = np.array([[-30.0, 3.0], [30.0, 3.0], [60.0, 3.0], [60.0, 60.0], [10.0, 60.0], [10.0, -60.0]])
    kerb = Kerb(points, np.array([-30.0, 30.0, 60.0, 117.0, 167.0, 287.0]), left=True)
    found = look(street_of(kerb), BUS, np.array([8.0]), standing(8.0, 0.0, 0.0), TO_JUDGE)  # the bus stands across its last piece
    assert np.min(found["at"]["gap"][..., 0, :]) == pytest.approx(3.0 - 0.5 * BUS.width, abs=NEAR)
