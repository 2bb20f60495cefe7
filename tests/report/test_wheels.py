from __future__ import annotations

import numpy as np
import pytest

from hdvplan.judging.bodies import wheel_tracks
from hdvplan.judging.result import Result
from hdvplan.report.kerbs import shown_kerbs
from hdvplan.vehicle.kinematics import wheels_of
from hdvplan.vehicle.load import load_vehicle


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
