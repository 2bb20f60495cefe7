"""How programs that ``hdvplan bench --export-qps`` has written are read, each format in a few lines to take over."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp


def names(directory: Path) -> Iterator[tuple[str, str]]:
    """Yield sequence and name of every program, in the order in which planning asked for them."""
    for sequence in json.loads((directory / "manifest.json").read_text(encoding="utf-8"))["sequences"]:
        for program in sequence["programs"]:
            yield sequence["name"], program["name"]


def from_parquet(directory: Path, sequence: str) -> Iterator[dict[Any, Any]]:
    """Yield the programs of a sequence in the format ``qpbenchmark``: arrays by their names, matrices dense."""
    import pandas as pd  # noqa: PLC0415 - the other formats are read without

    for row in pd.read_parquet(directory / f"{sequence}.parquet").to_dict("records"):
        yield {**row, **{name: np.reshape(row[name], (-1, len(row["q"]))) for name in "PGA"}}


def from_npz(directory: Path, sequence: str, name: str) -> dict[str, Any]:
    """Return a program in the format ``npz``: arrays by their names, matrices sparse."""
    with np.load(directory / sequence / f"{name}.npz") as file:
        found: dict[str, Any] = dict(file)
    for matrix, rows in (("P", "q"), ("G", "h"), ("A", "b")):
        parts = tuple(found.pop(f"{matrix}_{part}") for part in ("data", "indices", "indptr"))
        found[matrix] = sp.csc_matrix(parts, shape=(len(found[rows]), len(found["q"])))
    return found


def from_acados(directory: Path, sequence: str, name: str) -> tuple[dict[str, list[np.ndarray[Any, Any]]], dict[str, Any]]:
    """Return a program in the format ``acados``, of every field the stages' arrays, and its solution."""
    folder = directory / sequence / name
    fields: dict[str, list[np.ndarray[Any, Any]]] = {}
    for key, values in sorted(json.loads((folder / f"{name}.json").read_text(encoding="utf-8")).items()):
        fields.setdefault(key.rpartition("_")[0], []).append(np.array(values))
    return fields, json.loads((folder / f"{name}_ref_sol.json").read_text(encoding="utf-8"))
