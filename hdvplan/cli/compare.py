"""``hdvplan compare``: compare two benchmark runs, and show a comparison; and what ``hdvplan bench`` compares a run with."""

from __future__ import annotations

import os
import shlex
import sys
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.bench import ENVELOPE_M, FACTOR, FLOOR_S, PATIENCE_S, TIME_LIMIT_S
from hdvplan.cli.console import ExitCode, note, print_json, print_line, print_tables, progress, warn, writing
from hdvplan.cli.help import OUTPUT
from hdvplan.cli.options import OptionsOf, with_settings
from hdvplan.errors import HdvplanError, OptionError
from hdvplan.settings import Setting

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import pandas as pd

    from hdvplan.bench.comparing.against import Settings
    from hdvplan.bench.comparing.compare import Comparison
    from hdvplan.bench.comparing.decision import Rule
    from hdvplan.bench.comparing.work import CommandWork
    from hdvplan.bench.suite import Suite

DECISION = "Decision"  # options that say what a regression is


@dataclass(frozen=True)
class Decision:
    """What a regression is."""

    factor: Annotated[float, Setting("A cell that takes more than X times as long has regressed.", "X")] = FACTOR
    floor: Annotated[float, Setting("Smaller differences of the mean planning step do not count [ms].", "MS")] = 1e3 * FLOOR_S
    envelope_tolerance: Annotated[float, Setting("Envelopes that differ by less are equal [m].", "M")] = ENVELOPE_M
    expect_changes: Annotated[bool, Setting("Show changed counters and envelopes, but do not count them as a regression.")] = False
    patience: Annotated[float, Setting("Where noise hides the answer, measure on for so long [s].", "S")] = PATIENCE_S
    time_limit: Annotated[float, Setting("A process that takes longer is ended, and named [s].", "S")] = TIME_LIMIT_S

    def settings(self) -> Settings:
        """Return how two programs, or runs, are compared; an ``OptionError`` where a value is outside its range."""
        from hdvplan.bench.comparing.against import Settings
        from hdvplan.bench.comparing.decision import Rule

        for name, seconds in (("--patience", self.patience), ("--time-limit", self.time_limit)):
            if not seconds >= 0.0 or (seconds == 0.0 and name == "--time-limit"):
                msg = f"{name} must be a positive number of seconds, not {seconds:g}"
                raise OptionError(msg)
        return Settings(Rule(self.factor, 1e-3 * self.floor), self.expect_changes, patience=self.patience, time_limit=self.time_limit)

    def words(self) -> list[str]:
        """Return the options that make another decision than the usual one."""
        usual, numbers = Decision(), ("factor", "floor", "patience", "time_limit")
        changed = [name for name in numbers if getattr(self, name) != getattr(usual, name)]
        words = [word for name in changed for word in (f"--{name.replace('_', '-')}", f"{getattr(self, name):g}")]
        return words + ["--expect-changes"] * self.expect_changes


@dataclass(frozen=True)
class Report:
    """How a comparison is told."""

    reports: Annotated[Path | None, Setting("Also write the comparison as JSON, JUnit XML, Markdown and for dashboards.", "DIR")] = None
    format_: Annotated[
        str,
        Setting("github: an annotation on stdout, tables in the step summary.", names=("--format",), choices=("text", "github")),
    ] = "text"
    json: Annotated[bool, Setting("Write JSON to stdout, and nothing else.")] = False
    quiet: Annotated[bool, Setting("No progress, notes or tables; errors remain.")] = False


