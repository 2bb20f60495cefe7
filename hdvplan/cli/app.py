"""The command line: its commands, the process that they run in, and the one place where errors become messages and exit codes."""

from __future__ import annotations

import os
import re
import shutil
import signal
import sys
import threading
import traceback
from contextlib import contextmanager, suppress
from functools import cache
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer.main import get_command

from hdvplan.cli import bench, compare, export_c, judge, need, plan, report, reproduce, roads, solvers, study, turn, vehicles
from hdvplan.cli.console import ExitCode, answers, print_json, report_error
from hdvplan.cli.help import Command, Group
from hdvplan.errors import HdvplanError, MeasurementError, PlanError, QpDataError, SolverError, TurnError
from hdvplan.texts import did_you_mean
from hdvplan.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from types import FrameType

_UsageError: type[Exception] = typer.BadParameter.__mro__[1]  # click's; newer versions of Typer carry their own click

app = typer.Typer(
    name="hdvplan",
    cls=Group,
    help="Can this bus or truck drive this real road, how evenly does it sweep it, and which solver of quadratic programs (QPs) plans it "
    "fast enough?",
    epilog="Exit codes: 0 done; 1 a limit is broken or no plan exists, or a regression; 2 bad input or usage; 3 could not measure; "
    "70 a bug in hdvplan; 130 interrupted.",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # square brackets are units here, not markup
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 120},
)
_VEHICLES, _MEASURING = "Does my vehicle fit?", "How fast, and how exact?"
_DATA = "Roads, vehicles, solvers"
_CACHE = 4_000_000  # bytes that Matplotlib keeps: its list of fonts, and more

app.command("plan", cls=Command, rich_help_panel=_VEHICLES)(plan.plan)
app.command("judge", cls=Command, rich_help_panel=_VEHICLES)(judge.judge)
app.command("need", cls=Command, rich_help_panel=_VEHICLES)(need.need)
app.command("turn", cls=Command, rich_help_panel=_VEHICLES)(turn.turn)
app.command("study", cls=Command, rich_help_panel=_VEHICLES)(study.study)
app.command("report", cls=Command, rich_help_panel=_VEHICLES)(report.report)
app.command("bench", cls=Command, rich_help_panel=_MEASURING)(bench.bench)
app.command("compare", cls=Command, rich_help_panel=_MEASURING)(compare.compare)
app.command("reproduce", cls=Command, rich_help_panel=_MEASURING)(reproduce.reproduce)
app.command("export-c", cls=Command, rich_help_panel=_DATA)(export_c.export_c)
app.add_typer(roads.app, name="roads", rich_help_panel=_DATA)
app.add_typer(vehicles.app, name="vehicles", rich_help_panel=_DATA)
app.command("solvers", cls=Command, rich_help_panel=_DATA)(solvers.solvers)


def _print_version(wanted: bool) -> None:
    if wanted:
        sys.stdout.write(f"hdvplan {__version__}\n")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error; accepted anywhere.")] = False,
) -> None:
    """Read the options that every command has; ``run`` has already taken --debug out."""


def run_process() -> int:
    """Run the command line of this process and return its exit code."""
    if isinstance(stdout := answers(), TextIOWrapper):
        stdout.reconfigure(errors="backslashreplace")  # as stderr: names may hold what a terminal's encoding has not
    return _written(run(sys.argv[1:]))


@cache
def command_line() -> Callable[..., object]:
    """Return what runs the commands. Typer reads the options of all of them for it: a process that runs several does that once."""
    return get_command(app)


def _written(code: int) -> int:
    """Return the exit code once stdout is written: at the end of the process Python would say what went wrong, in lines of its own."""
    try:
        answers().flush()
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), answers().fileno())  # Python tries once more
        if isinstance(error, BrokenPipeError) or code == ExitCode.USAGE:  # its reader, such as head, has enough; or all is message
            return code
        report_error(f"stdout: {error.strerror}")
        return ExitCode.USAGE
    return code


def run(arguments: Sequence[str]) -> int:
    """Run the command line ``arguments`` (without the program's name) and return the exit code."""
    arguments, debug = _without_debug(arguments)
    json = "--json" in arguments
    failed: Exception | None = None
    code: object = None
    with interruption_noted() as interrupted:
        try:
            give_matplotlib_a_folder()
            if "bench" in arguments:
                arguments = bench.with_picture(arguments)
            code = command_line()(args=arguments or ["--help"], prog_name="hdvplan", standalone_mode=False)
        except (KeyboardInterrupt, typer.Abort):
            code = ExitCode.INTERRUPTED
        except SystemExit as left:
            if not isinstance(left.__context__, BrokenPipeError):
                raise
            return ExitCode.UNREAD  # Typer leaves by 1 then, which is that of a broken limit
        except Exception as error:  # noqa: BLE001 - the single place that turns errors into messages
            failed = error
            if debug:
                traceback.print_exc()
        if interrupted() or code == ExitCode.INTERRUPTED:
            return _report(KeyboardInterrupt(), json=json)
    if isinstance(failed, BrokenPipeError):  # nobody reads what is written any more: a process that SIGPIPE ends says nothing either
        return ExitCode.UNREAD
    if failed is not None:
        return _report(failed, json=json)
    if not arguments:
        return ExitCode.USAGE  # no command was given: the help was printed
    return int(code) if isinstance(code, int) else ExitCode.OK


