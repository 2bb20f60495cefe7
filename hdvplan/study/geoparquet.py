"""Tables as GeoParquet 1.1: Parquet with one column of WKB in longitude and latitude, and what says so to map programs.

The format asks for no more than this column and a piece of JSON, so pyarrow writes it alone: GeoPandas would bring a second table library.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from hdvplan.errors import OptionError
from hdvplan.fileio import refuse_special, write_atomically
from hdvplan.study.cells import Row
from hdvplan.study.columns import COUNT, GEOMETRY, NUMBER, SHAPE, TEXT, TRUTH, Column

LINES, POINTS = "LineString", "Point"
_TYPES = {TEXT: pa.string(), NUMBER: pa.float64(), COUNT: pa.int64(), TRUTH: pa.bool_(), SHAPE: pa.binary()}
_PACKING = "zstd"


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
    sink = pa.BufferOutputStream()
    pq.write_table(pa.Table.from_pylist(list(rows), schema=schema), sink, compression=_PACKING)
    write_atomically(path, sink.getvalue().to_pybytes())


def write_tables(path: Path, tables: Iterable[pa.Table], schema: pa.Schema) -> None:
    """Write tables behind each other as one file that appears whole or not at all; no more than one of them is in memory.

    Raises:
        OSError: it cannot be written.

    """
    refuse_special(path)
    aside = path.with_name(f".{path.name}.part")
    try:
        aside.unlink(missing_ok=True)
        with aside.open("xb") as file, pq.ParquetWriter(file, schema, compression=_PACKING) as writer:  # never through a link
            for table in tables:
                writer.write_table(table)
        aside.replace(path)
    except BaseException:
        aside.unlink(missing_ok=True)
        raise


def read_part(path: Path, schema: pa.Schema) -> pa.Table:
    """Return a file's table with the columns of ``schema``; those that it has not are empty.

    Raises:
        OptionError: it is damaged, or a column is of another kind.

    """
    try:
        table = pq.ParquetFile(path).read()
        there = set(table.column_names)
        arrays = [
            table.column(field.name).cast(field.type) if field.name in there else pa.nulls(len(table), field.type) for field in schema
        ]
    except (OSError, pa.ArrowException, LookupError) as error:
        msg = f"{path} cannot be read: {error}"
        raise OptionError(msg, hint="delete it: what it held is planned again") from error
    return pa.table(arrays, schema=schema)
