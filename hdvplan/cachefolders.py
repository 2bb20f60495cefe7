"""Find a folder for compiled kernels, whoever runs hdvplan and wherever: without a home, from a read-only installation, beside other users.

Numba's files are pickles: whoever writes one runs code in the process that reads it. A folder is therefore used only where nobody but
its user, the system's administrator and the owner of this installation could have written into it.
"""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

_ROOM = 64_000_000  # bytes that one kind of vehicle needs, and as many again
_MODE = 0o755  # nobody else may write, even where the umask would allow it


@dataclass(frozen=True)
class CacheFolders:
    """Where compiled kernels are looked for, and where new ones are kept.

    ``note`` says why these are not kept for good; empty where they are.
    """

    read: tuple[Path, ...]
    write: Path | None
    note: str = ""


def find_folders(name: str) -> CacheFolders:
    """Return the cache folders called ``name``: the first that can be written, those before it that can be read.

    They are looked for in ``NUMBA_CACHE_DIR``, then in ``XDG_CACHE_HOME`` or ``~/.cache``, then where temporary files go.
    """
    read: list[Path] = []
    obstacles: list[str] = []
    for folder in _lasting(name):
        found = obstacle(folder)
        if found is None:
            return CacheFolders((*read, folder), folder)
        obstacles.append(found)
        if _is_trusted(folder):
            read.append(folder)
    reason = "; ".join(obstacles) or "there is no home folder"
    hint = "NUMBA_CACHE_DIR names a folder to keep it in"
    temporary = temporary_folder(name)
    if temporary is None:
        return CacheFolders(tuple(read), None, f"compiled code is not kept ({reason}): every run compiles; {hint}")
    return CacheFolders((*read, temporary), temporary, f"compiled code is kept in {temporary.parent} only ({reason}); {hint}")


def temporary_folder(name: str) -> Path | None:
    """Return this user's folder ``name`` among the temporary files, for all of the user's processes; None without a place for it."""
    with suppress(OSError):
        user = os.geteuid() if hasattr(os, "geteuid") else "user"
        folder = Path(tempfile.gettempdir()).absolute() / f"hdvplan-{user}" / name
        if obstacle(folder) is None:
            return folder
    return None


def obstacle(folder: Path) -> str | None:
    """Make ``folder`` if need be; return what forbids to keep files in it, or None."""
    try:
        for level in (*reversed(folder.parents), folder):
            level.mkdir(mode=_MODE, exist_ok=True)
        free = shutil.disk_usage(folder).free
    except OSError as error:
        return f"{error.filename}: {error.strerror}"
    if not os.access(folder, os.R_OK | os.W_OK | os.X_OK):
        return f"{folder.parent} cannot be written"
    if not _is_trusted(folder):
        return f"{folder.parent} is another user's, or open to all"
    return f"{folder.parent} is full" if free < _ROOM else None


def readable_by_all(folder: Path) -> None:
    """Let every user read ``folder`` and what is in it, whatever the umask was when it was filled."""
    for path in (folder.parent, folder, *folder.rglob("*")):
        path.chmod(_MODE if path.is_dir() else 0o644)


def _lasting(name: str) -> Iterator[Path]:
    """Yield the folders that outlive a restart, by falling precedence."""
    bases = [os.environ.get("NUMBA_CACHE_DIR"), os.environ.get("XDG_CACHE_HOME")]
    if not bases[1]:
        with suppress(RuntimeError):  # no HOME, and no entry in the list of users
            bases.append(str(Path.home() / ".cache"))
    for base in filter(None, bases):
        with suppress(OSError):  # relative to a folder that is gone
            yield Path(base).absolute() / "hdvplan" / name


def _is_trusted(folder: Path) -> bool:
    """Tell whether nobody has filled ``folder``, or put it where it is, who could not change hdvplan itself; False where there is none."""
    if not hasattr(os, "geteuid"):
        return folder.is_dir()  # Windows: each user's folders are closed to others
    owners = {os.geteuid(), 0, Path("/").stat().st_uid, Path(__file__).stat().st_uid}  # in a container root may go by another number
    try:
        named = [level.lstat() for level in (folder, *folder.parents)]  # a link is its owner's, wherever it leads
        real = folder.resolve(strict=True)
        own, *above = (level.stat() for level in (real, *real.parents))
    except OSError:
        return False
    closed = [not state.st_mode & stat.S_IWOTH or state.st_mode & stat.S_ISVTX for state in above]  # sticky: what is there is its owner's
    return all(state.st_uid in owners for state in (*named, own, *above)) and not own.st_mode & stat.S_IWOTH and all(closed)
