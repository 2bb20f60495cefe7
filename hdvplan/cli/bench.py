"""``hdvplan bench``: time the planning of vehicles along roads, scheme by scheme and solver by solver."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli import completion
from hdvplan.cli.console import ExitCode, note, print_json, print_tables, progress
from hdvplan.cli.options import JsonOption, QuietOption
from hdvplan.errors import OptionError

if TYPE_CHECKING:
    from pandas import DataFrame


def bench(
    solvers: Annotated[
        str | None, typer.Option("--solvers", metavar="A,B", help="Names from `hdvplan solvers`.", autocompletion=completion.solver_list)
    ] = None,
    vehicles: Annotated[
        str | None, typer.Option("--vehicles", metavar="A,B", help="Presets or vehicle files.", autocompletion=completion.vehicle_list)
    ] = None,
    roads: Annotated[
        str | None,
        typer.Option("--roads", metavar="A,B", help="Road files, or names from `hdvplan roads list`.", autocompletion=completion.road_list),
    ] = None,
    schemes: Annotated[str | None, typer.Option("--schemes", metavar="rti,sqp", help="How often a step linearises and solves.")] = None,
    rounds: Annotated[int | None, typer.Option("--rounds", metavar="N", help="Drives of every cell.")] = None,
    budget: Annotated[float | None, typer.Option("--budget", metavar="S", help="Most planning time of one drive [s].")] = None,
    half_width: Annotated[float | None, typer.Option("--half-width", metavar="M", help="Limits at +-M [m].")] = None,
    slack: Annotated[
        float | None, typer.Option("--slack", metavar="M", help="Limits this far beyond the geometric half width [m].")
    ] = None,
    no_limits: Annotated[bool, typer.Option("--no-limits", help="Plan without limits.")] = False,
    pinch: Annotated[
        float | None, typer.Option("--pinch", metavar="M", help="Move the outer limit of the tightest bend inwards over 6 m of road [m].")
    ] = None,
    horizon: Annotated[float | None, typer.Option("--horizon", metavar="M", help="How far each plan looks ahead [m].")] = None,
    step: Annotated[float | None, typer.Option("--step", metavar="M", help="Distance between stations [m].")] = None,
    replan: Annotated[float | None, typer.Option("--replan", metavar="M", help="Distance driven before the next plan [m].")] = None,
    suite: Annotated[
        Path | None, typer.Option("--suite", metavar="FILE.toml", help="Read all of the above from a file; options override it.")
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where to write, and to go on from.")] = Path("hdvplan-bench"),
    fresh: Annotated[bool, typer.Option("--fresh", help="Throw away what an earlier run has left in DIR.")] = False,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Time the planning of vehicles along roads, by scheme and QP solver.

    Every cell is driven once a round, in an order that lets a busy or warming machine hit all cells alike. A killed run
    goes on where it stopped when the same command is given again.

    Defaults: ten shipped roads, bus and tractor-trailer, both schemes, riccati, piqp, clarabel and osqp, three rounds, limits
    0.5 m beyond the geometric half width. A cell that cannot be planned is a row of the tables and ends nothing.
    """
    from hdvplan.bench.machine import use_one_thread

    one_thread = use_one_thread()  # before anything imports NumPy
    from hdvplan.bench.courses import courses_of
    from hdvplan.bench.directory import begin, discard, finish, read_table, recorded
    from hdvplan.bench.run import remaining, run
    from hdvplan.bench.suite import read_suite, suite_of
    from hdvplan.jit import is_compiled
    from hdvplan.report.timing import LAYOUTS, summary_tables
    from hdvplan.solvers.registry import solver_named

    given = {
        "roads": _names(roads), "vehicles": _names(vehicles), "schemes": _names(schemes), "solvers": _names(solvers), "rounds": rounds,
        "budget": budget, "limits": False if no_limits else None, "half_width": half_width, "slack": slack, "pinch": pinch,
        "horizon": horizon, "step": step, "replan": replan,
    }  # fmt: skip
    wanted = suite_of((read_suite(suite) if suite else {}) | {name: value for name, value in given.items() if value is not None})
    record = None if fresh else recorded(wanted, out)
    if record is not None and record["finished"]:
        note(f"{out} holds this run, finished; --fresh measures again", quiet=quiet)
    else:
        if not is_compiled():
            note("compiling the planning kernels, once per installation: about 20 s", quiet=quiet)
        courses, makers = courses_of(wanted), {name: solver_named(name) for name in wanted.solvers}
        try:
            if fresh:
                discard(out)
            begin(wanted, out, record, one_thread=one_thread)
            with progress("measuring", quiet=quiet, undisturbed=True) as on_progress:
                run(wanted, courses, makers, out, on_progress)
            finish(wanted, out)
        except OSError as error:
            msg = f"cannot write to {out}: {error.strerror or error}"
            raise OptionError(msg, hint="choose another folder with --out") from error
        except KeyboardInterrupt:
            count = len(wanted.cells()) * wanted.rounds
            note(f"{count - remaining(wanted, out)} of {count} drives are kept in {out}; the same command goes on from there")
            raise
    tables = {name: read_table(out, name) for name in LAYOUTS}
    if json:
        print_json({"out": str(out)} | {name: _rows(tables[name]) for name in LAYOUTS})
    elif not quiet:
        print_tables(*summary_tables(tables))
        note(f"written to {out}/")
    return ExitCode.OK


def _rows(table: DataFrame) -> list[dict[str, object]]:
    """Return a table's rows for JSON, which has no NaN."""
    return [{str(name): None if value != value else value for name, value in row.items()} for row in table.to_dict("records")]  # noqa: PLR0124 - NaN


def _names(text: str | None) -> list[str] | None:
    return None if text is None else [name.strip() for name in text.split(",") if name.strip()]
