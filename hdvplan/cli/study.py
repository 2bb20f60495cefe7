"""``hdvplan study``: every combination of roads, vehicles and settings that a file names, planned, judged and ranked."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.answers import WORDS
from hdvplan.cli.console import ExitCode, note, print_json, print_line, print_tables, progress, report_error, warn, writing
from hdvplan.cli.help import OUTPUT
from hdvplan.cli.options import JsonOption, OptionsOf, QuietOption, with_settings
from hdvplan.errors import OptionError
from hdvplan.settings import Setting

if TYPE_CHECKING:
    from rich.table import Table

    from hdvplan.study import Engine, Results

_RUNNING = "Running"  # a group of options
_MOST_WORKERS = 1000  # more than machines have cores: each takes hundreds of megabytes
_RETRIES = 1
_PLACES = 8  # of the ranking that are printed
_REASONS = 3  # why cells have no answer, and notes on roads, likewise


@dataclass(frozen=True)
class Running:
    """Where the cells of a study are planned, and how patiently."""

    workers: Annotated[int | None, Setting("Processes on this machine [default: one for each core].", "N")] = None
    scheduler: Annotated[str | None, Setting("Run on the Dask cluster at this address, such as tcp://10.0.0.1:8786.", "ADDRESS")] = None
    cell_limit: Annotated[float, Setting("Longest time for one cell [s].", "S")] = 1800.0
    retries: Annotated[int | None, Setting("Further tries of a cell that failed, hung or was killed [default: 1].", "N")] = None
    fail_on_no: Annotated[bool, Setting("Exit code 1 where a vehicle does not fit, too.")] = False

    def check(self) -> None:
        """Refuse, by an ``OptionError``, numbers that cannot be, and what a cluster decides by itself."""
        for wrong, words, hint in (
            (self.workers is not None and self.workers < 1, f"--workers must be a positive number, not {self.workers}", None),
            ((self.workers or 0) > _MOST_WORKERS, f"--workers must be at most {_MOST_WORKERS}, not {self.workers}", None),
            (not self.cell_limit > 0.0, f"--cell-limit must be a positive number of seconds, not {self.cell_limit:g}", None),
            ((self.retries or 0) < 0, f"--retries must not be negative, but is {self.retries}", None),
            (
                self.scheduler is not None and self.workers is not None,
                "--workers is for processes on this machine; a cluster has its own",
                "leave out --workers or --scheduler",
            ),
            (
                self.scheduler is not None and self.retries is not None,
                "--retries is for processes on this machine; on a cluster a setting of Dask decides",
                "set distributed.scheduler.allowed-failures where the scheduler runs",
            ),
        ):
            if wrong:
                raise OptionError(words, hint=hint)

    def engine(self) -> Engine:
        """Return what plans the cells: processes on this machine, or a cluster."""
        from hdvplan.study import LocalEngine, connected

        if self.scheduler is not None:
            return connected(self.scheduler, self.cell_limit)
        return LocalEngine(self.workers, self.cell_limit, _RETRIES if self.retries is None else self.retries)


@with_settings
def study(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE.toml", help="What to combine: roads, vehicles, widths and settings; docs/studies.md describes it."),
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Where to write; a study that is there is resumed.", rich_help_panel=OUTPUT)
    ],
    *,
    running: Annotated[Running, OptionsOf(Running, _RUNNING, {"fail_on_no": OUTPUT})],
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Plan every combination of roads, vehicles and settings.

    A combination is called a cell. DIR receives cells.parquet and cells.csv (one row for each cell), places.parquet (every breach and
    tightest place), table.xlsx for spreadsheets, ranking.csv, straying.csv, map.html and study.json. Finished cells are kept: the same
    command resumes the study, and plans only the cells that are new, have changed, failed, hung or were killed.

    Exit code 0: every cell has an answer, YES or NO. 1: some were refused, failed, hung or were killed, or, with --fail-on-no, are NO.
    2: bad input.
    """
    running.check()
    from hdvplan.machine import use_one_thread

    use_one_thread()  # before anything imports NumPy
    from hdvplan.study.spec import read_study

    wanted = read_study(file)
    from hdvplan.process import ended_by_signals
    from hdvplan.study import run
    from hdvplan.study.engine import UNANSWERED

    engine = running.engine()
    counted = [0, len(wanted)]
    try:
        with writing(f"to {out}"), ended_by_signals(), progress(f"planning {_cells(counted[1])}", quiet=quiet, undisturbed=True) as tell:

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
    if not quiet:
        for text, count in results.notes().most_common(_REASONS):
            note(f"{_cells(count)}: {text}")
    if rescued := results.rescued():
        warn(f"{_cells(rescued)} with steps that the solver failed at and another one planned: column rescued_steps", quiet=quiet)
    if results.unanswered:
        told = [f"{count} {ending}: {reason}" for (ending, reason), count in results.reasons().most_common()]
        again = any(ending in UNANSWERED for ending in results.outcomes)
        hint = "the column reason of cells.csv has every reason"
        hint += "; the same command tries again those that failed, hung or were killed" if again else ""
        report_error(f"{_cells(results.unanswered)} without an answer", hint, _first(told, "reasons"))
    unfit = results.unfit() if running.fail_on_no else []
    if unfit:
        report_error(f"{_cells(len(unfit))} whose vehicle does not fit", "cells.csv has all, word NO", _first(unfit, "cells"))
    return ExitCode.BROKEN if results.unanswered or unfit else ExitCode.OK


def _first(lines: list[str], what: str) -> list[str]:
    """Return the first lines, and how many there are beyond them."""
    return lines[:_REASONS] + ([f"and {len(lines) - _REASONS} other {what}"] if len(lines) > _REASONS else [])


def _cells(count: int) -> str:
    return "1 cell" if count == 1 else f"{count} cells"


def _summary(results: Results, cells: int) -> str:
    words = [f"{count} {word}" for word in WORDS if (count := results.fits.get(word, 0))]
    words += [f"{count} {ending}" for ending, count in sorted(results.outcomes.items()) if ending != "planned"]
    return f"{_cells(cells)}: {', '.join(words)}"


def _ranking(results: Results) -> list[Table]:
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
            number(row["widening_m"], 2), str(row["roads"]), str(row["vehicles"]), str(row["which_vehicles"]),
        )
        for row in ranking.head(_PLACES).to_dict("records")
    ]  # fmt: skip
    columns = ("road", "s [m]", "lat", "lon", "half width [m]", "widening [m]", "roads", "vehicles", "which")
    rest = len(ranking) - len(rows)
    caption = f"and {rest} more in ranking.csv and map.html" if rest else None
    return [grid("places that need the least widening", columns, rows, text=("road", "which"), one_line=("which",), caption=caption)]
