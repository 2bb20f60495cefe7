"""Streets drawn around a drive that is known, integrated here: a plan finds its way, and is judged by poses every 2 cm."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from hdvplan import api
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.finer import replanned
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import verdict_of
from hdvplan.road.line import Line, RawRoad, smoothed
from hdvplan.road.options import RoadOptions
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle

STEP_M = 0.02
LENGTH_M, REST_M = 150.0, 35.0  # driven, and of it beyond the end of the line
BLOCK_M = 200.0


def rates(vehicle: Vehicle, heading: FloatArray, kappa: float) -> tuple[FloatArray, FloatArray]:
    """Return how headings change, and how the lead rear axle moves, per metre that it rolls."""
    ahead = np.array([np.cos(heading[0]), np.sin(heading[0])])
    moves, turns = ahead, [kappa]
    for before, unit, of_before, own in zip(vehicle.units, vehicle.units[1:], heading, heading[1:], strict=False):
        coupling = moves + before.hitch_offset * turns[-1] * np.array([np.sin(of_before), -np.cos(of_before)])
        along, across = np.array([np.cos(own), np.sin(own)]), np.array([-np.sin(own), np.cos(own)])
        turns.append(float(across @ coupling) / unit.wheelbase)
        moves = float(along @ coupling) * along
    return np.array(turns), ahead


def poses_at(vehicle: Vehicle, place: FloatArray, heading: FloatArray) -> FloatArray:
    """Return x, y and heading of every unit's axle, (units, 3)."""
    found = [(place[0], place[1], heading[0])]
    for before, unit, of_before, own in zip(vehicle.units, vehicle.units[1:], heading, heading[1:], strict=False):
        x, y, _ = found[-1]
        x, y = x - before.hitch_offset * np.cos(of_before), y - before.hitch_offset * np.sin(of_before)
        found.append((x - unit.wheelbase * np.cos(own), y - unit.wheelbase * np.sin(own), own))
    return np.array(found)


def driven(vehicle: Vehicle, place: FloatArray, heading: FloatArray, kappa: FloatArray, step: float) -> FloatArray:
    """Return the poses of a vehicle that drives ``kappa`` (n,) [1/m], each for ``step`` [m]: (n + 1, units, 3)."""
    found = [poses_at(vehicle, place, heading)]
    for own in kappa:
        turns, _ = rates(vehicle, heading, own)
        turns, ahead = rates(vehicle, heading + 0.5 * step * turns, own)
        heading, place = heading + step * turns, place + step * ahead
        found.append(poses_at(vehicle, place, heading))
    return np.array(found)


def random_drive(vehicle: Vehicle, seed: int) -> FloatArray:
    """Return the poses of a drive that begins straight and then steers at random, within 0.8 of the largest curvature."""
    random = np.random.default_rng(seed)
    most, rate = 0.8 * vehicle.max_curvature, 0.6 * vehicle.max_curvature_rate
    kappa, target, at, now = [], 0.0, 25.0, 0.0
    for number in range(round(LENGTH_M / STEP_M)):
        s = number * STEP_M
        if at <= s < LENGTH_M - 5.0:
            target = random.uniform(-most, most) * random.choice([0.3, 0.6, 1.0])
            at = s + random.uniform(6.0, 20.0)
        now += float(np.clip(target - now, -rate * STEP_M, rate * STEP_M))
        kappa.append(now)
    return driven(vehicle, np.zeros(2), np.zeros(len(vehicle.units)), np.array(kappa[1:]), STEP_M)


def bodies(vehicle: Vehicle, poses: FloatArray, less: float = 0.0) -> list[NDArray[np.object_]]:
    """Return the rectangles of every unit at its poses, smaller by ``less`` on every side [m]."""
    found = []
    for unit, (x, y, heading) in zip(vehicle.units, np.moveaxis(poses, (1, 2), (0, 1)), strict=True):
        front, rear, half = unit.front - less, less - unit.rear_overhang, 0.5 * unit.width - less
        corners = [
            (x + ahead * np.cos(heading) - left * np.sin(heading), y + ahead * np.sin(heading) + left * np.cos(heading))
            for ahead, left in ((front, half), (rear, half), (rear, -half), (front, -half))
        ]
        found.append(np.array(shapely.polygons(np.stack([np.stack(corner, axis=1) for corner in corners], axis=1))))
    return found


def corner_of(pose: FloatArray, ahead: float, left: float) -> FloatArray:
    x, y, heading = pose
    return np.array([x + ahead * np.cos(heading) - left * np.sin(heading), y + ahead * np.sin(heading) + left * np.cos(heading)])


def edges_around(vehicle: Vehicle, poses: FloatArray, margin: float) -> tuple[FloatArray, FloatArray] | None:
    """Return left and right edges ``margin`` outside what is swept [m]; None where the drive meets itself."""
    area, *apart = shapely.get_parts(shapely.union_all(np.concatenate(bodies(vehicle, poses))).buffer(margin))
    if apart or len(area.interiors) > 0:
        return None
    ring = np.asarray(shapely.normalize(area).exterior.simplify(2e-3).coords)[:-1]
    ring = ring if shapely.LinearRing(ring).is_ccw else ring[::-1]
    last, lead = vehicle.units[-1], vehicle.lead
    ends = [(poses[0, -1], -last.rear_overhang - margin, last), (poses[-1, 0], lead.front + margin, lead)]
    (a, b), (c, d) = (
        [int(np.argmin(np.hypot(*(ring - corner_of(pose, ahead, side * (0.5 * unit.width + margin))).T))) for side in (1.0, -1.0)]
        for pose, ahead, unit in ends
    )
    count = len(ring)
    return np.roll(ring, -c, axis=0)[: (a - c) % count + 1][::-1], np.roll(ring, -b, axis=0)[: (d - b) % count + 1]


