"""The points of a body's outline that planning constrains."""

from __future__ import annotations

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.vehicle.model import Vehicle

POINTS_PER_EDGE = core.number("HDV_POINTS_PER_EDGE")
_SAME_M = 1e-6
# Ahead of the unit's axle [m]; 1 where it belongs to an overhang.
EDGE_POINT = core.record("hdv_edge_point")


def axles_behind(vehicle: Vehicle) -> FloatArray:
    """Return every axle's distance behind the lead rear axle on a straight, shape (units,) [m]."""
    steps = [ahead.hitch_offset + unit.wheelbase for ahead, unit in zip(vehicle.units, vehicle.units[1:], strict=False)]
    return np.concatenate([[0.0], np.cumsum(steps)])


def auxiliary_ahead(vehicle: Vehicle, axle: int) -> float:
    """Return how far the auxiliary axle lies ahead of the lead rear axle on a straight [m].

    ``axle`` is the number of its unit (from 0, or -1 for the last); of the lead unit it is the front axle.
    """
    return vehicle.lead.wheelbase if axle % len(vehicle.units) == 0 else -float(axles_behind(vehicle)[axle])


def edge_points(vehicle: Vehicle) -> Records:
    """Return the sampled points of both long edges of every body, records of ``EDGE_POINT``, shape (units, POINTS_PER_EDGE).

    Corners, axle and front axle (or coupling) always belong; the rest splits the longest gaps. The axle is where a
    body's inner edge comes closest to the inside of a turn, the corners are its furthest points outside ([BUS], sec. IV).
    """
    table = np.empty((len(vehicle.units), POINTS_PER_EDGE), EDGE_POINT)
    for row, unit in zip(table, vehicle.units, strict=True):
        ahead = np.unique([-unit.rear_overhang, 0.0, min(unit.wheelbase, unit.front), unit.front])
        ahead = ahead[np.concatenate([[True], np.diff(ahead) > _SAME_M])]
        while len(ahead) < POINTS_PER_EDGE:
            gap = int(np.argmax(np.diff(ahead)))
            ahead = np.insert(ahead, gap + 1, 0.5 * (ahead[gap] + ahead[gap + 1]))
        row["ahead"] = ahead
        row["overhang"] = (ahead < -_SAME_M) | (ahead > unit.wheelbase + _SAME_M)
    return table


def axle_points(vehicle: Vehicle) -> Records:
    """Return the axles that objectives centre, laid out as ``edge_points``.

    A single unit's rear and front axle; in a chain every unit's own.
    """
    table = np.zeros((len(vehicle.units), 2 if len(vehicle.units) == 1 else 1), EDGE_POINT)
    if len(vehicle.units) == 1:
        table["ahead"][0, 1] = vehicle.lead.wheelbase
    return table
