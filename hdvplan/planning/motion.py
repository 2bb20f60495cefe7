"""The motion that a planning step linearises at: the last plan, shifted along the road and moved by each QP's step."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hdvplan.jit import FloatArray, compiled
from hdvplan.planning.stations import Stations
from hdvplan.vehicle.body import POINTS_PER_EDGE, axis_points, edge_points
from hdvplan.vehicle.model import Vehicle

_STEEPEST = 1.3  # largest heading error a plan may reach: the model's domain ends at pi/2 [rad]
_INSIDE = 0.05  # smallest 1 - e_y k a plan may reach
_SHORTEST = 1e-3  # share of a step below which it is not taken at all


@dataclass(frozen=True)
class Motion:
    """States and curvatures over one horizon, and the feet of all points that were last projected (warm starts)."""

    z: FloatArray  # (N+1, n)
    kappa: FloatArray  # (N,) [1/m]
    aux_feet: FloatArray  # (N+1,) of the auxiliary axle [m]
    axis_feet: FloatArray  # (N+1, units, 4) of the points that screen a body
    feet: FloatArray  # (N+1, units, points, 2) of the points of both edges
    gaps: FloatArray  # same shape: every point's clearance to its limit, or a lower bound of it [m]
    reach_feet: FloatArray  # (N+1, units, points, 2) of the points whose furthest reach is the objective; points may be 0
    aux_ahead: float  # where these points lie ahead of the lead rear axle on a straight [m]
    axis_ahead: FloatArray  # (units, 4)
    points_ahead: FloatArray  # (units, points, 1)
    reach_ahead: FloatArray  # (units, points, 1)

    @classmethod
    def empty(cls, vehicle: Vehicle, stages: int, reach_points: FloatArray, *, axle: int = -1) -> Motion:
        """Return the memory for a horizon of ``stages`` intervals; ``reach_points`` (units, points, 2) as ``edge_points``.

        ``axle`` as in ``Residual``.
        """
        units = len(vehicle.units)
        feet = (stages + 1, units, POINTS_PER_EDGE, 2)
        behind = axles_behind(vehicle)
        return cls(
            np.zeros((stages + 1, vehicle.states)),
            np.zeros(stages),
            np.zeros(stages + 1),
            np.zeros((stages + 1, units, 4)),
            np.zeros(feet),
            np.full(feet, np.inf),
            np.zeros((stages + 1, *reach_points.shape[:2], 2)),
            aux_ahead(vehicle, axle),
            axis_points(vehicle) - behind[:, None],
            edge_points(vehicle)[:, :, :1] - behind[:, None, None],
            reach_points[:, :, :1] - behind[:, None, None],
        )

    def by_stage(self) -> tuple[FloatArray, ...]:
        """Return every array as a view of shape (stages, values)."""
        return flat_stages((self.z, self.kappa, self.aux_feet, self.axis_feet, self.feet, self.gaps, self.reach_feet))

    def guess(self, stations: Stations, first: int, begin: int) -> None:
        """Set the motion from stage ``begin`` on, and the curvature that leads there, to the road's stationary geometry.

        ``first`` is the station of stage 0.
        """
        end = first + len(self.kappa)
        horizon, held = slice(first + begin, end + 1), max(begin - 1, 0)
        geometry, s = stations.centring, stations.s[horizon]
        self.z[begin:] = geometry.states[horizon]
        self.kappa[held:] = geometry.kappa[first + held : end]
        self.aux_feet[begin:] = s + self.aux_ahead
        self.axis_feet[begin:] = s[:, None, None] + self.axis_ahead
        self.feet[begin:] = s[:, None, None, None] + self.points_ahead
        self.reach_feet[begin:] = s[:, None, None, None] + self.reach_ahead


def axles_behind(vehicle: Vehicle) -> FloatArray:
    """Return every axle's distance behind the lead rear axle on a straight, shape (units,) [m]."""
    steps = [ahead.hitch_offset + unit.wheelbase for ahead, unit in zip(vehicle.units, vehicle.units[1:], strict=False)]
    return np.concatenate([[0.0], np.cumsum(steps)])


def aux_ahead(vehicle: Vehicle, axle: int) -> float:
    """Return how far the auxiliary axle lies ahead of the lead rear axle on a straight [m]; ``axle`` as in ``Residual``."""
    return vehicle.lead.wheelbase if axle % len(vehicle.units) == 0 else -float(axles_behind(vehicle)[axle])


def flat_stages(arrays: tuple[FloatArray, ...]) -> tuple[FloatArray, ...]:
    """Return views of shape (stages, values) of arrays whose first axis counts stages."""
    return tuple(array.reshape(len(array), math.prod(array.shape[1:])) for array in arrays)


@compiled
def shift_stages(arrays: tuple[FloatArray, ...], by: int) -> None:
    """Move every array ``by`` stages towards its beginning; its last ``by`` stages keep their values."""
    for array in arrays:
        for i in range(array.shape[0] - by):
            for j in range(array.shape[1]):
                array[i, j] = array[i + by, j]


@compiled
def keep_steering(kappa: FloatArray, kappa_before: float, begin: int, most: float, change: float) -> None:
    """Bring the curvatures from number ``begin`` on within what steering allows: at most ``most``, changing by at most ``change``.

    A motion that keeps these bounds keeps them after any share of a QP's step.
    """
    for i in range(begin, kappa.size):
        before = kappa[i - 1] if i > 0 else kappa_before
        kappa[i] = max(min(kappa[i], before + change, most), before - change, -most)


@compiled
def take_step(z: FloatArray, kappa: FloatArray, x: FloatArray, road_curvature: FloatArray, share: float) -> float:
    """Move a motion by ``share`` of a QP's solution ``x`` (N+1, n + 1), less where it would leave the model's domain.

    The first state is given: a solver's residual must not move it. Returns the largest change of a state, or infinity
    where no part of the step could be taken.
    """
    n, length, inside = z.shape[1], 2.0 * share, False
    while not inside and length > _SHORTEST:
        length *= 0.5
        inside = True
        for i in range(1, z.shape[0]):
            e_y, e_psi = z[i, 0] + length * x[i, 0], z[i, 1] + length * x[i, 1]
            if not (abs(e_psi) < _STEEPEST and 1.0 - e_y * road_curvature[i] > _INSIDE):
                inside = False
                break
    if not inside:
        return np.inf
    largest = 0.0
    for i in range(1, z.shape[0]):
        for j in range(n):
            z[i, j] += length * x[i, j]
            largest = max(largest, length * abs(x[i, j]))
        kappa[i - 1] += length * x[i, n]
    return largest
