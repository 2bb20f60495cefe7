"""Limits: the rows that keep every body within the road's limits, linearised at a given motion.

Bodies far from their limits are screened out by bounds that need no projection, or few, and once found clear they are not looked at
again before they have moved. Of every other edge the tightest places enter, see ``edges``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hdvplan.jit import FloatArray, Record, Records, compiled, inner
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.edges import PLACE, ROWS_PER_EDGE, Bodies, never, write_edge
from hdvplan.planning.terms.screening import CLEAR_M, clear_by_axis, clear_by_state
from hdvplan.planning.terms.term import Horizon, Needs, Place, Scene
from hdvplan.qp.program import by_stage
from hdvplan.vehicle.body import POINTS_PER_EDGE, axis_points, axles_behind, edge_points
from hdvplan.vehicle.model import Vehicle

EDGE = np.dtype(
    [
        ("clear", float),  # a lower bound of its clearance to all limits, the wheels' for overhangs too [m]
        ("gap", float),  # a lower bound of its clearance to the limits that it must keep [m]
        ("looked", float),  # 1 where that was found by looking at the edge, 0 where a bound says it
        ("never", float),  # 1 while the edge's rows never bind
    ]
)


class Seen(NamedTuple):
    """What was seen of every stage when it was last looked at."""

    z: FloatArray  # (N+1, n), the state
    edges: Records  # (N+1, units, 2) of ``EDGE``, left and right
    axis_feet: FloatArray  # (N+1, units, 4) [m]
    feet: FloatArray  # (N+1, units, points, 2), of the points of both edges [m]
    least: FloatArray  # (1,), the least gap of all edges [m]


@dataclass(frozen=True)
class Limits:
    """Every edge of every body: ``rows_per_edge`` rows a stage, elastic at the settings' prices."""

    rows_per_edge: int

    def needs(self, vehicle: Vehicle) -> Needs:
        """Return the rows: see ``Term``."""
        return Needs(rows=2 * self.rows_per_edge * len(vehicle.units))

    def part(self, scene: Scene, place: Place) -> LimitsPart:
        """Return the term in its place: see ``Term``."""
        vehicle, settings, count = scene.vehicle, scene.settings, scene.settings.stages + 1
        units = len(vehicle.units)
        rows = scene.qp.rows[:, place.row : place.row + self.needs(vehicle).rows]
        soft = np.arange(rows.shape[1]) % self.rows_per_edge >= ROWS_PER_EDGE
        rows["linear"], rows["quadratic"] = np.where(soft, 0.0, settings.elastic_weight), settings.elastic_growth
        rows["quadratic"][:, soft] = 2.0 * settings.overhang_cost
        points, axis = edge_points(vehicle), axis_points(vehicle)
        seen = Seen(
            np.zeros((count, vehicle.states)), np.zeros((count, units, 2), EDGE), np.zeros((count, *axis.shape)),
            np.zeros((count, *points.shape, 2)), np.full(1, np.inf),
        )  # fmt: skip
        path, limits = scene.stations.path, scene.stations.limits
        bodies = Bodies(scene.units, points, axis, axles_behind(vehicle), _furthest(vehicle), path.curve, limits, settings.clearance)
        return LimitsPart(scene, bodies, rows, seen)


def limits_of(stations: Stations, settings: PlannerSettings) -> Limits | None:
    """Return the limits of a drive: two more rows an edge where overhangs may reach further at a cost; None on a road without."""
    if not stations.limits.values.size:
        return None
    return Limits(2 * ROWS_PER_EDGE if stations.limits.two_regions and settings.overhang_cost > 0.0 else ROWS_PER_EDGE)


def _furthest(vehicle: Vehicle) -> float:
    """Return a bound of how far any point of a body can be from the lead rear axle, however the vehicle is folded [m]."""
    axle, furthest, hitch = 0.0, 0.0, 0.0
    for number, unit in enumerate(vehicle.units):
        axle += hitch + (unit.wheelbase if number else 0.0)
        furthest = max(furthest, axle + float(np.hypot(max(unit.front, unit.rear_overhang), 0.5 * unit.width)))
        hitch = abs(unit.hitch_offset)
    return furthest


@dataclass(frozen=True)
class LimitsPart:
    """Limits in their place; see ``Part``."""

    scene: Scene
    bodies: Bodies
    rows: Records  # (N+1, own rows)
    seen: Seen

    @property
    def memory(self) -> tuple[FloatArray, ...]:
        """What was seen."""
        return tuple(by_stage(array) for array in self.seen[:-1])

    def extend(self, horizon: Horizon, begin: int) -> int:
        """See ``Part``."""
        return self._linearise(horizon, begin, fresh=True)

    def linearise(self, horizon: Horizon) -> int:
        """See ``Part``."""
        return self._linearise(horizon, 1, fresh=False)

    def price(self, horizon: Horizon) -> float:  # noqa: ARG002 - a protocol's method
        """Return the prices of all rows that the motion breaks: see ``Part``."""
        return price_of(self.scene.qp.stages, self.rows)

    @property
    def violation(self) -> float:
        """The deepest breach of a limit at any stage of the motion that was last linearised at; 0 when all are kept [m]."""
        return max(0.0, -float(self.seen.least[0]))

    def _linearise(self, horizon: Horizon, begin: int, *, fresh: bool) -> int:
        motion = self.scene.motion
        return linearise_limits(
            self.bodies,
            horizon.road,
            motion.stages,
            motion.poses,
            begin,
            fresh,
            horizon.binding,
            self.seen,
            self.scene.qp.stages,
            self.rows,
        )


