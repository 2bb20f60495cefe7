"""Options that several commands share. Only Typer is imported here: ``--help`` stays quick."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli import completion
from hdvplan.errors import OptionError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hdvplan.road.load import RoadOptions

RoadArgument = Annotated[
    str,
    typer.Argument(
        metavar="ROAD",
        help="A road file (CSV, GeoJSON, OpenDRIVE, or what GDAL reads), or a name from `hdvplan roads list`.",
        autocompletion=completion.roads,
    ),
]
SmoothOption = Annotated[
    float | None,
    typer.Option("--smooth", metavar="M", help="Largest allowed deviation of the smoothed centre line from the given points [m]."),
]
CrsOption = Annotated[str | None, typer.Option("--crs", metavar="EPSG:N", help="Coordinate reference system of the road file.")]
FeatureOption = Annotated[
    str | None, typer.Option("--name", "--id", metavar="NAME", help="Which line of the road file, by its name or id.")
]
LayerOption = Annotated[str | None, typer.Option("--layer", metavar="LAYER", help="Which layer of the road file, or sheet.")]
RoleOption = Annotated[
    list[str] | None,
    typer.Option(
        "--role",
        metavar="NAME=obstacle|sweepable|edge",
        help="What a layer or a feature of the road file is; may be repeated.",
    ),
]
RoadIdsOption = Annotated[
    str | None,
    typer.Option("--road-ids", metavar="A,B,...", help="Roads of an OpenDRIVE file, in driving order; -A: from its end; gaps are filled."),
]
LaneOption = Annotated[
    int | None, typer.Option("--lane", metavar="N", help="Lane of the first road; 0: along the reference line of all roads.")
]
OffsetOption = Annotated[
    float,
    typer.Option("--offset", metavar="M", help="Drive this far left of the line, negative: right [m]; the file's edges stay."),
]
ReverseOption = Annotated[bool, typer.Option("--reverse", help="Drive the line from its end to its start; before --offset.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Write JSON to stdout, and nothing else.")]
QuietOption = Annotated[bool, typer.Option("--quiet", help="No progress, notes or tables; errors remain.")]
OutOption = Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Where to write [default: <road>.<vehicle>/].")]


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
) -> RoadOptions:
    """Return how to read a road file, with the library's defaults where the user gave nothing.

    Raises:
        OptionError: a value outside its range.

    """
    from dataclasses import replace

    from hdvplan.road.load import RoadOptions

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


def file_name(name: str) -> str:
    """Return ``name`` with what files should not be called by replaced."""
    return re.sub(r"[^\w.-]+", "-", name)
