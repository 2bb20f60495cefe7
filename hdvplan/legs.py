"""Drives of several legs, forwards and rear first: from a file to a judged plan, whose cusps are moved where the drawn ones lack room."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from hdvplan.arrays import FloatArray
from hdvplan.driving.drive import POSE_SPACING_M, Drive
from hdvplan.driving.lead_line import lead_line
from hdvplan.driving.legs import drive_legs
from hdvplan.errors import HdvplanError, PlanError, RoadError
from hdvplan.judging.legs import LegsResult
from hdvplan.judging.result import result_of
from hdvplan.planning.objectives import Objective, objective_named
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.joints import joined
from hdvplan.road.legs import Leg, Legs
from hdvplan.road.load import find_road
from hdvplan.road.load_legs import legs_of, within
from hdvplan.road.options import RoadOptions
from hdvplan.road.regions import Kind
from hdvplan.road.road import part_of
from hdvplan.solvers.registry import DEFAULT, SolverClass, dependable
from hdvplan.vehicle.model import Vehicle

_USUAL, _SETTINGS = RoadOptions(), PlannerSettings()
_LEAD_AXLE = "lead-axle"
_FURTHEST_M = 6.0  # that a cusp is moved past the drawn one
_SHORT_M = 8.0  # that a leg stops short of it
_FIRST_M = 1.5  # of the first trials
_TRIALS = 16  # a cusp
_FOUND_M = 0.02  # to which cusps are sought
_ROOM_M = 100.0  # of a line beyond its ends: further than bodies reach


def load_legs(source: str | Path, options: RoadOptions = _USUAL, *, last_axle_of: Vehicle | None = None) -> Legs:
    """Return the legs in the file ``source``, or in the shipped one of that name.

    With ``last_axle_of`` a vehicle, the lines that are driven backwards are those of its last axle, else of the lead rear axle.

    Raises:
        RoadError: no such file or name, an unusable file, one without legs, or legs that do not meet or cannot be smoothed.

    """
    found = find_road(source, options)
    if found.line is None:
        msg = f"{source} is a road, and has no legs"
        raise RoadError(msg)
    return legs_of(found.line, None if last_axle_of is None else partial(lead_line, last_axle_of))


def plan_legs(
    legs: Legs,
    vehicle: Vehicle,
    *,
    objective: str | Objective = "geometric",
    solver: str | SolverClass = DEFAULT,
    settings: PlannerSettings = _SETTINGS,
    refine: bool = True,
    on_progress: Callable[[float], None] | None = None,
) -> LegsResult:
    """Plan ``vehicle`` along all legs, across their cusps, and judge every leg by an exact simulation.

    The steering turns at cusps while the vehicle stands. ``refine`` plans again where that lacks room: with the lead axle on the lines,
    then with cusps a little past the drawn ones, or short of them, which the result tells. ``on_progress`` receives the driven share of
    the first plan, 0 to 1.

    Raises:
        OptionError: no such objective, or one that cannot plan several legs.
        SolverError: no such solver, not installed, or neither it nor a second solver found a plan.
        PlanError: the vehicle cannot be planned along a line, even without limits.

    """

    def once(legs: Legs, objective: str | Objective, on_progress: Callable[[float], None] | None = None) -> LegsResult:
        drive = partial(drive_legs, legs, vehicle, objective_named(objective), dependable(solver))
        try:
            drives = drive(settings, on_progress=on_progress)
        except PlanError:
            if all(leg.road.street is None for leg in legs.legs):
                raise
            drives = tuple(replace(one, settings=settings) for one in drive(settings.unlimited, on_progress=on_progress))
        return LegsResult(legs, tuple(result_of(_whole(drive, legs), solver=solver, objective=objective) for drive in drives))

    found = once(legs, objective, on_progress)
    if refine and found.fits is False:
        found = max(found, once(legs, _LEAD_AXLE), key=lambda one: one.room)
    if refine and found.fits is False:
        found = with_room(found, partial(once, objective=found.results[0].case.objective))
    return found


def _whole(drive: Drive, legs: Legs) -> Drive:
    """Return a drive among whole obstacles: planning knows those across the continuation of its line in two parts."""
    if not legs.regions:
        return drive
    areas = (region for region in drive.road.regions if region.kind is Kind.SWEEPABLE)
    obstacles = (region for region in legs.regions if region.kind is Kind.OBSTACLE)
    return replace(drive, road=replace(drive.road, regions=(*obstacles, *areas)))


def past(legs: Legs, by: FloatArray) -> Legs:
    """Return legs that are driven ``by`` past their cusps (cusps,), or stop short of them where negative [m]; first and last ends stay.

    Raises:
        RoadError: lines that stop short no longer meet.

    """
    ends = np.concatenate([[0.0], by, [0.0]])
    moved = []
    for leg, before, after in zip(legs.legs, ends[:-1], ends[1:], strict=True):
        low, high = (after, before) if leg.backward else (before, after)
        road = part_of(leg.road, -float(low), leg.road.path.length + float(high), _ROOM_M, _ROOM_M)
        if leg.road.limits is None and leg.road.drawn is None:  # the bounds of an open place are no street
            road = replace(road, drawn=None)
        moved.append(Leg(road, leg.backward))
    own, _ = joined(tuple(moved), 2.0 * _FURTHEST_M)
    return replace(legs, legs=tuple(within(leg, legs.regions) for leg in own))


def with_room(drawn: LegsResult, plan: Callable[[Legs], LegsResult]) -> LegsResult:
    """Return the plan with the most room among those with cusps near the drawn ones; the first that fits, where one does."""
    best, count = drawn, len(drawn.legs.legs) - 1
    if not count:  # a single leg, backwards
        return drawn

    def lacking(by: FloatArray) -> float:
        nonlocal best
        if best.fits:  # what is still tried costs nothing
            return -best.room
        try:
            found = replace(plan(past(drawn.legs, by)), past=tuple(by.tolist()))
        except HdvplanError:
            return float(np.inf)
        best = max(best, found, key=lambda one: one.room)
        return _entered(found) - found.room

    simplex = np.vstack([np.zeros(count), _FIRST_M * np.eye(count)])
    options: Any = {"initial_simplex": simplex, "maxfev": _TRIALS * count, "xatol": _FOUND_M, "fatol": _FOUND_M}  # typed by method
    bounds = [(-_SHORT_M, _FURTHEST_M)] * count
    scipy.optimize.minimize(lacking, np.zeros(count), method="Nelder-Mead", bounds=bounds, options=options)
    return best


def _entered(found: LegsResult) -> float:
    """Return the way over which bodies are in obstacles [m]: how deep one is in a wall says little, or how far beyond it it is driven."""
    obstacles = [region.polygon for region in found.legs.regions if region.kind is Kind.OBSTACLE]
    inside = (np.unique(result.outlines.query(obstacles, predicate="intersects")[1]).size for result in found.results)
    return POSE_SPACING_M * sum(inside)
