from dataclasses import replace

import numpy as np
import pytest

from hdvplan.arrays import FloatArray
from hdvplan.centring.stationary import CentringTable, stationary
from hdvplan.driving.drive import Drive
from hdvplan.judging.balance import balance_of
from hdvplan.judging.bodies import contact
from hdvplan.judging.envelope import Envelope
from hdvplan.planning.objectives import geometric
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import stations_of
from hdvplan.road.limits import Limits
from hdvplan.road.path import ReferencePath, from_samples
from hdvplan.road.road import Road
from hdvplan.vehicle.kinematics import axles_behind
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.chains import arc, on_road, three_units, winding


def executed(path: ReferencePath, vehicle: Vehicle, state: FloatArray, limits: Limits | None = None) -> Drive:
    """Return a drive that holds one road-aligned state, or goes through one a pose, over all of the road."""
    road = Road("road", path, limits)
    stations = stations_of(road, vehicle, CentringTable.of(vehicle), step=0.5, horizon=20.0)
    poses_s = np.asarray(0.25 * np.arange(round(path.length / 0.25) + 1), float)
    poses = np.ascontiguousarray(np.broadcast_to(state, (len(poses_s), vehicle.states)))
    kappa = np.zeros((len(poses_s) - 1) // 2)
    return Drive(
        road,
        vehicle,
        PlannerSettings(horizon=20.0),
        stations,
        geometric(stations, vehicle),
        poses[::2],
        kappa,
        poses_s,
        poses,
        np.zeros(len(poses_s) - 1),
        (),
        0.0,
    )


def straight(length: float = 60.0) -> ReferencePath:
    return arc(0.0, length)


def limits(s: list[float], left: list[float], right: list[float], *, sweep: float = 0.0) -> Limits:
    wide, narrow = np.array(left), -np.array(right)
    return Limits(np.array(s), wide, narrow, wide + sweep, narrow - sweep)


@pytest.mark.parametrize("vehicle", [load_vehicle("bus"), load_vehicle("tractor-trailer"), three_units()], ids=lambda v: v.name)
def test_driving_straight_sweeps_half_the_width_and_the_offset(vehicle: Vehicle) -> None:
    state = np.zeros(vehicle.states)
    state[0] = 0.2
    found = Envelope(executed(straight(), vehicle, state))
    for unit, left, right in zip(vehicle.units, found.left, found.right, strict=True):
        seen = np.isfinite(left) & (found.s < found.s[np.isfinite(left)][-1])  # but for the one that only a front edge touches
        assert np.max(np.abs(left[seen] - (0.2 + 0.5 * unit.width))) < 1e-9
        assert np.max(np.abs(right[seen] - (0.2 - 0.5 * unit.width))) < 1e-9
    middle = slice(80, 160)  # every body passes here
    assert np.max(np.abs(found.reach_left[middle] - (0.2 + 0.5 * vehicle.width))) < 1e-9


def test_an_envelope_knows_where_a_trailer_never_was() -> None:
    vehicle = load_vehicle("tractor-trailer")
    found = Envelope(executed(straight(), vehicle, np.zeros(3)))
    assert np.all(np.isfinite(found.left[0]))
    # the coupling ends 0.30 m ahead of the tractor's axle, which ends on the road's last station
    assert np.max(found.s[np.isfinite(found.left[1])]) == pytest.approx(60.0)
    assert found.s[0] == 0.0
    assert found.s[-1] == pytest.approx(60.0)


def test_rounding_leaves_no_station_without_a_reach() -> None:
    bus = load_vehicle("bus")
    blunt = replace(bus, units=(replace(bus.lead, rear_overhang=0.0),))  # its rear edge begins on the road's first station
    done = executed(straight(), blunt, np.zeros(2))
    late = replace(done, poses_s=done.poses_s + 1e-9)  # as coordinates of a million metres are rounded
    found = balance_of(late)
    assert (found.max_left, found.max_right) == pytest.approx((1.27, 1.27), abs=1e-9)
    assert found.mean_abs_imbalance == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("name", ["bus", "tractor-trailer", "tractor-trailer-paper"])
def test_a_vehicle_in_a_circle_sweeps_the_analytic_radii(name: str, sign: float) -> None:
    vehicle, radius = load_vehicle(name), 15.0
    circle = stationary(vehicle, np.array([1.0 / radius]))
    lead = 1.0 / circle.kappa[0]
    last = lead
    if len(vehicle.units) > 1:
        last = np.sqrt(lead**2 + vehicle.lead.hitch_offset**2 - vehicle.units[1].wheelbase ** 2)
    outer, inner = np.hypot(lead + 1.27, vehicle.lead.front), last - 1.27
    state = sign * np.concatenate([[radius - lead, 0.0], circle.beta[0]])
    found = Envelope(executed(arc(sign / radius, 80.0), vehicle, state))
    outside, inside = (-found.reach_right, found.reach_left) if sign > 0.0 else (found.reach_left, -found.reach_right)
    passed = slice(100, 260)  # the whole vehicle passes here
    # chord against arc between poses and outline points 0.25 m apart
    assert np.max(np.abs(outside[passed] - (outer - radius))) < 2e-3
    assert np.max(np.abs(inside[passed] - (radius - inner))) < 2e-3


def closed_ring(radius: float = 20.0) -> ReferencePath:
    """Return a circle to the left, driven once round."""
    turned = np.linspace(0.0, 2.0 * np.pi, 252)
    x, y, curvature = radius * np.sin(turned), radius * (1.0 - np.cos(turned)), np.full(252, 1.0 / radius)
    return from_samples(x, y, turned, curvature, 2.0 * np.pi * radius / 251, closed=True)


def test_what_is_swept_beyond_the_end_of_a_closed_road_counts_at_its_begin() -> None:
    vehicle, radius, ring = load_vehicle("bus"), 20.0, closed_ring()
    lead = 1.0 / stationary(vehicle, np.array([1.0 / radius])).kappa[0]
    done = executed(ring, vehicle, np.array([radius - lead, 0.0]))
    outside = -Envelope(done).reach_right
    # The front corner stands ahead of the first metres, and comes there at the end of the round.
    assert np.max(np.abs(outside[:20] - outside[200])) < 2e-3  # chord against arc, as above
    assert contact(done, 0, "right", 2.0) == "front corner"


def test_a_limit_at_a_lap_s_end_holds_for_what_stands_there_at_the_start() -> None:
    vehicle, ring = load_vehicle("bus"), closed_ring()
    states = np.zeros((round(ring.length / 0.25) + 1, 2))
    states[0, 0] = 0.5  # it begins left of the line, and drives the rest of the lap on it
    done = executed(ring, vehicle, states, limits([0.0, 123.0, 124.0, 125.0, ring.length], [3.0, 3.0, 1.5, 3.0, 3.0], [9.0] * 5))
    (breach,) = balance_of(done).breaches
    assert (breach.side, breach.part) == ("left", "rear overhang")
    assert breach.s_deepest == pytest.approx(124.0)
    # its side lies 1.77 m inside the tangent at the start, so 18.23 m from the centre; chord against arc, as above
    assert breach.depth == pytest.approx(20.0 - 18.23 / np.cos((ring.length - 124.0) / 20.0) - 1.5, abs=2e-3)


def test_the_envelope_holds_every_dense_outline_point_of_a_winding_drive() -> None:
    vehicle, path = three_units(), winding()
    s = np.linspace(0.0, 2.0 * np.pi, 441)
    states = np.column_stack([0.5 * np.sin(s), 0.1 * np.cos(2.0 * s), 0.2 * np.sin(s), -0.2 * np.sin(3.0 * s)])
    done = executed(path, vehicle, states)
    found = Envelope(done)
    sides = [
        np.concatenate(
            [np.column_stack([np.linspace(-u.rear_overhang, u.front, 97), np.full(97, w)]) for w in (0.5 * u.width, -0.5 * u.width)]
        )
        for u in vehicle.units
    ]
    longer = done.stations.path
    for i in (120, 200, 277, 350):
        for unit, places in enumerate(on_road(vehicle, longer, float(done.poses_s[i]), done.poses_z[i], sides)):
            ahead = sides[unit][:, 0] - axles_behind(vehicle)[unit]
            foot, offset = longer.project(places[:, 0], places[:, 1], float(done.poses_s[i]) + ahead)
            inside = (foot > 1.0) & (foot < 109.0)
            left = np.interp(foot[inside], found.s, found.left[unit])
            right = np.interp(foot[inside], found.s, found.right[unit])
            # between stations 0.25 m apart a corner's peak is cut by up to 0.25 m times the slope of the envelope's kink
            assert np.max(offset[inside] - left) < 0.01
            assert np.max(right - offset[inside]) < 0.01


def test_a_limit_that_is_broken_is_found_with_its_place_depth_side_and_body() -> None:
    vehicle = load_vehicle("tractor-trailer")
    dip = limits([0.0, 30.0, 32.0, 34.0, 60.0], [2.0, 2.0, 1.0, 2.0, 2.0], [2.0] * 5)
    found = balance_of(executed(straight(), vehicle, np.zeros(3), dip))
    (breach,) = found.breaches
    assert breach.side == "left"
    assert breach.s_deepest == pytest.approx(32.0)
    assert breach.depth == pytest.approx(0.27, abs=1e-9)  # half width 1.27 m against 1.0 m
    # the limit falls below 1.26 m at 30 + 2 * 0.74 = 31.48 m: stations at 31.50 and 32.50 m
    assert breach.s_from == pytest.approx(31.5)
    assert breach.s_to == pytest.approx(32.5)
    assert found.min_clearance == pytest.approx(-0.27, abs=1e-9)
    assert found.violation == pytest.approx(0.27, abs=1e-9)


def test_a_breach_on_the_right_names_the_body_that_is_deepest() -> None:
    vehicle = load_vehicle("tractor-trailer")
    state = np.array([0.0, 0.0, -0.1])  # the trailer's tail hangs to the right of a straight tractor
    narrow = limits([0.0, 40.0, 41.0, 42.0, 60.0], [9.0] * 5, [9.0, 9.0, 1.5, 9.0, 9.0])
    found = balance_of(executed(straight(), vehicle, state, narrow))
    (breach,) = found.breaches
    assert (breach.side, breach.unit) == ("right", 1)
    # The kerb's point is deepest where it is as far beyond the trailer's side as it is ahead of its rear, which is 12.43 m behind the
    # coupling. Between two poses, 0.25 m apart, the trailer swings back; in the first one from there on the point is nearer to its side.
    deepest = (12.43 * np.tan(0.1) - 1.5 / np.cos(0.1) + 1.27) / (1.0 + np.tan(0.1))
    assert deepest - 0.25 * np.tan(0.1) <= breach.depth <= deepest


@pytest.mark.parametrize(("reach", "regions"), [(2.2, []), (1.65, ["drivable"])])
def test_an_overhang_may_sweep_where_wheels_may_not(reach: float, regions: list[str]) -> None:
    vehicle = load_vehicle("bus")
    # It drives straight on towards the left kerb, and is nearest at the end: the front corner reaches 9.34 sin 0.1 + 1.27 cos 0.1 = 2.196,
    # the front axle's side 1.863.
    states = np.stack([np.tan(0.1) * (0.25 * np.arange(241) - 60.0), np.full(241, 0.1)], axis=1)
    done = executed(straight(), vehicle, states, limits([0.0, 60.0], [reach] * 2, [9.0] * 2, sweep=0.6))
    found = balance_of(done)
    assert [breach.region for breach in found.breaches] == regions
    corner, axle = 9.34 * np.sin(0.1) + 1.27 * np.cos(0.1), 6.0 * np.sin(0.1) + 1.27 * np.cos(0.1)
    assert found.min_clearance == pytest.approx(min(reach + 0.6 - corner, reach - axle), abs=1e-9)  # rounding: a path of quintics
