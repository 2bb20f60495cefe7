"""``hdvplan compare``: compare two benchmark runs, and show a comparison."""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli.bench_options import Decision, Report
from hdvplan.cli.console import ExitCode, print_json, print_line, print_tables, warn, writing
from hdvplan.cli.help import OUTPUT
from hdvplan.cli.settings import OptionsOf, with_settings
from hdvplan.errors import HdvplanError, OptionError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hdvplan.bench.comparing.compare import Comparison
    from hdvplan.bench.comparing.decision import Rule

DECISION = "Decision"  # options that say what a regression is


@with_settings
def compare(
    base: Annotated[
        Path, typer.Argument(metavar="BASE", help="The former run: a folder of `hdvplan bench`, or one with several such folders.")
    ],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="The new run.")],
    *,
    decision: Annotated[Decision, OptionsOf(Decision, DECISION, only=("factor", "floor", "envelope_tolerance", "expect_changes"))],
    reports: Annotated[
        Path | None,
        typer.Option(
            "--reports",
            metavar="DIR",
            help="Also write the comparison as JSON, JUnit XML, Markdown and for dashboards.",
            rich_help_panel=OUTPUT,
        ),
    ] = None,
    report: Annotated[Report, OptionsOf(Report, OUTPUT)],
) -> int:
    """Compare two benchmark runs of the same cells.

    A cell is a combination of road, vehicle, scheme and solver. Exact counters come first, then the times of planning steps. Counters are
    quadratic programs (QPs), iterations, non-zeros, statuses and the envelope; any change is shown. Times are compared pair by pair, in the
    order of measurement; at least three pairs are needed. `hdvplan bench --against REV` measures such pairs.

    Exit codes: 0 fine; 1 a cell became slower, or counters changed; 2 bad input or usage; 3 could not measure: the times
    are too uncertain.
    """
    with told_to_programs(report):
        return _compared(base, new, decision, reports, report)


def _compared(base: Path, new: Path, decision: Decision, reports: Path | None, report: Report) -> ExitCode:
    from hdvplan.bench.comparing.compare import compare as compared
    from hdvplan.bench.comparing.counters import Tolerance
    from hdvplan.bench.comparing.reports import write_reports
    from hdvplan.bench.comparing.sides import check_same_settings, read_side

    rule, apart = decision.rule(), decision.envelope_tolerance
    if not apart >= 0.0:
        msg = f"--envelope-tolerance must be at least 0, not {apart:g}"
        raise OptionError(msg)
    sides = read_side(base), read_side(new)
    check_same_settings(*sides)
    about = "; ".join(
        f"{word}: {path} ({', '.join(side.machines) or 'machine unknown'})"
        for word, path, side in zip(("base", "new"), (base, new), sides, strict=True)
    )
    found = compared(*sides, rule, Tolerance(envelope=apart), expect_changes=decision.expect_changes)
    comparison = replace(found, about=about)
    if reports is not None:
        with writing(f"the reports to {reports}", None):
            write_reports(comparison, rule, None, reports)
    return show(comparison, rule, report)


@contextmanager
def told_to_programs(report: Report) -> Iterator[None]:
    """Report on stdout, too, why the block ends in an error, or that it was interrupted: programs that parse it find the reason there."""
    try:
        yield
    except (HdvplanError, KeyboardInterrupt, SystemExit) as error:
        if report.json or report.format_ == "github":
            from hdvplan.bench.comparing.reports import refusal_annotation, refusal_json

            message, hint = (str(error), error.hint) if isinstance(error, HdvplanError) else ("interrupted", None)
            if report.json:
                print_json(refusal_json(message, hint))
            else:
                print_line(refusal_annotation(message, hint))
        raise


def show(comparison: Comparison, rule: Rule, report: Report, again: str | None = None) -> ExitCode:
    """Write a comparison as asked for and return its exit code; ``again`` is the command that shows it again."""
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
            print_tables(*comparison_tables(comparison))
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
