"""How a road file is read: options that several commands have together."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hdvplan.cli import completion
from hdvplan.cli.help import ROAD

if TYPE_CHECKING:
    from collections.abc import Callable

    from hdvplan.road.line import RoadOptions


@dataclass(frozen=True)
class Reading:
    """What a user says of how a road file is read; fields are called as in ``RoadOptions``."""

    smooth: Annotated[
        float | None,
        typer.Option(
            "--smooth",
            metavar="M",
            help="How far smoothing may move the road's line from the given points [m] [default: 5].",
            rich_help_panel=ROAD,
        ),
    ] = None
    crs: Annotated[
        str | None, typer.Option("--crs", metavar="EPSG:N", help="Coordinate reference system of the road file.", rich_help_panel=ROAD)
    ] = None
    unit: Annotated[
        str | None,
        typer.Option(
            "--unit",
            metavar="mm|cm|m|ft|in",
            help="Unit of a road file without a coordinate reference system (DXF; CSV with x,y) [default: what it says, or m].",
            rich_help_panel=ROAD,
        ),
    ] = None
    corners: Annotated[
        str | None,
        typer.Option(
            "--corners",
            metavar="auto|sharp|round",
            help="How the line's points are read: bends and corners told apart, all as corners, or all on one curve [default: auto].",
            autocompletion=completion.corners,
            rich_help_panel=ROAD,
        ),
    ] = None
    corner_radius: Annotated[
        float | None,
        typer.Option(
            "--corner-radius", metavar="M", help="Radius of the kerbs inside corners of the line [m] [default: 0].", rich_help_panel=ROAD
        ),
    ] = None
    feature: Annotated[
        str | None,
        typer.Option("--name", "--id", metavar="NAME", help="Which line of the road file, by its name or id.", rich_help_panel=ROAD),
    ] = None
    layer: Annotated[
        str | None, typer.Option("--layer", metavar="LAYER", help="Which layer, or sheet, of the road file.", rich_help_panel=ROAD)
    ] = None
    roles: Annotated[
        list[str] | None,
        typer.Option(
            "--role",
            metavar="NAME=ROLE",
            help="What a layer or feature of the road file is: obstacle, sweepable or edge; may be repeated.",
            rich_help_panel=ROAD,
        ),
    ] = None
    road_ids: Annotated[
        str | None,
        typer.Option(
            "--road-ids",
            metavar="A,B,...",
            help="Roads of an OpenDRIVE file, in driving order; -A drives a road from its end; gaps are filled.",
            rich_help_panel=ROAD,
        ),
    ] = None
    lane: Annotated[
        int | None,
        typer.Option(
            "--lane",
            metavar="N",
            help="Lane of the first OpenDRIVE road [default: the outermost that leads to the last]; "
            "0: along the reference line of all roads.",
            rich_help_panel=ROAD,
        ),
    ] = None
    offset: Annotated[
        float,
        typer.Option(
            "--offset",
            metavar="M",
            help="Drive this far to the left of the line, negative: to the right [m]; the file's edges do not move.",
            rich_help_panel=ROAD,
        ),
    ] = 0.0
    reverse: Annotated[
        bool, typer.Option("--reverse", help="Drive the line from its end to its start; applied before --offset.", rich_help_panel=ROAD)
    ] = False

    def options(self, max_curvature: float | None = None) -> RoadOptions:
        """Return how to read a road file, with the library's defaults where the user gave nothing; ``max_curvature`` is in 1/m.

        Raises:
            OptionError: a value outside its range.

        """
        from hdvplan.road.line import RoadOptions

        given: dict[str, Any] = vars(self) | {"roles": tuple(self.roles or ()), "max_curvature": max_curvature}
        return RoadOptions(**{name: value for name, value in given.items() if value is not None})


AS_SAID = Reading()  # by the file


def reads_road(command: Callable[..., int]) -> Callable[..., int]:
    """Give a command the options of ``Reading`` in the place of its parameter ``reading``."""
    options = inspect.signature(Reading, eval_str=True).parameters

    @wraps(command)
    def read(**given: Any) -> int:  # noqa: ANN401 - options
        return command(reading=Reading(**{name: given.pop(name) for name in options}), **given)

    own = inspect.signature(command, eval_str=True).parameters
    together = [option for name, mine in own.items() for option in (options.values() if name == "reading" else [mine])]
    read.__signature__ = inspect.Signature(together)  # type: ignore[attr-defined] # where Typer looks for them
    return read
