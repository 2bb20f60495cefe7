"""``hdvplan vehicles``: the presets, as a table and as TOML to copy and edit."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli import completion
from hdvplan.cli.console import ExitCode, print_json, print_tables
from hdvplan.cli.options import JsonOption

if TYPE_CHECKING:
    from collections.abc import Iterable

    from hdvplan.vehicle.model import Vehicle

app = typer.Typer(help="List and show the preset vehicles.", rich_markup_mode=None)

_CAPTION = "axles: wheelbase of each body; front, rear: overhangs; radius: the lead rear axle's tightest"


@app.command("list")
def list_vehicles(json: JsonOption = False) -> int:
    """List the preset vehicles with their dimensions."""
    from hdvplan.report.tables import grid
    from hdvplan.vehicle.load import load_vehicle, preset_names

    presets = [load_vehicle(name) for name in preset_names()]
    if json:
        print_json([_described(vehicle) for vehicle in presets])
        return ExitCode.OK
    rows = [
        (
            vehicle.name,
            f"{vehicle.reach_ahead + vehicle.reach_behind:.2f}",
            f"{vehicle.width:.2f}",
            _joined(unit.wheelbase for unit in vehicle.units),
            f"{vehicle.lead.front_overhang:.2f}",
            f"{vehicle.units[-1].rear_overhang:.2f}",
            f"{1 / vehicle.max_curvature:.1f}",
        )
        for vehicle in presets
    ]
    columns = ("vehicle", "length [m]", "width [m]", "axles [m]", "front [m]", "rear [m]", "radius [m]")
    print_tables(grid("preset vehicles", columns, rows, text=("vehicle",), caption=_CAPTION))
    return ExitCode.OK


@app.command("show")
def show_vehicle(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A preset.", autocompletion=completion.vehicles)], json: JsonOption = False
) -> int:
    """Print a preset's TOML, ready to copy and edit."""
    from hdvplan.vehicle.load import load_vehicle, preset_text

    text = preset_text(name)
    if json:
        print_json(_described(load_vehicle(name)))
    else:
        sys.stdout.write(text)
    return ExitCode.OK


def _described(vehicle: Vehicle) -> dict[str, object]:
    from dataclasses import asdict

    return asdict(vehicle) | {"length_m": vehicle.reach_ahead + vehicle.reach_behind, "width_m": vehicle.width}


def _joined(lengths: Iterable[float]) -> str:
    return "+".join(f"{length:.2f}" for length in lengths)
