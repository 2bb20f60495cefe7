"""Options that several commands share. Only Typer is imported here: ``--help`` stays quick."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli import completion
from hdvplan.cli.help import OUTPUT, PLANNING, ROAD, VEHICLE
from hdvplan.errors import OptionError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hdvplan.road.line import RoadOptions

_LONGEST_NAME = 110  # bytes; a file's name has up to 255

RoadArgument = Annotated[
    str,
    typer.Argument(
        metavar="ROAD",
        help="A road file (CSV, GeoJSON, OpenDRIVE, or a format that GDAL reads), or a name from `hdvplan roads list`.",
        autocompletion=completion.roads,
    ),
]
VehicleOption = Annotated[
    str,
    typer.Option(
        "--vehicle",
        metavar="NAME|FILE.toml",
        help="A name from `hdvplan vehicles list`, or a vehicle file.",
        autocompletion=completion.vehicles,
        rich_help_panel=VEHICLE,
    ),
]
HalfWidthOption = Annotated[
    float | None, typer.Option("--half-width", metavar="M", help="Limits at M to either side of the line [m].", rich_help_panel=VEHICLE)
]
ClearanceOption = Annotated[
    float, typer.Option("--clearance", metavar="M", help="Room to keep from every limit and obstacle [m].", rich_help_panel=VEHICLE)
]
SmoothOption = Annotated[
    float | None,
    typer.Option(
        "--smooth",
        metavar="M",
        help="How far smoothing may move the road's line from the given points [m] [default: 5].",
        rich_help_panel=ROAD,
    ),
]
CrsOption = Annotated[
    str | None, typer.Option("--crs", metavar="EPSG:N", help="Coordinate reference system of the road file.", rich_help_panel=ROAD)
]
FeatureOption = Annotated[
    str | None,
    typer.Option("--name", "--id", metavar="NAME", help="Which line of the road file, by its name or id.", rich_help_panel=ROAD),
]
UnitOption = Annotated[
    str | None,
    typer.Option(
        "--unit",
        metavar="mm|cm|m|ft|in",
        help="Unit of a road file without a coordinate reference system (DXF; CSV with x,y) [default: what it says, or m].",
        rich_help_panel=ROAD,
    ),
]
CornersOption = Annotated[
    str | None,
    typer.Option(
        "--corners",
        metavar="auto|sharp|round",
        help="How the line's points are read: bends and corners told apart, all as corners, or all on one curve [default: auto].",
        autocompletion=completion.corners,
        rich_help_panel=ROAD,
    ),
]
CornerRadiusOption = Annotated[
    float | None,
    typer.Option(
        "--corner-radius", metavar="M", help="Radius of the kerbs inside corners of the line [m] [default: 0].", rich_help_panel=ROAD
    ),
]
LayerOption = Annotated[
    str | None, typer.Option("--layer", metavar="LAYER", help="Which layer, or sheet, of the road file.", rich_help_panel=ROAD)
]
RoleOption = Annotated[
    list[str] | None,
    typer.Option(
        "--role",
        metavar="NAME=ROLE",
        help="What a layer or feature of the road file is: obstacle, sweepable or edge; may be repeated.",
        rich_help_panel=ROAD,
    ),
]
RoadIdsOption = Annotated[
    str | None,
    typer.Option(
        "--road-ids",
        metavar="A,B,...",
        help="Roads of an OpenDRIVE file, in driving order; -A drives a road from its end; gaps are filled.",
        rich_help_panel=ROAD,
    ),
]
LaneOption = Annotated[
    int | None,
    typer.Option(
        "--lane",
        metavar="N",
        help="Lane of the first OpenDRIVE road [default: the outermost that leads to the last]; 0: along the reference line of all roads.",
        rich_help_panel=ROAD,
    ),
]
OffsetOption = Annotated[
    float,
    typer.Option(
        "--offset",
        metavar="M",
        help="Drive this far to the left of the line, negative: to the right [m]; the file's edges do not move.",
        rich_help_panel=ROAD,
    ),
]
ReverseOption = Annotated[
    bool, typer.Option("--reverse", help="Drive the line from its end to its start; applied before --offset.", rich_help_panel=ROAD)
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
OutOption = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Where to write [default: <road>.<vehicle>/].", rich_help_panel=OUTPUT)
]


def road_options(
    smooth: float | None,
    crs: str | None,
    feature: str | None,
    max_curvature: float | None = None,
    *,
    offset: float = 0.0,
    reverse: bool = False,
    layer: str | None = None,
    roles: Sequence[str] | None = None,
    road_ids: str | None = None,
    lane: int | None = None,
    unit: str | None = None,
    corners: str | None = None,
    corner_radius: float | None = None,
) -> RoadOptions:
    """Return how to read a road file, with the library's defaults where the user gave nothing.

    Raises:
        OptionError: a value outside its range.

    """
    from dataclasses import replace

    from hdvplan.road.line import RoadOptions

    options = RoadOptions()
    return replace(
        options,
        smooth=options.smooth if smooth is None else smooth,
        crs=crs,
        feature=feature,
        max_curvature=options.max_curvature if max_curvature is None else max_curvature,
        offset=offset,
        reverse=reverse,
        layer=layer,
        roles=tuple(roles or ()),
        road_ids=road_ids,
        lane=lane,
        unit=unit,
        corners=corners,
        corner_radius=corner_radius,
    )


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
