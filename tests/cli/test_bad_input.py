from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.cli.conftest import Cli, Outcome

BUS = ("--vehicle", "bus", "--no-plot")


def refused(outcome: Outcome, *words: str, code: int = 2) -> None:
    """Assert that a command ended in one error line, perhaps a hint line, nothing on stdout, and a meaningful message."""
    assert outcome.code == code
    assert outcome.out == ""
    lines = outcome.err.splitlines()
    assert lines[0].startswith("error: ")
    assert len(lines) == 1 or (len(lines) == 2 and lines[1].startswith("hint: "))
    for word in words:
        assert word in outcome.err


def test_limits_of_the_file_narrower_than_the_vehicle_are_a_warning_with_the_place_and_then_a_broken_limit(
    cli: Cli, tmp_path: Path
) -> None:
    (tmp_path / "narrow.csv").write_text("s,kappa,left,right\n0,0,2,2\n40,0,1.2,1.2\n60,0,2,2\n", encoding="utf-8")
    outcome = cli("plan", "narrow.csv", *BUS)
    assert outcome.code == 1
    again, warning, error, _ = outcome.err.splitlines()
    assert again.startswith("the first plan lacks 0.07")
    # 2.54 m from 4 m to 2.4 m over 40 m, and back over 20 m; looked at every 0.5 m
    assert warning == "warning: too narrow for the bus from s = 37.0 to 41.5 m: limits are 2.40 m apart, needs 2.54 m"
    assert re.search(" of the bus breaks the (left|right) limit by 0.0", error)  # no part of a bus on a straight is deeper than another


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--vehicle", "tram"), ("unknown vehicle 'tram'", "hint")),
        (("--vehicle", "missing.toml"), ("missing.toml", "does not exist")),
        ((), ("missing option '--vehicle'", "hdvplan plan --help")),
        ((*BUS, "--horizon", "-100"), ("horizon", "-100")),
        ((*BUS, "--step", "0.3"), ("whole number of steps",)),
        ((*BUS, "--step", "nan"), ("step",)),
        ((*BUS, "--step", "half"), ("--step",)),
        ((*BUS, "--replan", "200"), ("replanning distance", "longer than the horizon")),
        ((*BUS, "--smooth", "-1"), ("smooth must be a positive number, not -1",)),
        ((*BUS, "--scheme", "mpc"), ("--scheme", "rti or sqp", "'mpc'")),
        ((*BUS, "--solver", "simplex"), ("unknown solver 'simplex'", "hint")),
        ((*BUS, "--objective", "geometrik"), ("unknown objective", "did you mean 'geometric'")),
        ((*BUS, "--bias", "left"), ("--bias left is neither",)),
        ((*BUS, "--half-width", "3", "--left", "2"), ("--half-width", "--left")),
        ((*BUS, "--left", "3"), ("--left needs --right",)),
        ((*BUS, "--half-width", "-3"), ("must be a positive number of metres",)),
        ((*BUS, "--half-width", "1"), ("2.00 m apart", "2.54 m wide")),
        ((*BUS, "extra"), ("unexpected",)),
    ],
)
def test_a_wrong_option_is_refused_in_one_line(cli: Cli, arguments: tuple[str, ...], words: tuple[str, ...]) -> None:
    refused(cli("plan", "uturn", *arguments), *words)


def test_output_into_a_file_is_refused_before_planning(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("mine", encoding="utf-8")
    refused(cli("plan", "uturn", *BUS, "--out", "taken"), "taken is a file")
    refused(cli("plan", "uturn", *BUS, "--out", "taken/deeper"), "cannot write to", "--out")
    assert (tmp_path / "taken").read_text(encoding="utf-8") == "mine"


def test_unknown_names_come_with_a_suggestion(cli: Cli) -> None:
    refused(cli("plan", "goteborg_nya_alen", *BUS), "goteborg_nya_allen")
    refused(cli("plan", "excel_lower.csv", *BUS), "excel_lower.csv does not exist", "give a road file")
    refused(cli("roads"), "missing command", "hdvplan roads --help")


def test_an_unexpected_exception_is_one_line_and_a_code_of_its_own(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_name: str) -> None:
        msg = "index 3 is\nout of bounds"
        raise IndexError(msg)

    monkeypatch.setattr("hdvplan.vehicle.load.read_vehicle", fail)
    refused(cli("plan", "uturn", *BUS), "internal: IndexError: index 3 is out of bounds", "--debug", code=70)


@pytest.mark.parametrize("arguments", [("--debug", "plan", "nowhere", *BUS), ("plan", "nowhere", *BUS, "--debug")])
def test_debug_shows_the_traceback_on_either_side_of_the_command(cli: Cli, arguments: tuple[str, ...]) -> None:
    outcome = cli(*arguments)
    assert outcome.code == 2
    assert "Traceback (most recent call last)" in outcome.err
    assert "error: no road file" in outcome.err


def test_an_interrupt_is_reported_as_shells_do(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(_name: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("hdvplan.vehicle.load.read_vehicle", interrupt)
    refused(cli("plan", "uturn", *BUS), "interrupted", code=130)


@pytest.mark.parametrize(
    "arguments",
    [
        ("roads", "make", "uturn", "--out", "."),
        ("roads", "info", "uturn", "--csv", "."),
        ("roads", "info", "uturn", "--csv", "missing/needs.csv"),
    ],
)
def test_a_file_that_cannot_be_written_is_refused_in_a_line(cli: Cli, arguments: tuple[str, ...]) -> None:
    outcome = cli(*arguments)
    assert (outcome.code, outcome.out) == (2, "")
    assert re.fullmatch(
        rf"error: cannot write {re.escape(arguments[-1])}: .*\nhint: choose another file with {arguments[-2]}\n", outcome.err
    )


@pytest.mark.parametrize("lengths", [("--step", "1e-9"), ("--horizon", "1e6", "--step", "0.05")])
def test_steps_that_no_memory_holds_are_refused(cli: Cli, lengths: tuple[str, ...]) -> None:
    refused(cli("plan", "uturn", *BUS, *lengths), "a step has at least 0.01 m, a horizon at most 20000 steps")
