"""``hdvplan bench``: time the planning of vehicles along roads, scheme by scheme and solver by solver."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from hdvplan.bench import PICTURE
from hdvplan.bench.suite import Suite, read_suite, suite_of
from hdvplan.cli.compare import DECISION, Decision, Report, gate, hold_to, told_to_programs
from hdvplan.cli.console import ExitCode, note, print_json, print_line, print_tables, progress, report_error, rows_json, warn, writing
from hdvplan.cli.help import OUTPUT
from hdvplan.cli.options import OptionsOf, with_settings
from hdvplan.errors import OptionError
from hdvplan.report import PICTURES
from hdvplan.settings import Setting, choice

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from hdvplan.bench.comparing.work import CommandWork
    from hdvplan.case import Case

_WHAT, _LIMITS, _HOW, _COMPARISON = "What to measure", "Limits", "How to measure", "Comparison"  # groups of options
_OF_SUITE = dict.fromkeys(("solvers", "vehicles", "roads", "road_ids", "schemes", "objective"), _WHAT)
_OF_SUITE |= dict.fromkeys(("half_width", "slack", "pinch", "classes"), _LIMITS)
_MEASURES = ("step_limit", "cell_limit", "memory_limit")  # that need a process which can be ended


@dataclass(frozen=True)
class BenchOptions:
    """What a benchmark does besides measuring its suite."""

    suite: Annotated[Path | None, Setting("Read settings from a file; options override them.", "FILE.toml")] = None
    no_limits: Annotated[bool, Setting("Plan without limits.")] = False
    in_process: Annotated[bool, Setting("Measure in this process: of the limits only --budget applies, and a crash ends the run.")] = False
    against: Annotated[
        str | None,
        Setting("Measure in alternation with a revision, a release (hdvplan==X) or another interpreter, and compare.", "REV"),
    ] = None
    command: Annotated[str | None, Setting("With --against: measure your own command, which prints planning times as JSON.", "CMD")] = None
    extras: Annotated[str | None, Setting("With --command: install these extras of the project, too, on both sides.", "NAME,...")] = None
    counters: Annotated[
        Path | None, Setting("Compare sums of QPs and iterations (2 % may differ), sizes and envelopes with a baseline.", "FILE.csv")
    ] = None
    renew: Annotated[bool, Setting("Write FILE.csv of --counters instead of comparing.")] = False
    strict: Annotated[
        bool,
        Setting(
            "End with 1 if a cell is not ok, with --counters if any sum changed, with --against with 3 if noise could hide any change."
        ),
    ] = False

    def check(self, files: BenchFiles, given: Mapping[str, object], decision: Decision) -> None:
        """Refuse, by an ``OptionError``, options that contradict each other; ``given`` are those of the suite."""
        if files.plot is not None:
            choice("the picture's ending", Path(files.plot).suffix.lower().removeprefix("."), PICTURES)
        compared = self.against is not None
        for contradictory, words, hint in (
            (compared and files.plot is not None, "--plot draws one benchmark, and --against measures several", "leave out --plot"),
            (
                not compared and (decision != Decision() or self.command is not None),
                "--factor, --floor, --expect-changes, --patience, --time-limit and --command need --against",
                None if self.counters is None else "--renew takes changed counters over",
            ),
            (self.extras is not None and self.command is None, "--extras needs --command", None),
            (self.renew and self.counters is None, "--renew needs --counters", None),
            (
                self.strict and files.export_qps is not None,
                "--strict speaks of cells that are measured, and --export-qps measures none",
                "leave out --strict",
            ),
            (
                compared and self.counters is not None,
                "--against compares counters with those of REV, not with a file",
                "leave out --counters",
            ),
            (
                self.in_process and any(name in given for name in _MEASURES),
                "--step-limit, --cell-limit and --memory-limit need a process that can be ended",
                "leave out --in-process",
            ),
            (
                files.export_qps is not None and (compared or self.counters is not None or files.plot is not None),
                "--export-qps measures nothing, so --against, --counters and --plot do not apply",
                "leave them out",
            ),
        ):
            if contradictory:
                raise OptionError(words, hint=hint)


@dataclass(frozen=True)
class BenchFiles:
    """What a benchmark writes."""

    out: Annotated[Path, Setting("Where to write, and where a stopped run continues.", "DIR")] = Path("hdvplan-bench")
    fresh: Annotated[bool, Setting("Delete what an earlier run has left in DIR.")] = False
    plot: Annotated[
        str | None,
        Setting("Draw the run [default file: DIR/bench.png]: png, pdf, svg.", "[FILE]"),
    ] = None
    export_qps: Annotated[Path | None, Setting("Measure nothing: write the QPs of the drives of the first of --solvers.", "DIR")] = None
    qp_format: Annotated[
        str,
        Setting(
            "Of --export-qps: matrices, dense (needs pyarrow, of the extra study) or sparse, or stages.",
            choices=("qpbenchmark", "npz", "acados"),
        ),
    ] = "qpbenchmark"


def with_picture(arguments: Sequence[str]) -> list[str]:
    """Return the arguments with the usual picture behind a bare --plot: Typer knows no option whose value may be left out."""
    given = []
    for argument, following in zip(arguments, [*arguments[1:], "-"], strict=True):
        given += [argument, PICTURE] if argument == "--plot" and following.startswith("-") else [argument]
    return given


@with_settings
def bench(
    *,
    given: Annotated[dict[str, object], OptionsOf(Suite, _HOW, _OF_SUITE, given=True)],
    options: Annotated[BenchOptions, OptionsOf(BenchOptions, _COMPARISON, {"in_process": _HOW, "suite": _WHAT, "no_limits": _LIMITS})],
    decision: Annotated[Decision, OptionsOf(Decision, DECISION, only=("factor", "floor", "expect_changes", "patience", "time_limit"))],
    files: Annotated[BenchFiles, OptionsOf(BenchFiles, OUTPUT)],
    report: Annotated[Report, OptionsOf(Report, OUTPUT, only=("format_", "json", "quiet"))],
) -> int:
    """Time planning by road, vehicle, scheme and solver.

    A cell is one such combination. Solvers solve quadratic programs (QPs). Every cell is driven once a round, in an order that lets a busy
    or warming machine affect all cells equally. To continue a run that was stopped, give the same command again; --against begins anew.

    --export-qps measures nothing: the first of --solvers drives, and exit code 1 says that a drive ended early.

    Defaults: ten shipped roads, bus and tractor-trailer, both schemes, riccati, piqp, clarabel and osqp, three rounds, limits
    0.5 m beyond the geometric half width. A cell that cannot be planned, or not rightly, is a row of the tables; the
    run continues, and its exit code is 0, or 1 with --strict.

    With --against: two roads, riccati and six rounds; five fresh processes for each side, which take turns, ten if a repeat is needed,
    more where noise hides the answer.
    Exit codes then: 0 fine; 1 something became slower, counters changed, or the new program does not run; 2 bad input; 3 could not
    measure: noise, with --strict in any quantity, or a base that does not run. DIR has the result as JSON, JUnit XML, Markdown and for
    dashboards.
    """
    options.check(files, given, decision)
    json, quiet, out = report.json, report.quiet, files.out
    from hdvplan.machine import use_one_thread

    one_thread = use_one_thread()  # before anything imports NumPy
    from hdvplan.planning.settings import check_objective
    from hdvplan.solvers.registry import check_solver, solver_named

    given |= {"limits": False} if options.no_limits else {}
    if options.against is not None:
        with told_to_programs(report):
            return gate(options.against, _measured(given, options), out, decision, report, strict=options.strict)
    wanted = suite_of(read_suite(options.suite, given))
    check_objective(wanted.objective)
    for name in wanted.solvers:
        check_solver(name)  # what is wrong with names is said before more is loaded
    from hdvplan.bench.comparing.counters import read_counters
    from hdvplan.bench.measuring.courses import cases_of
    from hdvplan.bench.measuring.directory import begin, damage_told, discard, finish, read_record, read_table, recorded
    from hdvplan.bench.measuring.ranking import broken_limits
    from hdvplan.bench.measuring.run import remaining, run
    from hdvplan.bench.measuring.samples import OK
    from hdvplan.bench.measuring.timing import LAYOUTS, reasons_of, summary_tables
    from hdvplan.process import ended_by_signals

    if files.export_qps is not None:
        from hdvplan.bench.measuring.export import cases_to_export, export

        with writing(f"to {files.export_qps}", "choose another folder"):
            written = export(cases_to_export(wanted), files.export_qps, files.qp_format)
        count = sum(len(one["programs"]) for one in written)
        note(f"wrote {files.export_qps}/, QPs: {count}, drives: {len(written)}", quiet=quiet)
        early = [one for one in written if one["ended"]]
        for one in early:
            warn(f"{one['name']} ended early, after {len(one['programs'])} QPs: {one['ended']}", quiet=quiet)
        return ExitCode.BROKEN if early else ExitCode.OK
    baseline = None if options.counters is None or options.renew else read_counters(options.counters)  # told before anything is measured
    only_drawn = files.plot is not None and options.counters is None
    record = None if files.fresh else recorded(wanted, out, only_drawn=only_drawn)
    if record is not None and record["finished"]:
        note(f"{out} already has this run; --fresh measures again", quiet=quiet)
    else:
        cases = cases_of(wanted)
        for name in wanted.solvers:
            solver_named(name)  # a class that cannot be loaded is the user's mistake, not a row
        try:
            with writing(f"to {out}"), ended_by_signals():
                if files.fresh:
                    discard(out)
                begin(wanted, cases, out, record, one_thread=one_thread)
                tolerances = _tolerances(wanted, cases, out, record, quiet=quiet)
                makers = {name: solver_named(name) for name in wanted.solvers}
                makers |= {key: solver_named(key.rpartition(", ")[0], tolerance) for key, tolerance in tolerances.items()}
                with progress("measuring", quiet=quiet, undisturbed=True) as on_progress:
                    run(wanted, cases, makers, out, on_progress, in_process=options.in_process)
                finish(wanted, out)
        except (KeyboardInterrupt, SystemExit):
            count = len(wanted.cells()) * wanted.rounds
            note(f"{count - remaining(wanted, out)} of {count} drives are saved in {out}; the same command continues the run")
            raise
    if files.plot is not None:
        picture = out / PICTURE if files.plot == PICTURE else Path(files.plot)
        from hdvplan.bench.measuring.pictures import draw

        with writing(f"{picture}", None), damage_told(out):
            draw(out, picture)
        note(f"picture in {picture}", quiet=quiet)
    if options.counters is not None:
        return hold_to(options.counters, baseline, out, report, strict=options.strict)
    tables, record = {name: read_table(out, f"{name}.csv") for name in LAYOUTS}, read_record(out)
    with damage_told(out):
        if json:
            head = {"out": str(out), "verdict": record["verdict"], "load": record["load"], "untuned": record.get("untuned", [])}
            print_json({**head, **{name: rows_json(tables[name]) for name in LAYOUTS}})
        elif not quiet:
            print_tables(*summary_tables(tables, record.get("tolerances")))
            for line in (
                *reasons_of(tables["timing"]),
                *broken_limits(tables["summary"]),
                *(finding["text"] for finding in record["verdict"]),
            ):
                print_line(line)
            for warning in (record["load"]["warning"], *record.get("untuned", [])):
                if warning:
                    warn(warning)
            note(f"written to {out}/")
    failed = int((tables["timing"]["status"] != OK).sum()) if options.strict else 0
    if failed:
        report_error(f"{failed} of {len(tables['timing'])} cells are not ok", f"{out}/timing.csv has each one's status and message")
    return ExitCode.BROKEN if failed else ExitCode.OK


def _measured(given: Mapping[str, object], options: BenchOptions) -> Suite | CommandWork:
    """Return what a comparison measures, a user's own command or a suite; an ``OptionError`` or ``SolverError`` where it is none."""
    from hdvplan.bench.comparing.against import SUITE
    from hdvplan.bench.comparing.work import CommandWork, command_words
    from hdvplan.plugins import is_reference
    from hdvplan.solvers.registry import check_solver

    if options.command is not None:
        if options.suite is not None or given:
            msg = "--command measures your own command: a suite and its options do not apply"
            raise OptionError(msg, hint="leave them out")
        return CommandWork(command_words(options.command), tuple(options.extras.split(",")) if options.extras else ())
    wanted = suite_of(dict(SUITE) | read_suite(options.suite, given))
    for name in wanted.solvers:
        if not is_reference(name):  # each program has its own of these
            check_solver(name)
    return wanted


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
