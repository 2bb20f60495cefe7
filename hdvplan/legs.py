"""Drives of several legs, forwards and rear first: from a file to a judged plan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from hdvplan.cusps import with_room
from hdvplan.driving.drive import Drive
from hdvplan.driving.lead_line import lead_line
from hdvplan.driving.legs import drive_legs
from hdvplan.errors import RoadError
from hdvplan.judging.legs import LegsResult
from hdvplan.judging.result import result_of
from hdvplan.planning.objectives import Objective, objective_named
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.legs import Legs
from hdvplan.road.load import find_road
from hdvplan.road.load_legs import legs_of
from hdvplan.road.options import RoadOptions
from hdvplan.road.regions import Kind
from hdvplan.solvers.registry import DEFAULT, SolverClass, dependable
from hdvplan.vehicle.model import Vehicle

_USUAL, _SETTINGS = RoadOptions(), PlannerSettings()
_LEAD_AXLE = "lead-axle"


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
        PlanError: the vehicle cannot be planned along a line, or its trailers fold.

    """

    def once(legs: Legs, objective: str | Objective, on_progress: Callable[[float], None] | None = None) -> LegsResult:
        drives = drive_legs(legs, vehicle, objective_named(objective), dependable(solver), settings, on_progress=on_progress)
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
