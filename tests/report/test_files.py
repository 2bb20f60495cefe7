from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from hdvplan.fileio import csv_bytes, json_bytes, write_atomically
from hdvplan.judging.result import Result
from hdvplan.report.files import envelope_table, path_table, picture_bytes, profile_table, steps_table, write_plan


def test_the_summary_is_written_last(bus: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[str] = []
    monkeypatch.setattr("hdvplan.report.files.write_atomically", lambda path, _content: written.append(path.name))
    write_plan(bus, tmp_path)
    assert written[-1] == "summary.json"
    assert len(written) == 8


def test_a_failing_run_leaves_no_summary_of_a_former_plan(bus: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_plan(bus, tmp_path)

    def fail(_result: Result) -> None:
        msg = "disk full"
        raise OSError(msg)

    monkeypatch.setattr("hdvplan.report.files.envelope_table", fail)
    with pytest.raises(OSError, match="disk full"):
        write_plan(bus, tmp_path)
    assert not (tmp_path / "summary.json").exists()


def test_without_a_plot_the_picture_of_a_former_plan_goes(bus: Result, tmp_path: Path) -> None:
    (tmp_path / "plan.png").write_bytes(b"old")
    write_plan(bus, tmp_path)
    assert not (tmp_path / "plan.png").exists()


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


def test_the_path_reads_back_exactly(trailer: Result) -> None:
    table = path_table(trailer)
    read = np.loadtxt(BytesIO(csv_bytes(table)), delimiter=",", skiprows=1)
    np.testing.assert_array_equal(read, table.to_numpy())
    assert list(table.columns) == ["s", "x", "y", "heading", "e_y", "e_psi", "beta1", "kappa", "K"]
    assert len(read) == len(trailer.drive.z)


def test_the_path_s_heading_is_continuous_and_its_points_lie_at_their_offset(trailer: Result) -> None:
    table, path = path_table(trailer), trailer.drive.stations.path
    assert np.max(np.abs(np.diff(table["heading"]))) < 0.1  # half a metre on a radius above 5 m, and no jump by 2 pi
    _, offset = path.project(table["x"].to_numpy(), table["y"].to_numpy(), table["s"].to_numpy())
    np.testing.assert_allclose(offset, table["e_y"], atol=1e-9)  # the projection's own accuracy


def test_the_envelope_s_limits_are_empty_without_limits(trailer: Result, bus: Result) -> None:
    assert envelope_table(trailer)["left_limit"].isna().all()
    assert b",nan" not in csv_bytes(envelope_table(trailer))
    table = envelope_table(bus)
    assert (table["left_limit"] == 3.0).all()
    assert (table["right_limit"] == -3.0).all()
    assert (table["expected_left"] == -table["expected_right"]).all()


def test_the_profile_holds_what_drawings_need(kerbed: Result, trailer: Result) -> None:
    table = profile_table(kerbed)
    assert table["clearance"].min() == pytest.approx(kerbed.balance.min_clearance, abs=6e-5)  # rounded to 0.1 mm
    assert (table["left_sweep_limit"] == 2.2).all()
    np.testing.assert_allclose(table["left1"], kerbed.envelope.reach_left, atol=6e-5)
    table = profile_table(trailer)
    assert table["clearance"].isna().all()  # no limits
    assert {"expected_beta1", "left2", "right2", "road_curvature"} <= set(table.columns)


def test_every_planning_step_is_a_row_with_its_times(bus: Result) -> None:
    table, plans = steps_table(bus), bus.drive.plans
    assert len(table) == len(plans)
    assert list(table["s"][:3]) == [0.0, 5.0, 10.0]
    np.testing.assert_allclose(table["total_ms"], [1e3 * plan.times.total for plan in plans], atol=1e-6)  # rounded to 1 ns
    parts = table[["linearise_ms", "update_ms", "solve_ms", "check_ms"]].sum(axis=1)
    assert (parts <= table["total_ms"] + 1e-5).all()
    assert (table["status"] == "solved").all()


def test_pictures_come_in_the_formats_asked_for(bus: Result, tmp_path: Path) -> None:
    (tmp_path / "plan.png").write_bytes(b"old")
    write_plan(bus, tmp_path, pictures=["pdf", "svg"])
    assert (tmp_path / "plan.pdf").read_bytes().startswith(b"%PDF")
    svg = (tmp_path / "plan.svg").read_bytes()
    assert svg.startswith(b"<?xml")
    assert b">bus on uturn" in svg  # text stays text
    assert not (tmp_path / "plan.png").exists()
    assert picture_bytes(bus, "svg") == svg  # the same plan, the same file


def test_writing_tells_how_far_it_is(bus: Result, tmp_path: Path) -> None:
    shares: list[float] = []
    write_plan(bus, tmp_path, on_progress=shares.append)
    assert shares == sorted(shares)
    assert len(shares) == 7
    assert 0.0 < shares[0] < shares[-1] < 1.0  # the summary is still to come


def test_json_refuses_what_json_cannot_say() -> None:
    assert json.loads(json_bytes({"place": "Göteborg"})) == {"place": "Göteborg"}
    with pytest.raises(ValueError, match="JSON"):
        json_bytes({"reach": float("nan")})
