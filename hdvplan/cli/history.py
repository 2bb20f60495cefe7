"""``hdvplan history``: planning times by commit, and where they changed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hdvplan.cli.console import ExitCode, note, print_json, print_tables
from hdvplan.cli.help import OUTPUT
from hdvplan.cli.options import JsonOption, QuietOption, choice
from hdvplan.errors import OptionError

PICTURES = ("png", "pdf", "svg")


def history(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The folder that `hdvplan bench --against REV --history DIR` adds to.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="The chart: png, pdf or svg [default: DIR/history.png].", rich_help_panel=OUTPUT),
    ] = None,
    plot: Annotated[bool, typer.Option("--plot/--no-plot", help="Draw the chart.", rich_help_panel=OUTPUT)] = True,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Show planning times by commit.

    Each kind of machine and each suite or command has its own table and chart; the file of the second chart ends in -2. If all commits
    were measured against the same base, the numbers are ratios to it, which do not depend on the state of the machine. About one in a
    hundred histories shows a change although nothing changed.
    """
    from hdvplan.bench.history import read_entries
    from hdvplan.bench.trend_report import trend_figure, trend_json, trend_tables
    from hdvplan.bench.trends import trends_of
    from hdvplan.fileio import write_atomically
    from hdvplan.report.style import figure_bytes

    chart = out or folder / "history.png"
    kind = choice("the chart's ending", chart.suffix.lower().removeprefix("."), PICTURES)
    trends = trends_of(read_entries(folder))
    if json:
        print_json([trend_json(trend) for trend in trends])
    elif not quiet:
        print_tables(*(table for trend in trends for table in trend_tables(trend)))
    for number, trend in enumerate(trends if plot else (), start=1):
        file = chart if number == 1 else chart.with_stem(f"{chart.stem}-{number}")
        try:
            write_atomically(file, figure_bytes(trend_figure(trend), kind))
        except OSError as error:
            msg = f"cannot write {file}: {error.strerror or error}"
            raise OptionError(msg, hint="choose another file with --out, or --no-plot") from error
        note(f"chart in {file}", quiet=quiet or json)
    return ExitCode.OK
