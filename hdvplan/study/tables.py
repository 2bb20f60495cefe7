"""What people read of a study: a ranking of the places that keep vehicles out, the courses that fit, and all answers as text and workbook.

In the ranking near places are merged, with the widening that each needs; courses that fit are sorted by how far their drivers may stray.
The workbook has one sheet of roads by vehicles, and one with a row a cell. It holds numbers: CSV that is opened in a program set to
decimal commas does not.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pyogrio
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from hdvplan.answers import NEEDS, YES, needs_text, room_text
from hdvplan.arrays import FloatArray
from hdvplan.fileio import csv_bytes, replaced, write_atomically
from hdvplan.study.cells import BREACH, DEAD_END, GEOMETRY, TIGHTEST, WIDENING
from hdvplan.texts import no_formula, printable

MERGED_M = 25.0  # places nearer than this to a deeper one are one with it
_AT_ONCE = 8192  # rows in memory
_EARTH_M = 6_371_000.0
_CLEARANCE = "settings_clearance"
# With road and vehicle: what is asked, whatever the plan.
_COURSE = ["half_width_m", "left_m", "right_m", "offset_m", "reverse", "pass", _CLEARANCE]
_WIDTH = ["half_width_m", "left_m", "right_m"]  # places of different widths are never one
_CELL = ["key", "road", "vehicle", *_COURSE, "outcome", "fits", "spare_m"]
_PLACE = ["key", "kind", "s_m", "x", "y", "lon", "lat", "depth_m", "spare_m", "area_m2", "side", "unit", "part", "obstacle"]
COLUMNS = [
    "rank", "worst_rank", "widening_m", "widening_m2", "vehicles", "roads", "courses", *_WIDTH, "road", "s_m", "lon", "lat", "x", "y",
    "vehicle", "side", "unit", "part", "obstacle", "which_vehicles", "which_roads", "key",
]  # fmt: skip
_STRAYING = ["tracking_error_m", "tracking_s_m", "tracking_unit", "tracking_part", "spare_m", "key"]
WORDS = ("road", "vehicle", "side", "unit", "part", "obstacle", "which_vehicles", "which_roads", "key")  # of the columns
MOST_CELLS = 10_000  # a workbook is written from memory as a whole
_DECIDES = ["s_m", "lat", "lon", "side", "unit", "part", "obstacle"]
_OPTIONS = ["objective", "scheme", "solver", "offset_m", "reverse", "pass", "settings_clearance"]
_KEPT = ["clearance_wanted_m", "tracking_error_m"]
_LATER = 1e9  # what counts as lacking where there is no plan


def ranking_of(cells: Path, places: Path, varied: tuple[str, ...]) -> pd.DataFrame:
    """Return the ranking of a study's tables: the places that need the least widening first, those without any plan last.

    Of every road, vehicle, width and clearance the best cell counts: a vehicle that fits by one objective needs no widening.
    ``widening_m`` is the most that any vehicle lacks there, with the clearance that was asked for. Where the study asked for needs, it is
    the depth of the least widening, and ``widening_m2`` its area. ``worst_rank`` counts from the place that lacks most.
    """
    found = _lacking(cells, places, varied)
    if found.empty:
        return pd.DataFrame(columns=COLUMNS)
    frames = [_merged(group) for _, group in found.groupby(_WIDTH, dropna=False, sort=True)]
    ranking = pd.concat(frames, ignore_index=True)
    ranking["worst_rank"] = ranking["widening_m"].fillna(np.inf).rank(ascending=False, method="first").astype(int)
    by = {"widening_m": True, "vehicles": False, "courses": False, "road": True, "s_m": True}
    ranking = ranking.sort_values(list(by), ascending=list(by.values()), na_position="last", kind="stable", ignore_index=True)
    ranking["rank"] = np.arange(1, len(ranking) + 1)
    return ranking[COLUMNS]


def straying_of(cells: Path, varied: tuple[str, ...]) -> pd.DataFrame:
    """Return the courses that fit, those first whose drivers may stray least; of every course the cell counts that lets them stray most."""
    course = ["road", "vehicle", *varied, *_COURSE, "tracking_length_m"]
    fitting = (part[part["tracking_error_m"].notna()] for part in _parts(cells, [*course, *_STRAYING]))
    best = _best(fitting, ["tracking_error_m", "spare_m"], course)
    found = best.sort_values(["tracking_error_m", "road", "vehicle"], kind="stable", ignore_index=True)
    found.insert(0, "rank", np.arange(1, len(found) + 1))
    return found[["rank", *_STRAYING[:-1], *course, _STRAYING[-1]]]


def _best(parts: Iterator[pd.DataFrame], by: list[str], course: list[str]) -> pd.DataFrame:
    """Return the row of every course that has most of some columns, of the parts of a table that is not in memory as a whole."""
    best = pd.DataFrame()
    for part in parts:
        table = part if best.empty else pd.concat([best, part])
        best = table.sort_values(by, ascending=False, na_position="last", kind="stable").drop_duplicates(course)
    return best


def _lacking(cells: Path, places: Path, varied: tuple[str, ...]) -> pd.DataFrame:
    """Return the places where the best cells of courses lack room, with their courses; neither table is in memory as a whole."""
    course = ["road", "vehicle", *varied, *_COURSE]
    judged = (
        part[part["fits"].notna() & part["outcome"].isin(["planned", "no plan"])].astype({"fits": bool})
        for part in _parts(cells, [*_CELL, *varied])
    )
    best = _best(judged, ["fits", "spare_m"], course)
    best = best[~best["fits"]]
    kinds = [BREACH, DEAD_END, TIGHTEST, WIDENING]
    found = [part[part["kind"].isin(kinds) & part["key"].isin(best["key"])] for part in _parts(places, _PLACE)]
    if not any(map(len, found)):
        return pd.DataFrame()
    at = pd.concat([part for part in found if len(part)])
    widened = set(at.loc[at["kind"] == WIDENING, "key"])
    at = at[(at["kind"] == WIDENING) == at["key"].isin(widened)]  # what must change, where it is known, else what the plan broke
    broken = set(at.loc[at["kind"] != TIGHTEST, "key"])
    at = at[(at["kind"] != TIGHTEST) == at["key"].isin(broken)]  # the tightest place where all that is lacking is the clearance
    at = at.merge(best[["key", *course]], on="key", how="left").drop_duplicates(["key", "kind", "s_m", "side"])
    kept = at[_CLEARANCE].astype(float).fillna(0.0).where(at["kind"] == BREACH, 0.0)
    return at.assign(depth_m=(at["depth_m"] + kept).where(at["kind"] != TIGHTEST, -at["spare_m"]))


def _parts(path: Path, columns: list[str]) -> Iterator[pd.DataFrame]:
    for batch in pq.ParquetFile(path).iter_batches(batch_size=_AT_ONCE, columns=columns):
        yield batch.to_pandas()


def _merged(found: pd.DataFrame) -> pd.DataFrame:
    """Return one row for all places around a deepest one."""
    found = found.sort_values(["depth_m", "road", "s_m", "key"], ascending=[False, True, True, True], na_position="first", kind="stable")
    points = _points(found)
    tree = cKDTree(points)
    owner = np.full(len(found), -1)
    for number in range(len(found)):
        if owner[number] < 0:
            near = np.asarray(tree.query_ball_point(points[number], MERGED_M))
            owner[near[owner[near] < 0]] = number
    rows = []
    for _, members in found.groupby(owner, sort=True):
        deepest = members.iloc[0]
        vehicles, roads = sorted(set(members["vehicle"])), sorted(set(members["road"]))
        rows.append(
            deepest.to_dict()
            | {
                "widening_m": deepest["depth_m"],
                "widening_m2": members["area_m2"].max(),
                "vehicles": len(vehicles),
                "roads": len(roads),
                "courses": members["key"].nunique(),
                "which_vehicles": "; ".join(vehicles),
                "which_roads": "; ".join(roads),
            }
        )
    return pd.DataFrame(rows)


def _points(found: pd.DataFrame) -> NDArray[np.float64]:
    """Return places in space [m], shape (n, 3): on the Earth by longitude and latitude; each road without them in a plane of its own."""
    lon, lat = (np.deg2rad(found[name].to_numpy(float)) for name in ("lon", "lat"))
    globe: FloatArray = _EARTH_M * np.column_stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    apart = 1e8 * (1.0 + pd.factorize(found["road"])[0])  # further than anything on the Earth
    plane = np.column_stack([found[["x", "y"]].to_numpy(float), apart])
    points: FloatArray = np.where(np.isnan(lon)[:, None], plane, globe)
    return points


def write_workbook(path: Path, cells: Path, varied: tuple[str, ...]) -> None:
    """Write the workbook of a table of cells; nothing, and none from before stays, where the study is too large for one.

    Raises:
        OSError: it cannot be written.

    """
    file = pq.ParquetFile(cells)
    if not 0 < file.metadata.num_rows <= MOST_CELLS:
        path.unlink(missing_ok=True)
        return
    wanted = ["road", "vehicle", *varied, *_WIDTH, "word", "spare_m", *_KEPT, "verdict_half_width_m", *_DECIDES, *_OPTIONS]
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
    keys = ["road", *(name for name in _WIDTH if table[name].notna().any())]
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
    if answer == YES and pd.isna(record[_CLEARANCE]) and record["clearance_wanted_m"] > 0.0:  # as much as can be kept was asked for
        return f"{answer}, {record['clearance_wanted_m'] + spare:.2f} m kept"
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
