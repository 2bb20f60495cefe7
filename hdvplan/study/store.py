"""What a study keeps: every cell that ended, in one SQLite file, and in the end one table of all in the study's order.

The tables are GeoParquet 1.1: Parquet with one column of WKB in longitude and latitude, and a piece of JSON that says so to map programs.
"""

from __future__ import annotations

import json
import sqlite3
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from hdvplan.fileio import replaced
from hdvplan.study.cells import COUNT, GEOMETRY, NUMBER, SHAPE, TEXT, TRUTH, Cell, Column, Row, cell_columns, place_columns
from hdvplan.study.engine import UNANSWERED, Done

CELLS, PLACES, KEPT, DAMAGED = "cells.parquet", "places.parquet", "kept.sqlite", "kept.damaged.sqlite"
_TABLE = "CREATE TABLE IF NOT EXISTS cells (key TEXT PRIMARY KEY, answered INTEGER NOT NULL, content BLOB NOT NULL)"
_PATIENCE_S = 60.0  # for another process that writes into the same file
_BLOCK = 4096  # cells of the final table in memory
LINES, POINTS = "LineString", "Point"
_TYPES = {TEXT: pa.string(), NUMBER: pa.float64(), COUNT: pa.int64(), TRUTH: pa.bool_(), SHAPE: pa.binary()}
_PACKING = "zstd"


class Store:
    """The cells that ended, by their keys, the last of each: what is added is on disk, and stays there whatever ends the process."""

    def __init__(self, folder: Path, on_damage: Callable[[str], None]) -> None:
        """Open the file, or make it.

        A damaged file is moved aside, and cells whose content is damaged are forgotten; ``on_damage`` receives a line about either.

        Raises:
            OSError: it cannot be read or written.

        """
        self._path = folder / KEPT
        try:
            forgotten = self._open()
        except sqlite3.DatabaseError as error:
            self._path.replace(folder / DAMAGED)
            (folder / f"{KEPT}-journal").unlink(missing_ok=True)  # SQLite would take it for one of the new file
            on_damage(f"{self._path} cannot be read: {error}; moved to {folder / DAMAGED}, and what it held is planned again")
            forgotten = self._open()
        if forgotten:
            on_damage(f"{self._path} has damaged cells: {forgotten}, which are planned again")

    def _open(self) -> int:
        """Open the file and forget damaged cells; return how many."""
        with self._told():
            self._file = sqlite3.connect(self._path, timeout=_PATIENCE_S)
            try:
                self._file.execute(_TABLE)
                _refuse_damaged(self._file)
                kept = self._file.execute("SELECT rowid, content FROM cells")
                damaged = [(row,) for row, content in kept if not _is_sound(content)]
                with self._file:
                    self._file.executemany("DELETE FROM cells WHERE rowid = ?", damaged)
            except BaseException:
                self.close()
                raise
        return len(damaged)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def add(self, done: Done) -> None:
        """Keep a cell.

        Raises:
            OSError: it cannot be written.

        """
        outcome = done.outcome
        content = [outcome.row | {"parallel_attempts": done.attempts}, outcome.places]
        packed = zlib.compress(json.dumps(content, default=_plain).encode())
        with self._told(), self._file:
            row = done.cell.key, outcome.ending not in UNANSWERED, packed
            self._file.execute("INSERT OR REPLACE INTO cells VALUES (?, ?, ?)", row)

    def has_answer(self, key: str) -> bool:
        """Tell whether the cell of a key ended with an answer."""
        with self._told():
            return self._file.execute("SELECT 1 FROM cells WHERE key = ? AND answered", (key,)).fetchone() is not None

    def rows(self, cell: Cell) -> tuple[list[Row], list[Row]]:
        """Return what is kept of a cell as rows of ``cells.parquet`` and of ``places.parquet``; none where it is not kept."""
        with self._told():
            found = self._file.execute("SELECT content FROM cells WHERE key = ?", (cell.key,)).fetchone()
        if found is None:
            return [], []
        row, places = json.loads(zlib.decompress(found[0]), object_hook=_with_shape)
        coordinates = cell.coordinates()
        return [coordinates | row], [coordinates | place for place in places]

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Say what the system refuses in the block: a full disk, a file that may not be written."""
        try:
            yield
        except sqlite3.OperationalError as error:
            msg = f"{self._path}: {error}"
            raise OSError(msg) from error


def _refuse_damaged(file: sqlite3.Connection) -> None:
    """Refuse a file that SQLite finds damaged: its index is otherwise read only where keys are looked for."""
    (found,) = file.execute("PRAGMA integrity_check(1)").fetchone()
    if found != "ok":
        raise sqlite3.DatabaseError(found)


def _is_sound(content: Any) -> bool:  # noqa: ANN401 - a damaged file may hold anything
    """Tell whether a cell's content is as it was written, which its checksum says."""
    try:
        zlib.decompress(content)
    except (zlib.error, TypeError):
        return False
    return True


def _plain(value: Any) -> object:  # noqa: ANN401 - whatever JSON does not know
    """Return WKB as hexadecimal text, and a number of NumPy's as Python's."""
    return value.hex() if isinstance(value, bytes) else value.item()


def _with_shape(row: Row) -> Row:
    shape = row.get(GEOMETRY.name)
    return row | {GEOMETRY.name: bytes.fromhex(shape)} if isinstance(shape, str) else row


def write_whole(folder: Path, varied: tuple[str, ...], store: Store, cells: Iterable[Cell]) -> None:
    """Write ``cells.parquet`` and ``places.parquet``: the kept rows of ``cells``, in their order, some in memory at a time.

    Raises:
        OSError: a file cannot be written, or the store not be read.

    """
    following = iter(cells)
    with (
        table_file(folder / CELLS, schema_of(cell_columns(varied), LINES)) as write_cells,
        table_file(folder / PLACES, schema_of(place_columns(varied), POINTS)) as write_places,
    ):
        while block := list(islice(following, _BLOCK)):
            kept = [store.rows(cell) for cell in block]
            write_cells([row for rows, _ in kept for row in rows])
            write_places([place for _, places in kept for place in places])
    pa.default_memory_pool().release_unused()  # ranking and map have use for it


@contextmanager
def table_file(path: Path, schema: pa.Schema) -> Iterator[Callable[[Sequence[Row]], None]]:
    """Provide what writes rows into a file, which appears whole at the end of the block or not at all; what a row has not is empty.

    Raises:
        OSError: it cannot be written.

    """
    with replaced(path) as file, pq.ParquetWriter(file, schema, compression=_PACKING) as writer:

        def write(rows: Sequence[Row]) -> None:
            if rows:
                writer.write_table(pa.Table.from_pylist(rows, schema=schema))

        yield write


def schema_of(columns: Sequence[Column], shape: str) -> pa.Schema:
    """Return the schema of a table whose geometries are of one kind, ``LINES`` or ``POINTS``."""
    about = {
        "version": "1.1.0",
        "primary_column": GEOMETRY.name,
        "columns": {GEOMETRY.name: {"encoding": "WKB", "geometry_types": [shape]}},  # without a crs: longitude, latitude of WGS 84
    }
    fields = [pa.field(column.name, _TYPES[column.kind]) for column in columns]
    return pa.schema(fields, metadata={"geo": json.dumps(about)})
