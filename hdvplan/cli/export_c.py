"""``hdvplan export-c``: a planner as C files, for a vehicle's own computer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hdvplan.cli.checks import vehicle_named
from hdvplan.cli.console import ExitCode, note, print_line, progress, writing
from hdvplan.cli.help import OUTPUT, PLANNING, ROAD, VEHICLE
from hdvplan.cli.options import OptionsOf, Output, Room, VehicleOption, check_folder, file_name, with_settings
from hdvplan.export import Budget
from hdvplan.planning.settings import PlannerSettings, PlanOptions

_PLANNED = ("horizon", "step", "replan", "smoothness", "clearance")


@with_settings
def export_c(
    vehicle: VehicleOption,
    *,
    road: Annotated[str, typer.Option("--road", metavar="ROAD", help="The sample that main.c drives.", rich_help_panel=ROAD)] = "uturn",
    room: Annotated[Room, OptionsOf(Room, VEHICLE)],
    settings: Annotated[PlannerSettings, OptionsOf(PlannerSettings, PLANNING, {"clearance": VEHICLE}, only=_PLANNED)],
    options: Annotated[PlanOptions, OptionsOf(PlanOptions, PLANNING, only=("objective",))],
    budget: Annotated[Budget, OptionsOf(Budget, PLANNING)],
    output: Annotated[Output, OptionsOf(Output, OUTPUT, words={"out": "Where to write [default: <vehicle>.c/]."}, only=("out", "quiet"))],
) -> int:
    """Write the planner of a vehicle as C files.

    They are C99 without allocation: planner, solver, the vehicle's constants, a sample road, main.c that drives it, and a Makefile. The
    plans are those of hdvplan. A step that has spent its budget ends with the best motion that it has.

    Exit code 0: the files are written. 2: bad input.
    """
    reaches, quiet = room.reaches(), output.quiet
    check_folder(output.out)
    from hdvplan.case import Case
    from hdvplan.export.write import write_planner
    from hdvplan.road.load import load_road

    driven = vehicle_named(vehicle, quiet=quiet)
    with progress(f"reading {road}", quiet=quiet):
        track = load_road(road)
    case = Case(track if reaches is None else track.with_limits(*reaches), driven, objective=options.objective, settings=settings)
    directory = output.out or Path(file_name(f"{driven.name}.c"))
    with progress(f"laying out the planner of {driven.name}", quiet=quiet), writing(f"to {directory}"):
        write_planner(case, directory, budget)
    note(f"a planning step has at most {budget.factorisations} factorisations and {budget.linearisations} linearisations", quiet=quiet)
    if not quiet:
        print_line(f"{directory}/ holds the planner; try it: make -C {directory} && {directory}/sample > driven.csv")
    return ExitCode.OK
