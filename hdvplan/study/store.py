"""What a study keeps: parts with the cells that ended, which are never changed, and in the end one table of all in the study's order.

All are GeoParquet 1.1: Parquet with one column of WKB in longitude and latitude, and a piece of JSON that says so to map programs.
"""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from itertools import islice
from pathlib import Path
from time import time_ns
from typing import Self

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from hdvplan.arrays import IntArray
from hdvplan.errors import OptionError
from hdvplan.fileio import replaced
from hdvplan.study.cells import COUNT, GEOMETRY, NUMBER, SHAPE, TEXT, TRUTH, Column, Row, cell_columns, place_columns
from hdvplan.study.engine import UNANSWERED, Done

CELLS, PLACES, PARTS, DAMAGED = "cells.parquet", "places.parquet", "parts", "damaged"
_KEY = "S32"  # a key as an array's entry
_EVERY_S, _EVERY_ROWS = 10.0, 1024  # a part is written after so long, or with so many cells
_BLOCK = 4096  # cells of the final table that are put in order at a time
LINES, POINTS = "LineString", "Point"
_TYPES = {TEXT: pa.string(), NUMBER: pa.float64(), COUNT: pa.int64(), TRUTH: pa.bool_(), SHAPE: pa.binary()}
_PACKING = "zstd"
_OPEN = 4  # parts that are kept in memory meanwhile


@dataclass(frozen=True)
class Folder:
    """A study's folder, and the schemas of its tables."""

    path: Path
    varied: tuple[str, ...]

    @cached_property
    def cells(self) -> pa.Schema:
        """Of ``cells.parquet``."""
        return schema_of(cell_columns(self.varied), LINES)

    @cached_property
    def places(self) -> pa.Schema:
        """Of ``places.parquet``."""
        return schema_of(place_columns(self.varied), POINTS)

    def part(self, kind: str, name: str) -> Path:
        """Return where a part of ``cells`` or ``places`` is."""
        return self.path / PARTS / kind / f"{name}.parquet"

    def parts(self) -> list[str]:
        """Return the names of the parts, oldest first."""
        return sorted(file.stem for file in (self.path / PARTS / "cells").glob("*.parquet") if not file.name.startswith("."))


@dataclass(frozen=True)
class Kept:
    """In which part the row of every key is: of several the last; 40 bytes a cell."""

    parts: tuple[str, ...]
    keys: NDArray[np.bytes_]  # sorted
    part: IntArray
    answered: NDArray[np.bool_]

    def find(self, keys: Sequence[str]) -> IntArray:
        """Return the places of keys in the arrays, shape (len(keys),); -1 for one that is not kept."""
        wanted = np.array(keys, dtype=_KEY)
        if not len(self.keys):
            return np.full(len(wanted), -1, dtype=np.intp)
        at = np.minimum(np.searchsorted(self.keys, wanted), len(self.keys) - 1)
        found: IntArray = np.where(self.keys[at] == wanted, at, -1)
        return found


class DamagedPartError(OptionError):
    """A part whose content is none of a study; ``part`` is its name, without the ending."""

    def __init__(self, path: Path, error: Exception) -> None:
        super().__init__(f"{path} cannot be read: {error}")
        self.path, self.part = path, path.stem


def set_aside(folder: Folder, name: str) -> Path:
    """Move both files of a part to where nothing reads them, and return that folder: its cells have no answer then.

    Raises:
        OSError: they cannot be moved.

    """
    aside = folder.path / PARTS / DAMAGED
    aside.mkdir(exist_ok=True)
    for kind in ("cells", "places"):  # without its cells nothing looks for a part
        with suppress(FileNotFoundError):
            folder.part(kind, name).replace(aside / f"{kind}-{name}.parquet")
    return aside


def kept_in(folder: Folder) -> Kept:
    """Return what the parts in a folder hold.

    Raises:
        DamagedPartError: a part is damaged.
        OSError: one cannot be read for another reason.

    """
    names = tuple(folder.parts())
    keys, parts, answered = [np.empty(0, _KEY)], [np.empty(0, np.intp)], [np.empty(0, bool)]
    for number, name in enumerate(names):
        path = folder.part("cells", name)
        try:
            table = pq.ParquetFile(path).read(["key", "outcome"])
            keys.append(np.array(table["key"].to_pylist(), dtype=_KEY))
            answered.append(np.array([outcome not in UNANSWERED for outcome in table["outcome"].to_pylist()], dtype=bool))
        except (OSError, pa.ArrowException, LookupError, TypeError, ValueError) as error:  # a damaged table may hold anything
            raise _reason(path, error) from error
        parts.append(np.full(len(table), number, dtype=np.intp))
    every = np.concatenate(keys)[::-1]  # the last is the first of its kind
    unique, first = np.unique(every, return_index=True)
    at = len(every) - 1 - first
    return Kept(names, unique, np.concatenate(parts)[at], np.concatenate(answered)[at])


