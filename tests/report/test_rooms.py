"""What results say of rooms, obstacles, wheels and steering."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from hdvplan.answers import room_text
from hdvplan.api import drive_case, plan
from hdvplan.arrays import FloatArray, IntArray
from hdvplan.case import Case
from hdvplan.driving.drive import Drive
from hdvplan.judging.balance import balance_of
from hdvplan.judging.bodies import corners, pose_at, wheel_tracks
from hdvplan.judging.clearance import approaches
from hdvplan.judging.envelope import steering_of, steering_texts
from hdvplan.judging.result import Result, result_of
from hdvplan.judging.sentences import breach_text
from hdvplan.judging.verdict import verdict_details, verdict_line, verdict_of
from hdvplan.planning.settings import PlannerSettings
from hdvplan.report.compared import answer_of
from hdvplan.report.kerbs import shown_kerbs
from hdvplan.report.layers import drawn_features
from hdvplan.report.rooms import breach_place, pose_touching, room_at, shared_with, tightest_windows, tightness
from hdvplan.road.path import from_curvature
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.vehicle.kinematics import wheels_of
from hdvplan.vehicle.load import load_vehicle


def beside_a_van(straight: Result, y: float) -> Result:
    """Return the straight drive, 1.27 m to either side, with a van whose side lies at ``y`` [m]."""
    road = replace(straight.drive.road, regions=(Region(Kind.OBSTACLE, shapely.box(40.0, y, 45.0, y + 2.0), "van"),))
    drive = replace(straight.drive, road=replace(road.within(straight.drive.road.limits)))
    return result_of(drive, solver="riccati", objective="geometric")


@pytest.mark.parametrize("name", ["bus", "kerbed", "straight", "near", "hit"])
def test_the_tightest_place_has_the_verdict_s_number(name: str, straight: Result, request: pytest.FixtureRequest) -> None:
    made = {"near": 1.5, "hit": 1.0}
    result = beside_a_van(straight, made[name]) if name in made else request.getfixturevalue(name)
    room, verdict = room_at(result, int(np.argmax(tightness(result)))), verdict_of(result)
    assert -room.depth == pytest.approx(verdict.spare, abs=1e-9)  # the same doubles, added in another order
    assert room.s == pytest.approx(verdict.s, abs=1e-9)
    assert room.broken == (verdict.fits is False)
    assert room.obstacle == ("van" if name in made else None)
    if not room.broken:
        assert np.hypot(*(room.ends[1] - room.ends[0])) == pytest.approx(-room.depth, abs=1e-6)


@pytest.mark.parametrize("name", ["trailer", "kerbed"])
def test_what_is_enlarged_is_named_by_the_tightest_place_in_it(name: str, request: pytest.FixtureRequest) -> None:
    result: Result = request.getfixturevalue(name)
    score, s = tightness(result), result.envelope.s
    for window in tightest_windows(result):
        assert window.room is not None
        depth = window.room.depth if window.room.limited else -window.room.depth  # without limits it is less the reach
        assert depth == pytest.approx(np.max(score[(s >= window.s_from) & (s <= window.s_to)]))


def test_a_comparison_of_vehicles_that_fit_has_no_negative_room(straight: Result) -> None:
    touching = beside_a_van(straight, 1.265)
    assert -0.01 < (verdict_of(touching).spare or 0.0) < 0.0  # limits are kept to 1 cm
    assert answer_of((touching,)).endswith(f"; {room_text(0.0, fits=True)} for the bus")


def test_a_van_that_is_hit_is_drawn_where_it_was_hit(straight: Result) -> None:
    result = beside_a_van(straight, 1.0)
    (breach,) = result.balance.breaches
    s, offset = breach_place(result, breach)
    assert 40.0 <= s <= 45.0 + 1e-9  # rounding of doubles
    assert 1.0 <= offset <= 1.275  # the bus keeps straight to a millimetre
    (conflict,) = [feature for feature in drawn_features(result) if feature.layer == "conflicts"]
    assert conflict.properties["obstacle"] == "van"
    assert conflict.geometry.area == pytest.approx(5.0 * 0.27, rel=0.01)  # likewise


def test_however_many_vans_are_hit_the_bodies_are_placed_once(straight: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    vans = [shapely.box(s, 1.0, s + 1.0, 3.0) for s in np.arange(10.0, 70.0, 4.0)]
    regions = tuple(Region(Kind.OBSTACLE, van, str(number)) for number, van in enumerate(vans))
    road = replace(straight.drive.road, regions=regions).within(straight.drive.road.limits)
    result = result_of(replace(straight.drive, road=road), solver="riccati", objective="geometric")
    calls: list[IntArray] = []

    def counted(drive: Drive, numbers: IntArray) -> FloatArray:
        calls.append(numbers)
        return corners(drive, numbers)

    monkeypatch.setattr("hdvplan.judging.result.corners", counted)
    conflicts = [feature for feature in drawn_features(result) if feature.layer == "conflicts"]
    assert len(calls) == 1  # once for each takes minutes where there are thousands
    assert {feature.properties["obstacle"] for feature in conflicts} == {str(number) for number in range(len(vans))}
    for feature in conflicts:
        assert vans[int(str(feature.properties["obstacle"]))].buffer(1e-9).contains(feature.geometry)


def test_the_vehicle_stands_where_it_is_tightest(kerbed: Result) -> None:
    room = room_at(kerbed, int(np.argmax(tightness(kerbed))))
    (bodies,) = corners(kerbed.drive, np.array([pose_touching(kerbed, room)]))
    # The touch lies between two poses, which are 0.25 m apart: the nearer one is off by half of that at most.
    assert shapely.distance(shapely.Polygon(bodies[room.unit]).exterior, shapely.Point(room.ends[0])) < 0.125


def test_the_place_of_the_nearest_approach_is_told_on_the_road_in_the_plane_and_on_the_body(straight: Result) -> None:
    hit = Region(Kind.OBSTACLE, shapely.box(50.0, -3.0, 51.0, -1.0))
    (touched,) = approaches(replace(straight.drive, road=replace(straight.drive.road, regions=(hit,))))
    assert (touched.side, touched.unit) == ("right", 0)
    assert touched.x == pytest.approx(touched.s, abs=1e-6)  # a straight along x
    assert touched.y == pytest.approx(-1.0, abs=1e-6)
    assert touched.s_from == pytest.approx(50.0, abs=1e-6)
    assert touched.s_to == pytest.approx(51.0, abs=1e-6)


def test_a_post_that_a_corner_swings_over_between_two_poses_is_hit() -> None:
    bend = Road("bend", from_curvature(np.array([0.0, 30.0, 38.0, 80.0]), np.array([0.0, 0.0, 0.09, 0.09])))
    drive = drive_case(Case(bend, load_vehicle("bus"), settings=PlannerSettings(horizon=40.0)))
    first = pose_at(drive, 50.0)
    left, right = np.mean(corners(drive, np.array([first, first + 1]))[:, 0, :2], axis=0)  # its front corners, half-way between two poses
    post = Region(Kind.OBSTACLE, shapely.Point(right + 0.02 * (left - right) / 2.54).buffer(0.01))
    driven = replace(drive, road=replace(bend, regions=(post,)))
    (hit,) = approaches(driven)
    assert (hit.side, hit.part) == ("right", "front corner")
    assert (
        -0.03 < hit.distance < -0.01
    )  # the post is 3 cm within the path of the corner, which crosses the body's sides at half right angles
    drawn = shared_with(result_of(driven, solver="riccati", objective="geometric"), hit)
    assert drawn.area == pytest.approx(post.polygon.area, rel=0.01)  # of poses alone nothing, and of a wall teeth


def test_an_obstacle_that_is_hit_is_one_breach_with_its_depth_in_the_plane(straight: Result) -> None:
    boxes = (shapely.box(50.0, -3.0, 51.0, -1.0), shapely.box(60.0, 1.262, 61.0, 3.0))  # 0.27 m, and 8 mm: within what counts as kept
    road = replace(straight.drive.road, regions=tuple(Region(Kind.OBSTACLE, box, "bin") for box in boxes)).with_limits(3.0, 3.0)
    drive = replace(straight.drive, road=road)
    judged = replace(straight, drive=drive, balance=balance_of(drive))
    (breach,) = judged.balance.breaches
    assert (breach.obstacle, breach.side, breach.unit) == ("bin", "right", 0)
    assert breach.depth == pytest.approx(0.27, abs=1e-6)
    assert judged.balance.min_clearance == -breach.depth
    assert judged.clearance is not None
    assert np.min(judged.clearance) == -breach.depth  # over arclength as well: the limits along s jump a cell early
    assert "enters the obstacle 'bin' by 0.270 m" in breach_text(judged, breach)
    assert judged.entered == ()
    assert "beyond the obstacle 'bin'" in verdict_line(judged, verdict_of(judged))


def test_an_obstacle_that_closes_the_street_tells_what_lacks_to_it_and_to_the_kerb() -> None:
    wall = shapely.box(29.0, -3.6, 31.0, 2.5)  # leaves 1.0 m to the left
    road = Road("shut", from_curvature(np.array([0.0, 60.0]), np.array([0.0, 0.0])), regions=(Region(Kind.OBSTACLE, wall, "wall"),))
    judged = plan(Case(road.with_limits(3.5, 3.5), load_vehicle("bus")))
    left = max(breach.depth for breach in judged.balance.breaches if (breach.obstacle, breach.side) == (None, "left"))
    hit = -judged.approaches[0].distance
    assert hit > left
    assert f"; {left:.2f} m beyond the left limit as well; " in verdict_details(judged, verdict_of(judged))
    assert hit + left > 2.54 - 1.0 - 0.01  # what lacks beside both is at least what the vehicle is too wide by


def test_the_clearance_over_s_is_to_the_obstacle_all_along_it(straight: Result) -> None:
    wedge = shapely.Polygon([(20.0, 1.5), (30.0, 2.0), (30.0, 5.0), (20.0, 5.0)])
    bin_ = shapely.box(50.0, 1.0, 52.0, 2.0)
    road = replace(straight.drive.road, regions=tuple(Region(Kind.OBSTACLE, one) for one in (wedge, bin_))).with_limits(3.0, 3.0)
    drive = replace(straight.drive, road=road)
    judged = replace(straight, drive=drive, balance=balance_of(drive))
    assert judged.clearance is not None
    s = judged.envelope.s
    wanted = np.where((s >= 20.0) & (s <= 30.0), 0.23 + 0.05 * (s - 20.0), np.where((s >= 50.0) & (s <= 52.0), -0.27, 1.73))
    sure = np.min(np.abs(s[:, None] - [20.0, 30.0, 50.0, 52.0]), axis=1) > 0.5  # beside an end the least is that of both
    np.testing.assert_allclose(judged.clearance[sure], wanted[sure], atol=0.025)  # the wedge rises by 1.9 cm over the places looked at


def test_every_axle_has_a_wheel_on_either_side() -> None:
    vehicle = load_vehicle("tractor-trailer")
    wheels = wheels_of(vehicle)
    assert [(wheel.unit, wheel.axle, wheel.side) for wheel in wheels] == [
        (unit, axle, side) for unit, axle in ((0, "front"), (0, "rear"), (1, "axle")) for side in ("left", "right")
    ]
    assert wheels[0].ahead == vehicle.lead.wheelbase
    assert wheels[0].left == -wheels[1].left == 0.5 * vehicle.lead.width


def test_wheels_of_an_axle_stay_a_width_apart_in_a_bend_and_the_trailer_cuts_in(trailer: Result) -> None:
    tracks = {(track.wheel.unit, track.wheel.axle, track.wheel.side): track.points for track in wheel_tracks(trailer.drive)}
    for unit, axle in ((0, "front"), (0, "rear"), (1, "axle")):
        apart = np.hypot(*(tracks[unit, axle, "left"] - tracks[unit, axle, "right"]).T)
        np.testing.assert_allclose(apart, trailer.drive.vehicle.units[unit].width, rtol=1e-12)  # rounding of doubles
    path, middle = trailer.drive.stations.path, {}
    for key in ((0, "front"), (1, "axle")):
        points = 0.5 * (tracks[*key, "left"] + tracks[*key, "right"])
        at = len(points) // 2  # in the roundabout, which turns left
        near = float(trailer.drive.poses_s[at]) + (5.0 if key[0] == 0 else -10.0)
        middle[key] = float(path.project(points[at, 0], points[at, 1], near)[1])
    assert middle[1, "axle"] > middle[0, "front"]


def test_tracks_and_kerbs_end_beyond_the_road_where_wheels_and_bodies_are_no_longer_judged(straight: Result) -> None:
    vehicle, end = straight.drive.vehicle, straight.drive.road.path.length
    assert straight.drive.poses_s[-1] > end + vehicle.lead.rear_overhang  # it is driven until all of it has left the road
    for track in wheel_tracks(straight.drive):
        assert np.max(track.points[:, 0]) == pytest.approx(end + track.wheel.ahead, abs=0.26)  # a pose
    for kerb in shown_kerbs(straight):
        assert kerb.line.bounds[2] == pytest.approx(end + vehicle.reach_ahead, abs=1e-5)  # rounding of arclengths


def steered(result: Result, kappa: FloatArray) -> list[str]:
    drive = replace(result.drive, kappa=kappa)
    return steering_texts(drive, steering_of(drive))


def gentle(result: Result) -> FloatArray:
    return np.zeros(len(result.drive.kappa))


def test_shares_are_those_of_the_vehicles_limits(straight: Result) -> None:
    kappa, vehicle = gentle(straight), straight.drive.vehicle
    kappa[40:] = 0.5 * vehicle.max_curvature_rate * straight.drive.settings.step
    found = steering_of(replace(straight.drive, kappa=kappa))
    assert found.rate.share == pytest.approx(0.5)
    assert found.rate.s == 20.0  # of the 40th step of half a metre
    assert found.curvature.share == pytest.approx(kappa[-1] / vehicle.max_curvature)


def test_steering_that_is_used_up_is_told_with_its_place(straight: Result) -> None:
    kappa = gentle(straight)
    kappa[60:64] = 0.97 * straight.drive.vehicle.max_curvature
    texts = steered(straight, kappa)
    assert texts[0] == "the plan uses 97 % of the steering at s = 30.0 m, over 95 % along 2.0 m of road"
    assert "of the steering rate at s = " in texts[1]
    given = replace(straight.drive, kappa=kappa, plans=())  # a path of one's own
    assert steering_texts(given, steering_of(given))[0] == texts[0].replace("the plan", "the path")


@pytest.mark.parametrize(("apart", "told"), [(8.0, True), (30.0, False)])
def test_a_swing_from_lock_to_lock_counts_within_the_vehicles_length(straight: Result, *, apart: float, told: bool) -> None:
    kappa, most = gentle(straight), straight.drive.vehicle.max_curvature
    kappa[40:44], kappa[40 + int(2 * apart) :][:4] = 0.9 * most, -0.9 * most  # the bus is 12 m long
    texts = steered(straight, kappa)
    assert any("from lock to lock" in text for text in texts) is told
