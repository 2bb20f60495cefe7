"""What passing obstacles on certain sides costs: a plan of the stretch of road around them, judged by simulation."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.driving.drive import Drive, drive
from hdvplan.errors import PlanError, SolverError
from hdvplan.judging.balance import KEPT_M, edge_gaps_of
from hdvplan.judging.envelope import SPACING_M, envelope_of
from hdvplan.judging.obstacles import approaches
from hdvplan.judging.passed import Trial
from hdvplan.planning.bias import Bias
from hdvplan.planning.objectives import objective_named
from hdvplan.road.obstructed import Obstructed
from hdvplan.road.regions import Side
from hdvplan.road.road import Limits, Road
from hdvplan.solvers.second import dependable

_ROOM_M = 20.0  # of path and limits beyond the ends of a stretch, the vehicle and its horizon
_NO_PLAN = Trial(np.inf, np.inf, -np.inf, np.inf, np.inf)


def tried(case: Case, road: Obstructed, sides: Mapping[int, Side], s_from: float, s_to: float) -> Trial:
    """Plan ``case`` from ``s_from`` to ``s_to`` [m] with the obstacles of some passages, and judge it.

    ``sides`` are those of the passages, by their numbers. The vehicle starts in the stationary geometry of the first point.
    """
    part = _stretch(case, road, sides, s_from, s_to)
    bias = Bias(case.bias.s - s_from, case.bias.offset)
    try:
        driven = drive(part, case.vehicle, objective_named(case.objective), dependable(case.solver), case.settings, bias=bias)
        return _judged(driven)
    except (PlanError, SolverError):
        return _NO_PLAN


def _stretch(case: Case, road: Obstructed, sides: Mapping[int, Side], s_from: float, s_to: float) -> Road:
    """Return a stretch as a separate road that continues, beyond both ends, as the whole one does."""
    vehicle, whole = case.vehicle, case.road
    before, after = vehicle.reach_behind + _ROOM_M, case.settings.horizon + vehicle.reach_ahead + _ROOM_M
    path = whole.path.stretch(s_from, s_to, before, after)
    given = _limits(road, {}, s_from, before, s_to, after)
    there = np.flatnonzero((road.spans[0] < s_to) & (road.spans[1] > s_from))
    regions = tuple(whole.regions[one] for one in dict.fromkeys(road.passages[number].region for number in there if number in sides))
    limits = _limits(road, sides, s_from, before, s_to, after)
    return Road(whole.name, path, limits, regions=regions, band=given, edges=given)


def _limits(road: Obstructed, sides: Mapping[int, Side], s_from: float, before: float, s_to: float, after: float) -> Limits:
    s, values = road.limits(sides, s_from - before, s_to + after)
    near = np.flatnonzero((s >= s_from - before) & (s <= s_to + after))
    part = slice(max(near[0] - 1, 0), near[-1] + 2) if len(near) else slice(None)
    return Limits(s[part] - s_from, *values[:, part])


def _judged(driven: Drive) -> Trial:
    envelope, settings = envelope_of(driven), driven.settings
    gaps = edge_gaps_of(driven, envelope)
    distances = [(approach.distance, approach.s_to - approach.s_from + SPACING_M) for approach in approaches(driven)]
    clearance = min(*(float(np.nanmin(gap)) for gap in gaps.values()), *(distance for distance, _ in distances))
    lacking = settings.clearance - clearance
    harm = sum(SPACING_M * float(np.nansum(_missing(settings.clearance - gap) ** 2)) for gap in gaps.values())
    harm += sum(length * float(_missing(settings.clearance - distance)) ** 2 for distance, length in distances)
    off = 0.5 * (envelope.reach_left + envelope.reach_right) - driven.bias.at(envelope.s)
    turned = float(np.mean(np.diff(driven.kappa) ** 2))
    cost = float(np.mean(off**2)) + settings.smoothness * turned
    return Trial(lacking if lacking > KEPT_M else 0.0, harm, clearance, float(np.mean(np.abs(off))), cost)


def _missing(lacking: FloatArray | float) -> FloatArray:
    return np.where(np.asarray(lacking) > KEPT_M, lacking, 0.0)
