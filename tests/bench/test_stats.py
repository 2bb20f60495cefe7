from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from hdvplan.bench.measuring.ranking import ranked_times
from hdvplan.bench.measuring.samples import FAILED, NUMBERS, OVER_BUDGET, WRONG, Measurement
from hdvplan.bench.measuring.stats import SOME_REFUSED, SOME_UNSOLVED, status_of, tables_of
from hdvplan.bench.measuring.timing import accuracy, captions, summary_tables
from hdvplan.bench.suite import Cell, Suite
from hdvplan.planning.settings import Scheme
from tests.bench.conftest import made_up

RTI, SQP = Scheme.RTI, Scheme.SQP


def cell(scheme: Scheme = RTI, solver: str = "riccati", road: str = "road") -> Cell:
    return Cell(road, "bus", scheme, solver)


def only(rounds: list[Measurement]) -> pd.Series[Any]:
    return tables_of([cell()], [rounds]).timing.iloc[0]


def test_the_cold_start_is_told_apart_from_the_steps_that_follow() -> None:
    row = only([made_up([0.9, 0.001, 0.003])])
    # Sums and products of a few decimals: exact to rounding.
    assert row["cold_ms"] == pytest.approx(900.0)
    assert row["mean_ms"] == pytest.approx(2.0)
    assert row["max_ms"] == pytest.approx(3.0)
    assert row["steps"] == 2


def test_a_step_whose_work_was_elsewhere_counts_by_the_clock_and_one_that_was_held_up_does_not() -> None:
    cpu, waits = NUMBERS.index("cpu_s"), NUMBERS.index("waits")
    away = made_up([0.1, *([0.002] * 4)])
    away.steps[1:, cpu] = [0.0002, 0.0002, 0.0019, 0.003]
    away.steps[1:, waits] = [1, 3, 0, 1]  # of two steps another process did the work; the last one had several threads
    assert ranked_times(tables_of([cell()], [[away]]).samples)["ms"].to_numpy() == pytest.approx([2.0, 2.0, 1.9, 3.0])


def test_on_a_busy_machine_the_step_of_a_slow_solver_and_its_ratio_are_of_one_clock() -> None:
    quick, slow = made_up([0.1, *([0.001] * 4)]), made_up([0.1, *([0.028] * 4)])
    slow.steps[1:, NUMBERS.index("cpu_s")] = 0.014  # others take the core from it in every step, and hardly ever from the quick one
    summary = tables_of([cell(), cell(solver="piqp")], [[quick], [slow]]).summary.set_index("solver")
    assert summary.loc["piqp", "step_ms"] == pytest.approx(14.0)
    assert summary.loc["piqp", "ratio"] == pytest.approx(14.0)


def test_percentiles_are_those_of_all_rounds_together() -> None:
    seconds = list(np.arange(1, 101) / 1e3)
    row = only([made_up([0.0, *seconds[:50]]), made_up([0.0, *seconds[50:]])])
    assert row["p50_ms"] == pytest.approx(50.5)  # interpolated halfway between 50 and 51
    assert row["p95_ms"] == pytest.approx(np.percentile(range(1, 101), 95))
    assert row["p99_ms"] == pytest.approx(np.percentile(range(1, 101), 99))
    assert row["p99_99_ms"] == pytest.approx(99.9901)  # of a hundred steps: a hundredth of the way from the slowest to the next


def test_a_disturbed_round_moves_the_max_but_not_the_fastest() -> None:
    row = only([made_up([0.1, 0.001, 0.002, 0.500]), made_up([0.1, 0.001, 0.400, 0.003]), made_up([0.1, 0.3, 0.002, 0.004])])
    assert row["max_ms"] == pytest.approx(500.0)
    assert row["fastest_max_ms"] == pytest.approx(3.0)
    assert row["fastest_mean_ms"] == pytest.approx(2.0)


def test_a_solver_s_own_doubts_are_counted_apart_from_failures() -> None:
    row = only([replace(made_up([0.1, 0.1, 0.1]), statuses=("solved", "iteration limit", "inaccurate"))])
    assert (row["unsolved"], row["failures"], row["status"]) == (2, 0, "ok")


def test_a_solver_that_reports_no_iterations_shows_none() -> None:
    assert np.isnan(only([made_up([0.1, 0.002], iterations=0)])["iterations_mean"])


