"""The largest reach as an objective: an epigraph variable t >= |offset| of every watched point at every stage of the horizon.

t is one state more, which the first stage's last input sets and all others keep: its rows then look like those of any limit,
and every solver takes the program as it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.jit import FloatArray, Records, compiled
from hdvplan.planning.terms.term import Horizon, Needs, Place, Scene
from hdvplan.qp.program import by_stage
from hdvplan.road.path import PLANNING_STEP_M, Curve, project
from hdvplan.vehicle.body import axle_points, axles_behind, edge_points
from hdvplan.vehicle.kinematics import body_point, point_gradient
from hdvplan.vehicle.model import Vehicle

_FURTHEST_M = 100.0  # more than any vehicle can reach off its road; bounds of a variable that needs none


@dataclass(frozen=True)
class Reach:
    """The largest distance t of any watched point from the road's centre over the horizon of N stages, at the cost N t^2."""

    bodies: bool  # watch the points of both edges of every body; else the axles alone

    def points(self, vehicle: Vehicle) -> Records:
        """Return the watched points, as ``edge_points``."""
        return edge_points(vehicle) if self.bodies else axle_points(vehicle)

    def needs(self, vehicle: Vehicle) -> Needs:
        """Return t, the input that sets it, and two rows a point: see ``Term``."""
        return Needs(states=1, inputs=1, rows=2 * self.points(vehicle).size)

    def part(self, scene: Scene, place: Place) -> ReachPart:
        """Return the term in its place: see ``Term``. Its rows are priced above their multipliers, which add up to 2 N t."""
        qp, t, u, count = scene.qp, place.state, place.input, scene.settings.stages
        qp.stages["A"][1:, t, t], qp.stages["B"][:, t, u] = 1.0, 0.0
        qp.stages["A"][0, t, t], qp.stages["B"][0, t, u] = 0.0, 1.0
        qp.stages["R"][:, u, u] = 1.0  # the other stages' last inputs do nothing, and are 0
        qp.stages["u_low"][:, u], qp.stages["u_high"][:, u] = -_FURTHEST_M, _FURTHEST_M
        rows = qp.rows[:, place.row : place.row + self.needs(scene.vehicle).rows]
        rows["g"][:, :, t], rows["linear"] = -1.0, 2.0 * count * _FURTHEST_M
        points = self.points(scene.vehicle)
        half = scene.units["half_width"] if self.bodies else np.zeros(len(scene.units))
        ahead = points["ahead"][:, :, None] - axles_behind(scene.vehicle)[:, None, None]
        return ReachPart(scene, t, u, rows, points, half, ahead, np.zeros((count + 1, *points.shape, 2)))


@dataclass(frozen=True)
class ReachPart:
    """The largest reach in its place; see ``Part``."""

    scene: Scene
    t: int  # its state
    u: int  # the input that sets it
    rows: Records  # (N+1, own rows)
    points: Records
    half_widths: FloatArray  # off its unit's axis where a point lies, (units,) [m]
    ahead: FloatArray  # of the lead rear axle on a straight, (units, points, 1) [m]
    feet: FloatArray  # (N+1, units, points, 2) [m]
    violation: float = 0.0

    @property
    def memory(self) -> tuple[FloatArray, ...]:
        """The feet."""
        return (by_stage(self.feet),)

    def extend(self, horizon: Horizon, begin: int) -> int:
        """See ``Part``."""
        self.feet[begin:] = horizon.road["s"][begin:, None, None, None] + self.ahead
        return self._linearise(horizon, begin)

    def linearise(self, horizon: Horizon) -> int:
        """See ``Part``."""
        return self._linearise(horizon, 1)

    def price(self, horizon: Horizon) -> float:  # noqa: ARG002 - a protocol's method
        """Return N t^2: see ``Part``."""
        return (len(self.rows) - 1) * float(np.max(-self.rows["h"][1:], initial=0.0)) ** 2

    def _linearise(self, horizon: Horizon, begin: int) -> int:
        scene = self.scene
        stages = scene.qp.stages
        # after a shift another stage is the first, and the last one has moved
        stages["A"][0, self.t, self.t], stages["B"][0, self.t, self.u] = 0.0, 1.0
        stages["Q"][:, self.t, self.t] = 0.0
        stages["Q"][-1, self.t, self.t] = 2.0 * (len(stages) - 1)
        return linearise_reach(
            self.points, self.half_widths, scene.stations.path.curve, horizon.road, scene.motion.poses, self.feet, begin,
            scene.vehicle.states, stages, self.rows,
        )  # fmt: skip


@compiled
def linearise_reach(
    points: Records, half_widths: FloatArray, curve: Curve, road: Records, poses: Records, feet: FloatArray, begin: int, n: int,
    stages: Records, rows: Records,
) -> int:  # fmt: skip
    """Write the rows g dz <= h of offset <= 0 to the left and offset >= 0 to the right at stages i >= ``begin`` >= 1.

    Every point has its two rows, ``half_widths`` (units,) off its unit's axis: an epigraph variable moves these limits outwards.
    Returns -1, or a stage with a point that has no foot. ``feet`` is warm start and result; ``n`` are the vehicle's states.
    """
    across = np.empty(n)
    for i in range(begin, stages.size):
        row, stages[i].live = 0, 1.0
        for unit in range(points.shape[0]):
            for side in range(2):
                sign = 1.0 - 2.0 * side
                for point in range(points.shape[1]):
                    x, y = body_point(poses[i, unit], points[unit, point].ahead, sign * half_widths[unit])
                    foot, e, cos, sin, _ = project(curve, x, y, feet[i, unit, point, side], PLANNING_STEP_M)
                    if np.isnan(e):
                        return i
                    feet[i, unit, point, side] = foot
                    point_gradient(poses[i], unit, x, y, road[i], -sin, cos, across)
                    for j in range(n):
                        rows[i, row].g[j] = sign * across[j]
                    rows[i, row].h = -sign * e
                    row += 1
    return -1
