"""Options that several commands share. Only Typer is imported here: ``--help`` stays quick."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli import completion
from hdvplan.cli.help import OUTPUT, VEHICLE
from hdvplan.errors import OptionError
from hdvplan.report import DRAWINGS, PICTURES
from hdvplan.settings import Setting, choice

if TYPE_CHECKING:
    from hdvplan.report.paper import SheetOptions

_LONGEST_NAME = 110  # bytes; a file's name has up to 255

_ROAD = typer.Argument(
    metavar="ROAD",
    help="A road file (CSV, GeoJSON, OpenDRIVE, Lanelet2, or a format that GDAL reads), or a name from `hdvplan roads list`.",
    autocompletion=completion.roads,
)
RoadArgument = Annotated[str, _ROAD]
RoadOrNoneArgument = Annotated[str | None, _ROAD]
_VEHICLE = typer.Option(
    "--vehicle",
    metavar="NAME|FILE.toml",
    help="A name from `hdvplan vehicles list`, or a vehicle file.",
    autocompletion=completion.vehicles,
    rich_help_panel=VEHICLE,
)
VehicleOption = Annotated[str, _VEHICLE]
VehiclesOption = Annotated[
    str,
    typer.Option(
        "--vehicle",
        metavar="NAME|FILE.toml,...",
        help="A name from `hdvplan vehicles list`, or a vehicle file; several, separated by commas, are compared.",
        autocompletion=completion.listed(completion.vehicles),
        rich_help_panel=VEHICLE,
    ),
]
VehicleOrNoneOption = Annotated[str | None, _VEHICLE]
JsonOption = Annotated[bool, typer.Option("--json", help="Write JSON to stdout, and nothing else.", rich_help_panel=OUTPUT)]
QuietOption = Annotated[bool, typer.Option("--quiet", help="No verdict, progress, notes or tables; errors remain.", rich_help_panel=OUTPUT)]


@dataclass(frozen=True)
class Room:
    """The road's limits, as options give them."""

    half_width: Annotated[float | None, Setting("Limits at M to either side of the line [m].", "M")] = None
    left: Annotated[float | None, Setting("Limit at M to the left of the line [m]; needs --right.", "M")] = None
    right: Annotated[float | None, Setting("Limit at M to the right of the line, a positive number [m]; needs --left.", "M")] = None

    def reaches(self) -> tuple[float, float] | None:
        """Return the limits left and right [m], or None where none are given; an ``OptionError`` where they contradict each other."""
        if self.half_width is not None:
            if self.left is not None or self.right is not None:
                msg = "--half-width sets both limits; it cannot be combined with --left and --right"
                raise OptionError(msg)
            return self.half_width, self.half_width
        if self.left is None and self.right is None:
            return None
        if self.left is None or self.right is None:
            given, missing = ("--left", "--right") if self.right is None else ("--right", "--left")
            msg = f"{given} needs {missing}"
            raise OptionError(msg, hint="or give --half-width for both")
        return self.left, self.right


WRITTEN = ("out", "json", "plot", "formats", "sheet", "scale", "stamps", "quiet")  # of ``Output``, by commands that make no film


@dataclass(frozen=True)
class Output:
    """Where a command that drives a vehicle writes, and what."""

    out: Annotated[Path | None, Setting("Where to write [default: <road>.<vehicle>/].", "DIR")] = None
    json: Annotated[bool, Setting("Write JSON to stdout, and nothing else.")] = False
    plot: Annotated[bool, Setting("Draw the picture plan.png.", names=("--plot/--no-plot",))] = True
    formats: Annotated[str, Setting("png, pdf, svg: the picture; dxf, gpkg: layers for CAD and GIS.", "A,B", ("--format",))] = "png"
    sheet: Annotated[str | None, Setting("Draw sheet.pdf at a round scale; up to a0.", "a4|a3|...")] = None
    scale: Annotated[str | None, Setting("Scale of the sheet: 200 draws 1:200 [default: what fits].", "N")] = None
    stamps: Annotated[
        tuple[str, ...],
        Setting("In the sheet's title block besides: 'project=Line 18', 'checked by='; may be repeated.", "NAME=TEXT", ("--stamp",)),
    ] = ()
    animate: Annotated[bool, Setting("Write drive.gif, a film of the drive.")] = False
    quiet: Annotated[bool, Setting("No verdict, progress, notes or tables; errors remain.")] = False

    def drawn_on(self) -> SheetOptions | None:
        """Return what the sheet is drawn on, or None without one; an ``OptionError`` where there is no such paper or scale."""
        if self.sheet is None:
            if self.scale is not None or self.stamps:
                msg = "--stamp needs a sheet" if self.scale is None else f"--scale {self.scale} needs a sheet"
                raise OptionError(msg, hint="add --sheet a3")
            return None
        from hdvplan.report.paper import SheetOptions

        return SheetOptions.named(self.sheet, self.scale, self.stamps)

    def kinds(self, drawings: Sequence[str] = DRAWINGS) -> list[str]:
        """Return which of ``PICTURES`` and ``drawings`` are asked for, without ``plot`` no pictures; else an ``OptionError``."""
        kinds = [choice("--format", kind.strip(), (*PICTURES, *drawings)) for kind in self.formats.split(",")]
        return [kind for kind in kinds if self.plot or kind in drawings]


def check_folder(out: Path | None) -> None:
    """Refuse, by an ``OptionError``, a place of output that is a file."""
    if out is not None and out.exists() and not out.is_dir():
        msg = f"--out {out} is a file, not a folder"
        raise OptionError(msg, hint="choose another folder with --out")


def file_name(name: str) -> str:
    """Return ``name`` with what files should not be called by replaced, short enough for two of them to be one file's name."""
    return re.sub(r"[^\w.-]+", "-", name).encode()[:_LONGEST_NAME].decode(errors="ignore")
