"""Smoothed roads on disk, for all processes of this user: smoothing one takes longer than planning along it, and many cells share it."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import TypeVar

from hdvplan.fileio import write_atomically
from hdvplan.temporary import temporary_folder

Thing = TypeVar("Thing")
KEPT = 64  # files, the newest; a road of 10 km takes some megabytes
_folder = cache(temporary_folder)  # one that nobody else can write to: what is in it runs as code


def spooled(name: str, make: Callable[[], Thing]) -> Thing:
    """Return what is kept under a name, which tells the content, or else what ``make`` returns, which is then kept."""
    folder = _folder("roads")
    if folder is None:
        return make()
    path = folder / f"{sha256(name.encode()).hexdigest()[:32]}.pickle"
    with suppress(Exception):  # none is there, or a crash of the machine left half of one: the next one replaces it
        found: Thing = pickle.loads(path.read_bytes())  # noqa: S301 - see ``_folder``
        return found
    made = make()
    with suppress(OSError):  # a full disk only costs time
        write_atomically(path, pickle.dumps(made))
        for old in sorted(folder.glob("*.pickle"), key=_written)[:-KEPT]:
            old.unlink(missing_ok=True)
    return made


def _written(path: Path) -> float:
    """Return when a file was written; one that another process has removed counts as old."""
    try:
        return path.stat().st_mtime
    except FileNotFoundError:
        return 0.0
