"""What passing obstacles on certain sides costs: a plan of the stretch of road around them, judged by simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.driving.drive import Drive, drive
from hdvplan.errors import PlanError, SolverError
from hdvplan.judging.balance import KEPT_M, gaps_of
from hdvplan.judging.clearance import touches_of
from hdvplan.judging.envelope import SPACING_M, envelope_of
from hdvplan.judging.obstacles import approaches
from hdvplan.judging.result import Trial
from hdvplan.planning.bias import Bias
from hdvplan.planning.objectives import objective_named
from hdvplan.road.part import part_of
from hdvplan.road.regions import Side
from hdvplan.road.road import Road
from hdvplan.solvers.registry import dependable

_ROOM_M = 20.0  # of path and limits beyond the ends of a stretch, the vehicle and its horizon
_NO_PLAN = Trial(np.inf, np.inf, -np.inf, np.inf, np.inf)


def tried(case: Case, sides: Mapping[int, Side], s_from: float, s_to: float) -> Trial:
    """Plan ``case`` from ``s_from`` to ``s_to`` [m] with the obstacles of some passages, and judge it.

    ``sides`` are those of the passages, by their numbers. The vehicle starts in the stationary geometry of the first point.
    """
    part = _stretch(case, sides, s_from, s_to)
    bias = Bias(case.bias.s - s_from, case.bias.offset)
    try:
        driven = drive(part, case.vehicle, objective_named(case.objective), dependable(case.solver), case.settings, bias=bias)
        return _judged(driven)
    except (PlanError, SolverError):
        return _NO_PLAN


def _stretch(case: Case, sides: Mapping[int, Side], s_from: float, s_to: float) -> Road:
    """Return a stretch as a separate road that continues, beyond both ends, as the whole one does."""
    vehicle, road = case.vehicle, case.road
    before, after = vehicle.reach_behind + _ROOM_M, case.settings.horizon + vehicle.reach_ahead + _ROOM_M
    there = [
        passage.region
        for number, passage in enumerate(road.passages)
        if number in sides and (road.path.closed or (passage.s_from < s_to and passage.s_to > s_from))
    ]
    part = part_of(road.passing(sides), s_from, s_to, before, after)
    return replace(part, regions=tuple(road.regions[one] for one in dict.fromkeys(there)))


def _judged(driven: Drive) -> Trial:
    envelope, settings = envelope_of(driven), driven.settings
    gaps = gaps_of(touches_of(driven, envelope.s))
    distances = [(approach.distance, approach.s_to - approach.s_from + SPACING_M) for approach in approaches(driven)]
    clearance = min([*(float(np.nanmin(gap)) for gap in gaps.values()), *(distance for distance, _ in distances)], default=np.inf)
    lacking = settings.clearance - clearance
    harm = sum(SPACING_M * float(np.nansum(_missing(settings.clearance - gap) ** 2)) for gap in gaps.values())
    harm += sum(length * float(_missing(settings.clearance - distance)) ** 2 for distance, length in distances)
    off = 0.5 * (envelope.reach_left + envelope.reach_right) - driven.bias.at(envelope.s)
    turned = float(np.mean(np.diff(driven.kappa) ** 2))
    cost = float(np.mean(off**2)) + settings.smoothness * turned
    return Trial(lacking if lacking > KEPT_M else 0.0, harm, clearance, float(np.mean(np.abs(off))), cost)


def _missing(lacking: FloatArray | float) -> FloatArray:
    return np.where(np.asarray(lacking) > KEPT_M, lacking, 0.0)
