"""A study from its entries to its tables, in this process: what is kept, what is skipped, what runs anew."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
import shapely

import hdvplan
from hdvplan import api
from hdvplan.answers import NEEDS
from hdvplan.errors import OptionError
from hdvplan.report.summary import summary_of
from hdvplan.study.cells import PARALLEL, SUMMARY, cells_of, taken
from hdvplan.study.conduct import STRAYING, Results, run
from hdvplan.study.engine import KILLED, ended
from hdvplan.study.pools import outcome_of
from hdvplan.study.spec import study_of
from hdvplan.study.store import DAMAGED, KEPT, Store
from tests.study.conftest import InHere, kept_in, known_outcome

Entries = dict[str, object]


def exact(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table without what was measured beside other work."""
    return table.drop(columns=[name for name in table if str(name).startswith(PARALLEL)])


def _run(folder: Path, entries: Entries, engine: InHere | None = None, out: str = "out") -> Results:
    return run(study_of(entries, folder), folder / out, engine or InHere())


def test_a_study_tells_of_every_cell_what_a_plan_tells(folder: Path) -> None:
    one: Entries = {"roads": ["bend.csv"], "vehicles": ["bus"], "left": [1.6, 3.5], "right": [1.7, 3.0]}
    table = _run(folder, one | {"settings": {"horizon": 30}}, InHere(instead=outcome_of)).cells()  # planned again where room is lacking
    assert table[["left_m", "right_m"]].to_numpy().tolist() == [[1.6, 1.7], [3.5, 3.0]]
    road = hdvplan.load_road(folder / "bend.csv")
    for row in table.to_dict("records"):
        limited = road.with_limits(row["left_m"], row["right_m"])
        vehicle = hdvplan.load_vehicle(row["vehicle"])
        result = hdvplan.replanned(api.plan(hdvplan.Case(limited, vehicle, settings=hdvplan.PlannerSettings(horizon=30.0))))
        assert row["case"] == result.case.key
        for name, value in taken(summary_of(result), SUMMARY).items():
            assert pd.isna(row[name]) if value is None else row[name] == value, name
        assert row["outcome"] == "planned"
        assert row[f"{PARALLEL}cpu_s"] > 0.0


def test_every_scalar_of_a_summary_has_a_column(folder: Path) -> None:
    road = hdvplan.load_road(folder / "lane.geojson").with_limits(1.6, 1.6)
    summary = summary_of(api.plan(hdvplan.Case(road, hdvplan.load_vehicle("bus"), settings=hdvplan.PlannerSettings(horizon=30.0))))
    known = {column.path for column in SUMMARY} | {"road", "vehicle", "scheme", "solver", "objective"}  # these tell the cells apart
    # they have columns of their own, are of the vehicle, or what only `hdvplan plan` looks for
    elsewhere = {"time_ms", "settings", "bodies", "wheels", "largest_clearance_m"}
    for name, value in summary.items():
        inside = value if isinstance(value, dict) else {}
        scalars = [f"{name}.{part}" for part, one in inside.items() if not isinstance(one, dict | list)]
        scalars = scalars if inside else [name] if not isinstance(value, list) else []
        if name not in elsewhere:
            assert set(scalars) - {"verdict.proof"} <= known  # an entry of its own where there is one


def test_tables_open_as_geoparquet_with_lines_and_points(folder: Path, tiny: Entries) -> None:
    results = _run(folder, tiny)
    for name, kind in (("cells", "LineString"), ("places", "Point")):
        about = json.loads(pq.read_schema(folder / "out" / f"{name}.parquet").metadata[b"geo"])
        assert about["columns"]["geometry"] == {"encoding": "WKB", "geometry_types": [kind]}
    cells, places = results.cells(), results.places()
    on_earth = cells["road"] == "lane"
    assert cells["geometry"].notna().tolist() == on_earth.tolist()
    first = shapely.get_coordinates(shapely.from_wkb(cells[on_earth]["geometry"].iloc[0]))[0]
    assert first == pytest.approx([9.52, 47.14], abs=2e-5)  # smoothing may move it by a metre
    points = shapely.get_coordinates(shapely.from_wkb(places.dropna(subset="geometry")["geometry"].to_numpy()))
    assert np.array_equal(points, places.dropna(subset="geometry")[["lon", "lat"]].to_numpy())