def test_a_residual_that_is_no_number_is_not_hidden_by_others() -> None:
    measured = made_up([0.1, 0.002, 0.004], usable=False)
    measured.steps[1, 8] = np.nan
    assert np.isnan(only([measured])["primal_max"])


def test_failures_count_refused_steps_and_drives_that_ended() -> None:
    row = only([made_up([0.1, 0.1], usable=False), made_up([0.1], outcome=FAILED, message="no foot", shift=None)])
    assert row["failures"] == 3
    assert [row["status"], row["message"]] == [FAILED, "no foot"]


@pytest.mark.parametrize(
    ("rounds", "status"),
    [
        ([made_up([0.1])], "ok"),
        ([made_up([0.1]), made_up([0.1], usable=False)], SOME_UNSOLVED),
        ([made_up([0.1], usable=False), made_up([0.1], outcome=OVER_BUDGET)], OVER_BUDGET),
        ([made_up([], outcome=FAILED)], FAILED),
    ],
)
def test_a_cell_s_status_is_that_of_its_worst_drive(rounds: list[Measurement], status: str) -> None:
    assert status_of(rounds)[0] == status


@pytest.mark.parametrize(("step", "round_"), [(0, 0), (0, 1), (2, 1)])
def test_a_step_that_is_not_accepted_in_any_round_keeps_a_solver_from_winning(step: int, round_: int) -> None:
    judged = [replace(made_up([0.1, 0.01, 0.01]), distances=np.tile([0.0, 0.0, 1.0], (3, 1))) for _ in range(2)]
    judged[round_].steps[step, NUMBERS.index("dual")] = 1.0
    tables = tables_of([cell()], [judged])
    row = tables.timing.iloc[0]
    assert (row["status"], row["accepted"], row["expected"]) == (SOME_REFUSED, 2, 3)
    assert "1 of 6 steps" in row["message"]
    assert not tables.summary["proved"].any()


def test_a_cell_without_any_step_is_a_row_without_times() -> None:
    tables = tables_of([cell(), cell(solver="piqp")], [[made_up([], outcome=FAILED, shift=None)], [made_up([0.1, 0.2])]])
    assert list(tables.timing["steps"]) == [0, 1]
    assert np.isnan(tables.timing["mean_ms"][0])
    assert np.isnan(tables.envelope["path_difference_m"]).all()  # the first has no path, the second nothing to compare with
    assert dict(zip(tables.summary["solver"], tables.summary["cells_ok"], strict=True)) == {"piqp": 1, "riccati": 0}  # the able one first
    assert accuracy(tables.summary).endswith("piqp at 1e-08: no path to compare.")


def test_a_fast_wrong_solver_shows_in_its_path() -> None:
    cells = [cell(), cell(solver="hasty")]
    tables = tables_of(cells, [[made_up([0.1, 0.01])], [made_up([0.1, 0.001], shift=-0.03)]])
    assert list(tables.envelope["path_difference_m"]) == [0.0, 0.03]
    hasty = tables.summary[tables.summary["solver"] == "hasty"].iloc[0]
    assert (hasty["path_difference_m"], hasty["failures"]) == (0.03, 0)


def test_paths_are_compared_under_the_same_scheme_and_on_the_same_road() -> None:
    cells = [cell(scheme, solver, road) for road in "ab" for scheme in (RTI, SQP) for solver in ("piqp", "riccati")]
    shifts = [0.1, 0.1, 0.2, 0.2, 0.3, 0.3, 0.4, 0.4]
    tables = tables_of(cells, [[made_up([0.1, 0.1], shift=shift)] for shift in shifts])
    assert (tables.envelope["path_difference_m"] == 0.0).all()


def test_sqp_is_set_against_rti_by_mean_worst_case_and_envelope() -> None:
    cells = [cell(RTI), cell(SQP), cell(RTI, "osqp")]
    rounds = [[made_up([9.0, 0.01, 0.03])], [made_up([9.0, 0.02, 0.30], shift=0.004)], [made_up([9.0, 0.01])]]
    schemes = tables_of(cells, rounds).schemes
    assert list(schemes["solver"]) == ["riccati"]  # OSQP ran only one scheme
    row = schemes.iloc[0]
    assert row["mean_ratio"] == pytest.approx(0.16 / 0.02)
    assert row["max_ratio"] == pytest.approx(10.0)
    assert row["envelope_difference_m"] == pytest.approx(0.004)


