"""What a study's workbook says, read back by GDAL."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyogrio
import pytest

from hdvplan.study.cells import Row, cell_columns
from hdvplan.study.store import LINES, schema_of, write_rows
from hdvplan.study.workbook import write_workbook


def _cell(road: str, vehicle: str, **more: object) -> Row:
    told: Row = {"key": f"{road}{vehicle}{more}", "road": road, "vehicle": vehicle, "outcome": "planned", "objective": "geometric"}
    return told | more


def _sheets(folder: Path, cells: list[Row]) -> dict[str, dict[str, list[object]]]:
    write_rows(folder / "cells.parquet", cells, schema_of(cell_columns(()), LINES))
    write_workbook(folder / "table.xlsx", folder / "cells.parquet", ())
    found: dict[str, dict[str, list[object]]] = {}
    for sheet, _ in pyogrio.list_layers(folder / "table.xlsx"):
        # GDAL takes a first row for headings only where another row holds numbers
        meta, _, _, fields = pyogrio.raw.read(folder / "table.xlsx", layer=sheet, HEADERS="FORCE")
        found[sheet] = {name: values.tolist() for name, values in zip(meta["fields"], fields, strict=True)}
    return found


def test_a_workbook_has_roads_by_vehicles_and_every_cell(tmp_path: Path) -> None:
    cells = [
        _cell("high street", "bus", fits=True, spare_m=1.25, s_m=84.0),
        _cell("high street", "long bus", fits=False, spare_m=-0.06, s_m=81.5),
        _cell("=mill lane", "bus", fits=None, verdict_half_width_m=2.2),
        _cell("=mill lane", "long bus", outcome="no plan", fits=False),
    ]
    sheets = _sheets(tmp_path, cells)
    assert list(sheets) == ["roads by vehicles", "cells"]
    matrix = sheets["roads by vehicles"]
    assert matrix["road"] == ["high street", "'=mill lane"]  # no formula
    assert matrix["bus"] == ["YES, 1.25 m to spare", "NEEDS 2.20 m to both sides"]
    assert matrix["long bus"] == ["NO, 0.06 m lacking", "NO"]
    listed = sheets["cells"]
    assert listed["answer"] == ["YES", "NO", "NEEDS", "NO"]
    assert listed["spare_m"] == pytest.approx([1.25, -0.06, np.nan, np.nan], nan_ok=True)  # numbers, not words


def test_of_several_settings_the_best_answer_stands_in_the_row_of_its_width(tmp_path: Path) -> None:
    widths = ({"half_width_m": half, "left_m": half, "right_m": half} for half in (2.0, 3.0))
    cells = [
        _cell("lane", "bus", objective=objective, fits=fits, spare_m=spare, **width)
        for width, answers in zip(widths, (((False, -0.3), (False, -0.1)), ((False, -0.02), (True, 0.4))), strict=True)
        for objective, (fits, spare) in zip(("geometric", "balanced"), answers, strict=True)
    ]
    matrix = _sheets(tmp_path, cells)["roads by vehicles"]
    assert matrix["half_width_m"] == [2, 3]
    assert matrix["bus"] == ["NO, 0.10 m lacking", "YES, 0.40 m to spare"]


def test_a_study_too_large_for_a_workbook_leaves_none_from_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _sheets(tmp_path, [_cell("lane", "bus", fits=True, spare_m=0.5)])
    monkeypatch.setattr("hdvplan.study.workbook.MOST_CELLS", 1)
    write_rows(
        tmp_path / "cells.parquet", [_cell("lane", name, fits=True, spare_m=0.5) for name in "ab"], schema_of(cell_columns(()), LINES)
    )
    write_workbook(tmp_path / "table.xlsx", tmp_path / "cells.parquet", ())
    assert not (tmp_path / "table.xlsx").exists()
