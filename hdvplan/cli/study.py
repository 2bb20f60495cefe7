"""``hdvplan study``: every combination of roads, vehicles and settings that a file names, planned, judged and ranked."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli.checks import check_workers
from hdvplan.cli.console import ExitCode, note, print_json, print_line, print_tables, progress, report_error, warn, writing
from hdvplan.cli.help import OUTPUT
from hdvplan.cli.options import JsonOption, QuietOption
from hdvplan.errors import OptionError

if TYPE_CHECKING:
    from rich.table import Table

    from hdvplan.study import Engine, Results

_RUNNING = "Running"  # a group of options
_LIMIT_S = 1800.0
_RETRIES = 1
_PLACES = 8  # of the ranking that are printed


def study(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE.toml", help="What to combine: roads, vehicles, widths and settings; docs/studies.md describes it."),
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Where to write; a study that is there is resumed.", rich_help_panel=OUTPUT)
    ],
    workers: Annotated[
        int | None,
        typer.Option("--workers", metavar="N", help="Processes on this machine [default: one for each core].", rich_help_panel=_RUNNING),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler",
            metavar="ADDRESS",
            help="Run on the Dask cluster at this address, such as tcp://10.0.0.1:8786.",
            rich_help_panel=_RUNNING,
        ),
    ] = None,
    cell_limit: Annotated[
        float, typer.Option("--cell-limit", metavar="S", help="Longest time for one cell [s].", rich_help_panel=_RUNNING)
    ] = _LIMIT_S,
    retries: Annotated[
        int | None,
        typer.Option(
            "--retries", metavar="N", help="Further tries of a cell that failed, hung or was killed [default: 1].", rich_help_panel=_RUNNING
        ),
    ] = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Plan every combination of roads, vehicles and settings.

    A combination is called a cell. DIR receives cells.parquet (one row for each cell), places.parquet (every breach and tightest place),
    table.xlsx for spreadsheets, ranking.csv, map.html and study.json. Finished cells are kept: the same command resumes the study, and
    plans only the cells that are new, have changed, failed, hung or were killed.

    Exit code 0: every cell has an answer, YES or NO. 1: some failed, hung or were killed. 2: bad input.
    """
    check_workers(workers)
    if not cell_limit > 0.0:
        msg = f"--cell-limit must be a positive number of seconds, not {cell_limit:g}"
        raise OptionError(msg)
    if retries is not None and retries < 0:
        msg = f"--retries must not be negative, but is {retries}"
        raise OptionError(msg)
    if scheduler is not None and workers is not None:
        msg = "--workers is for processes on this machine; a cluster has its own"
        raise OptionError(msg, hint="leave out --workers or --scheduler")
    if scheduler is not None and retries is not None:
        msg = "--retries is for processes on this machine; on a cluster a setting of Dask decides"
        raise OptionError(msg, hint="set distributed.scheduler.allowed-failures where the scheduler runs")
    from hdvplan.machine import use_one_thread

    use_one_thread()  # before anything imports NumPy
    from hdvplan.study.spec import read_study

    wanted = read_study(file)
    from hdvplan.signals import ended_by_signals
    from hdvplan.study import LocalEngine, connected, run

    engine: Engine = (
        LocalEngine(workers, cell_limit, _RETRIES if retries is None else retries)
        if scheduler is None
        else connected(scheduler, cell_limit)
    )
    counted = [0, len(wanted)]
    try:
        with writing(f"to {out}"), ended_by_signals(), progress(f"planning {counted[1]} cells", quiet=quiet, undisturbed=True) as tell:

            def on_progress(done: int, total: int) -> None:
                counted[:] = done, total
                tell(done / total)

            results = run(wanted, out, engine, on_progress=on_progress, on_damage=warn)
    except (KeyboardInterrupt, SystemExit):
        note(f"{counted[0]} of {counted[1]} cells are kept in {out}; the same command continues the study")
        raise
    if json:
        print_json({"out": str(out), "cells": counted[1], "outcomes": dict(results.outcomes), "fits": dict(results.fits)})
    elif not quiet:
        print_line(_summary(results, counted[1]))
        print_tables(*_ranking(results))
        print_line(f"written to {out}/")
    if results.unanswered:
        report_error(
            f"{results.unanswered} cells have no answer", "the column reason of cells.parquet says why; the same command tries them again"
        )
        return ExitCode.BROKEN
    return ExitCode.OK


def _summary(results: Results, cells: int) -> str:
    """Return the study in a sentence."""
    words = [f"{count} {word}" for word in ("YES", "NO", "NEEDS") if (count := results.fits.get(word, 0))]
    words += [f"{count} {ending}" for ending, count in sorted(results.outcomes.items()) if ending != "planned"]
    return f"{cells} cells: {', '.join(words)}"


def _ranking(results: Results) -> list[Table]:
    """Return the head of the ranking as a table; nothing where every vehicle fits."""
    from math import isnan

    from hdvplan.report.grid import grid

    ranking = results.ranking()
    if ranking.empty:
        return []

    def number(value: float, digits: int) -> str:
        return "-" if isnan(value) else f"{value:.{digits}f}"

    rows = [
        (
            str(row["road"]), number(row["s_m"], 1), number(row["lat"], 5), number(row["lon"], 5), number(row["half_width_m"], 2),
            number(row["widening_m"], 2), str(row["vehicles"]), str(row["which_vehicles"]),
        )
        for row in ranking.head(_PLACES).to_dict("records")
    ]  # fmt: skip
    columns = ("road", "s [m]", "lat", "lon", "half width [m]", "widening [m]", "vehicles", "which")
    rest = len(ranking) - len(rows)
    caption = f"and {rest} more in ranking.csv and map.html" if rest else None
    return [grid("places that need the least widening", columns, rows, text=("road", "which"), one_line=("which",), caption=caption)]
