"""Random drives, integrated here and not by hdvplan, streets drawn around what they sweep, and whether a plan crosses an edge."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray
from hdvplan.judging.result import Result
from hdvplan.road.line import Line, RawRoad, smoothed
from hdvplan.road.options import RoadOptions
from hdvplan.road.road import Road
from hdvplan.vehicle.model import Vehicle

STEP_M = 0.02
LENGTH_M, REST_M = 150.0, 35.0  # driven, and of it beyond the end of the line
BLOCK_M = 200.0
_EDGES = 4  # every fourth pose is looked at, and the hull from one to the next: a body's path is straight over 8 cm to 0.1 mm
_SAME_M = 1e-4  # of two integrations over a quarter of a metre


def rates(vehicle: Vehicle, heading: Sequence[float], kappa: float) -> list[float]:
    """Return how the units' headings change per metre that the lead rear axle rolls [rad/m]."""
    x, y = math.cos(heading[0]), math.sin(heading[0])  # the motion of the axle
    turns = [kappa]
    for before, unit, of_before, own in zip(vehicle.units, vehicle.units[1:], heading, heading[1:], strict=False):
        x += before.hitch_offset * turns[-1] * math.sin(of_before)
        y -= before.hitch_offset * turns[-1] * math.cos(of_before)
        along, across = x * math.cos(own) + y * math.sin(own), y * math.cos(own) - x * math.sin(own)
        turns.append(across / unit.wheelbase)
        x, y = along * math.cos(own), along * math.sin(own)
    return turns


def poses_at(vehicle: Vehicle, x: float, y: float, heading: Sequence[float]) -> list[tuple[float, float, float]]:
    """Return x, y and heading of every unit's axle."""
    found = [(x, y, heading[0])]
    for before, unit, of_before, own in zip(vehicle.units, vehicle.units[1:], heading, heading[1:], strict=False):
        x -= before.hitch_offset * math.cos(of_before) + unit.wheelbase * math.cos(own)
        y -= before.hitch_offset * math.sin(of_before) + unit.wheelbase * math.sin(own)
        found.append((x, y, own))
    return found


def driven(vehicle: Vehicle, place: FloatArray, heading: FloatArray, kappa: FloatArray, step: float) -> FloatArray:
    """Return the poses of a vehicle that drives ``kappa`` (n,) [1/m], each for ``step`` [m]: (n + 1, units, 3)."""
    (x, y), now = place.tolist(), heading.tolist()
    found = [poses_at(vehicle, x, y, now)]
    for own in kappa.tolist():
        middle = [angle + 0.5 * step * turn for angle, turn in zip(now, rates(vehicle, now, own), strict=True)]
        turns = rates(vehicle, middle, own)
        x, y = x + step * math.cos(middle[0]), y + step * math.sin(middle[0])
        now = [angle + step * turn for angle, turn in zip(now, turns, strict=True)]
        found.append(poses_at(vehicle, x, y, now))
    return np.array(found)


def random_drive(vehicle: Vehicle, seed: int, *, sudden: bool = False) -> FloatArray:
    """Return the poses of a drive that begins straight and then steers at random, within 0.8 of the largest curvature.

    With ``sudden`` it does so at once, which no driver can, and what is proved of all drives holds for, too.
    """
    random = np.random.default_rng(seed)
    most, rate = 0.8 * vehicle.max_curvature, 0.6 * vehicle.max_curvature_rate
    kappa, target, at, now = [], 0.0, 25.0, 0.0
    for number in range(round(LENGTH_M / STEP_M)):
        s = number * STEP_M
        if at <= s < LENGTH_M - 5.0:
            target = random.uniform(-most, most) * random.choice([0.3, 0.6, 1.0])
            at = s + random.uniform(6.0, 20.0)
        now += (target - now) if sudden else float(np.clip(target - now, -rate * STEP_M, rate * STEP_M))
        kappa.append(now)
    return driven(vehicle, np.zeros(2), np.zeros(len(vehicle.units)), np.array(kappa), STEP_M)


def bodies(vehicle: Vehicle, poses: FloatArray, less: float = 0.0) -> list[NDArray[np.object_]]:
    """Return the rectangles of every unit at its poses, smaller by ``less`` on every side [m]."""
    found = []
    for unit, pose in zip(vehicle.units, np.moveaxis(poses, (1, 2), (0, 1)), strict=True):
        front, rear, half = unit.front - less, less - unit.rear_overhang, 0.5 * unit.width - less
        corners = [corner_of(pose, *place).T for place in ((front, half), (rear, half), (rear, -half), (front, -half))]
        found.append(np.array(shapely.polygons(np.stack(corners, axis=1))))
    return found


def corner_of(pose: FloatArray, ahead: float, left: float) -> FloatArray:
    """Return the place (2, ...) of a point ahead of a unit's axle, at ``pose`` (3, ...), and left of its axis [m]."""
    x, y, heading = pose
    return np.array([x + ahead * np.cos(heading) - left * np.sin(heading), y + ahead * np.sin(heading) + left * np.cos(heading)])


def swept_by(vehicle: Vehicle, poses: FloatArray) -> BaseGeometry:
    """Return what all bodies sweep."""
    steps = [shapely.geometrycollections(np.stack([of[:-1], of[1:]], axis=1)) for of in bodies(vehicle, poses[::_EDGES])]
    return shapely.union_all(shapely.convex_hull(np.array(steps)))


def edges_around(vehicle: Vehicle, poses: FloatArray, margin: float) -> tuple[FloatArray, FloatArray] | None:
    """Return left and right edges ``margin`` outside what is swept [m]; None where the drive meets itself."""
    area, *apart = shapely.get_parts(swept_by(vehicle, poses).buffer(margin))
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
    """Return the street between edges, with the way of the lead axle as its line, a point every 2 m."""
    line = poses[: -round(REST_M / STEP_M) : 100, 0, :2]
    options = RoadOptions(smooth=5.0, max_curvature=vehicle.max_curvature)
    return smoothed(Line("around", RawRoad(line, edges=edges), options))[0]


def dense(result: Result) -> tuple[FloatArray, FloatArray]:
    """Return arclengths (n,) and poses (n, units, 3) of an executed plan every 2 cm, integrated anew from each kept pose to the next.

    Raises:
        ArithmeticError: the two integrations end apart.

    """
    drive, path, s, poses, apart = result.drive, result.drive.stations.path, [], [], 0.0
    x, y = path.to_plane(drive.poses_s, drive.poses_z[:, 0])
    first = path.at(drive.poses_s).heading + drive.poses_z[:, 1]
    heading = first[:, None] - np.concatenate(
        [np.zeros((len(x), 1)), np.cumsum(drive.poses_z[:, 2 : 1 + len(drive.vehicle.units)], axis=1)], axis=1
    )
    for at, kappa in enumerate(drive.poses_kappa):
        chord = float(np.hypot(x[at + 1] - x[at], y[at + 1] - y[at]))
        arc = chord / float(np.sinc(np.arcsin(0.5 * chord * abs(kappa)) / np.pi))
        count = int(np.ceil(arc / STEP_M))
        own = driven(drive.vehicle, np.array([x[at], y[at]]), heading[at], np.full(count, kappa), arc / count)
        apart = max(apart, float(np.hypot(own[-1, 0, 0] - x[at + 1], own[-1, 0, 1] - y[at + 1])))
        poses.append(own[:-1])
        s.append(np.linspace(drive.poses_s[at], drive.poses_s[at + 1], count, endpoint=False))
    if apart > _SAME_M:
        msg = f"two integrations of one drive are {apart:.5f} m apart"
        raise ArithmeticError(msg)
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
