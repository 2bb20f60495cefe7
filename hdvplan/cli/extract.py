"""``hdvplan roads extract``: the routes of a map as roads."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli.console import ExitCode, note, print_json, print_tables, progress, warn
from hdvplan.cli.options import JsonOption, QuietOption, file_name
from hdvplan.errors import OptionError

if TYPE_CHECKING:
    from rich.table import Table

    from hdvplan.network.extract import Route

_COLUMNS = ("relation", "ref", "route", "roads", "length [km]", "ways missing", "gaps", "wrong order", "turns")


def extract(
    source: Annotated[Path, typer.Argument(metavar="MAP", help="A map of OpenStreetMap (.osm.pbf, .osm, .osm.gz), or liechtenstein.")],
    route: Annotated[str, typer.Option("--route", metavar="KIND", help="Which routes, by their tag route.")] = "bus",
    ref: Annotated[list[str] | None, typer.Option("--ref", metavar="REF", help="Only the line of this number; may be repeated.")] = None,
    lane: Annotated[
        float | None, typer.Option("--lane-width", metavar="M", help="Width of a lane where the map only counts them [m] [default: 3.25].")
    ] = None,
    half_width: Annotated[
        float | None, typer.Option("--half-width", metavar="M", help="Limits at +-M [m] of ways that tell neither width nor lanes.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Where to write [default: <map>.<kind>/].")] = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Write the routes of a map as road files, one for every stretch without gaps.

    A route's ways are joined in its order, each turned so that it meets the next; roundabouts are driven from where a route enters them to
    where it leaves them. Gaps, ways out of order and ways that the map lacks cut a route; each is told on a line of its own.
    """
    if out is not None and out.exists() and not out.is_dir():
        msg = f"--out {out} is a file, not a folder"
        raise OptionError(msg)
    from hdvplan.network.extract import RECORD, record_of
    from hdvplan.network.extract import extract as extracted
    from hdvplan.network.widths import USUAL, Widths
    from hdvplan.road.library import map_file

    shipped = None if source.exists() else map_file(str(source))
    source = shipped or source
    widths = Widths(USUAL.lane if lane is None else lane, half_width)
    directory = out or Path(file_name(f"{source.name.partition('.')[0]}.{route}"))
    try:
        with progress(f"stitching {source.name}", quiet=quiet) as on_progress:
            routes = extracted(source, directory, kind=route, refs=tuple(ref or ()), widths=widths, on_progress=on_progress)
    except OSError as error:
        msg = f"cannot write to {directory}: {error.strerror or error}"
        raise OptionError(msg, hint="choose another folder with --out") from error
    for one in routes:
        for finding in one.findings:
            place = "" if finding.place is None else f", at {finding.place[1]:.5f}, {finding.place[0]:.5f}"
            warn(f"{one.label}: {finding.text}{place}", quiet=quiet)
    if json:
        print_json(record_of(routes, source.name, route, widths))
    elif not quiet:
        print_tables(_table(routes))
        roads = sum(len(one.roads) for one in routes)
        note(f"wrote {roads} roads to {directory}/; {RECORD} and report.csv tell of them")
    return ExitCode.OK


def _table(routes: tuple[Route, ...]) -> Table:
    """Return the routes and how many roads each became."""
    from hdvplan.network.stitch import Trouble
    from hdvplan.report.grid import grid

    rows = [
        (
            str(one.relation.id),
            one.relation.tags.get("ref", ""),
            one.relation.tags.get("name", ""),
            str(len(one.roads)),
            f"{1e-3 * one.length:.1f}",
            *(str(number) if number else "" for number in (one.missing, *map(one.count, (Trouble.GAP, Trouble.ORDER, Trouble.TURN)))),
        )
        for one in routes
    ]
    whole = sum(one.whole for one in routes)
    limited = sum(road.with_limits for one in routes for road in one.roads) / max(1.0, sum(one.length for one in routes))
    caption = (
        f"{whole} of {len(routes)} whole; limits known on {100.0 * limited:.0f} % of their length; © OpenStreetMap contributors, ODbL 1.0"
    )
    return grid("routes", _COLUMNS, rows, text=("relation", "ref", "route"), one_line=("route",), caption=caption)
