"""Where the process begins: next to nothing is imported here, so that Ctrl-C is answered from the first moment."""

from __future__ import annotations

import gc
import os
import signal
import sys

_COLLECTED = 300_000  # new objects from which Python looks for dead ones: 700, its own, lets it go through all imports again and again
_STREAMS = (("stdin", "r"), ("stdout", "w"), ("stderr", "w"))


def main() -> None:
    """Run the command line of this process and exit with its code."""
    code = 130  # interrupted, as shells report it
    try:
        open_streams()
        gc.set_threshold(_COLLECTED)
        from hdvplan.cli.app import run_process

        code = run_process()
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is said and written
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        sys.stderr.write("error: interrupted\n")
    gc.disable()  # the process ends: its memory is given back as a whole
    sys.exit(code)


def open_streams() -> None:
    """Let the standard streams that the caller has closed lead nowhere: else the next file that is opened would take the place of one."""
    for name, mode in _STREAMS:
        if getattr(sys, name) is None:
            nowhere = os.open(os.devnull, os.O_RDWR)  # the lowest number that is free is this stream's own
            os.set_inheritable(nowhere, True)  # for the processes that are started, too
            setattr(sys, name, os.fdopen(nowhere, mode))