@with_settings
def compare(
    base: Annotated[
        Path, typer.Argument(metavar="BASE", help="The former run: a folder of `hdvplan bench`, or one with several such folders.")
    ],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="The new run.")],
    *,
    decision: Annotated[Decision, OptionsOf(Decision, DECISION, only=("factor", "floor", "envelope_tolerance", "expect_changes"))],
    report: Annotated[Report, OptionsOf(Report, OUTPUT)],
) -> int:
    """Compare two benchmark runs of the same cells.

    A cell is a combination of road, vehicle, scheme and solver. Exact counters come first, then the times of planning steps. Counters are
    quadratic programs (QPs), iterations, non-zeros, statuses and the envelope; any change is shown. Times are compared pair by pair, in the
    order of measurement; at least three pairs are needed. `hdvplan bench --against REV` measures such pairs.

    Exit codes: 0 fine; 1 a cell became slower, or counters changed; 2 bad input or usage; 3 could not measure: the times
    are too uncertain.
    """
    from hdvplan.bench.comparing.compare import check_comparable
    from hdvplan.bench.comparing.compare import compare as compared
    from hdvplan.bench.comparing.counters import Tolerance
    from hdvplan.bench.comparing.reports import write_reports
    from hdvplan.bench.comparing.sides import read_side

    with told_to_programs(report):
        rule, apart = decision.settings().rule, decision.envelope_tolerance
        if not apart >= 0.0:
            msg = f"--envelope-tolerance must be at least 0, not {apart:g}"
            raise OptionError(msg)
        sides = read_side(base), read_side(new)
        check_comparable(*sides)
        about = "; ".join(
            f"{word}: {path} ({', '.join(side.machines) or 'machine unknown'})"
            for word, path, side in zip(("base", "new"), (base, new), sides, strict=True)
        )
        found = compared(*sides, rule, Tolerance(envelope=apart), expect_changes=decision.expect_changes)
        comparison = replace(found, about=about)
        if report.reports is not None:
            with writing(f"the reports to {report.reports}", None):
                write_reports(comparison, rule, None, report.reports)
        return show(comparison, rule, report, f"{report.reports or '--reports DIR'}/summary.md")


@contextmanager
def told_to_programs(report: Report) -> Iterator[None]:
    """Annotate on stdout, where GitHub Actions read it, why the block ends in an error, or that it was interrupted."""
    try:
        yield
    except (HdvplanError, KeyboardInterrupt, SystemExit) as error:
        if report.format_ == "github" and not report.json:
            from hdvplan.bench.comparing.reports import refusal_annotation

            print_line(refusal_annotation(*((str(error), error.hint) if isinstance(error, HdvplanError) else ("interrupted", None))))
        raise


def show(comparison: Comparison, rule: Rule, report: Report, where: str = "", again: str | None = None) -> ExitCode:
    """Write a comparison as asked for and return its exit code; ``where`` has what decides nothing, ``again`` is the command for it."""
    from hdvplan.bench.comparing.decision import GateVerdict
    from hdvplan.bench.comparing.reports import comparison_json, github_annotation
    from hdvplan.bench.comparing.words import comparison_markdown, comparison_tables, verdict_line

    if report.json:
        print_json(comparison_json(comparison, rule, again))
    elif report.format_ == "github":
        sys.stdout.write(f"{github_annotation(comparison, rule)}\n")
        _summarise(comparison_markdown(comparison, rule, again))
    else:
        if not report.quiet:
            print_tables(*comparison_tables(comparison, where))
            if comparison.failure is not None and comparison.failure.tail:
                sys.stdout.write(f"{comparison.failure.tail}\n")
            if comparison.about:
                sys.stdout.write(f"{comparison.about}\n")
            if again is not None and comparison.verdict is not GateVerdict.FINE:
                sys.stdout.write(f"again: {again}\n")
        sys.stdout.write(f"{verdict_line(comparison, rule)}\n")
    codes = {GateVerdict.FINE: ExitCode.OK, GateVerdict.REGRESSED: ExitCode.BROKEN, GateVerdict.UNMEASURABLE: ExitCode.UNMEASURED}
    return codes[comparison.verdict]


def _summarise(markdown: str) -> None:
    """Append to the step summary of GitHub Actions, or say that it cannot be written, which is no verdict; elsewhere write to stdout."""
    summary = os.environ.get("GITHUB_STEP_SUMMARY")
    if not summary:
        sys.stdout.write(markdown)
        return
    try:
        with Path(summary).open("a", encoding="utf-8") as file:
            file.write(markdown)
    except OSError as error:
        warn(f"cannot write the step summary {summary}: {error.strerror or error}")


