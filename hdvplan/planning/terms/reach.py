"""The largest reach as an objective: an epigraph variable t >= |offset| of every watched point at every stage: hdvplan/core/reach.c.

t is one state more, which the first stage's last input sets and all others keep: its rows then look like those of any limit,
and every solver takes the program as it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan import core
from hdvplan.arrays import Records
from hdvplan.planning.terms.term import CorePart, Needs, Place, Scene, Term, core_functions
from hdvplan.qp.program import by_stage
from hdvplan.vehicle.body import axle_points, axles_behind, edge_points
from hdvplan.vehicle.model import Vehicle

_FURTHEST_M = 100.0  # more than any vehicle can reach off its road; bounds of a variable that needs none
_REACH = core.record(
    "hdv_reach",
    [
        *((name, core.ADDRESS) for name in ("curve", "points")),
        ("point_count", np.int64),
        *((name, core.ADDRESS) for name in ("half_widths", "ahead")),
        *((name, np.int64) for name in ("state", "input", "row")),
        ("feet", core.ADDRESS),
    ],
)
_FUNCTIONS = core_functions("reach")


@dataclass(frozen=True)
class Reach(Term):
    """The largest distance t of any watched point from the road's centre over the horizon of N stages, at the cost N t^2."""

    bodies: bool  # watch the points of both edges of every body; else the axles alone

    def points(self, vehicle: Vehicle) -> Records:
        """Return the watched points, as ``edge_points``."""
        return edge_points(vehicle) if self.bodies else axle_points(vehicle)

    def needs(self, vehicle: Vehicle) -> Needs:
        """Return t, the input that sets it, and two rows a point: see ``Term``."""
        return Needs(states=1, inputs=1, rows=2 * self.points(vehicle).size)

    def part(self, scene: Scene, place: Place) -> CorePart:
        """Return the term in its place: see ``Term``. Its rows are priced above their multipliers, which add up to 2 N t."""
        qp, t, u, count = scene.qp, place.state, place.input, scene.settings.stages
        qp.stages["R"][:, u, u] = 1.0  # the other stages' last inputs do nothing, and are 0
        qp.stages["u_low"][:, u], qp.stages["u_high"][:, u] = -_FURTHEST_M, _FURTHEST_M
        rows = qp.rows[:, place.row : place.row + self.needs(scene.vehicle).rows]
        rows["g"][:, :, t], rows["linear"] = -1.0, 2.0 * count * _FURTHEST_M
        points = self.points(scene.vehicle)
        half = np.ascontiguousarray(scene.units["half_width"]) if self.bodies else np.zeros(len(scene.units))
        ahead = points["ahead"] - axles_behind(scene.vehicle)[:, None]
        feet = np.zeros((scene.capacity, *points.shape, 2))
        curve, more = scene.stations.path.record, (half, ahead)
        data = np.array(
            [(core.address(curve), core.address(points), points.shape[1], *map(core.address, more), t, u, place.row, core.address(feet))],
            _REACH,
        )
        return CorePart(scene, _FUNCTIONS, data, kept=(curve, points, *more), memory=(by_stage(feet),))
