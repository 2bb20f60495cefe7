"""Compile the small numeric kernels once and keep the machine code between runs.

Numba keys its on-disk cache on the file of the *calling* function only, so a changed callee in another file would be
served stale. The cache directory therefore carries a digest of all of hdvplan's kernel sources: any edit or upgrade
gets an empty cache, and a read-only installation is no obstacle.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

Function = TypeVar("Function", bound=Callable[..., object])
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

_PACKAGE = Path(__file__).parent


def cache_directory() -> Path:
    """Return where compiled kernels of exactly this source and numba version are kept."""
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(_PACKAGE.rglob("*.py")):
        text = source.read_bytes()
        if b"@compiled" in text:
            digest.update(text)
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "hdvplan" / digest.hexdigest()[:16]


def is_compiled() -> bool:
    """Tell whether an earlier run has left the planner's compiled kernels, i.e. whether planning starts at once."""
    return any(CACHE.glob("**/linearise.linearise-*.nbi"))


def compiled(function: Function) -> Function:
    """Compile a kernel at its first call and cache it on disk; ``.py_func`` remains the plain Python twin."""
    return cast("Function", numba.njit(cache=True, error_model="numpy", fastmath={"contract"})(function))


CACHE = cache_directory()
numba.config.CACHE_DIR = str(CACHE)  # type: ignore[attr-defined] # numba fills its configuration at run time
