"""``hdvplan vehicles``: the presets, as a table, as TOML to copy and edit, and as drawings."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli.console import ExitCode, note, print_json, print_tables, writing
from hdvplan.cli.help import OUTPUT, Command
from hdvplan.cli.options import JsonOption, file_name, offered_vehicles
from hdvplan.errors import OptionError
from hdvplan.report import PICTURES
from hdvplan.settings import choice

if TYPE_CHECKING:
    from hdvplan.vehicle.model import Vehicle

app = typer.Typer(help="List and show the preset vehicles.", rich_markup_mode=None)

_TITLES = {"papers": "vehicles of the papers", "europe": "Europe", "aashto": "design vehicles of AASHTO (USA)"}
_CAPTION = "*: this axle steers too; radius: the least that the front wheels alone allow"


@app.command("list", cls=Command)
def list_vehicles(json: JsonOption = False) -> int:
    """List the preset vehicles with their dimensions."""
    from hdvplan.report.grid import grid
    from hdvplan.vehicle.load import load_vehicle, preset_groups

    groups = {group: [load_vehicle(name) for name in names] for group, names in preset_groups().items()}
    if json:
        print_json([{"group": group} | _described(vehicle) for group, vehicles in groups.items() for vehicle in vehicles])
        return ExitCode.OK
    columns = ("vehicle", "units", "length [m]", "width [m]", "wheelbases [m]", "radius [m]")
    tables = [grid(_TITLES[group], columns, map(_row, vehicles), text=("vehicle",)) for group, vehicles in groups.items()]
    tables[-1].caption, tables[-1].caption_justify = _CAPTION, "left"
    print_tables(*tables)
    return ExitCode.OK


def _row(vehicle: Vehicle) -> tuple[str, ...]:
    return (
        vehicle.name,
        f"{len(vehicle.units)}",
        f"{vehicle.reach_ahead + vehicle.reach_behind:.2f}",
        f"{vehicle.width:.2f}",
        "+".join(f"{unit.wheelbase:.1f}{'*' if unit.steering_ratio else ''}" for unit in vehicle.units),
        f"{1 / vehicle.max_curvature:.1f}",
    )


@app.command("show", cls=Command)
def show_vehicle(
    name: Annotated[
        str,
        typer.Argument(metavar="NAME", help="A name from `hdvplan vehicles list`, or a vehicle file.", autocompletion=offered_vehicles),
    ],
    file: Annotated[Path | None, typer.Argument(metavar="FILE", help="The picture of --plot [default: NAME.png]; png, pdf or svg.")] = None,
    plot: Annotated[bool, typer.Option("--plot", help="Draw the vehicle with its dimensions instead.", rich_help_panel=OUTPUT)] = False,
    json: JsonOption = False,
) -> int:
    """Print a vehicle's TOML, ready to copy and edit; or draw it."""
    from hdvplan.vehicle.load import read_vehicle, vehicle_text

    if file is not None and not plot:
        msg = f"{file} is a file for a drawing, but --plot is not given"
        raise OptionError(msg)
    (vehicle, remark), text = read_vehicle(name), vehicle_text(name)
    if remark is not None:
        note(remark)
    drawn = None
    if plot:
        from hdvplan.fileio import write_atomically
        from hdvplan.report.drawing import vehicle_figure
        from hdvplan.report.style import figure_bytes

        drawn = file or Path(f"{file_name(vehicle.name)}.png")
        kind = choice("the drawing's ending", drawn.suffix.lower().removeprefix("."), PICTURES)
        with writing(f"{drawn}", "choose another file: hdvplan vehicles show NAME --plot FILE"):
            write_atomically(drawn, figure_bytes(vehicle_figure(vehicle), kind))
    if json:
        print_json(_described(vehicle) | ({} if drawn is None else {"file": str(drawn)}))
    elif drawn is not None:
        note(f"wrote {drawn}")
    else:
        sys.stdout.write(text)
    return ExitCode.OK


def _described(vehicle: Vehicle) -> dict[str, object]:
    from dataclasses import asdict

    return asdict(vehicle) | {"length_m": vehicle.reach_ahead + vehicle.reach_behind, "width_m": vehicle.width}
