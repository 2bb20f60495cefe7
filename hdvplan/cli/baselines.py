"""What ``hdvplan bench`` compares a run with: another program, or committed counters."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from hdvplan.cli.compare import show
from hdvplan.cli.console import ExitCode, note, progress, warn
from hdvplan.errors import HdvplanError, OptionError

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

    from hdvplan.bench.comparing.work import CommandWork
    from hdvplan.bench.suite import Suite
    from hdvplan.cli.bench_options import Decision, Report


def measured(suite: Path | None, given: Mapping[str, object], command: str | None) -> Suite | CommandWork:
    """Return what a comparison measures: a user's own command, or a suite.

    Raises:
        OptionError: no such suite, settings that contradict each other, or a command that is none.
        SolverError: no such solver.

    """
    from hdvplan.bench.comparing.against import SUITE
    from hdvplan.bench.comparing.work import CommandWork, command_words
    from hdvplan.bench.suite import read_suite, suite_of
    from hdvplan.plugins import is_reference
    from hdvplan.solvers.registry import check_solver

    if command is not None:
        if suite is not None or given:
            msg = "--command measures your own command: a suite and its options do not apply"
            raise OptionError(msg, hint="leave them out")
        return CommandWork(command_words(command))
    wanted = suite_of(dict(SUITE) | (read_suite(suite) if suite else {}) | dict(given))
    for name in wanted.solvers:
        if not is_reference(name):  # each program has its own of these
            check_solver(name)
    return wanted


def gate(against: str, work: Suite | CommandWork, out: Path, decision: Decision, report: Report) -> ExitCode:
    """Measure this program and another in turn into ``out``, show how they compare, and leave reports for other programs.

    Raises:
        OptionError: a road or vehicle that cannot be read, a program that is none, or ``out`` cannot be written.

    """
    from hdvplan.bench.comparing.against import SIDES, Listener, guard
    from hdvplan.bench.comparing.reports import write_reports
    from hdvplan.bench.comparing.work import CommandWork

    if not isinstance(work, CommandWork):
        _check(work)
    settings, quiet = decision.settings(), report.quiet
    again = _again(against, work, decision, out)
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
    return show(comparison, settings.rule, report, again)


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


def _again(against: str, wanted: Suite | CommandWork, decision: Decision, out: Path) -> str:
    """Return the command that measures the same again."""
    from hdvplan.bench.comparing.work import CommandWork

    what = ["--command", shlex.join(wanted.words)] if isinstance(wanted, CommandWork) else ["--suite", str(out / "suite.toml")]
    return shlex.join(["hdvplan", "bench", "--against", against, *what, *decision.words(), "--out", f"{out}-again"])


def hold_to(counters: Path, baseline: pd.DataFrame | None, out: Path, report: Report) -> int:
    """Compare a finished run's counters with the ``baseline`` that ``counters`` holds, or without one make them the baseline."""
    from hdvplan.bench.comparing.compare import compare_counters
    from hdvplan.bench.comparing.counters import write_counters
    from hdvplan.bench.comparing.decision import Rule
    from hdvplan.bench.comparing.sides import read_side

    measured = read_side(out).counters
    if baseline is None:
        write_counters(measured, counters)
        note(f"counters written to {counters}", quiet=report.quiet)
        return ExitCode.OK
    code = show(compare_counters(baseline, measured), Rule(), report)
    if code is not ExitCode.OK:
        note("where the change is meant: the same command with --renew", quiet=report.quiet)
    return code
