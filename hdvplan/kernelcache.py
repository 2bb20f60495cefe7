"""Keep the machine code of kernels on disk, in numba's files but in folders of our own choice: a failing disk costs time, never a plan."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any
from uuid import uuid4

from numba.core.caching import IndexDataCacheFile, _Cache
from numba.core.compiler import CompileResult

from hdvplan.cachefolders import CacheFolders

_LOG = logging.getLogger("hdvplan")
_LOG.addHandler(logging.NullHandler())  # the library says nothing unless its user listens


class KernelFile(IndexDataCacheFile):
    """One kernel's compiled overloads in one folder."""

    def __init__(self, folder: Path, stem: str) -> None:
        super().__init__(str(folder), stem, "")  # the folder's name stands for the source: no stamp
        self._stem = stem

    def _data_name(self, _number: int) -> str:
        """Return a distinct file name for every overload.

        Numba numbers them. Two processes that compile one kernel for different records at the same time would take the same number, and
        from then on the one's index could lead to the other's code, which reads the records in a wrong layout.
        """
        return f"{self._stem}.{uuid4().hex}.nbc"

    def _load_index(self) -> dict[object, str]:
        """Return an empty index where the file is damaged or forbidden: what is saved next replaces it."""
        try:
            return dict(super()._load_index())
        except Exception:  # noqa: BLE001 - unpickling damaged bytes raises anything
            return {}


class KernelCache(_Cache):
    """One kernel's cache, which its dispatcher queries before it compiles, and fills afterwards."""

    def __init__(self, function: Callable[..., object], folders: CacheFolders) -> None:
        code = function.__code__
        source = Path(code.co_filename)
        self._folders = folders
        self._inside = f"{source.parent.name}_{sha256(os.fsencode(source.parent.absolute())).hexdigest()[:16]}"
        version = f"py{sys.version_info[0]}{sys.version_info[1]}{getattr(sys, 'abiflags', '')}"
        self._stem = f"{source.stem}.{code.co_qualname}-{code.co_firstlineno}.{version}"

    @property
    def cache_path(self) -> str | None:
        """Return the folder that new code goes to."""
        return None if self._folders.write is None else str(self._folders.write / self._inside)

    def load_overload(self, signature: object, target: Any) -> object:  # noqa: ANN401 - numba has no types
        """Return the code for a signature from the first folder that has it, or None."""
        target.refresh()
        key = (signature, target.codegen().magic_tuple())
        for folder in self._folders.read:
            try:
                kept = KernelFile(folder / self._inside, self._stem).load(key)
                if kept is not None:
                    return CompileResult._rebuild(target, *kept)  # noqa: SLF001 - as numba's own cache does
            except Exception:  # noqa: BLE001, S112 - damaged bytes raise anything; the kernel compiles then
                continue
        return None

    def save_overload(self, signature: object, compiled: Any) -> None:  # noqa: ANN401 - as above
        """Keep code that was compiled, if it can be, and log once where that is not for good."""
        if self._folders.note:
            _warn(self._folders.note)
        if self._folders.write is None or compiled.library.has_dynamic_globals:
            return
        folder = self._folders.write / self._inside
        try:
            folder.mkdir(mode=0o755, exist_ok=True)
            KernelFile(folder, self._stem).save((signature, compiled.codegen.magic_tuple()), compiled._reduce())  # noqa: SLF001 - as above
        except OSError as error:
            _warn(f"compiled code is not kept ({self._folders.write.parent}: {error.strerror}): the next run compiles again")

    def enable(self) -> None:
        """Do nothing: the cache is always on."""

    def disable(self) -> None:
        """Do nothing, as above."""

    def flush(self) -> None:
        """Forget what is kept of this kernel."""
        if self._folders.write is not None:
            KernelFile(self._folders.write / self._inside, self._stem).flush()


@cache
def _warn(message: str) -> None:
    """Log a message, once a process."""
    _LOG.warning(message)
