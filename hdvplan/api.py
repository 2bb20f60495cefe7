"""The whole way from a road and a vehicle to a judged plan, in one call."""

from __future__ import annotations

from collections.abc import Callable

from hdvplan.driving.drive import drive, warm_up
from hdvplan.judging.result import Result, result_of
from hdvplan.planning.bias import NONE, Bias
from hdvplan.planning.objectives import objective_named
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.road import Road
from hdvplan.solvers.registry import DEFAULT, solver_named
from hdvplan.vehicle.model import Vehicle

_DEFAULTS = PlannerSettings()


def plan(
    road: Road,
    vehicle: Vehicle,
    settings: PlannerSettings = _DEFAULTS,
    *,
    objective: str = "geometric",
    solver: str = DEFAULT,
    bias: Bias = NONE,
    on_progress: Callable[[float], None] | None = None,
) -> Result:
    """Plan ``vehicle`` along all of ``road`` in receding horizon and judge what an exact simulation of it sweeps.

    ``objective`` and ``solver`` are the command line's names; ``bias`` is where the middle of the swept area should lie, see
    ``hdvplan.planning.bias.bias_named``; ``on_progress`` receives the driven share, 0 to 1. Loads and
    compiles everything before the first timed step.

    Raises:
        OptionError: no such objective, or a bias that the road or the objective has no room for.
        SolverError: no such solver, not installed, or its first plan failed.
        RoadError: the road is shorter than the vehicle.
        PlanError: the vehicle cannot be planned further, or a body reaches beyond the road's centre of curvature.

    """
    centred, make_workspace = objective_named(objective), solver_named(solver)
    warm_up(vehicle, centred, make_workspace, settings)
    driven = drive(road, vehicle, centred, make_workspace, settings, bias=bias, on_progress=on_progress)
    return result_of(driven, solver=solver, objective=objective)
