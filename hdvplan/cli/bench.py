"""``hdvplan bench``: time the planning of vehicles along roads, scheme by scheme and solver by solver."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from hdvplan.bench import PICTURE
from hdvplan.cli import bench_options as options
from hdvplan.cli.baselines import gate, hold_to, measured
from hdvplan.cli.compare import FORMATS, ExpectChangesOption, FactorOption, FloorOption, FormatOption, rule_of, told_to_programs
from hdvplan.cli.console import ExitCode, note, print_json, print_line, print_tables, progress, rows_json, warn, writing
from hdvplan.cli.options import JsonOption, QuietOption
from hdvplan.errors import OptionError
from hdvplan.settings import choice

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from hdvplan.bench.suite import Suite
    from hdvplan.case import Case


PICTURES = ("png", "pdf", "svg", "tex", "pgf")


def with_picture(arguments: Sequence[str]) -> list[str]:
    """Return the arguments with the usual picture behind a bare --plot: Typer knows no option whose value may be left out."""
    given = []
    for argument, following in zip(arguments, [*arguments[1:], "-"], strict=True):
        given += [argument, PICTURE] if argument == "--plot" and following.startswith("-") else [argument]
    return given


def bench(
    solvers: options.Solvers = None,
    vehicles: options.Vehicles = None,
    roads: options.Roads = None,
    schemes: options.Schemes = None,
    objective: options.Objective = None,
    suite: options.Suite = None,
    half_width: options.HalfWidth = None,
    slack: options.Slack = None,
    no_limits: options.NoLimits = False,
    pinch: options.Pinch = None,
    classes: options.Classes = None,
    rounds: options.Rounds = None,
    accuracy: options.Accuracy = None,
    sample: options.Sample = None,
    horizon: options.Horizon = None,
    step: options.Step = None,
    replan: options.Replan = None,
    budget: options.Budget = None,
    step_limit: options.StepLimit = None,
    cell_limit: options.CellLimit = None,
    memory_limit: options.MemoryLimit = None,
    in_process: options.InProcess = False,
    against: options.Against = None,
    command: options.Command = None,
    counters: options.Counters = None,
    renew: options.Renew = False,
    factor: FactorOption = None,
    floor: FloorOption = None,
    expect_changes: ExpectChangesOption = False,
    out: options.Out = Path("hdvplan-bench"),
    fresh: options.Fresh = False,
    plot: options.Plot = None,
    export_qps: options.ExportQps = None,
    format_: FormatOption = "text",
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Time planning by road, vehicle, scheme and solver.

    A cell is one such combination. Solvers solve quadratic programs (QPs). Every cell is driven once a round, in an order that lets a busy
    or warming machine affect all cells equally. To continue a run that was stopped, give the same command again.

    Defaults: ten shipped roads, bus and tractor-trailer, both schemes, riccati, piqp, clarabel and osqp, three rounds, limits
    0.5 m beyond the geometric half width. A cell that cannot be planned is a row of the tables; the run continues.

    With --against: two roads, riccati and six rounds; five fresh processes for each side, which take turns, ten if a repeat is needed.
    Exit codes then: 0 fine; 1 something became slower, counters changed, or the new program does not run; 2 bad input; 3 could not
    measure: noise, or a base that does not run. DIR has the result as JSON, JUnit XML, Markdown and for dashboards.
    """
    choice("--format", format_, FORMATS)
    if plot is not None:
        choice("the picture's ending", Path(plot).suffix.lower().removeprefix("."), PICTURES)
    compared, limited = against is not None, _any(step_limit, cell_limit, memory_limit)
    for contradictory, words, hint in (
        (compared and plot is not None, "--plot draws one benchmark, and --against measures several", "leave out --plot"),
        (
            not compared and (expect_changes or _any(factor, floor, command)),
            "--factor, --floor, --expect-changes and --command need --against",
            None,
        ),
        (renew and counters is None, "--renew needs --counters", None),
        (compared and counters is not None, "--against compares counters with those of REV, not with a file", "leave out --counters"),
        (
            in_process and limited,
            "--step-limit, --cell-limit and --memory-limit need a process that can be ended",
            "leave out --in-process",
        ),
        (
            export_qps is not None and _any(against, counters, plot),
            "--export-qps measures nothing, so --against, --counters and --plot do not apply",
            "leave them out",
        ),
    ):
        if contradictory:
            raise OptionError(words, hint=hint)
    from hdvplan.machine import use_one_thread

    one_thread = use_one_thread()  # before anything imports NumPy
    from hdvplan.bench.suite import read_suite, suite_of
    from hdvplan.planning.objective_names import check_objective
    from hdvplan.solvers.registry import check_solver, solver_named

    lists = {"roads": roads, "vehicles": vehicles, "schemes": schemes, "solvers": solvers, "classes": classes}
    single = {
        "objective": objective, "rounds": rounds, "budget": budget, "limits": False if no_limits else None, "half_width": half_width,
        "slack": slack, "pinch": pinch, "horizon": horizon, "step": step, "replan": replan, "accuracy": accuracy, "sample": sample,
        "step_limit": step_limit, "cell_limit": cell_limit, "memory_limit": memory_limit,
    }  # fmt: skip
    given: dict[str, object] = {
        name: [one.strip() for one in text.split(",") if one.strip()] for name, text in lists.items() if text is not None
    }
    given |= {name: value for name, value in single.items() if value is not None}
    if against is not None:
        with told_to_programs(json=json, format_=format_):
            what = measured(suite, given, command)
            rule = rule_of(factor, floor)
            return gate(against, what, rule, out, expect_changes=expect_changes, format_=format_, json=json, quiet=quiet)
    entries = read_suite(suite) if suite else {}
    wanted = suite_of(entries | given)
    check_objective(wanted.objective)
    for name in wanted.solvers:
        check_solver(name)  # what is wrong with names is said before more is loaded
    from hdvplan.bench.measuring.courses import cases_of
    from hdvplan.bench.measuring.directory import begin, damage_told, discard, finish, read_record, read_table, recorded
    from hdvplan.bench.measuring.run import remaining, run
    from hdvplan.bench.measuring.timing import LAYOUTS, summary_tables

    if export_qps is not None:
        from hdvplan.bench.measuring.export import cases_to_export, export

        with writing(f"to {export_qps}", "choose another folder"):
            files = export(cases_to_export(wanted), export_qps)
        note(f"wrote {export_qps}/, sequences of QPs: {len(files)}", quiet=quiet)
        return ExitCode.OK
    record = None if fresh else recorded(wanted, out, only_drawn=plot is not None and counters is None)
    if record is not None and record["finished"]:
        note(f"{out} already has this run; --fresh measures again", quiet=quiet)
    else:
        cases = cases_of(wanted)
        for name in wanted.solvers:
            solver_named(name)  # a class that cannot be loaded is the user's mistake, not a row
        try:
            with writing(f"to {out}"):
                if fresh:
                    discard(out)
                begin(wanted, cases, out, record, one_thread=one_thread)
                tolerances = _tolerances(wanted, cases, out, record, quiet=quiet)
                makers = {name: solver_named(name) for name in wanted.solvers}
                makers |= {key: solver_named(key.rpartition(", ")[0], tolerance) for key, tolerance in tolerances.items()}
                with progress("measuring", quiet=quiet, undisturbed=True) as on_progress:
                    run(wanted, cases, makers, out, on_progress, in_process=in_process)
                finish(wanted, out)
        except KeyboardInterrupt:
            count = len(wanted.cells()) * wanted.rounds
            note(f"{count - remaining(wanted, out)} of {count} drives are saved in {out}; the same command continues the run")
            raise
    if plot is not None:
        picture = out / PICTURE if plot == PICTURE else Path(plot)
        from hdvplan.bench.measuring.pictures import draw

        with writing(f"{picture}", None), damage_told(out):
            draw(out, picture)
        note(f"picture in {picture}", quiet=quiet)
    if counters is not None:
        return hold_to(counters, out, renew, format_=format_, json=json, quiet=quiet)
    tables, told = {name: read_table(out, name) for name in LAYOUTS}, read_record(out)
    with damage_told(out):
        if json:
            head = {"out": str(out), "verdict": told["verdict"], "load": told["load"], "untuned": told.get("untuned", [])}
            print_json({**head, **{name: rows_json(tables[name]) for name in LAYOUTS}})
        elif not quiet:
            print_tables(*summary_tables(tables, told.get("tolerances")))
            for finding in told["verdict"]:
                print_line(finding["text"])
            for warning in (told["load"]["warning"], *told.get("untuned", [])):
                if warning:
                    warn(warning)
            note(f"written to {out}/")
    return ExitCode.OK


def _tolerances(
    suite: Suite, cases: Sequence[Case], out: Path, record: dict[str, Any] | None, *, quiet: bool
) -> Mapping[str, float | None]:
    """Return the tolerances that the suite's accuracy asks for, found once for a run; none where it asks for none."""
    if suite.accuracy is None:
        return {}
    if record is not None and "tolerances" in record:
        return dict(record["tolerances"])
    from hdvplan.bench.measuring.directory import note_tolerances
    from hdvplan.bench.measuring.tuning import tuned

    with progress("tuning tolerances", quiet=quiet, undisturbed=True) as on_progress:
        found = tuned(suite, cases, on_progress)
    note_tolerances(out, found)
    return found


def _any(*values: object) -> bool:
    """Tell whether any of these options is given."""
    return any(value is not None for value in values)
