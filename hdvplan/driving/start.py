"""The state of a vehicle at the start of its road.

It is the stationary geometry for the curvature at the road's first point, as if the road had always had this curvature. In a bend
so tight that a body would not lie beside the road's continuation then, it comes along that continuation instead: a curvature that
fades to zero, and a straight before it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy  # its subpackages load when they are first used

from hdvplan.arrays import FloatArray
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import Stations
from hdvplan.road.path import ReferencePath, evaluate_many, project_many
from hdvplan.road.road import Road, part_of
from hdvplan.road.street import look
from hdvplan.vehicle.kinematics import axles_behind, place_many, points_on
from hdvplan.vehicle.model import Vehicle

_MOVES = 5  # of a start, until it is kept
_NEAR_M = 0.2  # contacts with so much room bear on a move, too
_INSIDE_M = 1e-3  # what a move may miss, for gaps are not straight
_PROBE_M = 1e-6  # of a derivative
_FURTHEST_M = 5.0  # that a start is moved: gaps are not straight, and a move without end leaves the model
_SHARES = (1.0, 0.5, 0.25, 0.125)  # of what lacks, that a move is to give
_SPACING_M = 0.25  # of the places on a body's edges that are looked at
_STRAIGHT_M = 20.0  # of continuation before the vehicle's length: its curvature has faded there
_ROOM_M = 20.0  # of path beyond the vehicle and its horizon


class Start(NamedTuple):
    """The road-aligned state at s = 0, and the curvature that was driven until there [1/m]."""

    z: FloatArray
    kappa: float


def start_of(stations: Stations, vehicle: Vehicle) -> Start:
    """Return the stationary geometry of the first station, as far as the vehicle can steer."""
    geometry = stations.centring
    return Start(geometry.states[0], float(np.clip(geometry.kappa[0], -vehicle.max_curvature, vehicle.max_curvature)))


def kept_start(stations: Stations, vehicle: Vehicle, begin: Start, clearance: float, s: float = 0.0) -> Start:
    """Return a start at ``s`` [m] moved as little as it takes for all bodies to stand within the street.

    Where that is not found it is the one that lacks least of those that were tried, the start itself among them.
    """
    if stations.street is None:
        return begin
    length = vehicle.reach_ahead + vehicle.reach_behind
    metres = np.array([1.0, *[length] * vehicle.rigid_states][: len(begin.z)])  # that a body moves, about
    z = best = begin.z
    least = -np.inf
    for _ in range(_MOVES):
        gaps = _gaps(stations, vehicle, z[None], s)[0]
        room = float(np.min(gaps, initial=np.inf))
        if room > least:
            best, least = z, room
        if room >= clearance:
            break
        move = _move(stations, vehicle, z, gaps, clearance, s, metres)
        if move is None or np.max(np.abs(z + move - begin.z) * metres) > _FURTHEST_M:
            break
        z = z + move
    return begin._replace(z=best)


def _move(
    stations: Stations, vehicle: Vehicle, z: FloatArray, gaps: FloatArray, clearance: float, s: float, metres: FloatArray
) -> FloatArray | None:
    """Return the least move of a state that gives all bodies ``clearance``, or as much of what lacks as it can; None without any.

    ``metres`` (n,) are what a state counts.
    """
    near = np.flatnonzero(gaps < clearance + _NEAR_M)
    changed = _gaps(stations, vehicle, z + np.diag(_PROBE_M / metres), s)[:, near]
    rows, lacking = (changed - gaps[near]).T / _PROBE_M, clearance + _INSIDE_M - gaps[near]
    for share in _SHARES:
        # Least-distance programming (Lawson and Hanson 1974, chapter 23): the shortest move for which rows @ move >= wanted.
        wanted = lacking - (1.0 - share) * np.max(lacking)
        held, target = np.vstack([rows.T, wanted]), np.append(np.zeros(len(z)), 1.0)
        solution, rest = scipy.optimize.nnls(held, target)
        if rest >= _PROBE_M:
            residual = target - held @ solution
            return np.asarray(-residual[:-1] / residual[-1] / metres)
    return None


def _gaps(stations: Stations, vehicle: Vehicle, z: FloatArray, at: float) -> FloatArray:
    """Return the gaps of all bodies' contacts in states ``z`` (k, states) at an arclength [m], (k, contacts) [m]; see ``look``."""
    s = np.full(len(z), at)
    points = evaluate_many(stations.path, s)
    assert stations.street is not None  # noqa: S101 - for the type checker: who asks has one
    poses = place_many(vehicle.table(), points, z)
    found: FloatArray = look(stations.street, vehicle.table(), axles_behind(vehicle), s, poses)["gap"]
    return found.reshape(len(z), -1)


def lies_beside(path: ReferencePath, vehicle: Vehicle, z: FloatArray) -> bool:
    """Tell whether all bodies of a vehicle in state ``z`` at s = 0 lie beside the path: every point of their edges has a foot on it."""
    poses = place_many(vehicle.table(), evaluate_many(path, np.zeros(1)), z[None])[0]
    for unit, pose, behind in zip(vehicle.units, poses, axles_behind(vehicle), strict=True):
        ahead = np.linspace(-unit.rear_overhang, unit.front, int(np.ceil(unit.length / _SPACING_M)) + 1)
        for across in (0.5 * unit.width, -0.5 * unit.width):
            x, y = points_on(pose, ahead, across).T
            if np.any(np.isnan(project_many(path, x, y, ahead - behind)[1])):
                return False
    return True


def approach_to(road: Road, vehicle: Vehicle, settings: PlannerSettings) -> Road:
    """Return the continuation before a road's start as a separate road, on which the whole vehicle begins behind the bend."""
    length = settings.replan * float(np.ceil((vehicle.reach_ahead + vehicle.reach_behind + _STRAIGHT_M) / settings.replan))
    part = part_of(road, -length, 0.0, vehicle.reach_behind + _ROOM_M, settings.horizon + vehicle.reach_ahead + _ROOM_M)
    return replace(part, regions=(), faces=None)