def gate(against: str, work: Suite | CommandWork, out: Path, decision: Decision, report: Report, *, strict: bool) -> ExitCode:
    """Measure this program and another in turn into ``out``, show how they compare, and leave reports for other programs."""
    from hdvplan.bench.comparing.against import SIDES, Listener, guard
    from hdvplan.bench.comparing.reports import write_reports
    from hdvplan.bench.comparing.work import CommandWork

    if not isinstance(work, CommandWork):
        _check(work)
    settings, quiet = replace(decision.settings(), strict=strict), report.quiet
    again = _again(against, work, [*decision.words(), *["--strict"] * strict], out)
    try:
        with progress("measuring", quiet=quiet, undisturbed=True) as on_progress:
            comparison = guard(against, work, settings, out, Listener(lambda step: note(step, quiet=quiet), on_progress))
        before, after = (_versions(out / side / "00") for side in SIDES)
        changed = [
            f"{name} {before.get(name, '-')} -> {after.get(name, '-')}" for name in before | after if before.get(name) != after.get(name)
        ]
        if comparison.failure is None and changed:
            note(f"versions differ: {', '.join(changed)}", quiet=quiet)
        write_reports(comparison, settings.rule, again, out)
    except OSError as error:
        raise _cannot_write(error, out) from error
    return show(comparison, settings.rule, report, f"{out / 'summary.md'}", again)


def _versions(process: Path) -> dict[str, str]:
    """Return the versions of hdvplan and of libraries from the folder of a process; a command of one's own notes none."""
    from hdvplan.fileio import read_json

    try:
        noted = read_json(process / "run.json")["software"]
        return {"hdvplan": str(noted["hdvplan"])} | {str(name): str(version) for name, version in noted["packages"].items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return {}


def _cannot_write(error: OSError, out: Path) -> OptionError:
    """Return what is said of a file that cannot be written: one in ``out``, or of a cache or temporary folder."""
    file, folder = Path(str(error.filename or out)).absolute(), out.absolute()
    reason = error.strerror or error
    if file.is_relative_to(folder) or folder.is_relative_to(file):
        return OptionError(f"cannot measure into {out}: {reason}", hint="choose another folder with --out")
    return OptionError(f"cannot measure: {file}: {reason}", hint="TMPDIR and XDG_CACHE_HOME choose other folders")


def _check(suite: Suite) -> None:
    """Refuse a road or vehicle that cannot be read: that is the user's mistake, not a failed measurement.

    Where this very program cannot even be imported, its processes will say so.
    """
    try:
        from hdvplan.bench.measuring.courses import cases_of

        cases_of(suite)
    except HdvplanError:
        raise
    except Exception as error:  # noqa: BLE001 - a program of any kind may be under test
        warn(f"this hdvplan cannot load what the suite names: {type(error).__name__}: {error}")


def _again(against: str, wanted: Suite | CommandWork, words: Sequence[str], out: Path) -> str:
    from hdvplan.bench.comparing.work import CommandWork

    what = ["--suite", str(out / "suite.toml")]
    if isinstance(wanted, CommandWork):
        what = ["--command", shlex.join(wanted.words), *(("--extras", ",".join(wanted.extras)) if wanted.extras else ())]
    return shlex.join(["hdvplan", "bench", "--against", against, *what, *words, "--out", f"{out}-again"])


def hold_to(counters: Path, baseline: pd.DataFrame | None, out: Path, report: Report, *, strict: bool) -> int:
    """Compare a finished run's counters with the ``baseline`` that ``counters`` holds, ``strict``: exactly; without one they become it."""
    from hdvplan.bench.comparing.compare import compare_counters
    from hdvplan.bench.comparing.counters import write_counters
    from hdvplan.bench.comparing.decision import Rule
    from hdvplan.bench.comparing.sides import read_side

    measured = read_side(out).counters
    if baseline is None:
        write_counters(measured, counters)
        note(f"counters written to {counters}", quiet=report.quiet)
        return ExitCode.OK
    comparison = compare_counters(baseline, measured, exact=strict)
    code = show(comparison, Rule(), report)
    if comparison.changes:
        note("where the change is meant: the same command with --renew", quiet=report.quiet)
    return code