@pytest.mark.parametrize("classes", [("as set",), ("inactive", "binding")])
def test_the_schemes_in_the_terminal_name_the_class_of_limits_where_there_are_any(classes: tuple[str, ...]) -> None:
    cells = [replace(cell(scheme), limits=limits) for limits in classes for scheme in (RTI, SQP)]
    table = summary_tables(vars(tables_of(cells, [[made_up([9.0, 0.01, 0.03])]] * len(cells))))[-1]
    columns = {str(column.header): list(map(str, column.cells)) for column in table.columns}
    assert columns.get("limits", ["as set"]) == list(classes)


def test_the_schemes_in_the_terminal_are_ratios_of_the_steps_above_and_leave_out_what_is_not_ok() -> None:
    cells = [cell(scheme, solver) for scheme in (RTI, SQP) for solver in ("riccati", "piqp")]
    rounds = [[made_up([9.0, 0.01, 0.02])], [made_up([9.0, 0.01])], [made_up([9.0, 0.03, 0.05])], [made_up([9.0, 0.01])]]
    for (drive,), took in ((rounds[0], 0.01), (rounds[2], 0.02)):
        drive.steps[1:, NUMBERS.index("cpu_s")] = took  # by the clock they took twice to three times as long: others had the core
    rounds[3][0].steps[1, NUMBERS.index("usable")] = 0.0
    table = summary_tables(vars(tables_of(cells, rounds)))[-1]
    columns = [list(map(str, column.cells)) for column in table.columns]
    assert list(zip(*columns, strict=True)) == [("bus", "riccati", "2.00", "2.00", "0.0e+00"), ("bus", "piqp", "-", "-", "-")]


@pytest.mark.parametrize(("off", "status"), [(0.0, SOME_UNSOLVED), (0.1, WRONG)])
def test_a_path_that_bad_steps_did_not_spoil_is_no_merit_of_theirs(off: float, status: str) -> None:
    careless = replace(made_up([0.1, 0.01, 0.01], shift=1e-10), distances=np.tile([off, 0.0, 1.0], (3, 1)))
    careless.steps[2, NUMBERS.index("usable")] = status == WRONG  # else the last plan was driven instead
    tables = tables_of([cell(), cell(solver="piqp")], [[made_up([0.1, 0.01, 0.01])], [careless]])
    assert tables.timing["status"].tolist() == ["ok", status]
    assert tables.envelope["path_difference_m"].isna().tolist() == [False, True]


def test_the_summary_pools_the_steps_of_all_roads() -> None:
    cells = [cell(road="long"), cell(road="short")]
    summary = tables_of(cells, [[made_up([0.1] + [0.001] * 3)], [made_up([0.1, 0.005])]]).summary
    assert len(summary) == 1
    assert summary["mean_ms"][0] == pytest.approx(2.0)  # (3 x 1 + 5) / 4
    assert summary["fastest_max_ms"][0] == pytest.approx(5.0)
    assert (summary["cells"][0], summary["steps"][0]) == (2, 4)


def test_a_caption_says_by_which_rule_steps_were_accepted() -> None:
    found, machine = tables_of([cell()], [[made_up([0.1, 0.2])]]), {"processor": "any", "python": "any"}
    own, held = (captions(Suite(solvers=("riccati",), accuracy=accuracy), machine, found)["summary"] for accuracy in (None, 1e-4))
    assert "accepted: steps whose recomputed residuals prove them" in own
    assert "dual and gap" in own
    assert "as a share of all, also of those not reached in time" in own
    assert "accepted: steps with e_y within 0.0002 m of the optimum" in held
    assert "dual and gap" not in held  # residuals decide nothing here


def test_on_a_sample_the_default_solver_is_told_its_tolerance_and_distance_as_all_others() -> None:
    summary = pd.DataFrame({"solver": ["riccati", "piqp"], "path_difference_m": [np.nan, np.nan], "distance_m": [9e-5, 2e-5]})
    told = accuracy(summary, {"riccati, as set": 1e-2, "piqp, as set": 1e-4})
    assert told.endswith("from the optimum: riccati at 0.01: 9.0e-05 m; piqp at 0.0001: 2.0e-05 m.")
