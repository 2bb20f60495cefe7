"""``hdvplan roads extract``: the routes of a map as roads."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli.console import ExitCode, note, print_json, print_tables, progress, warn, writing
from hdvplan.cli.help import OUTPUT
from hdvplan.cli.options import JsonOption, OptionsOf, QuietOption, check_folder, file_name, with_settings
from hdvplan.settings import Setting

if TYPE_CHECKING:
    from rich.table import Table

    from hdvplan.network.extract import Route

_ROUTES, _LIMITS = "Routes", "Limits"  # groups of options
_COLUMNS = ("relation", "ref", "route", "roads", "length [km]", "cuts", "missing")
_WARNINGS = 10  # shown one by one


@dataclass(frozen=True)
class RouteOptions:
    """Which routes of a map are extracted, and how wide their ways are where it does not tell."""

    route: Annotated[str, Setting("Which routes: the value of their tag route.", "KIND")] = "bus"
    ref: Annotated[tuple[str, ...], Setting("Only the line with this number; may be repeated.", "REF")] = ()
    lane: Annotated[
        float | None, Setting("Width of a lane where the map only has their number [m] [default: 3.25].", "M", ("--lane-width",))
    ] = None
    half_width: Annotated[float | None, Setting("Limits at +-M [m] for ways without width and lanes.", "M")] = None
    out: Annotated[Path | None, Setting("Where to write [default: <map>.<kind>/].", "DIR")] = None


@with_settings
def extract(
    source: Annotated[Path, typer.Argument(metavar="MAP", help="A map of OpenStreetMap (.osm.pbf, .osm, .osm.gz), or liechtenstein.")],
    *,
    chosen: Annotated[RouteOptions, OptionsOf(RouteOptions, _ROUTES, {"lane": _LIMITS, "half_width": _LIMITS, "out": OUTPUT})],
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Write the routes of a map as road files.

    A route's ways are joined in its order, each turned so that it meets the next. Roundabouts are driven from where a route enters to where
    it leaves. A route is cut at gaps, at ways out of order and at ways that the map lacks; warnings name the first ten places, extract.json
    names all.
    """
    check_folder(chosen.out)
    from hdvplan.network.extract import RECORD, record_of
    from hdvplan.network.extract import extract as extracted
    from hdvplan.network.roads import USUAL, Widths
    from hdvplan.road.scenarios import shipped

    source = source if source.exists() else shipped("networks").get(str(source), source)
    route, widths = chosen.route, Widths(USUAL.lane if chosen.lane is None else chosen.lane, chosen.half_width)
    directory = chosen.out or Path(file_name(f"{source.name.partition('.')[0]}.{route}"))
    with writing(f"to {directory}"), progress(f"stitching {source.name}", quiet=quiet) as on_progress:
        routes = extracted(source, directory, kind=route, refs=chosen.ref, widths=widths, on_progress=on_progress)
    findings = [(one.label, finding) for one in routes for finding in one.findings]
    for label, finding in findings[:_WARNINGS]:
        place = "" if finding.place is None else f", at {finding.place[1]:.5f}, {finding.place[0]:.5f}"
        warn(f"{label}: {finding.text}{place}", quiet=quiet)
    if len(findings) > _WARNINGS:
        warn(f"{len(findings) - _WARNINGS} more remarks on routes are in {directory / RECORD}", quiet=quiet)
    if json:
        print_json(record_of(routes, source.name, route, widths))
    elif not quiet:
        print_tables(_table(routes))
        roads = sum(len(one.roads) for one in routes)
        note(f"wrote {roads} roads, report.csv and {RECORD} to {directory}/")
    return ExitCode.OK


def _table(routes: tuple[Route, ...]) -> Table:
    """Return the routes, how many roads each became, at how many places it is cut, and how many of its ways the map lacks."""
    from hdvplan.network.stitch import CUTS
    from hdvplan.report.grid import grid

    rows = [
        (
            str(one.relation.id),
            one.relation.tags.get("ref", ""),
            one.relation.tags.get("name", ""),
            str(len(one.roads)),
            f"{1e-3 * one.length:.1f}",
            *(str(number) if number else "" for number in (one.count(*CUTS), one.missing)),
        )
        for one in routes
    ]
    whole = sum(one.whole for one in routes)
    limited = sum(road.with_limits for one in routes for road in one.roads) / max(1.0, sum(one.length for one in routes))
    caption = (
        f"{whole} of {len(routes)} whole; limits known on {100.0 * limited:.0f} % of their length; © OpenStreetMap contributors, ODbL 1.0"
    )
    return grid("routes", _COLUMNS, rows, text=("route",), one_line=("route",), caption=caption)
