"""Options that several commands share. Only Typer is imported here: ``--help`` stays quick."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli import completion
from hdvplan.cli.help import OUTPUT, PLANNING, VEHICLE
from hdvplan.errors import OptionError

if TYPE_CHECKING:
    from collections.abc import Sequence

_LONGEST_NAME = 110  # bytes; a file's name has up to 255

RoadArgument = Annotated[
    str,
    typer.Argument(
        metavar="ROAD",
        help="A road file (CSV, GeoJSON, OpenDRIVE, or a format that GDAL reads), or a name from `hdvplan roads list`.",
        autocompletion=completion.roads,
    ),
]
_VEHICLE = typer.Option(
    "--vehicle",
    metavar="NAME|FILE.toml",
    help="A name from `hdvplan vehicles list`, or a vehicle file.",
    autocompletion=completion.vehicles,
    rich_help_panel=VEHICLE,
)
VehicleOption = Annotated[str, _VEHICLE]
VehicleOrNoneOption = Annotated[str | None, _VEHICLE]
HalfWidthOption = Annotated[
    float | None, typer.Option("--half-width", metavar="M", help="Limits at M to either side of the line [m].", rich_help_panel=VEHICLE)
]
ClearanceOption = Annotated[
    float, typer.Option("--clearance", metavar="M", help="Room to keep from every limit and obstacle [m].", rich_help_panel=VEHICLE)
]
ObjectiveOption = Annotated[
    str,
    typer.Option(
        "--objective",
        metavar="NAME",
        help="What the plan centres: geometric, balanced, geometric-fixed, lead-axle, trail-axle, art-weighted, art-weighted:0.45, "
        "axle-max, body-max, one of an installed package, or your own: package.module:name, file.py:name.",
        autocompletion=completion.objectives,
        rich_help_panel=PLANNING,
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Write JSON to stdout, and nothing else.", rich_help_panel=OUTPUT)]
QuietOption = Annotated[bool, typer.Option("--quiet", help="No progress, notes or tables; errors remain.", rich_help_panel=OUTPUT)]
FormatsOption = Annotated[
    str,
    typer.Option("--format", metavar="A,B", help="png, pdf, svg: the picture; dxf, gpkg: layers for CAD and GIS.", rich_help_panel=OUTPUT),
]
OutOption = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Where to write [default: <road>.<vehicle>/].", rich_help_panel=OUTPUT)
]


def choice(option: str, value: str, choices: Sequence[str]) -> str:
    """Return ``value`` if it is one of the choices.

    Raises:
        OptionError: it is none of them.

    """
    if value not in choices:
        msg = f"{option} must be {', '.join(choices[:-1])} or {choices[-1]}, not {value!r}"
        raise OptionError(msg)
    return value


def drawn_formats(text: str, pictures: Sequence[str], drawings: Sequence[str], *, plot: bool) -> list[str]:
    """Return what ``--format A,B`` asks for, of these; without ``plot`` no pictures.

    Raises:
        OptionError: one is none of them.

    """
    kinds = [choice("--format", kind.strip(), (*pictures, *drawings)) for kind in text.split(",")]
    return [kind for kind in kinds if plot or kind in drawings]


def file_name(name: str) -> str:
    """Return ``name`` with what files should not be called by replaced, short enough for two of them to be one file's name."""
    return re.sub(r"[^\w.-]+", "-", name).encode()[:_LONGEST_NAME].decode(errors="ignore")
