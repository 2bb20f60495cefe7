"""``hdvplan export-c``: a planner as C files, for a vehicle's own computer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hdvplan.cli import completion
from hdvplan.cli.checks import vehicle_named
from hdvplan.cli.console import note, print_line, progress, writing
from hdvplan.cli.help import OUTPUT, PLANNING, ROAD, VEHICLE
from hdvplan.cli.options import QuietOption, VehicleOption, check_folder, file_name

_BUDGET = "Budget of a step"
_SAMPLE = "uturn"


def export_c(
    vehicle: VehicleOption,
    road: Annotated[str, typer.Option("--road", metavar="ROAD", help="The sample that main.c drives.", rich_help_panel=ROAD)] = _SAMPLE,
    half_width: Annotated[
        float | None, typer.Option("--half-width", metavar="M", help="Limits at M to either side of the line [m].", rich_help_panel=VEHICLE)
    ] = None,
    clearance: Annotated[
        float, typer.Option("--clearance", metavar="M", help="Room to keep from every limit [m].", rich_help_panel=VEHICLE)
    ] = 0.0,
    objective: Annotated[
        str,
        typer.Option(
            "--objective",
            metavar="NAME",
            help="What the plan centres, as in `hdvplan plan`.",
            autocompletion=completion.objectives,
            rich_help_panel=PLANNING,
        ),
    ] = "geometric",
    horizon: Annotated[
        float, typer.Option("--horizon", metavar="M", help="How far each plan looks ahead [m].", rich_help_panel=PLANNING)
    ] = 100.0,
    step: Annotated[float, typer.Option("--step", metavar="M", help="Distance between stations [m].", rich_help_panel=PLANNING)] = 0.5,
    replan: Annotated[
        float, typer.Option("--replan", metavar="M", help="Distance driven before the next plan [m].", rich_help_panel=PLANNING)
    ] = 5.0,
    factorisations: Annotated[
        int | None,
        typer.Option("--factorisations", metavar="N", help="Most factorisations of a step [default: 120].", min=1, rich_help_panel=_BUDGET),
    ] = None,
    linearisations: Annotated[
        int | None,
        typer.Option("--linearisations", metavar="N", help="Most linearisations of a step [default: 24].", min=3, rich_help_panel=_BUDGET),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Where to write [default: <vehicle>.c/].", rich_help_panel=OUTPUT)
    ] = None,
    quiet: QuietOption = False,
) -> None:
    """Write the planner of a vehicle as C files.

    They are C99 without allocation: planner, solver, the vehicle's constants, a sample road, main.c that drives it, and a Makefile. The
    plans are those of hdvplan. A step that has spent its budget ends with the best motion that it has.

    Exit code 0: the files are written. 2: bad input.
    """
    check_folder(out)
    from hdvplan.case import Case
    from hdvplan.export.write import DEFAULT_BUDGET, Budget, write_planner
    from hdvplan.planning.settings import PlannerSettings
    from hdvplan.road.load import load_road

    driven = vehicle_named(vehicle, quiet=quiet)
    settings = PlannerSettings(horizon=horizon, step=step, replan=replan, clearance=clearance)
    with progress(f"reading {road}", quiet=quiet):
        track = load_road(road)
    if half_width is not None:
        track = track.with_limits(half_width, half_width)
    budget = Budget(factorisations or DEFAULT_BUDGET.factorisations, linearisations or DEFAULT_BUDGET.linearisations)
    directory = out or Path(file_name(f"{driven.name}.c"))
    case = Case(track, driven, objective=objective, settings=settings)
    with progress(f"laying out the planner of {driven.name}", quiet=quiet), writing(f"to {directory}"):
        write_planner(case, directory, budget)
    note(f"a planning step has at most {budget.factorisations} factorisations and {budget.linearisations} linearisations", quiet=quiet)
    if not quiet:
        print_line(f"{directory}/ holds the planner; try it: make -C {directory} && {directory}/sample > driven.csv")
