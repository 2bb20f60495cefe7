"""``hdvplan report``: plans side by side, needs and turns in one HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hdvplan.cli.console import ExitCode, note, print_json, progress, writing
from hdvplan.cli.help import OUTPUT
from hdvplan.cli.options import JsonOption, QuietOption
from hdvplan.errors import OptionError


def report(
    directories: Annotated[list[Path], typer.Argument(metavar="DIR", help="Folders of `hdvplan plan`, `judge`, `need` or `turn`.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="The HTML file to write.", rich_help_panel=OUTPUT)] = Path(
        "report.html"
    ),
    title: Annotated[
        str, typer.Option("--title", metavar="TEXT", help="Heading of the page.", rich_help_panel=OUTPUT)
    ] = "Swept path report",
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Put plans side by side in one HTML file that works offline.

    It has the summaries, a map of each plan to pan and zoom with the vehicle at the place that you point at, diagrams over the road's
    length, the tightest places and the distribution of the step times. Drives of several legs, needs and turns follow with their pictures.
    """
    from hdvplan.report.html import write_report

    if out.is_dir():
        msg = f"--out {out} is a folder, not a file"
        raise OptionError(msg)
    others = [path for path in directories if path.is_file()]
    if others and len(others) < len(directories):  # as a shell's DIR/* gives: several vehicles' table lies beside their folders
        directories = [path for path in directories if path not in others]
        note(f"left out, as no folders: {', '.join(map(str, others))}", quiet=quiet)
    with writing(f"{out}", "choose another file with --out"), progress("writing the report", quiet=quiet) as on_progress:
        size = write_report(directories, out, title=title, on_progress=on_progress)
    if json:
        print_json({"file": str(out), "bytes": size, "plans": [str(directory) for directory in directories]})
    else:
        note(f"wrote {out}: {len(directories)} folder{'s' * (len(directories) > 1)}, {size / 1e6:.1f} MB", quiet=quiet)
    return ExitCode.OK
