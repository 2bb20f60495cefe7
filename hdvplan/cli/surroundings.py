"""The process that a command runs in: Ctrl-C at any moment, and a folder for Matplotlib where the user has no home."""

from __future__ import annotations

import os
import shutil
import signal
import sys
import threading
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType

_ROOM = 4_000_000  # bytes: its list of fonts, and more


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
    if "MPLCONFIGDIR" in os.environ or sys.platform == "win32" or _usual_are_writable():
        return
    from hdvplan.temporary import temporary_folder

    folder = temporary_folder("matplotlib")
    if folder is not None:
        os.environ["MPLCONFIGDIR"] = str(folder)


def _usual_are_writable() -> bool:
    try:
        home = Path.home()
    except RuntimeError:  # no HOME, and no entry in the list of users
        return False
    return all(
        _is_writable(Path(os.environ.get(name) or home / below))
        for name, below in (("XDG_CONFIG_HOME", ".config"), ("XDG_CACHE_HOME", ".cache"))
    )


def _is_writable(folder: Path) -> bool:
    """Tell whether ``folder``, or else the lowest one above it that exists, takes new files."""
    there = next(level for level in map(str, (folder, *folder.absolute().parents)) if os.path.isdir(level))  # noqa: PTH112 - the Path may raise
    return os.access(there, os.W_OK) and shutil.disk_usage(there).free >= _ROOM
