"""Which places a ranking has, and what a study's workbook says of them, read back by GDAL."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pyogrio
import pytest

from hdvplan.answers import NEEDS, NO, YES, needs_text, room_text
from hdvplan.study.cells import Row, cell_columns, place_columns
from hdvplan.study.store import LINES, POINTS, schema_of, table_file
from hdvplan.study.tables import MERGED_M, ranking_of, straying_of, write_workbook

METRE = 1.0 / 111_195.0  # of latitude, in degrees on a sphere of 6371 km


def _ranking(folder: Path, cells: list[Row], places: list[Row]) -> pd.DataFrame:
    common: Row = {"objective": "geometric", "scheme": "rti", "solver": "riccati", "offset_m": 0.0, "reverse": False}
    with table_file(folder / "cells.parquet", schema_of(cell_columns(()), LINES)) as write:
        write([common | cell for cell in cells])
    with table_file(folder / "places.parquet", schema_of(place_columns(()), POINTS)) as write:
        write([common | place for place in places])
    return ranking_of(folder / "cells.parquet", folder / "places.parquet", ())


def _cell(key: str, vehicle: str = "bus", half_width: float = 3.0, **more: object) -> Row:
    told: Row = {"key": key, "road": "line", "vehicle": vehicle, "half_width_m": half_width, "left_m": half_width, "right_m": half_width}
    return told | {"outcome": "planned", "fits": False, "spare_m": -0.1} | more


def _place(key: str, north: float, depth: float | None, **more: object) -> Row:
    return {"key": key, "kind": "breach", "s_m": north, "lon": 9.5, "lat": 47.0 + north * METRE, "depth_m": depth, "side": "left"} | more


def test_near_places_of_all_vehicles_are_one_that_needs_what_most_lack(tmp_path: Path) -> None:
    cells = [_cell("a"), _cell("b", "truck")]
    places = [_place("a", 0.0, 0.2), _place("b", 0.9 * MERGED_M, 0.5), _place("b", 3.0 * MERGED_M, 0.1)]
    ranking = _ranking(tmp_path, cells, places)
    assert ranking["widening_m"].tolist() == [0.1, 0.5]  # least first
    assert ranking["worst_rank"].tolist() == [2, 1]
    assert ranking["which_vehicles"].tolist() == ["truck", "bus; truck"]
    assert ranking["vehicles"].tolist() == [1, 2]


def test_places_in_a_row_do_not_merge_into_one_long_place(tmp_path: Path) -> None:
    places = [_place("a", number * 0.9 * MERGED_M, 0.1 + 0.01 * number) for number in range(6)]
    assert len(_ranking(tmp_path, [_cell("a")], places)) == 3


def test_the_best_plan_of_a_vehicle_decides(tmp_path: Path) -> None:
    fits = _cell("b", objective="lead-axle", fits=True, spare_m=0.1)
    assert _ranking(tmp_path, [_cell("a"), fits], [_place("a", 0.0, 0.2)]).empty
    less = _cell("b", objective="lead-axle", spare_m=-0.05)
    assert _ranking(tmp_path, [_cell("a"), less], [_place("a", 0.0, 0.2), _place("b", 500.0, 0.05)])["widening_m"].tolist() == [0.05]


def test_a_clearance_that_is_not_kept_is_lacking_too(tmp_path: Path) -> None:
    cells = [_cell("a", settings_clearance=0.25, spare_m=-0.125), _cell("b", "truck", settings_clearance=0.25, spare_m=-0.75)]
    tightest = [_place("a", 0.0, None, kind="tightest", spare_m=-0.125), _place("b", 500.0, None, kind="tightest", spare_m=-0.75)]
    ranking = _ranking(tmp_path, cells, [*tightest, _place("b", 500.0, 0.5, spare_m=-0.5)])
    assert ranking[["which_vehicles", "widening_m"]].to_numpy().tolist() == [["bus", 0.125], ["truck", 0.75]]


def test_a_vehicle_that_fits_closely_may_still_keep_no_clearance(tmp_path: Path) -> None:
    cells = [_cell("a", settings_clearance=0.0, fits=True, spare_m=0.1), _cell("b", settings_clearance=0.25, spare_m=-0.125)]
    ranking = _ranking(tmp_path, cells, [_place("b", 0.0, None, kind="tightest", spare_m=-0.125)])
    assert ranking["widening_m"].tolist() == [0.125]


def test_places_of_different_widths_are_not_one(tmp_path: Path) -> None:
    ranking = _ranking(tmp_path, [_cell("a"), _cell("b", half_width=2.5)], [_place("a", 0.0, 0.2), _place("b", 0.0, 0.7)])
    assert ranking[["half_width_m", "widening_m"]].to_numpy().tolist() == [[3.0, 0.2], [2.5, 0.7]]


def test_a_place_without_any_plan_comes_last_and_is_the_worst(tmp_path: Path) -> None:
    dead = _cell("b", "truck", outcome="no plan", spare_m=None)
    ranking = _ranking(tmp_path, [_cell("a"), dead], [_place("a", 0.0, 0.2), _place("b", 500.0, None, kind="no plan")])
    assert ranking["which_vehicles"].tolist() == ["bus", "truck"]
    assert ranking["worst_rank"].tolist() == [2, 1]
    assert pd.isna(ranking["widening_m"].iloc[1])


def test_what_must_be_widened_counts_where_it_is_known(tmp_path: Path) -> None:
    widening = _place("a", 0.0, 0.15, kind="widening", area_m2=2.5)
    ranking = _ranking(tmp_path, [_cell("a")], [_place("a", 0.0, 0.2), widening])
    assert ranking[["widening_m", "widening_m2"]].to_numpy().tolist() == [[0.15, 2.5]]


@pytest.mark.parametrize(("roads", "count"), [(("line", "line"), 1), (("line", "other"), 2)])
def test_roads_without_a_place_on_the_earth_lie_apart(tmp_path: Path, roads: tuple[str, str], count: int) -> None:
    cells = [_cell("a", road=roads[0]), _cell("b", "truck", road=roads[1])]
    nowhere: Row = {"lon": None, "lat": None, "x": 1.0, "y": 2.0}
    assert len(_ranking(tmp_path, cells, [_place("a", 0.0, 0.2) | nowhere, _place("b", 5.0, 0.3) | nowhere])) == count


def test_cells_that_fit_have_no_answer_or_no_limits_keep_nothing_out(tmp_path: Path) -> None:
    cells = [_cell("a", fits=True), _cell("b", fits=None), _cell("c", outcome="killed", fits=None)]
    assert _ranking(tmp_path, cells, [_place(key, 0.0, 0.1) for key in "abc"]).empty


def test_courses_that_fit_are_told_by_how_far_their_drivers_may_stray(tmp_path: Path) -> None:
    fits: Row = {"fits": True, "spare_m": 0.3, "tracking_length_m": 6.0}
    cells = [
        _cell("a", tracking_error_m=0.1) | fits,
        _cell("b", objective="lead-axle", tracking_error_m=0.2, tracking_part="front corner") | fits,
        _cell("c", "truck", tracking_error_m=0.15, tracking_part="rear axle") | fits,
        _cell("d", half_width=2.5),
    ]
    assert _ranking(tmp_path, cells, []).empty
    found = straying_of(tmp_path / "cells.parquet", ())
    assert found[["rank", "vehicle", "tracking_error_m", "key"]].to_numpy().tolist() == [[1, "truck", 0.15, "c"], [2, "bus", 0.2, "b"]]
    assert found["tracking_part"].tolist() == ["rear axle", "front corner"]


def _read_cell(road: str, vehicle: str, **more: object) -> Row:
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
        _read_cell("high street", "bus", word=YES, spare_m=1.25, s_m=84.0),
        _read_cell("high street", "long bus", word=NO, spare_m=-0.06, s_m=81.5),
        _read_cell("=mill lane", "bus", word=NEEDS, verdict_half_width_m=2.2),
        _read_cell("=mill lane", "long bus", outcome="no plan", word=NO),
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


def test_a_workbook_says_how_much_room_is_kept_where_as_much_as_can_be_was_asked_for(tmp_path: Path) -> None:
    kept = {"word": YES, "spare_m": -0.004, "clearance_wanted_m": 0.82}
    cells = [_read_cell("lane", "bus", **kept), _read_cell("lane", "van", **kept, settings_clearance=0.82)]
    matrix = _sheets(tmp_path, cells)["roads by vehicles"]
    assert (matrix["bus"], matrix["van"]) == ([f"{YES}, 0.82 m kept"], [f"{YES}, {room_text(-0.004, fits=True)}"])


def test_of_several_settings_the_best_answer_stands_in_the_row_of_its_width(tmp_path: Path) -> None:
    widths = ({"half_width_m": half, "left_m": half, "right_m": half} for half in (2.0, 3.0))
    cells = [
        _read_cell("lane", "bus", objective=objective, word=word, spare_m=spare, **width)
        for width, answers in zip(widths, (((NO, -0.3), (NO, -0.1)), ((NO, -0.02), (YES, 0.4))), strict=True)
        for objective, (word, spare) in zip(("geometric", "balanced"), answers, strict=True)
    ]
    matrix = _sheets(tmp_path, cells)["roads by vehicles"]
    assert matrix["half_width_m"] == [2, 3]
    assert matrix["bus"] == [f"{NO}, {room_text(-0.1, fits=False)}", f"{YES}, {room_text(0.4, fits=True)}"]


def test_a_study_too_large_for_a_workbook_leaves_none_from_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _sheets(tmp_path, [_read_cell("lane", name, word=YES, spare_m=0.5) for name in "ab"])
    monkeypatch.setattr("hdvplan.study.tables.MOST_CELLS", 1)
    write_workbook(tmp_path / "table.xlsx", tmp_path / "cells.parquet", ())
    assert not (tmp_path / "table.xlsx").exists()