def road_around(vehicle: Vehicle, poses: FloatArray, edges: tuple[FloatArray, FloatArray]) -> Road:
    line = poses[: -round(REST_M / STEP_M) : 100, 0, :2]
    options = RoadOptions(smooth=5.0, max_curvature=vehicle.max_curvature)
    return smoothed(Line("around", RawRoad(line, edges=edges), options))[0]


def dense(result: Result) -> tuple[FloatArray, FloatArray]:
    """Return arclengths (n,) and poses (n, units, 3) of an executed plan every 2 cm, integrated anew from each kept pose to the next."""
    drive, path, s, poses = result.drive, result.drive.stations.path, [], []
    x, y = path.to_plane(drive.poses_s, drive.poses_z[:, 0])
    first = path.at(drive.poses_s).heading + drive.poses_z[:, 1]
    heading = first[:, None] - np.concatenate(
        [np.zeros((len(x), 1)), np.cumsum(drive.poses_z[:, 2 : 1 + len(drive.vehicle.units)], axis=1)], axis=1
    )
    for at, kappa in enumerate(drive.poses_kappa):
        chord = float(np.hypot(x[at + 1] - x[at], y[at + 1] - y[at]))
        arc = chord if abs(kappa) < 1e-9 else 2.0 / abs(kappa) * float(np.arcsin(0.5 * chord * abs(kappa)))
        count = int(np.ceil(arc / STEP_M))
        own = driven(drive.vehicle, np.array([x[at], y[at]]), heading[at], np.full(count, kappa), arc / count)
        assert np.hypot(own[-1, 0, 0] - x[at + 1], own[-1, 0, 1] - y[at + 1]) < 1e-4  # two integrations of a quarter of a metre
        poses.append(own[:-1])
        s.append(np.linspace(drive.poses_s[at], drive.poses_s[at + 1], count, endpoint=False))
    return np.concatenate(s), np.concatenate(poses)


def crosses(result: Result, edges: tuple[FloatArray, FloatArray], allowed: float) -> bool:
    """Return whether a body lies more than ``allowed`` over an edge [m]; once the lead axle has left the road, over one before its end."""
    s, poses = dense(result)
    path = result.drive.road.path
    end = path.at(np.array([path.length]))
    along = np.array([np.cos(end.heading[0]), np.sin(end.heading[0])])
    place, aside = np.array([end.x[0], end.y[0]]), 0.2 * BLOCK_M * np.array([-along[1], along[0]])
    beyond = shapely.Polygon([place + aside, place - aside, place - aside + BLOCK_M * along, place + aside + BLOCK_M * along])
    on = s <= path.length
    for edge, of_unit in itertools.product(edges, bodies(result.drive.vehicle, poses, allowed)):
        line = shapely.LineString(edge)
        before_end = shapely.difference(line, beyond)
        if np.any(shapely.intersects(line, of_unit[on])) or np.any(shapely.intersects(before_end, of_unit[~on])):
            return True
    return False


def answers(name: str, margin: float, seeds: range) -> list[float]:
    """Return what every plan around a known drive has to spare [m]; no YES may cross an edge."""
    vehicle, found = load_vehicle(name), []
    for seed in seeds:
        poses = random_drive(vehicle, seed)
        edges = edges_around(vehicle, poses, margin)
        if edges is not None:
            result = replanned(api.plan(Case(road_around(vehicle, poses, edges), vehicle)))
            verdict = verdict_of(result)
            assert verdict.spare is not None
            found.append(verdict.spare)
            assert not (verdict.fits and crosses(result, edges, KEPT_M + 2e-3)), seed  # chords of edges 2 mm, sweeps of the judge
    assert found
    return found


def test_a_known_drive_that_ends_in_a_bend_is_found() -> None:
    """Edges go on beyond the line's end, where the front must keep them until the lead axle has left the road."""
    assert min(answers("tractor-trailer", 0.05, range(2, 3))) >= -KEPT_M


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bus", "articulated-bus", "tractor-trailer", "a-double"])
@pytest.mark.parametrize(("margin", "share"), [(0.05, 0.98), (0.02, 0.95)])
def test_a_vehicle_finds_its_way_along_a_drive_with_centimetres_of_room(name: str, margin: float, share: float) -> None:
    found = np.array(answers(name, margin, range(12)))
    assert np.mean(found >= -KEPT_M) >= share
    assert np.min(found) >= -0.02  # what following the drive would lack, which is nothing, and the 2 cm that are allowed


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bus", "articulated-bus", "tractor-trailer", "a-double"])
def test_a_street_narrower_than_the_vehicle_is_never_a_yes(name: str) -> None:
    assert np.all(np.array(answers(name, -0.1, range(4))) < -KEPT_M)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bus", "articulated-bus", "tractor-trailer", "a-double"])
def test_what_is_lacking_is_no_more_than_following_a_known_drive_lacks(name: str) -> None:
    assert min(answers(name, -0.1, range(4))) >= -0.12  # following the drive lacks 10 cm
