"""What ``hdvplan bench`` holds a run against: another program, or committed counters."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from hdvplan.cli.compare import show
from hdvplan.cli.console import ExitCode, note, progress
from hdvplan.errors import OptionError

if TYPE_CHECKING:
    from hdvplan.bench.compare import Comparison
    from hdvplan.bench.gate import Rule
    from hdvplan.bench.suite import Suite


def measure(against: str, suite: Suite, rule: Rule, out: Path, expect_changes: bool, *, quiet: bool) -> Comparison:
    """Measure a suite with this program and another, interleaved into ``out``, and return how they compare.

    Raises:
        OptionError: a road or vehicle that cannot be read, a program that is none, or ``out`` cannot be written.
        MeasurementError: a program cannot be installed or run.

    """
    from hdvplan.bench.against import measure_against
    from hdvplan.bench.courses import cases_of
    from hdvplan.bench.environment import base_program, working_tree

    cases_of(suite)  # a road or vehicle that cannot be read is the user's mistake, not a failed measurement
    new = working_tree()
    try:
        with (
            base_program(against, lambda step: note(step, quiet=quiet)) as base,
            progress("measuring", quiet=quiet, undisturbed=True) as bar,
        ):
            note(f"base: {base.name}; new: {new.name}", quiet=quiet)
            return measure_against(base, new, suite, rule, out, expect_changes=expect_changes, on_progress=bar)
    except OSError as error:
        msg = f"cannot measure into {out}: {error.strerror or error}"
        raise OptionError(msg, hint="choose another folder with --out") from error


def hold_to(counters: Path, out: Path, renew: bool, *, format_: str, json: bool, quiet: bool) -> int:
    """Compare a finished run's counters with a baseline, or make them the baseline."""
    from hdvplan.bench.compare import compare_counters, read_side
    from hdvplan.bench.counters import read_counters, write_counters
    from hdvplan.bench.gate import Rule

    measured = read_side(out).counters
    if renew:
        write_counters(measured, counters)
        note(f"counters written to {counters}", quiet=quiet)
        return ExitCode.OK
    return show(compare_counters(read_counters(counters), measured), Rule(), format_=format_, json=json, quiet=quiet)