def test_cells_are_a_plain_table_too(folder: Path, tiny: Entries) -> None:
    (folder / "=1+1.csv").write_bytes((folder / "bend.csv").read_bytes())
    (folder / "short.csv").write_text("s,kappa\n0,0\n5,0\n", encoding="utf-8")  # refused: most of its columns are empty
    _run(folder, tiny | {"roads": ["bend.csv", "=1+1.csv", "short.csv"], "vehicles": ["bus"]})
    plain, whole = pd.read_csv(folder / "out" / "cells.csv"), pd.read_parquet(folder / "out" / "cells.parquet").drop(columns="geometry")
    assert list(plain.columns) == list(whole.columns)
    assert list(plain["road"].unique()) == ["bend", "'=1+1", "short"]  # no formula
    assert list(plain["spare_m"].dropna()) == list(whole["spare_m"].dropna())
    counts = pd.read_csv(folder / "out" / "cells.csv", dtype=str)["plans"].dropna()
    assert len(counts) == 4
    assert all(counts.str.isdigit())  # beside cells without any


def test_every_cell_has_its_tightest_place_and_all_its_breaches(folder: Path, tiny: Entries) -> None:
    results = _run(folder, tiny)
    cells, places = results.cells(), results.places()
    assert places["key"].drop_duplicates().tolist() == cells["key"].tolist()  # in the order of the cells
    tightest = places[places["kind"] == "tightest"].set_index("key")["spare_m"]
    assert tightest.to_dict() == cells.set_index("key")["spare_m"].to_dict()
    breaches = places[places["kind"] == "breach"].groupby("key").size()
    assert breaches.reindex(cells["key"]).fillna(0).astype(int).tolist() == cells["breaches"].tolist()
    assert cells["breaches"].sum() > 0


@pytest.mark.slow
def test_only_what_changed_runs_anew_and_the_rest_stays_as_it_is(folder: Path, tiny: Entries) -> None:
    before, again = _run(folder, tiny).cells(), InHere()
    pd.testing.assert_frame_equal(before, _run(folder, tiny, again).cells())  # also what was measured: nothing was
    assert again.worked == []
    assert len(json.loads((folder / "out" / "study.json").read_bytes())["sessions"]) == 2
    wider, engine = tiny | {"half_widths": [1.6, 2.5, 3.5]}, InHere()
    assert len(_run(folder, wider, engine).cells()) == 12
    assert len(engine.worked) == 4
    (folder / "bend.csv").write_text("s,kappa\n0,0\n20,0\n30,0.02\n40,0\n60,0\n", encoding="utf-8")
    changed, narrowed = InHere(), InHere()
    _run(folder, wider, changed)
    assert len(changed.worked) == 6
    assert len(_run(folder, tiny, narrowed).cells()) == 8
    assert narrowed.worked == []


def test_a_cell_is_kept_as_soon_as_it_has_ended(folder: Path, tiny: Entries) -> None:
    kept: list[int] = []

    def interrupted(done: int, _: int) -> None:
        kept.append(kept_in(folder / "out"))
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(study_of(tiny, folder), folder / "out", InHere(), on_progress=interrupted)
    assert kept == [0, 1, 2, 3]
    rest = InHere()
    resumed = _run(folder, tiny, rest)
    assert len(rest.worked) == 5
    pd.testing.assert_frame_equal(exact(resumed.cells()), exact(_run(folder, tiny, out="undisturbed").cells()))


def test_an_interrupted_run_leaves_no_tables_of_an_earlier_one(folder: Path, tiny: Entries) -> None:
    """A job whose road had become too narrow was killed, and the old YES was published."""

    def interrupted(*_: int) -> None:
        raise KeyboardInterrupt

    few = tiny | {"vehicles": ["bus"]}
    first = exact(_run(folder, few).cells())
    assert (folder / "out" / "cells.csv").exists()
    with pytest.raises(KeyboardInterrupt):
        run(study_of(tiny, folder), folder / "out", InHere(), on_progress=interrupted)
    assert {path.name for path in (folder / "out").iterdir()} == {KEPT, "study.json"}
    again = InHere()
    pd.testing.assert_frame_equal(exact(_run(folder, few, again).cells()), first)
    assert again.worked == []


