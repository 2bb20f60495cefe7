from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pytest

from hdvplan.bench.measuring.pictures import bench_figure, order_of, pictured, share_within
from hdvplan.bench.measuring.ranking import Finding, Load, findings_of, load_of
from hdvplan.bench.measuring.samples import FAILED, NUMBERS, OVER_BUDGET, Measurement
from hdvplan.bench.measuring.stats import Tables, tables_of
from hdvplan.bench.measuring.timing import latex, shown
from hdvplan.bench.suite import Cell
from hdvplan.planning.settings import Scheme
from hdvplan.report.style import styled
from tests.bench.conftest import made_up

QUIET = Load(0.1, 1.0, 2, 1.0, "")
QUIET_SESSION = {"started": "2026-01-01T09:59:00+00:00", "load_average": [0.1, 0.1, 0.1]}
FINISHED = "2026-01-01T10:00:00+00:00"


def tables(**rounds: list[Measurement]) -> Tables:
    return tables_of([Cell("road", "bus", Scheme.RTI, solver) for solver in rounds], list(rounds.values()))


def finding(found: Tables, load: Load = QUIET) -> Finding:
    (only,) = findings_of(found.summary, load)
    return only


def test_the_fastest_solver_is_named_with_its_share_its_lead_and_the_agreement() -> None:
    rounds = [made_up([0.1, 0.001, 0.009]), made_up([0.1, 0.008, 0.003])]  # of every step the fastest counts
    told = finding(tables(slow=[made_up([0.1, 0.004, 0.002], shift=1e-9)], riccati=rounds))
    assert (told.winner, told.runner_up) == ("riccati", "slow")
    assert told.won == 0.5
    # Geometric means of (1.1, 3.1) and (4.1, 2.1) ms, less the shift of 0.1 ms.
    assert told.ratio == pytest.approx((np.sqrt(4.1 * 2.1) - 0.1) / (np.sqrt(1.1 * 3.1) - 0.1))
    assert (
        told.text
        == "bus, rti: riccati is fastest in 50.0 % of 2 steps, 1.6 times as fast as slow (1.75 ms a step), the same path to 1e-09 m"
    )


def test_solvers_within_five_percent_have_no_winner() -> None:
    told = finding(tables(one=[made_up([0.1, 0.00100])], other=[made_up([0.1, 0.00104])]))
    assert told.winner is None
    assert told.text.startswith("bus, rti: no winner: one and other within 4.0 %, 1 ms a step")


@pytest.mark.parametrize(
    "bad", [made_up([0.1, 0.0001], usable=False), made_up([0.1], outcome=FAILED, message="no"), made_up([], outcome=FAILED)]
)
def test_a_solver_that_fails_cannot_win_however_fast_it_is(bad: Measurement) -> None:
    told = finding(tables(hasty=[bad], riccati=[made_up([0.1, 0.001])]))
    assert told.winner == "riccati"
    assert "not ranked with it: hasty" in told.text or "only solver with accepted steps" in told.text


def test_a_solver_that_fails_later_takes_no_win_by_the_steps_that_it_did_fast() -> None:
    hasty = made_up([0.1, 0.0001], outcome=FAILED, message="no")
    found = tables(hasty=[hasty], riccati=[made_up([0.1, 0.001, 0.001])])
    told = finding(found)
    assert (told.winner, told.runner_up, told.ratio) == ("riccati", None, None)
    assert told.text == "bus, rti: riccati is the only solver with all its steps accepted, 1 ms a step; not ranked with it: hasty"
    assert list(shown(found.summary, "summary").set_index("solver")["x best"]) == ["1.0", "-"]


def test_a_solver_that_drives_another_path_is_not_said_to_lack_accepted_steps() -> None:
    told = finding(tables(riccati=[made_up([0.1, 0.001])], aside=[made_up([0.1, 0.0001], shift=0.05)]))
    assert told.text == (
        "bus, rti: riccati is the only solver with every status ok and every step accepted, 1 ms a step; not ranked with it: aside"
    )


def test_the_path_of_a_reference_that_is_wrong_itself_measures_no_other() -> None:
    off = np.array([[0.01, 0.0, 1.0], [0.01, 0.0, 1.0]])  # 1 cm from the optimum
    found = tables(riccati=[replace(made_up([0.1, 0.0001], shift=0.05), distances=off)], other=[made_up([0.1, 0.001])])
    assert found.timing.set_index("solver")["status"].to_dict() == {"riccati": "wrong optimum", "other": "ok"}
    assert finding(found).winner == "other"
    assert found.summary["path_difference_m"].isna().all()


def test_a_solver_that_its_budget_stopped_is_compared_over_the_steps_that_both_did() -> None:
    found = tables(slow=[made_up([0.1, 0.010], outcome=OVER_BUDGET, shift=None)], riccati=[made_up([0.1, 0.001, 0.009])])
    assert finding(found).ratio == pytest.approx(10.0)
    assert finding(found).runner_up == "slow"
    assert "10.0 times as fast as slow, over the steps that slow did within its budget (" in finding(found).text