@compiled
def price_of(stages: Records, rows: Records) -> float:
    """Return what the rows' breaches cost at the motion at which they were linearised."""
    total = 0.0
    for i in range(1, rows.shape[0]):
        if stages[i].live > 0.0:
            for row in range(rows.shape[1]):
                own = rows[i, row]
                over = max(0.0, -own.h)
                total += (own.linear + 0.5 * own.quadratic * over) * over
    return total


@compiled
def linearise_limits(
    bodies: Bodies, road: Records, motion: Records, poses: Records, begin: int, fresh: bool, binding: bool, seen: Seen, stages: Records,
    rows: Records,
) -> int:  # fmt: skip
    """Write the rows g dz <= h of the tightest places of every edge at stages i >= ``begin`` >= 1; the first state is given.

    Returns -1, or a stage with a point that has no foot. ``seen`` is warm start and result; nothing is known of the stages where they
    are ``fresh``. While limits are ``binding``, every edge that no bound clears has its rows: large steps need them.

    Row order within a stage: unit, left then right edge; then the tightest place of the edge's rear half and of its front half; then,
    where there are rows for them, what its rear and its front corner reach beyond the wheels' limit, if they belong to overhangs.
    """
    places, gradients = np.empty(POINTS_PER_EDGE + 1, PLACE), np.empty((2, motion[0].z.size))
    each, last, least = rows.shape[1] // (2 * bodies.units.size), bodies.units.size - 1, np.inf
    for i in range(begin, motion.size):
        z, at = motion[i].z, road[i]
        margin = at.margin + bodies.clearance
        if fresh:
            _begin(bodies, at, z, i, seen)
        moved = abs(z[0] - seen.z[i, 0])  # no offset of any point has changed by more than this
        for j in range(1, 2 + last):
            moved += bodies.reach * abs(z[j] - seen.z[i, j])
        for j in range(z.size):
            seen.z[i, j] = z[j]
        slid = np.inf if moved > 0.0 and at.varies > 0.0 else moved  # the feet of an edge that was looked at have met other limits
        for number in range(last + 1):
            left, right = seen.edges[i, number, 0], seen.edges[i, number, 1]
            left.clear -= slid if left.looked > 0.0 else moved
            right.clear -= slid if right.looked > 0.0 else moved
            if not (_is_clear(left, margin, binding) and _is_clear(right, margin, binding)):
                axis, feet = bodies.axis[number], seen.axis_feet[i, number]
                clear_left, clear_right = clear_by_axis(bodies.units[number], axis, bodies.curve, at, poses[i, number], feet)
                if clear_left - margin > CLEAR_M:
                    left.clear, left.looked = clear_left, 0.0
                if clear_right - margin > CLEAR_M:
                    right.clear, right.looked = clear_right, 0.0
            for side in range(2):
                edge, row = seen.edges[i, number, side], (2 * number + side) * each
                edge.gap = edge.clear
                if not _is_clear(edge, margin, binding):
                    feet = seen.feet[i, number]
                    write_edge(bodies, at, poses[i], number, side, edge, feet, rows[i, row : row + each], places, gradients)
                    if np.isnan(edge.gap):
                        return i
                    edge.looked, edge.never = 1.0, 0.0
                if _is_clear(edge, margin, binding):
                    if edge.never == 0.0:
                        never(rows[i], row, row + each, edge.clear - margin)
                        edge.never = 1.0
                else:
                    stages[i].live = 1.0
                least = min(least, edge.gap)
    for i in range(1, begin):
        for number in range(last + 1):
            least = min(least, seen.edges[i, number, 0].gap, seen.edges[i, number, 1].gap)
    seen.least[0] = least
    return -1


@inner
def _is_clear(edge: Record, margin: float, binding: bool) -> bool:
    """Return whether an edge needs no rows."""
    return edge.clear - margin > CLEAR_M and not (binding and edge.looked > 0.0)


@inner
def _begin(bodies: Bodies, at: Record, z: FloatArray, i: int, seen: Seen) -> None:
    """Write what is known of a stage that nothing has been seen of: feet as on a straight, clearances by a bound from the state."""
    clear = clear_by_state(bodies.units, at, z)
    for number in range(bodies.units.size):
        axle = at.s - bodies.behind[number]
        for point in range(bodies.axis.shape[1]):
            seen.axis_feet[i, number, point] = axle + bodies.axis[number, point]
        for point in range(bodies.points.shape[1]):
            seen.feet[i, number, point, 0] = seen.feet[i, number, point, 1] = axle + bodies.points[number, point].ahead
        for side in range(2):
            seen.edges[i, number, side].clear, seen.edges[i, number, side].looked = clear, 0.0
    for j in range(z.size):
        seen.z[i, j] = z[j]
