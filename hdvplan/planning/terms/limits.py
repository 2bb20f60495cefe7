"""Limits: the rows that keep every body within the road's limits, linearised at a given motion: see hdvplan/core/limits.c.

Bodies far from their limits are screened out by bounds that need no projection, or few, and once found clear they are not looked at
again before they have moved. Of every other edge the tightest places enter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import LimitTable, Stations
from hdvplan.planning.terms.term import CorePart, Needs, Place, Scene, core_functions
from hdvplan.qp.program import by_stage
from hdvplan.vehicle.body import axis_points, axles_behind, edge_points
from hdvplan.vehicle.model import Vehicle

ROWS_PER_EDGE = core.number("HDV_ROWS_PER_EDGE")  # the tightest places of each edge that enter the program
CLEAR_M = core.constant("HDV_CLEAR_M")  # a body that stays this far inside the limits by a safe bound needs no rows
# What is known of one edge of one body at one stage.
EDGE = core.record(
    "hdv_edge",
    [
        ("clear", float),  # a lower bound of its clearance to all limits, the wheels' for overhangs too [m]
        ("gap", float),  # a lower bound of its clearance to the limits that it must keep [m]
        ("looked", float),  # 1 where that was found by looking at the edge, 0 where a bound says it
        ("never", float),  # 1 while the edge's rows never bind
    ],
)
_TABLE = core.record("hdv_limit_table", [("values", core.ADDRESS), ("count", np.int64), ("s_first", float), ("spacing", float)])
_LIMITS = core.record(
    "hdv_limits",
    [
        *((name, core.ADDRESS) for name in ("curve", "table", "points", "axis", "behind")),
        *((name, float) for name in ("reach", "clearance")),
        *((name, np.int64) for name in ("row", "rows")),
        *((name, core.ADDRESS) for name in ("seen_z", "edges", "axis_feet", "feet")),
        ("violation", float),
    ],
)
_FUNCTIONS = core_functions("limits")


class Seen(NamedTuple):
    """What was seen of every stage when it was last looked at."""

    z: FloatArray  # (N+1, n), the state
    edges: Records  # (N+1, units, 2) of ``EDGE``, left and right
    axis_feet: FloatArray  # (N+1, units, 4) [m]
    feet: FloatArray  # (N+1, units, points, 2), of the points of both edges [m]


@dataclass(frozen=True)
class Limits:
    """Every edge of every body: ``rows_per_edge`` rows a stage, elastic at the settings' prices."""

    rows_per_edge: int

    def needs(self, vehicle: Vehicle) -> Needs:
        """Return the rows: see ``Term``."""
        return Needs(rows=2 * self.rows_per_edge * len(vehicle.units))

    def part(self, scene: Scene, place: Place) -> LimitsPart:
        """Return the term in its place: see ``Term``."""
        vehicle, settings, count = scene.vehicle, scene.settings, scene.capacity
        units = len(vehicle.units)
        rows = scene.qp.rows[:, place.row : place.row + self.needs(vehicle).rows]
        soft = np.arange(rows.shape[1]) % self.rows_per_edge >= ROWS_PER_EDGE
        rows["linear"], rows["quadratic"] = np.where(soft, 0.0, settings.elastic_weight), settings.elastic_growth
        rows["quadratic"][:, soft] = 2.0 * settings.overhang_cost
        points, axis, behind = edge_points(vehicle), axis_points(vehicle), axles_behind(vehicle)
        seen = Seen(
            np.zeros((count, vehicle.states)), np.zeros((count, units, 2), EDGE), np.zeros((count, *axis.shape)),
            np.zeros((count, *points.shape, 2)),
        )  # fmt: skip
        limits = np.ascontiguousarray(scene.stations.limits.values)
        road = (scene.stations.path.record, table_record(scene.stations.limits, limits), points, axis, behind)
        own = (_furthest(vehicle), settings.clearance, place.row, rows.shape[1])
        data = np.array([(*map(core.address, road), *own, *map(core.address, seen), 0.0)], _LIMITS)
        return LimitsPart(scene, _FUNCTIONS, data, rows, seen, (*road, limits))


def limits_of(stations: Stations, settings: PlannerSettings) -> Limits | None:
    """Return the limits of a drive: two more rows an edge where overhangs may reach further at a cost; None on a road without."""
    if not stations.limits.values.size:
        return None
    return Limits(2 * ROWS_PER_EDGE if stations.limits.two_regions and settings.overhang_cost > 0.0 else ROWS_PER_EDGE)


def table_record(table: LimitTable, values: FloatArray) -> Records:
    """Return a table of limits as the core takes it; its ``values``, contiguous, must outlive the record."""
    return np.array([(core.address(values), values.shape[1], table.s_first, table.spacing)], _TABLE)


def _furthest(vehicle: Vehicle) -> float:
    """Return a bound of how far any point of a body can be from the lead rear axle, however the vehicle is folded [m]."""
    axle, furthest, hitch = 0.0, 0.0, 0.0
    for number, unit in enumerate(vehicle.units):
        axle += hitch + (unit.wheelbase if number else 0.0)
        furthest = max(furthest, axle + float(np.hypot(max(unit.front, unit.rear_overhang), 0.5 * unit.width)))
        hitch = abs(unit.hitch_offset)
    return furthest


@dataclass(frozen=True)
class LimitsPart(CorePart):
    """Limits in their place; see ``Part``."""

    rows: Records  # (N+1, own rows)
    seen: Seen
    kept: tuple[Records | FloatArray, ...]  # what the data point to

    @property
    def memory(self) -> tuple[FloatArray, ...]:
        """What was seen."""
        return tuple(by_stage(array) for array in self.seen)

    @property
    def violation(self) -> float:
        """The deepest breach of a limit at any stage of the motion that was last linearised at; 0 when all are kept [m]."""
        return float(self.data["violation"][0])
