"""What a process does first that works for another one: it ends with it, leaves Ctrl-C to it, and prints nothing."""

from __future__ import annotations

import multiprocessing as mp
import os
import signal
import sys
import threading


def serve_parent() -> None:
    """Make this process one that works for the process which started it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent decides
    _end_with_the_parent()
    _silence()


def _end_with_the_parent() -> None:
    """End this process when its parent is gone, however that ended; the thread sleeps until then."""
    parent = mp.parent_process()
    if parent is not None:

        def follow() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=follow, daemon=True).start()


def _silence() -> None:
    """Send what solvers print from C to nowhere: stdout is for the tables."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    for descriptor in (1, 2):
        os.dup2(nowhere, descriptor)
