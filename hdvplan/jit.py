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
from time import perf_counter
from typing import Any, TypeAlias, TypeVar, cast
from uuid import uuid4

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
    import numba  # noqa: PLC0415 - modules that only name the types below must load without it

    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(_PACKAGE.rglob("*.py")):
        text = source.read_bytes()
        if any(b"\n@" + name in text for name in (b"compiled", b"inlined", b"inner")):
            digest.update(text)
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "hdvplan" / digest.hexdigest()[:16]


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
    """Compile with a cache of our own.

    Numba reads its cache directory when a function is decorated: it is put back at once, so that other users of numba in the process
    keep theirs.
    """
    import numba  # noqa: PLC0415 - as above

    former = numba.config.CACHE_DIR  # type: ignore[attr-defined] # numba fills its configuration at run time
    numba.config.CACHE_DIR = str(cache_directory())  # type: ignore[attr-defined]
    try:
        njit = cast("Any", numba.njit)  # numba's stubs do not know that wrappers can be left out
        compiler = njit(
            cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, forceinline=forceinline,
            no_cfunc_wrapper=True, no_cpython_wrapper=no_cpython_wrapper,
        )  # fmt: skip
        kernel = compiler(function)
    finally:
        numba.config.CACHE_DIR = former  # type: ignore[attr-defined]
    _name_apart(kernel._cache._cache_file)  # noqa: SLF001 - numba has no public way to it
    return cast("Function", kernel)


def _name_apart(cache_file: Any) -> None:  # noqa: ANN401 - numba has no types
    """Let every overload be saved under a name of its own.

    Numba numbers them. Two processes that compile one kernel for different records at the same time would take the same number, and
    from then on the one's index could lead to the other's code, which reads the records in a wrong layout.
    """
    stem = cache_file._index_name.removesuffix(".nbi")  # noqa: SLF001 - as above
    cache_file._data_name = lambda _number: f"{stem}.{uuid4().hex}.nbc"  # noqa: SLF001


def load(kernel: Callable[..., object], *arguments: object) -> float:
    """Compile a kernel for such arguments, or load what an earlier run has compiled, without calling it; return the time it took [s]."""
    import numba  # noqa: PLC0415 - as above

    started = perf_counter()
    cast("Any", kernel).compile(tuple(map(numba.typeof, arguments)))
    return perf_counter() - started


def is_compiled() -> bool:
    """Tell whether an earlier run has left the planner's compiled kernels, i.e. whether planning starts at once."""
    return any(cache_directory().glob("**/dynamics.linearise_dynamics-*.nbi"))
