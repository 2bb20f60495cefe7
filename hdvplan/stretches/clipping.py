"""The part of a drive on the core of a stretch, as a separate drive: the code that judges and draws drives need not know stretches."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from hdvplan.centring.stationary import Centring
from hdvplan.driving.drive import Drive
from hdvplan.planning.bias import Bias
from hdvplan.planning.stations import Stations
from hdvplan.road.path import ReferencePath
from hdvplan.road.road import Road

_ROOM_M = 20.0  # of poses beyond the vehicle's length before and behind the core: bodies askew


def clipped(drive: Drive, s_from: float, s_to: float) -> Drive:
    """Return the drive from arclength ``s_from``, which is a station, to ``s_to`` [m]; arclengths count from ``s_from``.

    Poses before and behind are kept as far as a body on them reaches into that part, so that its envelope is that of the whole drive.
    """
    step, vehicle = drive.settings.step, drive.vehicle
    first, last = round(s_from / step), int(np.ceil(s_to / step - 1e-9))
    near = (drive.poses_s >= s_from - vehicle.reach_ahead - _ROOM_M) & (drive.poses_s <= s_to + vehicle.reach_behind + _ROOM_M)
    return replace(
        drive,
        road=_road(drive.road, s_from, s_to),
        stations=_stations(drive.stations, first, s_from, s_to),
        z=drive.z[first : last + 1],
        kappa=drive.kappa[first:last],
        poses_s=drive.poses_s[near] - s_from,
        poses_z=drive.poses_z[near],
        poses_kappa=drive.poses_kappa[near[:-1] & near[1:]],
        plans=tuple(replace(plan, first=plan.first - first) for plan in drive.plans if first <= plan.first < last),
        bias=Bias(drive.bias.s - s_from, drive.bias.offset),
    )


def _road(road: Road, s_from: float, s_to: float) -> Road:
    limits = None if road.limits is None else replace(road.limits, s=road.limits.s - s_from)
    faces = tuple(face.shifted(s_from) for face in road.passed)
    cut = replace(road, path=_path(road.path, s_from, s_to), limits=limits, faces=faces)
    for name in ("bounds", "kerbs"):  # where ``cached_property`` looks: that street does not end where the part does
        street = getattr(road, name)
        cut.__dict__[name] = None if street is None else street.shifted(s_from)
    return cut


def _path(path: ReferencePath, s_from: float, s_to: float) -> ReferencePath:
    return replace(path, s_first=path.s_first - s_from, length=s_to - s_from, closed=False)


def _stations(stations: Stations, first: int, s_from: float, s_to: float) -> Stations:
    points = stations.points[first:].copy()
    points["s"] -= s_from
    centring = stations.centring
    cut: dict[str, Any] = {one.name: getattr(centring, one.name) for one in fields(centring)}
    cut |= {name: column[first:] for name, column in cut.items() if isinstance(column, np.ndarray)}
    return replace(
        stations,
        path=_path(stations.path, s_from, s_to),
        points=points,
        centring=Centring(**cut),
        street=None,  # what was planned in is not judged
        bias=stations.bias[first:],
    )
