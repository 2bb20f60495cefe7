"""A study's answers as text, and as a workbook for spreadsheets: one sheet of roads by vehicles, and one with a row a cell.

A workbook holds numbers: CSV that is opened in a program set to decimal commas does not.
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pyogrio
from numpy.typing import NDArray

from hdvplan.answers import NEEDS, YES, needs_text, room_text
from hdvplan.fileio import csv_bytes, replaced, write_atomically
from hdvplan.study.cells import GEOMETRY
from hdvplan.texts import no_formula, printable

MOST_CELLS = 10_000  # a workbook is written from memory as a whole
_WIDTHS = ["half_width_m", "left_m", "right_m"]
_PLACE = ["s_m", "lat", "lon", "side", "unit", "part", "obstacle"]
_OPTIONS = ["objective", "scheme", "solver", "offset_m", "reverse", "pass", "settings_clearance"]
_LATER = 1e9  # what counts as lacking where there is no plan


def write_workbook(path: Path, cells: Path, varied: tuple[str, ...]) -> None:
    """Write the workbook of a table of cells; nothing, and none from before stays, where the study is too large for one.

    Raises:
        OSError: it cannot be written.

    """
    file = pq.ParquetFile(cells)
    if not 0 < file.metadata.num_rows <= MOST_CELLS:
        path.unlink(missing_ok=True)
        return
    wanted = ["road", "vehicle", *varied, *_WIDTHS, "word", "spare_m", "tracking_error_m", "verdict_half_width_m", *_PLACE, *_OPTIONS]
    table = file.read([*wanted, "outcome", "reason", "verdict"]).to_pandas()
    table.insert(2, "answer", table.pop("word").fillna(table["outcome"]))
    listed = table.drop(columns=["outcome"]).dropna(axis="columns", how="all")
    with TemporaryDirectory() as folder:
        aside = Path(folder) / "table.xlsx"
        _add(aside, "roads by vehicles", _matrix(table))
        _add(aside, "cells", listed)
        write_atomically(path, aside.read_bytes())


def write_plain(path: Path, cells: Path) -> None:
    """Write a table of cells as text, without shapes; no more than some of it is in memory.

    Raises:
        OSError: it cannot be written.

    """
    file = pq.ParquetFile(cells)
    names = [name for name in file.schema_arrow.names if name != GEOMETRY.name]
    batches = file.iter_batches(MOST_CELLS, columns=names)
    texts = (csv_bytes(batch.to_pandas(types_mapper={pa.int64(): pd.Int64Dtype()}.get)) for batch in batches)
    with replaced(path) as written:
        written.writelines(text.partition(b"\n")[2] if number else text for number, text in enumerate(texts))


def _matrix(table: pd.DataFrame) -> pd.DataFrame:
    """Return one row a road and width, one column a vehicle: the answer of the best cell with the metres to spare, lacking or needed."""
    keys = ["road", *(name for name in _WIDTHS if table[name].notna().any())]
    spare = table["spare_m"].fillna(-table["verdict_half_width_m"]).fillna(-_LATER)
    best = table.assign(_spare=spare).sort_values("_spare", ascending=False, kind="stable").drop_duplicates([*keys, "vehicle"])
    rows: dict[tuple[object, ...], dict[str, object]] = {}
    for record in best.sort_index().to_dict("records"):
        at = tuple(None if pd.isna(record[name]) else record[name] for name in keys)  # NaN would be a row of its own each time
        rows.setdefault(at, {name: record[name] for name in keys})[f"{record['vehicle']}"] = _cell(record)
    return pd.DataFrame(list(rows.values()), columns=[*keys, *dict.fromkeys(table["vehicle"])])


def _cell(record: dict[Hashable, Any]) -> str:
    answer, spare = str(record["answer"]), float(record["spare_m"])
    if answer == NEEDS:
        return needs_text(record["verdict_half_width_m"])
    return answer if np.isnan(spare) else f"{answer}, {room_text(spare, fits=answer == YES)}"


def _add(path: Path, sheet: str, table: pd.DataFrame) -> None:
    columns = [_column(table[name]) for name in table]
    names = [printable(str(name)) for name in table]
    pyogrio.raw.write(path, None, columns, names, layer=sheet, driver="XLSX", geometry_type=None, append=path.exists())


def _column(values: pd.Series) -> NDArray[np.generic]:
    """Return a column as numbers, with NaN where there is none, or as words that are no formula."""
    if values.dtype.kind in "iuf":
        return values.to_numpy(float)
    words = ["" if pd.isna(value) else no_formula(printable(str(value))) for value in values]
    return np.array(words, dtype=object)
