"""Let Matplotlib work for users without a home that can be written: otherwise it prints a long warning at every start."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

_ROOM = 4_000_000  # bytes: its list of fonts, and more


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