class Writer:
    """Writes cells that ended as parts, some at a time; use it in a ``with`` block, which writes the rest whatever ends it.

    A thread does so every ten seconds: the next cell may take half an hour.
    """

    def __init__(self, folder: Folder) -> None:
        """Prepare; the first part makes the folders."""
        self._folder, self._writing, self._over = folder, threading.Lock(), threading.Event()
        self._cells: list[Row] = []
        self._places: list[Row] = []
        self._failed: OSError | None = None

    def __enter__(self) -> Self:
        """Begin to write."""
        threading.Thread(target=self._flush_often, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        """Write what is left."""
        self._over.set()
        self.flush()

    def add(self, done: Done) -> None:
        """Take a cell; it is on disk ten seconds later, or when there are many.

        Raises:
            OSError: a part cannot be written.

        """
        if self._failed is not None:
            raise self._failed
        coordinates = done.cell.coordinates()
        with self._writing:
            # Places first: an interruption must not leave a cell without them.
            self._places += [coordinates | place for place in done.outcome.places]
            self._cells.append(coordinates | done.outcome.row | {"parallel_attempts": done.attempts})
        if len(self._cells) >= _EVERY_ROWS:
            self.flush()

    def flush(self) -> None:
        """Write what was taken since the last part; its cells come last: with them the part is there.

        Raises:
            OSError: the part cannot be written.

        """
        with self._writing:
            if not self._cells:
                return
            name = f"{time_ns()}-{os.getpid()}"  # 19 digits: names sort by age
            for kind, rows, schema in (("places", self._places, self._folder.places), ("cells", self._cells, self._folder.cells)):
                path = self._folder.part(kind, name)
                path.parent.mkdir(parents=True, exist_ok=True)
                write_rows(path, rows, schema)
            self._cells, self._places = [], []

    def _flush_often(self) -> None:
        """Write now and then; the next cell tells what went wrong."""
        while not self._over.wait(_EVERY_S):
            try:
                self.flush()
            except OSError as error:
                self._failed = error


def write_whole(folder: Folder, keys: Iterable[str]) -> None:
    """Write ``cells.parquet`` and ``places.parquet``: the kept rows of ``keys``, in their order.

    What is in memory does not grow with the study, but for ``Kept``.

    Raises:
        DamagedPartError: a part is damaged.
        OSError: a file cannot be written, or a part not be read for another reason.

    """
    kept = kept_in(folder)
    following = iter(keys)
    blocks = [kept.find(block) for block in iter(lambda: list(islice(following, _BLOCK)), [])]
    blocks = [block[block >= 0] for block in blocks]
    for kind, name, schema in (("places", PLACES, folder.places), ("cells", CELLS, folder.cells)):
        read = lru_cache(maxsize=_OPEN)(partial(_part, folder, kind, schema))
        with replaced(folder.path / name) as file, pq.ParquetWriter(file, schema, compression=_PACKING) as writer:
            for table in _in_order(kept, blocks, read):
                writer.write_table(table)
    pa.default_memory_pool().release_unused()  # ranking and map have use for it


def _in_order(kept: Kept, blocks: Sequence[IntArray], read: Callable[[str], pa.Table]) -> Iterator[pa.Table]:
    """Yield the rows of every block of cells, in the cells' order; ``read`` gives a part's table by its name."""
    for block in blocks:
        tables, ranks = [], []
        for number in np.unique(kept.part[block]):
            mine = np.flatnonzero(kept.part[block] == number)
            table, keys = read(kept.parts[int(number)]), pa.array(kept.keys[block[mine]].astype(str))
            of = pc.index_in(table["key"], value_set=keys).combine_chunks()
            tables.append(table.filter(pc.is_valid(of)))
            ranks.append(mine[np.asarray(of.drop_null(), dtype=np.intp)])
        if tables:
            yield pa.concat_tables(tables).take(np.argsort(np.concatenate(ranks), kind="stable")).combine_chunks()


def schema_of(columns: Sequence[Column], shape: str) -> pa.Schema:
    """Return the schema of a table whose geometries are of one kind, ``LINES`` or ``POINTS``."""
    about = {
        "version": "1.1.0",
        "primary_column": GEOMETRY.name,
        "columns": {GEOMETRY.name: {"encoding": "WKB", "geometry_types": [shape]}},  # without a crs: longitude, latitude of WGS 84
    }
    fields = [pa.field(column.name, _TYPES[column.kind]) for column in columns]
    return pa.schema(fields, metadata={"geo": json.dumps(about)})


def write_rows(path: Path, rows: Sequence[Row], schema: pa.Schema) -> None:
    """Write rows as a file that appears whole or not at all; a column that a row has not is empty.

    Raises:
        OSError: it cannot be written.

    """
    with replaced(path) as file:
        pq.write_table(pa.Table.from_pylist(list(rows), schema=schema), file, compression=_PACKING)


def _part(folder: Folder, kind: str, schema: pa.Schema, name: str) -> pa.Table:
    """Return a part's table with the columns of ``schema``; those that it has not are empty."""
    path = folder.part(kind, name)
    try:
        table = pq.ParquetFile(path).read()
        there = set(table.column_names)
        arrays = [
            table.column(field.name).cast(field.type) if field.name in there else pa.nulls(len(table), field.type) for field in schema
        ]
    except (OSError, pa.ArrowException, LookupError, ValueError) as error:
        raise _reason(path, error) from error
    return pa.table(arrays, schema=schema)


def _reason(path: Path, error: Exception) -> Exception:
    """Return why a part cannot be read: the system's own reason, or damage. That one of its files is gone is damage too."""
    of_the_system = isinstance(error, OSError) and error.errno is not None and not isinstance(error, FileNotFoundError)
    return error if of_the_system else DamagedPartError(path, error)