@pytest.mark.parametrize(("seconds", "winner"), [(0.00119, None), (0.00121, "one")])
def test_a_busy_machine_has_no_winner_by_less_than_a_fifth(seconds: float, winner: str | None) -> None:
    found, busy = tables(one=[made_up([0.1, 0.001])], other=[made_up([0.1, seconds])]), replace(QUIET, warning="BUSY MACHINE")
    assert finding(found).winner == "one"
    assert finding(found, busy).winner == winner


def test_the_share_of_won_steps_does_not_depend_on_who_failed() -> None:
    able = {"riccati": [made_up([0.1, 0.001, 0.004])], "slow": [made_up([0.1, 0.004, 0.002])]}
    hasty = made_up([0.1, 0.0001, 0.0001])
    hasty.steps[2, NUMBERS.index("usable")] = 0.0
    alone, beside = tables(**able).summary, tables(**able, hasty=[hasty]).summary.set_index("solver")["won"]
    assert dict(zip(alone["solver"], alone["won"], strict=True)) == {"riccati": 0.5, "slow": 0.5}
    assert [beside["riccati"], beside["slow"]] == [0.5, 0.5]
    assert np.isnan(beside["hasty"])


def test_the_headline_is_of_accepted_steps_alone() -> None:
    hasty = made_up([0.1, 0.00007, 0.00007, 0.005])
    hasty.steps[1:3, NUMBERS.index("usable")] = 0.0
    found = tables(hasty=[hasty], riccati=[made_up([0.1, 0.001, 0.001, 0.001])])
    row = found.summary.set_index("solver").loc["hasty"]
    assert [row["step_ms"], row["median_ms"], row["worst_ms"]] == pytest.approx([5.0, 5.0, 5.0])
    assert row["distinct_steps"] == 3
    assert np.isnan(tables(hasty=[made_up([0.1, 0.00007], usable=False)]).summary["step_ms"].iloc[0])


def test_time_against_accuracy_shows_only_cells_whose_steps_are_all_accepted() -> None:
    rounds = {}
    for name, refused in (("hasty", 1), ("riccati", 0)):
        measured = made_up([0.1, 0.001, 0.001])
        measured.steps[2, NUMBERS.index("usable")] = 1 - refused
        rounds[name] = [replace(measured, distances=np.array([[1e-9, 1e-9, 10.0]] * 3))]
    found = tables(**rounds)
    shown = pictured(found.samples, found.timing, ["riccati", "hasty"])
    assert {name: len(points) for name, points in shown.accuracy.items()} == {"riccati": 1, "hasty": 0}


def test_neighbours_that_lengthen_the_clock_do_not_move_the_ranking() -> None:
    loaded = made_up([0.1, 0.010, 0.010])
    loaded.steps[:, NUMBERS.index("cpu_s")] = [0.1, 0.002, 0.002]
    rival = made_up([0.1, 0.012, 0.012])
    rival.steps[:, NUMBERS.index("cpu_s")] = [0.1, 0.003, 0.003]
    summary = tables(riccati=[loaded], rival=[rival]).summary
    assert list(summary["step_ms"]) == pytest.approx([2.0, 3.0])  # all waited alike: none of them of its own
    load = load_of(summary, [QUIET_SESSION], [1.0, 1.0, 1.0], 2, FINISHED)
    assert load.warning.startswith("BUSY MACHINE: steps took 4.50 times as long by the clock as by the processor on 2 cores")
    (told,) = findings_of(summary, load)
    assert told.text.endswith("[busy machine]")


@pytest.mark.parametrize(
    ("minutes", "begun", "ended", "busy"),
    [
        (1, 0.2, [1.2, 0.0, 0.0], False),
        (1, 1.9, [1.2, 0.0, 0.0], True),
        (1, 0.2, [2.9, 0.0, 0.0], True),
        (1, 0.2, [1.2, 2.9, 2.9], False),  # from before the session
        (9, 1.9, [1.0, 1.4, 2.0], False),  # only the minute before it was busy
        (9, 0.2, [1.0, 2.9, 2.0], True),  # some of its last five minutes were
        (20, 0.2, [1.0, 1.0, 2.9], True),
        (1, None, None, False),
    ],
)
def test_a_busy_machine_is_told_by_its_load(minutes: int, begun: float | None, ended: list[float] | None, busy: bool) -> None:
    summary = tables(riccati=[made_up([0.1, 0.001])]).summary
    started = (datetime.fromisoformat(FINISHED) - timedelta(minutes=minutes)).isoformat()
    sessions = [{"started": started, "load_average": None if begun is None else [begun, 0.0, 0.0]}]
    assert bool(load_of(summary, sessions, ended, 2, FINISHED).warning) is busy