def _without_debug(arguments: Sequence[str]) -> tuple[list[str], bool]:
    """Return the arguments without --debug, which is accepted on either side of the command, and whether it was there."""
    end = list(arguments).index("--") if "--" in arguments else len(arguments)
    kept = [argument for argument in arguments[:end] if argument != "--debug"]
    return [*kept, *arguments[end:]], len(kept) < end


def _report(error: BaseException, *, json: bool) -> ExitCode:
    code, message, hint = _told(error)
    report_error(message, hint)
    if json:
        print_json({"error": message, "hint": hint, "kind": type(error).__name__, "exit_code": code})
    return code


def _told(error: BaseException) -> tuple[ExitCode, str, str | None]:
    if isinstance(error, KeyboardInterrupt):
        return ExitCode.INTERRUPTED, "interrupted", None
    if isinstance(error, _UsageError):
        return ExitCode.USAGE, *_usage(error)
    if isinstance(error, HdvplanError):
        ran = isinstance(error, SolverError) and error.status is not None  # only a solver that ran has a status
        failed = ran or isinstance(error, PlanError | QpDataError | TurnError)  # a plan that could not be made; else input is no use
        code = ExitCode.UNMEASURED if isinstance(error, MeasurementError) else ExitCode.BROKEN if failed else ExitCode.USAGE
        return code, str(error), error.hint
    if isinstance(error, OSError) and error.strerror:  # of a file or a folder, which no program can mend
        return ExitCode.USAGE, f"{error.filename}: {error.strerror}" if error.filename else error.strerror, None
    if isinstance(error, MemoryError):  # of this machine, or what a container leaves of it
        short = " ".join(f"there is not enough memory; {error}".split()).rstrip("; ")
        return ExitCode.USAGE, short, "try a shorter part of the road, or fewer --workers"
    hint = "this is a bug in hdvplan; run again with --debug and report the traceback"
    return ExitCode.INTERNAL, f"internal: {type(error).__name__}: {error}", hint


def _usage(error: Exception) -> tuple[str, str]:
    """Return what a usage error says, and its hint: what a misspelt name may have meant, else where the help is."""
    message = error.format_message() if hasattr(error, "format_message") else str(error)
    context = getattr(error, "ctx", None)
    where = f"see `{context.command_path if context else 'hdvplan'} --help`"
    option, command = getattr(error, "option_name", None), re.match(r"No such command '(.*?)'", message)
    if context and command:
        return f"no such command '{command[1]}'", did_you_mean(command[1], context.command.commands, where)
    if context and option and hasattr(error, "possibilities"):
        known = [name for parameter in context.command.params for name in parameter.opts if name.startswith("--")]
        return f"no such option: {option}", did_you_mean(option, known, where)
    text = " ".join(message.split()).rstrip(".")
    comma = re.search(r"'(-?\d+),(\d+)'", f"{message} {error.__cause__}") if re.search("number|float", message) else None
    hint = f"did you mean '{comma[1]}.{comma[2]}'?" if comma else where
    return text[:1].lower() + text[1:], hint  # as hdvplan's own messages


@contextmanager
def interruption_noted() -> Iterator[Callable[[], bool]]:
    """Note a Ctrl-C in the block, which raises ``KeyboardInterrupt`` as ever; yield what tells whether there was one.

    Compiled libraries turn that exception into one of their own, or lose it: in their imports, callbacks and destructors. Where it is lost
    Python would print a traceback.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler or threading.current_thread() is not threading.main_thread():
        yield lambda: False  # it is ignored, as behind nohup, or somebody else's
        return
    seen: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        seen.append(number)
        signal.default_int_handler(number, frame)

    tell = sys.unraisablehook

    def tell_others(lost: sys.UnraisableHookArgs) -> None:
        if not isinstance(lost.exc_value, KeyboardInterrupt):
            tell(lost)

    signal.signal(signal.SIGINT, note)
    sys.unraisablehook = tell_others
    try:
        yield lambda: bool(seen)
    finally:
        sys.unraisablehook = tell
        signal.signal(signal.SIGINT, signal.default_int_handler)


def give_matplotlib_a_folder() -> None:
    """Name a temporary folder for Matplotlib's files where its usual ones cannot be written; one that the user has named stays."""
    os.environ.pop("MPLBACKEND", None)  # for windows: files need none, and one that is not installed here ends the import
    if "MPLCONFIGDIR" in os.environ or sys.platform == "win32":
        return
    with suppress(RuntimeError):  # no HOME, and no entry in the list of users
        home, usual = Path.home(), (("XDG_CONFIG_HOME", ".config"), ("XDG_CACHE_HOME", ".cache"))
        if all(_is_writable(Path(os.environ.get(name) or home / below)) for name, below in usual):
            return
    from hdvplan.process import temporary_folder

    folder = temporary_folder("matplotlib")
    if folder is not None:
        os.environ["MPLCONFIGDIR"] = str(folder)


def _is_writable(folder: Path) -> bool:
    """Tell whether ``folder``, or else the lowest one above it that exists, takes new files."""
    there = next(level for level in map(str, (folder, *folder.absolute().parents)) if os.path.isdir(level))  # noqa: PTH112 - the Path may raise
    return os.access(there, os.W_OK) and shutil.disk_usage(there).free >= _CACHE
