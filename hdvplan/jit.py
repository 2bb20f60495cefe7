"""Compile the small numeric kernels once and keep the machine code between runs.

Numba keys its on-disk cache on the file of the *calling* function only, so a changed callee in another file would be
served stale. The cache directory therefore carries a digest of all of hdvplan's kernel sources: any edit or upgrade
gets an empty cache, and a read-only installation is no obstacle.

Kernels take numpy structured arrays as records with named columns (``units[u].wheelbase``): one array costs one argument, and sizes
that stand in its dtype are constants to the compiler. Called as plain Python (``.py_func``) they need ``np.recarray`` views.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

Function = TypeVar("Function", bound=Callable[..., object])
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Records = NDArray[np.void]  # a structured array; every module that makes one names its columns
Record: TypeAlias = Any  # one element of it: NumPy's types know no columns

_PACKAGE = Path(__file__).parent


@cache
def cache_directory() -> Path:
    """Return where compiled kernels of exactly this source and numba version are kept."""
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(_PACKAGE.rglob("*.py")):
        text = source.read_bytes()
        if b"\n@compiled" in text:
            digest.update(text)
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "hdvplan" / digest.hexdigest()[:16]


def compiled(function: Function) -> Function:
    """Compile a kernel at its first call and cache it on disk; ``.py_func`` remains the plain Python twin.

    Kernels release the GIL. Numba reads its cache directory when a function is decorated: it is put back at once, so that other users
    of numba in the process keep theirs.
    """
    former = numba.config.CACHE_DIR  # type: ignore[attr-defined] # numba fills its configuration at run time
    numba.config.CACHE_DIR = str(cache_directory())  # type: ignore[attr-defined]
    try:
        return cast("Function", numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})(function))
    finally:
        numba.config.CACHE_DIR = former  # type: ignore[attr-defined]


def is_compiled() -> bool:
    """Tell whether an earlier run has left the planner's compiled kernels, i.e. whether planning starts at once."""
    return any(cache_directory().glob("**/dynamics.linearise_dynamics-*.nbi"))