def test_a_profile_counts_what_a_solver_was_given_and_failures_never_come() -> None:
    found = tables(
        riccati=[made_up([0.1, 0.001, 0.004, 0.001])],
        rival=[made_up([0.1, 0.002, 0.002, 0.002])],
        stopped=[made_up([0.1, 0.008], outcome=OVER_BUDGET, shift=None)],
        failed=[made_up([0.1, 0.001], outcome=FAILED, shift=None)],
        never=[made_up([0.1], outcome=FAILED, shift=None)],
    )
    shown = pictured(found.samples, found.timing, ["riccati", "rival", "stopped", "failed", "never"])
    assert list(shown.ratios) == ["riccati", "rival", "stopped", "failed"]  # a line on zero says nothing
    assert shown.steps == 3
    np.testing.assert_allclose(shown.ratios["riccati"], [1.0, 1.0, 2.0])
    np.testing.assert_allclose(shown.ratios["stopped"], [8.0])
    np.testing.assert_allclose(shown.ratios["failed"], [1.0, np.inf, np.inf])
    np.testing.assert_allclose(share_within(shown.ratios["riccati"], np.array([1.0, 1.9, 2.0])), [2 / 3, 2 / 3, 1.0])


def test_what_is_timed_of_a_sample_is_called_a_qp() -> None:
    measured = made_up([0.1, 0.001, 0.002])
    measured.steps[:, NUMBERS.index("linearise_s")] = 0.0
    found = tables(riccati=[replace(measured, distances=np.array([[0.0, 0.0, 10.0]] * 3))])
    assert finding(found).text == ("bus, rti: riccati alone, 1.42 ms a QP, all 2 QPs accepted; no other solver to compare with")
    shown = pictured(found.samples, found.timing, ["riccati"])
    axes = bench_figure(shown, "title", "caption").axes
    assert [one.get_ylabel() for one in axes] == ["share of QPs", "", "QP [ms]", "QP [ms]"]
    assert axes[1].get_xlabel() == "QP [ms]"
    assert axes[3].get_xlabel() == "e_y off the optimum, at most [m]; below 1e-14 drawn there"


def test_ten_solvers_have_ten_colours() -> None:
    found = tables(**{f"solver{number}": [made_up([0.1, 0.001])] for number in range(10)})
    figure = bench_figure(pictured(found.samples, found.timing, order_of(found.summary)), "title", "caption")
    assert len({line.get_color() for line in figure.axes[0].get_lines()}) == 10


def test_numbers_on_axes_are_no_formulas() -> None:
    measured = made_up([0.1, 0.001, 0.002])
    found = tables(riccati=[replace(measured, distances=np.array([[1e-12, 0.0, 10.0], [1e-9, 0.0, 10.0], [1e-6, 0.0, 10.0]]))])
    figure = bench_figure(pictured(found.samples, found.timing, ["riccati"]), "title", "caption")
    with styled():
        figure.draw_without_rendering()
    said = [label.get_text() for axes in figure.axes for axis in (axes.xaxis, axes.yaxis) for label in axis.get_ticklabels()]
    assert any(said)
    assert not [text for text in said if "$" in text]


def test_names_that_latex_would_read_are_escaped_in_cells_caption_and_foot() -> None:
    timing = tables(riccati=[made_up([0.1, 0.001])]).timing.assign(road="a_b&50%")
    text = latex(timing, "timing", "of a_b {50%} ~ \\x", ["x_y^2 < 1e-4"])
    assert r"a\_b\&50\%" in text
    assert r"\caption{of a\_b \{50\%\} \textasciitilde{} \textbackslash{}x}" in text
    assert r"\par\footnotesize x\_y\textasciicircum{}2 $<$ 1e-4" in text
    assert text.count("{table}") == 2
    depth = np.cumsum([{"{": 1, "}": -1}.get(letter, 0) for letter in text.replace(r"\{", "").replace(r"\}", "")])
    assert (depth.min(), depth[-1]) == (0, 0)


def test_a_latex_summary_has_what_a_page_has_room_for_and_is_never_wider_than_a_line() -> None:
    text = latex(tables(riccati=[made_up([0.1, 0.001])]).summary, "summary", "caption", ["foot"])
    head = next(line for line in text.splitlines() if line.startswith("vehicle &"))
    assert head.count("&") <= 12  # of 23 columns
    assert text.index(r"\resizebox") < text.index(r"\begin{tabular}") < text.index("\\end{tabular}}")


def test_a_step_that_the_residuals_do_not_prove_is_not_accepted() -> None:
    told = made_up([0.1, 0.001, 0.001])
    distances = np.array([[0.0, 0.0, 10.0]] * 3)
    told.steps[1, NUMBERS.index("dual")] = 2e-3  # 1e-4 of the largest multiplier is allowed, which is 10
    found = tables(riccati=[replace(told, distances=distances)])
    assert list(found.samples["accepted"]) == [True, False, True]
    assert found.timing["status"].iloc[0] == "some steps not accepted"
    assert found.timing["success"].iloc[0] == pytest.approx(2 / 3)
    assert "dual residual 2.0e-03" in found.timing["message"].iloc[0]
