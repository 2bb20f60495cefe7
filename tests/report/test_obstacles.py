from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from hdvplan.api import drive_case, plan
from hdvplan.case import Case
from hdvplan.judging.balance import balance_of
from hdvplan.judging.bodies import corners, pose_at
from hdvplan.judging.clearance import approaches
from hdvplan.judging.result import Result, result_of
from hdvplan.judging.sentences import breach_text
from hdvplan.judging.verdict import verdict_details, verdict_line, verdict_of
from hdvplan.planning.settings import PlannerSettings
from hdvplan.report.rooms import shared_with
from hdvplan.road.path import from_curvature
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle


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
