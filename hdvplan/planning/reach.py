"""The largest reach as an objective: an epigraph variable t >= |offset| of every watched point at every stage of the horizon.

t is one state more, which the first stage's last input sets and all others keep: its rows then look like those of any limit,
and every solver takes the program as it is.
"""

from __future__ import annotations

import numpy as np

from hdvplan.jit import FloatArray, compiled
from hdvplan.planning.objectives import Balanced, Furthest, Residual
from hdvplan.qp.program import StageQp
from hdvplan.road.path import project
from hdvplan.vehicle.body import axle_points, edge_points
from hdvplan.vehicle.kinematics import place, point_gradient
from hdvplan.vehicle.model import Vehicle

_FURTHEST_M = 100.0  # more than any vehicle can reach off its road; bounds of a variable that needs none


def watched_points(vehicle: Vehicle, centred: Residual | Furthest | Balanced) -> tuple[FloatArray, FloatArray]:
    """Return the points whose largest reach is the objective, as ``edge_points``, and how far off their axes they lie [m]."""
    half = vehicle.table()[:, 4]
    if not isinstance(centred, Furthest):
        return np.empty((len(half), 0, 2)), half
    return (edge_points(vehicle), half) if centred.bodies else (axle_points(vehicle), np.zeros_like(half))


def write_epigraph(qp: StageQp, t: int, rows: FloatArray) -> None:
    """Write what is constant about the state number ``t``: the first stage's last input sets it, all others keep it.

    ``rows`` (N, p, n) are the rows whose limit at 0 it moves outwards. Their multipliers add up to 2 N t, so the price at which they
    are elastic makes them exact.
    """
    stages = qp.shape.stages
    qp.A[:, t, t], qp.B[:, t, -1] = 1.0, 0.0
    qp.A[0, t, t], qp.B[0, t, -1] = 0.0, 1.0
    qp.Q[:, t, t], qp.Q[-1, t, t] = 0.0, 2.0 * stages
    qp.R[:, -1, -1] = 1.0  # the other stages' last inputs do nothing, and are 0
    qp.u_low[:, -1], qp.u_high[:, -1] = -_FURTHEST_M, _FURTHEST_M
    rows[:, :, t] = -1.0
    qp.linear[:, qp.shape.rows - rows.shape[1] :] = 2.0 * stages * _FURTHEST_M


@compiled
def linearise_reach(
    units: FloatArray, points: FloatArray, half_widths: FloatArray, coefficients: FloatArray, s_first: float, spacing: float,
    road: FloatArray, z: FloatArray, feet: FloatArray, begin: int, end: int, G: FloatArray, h: FloatArray,
) -> int:  # fmt: skip
    """Write the rows G dz <= h of offset <= 0 to the left and offset >= 0 to the right at stages 1 <= begin <= i < end.

    Every point has its two rows, ``half_widths`` (units,) off its unit's axis: an epigraph variable moves these limits outwards.
    Returns -1, or a stage with a point that has no foot. ``feet`` (N+1, units, points, 2) is warm start and result.
    """
    poses, along = np.empty((units.shape[0], 6)), np.empty(z.shape[1])
    for i in range(begin, end):
        place(units, road[0, i], road[1, i], road[2, i], road[3, i], z[i], poses)
        row = 0
        for unit in range(units.shape[0]):
            x, y, cos_u, sin_u = poses[unit, 0], poses[unit, 1], poses[unit, 2], poses[unit, 3]
            for side in range(2):
                sign = 1.0 - 2.0 * side
                across = sign * half_widths[unit]
                for point in range(points.shape[1]):
                    ahead = points[unit, point, 0]
                    px, py = x + ahead * cos_u - across * sin_u, y + ahead * sin_u + across * cos_u
                    feet[i, unit, point, side], e, cos, sin, _ = project(coefficients, s_first, spacing, px, py, feet[i, unit, point, side])
                    if np.isnan(e):
                        return i
                    point_gradient(poses, unit, px, py, road[2, i], road[3, i], -sin, cos, along)
                    for j in range(along.size):
                        G[i - 1, row, j] = sign * along[j]
                    h[i - 1, row] = -sign * e
                    row += 1
    return -1
