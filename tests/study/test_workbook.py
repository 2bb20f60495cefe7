"""What a study's workbook says, read back by GDAL."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyogrio
import pytest

from hdvplan.answers import NEEDS, NO, YES, needs_text, room_text
from hdvplan.study.cells import Row, cell_columns
from hdvplan.study.store import LINES, schema_of, table_file
from hdvplan.study.tables import write_workbook


def _cell(road: str, vehicle: str, **more: object) -> Row:
    row: Row = {"key": f"{road}{vehicle}{more}", "road": road, "vehicle": vehicle, "outcome": "planned", "objective": "geometric"}
    return row | more


def _sheets(folder: Path, cells: list[Row]) -> dict[str, dict[str, list[object]]]:
    with table_file(folder / "cells.parquet", schema_of(cell_columns(()), LINES)) as write:
        write(cells)
    write_workbook(folder / "table.xlsx", folder / "cells.parquet", ())
    found: dict[str, dict[str, list[object]]] = {}
    for sheet, _ in pyogrio.list_layers(folder / "table.xlsx"):
        # GDAL takes a first row for headings only where another row holds numbers
        meta, _, _, fields = pyogrio.raw.read(folder / "table.xlsx", layer=sheet, HEADERS="FORCE")
        found[sheet] = {name: values.tolist() for name, values in zip(meta["fields"], fields, strict=True)}
    return found


def test_a_workbook_has_roads_by_vehicles_and_every_cell(tmp_path: Path) -> None:
    cells = [
        _cell("high street", "bus", word=YES, spare_m=1.25, s_m=84.0),
        _cell("high street", "long bus", word=NO, spare_m=-0.06, s_m=81.5),
        _cell("=mill lane", "bus", word=NEEDS, verdict_half_width_m=2.2),
        _cell("=mill lane", "long bus", outcome="no plan", word=NO),
    ]
    sheets = _sheets(tmp_path, cells)
    assert list(sheets) == ["roads by vehicles", "cells"]
    matrix = sheets["roads by vehicles"]
    assert matrix["road"] == ["high street", "'=mill lane"]  # no formula
    assert matrix["bus"] == [f"{YES}, {room_text(1.25, fits=True)}", needs_text(2.2)]
    assert matrix["long bus"] == [f"{NO}, {room_text(-0.06, fits=False)}", NO]
    listed = sheets["cells"]
    assert listed["answer"] == [YES, NO, NEEDS, NO]
    assert listed["spare_m"] == pytest.approx([1.25, -0.06, np.nan, np.nan], nan_ok=True)  # numbers, not words


def test_of_several_settings_the_best_answer_stands_in_the_row_of_its_width(tmp_path: Path) -> None:
    widths = ({"half_width_m": half, "left_m": half, "right_m": half} for half in (2.0, 3.0))
    cells = [
        _cell("lane", "bus", objective=objective, word=word, spare_m=spare, **width)
        for width, answers in zip(widths, (((NO, -0.3), (NO, -0.1)), ((NO, -0.02), (YES, 0.4))), strict=True)
        for objective, (word, spare) in zip(("geometric", "balanced"), answers, strict=True)
    ]
    matrix = _sheets(tmp_path, cells)["roads by vehicles"]
    assert matrix["half_width_m"] == [2, 3]
    assert matrix["bus"] == [f"{NO}, {room_text(-0.1, fits=False)}", f"{YES}, {room_text(0.4, fits=True)}"]


def test_a_study_too_large_for_a_workbook_leaves_none_from_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _sheets(tmp_path, [_cell("lane", name, word=YES, spare_m=0.5) for name in "ab"])
    monkeypatch.setattr("hdvplan.study.tables.MOST_CELLS", 1)
    write_workbook(tmp_path / "table.xlsx", tmp_path / "cells.parquet", ())
    assert not (tmp_path / "table.xlsx").exists()
