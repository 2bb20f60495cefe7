"""The points of a body's outline that planning constrains."""

from __future__ import annotations

import numpy as np

from hdvplan.jit import FloatArray
from hdvplan.vehicle.model import Vehicle

POINTS_PER_EDGE = 6
_SAME_M = 1e-6


def axis_points(vehicle: Vehicle) -> FloatArray:
    """Return the distances ahead of the axle of the points that screen each body's axis, shape (units, 4), rising [m]."""
    return np.array([sorted([-unit.rear_overhang, 0.0, min(unit.wheelbase, unit.front), unit.front]) for unit in vehicle.units])


def edge_points(vehicle: Vehicle) -> FloatArray:
    """Return the sampled points of both long edges of every body, shape (units, POINTS_PER_EDGE, 2).

    The last axis holds the distance ahead of the unit's axle [m] and 1 where the point belongs to an overhang, else 0.
    Corners, axle and front axle (or coupling) always belong; the rest splits the longest gaps. The axle is where a
    body's inner edge comes closest to the inside of a turn, the corners are its furthest points outside ([BUS], sec. IV).
    """
    table = np.empty((len(vehicle.units), POINTS_PER_EDGE, 2))
    for row, unit in zip(table, vehicle.units, strict=True):
        ahead = np.unique([-unit.rear_overhang, 0.0, min(unit.wheelbase, unit.front), unit.front])
        ahead = ahead[np.concatenate([[True], np.diff(ahead) > _SAME_M])]
        while len(ahead) < POINTS_PER_EDGE:
            gap = int(np.argmax(np.diff(ahead)))
            ahead = np.insert(ahead, gap + 1, 0.5 * (ahead[gap] + ahead[gap + 1]))
        row[:, 0] = ahead
        row[:, 1] = (ahead < -_SAME_M) | (ahead > unit.wheelbase + _SAME_M)
    return table


def axle_points(vehicle: Vehicle) -> FloatArray:
    """Return the axles that objectives centre, laid out as ``edge_points``.

    A single unit's rear and front axle; in a chain every unit's own.
    """
    table = np.zeros((len(vehicle.units), 2 if len(vehicle.units) == 1 else 1, 2))
    if len(vehicle.units) == 1:
        table[0, 1, 0] = vehicle.lead.wheelbase
    return table
