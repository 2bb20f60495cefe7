"""Where output goes: results to stdout, everything else to stderr; and what is said of output that cannot be written."""

from __future__ import annotations

import json
import os
import sys
from contextlib import contextmanager, nullcontext
from enum import IntEnum
from time import monotonic
from typing import TYPE_CHECKING, TextIO

from hdvplan.errors import OptionError
from hdvplan.texts import encoded, printable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from pandas import DataFrame
    from rich.table import Table

    from hdvplan.cli.options import Output


_TELL_S = 10.0  # between two lines of progress
_UNCUT = 1000  # columns: wider than any table


class ExitCode(IntEnum):
    """What a command's exit status means."""

    OK = 0
    BROKEN = 1  # a limit is broken, or no plan exists; a regression
    USAGE = 2  # bad input or usage
    UNMEASURED = 3  # nothing can be said about planning times
    INTERNAL = 70  # a bug in hdvplan (EX_SOFTWARE of sysexits.h)
    INTERRUPTED = 130  # Ctrl-C, as shells report it
    UNREAD = 141  # nobody reads stdout any more, likewise (SIGPIPE)


def report_error(message: str, hint: str | None = None, reasons: Iterable[str] = ()) -> None:
    """Write one ``error:`` line, a line for each of ``reasons``, and a ``hint:`` line where there is a next step, to stderr."""
    sys.stderr.write(f"error: {printable(message)}\n")
    for reason in reasons:
        sys.stderr.write(f"{printable(reason)}\n")
    if hint:
        sys.stderr.write(f"hint: {printable(hint)}\n")


def note(message: str, *, quiet: bool = False) -> None:
    """Write a line to stderr unless the user wants silence."""
    if not quiet:
        sys.stderr.write(f"{printable(message)}\n")
        sys.stderr.flush()


def warn(message: str, *, quiet: bool = False) -> None:
    """Write a ``warning:`` line to stderr unless the user wants silence."""
    note(f"warning: {message}", quiet=quiet)


def print_line(text: str) -> None:
    """Write an answer of one line to stdout; the terminal wraps it."""
    sys.stdout.write(f"{printable(text)}\n")
    sys.stdout.flush()  # what stderr says next belongs below it


def print_tables(*tables: Table) -> None:
    """Write tables to stdout: at a terminal in its width if they fit, in colour unless NO_COLOR is set, else without trailing blanks."""
    from rich.console import Console

    console = Console(highlight=False, soft_wrap=False)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = _UNCUT
    width, unbound = console.width, console.options.update(width=_UNCUT)
    with nullcontext() if console.is_terminal else console.capture() as captured:
        for table in tables:
            console.width = max(width, console.measure(table, options=unbound).minimum)
            console.print(table, crop=False)
    if captured is not None:
        sys.stdout.write("".join(f"{line.rstrip()}\n" for line in captured.get().splitlines()))


def answers() -> TextIO:
    """Return stdout, also where all that is printed goes to stderr."""
    return sys.__stdout__ if sys.stdout is sys.stderr and sys.__stdout__ is not None else sys.stdout


def print_json(value: object) -> None:
    """Write ``value`` as JSON to stdout."""
    answers().write(encoded(json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False) + "\n").decode())


def print_answer(output: Output, summary: object, lines: Iterable[str], tables: Iterable[Table] = ()) -> None:
    """Write an answer to stdout as asked for: its summary as JSON, or its lines and tables, or nothing where the user wants silence."""
    if output.json:
        print_json(summary)
    elif not output.quiet:
        for line in lines:
            print_line(line)
        print_tables(*tables)


def rows_json(table: DataFrame) -> list[dict[str, object]]:
    """Return a table's rows for JSON, which has no NaN."""
    return [{str(name): None if value != value else value for name, value in row.items()} for row in table.to_dict("records")]  # noqa: PLR0124 - NaN


@contextmanager
def writing(what: str, hint: str | None = "choose another folder with --out") -> Iterator[None]:
    """Report, by an ``OptionError``, ``what`` the block cannot write."""
    try:
        yield
    except OSError as error:
        msg = f"cannot write {what}: {error.strerror or error}"
        raise OptionError(msg, hint=hint) from error


@contextmanager
def progress(
    task: str, *, quiet: bool, undisturbed: bool = False, part: Callable[[], str] | None = None
) -> Iterator[Callable[[float], None]]:
    """Show a bar with the time left on stderr while the block runs; it receives the done share, 0 to 1.

    Where stderr is no terminal, or with ``part``, which says what is done now, a line is written at most every ten seconds: something
    else is printed meanwhile.
    With ``undisturbed`` the bar is drawn only when the share changes: no other thread runs during a measurement, and the time left is
    estimated from the last hour.
    """
    if quiet or part or not sys.stderr.isatty():
        yield (lambda _: None) if quiet else _lines(lambda: task if part is None else f"{task} {part()}")
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    memory = 3600.0 if undisturbed else 30.0  # [s]
    with Progress(*columns, console=console, transient=True, auto_refresh=not undisturbed, speed_estimate_period=memory) as bar:
        known = bar.add_task(printable(task), total=1.0)
        yield lambda share: bar.update(known, completed=share, refresh=undisturbed)


def _lines(task: Callable[[], str]) -> Callable[[float], None]:
    """Return what writes how far a task is, and the time left, whenever ``_TELL_S`` have passed: logs are read while they grow."""
    first: float | None = None
    last = began = monotonic()

    def tell(share: float) -> None:
        nonlocal first, last, began
        now = monotonic()
        if first is None:  # before it an earlier run has done what it has, or something is installed
            first, began = share, now
        if now - last < _TELL_S:
            return
        last = now
        left = f", about {duration((now - began) * (1.0 - share) / (share - first))} left" if share > first else ""
        note(f"{task()}: {100.0 * share:.0f} %{left}")

    return tell


def duration(seconds: float) -> str:
    """Return a time as people say it."""
    minutes = round(seconds / 60.0)
    if minutes < 1:
        return f"{max(1, round(seconds))} s"
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"  # noqa: PLR2004 - of an hour
