"""Records and arrays of the core as constants in C."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hdvplan.arrays import FloatArray, IntArray, Records
from hdvplan.core import ADDRESS

_WIDTH = 110  # of a line of numbers
_TYPES = {"f": "double", "i": "int64_t"}


def number(value: Any) -> str:  # noqa: ANN401 - a number of Python or NumPy
    """Return a number, or an array of them, as C reads it: a float to its last bit."""
    if isinstance(value, np.ndarray):
        return "{" + ", ".join(map(number, value)) + "}"
    if isinstance(value, int | np.integer):
        return f"{value}" if abs(int(value)) < np.iinfo(np.int64).max else "INT64_MAX"
    text = repr(float(value))
    return {"inf": "INFINITY", "-inf": "-INFINITY", "nan": "NAN"}.get(text, text)


def record(values: np.void | Records, addresses: dict[str, str] | None = None) -> str:
    """Return the initialiser of a record: its numbers by name, and those addresses that are given; others stay null."""
    one: Any = values[0] if values.shape else values
    names = one.dtype.names or ()
    given = addresses or {}
    fields = [f".{name} = {given[name] if name in given else number(one[name])}" for name in names if _is_told(one, name, given)]
    return "{" + (", ".join(fields) or "0") + "}"


def _is_told(one: Any, name: str, given: dict[str, str]) -> bool:  # noqa: ANN401 - a record
    kind = one.dtype[name].base
    return name in given or (kind.names is None and kind != ADDRESS and bool(np.any(one[name] != 0)))


def array(name: str, values: FloatArray | IntArray | Records, kind: str = "") -> str:
    """Return the definition of an array of numbers, or of records of the struct ``kind``; at least of one entry, which C needs."""
    flat: NDArray[Any] = np.ascontiguousarray(values).reshape(-1)
    entries = [record(one) if kind else number(one) for one in flat]
    declared = f"struct {kind}" if kind else _TYPES[flat.dtype.kind]
    return f"const {declared} {name}[{max(len(entries), 1)}] = {{\n{_lines(entries or ['0'])}}};\n"


def _lines(entries: Iterable[str]) -> str:
    """Return entries in lines of some width."""
    lines, line = [], ""
    for entry in entries:
        if line and len(line) + len(entry) > _WIDTH:
            lines.append(line)
            line = ""
        line += f"{entry}, "
    return "".join(f"    {line.rstrip()}\n" for line in [*lines, line])
