"""Where the process begins: next to nothing is imported here, so that Ctrl-C is answered from the first moment."""

from __future__ import annotations

import atexit
import gc
import os
import signal
import sys

_COLLECTED = 300_000  # new objects from which Python looks for dead ones: 700, its own, lets it go through all imports again and again
_OWN = ":"  # in FILE.py:NAME and MODULE:NAME, a solver or objective of one's own
_STREAMS = (("stdin", "r"), ("stdout", "w"), ("stderr", "w"))


def main() -> None:
    """Run the command line of this process and exit with its code."""
    code, theirs = 130, False  # interrupted, as shells report it
    try:
        open_streams()
        if "--json" in sys.argv:
            keep_stdout_clean()
        gc.set_threshold(_COLLECTED)
        from hdvplan.cli.app import run_process
        from hdvplan.cli.console import ExitCode

        if any(_OWN in argument for argument in sys.argv):
            from hdvplan.process import fail_at_exit

            theirs = fail_at_exit(ExitCode.INTERNAL)
        try:
            code = run_process()
        except SystemExit as ended:  # by a signal
            code = int(ended.code or 0)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is said and written
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        sys.stderr.write("error: interrupted\n")
    gc.disable()  # the process ends: its memory is given back as a whole
    if theirs:
        atexit._run_exitfuncs()  # noqa: SLF001 - all that `os._exit` leaves out
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)


def keep_stdout_clean() -> None:
    """Let what a solver or planner of one's own prints, or its native library, go to stderr: on stdout nothing but JSON may be."""
    sys.stdout.flush()
    sys.__stdout__ = os.fdopen(os.dup(1), "w", encoding=sys.stdout.encoding)  # type: ignore[misc] # where print_json writes then
    os.dup2(2, 1)
    sys.stdout = sys.stderr


def open_streams() -> None:
    """Let the standard streams that the caller has closed lead nowhere: else the next file that is opened would take the place of one."""
    for name, mode in _STREAMS:
        if getattr(sys, name) is None:
            nowhere = os.open(os.devnull, os.O_RDWR)  # the lowest number that is free is this stream's own
            os.set_inheritable(nowhere, True)  # for the processes that are started, too
            setattr(sys, name, os.fdopen(nowhere, mode))
