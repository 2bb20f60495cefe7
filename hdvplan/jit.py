"""Compile the small numeric kernels once and keep the machine code between runs.

Numba keys its on-disk cache on the file of the *calling* function only, so a changed callee in another file would be
served stale. The cache folder therefore carries a digest of all of hdvplan's kernel sources: any edit or upgrade
gets an empty cache, and a read-only installation is no obstacle (``cachefolders.py``, ``kernelcache.py``).

Kernels take numpy structured arrays as records with named columns (``units[u].wheelbase``): one array costs one argument, and sizes
that stand in its dtype are constants to the compiler. Called as plain Python (``.py_func``) they need ``np.recarray`` views.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from hdvplan.cachefolders import CacheFolders, find_folders

Function = TypeVar("Function", bound=Callable[..., object])
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Records = NDArray[np.void]  # a structured array; every module that makes one names its columns
Record: TypeAlias = Any  # one element of it: NumPy's types know no columns

_PACKAGE = Path(__file__).parent


@cache
def cache_folders() -> CacheFolders:
    """Return where compiled kernels of exactly this source and numba version are kept."""
    import numba  # noqa: PLC0415 - modules that only name the types below must load without it

    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(_PACKAGE.rglob("*.py")):
        text = source.read_bytes()
        if any(b"\n@" + name in text for name in (b"compiled", b"inlined", b"inner")):
            digest.update(text)
    return find_folders(digest.hexdigest()[:16])


def compiled(function: Function) -> Function:
    """Compile a kernel at its first call and cache it on disk; ``.py_func`` remains the plain Python twin.

    Kernels release the GIL.
    """
    return _compile(function)


def inlined(function: Function) -> Function:
    """Compile a kernel into each of its callers: a call that passes arrays on costs 50 ns."""
    return _compile(function, forceinline=True)


def inner(function: Function) -> Function:
    """Compile a kernel into each of its callers, which are kernels: without a way in from Python it compiles a fifth faster."""
    return _compile(function, forceinline=True, no_cpython_wrapper=True)


def _compile(function: Function, *, forceinline: bool = False, no_cpython_wrapper: bool = False) -> Function:
    """Compile with a cache of our own: numba's gives up, or stops, where a folder cannot be written."""
    import numba  # noqa: PLC0415 - as above

    from hdvplan.kernelcache import KernelCache  # noqa: PLC0415 - it imports numba

    njit = cast("Any", numba.njit)  # numba's stubs do not know that wrappers can be left out
    compiler = njit(
        nogil=True, error_model="numpy", fastmath={"contract"}, forceinline=forceinline,
        no_cfunc_wrapper=True, no_cpython_wrapper=no_cpython_wrapper,
    )  # fmt: skip
    kernel = compiler(function)
    kernel._cache = KernelCache(function, cache_folders())  # noqa: SLF001 - numba has no public way to it
    return cast("Function", kernel)


def load(kernel: Callable[..., object], *arguments: object) -> float:
    """Compile a kernel for such arguments, or load what an earlier run has compiled, without calling it; return the time it took [s]."""
    import numba  # noqa: PLC0415 - as above

    started = perf_counter()
    cast("Any", kernel).compile(tuple(map(numba.typeof, arguments)))
    return perf_counter() - started


def is_compiled() -> bool:
    """Tell whether an earlier run has left the planner's compiled kernels, i.e. whether planning starts at once."""
    return any(True for folder in cache_folders().read for _ in folder.glob("*/dynamics.linearise_dynamics-*.nbi"))
