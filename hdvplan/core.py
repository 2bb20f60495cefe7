"""The compiled core: loads the library built from ``hdvplan/core`` and declares its functions and records.

It has ctypes; besides, only solvers in others' libraries have.

Who makes a record of arrays checks their kind and sizes then, once, keeps the arrays, and hands their addresses to every call.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import sys
from collections.abc import Callable
from itertools import takewhile
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from hdvplan.errors import HdvplanError

INT, REAL, POINTER = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
ADDRESS = np.uintp  # of a pointer in a record
_KINDS: dict[str, Any] = {"f": np.float64, "i": np.int64, "p": ADDRESS}  # as layout.c has them

_FOLDER = Path(__file__).parent
_SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
_HINT = (
    "build it again: `pip install -e .` in a checkout, which Python takes before an installed hdvplan if it is started there; "
    "else `pip install --force-reinstall --no-deps hdvplan`"
)


class CoreError(HdvplanError):
    """The compiled core is missing, cannot be loaded, or was built from other sources."""

    def __init__(self, message: str) -> None:
        super().__init__(message, hint=_HINT)


class _LayoutRow(ctypes.Structure):
    """``struct hdv_layout`` of layout.c."""

    _fields_ = tuple(zip(("record", "field", "kind", "offset", "size", "value"), (ctypes.c_char_p,) * 3 + (INT, INT, REAL), strict=True))


def load(folder: Path) -> ctypes.CDLL:
    """Return the fastest library in a folder that the processor can run, or the one that ``HDVPLAN_CORE`` names, such as baseline.

    Raises:
        CoreError: it is missing, cannot be loaded, or was built from other sources than those beside it.

    """
    library = _open(folder, os.environ.get("HDVPLAN_CORE") or "baseline")
    if "HDVPLAN_CORE" not in os.environ and library.hdv_has_avx2():
        library = _open(folder, "avx2")
    library.hdv_sources.restype = ctypes.c_char_p
    sources = sorted((folder / "core").glob("*.[ch]"))
    if sources and library.hdv_sources().decode() != hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest():
        msg = "the C core was built from other sources than those in hdvplan/core"
        raise CoreError(msg)
    return library


def _open(folder: Path, name: str) -> ctypes.CDLL:
    path = folder / f"_core_{name}{_SUFFIX}"
    if not path.exists():
        msg = f"the C core is missing: there is no {path}"
        raise CoreError(msg)
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        msg = f"the C core cannot be loaded: {error}"
        raise CoreError(msg) from None


def _layout(library: ctypes.CDLL) -> tuple[dict[str, dict[str, tuple[str, int, int]]], dict[str, float]]:
    """Return kind, offset and size [bytes] of the fields of the core's records, of a record itself under the name ''; and its constants."""
    library.hdv_layout.restype = ctypes.POINTER(_LayoutRow)
    found: dict[str, dict[str, tuple[str, int, int]]] = {}
    constants = {}
    for row in takewhile(lambda row: row.record is not None, library.hdv_layout()):
        if row.kind == b"c":
            constants[row.field.decode()] = row.value
        else:
            found.setdefault(row.record.decode(), {})[row.field.decode()] = row.kind.decode(), row.offset, row.size
    return found, constants


_LIBRARY = load(_FOLDER)
_LAYOUT, _CONSTANTS = _layout(_LIBRARY)


def function(name: str, *arguments: type[Any], returns: type[Any] | None = None, library: ctypes.CDLL | None = None) -> Callable[..., Any]:
    """Return a function of the core, or of another library: ``arguments`` and ``returns`` are of INT, REAL and POINTER.

    Raises:
        CoreError: the core has no such function.
        AttributeError: the other library has none.

    """
    try:
        found = getattr(library or _LIBRARY, name)
    except AttributeError:
        if library is not None:
            raise
        msg = f"the C core has no function {name}"
        raise CoreError(msg) from None
    found.argtypes, found.restype = list(arguments), returns
    return cast("Callable[..., Any]", found)


def record(name: str, **nested: np.dtype[Any]) -> np.dtype[np.void]:
    """Return the dtype of one of the core's records: its numbers and addresses, and what is ``nested`` in it, by the name of its field.

    Raises:
        CoreError: there is no such record, or it would not stand where the core has it.

    """
    rows = _LAYOUT.get(name, {})
    dtype = np.dtype([(field, nested.get(field, _KINDS[kind])) for field, (kind, _, _) in rows.items() if field])
    ours = {field: (kind[1], kind[0].itemsize) for field, kind in (dtype.fields or {}).items()} | {"": (0, dtype.itemsize)}
    if not rows or ours != {field: (offset, size) for field, (_, offset, size) in rows.items()}:
        msg = f"the C core has no record {name} of such fields"
        raise CoreError(msg)
    return dtype


def constant(name: str) -> float:
    """Return a constant of the core, such as HDV_CLEAR_M.

    Raises:
        CoreError: the core has no such constant.

    """
    if name not in _CONSTANTS:
        msg = f"the C core has no constant {name}"
        raise CoreError(msg)
    return _CONSTANTS[name]


def number(name: str) -> int:
    """Return a constant of the core that counts or numbers something; see ``constant``."""
    return int(constant(name))


def address(array: NDArray[Any], kind: np.dtype[Any] | type[Any] | None = None, shape: tuple[int, ...] | None = None) -> int:
    """Return where an array's numbers begin. Whoever keeps the address keeps the array, too.

    Raises:
        ValueError: it is not contiguous, or not of the kind and shape that the core will take it for, where these are given.

    """
    if not array.flags.c_contiguous or (kind is not None and array.dtype != kind) or (shape is not None and array.shape != shape):
        msg = f"not a contiguous array of {kind or 'any kind'}, {shape or 'any shape'}: {array.dtype}, {array.shape}, {array.strides}"
        raise ValueError(msg)
    return int(array.ctypes.data)


def callback(function: Callable[..., Any], *arguments: type[Any], returns: type[Any]) -> Callable[..., Any]:
    """Return a function that the core can call. It must not raise, and whoever hands it to the core keeps it."""
    return cast("Callable[..., Any]", ctypes.CFUNCTYPE(returns, *arguments)(function))


def entry(function: Callable[..., Any]) -> int:
    """Return where a function of the core, or a callback, begins, for records that hold it."""
    return ctypes.cast(cast("Any", function), POINTER).value or 0
