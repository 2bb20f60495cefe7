from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from io import BytesIO
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import shapely
from hypothesis import example, given
from hypothesis import strategies as st
from shapely.geometry.base import BaseGeometry

from hdvplan.api import plan
from hdvplan.case import Case
from hdvplan.errors import OptionError
from hdvplan.fileio import Column, Together, json_bytes, read_json, settle, table_bytes, write_atomically
from hdvplan.judging.result import Result
from hdvplan.report.files import Table, drawn_bytes, envelope_table, limits_json, path_table, profile_table, steps_table, write_plan
from hdvplan.report.planfiles import read_plan
from hdvplan.road.load import load_road
from hdvplan.vehicle.load import load_vehicle


def test_the_summary_is_there_last(bus: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    there: list[str] = []
    real = Path.replace

    def noted(path: Path, target: Path) -> Path:
        there.append(target.name)
        return real(path, target)

    monkeypatch.setattr(Path, "replace", noted)
    write_plan(bus, tmp_path)
    assert there[-1] == "summary.json"
    assert len(there) == 10  # and the folder that all are in before
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(there[1:])


def test_limits_in_the_file_are_the_kerbs_that_are_judged_to_2_mm(bus: Result) -> None:
    street = bus.drive.road.kerbs
    assert street is not None
    judged = shapely.MultiLineString([kerb.points for kerb in street.kerbs])
    items = json.loads(json_bytes(limits_json(bus)))
    written = shapely.MultiLineString([line for one in items if one["layer"] == "limits" for line in one["lines"]])

    def along(lines: BaseGeometry, others: BaseGeometry) -> BaseGeometry:  # not what goes on beyond an end
        return shapely.intersection(lines, shapely.buffer(others, 1.0, cap_style="flat"))

    assert shapely.hausdorff_distance(along(written, judged), along(judged, written)) < 2e-3


@pytest.fixture(scope="module")
def drawn(bus: Result, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a plan's files with its picture; copy them before you change them."""
    folder = tmp_path_factory.mktemp("drawn")
    write_plan(bus, folder, pictures=["svg"])
    return folder


@pytest.mark.parametrize("killed_after", range(13))
def test_whenever_a_run_is_killed_the_former_plan_or_the_new_one_is_there(
    bus: Result, drawn: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, killed_after: int
) -> None:
    shutil.copytree(drawn, tmp_path, dirs_exist_ok=True)
    former = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    monkeypatch.setattr("hdvplan.report.files.json_bytes", lambda *_, **__: b"{}")  # the new plan differs in its JSON
    moves, real = [0], {name: getattr(Path, name) for name in ("replace", "unlink")}

    def until_killed(name: str) -> object:
        def call(path: Path, *others: object, **options: object) -> object:
            moves[0] += 1
            if moves[0] > killed_after:
                raise SystemExit(137)
            return real[name](path, *others, **options)

        return call

    with monkeypatch.context() as patched:
        for name in real:
            patched.setattr(Path, name, until_killed(name))
        patched.setattr("shutil.rmtree", lambda *_, **__: None)  # a killed process tidies nothing up
        with suppress(SystemExit):
            write_plan(bus, tmp_path)
    settle(tmp_path)
    found = {file.name: file.read_bytes() for file in tmp_path.iterdir() if file.is_file()}
    assert (found == former) if killed_after == 0 else (found["summary.json"] == b"{}" and "plan.svg" not in found and len(found) == 9)


@pytest.mark.parametrize("named", ["../mine.txt", "{}/mine.txt", "..", "", "plan/../../mine.txt", "summary.json\0"])
def test_a_folder_of_others_takes_no_file_away_that_lies_elsewhere(tmp_path: Path, named: str) -> None:
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    aside = tmp_path / "plan" / ".hdvplan-new"
    aside.mkdir(parents=True)
    (aside / ".gone").write_text("summary.json\n" + named.format(tmp_path), encoding="utf-8")
    with pytest.raises(OptionError, match="names more than files of its folder"):
        read_plan(tmp_path / "plan")
    assert (tmp_path / "mine.txt").read_text(encoding="utf-8") == "mine"


def test_a_file_appears_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "file"
    target.write_bytes(b"old")

    def fail(_self: Path, _target: Path) -> None:
        msg = "disk full"
        raise OSError(msg)

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        write_atomically(target, b"new")
    assert target.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [target]


def test_the_path_reads_back_to_a_micrometre(trailer: Result) -> None:
    table = path_table(trailer)
    read = np.loadtxt(BytesIO(table_bytes(table)), delimiter=",", skiprows=1)
    half = {"heading": 5e-10, "e_psi": 5e-10, "beta1": 5e-10, "kappa": 5e-13, "K": 5e-10}  # of the last written decimal; else 0.5 um
    for (name, column), values in zip(table.items(), read.T, strict=True):
        np.testing.assert_allclose(values, column.content, rtol=1e-15, atol=1.001 * half.get(name, 5e-7))  # and a double's own digits
    assert list(table) == ["s", "x", "y", "heading", "e_y", "e_psi", "beta1", "kappa", "K"]
    assert len(read) == len(trailer.drive.z)


def test_missing_numbers_are_empty_and_words_stand_as_they_are() -> None:
    table = {
        "s": Column(np.array([0.0, 0.5, 1.0]), "%.2f"),
        "left": Column(np.array([np.nan, -1.0, np.inf]), "%.3f"),
        "status": Column(np.array(["solved", "failed", "solved"])),
        "qps": Column(np.array([1, 2, 3])),
        "usable": Column(np.array([True, False, True])),
    }
    lines = ["s,left,status,qps,usable", "0.00,,solved,1,True", "0.50,-1.000,failed,2,False", "1.00,inf,solved,3,True"]
    assert table_bytes(table).decode().splitlines() == lines
    long = {"number": Column(np.arange(2501.0), "%.1f")}  # more rows than are written at once
    assert table_bytes(long).decode().splitlines() == ["number", *(f"{number}.0" for number in range(2501))]
    assert table_bytes({"none": Column(np.empty(0), "%.1f")}) == b"none\n"


_NEAR_HALVES = st.integers(-(10**7), 10**7).map(lambda half: half / 2e6)


@given(st.lists(st.floats() | st.decimals(-9999, 9999, places=7).map(float) | _NEAR_HALVES, min_size=1), st.integers(0, 12))
@example([1.7976931348623157e308, -np.inf, 0.0, -0.0, np.nan, 0.5, 1.5, 2.5, 99999.5, 0.0000005], 0)
def test_decimals_are_those_of_printf(values: list[float], places: int) -> None:
    written = table_bytes({"number": Column(np.array(values), f"%.{places}f")}).decode().split("\n")
    assert written == ["number", *("" if np.isnan(value) else f"{value:.{places}f}" for value in values), ""]


def test_the_envelope_s_limits_are_empty_without_limits(trailer: Result, bus: Result) -> None:
    assert np.all(np.isnan(envelope_table(trailer)["left_limit"].content))
    assert b"nan" not in table_bytes(envelope_table(trailer))
    table = {name: column.content for name, column in envelope_table(bus).items()}
    assert np.all(table["left_limit"] == 3.0)
    assert np.all(table["right_limit"] == -3.0)
    assert np.all(table["expected_left"] == -table["expected_right"])


def test_the_profile_holds_what_drawings_need(kerbed: Result, trailer: Result) -> None:
    table = read_back(profile_table(kerbed))
    assert table["clearance"].min() == pytest.approx(kerbed.balance.min_clearance, abs=6e-5)  # rounded to 0.1 mm
    assert (table["left_sweep_limit"] == 2.2).all()
    np.testing.assert_allclose(table["left1"], kerbed.envelope.reach_left, atol=6e-5)
    table = read_back(profile_table(trailer))
    assert table["clearance"].isna().all()  # no limits
    assert {"expected_beta1", "left2", "right2", "road_curvature"} <= set(table.columns)


def test_the_room_over_s_does_not_jump_where_a_corner_passes_a_station_between_two_poses() -> None:
    """Where the lead axle is centred alone, a front corner follows the outer limit through half a U-turn."""
    result = plan(Case(load_road("uturn"), load_vehicle("bus"), "lead-axle"))
    clearance = result.clearance
    assert clearance is not None
    assert np.max(np.abs(np.diff(clearance))) < 0.15  # a corner at 45 degrees to a kerb comes nearer by 0.18 m in a station's 0.25 m
    assert np.min(clearance) == result.balance.min_clearance


def test_every_planning_step_is_a_row_with_its_times(bus: Result) -> None:
    table, plans = read_back(steps_table(bus)), bus.drive.plans
    assert len(table) == len(plans)
    assert list(table["s"][:3]) == [0.0, 5.0, 10.0]
    np.testing.assert_allclose(table["total_ms"], [1e3 * plan.times.total for plan in plans], atol=1e-6)  # rounded to 1 ns
    parts = table[["linearise_ms", "update_ms", "solve_ms", "check_ms"]].sum(axis=1)
    assert (parts <= table["total_ms"] + 1e-5).all()
    assert (table["status"] == "solved").all()
    assert table["usable"].dtype == bool


def read_back(table: Table) -> pd.DataFrame:
    return pd.read_csv(BytesIO(table_bytes(table)))


@pytest.mark.slow
def test_pictures_come_in_the_formats_asked_for(bus: Result, tmp_path: Path) -> None:
    write_plan(bus, tmp_path)
    (tmp_path / "plan.png").write_bytes(b"old")
    write_plan(bus, tmp_path, pictures=["pdf", "svg"])
    assert (tmp_path / "plan.pdf").read_bytes().startswith(b"%PDF")
    svg = (tmp_path / "plan.svg").read_bytes()
    assert svg.startswith(b"<?xml")
    assert b">bus on uturn" in svg  # text stays text
    assert not (tmp_path / "plan.png").exists()
    assert drawn_bytes(bus, "svg") == svg  # the same plan, the same file


def test_of_two_that_write_into_one_folder_at_once_each_ends_whole_and_the_last_one_wins(tmp_path: Path) -> None:
    together = Together("last.json", ("first.txt", "last.json"), {"last.json": "mark"})

    def contents(word: str) -> dict[str, Callable[[], bytes]]:
        return {"first.txt": word.encode, "last.json": lambda: json_bytes({"mark": word})}

    with ThreadPoolExecutor() as pool:

        def begin_another() -> bytes:
            others.append(pool.submit(together.write, tmp_path, contents("two")))
            wait(others, timeout=0.3)  # it would take milliseconds
            return b"one"

        others = list[Future[None]]()
        together.write(tmp_path, contents("one") | {"first.txt": begin_another})
        others[0].result()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["first.txt", "last.json"]
    assert (tmp_path / "first.txt").read_text(encoding="utf-8") == "two"
    assert read_json(tmp_path / "last.json") == {"mark": "two"}
