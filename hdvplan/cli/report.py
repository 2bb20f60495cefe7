"""``hdvplan report``: plans side by side in one HTML file, and how planning times went."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli.console import ExitCode, note, print_json, progress
from hdvplan.cli.help import OUTPUT
from hdvplan.cli.options import JsonOption, QuietOption
from hdvplan.errors import OptionError

if TYPE_CHECKING:
    from hdvplan.report.html import Section


def report(
    directories: Annotated[
        list[Path] | None, typer.Argument(metavar="DIR", help="Folders that `hdvplan plan` has written.", show_default=False)
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="The HTML file to write.", rich_help_panel=OUTPUT)] = Path(
        "report.html"
    ),
    title: Annotated[
        str | None,
        typer.Option("--title", metavar="TEXT", help="Heading of the page [default: Swept path report].", rich_help_panel=OUTPUT),
    ] = None,
    history: Annotated[
        Path | None,
        typer.Option(
            "--history", metavar="DIR", help="Add planning times by commit, from the folder of `bench --history`.", rich_help_panel=OUTPUT
        ),
    ] = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Put plans side by side in one HTML file that works offline.

    It has the summaries, a map of each plan to pan and zoom with the vehicle at the place that you point at, diagrams over the road's
    length, the tightest places and the distribution of the step times. With --history it has planning times by commit as well, or alone.
    """
    from hdvplan.report.html import write_report

    plans = directories or []
    if not plans and history is None:
        msg = "missing argument 'DIR'"
        raise OptionError(msg, hint="name folders that `hdvplan plan` has written, or --history")
    if out.is_dir():
        msg = f"--out {out} is a folder, not a file"
        raise OptionError(msg)
    heading = title or ("Swept path report" if plans else "Planning time by commit")
    try:
        with progress("writing the report", quiet=quiet) as on_progress:
            size = write_report(plans, out, title=heading, sections=_trends(history), on_progress=on_progress)
    except OSError as error:
        msg = f"cannot write {out}: {error.strerror or error}"
        raise OptionError(msg, hint="choose another file with --out") from error
    if json:
        print_json({"file": str(out), "bytes": size, "plans": [str(directory) for directory in plans]})
    else:
        added = " and a history" if history is not None else ""
        note(f"wrote {out}: {len(plans)} plan{'s' * (len(plans) != 1)}{added}, {size / 1e6:.1f} MB", quiet=quiet)
    return ExitCode.OK


def _trends(history: Path | None) -> list[Section]:
    if history is None:
        return []
    from hdvplan.bench.history import read_entries
    from hdvplan.bench.trend_report import trend_section
    from hdvplan.bench.trends import trends_of

    return [trend_section(trend) for trend in trends_of(read_entries(history))]
