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
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.term import Columns, CorePart, Needs, Scene, Term, core_functions
from hdvplan.qp.program import by_stage
from hdvplan.road.pieces import BLOCK
from hdvplan.vehicle.kinematics import axles_behind
from hdvplan.vehicle.model import Vehicle

ROWS_PER_SIDE = core.number("HDV_ROWS_PER_SIDE")  # the tightest contacts to each side that enter the program
CLEAR_M = core.constant("HDV_CLEAR_M")  # a body that stays this far inside the street by a safe bound needs no rows
# What is known of one edge of one body at one stage.
EDGE = core.record("hdv_edge")
_LIMITS = core.record("hdv_limits")
_NEAR = core.record("hdv_near", blocks=np.dtype((BLOCK, core.number("HDV_SOME"))))
_FUNCTIONS = core_functions("limits")


class Seen(NamedTuple):
    """What is known of every stage."""

    x: FloatArray  # (N+1, n + 2), the state, and the curvature until it, as last looked through; how far all is clear there, or 0 [m]
    edges: Records  # (N+1, units, 2) of ``EDGE``, left and right


@dataclass(frozen=True)
class Limits(Term):
    """Every edge of every body: ``rows_per_side`` rows a stage, elastic at the settings' prices."""

    rows_per_side: int

    def needs(self, vehicle: Vehicle) -> Needs:
        """Return the rows: see ``Term``."""
        return Needs(rows=2 * self.rows_per_side * len(vehicle.units))

    def part(self, scene: Scene, columns: Columns) -> LimitsPart:
        """Return the term as part of the program: see ``Term``."""
        vehicle, settings, count = scene.vehicle, scene.settings, scene.capacity
        units = len(vehicle.units)
        rows = scene.qp.rows[:, columns.row : columns.row + self.needs(vehicle).rows]
        soft = np.arange(rows.shape[1]) % self.rows_per_side >= ROWS_PER_SIDE
        rows["linear"], rows["quadratic"] = np.where(soft, 0.0, settings.elastic_weight), settings.elastic_growth
        rows["quadratic"][:, soft] = 2.0 * settings.overhang_cost
        behind = axles_behind(vehicle)
        seen = Seen(np.zeros((count, vehicle.states + 2)), np.zeros((count, units, 2), EDGE))
        assert scene.stations.street is not None  # noqa: S101 - for the type checker: see limits_of
        street = scene.stations.street.record.copy()
        street["clearance"] = settings.clearance - settings.give_way
        road, near = (scene.stations.path.record, street, behind), np.zeros(1, _NEAR)
        own = (_furthest(vehicle), settings.clearance, columns.row, rows.shape[1])
        data = np.array([(*map(core.address, road), *own, *map(core.address, (*seen, near)), 0.0)], _LIMITS)
        kept, memory = (*road, near, *scene.stations.street), tuple(by_stage(array) for array in seen)
        return LimitsPart(scene, _FUNCTIONS, data, rows, seen, kept=kept, memory=memory)


def limits_of(stations: Stations, settings: PlannerSettings) -> Limits | None:
    """Return the limits of a drive: two more rows a side where overhangs may reach further at a cost; None on a road without."""
    street = stations.street
    if street is None:
        return None
    return Limits(2 * ROWS_PER_SIDE if np.any(street.pieces["wheels"]) and settings.overhang_cost > 0.0 else ROWS_PER_SIDE)


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
    """Limits as part of a program; see ``Part``."""

    rows: Records  # (N+1, own rows)
    seen: Seen
