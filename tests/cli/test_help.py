"""Help texts and tables read well in 80 and 120 columns, and in a pipe."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.cli.conftest import Cli

COMMANDS = [
    "", "plan", "judge", "need", "turn", "study", "report", "bench", "compare", "reproduce", "export-c", "roads", "roads list",
    "roads info", "roads make", "roads extract", "vehicles", "vehicles list", "vehicles show", "solvers",
]  # fmt: skip
PLANKEN = Path(__file__).parents[1] / "network" / "files" / "planken.osm.pbf"
GROUP = re.compile(r"^(\S.*):$", flags=re.MULTILINE)


@pytest.mark.parametrize("columns", [80, 120])
@pytest.mark.parametrize("command", COMMANDS)
def test_help_fits_the_terminal_and_ends_no_line_in_blanks(cli: Cli, monkeypatch: pytest.MonkeyPatch, command: str, columns: int) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    outcome = cli(*command.split(), "--help")
    assert (outcome.code, outcome.err) == (0, "")
    lines = outcome.out.splitlines()
    assert lines[0].startswith("Usage: hdvplan")
    assert max(map(len, lines)) <= columns
    assert not [line for line in lines if line != line.rstrip()]
    assert "\x1b" not in outcome.out


def test_help_says_the_least_that_an_option_takes(cli: Cli) -> None:
    assert "at the motion; it begins with one. At least 3." in " ".join(cli("export-c", "--help").out.split())


@pytest.mark.parametrize(
    ("command", "groups"),
    [
        ("plan", ["Arguments", "Vehicle and room", "Road file", "Planning", "Output", "Options"]),
        ("judge", ["Arguments", "Vehicle and room", "Road file", "Planning", "Closed loop", "Output", "Options"]),
        ("need", ["Arguments", "Vehicle and room", "Road file", "Output", "Planning", "Turning heads and docks", "Options"]),
        ("turn", ["Vehicle and room", "Turn", "Turning heads and docks", "Output", "Options"]),
        ("bench", ["What to measure", "Limits", "How to measure", "Comparison", "Decision", "Output", "Options"]),
        ("compare", ["Arguments", "Decision", "Output", "Options"]),
        ("study", ["Arguments", "Output", "Running", "Options"]),
        ("roads extract", ["Arguments", "Routes", "Limits", "Output", "Options"]),
    ],
)
def test_options_are_grouped_by_what_they_are_for(cli: Cli, command: str, groups: list[str]) -> None:
    text = cli(*command.split(), "--help").out
    assert GROUP.findall(text) == groups
    (rest,) = re.findall(r"^Options:\n(.*)\Z", text, flags=re.DOTALL | re.MULTILINE)
    assert rest.split() == ["-h,", "--help", "Show", "this", "message", "and", "exit."]  # all others have a group


def test_the_road_s_smoothing_and_the_plan_s_smoothness_point_at_each_other(cli: Cli) -> None:
    text = " ".join(cli("plan", "--help").out.split())
    assert re.search(r"--smooth M How far smoothing may move the road's line", text)
    assert re.search(r"--curvature-weight, --smoothness W Weight of curvature changes .* The road's line is smoothed by --smooth\.", text)


@pytest.mark.parametrize("columns", [None, "80", "120"])
@pytest.mark.parametrize(
    "command", ["roads list", "vehicles list", "solvers", "roads info uturn", "turn --list", f"roads extract {PLANKEN} --out lines"]
)
def test_tables_in_a_pipe_end_no_line_in_blanks_and_keep_the_width_that_is_set(
    cli: Cli, monkeypatch: pytest.MonkeyPatch, command: str, columns: str | None
) -> None:
    monkeypatch.delenv("COLUMNS") if columns is None else monkeypatch.setenv("COLUMNS", columns)
    outcome = cli(*command.split())
    assert outcome.code == 0
    lines = outcome.out.splitlines()
    assert not [line for line in lines if line != line.rstrip()]
    assert columns is None or max(map(len, lines)) <= int(columns)


@pytest.mark.parametrize(
    ("arguments", "error", "hint"),
    [
        (("plna",), "no such command 'plna'", "did you mean 'plan'?"),
        (("roads", "lst"), "no such command 'lst'", "did you mean 'list'?"),
        (("paint",), "no such command 'paint'", "see `hdvplan --help`"),
        (("plan", "uturn", "--horizn", "50"), "no such option: --horizn", "did you mean '--horizon'?"),
        (("plan", "uturn", "--speed", "50"), "no such option: --speed", "see `hdvplan plan --help`"),
    ],
)
def test_a_misspelt_command_or_option_comes_with_what_it_may_have_meant(
    cli: Cli, arguments: tuple[str, ...], error: str, hint: str
) -> None:
    outcome = cli(*arguments)
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err == f"error: {error}\nhint: {hint}\n"


def test_a_number_with_a_comma_comes_with_that_with_a_point(cli: Cli) -> None:
    outcome = cli("plan", "uturn", "--half-width", "3,25")
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err.startswith("error: invalid value for '--half-width': ")
    assert outcome.err.endswith("hint: did you mean '3.25'?\n")
    assert "--help" in cli("plan", "uturn", "--max-plans", "3,25").err
    assert "--help" in cli("plan", "uturn", "--half-width", "wide").err


def test_arguments_are_shown_by_their_names(cli: Cli) -> None:
    text = cli("plan", "--help").out
    assert text.startswith("Usage: hdvplan plan [OPTIONS] ROAD\n")
    assert re.search(r"^  ROAD  A road file", text, flags=re.MULTILINE)
    assert re.match(r"Usage: hdvplan vehicles show \[OPTIONS\] NAME \[?FILE\]?\n", cli("vehicles", "show", "--help").out)
    assert "{" not in cli("report", "--help").out
