from __future__ import annotations

import gc
import gzip
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hdvplan.bench.measuring.courses import cases_of
from hdvplan.bench.measuring.measure import measure
from hdvplan.bench.measuring.run import remaining, run
from hdvplan.bench.measuring.samples import FAILED, NUMBERS, OK, OVER_BUDGET, Measurement, part_file, read_part, read_plain, write_part
from hdvplan.bench.measuring.stats import tables_of
from hdvplan.bench.suite import Suite
from hdvplan.case import Case
from hdvplan.driving.drive import simulate
from hdvplan.errors import OptionError
from hdvplan.solvers.registry import solver_named
from tests.fakes import Fake

RICCATI = solver_named("riccati")
_PATIENCE_S = 600.0  # of planning; a drive takes a second at most


@pytest.fixture
def case(tiny: Suite) -> Case:
    return cases_of(tiny)[0]


def test_a_drive_leaves_every_step_with_its_parts_and_what_it_swept(case: Case) -> None:
    measured = measure(case, RICCATI, budget=_PATIENCE_S, judged=True)
    table = measured.table()
    assert (measured.outcome, len(table)) == (OK, 12)  # 60 m, 5 m at a time
    parts = table[["linearise_s", "update_s", "solve_s", "check_s"]].sum(axis=1)
    assert (parts > 0.0).all()
    assert (parts <= table["total_s"]).all()
    assert (table["status"] == "solved").all()
    assert table["usable"].all()
    assert measured.nonzeros > 0
    assert measured.judgement is not None
    assert measured.judgement.e_y.shape == (121,)  # every 0.5 m
    assert measured.judgement.violation == 0.0
    assert gc.isenabled()


def test_what_happens_beside_the_planner_shows_in_the_time_of_the_drive_around_it(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    def slow(*arguments: object) -> object:
        end = time.perf_counter() + 2e-3
        while time.perf_counter() < end:  # who sleeps is not measured at all
            pass
        return simulate(*arguments)  # type: ignore[arg-type] # passed on

    plain = measure(case, RICCATI, budget=_PATIENCE_S, judged=False).table()
    assert (plain["outer_s"] >= plain["total_s"]).all()
    monkeypatch.setattr("hdvplan.driving.drive.simulate", slow)
    table = measure(case, RICCATI, budget=_PATIENCE_S, judged=False).table()
    assert len(table) == len(plain) > 0
    assert (table["outer_s"] >= table["total_s"] + 2e-3)[1:].all()  # the first plan is made before anything is executed


def test_a_drive_over_its_budget_stops_and_keeps_its_steps(case: Case) -> None:
    measured = measure(case, RICCATI, budget=1e-9, judged=True)
    assert (measured.outcome, len(measured.steps), measured.judgement) == (OVER_BUDGET, 1, None)
    assert "of planning" in measured.message
    assert gc.isenabled()


def test_a_solver_that_cannot_even_begin_is_a_row_with_its_reason(case: Case) -> None:
    measured = measure(case, Fake("not a number", honest=0), budget=_PATIENCE_S, judged=True)
    assert (measured.outcome, measured.statuses, measured.judgement) == (FAILED, (), None)
    assert "the first plan could not be solved" in measured.message
    assert measured.table().empty
    assert gc.isenabled()


def test_a_solver_that_fails_on_the_way_keeps_driving_and_every_failure_counts(case: Case, tiny: Suite) -> None:
    measured = measure(case, Fake("not a number", honest=6), budget=_PATIENCE_S, judged=True)
    refused = int((~measured.table()["usable"]).sum())
    assert 0 < refused < 12
    row = tables_of(tiny.cells()[:1], [[measured]]).timing.iloc[0]
    assert (row["failures"], row["steps"]) == (refused, 11)
    assert row["status"] == "some steps not solved"
    assert np.isnan(row["primal_max"])


def test_only_what_is_missing_is_measured(tiny: Suite, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    suite = replace(tiny, schemes=("rti",))
    makers = {name: solver_named(name) for name in suite.solvers}
    run(suite, cases_of(suite), makers, tmp_path, lambda _: None, in_process=True)
    kept = part_file(tmp_path, 0, 1).read_bytes()
    part_file(tmp_path, 1, 0).unlink()
    assert remaining(suite, tmp_path) == 1
    seen = []

    def write(path: Path, measured: Measurement) -> None:
        seen.append(path)
        write_part(path, measured)

    monkeypatch.setattr("hdvplan.bench.measuring.run.write_part", write)
    run(suite, cases_of(suite), makers, tmp_path, lambda _: None, in_process=True)
    assert seen == [part_file(tmp_path, 1, 0)]
    assert part_file(tmp_path, 0, 1).read_bytes() == kept


def test_a_kept_measurement_reads_back_exactly(case: Case, tmp_path: Path) -> None:
    for measured in (
        measure(case, RICCATI, budget=_PATIENCE_S, judged=True),
        measure(case, Fake("not a number", honest=0), budget=_PATIENCE_S, judged=True),
    ):
        file = part_file(tmp_path, 3, 1)
        write_part(file, measured)
        back = read_part(file)
        np.testing.assert_array_equal(back.steps, measured.steps)
        assert (back.statuses, back.outcome, back.message, back.nonzeros) == (
            measured.statuses, measured.outcome, measured.message, measured.nonzeros
        )  # fmt: skip
        assert (back.judgement is None) == (measured.judgement is None)
        if back.judgement is not None and measured.judgement is not None:
            for name, value in vars(measured.judgement).items():
                np.testing.assert_array_equal(getattr(back.judgement, name), value)
    assert [path.name for path in (tmp_path / "parts").iterdir()] == [file.name]  # nothing half-written is left


@pytest.mark.parametrize("keep", [0, 1, 40, -30])
def test_a_damaged_measurement_is_named_with_what_to_do(tmp_path: Path, keep: int) -> None:
    file = part_file(tmp_path, 0, 0)
    write_part(file, Measurement(np.zeros((2, len(NUMBERS))), ("solved", "solved"), OK, "", 0, None))
    assert read_part(file).outcome == OK
    file.write_bytes(file.read_bytes()[:keep])
    with pytest.raises(OptionError, match="cannot be read") as caught:
        read_part(file)
    assert "delete it" in str(caught.value.hint)


@pytest.mark.parametrize("objective", ["balanced", "axle-max", "body-max"])
def test_every_kind_of_objective_is_timed_and_its_own_columns_and_rows_are_counted(tiny: Suite, objective: str) -> None:
    case, usual = (cases_of(replace(tiny, objective=name))[0] for name in (objective, "geometric"))
    measured = measure(case, RICCATI, budget=_PATIENCE_S, judged=True)
    assert (measured.outcome, len(measured.steps)) == (OK, 12)
    assert measured.table()["usable"].all()
    rows = measured.nonzeros - measure(usual, RICCATI, budget=_PATIENCE_S, judged=False).nonzeros
    assert (rows > 0) == (objective != "balanced")  # a largest reach has rows of its own for every watched point


def test_a_table_that_unpacks_to_more_than_memory_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hdvplan.bench.measuring.samples._LARGEST", 1_000_000)
    (tmp_path / "samples.csv.gz").write_bytes(gzip.compress(b"a\n" + b"0\n" * 600_000))
    with pytest.raises(ValueError, match="unpacks to more than 1 MB"):
        read_plain(tmp_path / "samples.csv.gz")
    (tmp_path / "samples.csv.gz").write_bytes(gzip.compress(b"a\n" + b"0\n" * 400_000))
    assert len(read_plain(tmp_path / "samples.csv.gz")) == 400_000
