"""Processes: what one does first that works for another, the signals that end it, and the folders that only its user can write to."""

from __future__ import annotations

import ctypes
import multiprocessing as mp
import os
import shutil
import signal
import stat
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
_ENDED = b"error: the process was ended by C's exit(): by a library of a solver or objective of your own?"
_ROOM = 64_000_000  # bytes that must be free


def serve_parent() -> None:
    """Make this process one that works for the process which started it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent decides
    _end_with_the_parent()
    _silence()


def fail_at_exit(code: int) -> bool:
    """Let C's ``exit`` end this process with ``code`` and a word: native libraries call it, even with 0, the status of an answer.

    Return whether the process itself has to end by ``os._exit`` then.
    """
    if sys.platform == "win32":
        return False
    libc = ctypes.CDLL(None)
    ways = ((libc["_exit"], ctypes.c_void_p(code)), (libc["warnx"], ctypes.c_char_p(_ENDED)))  # called from the last to the first
    return not any(libc["__cxa_atexit"](function, argument, None) for function, argument in ways)


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


class _SignalError(KeyboardInterrupt):
    """A signal that ends a block, with the exit code. Who guards against other people's code lets it through as Ctrl-C, unlike sys.exit."""


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end the block as an exception does, so that it cleans up; the exit code is as shells report it.

    A signal that is ignored stays so, as SIGHUP behind nohup.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def leave(number: int, _: FrameType | None) -> None:
        raise _SignalError(128 + number)

    heard = [number for number in _SIGNALS if number != signal.SIGINT and signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, leave) for number in heard}
    try:
        yield
    except _SignalError as error:
        raise SystemExit(*error.args) from None
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Hold SIGINT, SIGTERM and SIGHUP back until the block has ended."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []
    before = {number: signal.signal(number, lambda number, _: held.append(number)) for number in _SIGNALS}
    try:
        yield
    finally:
        for number in reversed(before):
            signal.signal(number, before[number])
        if held:
            signal.raise_signal(held[0])


def temporary_folder(name: str) -> Path | None:
    """Return this user's folder ``name`` among the temporary files, for all of the user's processes; None without a place for it.

    Only the user, and the administrator, can write to it: what is kept there may run as code.
    """
    with suppress(OSError):
        user = os.geteuid() if hasattr(os, "geteuid") else "user"
        folder = Path(tempfile.gettempdir()).absolute() / f"hdvplan-{user}" / name
        for level in (folder.parent, folder):
            level.mkdir(mode=0o755, exist_ok=True)  # nobody else may write, even where the umask would allow it
        if os.access(folder, os.R_OK | os.W_OK | os.X_OK) and is_closed(folder) and shutil.disk_usage(folder).free >= _ROOM:
            return folder
    return None


def is_closed(folder: Path) -> bool:
    """Tell whether nobody else but the administrator can have filled ``folder``, or put it where it is."""
    if not hasattr(os, "geteuid"):
        return True  # Windows: each user's folders are closed to others
    owners = {os.geteuid(), 0, Path("/").stat().st_uid}  # in a container root may go by another number
    real = folder.resolve(strict=True)
    named = [level.lstat() for level in (folder, *folder.parents)]  # a link is its owner's, wherever it leads
    own, *above = (level.stat() for level in (real, *real.parents))
    closed = [not _is_shared(state, owners) or state.st_mode & stat.S_ISVTX for state in above]  # sticky: what is there is its owner's
    return all(state.st_uid in owners for state in (*named, own, *above)) and not _is_shared(own, owners) and all(closed)


def _is_shared(state: os.stat_result, owners: set[int]) -> bool:
    """Tell whether others may write: all, or a group other than the administrators' and the one that has the user's own number."""
    return bool(state.st_mode & stat.S_IWOTH or (state.st_mode & stat.S_IWGRP and state.st_gid not in owners))
