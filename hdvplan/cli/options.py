"""Options of commands: those that several share, how they are made of the fields of settings, and what the shell offers after TAB.

Only Typer is imported here: ``--help`` stays quick. Names that are offered come from the same functions as in the commands; the shell
completes files itself.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_origin

import typer

from hdvplan.cli.help import OUTPUT, VEHICLE
from hdvplan.errors import OptionError
from hdvplan.report import DRAWINGS, PICTURES
from hdvplan.settings import Field, Setting, choice, fields_of

if TYPE_CHECKING:
    from hdvplan.report.paper import SheetOptions

Offer = Callable[[str], list[str]]  # returns the names that begin so


def _offering(names: Callable[[], Sequence[str]]) -> Offer:
    return lambda incomplete: [name for name in names() if name.startswith(incomplete)]


@_offering
def offered_roads() -> list[str]:
    """Offer the shipped roads, examples and scenarios."""
    from hdvplan.road.scenarios import SCENARIOS, shipped_roads

    return [*shipped_roads(), *SCENARIOS]


@_offering
def offered_vehicles() -> list[str]:
    """Offer the preset vehicles."""
    from hdvplan.vehicle.load import preset_names

    return preset_names()


@_offering
def offered_templates() -> list[str]:
    """Offer the shipped templates of manoeuvres."""
    from hdvplan.turning.reversing.options import Template
    from hdvplan.turning.turn import template_names

    return [*template_names(), *Template]


@_offering
def offered_solvers() -> list[str]:
    """Offer the installed solvers."""
    from hdvplan.solvers.registry import solver_infos

    return [info.name for info in solver_infos() if info.version is not None]


@_offering
def offered_objectives() -> list[str]:
    """Offer the objectives."""
    from hdvplan.planning.settings import objective_names

    return objective_names()


def listed(offer: Offer) -> Offer:
    """Return what completes the last of several names with commas between them."""

    def offered(incomplete: str) -> list[str]:
        given, comma, last = incomplete.rpartition(",")
        return [given + comma + name for name in offer(last)]

    return offered


def one_of(names: Sequence[str]) -> Offer:
    """Return what offers those of fixed names that begin so."""
    return _offering(lambda: names)


_COMPLETED = {
    "solver": offered_solvers,
    "solvers": listed(offered_solvers),
    "objective": offered_objectives,
    "vehicles": listed(offered_vehicles),
    "roads": listed(offered_roads),
    "template": offered_templates,
}


@dataclass(frozen=True)
class OptionsOf:
    """What a command offers of settings: ``only`` some of them, in a group of its help; ``groups`` and ``words`` are of those that differ.

    The command receives the settings; with ``given`` a dictionary of what the user gave, which another source completes.
    """

    kind: Any
    group: str
    groups: Mapping[str, str] = field(default_factory=dict)
    words: Mapping[str, str] = field(default_factory=dict)
    only: tuple[str, ...] = ()
    given: bool = False

    def parameters(self) -> dict[str, inspect.Parameter]:
        """Return the options as parameters for Typer, by the names of their fields."""
        fields = {name: one for name, one in fields_of(self.kind).items() if one.setting.words and (not self.only or name in self.only)}
        return {name: self._parameter(one) for name, one in fields.items()}

    def _parameter(self, field: Field) -> inspect.Parameter:
        (kind, many), least = _typed(field), field.setting.least
        default = None if self.given or many else field.default
        shown = typer.Option(
            *field.options,
            metavar=field.setting.metavar or "|".join(field.choices) or None,
            help=self.words.get(field.name, field.setting.words) + (f" At least {least:g}." if least > 0.0 else ""),
            autocompletion=one_of(field.choices) if field.choices else _COMPLETED.get(field.name),
            rich_help_panel=self.groups.get(field.name, self.group),
        )
        annotation: Any = Annotated[kind if default is not None else kind | None, shown]
        return inspect.Parameter(field.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)

    def made(self, values: dict[str, Any]) -> Any:  # noqa: ANN401 - the settings
        """Return what the command receives, of what the user gave; an ``OptionError`` where a value is outside its range."""
        fields = fields_of(self.kind)
        chosen = {name: _chosen(fields[name], value) for name, value in values.items() if value is not None}
        return chosen if self.given else self.kind(**chosen)


def _typed(field: Field) -> tuple[Any, bool]:
    if get_origin(field.kind) is tuple:
        return (str, False) if field.setting.listed else (list[str], True)
    if get_args(field.kind) or (isinstance(field.kind, type) and issubclass(field.kind, StrEnum)):
        return str, False
    return field.kind, False


def _chosen(field: Field, value: Any) -> Any:  # noqa: ANN401 - of any field
    if field.choices and isinstance(value, str):
        return field.kind(choice(field.options[0], value, field.choices))
    if get_origin(field.kind) is tuple:
        return tuple(value) if isinstance(value, list) else tuple(one.strip() for one in value.split(",") if one.strip())
    return value


def with_settings(command: Callable[..., int]) -> Callable[..., int]:
    """Give a command the options of its settings in the place of each parameter that is annotated with ``OptionsOf``."""
    own = inspect.signature(command, eval_str=True).parameters
    parts = {name: part for name, mine in own.items() for part in get_args(mine.annotation)[1:] if isinstance(part, OptionsOf)}
    options = {name: part.parameters() for name, part in parts.items()}

    @wraps(command)
    def run(**given: Any) -> int:  # noqa: ANN401 - options
        for name, part in parts.items():
            given[name] = part.made({field: given.pop(field) for field in options[name]})
        return command(**given)

    shown = [one for name, mine in own.items() for one in (options[name].values() if name in parts else [mine])]
    run.__signature__ = inspect.Signature([one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in shown])  # type: ignore[attr-defined] # where Typer looks for them
    return run


_LONGEST_NAME = 110  # bytes; a file's name has up to 255

_ROAD = typer.Argument(
    metavar="ROAD",
    help="A road file (CSV, GeoJSON, OpenDRIVE, Lanelet2, or a format that GDAL reads), or a name from `hdvplan roads list`.",
    autocompletion=offered_roads,
)
RoadArgument = Annotated[str, _ROAD]
RoadOrNoneArgument = Annotated[str | None, _ROAD]
_VEHICLE = typer.Option(
    "--vehicle",
    metavar="NAME|FILE.toml",
    help="A name from `hdvplan vehicles list`, or a vehicle file.",
    autocompletion=offered_vehicles,
    rich_help_panel=VEHICLE,
)
VehicleOption = Annotated[str, _VEHICLE]
VehiclesOption = Annotated[
    str,
    typer.Option(
        "--vehicle",
        metavar="NAME|FILE.toml,...",
        help="A name from `hdvplan vehicles list`, or a vehicle file; several, separated by commas, are compared.",
        autocompletion=listed(offered_vehicles),
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
