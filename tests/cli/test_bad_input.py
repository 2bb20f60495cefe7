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