def test_a_file_that_cannot_be_written_ends_a_study(folder: Path, tiny: Entries, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hdvplan.study.store._PATIENCE_S", 0.0)
    _run(folder, tiny | {"vehicles": ["bus"]})
    with closing(sqlite3.connect(folder / "out" / KEPT)) as other:
        other.execute("BEGIN EXCLUSIVE")
        with pytest.raises(OSError, match="database is locked"):
            _run(folder, tiny)
    assert not (folder / "out" / DAMAGED).exists()


def test_two_processes_may_work_on_one_study(folder: Path, tiny: Entries) -> None:
    study = study_of(tiny, folder)
    first, second = InHere(), InHere(order=lambda cells: cells[::-1])
    each = zip(first.run(cells_of(study)), second.run(cells_of(study)), strict=True)
    (folder / "out").mkdir()
    with closing(Store(folder / "out", print)) as one, closing(Store(folder / "out", print)) as other:
        for mine, theirs in each:
            one.add(mine)
            other.add(theirs)
    assert kept_in(folder / "out") == 8


def test_a_road_is_called_as_it_is_in_the_ranking_too(folder: Path, tiny: Entries) -> None:
    (folder / "bend.csv").rename(folder / "007.csv")
    results = _run(folder, tiny | {"roads": ["007.csv"], "half_widths": [1.4]})
    assert set(results.ranking()["road"]) == set(results.cells()["road"]) == {"007"}


def test_a_cell_without_an_answer_is_a_row_and_runs_again_at_the_next_start(folder: Path, tiny: Entries) -> None:
    bad, killed = next(cells_of(study_of(tiny, folder))).key, ended(KILLED, "its process ended with SIGKILL")
    results = _run(folder, tiny, InHere(instead=lambda cell: killed if cell.key == bad else known_outcome(cell)))
    row = results.cells().iloc[0]
    assert results.unanswered == 1
    assert row["reason"] == "its process ended with SIGKILL"
    assert pd.isna(row["fits"])
    again = InHere()
    mended = _run(folder, tiny, again)
    assert again.worked == [bad]
    assert (mended.unanswered, len(mended.cells())) == (0, 8)


def test_what_cannot_be_planned_is_a_row_with_its_reason(folder: Path, tiny: Entries) -> None:
    (folder / "short.csv").write_text("s,kappa\n0,0\n6,0\n", encoding="utf-8")
    (folder / "text.csv").write_text("nothing of a road\n", encoding="utf-8")
    (folder / "tight.csv").write_text("s,kappa\n0,0.49\n45,0.49\n46,-0.49\n80,-0.49\n90,0\n", encoding="utf-8")
    results = _run(folder, tiny | {"roads": ["short.csv", "text.csv", "tight.csv"], "vehicles": ["bus"], "half_widths": [3.5]})
    table = results.cells().set_index("road")
    assert table["outcome"].to_dict() == {"short": "refused", "text": "refused", "tight": "no plan"}
    assert table["reason"].notna().all()
    assert not table.loc["tight", "fits"]
    (dead_end,) = results.places().to_dict("records")
    assert (dead_end["kind"], dead_end["s_m"]) == ("no plan", table.loc["tight", "s_m"])
    assert results.unanswered == 2
    assert results.reasons() == {("refused", table.loc[name, "reason"]): 1 for name in ("short", "text")}
    again = InHere()
    _run(folder, tiny | {"roads": ["short.csv", "text.csv", "tight.csv"], "vehicles": ["bus"], "half_widths": [3.5]}, again)
    assert not again.worked


def test_cells_whose_file_changes_meanwhile_have_no_answer_until_it_is_the_same_again(folder: Path, tiny: Entries) -> None:
    entries = tiny | {"roads": ["bend.csv"], "vehicles": ["bus"]}
    study, before = study_of(entries, folder), (folder / "bend.csv").read_text(encoding="utf-8")
    (folder / "bend.csv").write_text("s,kappa\n0,0\n60,0\n", encoding="utf-8")
    table = run(study, folder / "out", InHere(instead=outcome_of)).cells()
    assert set(table["outcome"]) == {"failed"}
    assert table["reason"].str.contains("differs here from the file").all()
    (folder / "bend.csv").unlink()
    table = run(study, folder / "out", InHere(instead=outcome_of)).cells()
    assert table["reason"].str.startswith("bend.csv cannot be read here").all()
    (folder / "bend.csv").write_text(before, encoding="utf-8")
    assert set(_run(folder, entries).cells()["outcome"]) == {"planned"}


@pytest.mark.slow
def test_needs_are_columns_and_widenings_are_places(folder: Path) -> None:
    entries: Entries = {"roads": ["bend.csv"], "vehicles": ["bus"], "half_widths": [1.4], "need": True, "settings": {"horizon": 30}}
    results = _run(folder, entries)
    (row,) = results.cells().to_dict("records")
    need = hdvplan.need_of(
        hdvplan.Case(
            hdvplan.load_road(folder / "bend.csv").with_limits(1.4, 1.4),
            hdvplan.load_vehicle("bus"),
            settings=hdvplan.PlannerSettings(horizon=30.0),
        )
    )
    assert row["need_half_width_m"] == need.room.room
    places = results.places()
    widened = places[places["kind"] == "widening"]
    assert widened["area_m2"].sum() == pytest.approx(row["need_widening_m2"], rel=1e-6)  # here the patches do not overlap
    assert results.ranking()["widening_m2"].tolist() == [widened["area_m2"].max()]  # they lie in one place


def test_a_clearance_may_be_the_largest_that_can_be_kept(folder: Path) -> None:
    """It is a course of its own beside one without, and tells what it keeps."""
    entries: Entries = {"roads": ["bend.csv"], "vehicles": ["bus"], "half_widths": [1.7]}
    results = _run(folder, entries | {"settings": {"horizon": 30, "clearance": [0.0, "max"], "offset": 0.1}})
    none, largest = results.cells().to_dict("records")
    assert (none["settings_clearance"], none["clearance_wanted_m"], none["fits"], largest["fits"]) == (0.0, 0.0, True, True)
    assert np.isnan(largest["settings_clearance"])
    assert largest["clearance_wanted_m"] + largest["spare_m"] > none["spare_m"] + 0.01
    assert largest["tracking_error_m"] > none["tracking_error_m"]
    assert len(pd.read_csv(results.folder / STRAYING)) == 2


def test_offsets_directions_and_varied_parameters_are_columns(folder: Path) -> None:
    entries: Entries = {
        "roads": ["bend.csv"],
        "vehicles": ["bus"],
        "half_widths": [3.5],
        "vary": {"bus.wheelbase": [5.5, 6.0]},
        "settings": {"horizon": 30, "reverse": [False, True], "clearance": 0.1},
    }
    results = _run(folder, entries)
    table = results.cells()
    assert table["bus.wheelbase"].tolist() == [5.5, 5.5, 6.0, 6.0]
    assert table["reverse"].tolist() == [False, True, False, True]
    assert set(table["settings_clearance"]) == {0.1}
    assert table["max_left_m"].nunique() == 4
    assert results.places()["bus.wheelbase"].notna().all()


def test_progress_counts_what_was_kept(folder: Path, tiny: Entries) -> None:
    _run(folder, tiny | {"vehicles": ["bus"]})
    told: list[tuple[int, int]] = []
    run(study_of(tiny, folder), folder / "out", InHere(), on_progress=lambda *now: told.append(now))
    assert told == [(number, 8) for number in range(4, 9)]


@pytest.mark.parametrize(
    ("name", "content"),
    [("cells.parquet", b"mine"), ("study.json", b'{"sessions": 5}'), ("study.json", b'{"sessions": [{"started": 1}]}')],
)
def test_a_folder_of_others_is_refused(folder: Path, tiny: Entries, name: str, content: bytes) -> None:
    (folder / "out").mkdir()
    (folder / "out" / "cells.parquet").write_bytes(b"mine")
    (folder / "out" / name).write_bytes(content)
    damaged = r"study\.json is damaged, or not of a study"
    with pytest.raises(OptionError, match=damaged if name == "study.json" else f"holds {name}, which is not of a study") as raised:
        _run(folder, tiny)
    assert ("put back study.json from a copy" in str(raised.value.hint)) == (name == "study.json")


def _overwritten(kept: Path) -> None:
    kept.write_bytes(b"nothing of a table\n" * 1000)


def _without_table(kept: Path) -> None:
    content = bytearray(kept.read_bytes())
    content[100:4096] = bytes(3996)
    kept.write_bytes(bytes(content))


def _without_index(kept: Path) -> None:
    with closing(sqlite3.connect(kept)) as file:
        (page,) = file.execute("SELECT rootpage FROM sqlite_master WHERE type = 'index'").fetchone()
    content = bytearray(kept.read_bytes())
    content[4096 * (page - 1) : 4096 * page] = bytes(4096)  # a page of SQLite's usual size, which only looking for keys reads
    kept.write_bytes(bytes(content))


def _of_other_keys(kept: Path) -> None:
    with closing(sqlite3.connect(kept)) as file:
        (key,) = file.execute("SELECT key FROM cells LIMIT 1").fetchone()
    content = kept.read_bytes()
    assert key.encode() in content
    kept.write_bytes(content.replace(key.encode(), b"\xff" * len(key), 1))  # no text


@pytest.mark.parametrize("damage", [_overwritten, _without_table, _without_index, _of_other_keys])
def test_a_damaged_file_is_moved_aside_and_told(folder: Path, tiny: Entries, damage: Callable[[Path], None]) -> None:
    whole = _run(folder, tiny).cells()
    damage(folder / "out" / KEPT)
    told: list[str] = []
    engine = InHere()
    healed = run(study_of(tiny, folder), folder / "out", engine, on_damage=told.append)
    (line,) = told
    assert f"{KEPT} cannot be read" in line
    assert (folder / "out" / DAMAGED).exists()
    assert len(engine.worked) == 8
    pd.testing.assert_frame_equal(exact(healed.cells()), exact(whole))


def test_a_cell_whose_content_is_damaged_is_planned_again_and_told(folder: Path, tiny: Entries) -> None:
    whole = _run(folder, tiny).cells()
    with closing(sqlite3.connect(folder / "out" / KEPT)) as file, file:
        file.execute("UPDATE cells SET content = substr(content, 1, 50) WHERE key = ?", (whole["key"][2],))
        file.execute("UPDATE cells SET content = 5 WHERE key = ?", (whole["key"][5],))
    told: list[str] = []
    engine = InHere()
    healed = run(study_of(tiny, folder), folder / "out", engine, on_damage=told.append)
    assert told == [f"{folder / 'out' / KEPT} has damaged cells: 2, which are planned again"]
    assert set(engine.worked) == {whole["key"][2], whole["key"][5]}
    pd.testing.assert_frame_equal(exact(healed.cells()), exact(whole))


def test_what_an_older_version_kept_is_refused(folder: Path, tiny: Entries) -> None:
    _run(folder, tiny)
    (folder / "out" / "parts" / "cells").mkdir(parents=True)
    with pytest.raises(OptionError, match="parts holds cells of an older hdvplan, which this one cannot read"):
        _run(folder, tiny)


def test_tables_are_written_through_no_link_and_into_no_folder_of_undecodable_bytes(folder: Path, tiny: Entries) -> None:
    (folder / "secret").write_text("mine", encoding="utf-8")
    (folder / "out").mkdir()
    for name in ("cells.parquet", "places.parquet", "cells.csv"):
        (folder / "out" / f".{name}.{os.getpid()}.part").symlink_to(folder / "secret")
    assert len(_run(folder, tiny).cells()) == 8
    assert (folder / "secret").read_text(encoding="utf-8") == "mine"
    with pytest.raises(OptionError, match="bytes in its name that are no text"):
        _run(folder, tiny, out="\udcff")
    assert not os.path.lexists(folder / "\udcff")


def test_a_study_may_be_run_from_python_by_its_file_or_its_entries(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    Path("study.toml").write_text('roads = ["bend.csv"]\nvehicles = ["bus"]\nsettings.horizon = 30\n', encoding="utf-8")
    by_file = hdvplan.study.run("study.toml", "a", InHere())
    by_entries = hdvplan.study.run({"roads": ["bend.csv"], "vehicles": ["bus"], "settings": {"horizon": 30}}, "b", InHere())
    pd.testing.assert_frame_equal(exact(by_file.cells()), exact(by_entries.cells()))
    assert by_file.fits == {NEEDS: 1}
