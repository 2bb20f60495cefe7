"""Folders that only their user, and the administrator, can write to: what is kept there may run as code."""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
from contextlib import suppress
from pathlib import Path

_ROOM = 64_000_000  # bytes that must be free


def temporary_folder(name: str) -> Path | None:
    """Return this user's folder ``name`` among the temporary files, for all of the user's processes; None without a place for it."""
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
