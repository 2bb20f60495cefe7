"""Command lines that cannot be meant, or cannot be done: each is refused in one line, before anything is written."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hdvplan.cli.app import command_line
from tests.cli.conftest import Cli, Outcome
from tests.road.drives import turn_features, written

BUS, LEGS, NEED = "plan uturn --vehicle bus --no-plot", "plan turn.geojson --vehicle citaro-k --horizon 40", "need short.csv --vehicle bus"
TURN, AWAY = "turn --vehicle bus", "turn --vehicle bus --template three-point"
DRAWN = "plan short.csv --vehicle bus --horizon 30 --half-width 3 --no-plot"
REFUSED = [  # a command, and words of the error
    ("plan uturn --vehicle tram", "unknown vehicle 'tram'"),
    ("plan uturn --vehicle missing.toml", "missing.toml does not exist"),
    ("plan uturn", "missing option '--vehicle'"),
    ("plan uturn --vehicle bus,bus", "the vehicle bus is given twice"),
    ("need uturn --vehicle bus,bus", "the vehicle bus is given twice"),
    ("need --template dock-90 --vehicle bus,midibus", "--template dock-90 takes one vehicle, not bus,midibus"),
    ("plan uturn --vehicle bus,", "unknown vehicle ''"),
    ("plan goteborg_nya_alen --vehicle bus", "goteborg_nya_alen"),
    ("plan excel_lower.csv --vehicle bus", "excel_lower.csv does not exist"),
    ("roads", "missing command"),
    (f"{BUS} extra", "unexpected"),
    (f"{BUS} --horizon -100", "horizon must be a positive number, not -100"),
    (f"{BUS} --step 0.3", "whole number of steps"),
    (f"{BUS} --step nan", "step must be a positive number"),
    (f"{BUS} --step half", "--step"),
    (f"{BUS} --step 1e-9", "a step has at least 0.01 m, a horizon at most 20000 steps"),
    (f"{BUS} --horizon 1e6 --step 0.05", "a step has at least 0.01 m, a horizon at most 20000 steps"),
    (f"{BUS} --replan 200", "the replanning distance 200 m is longer than the horizon"),
    (f"{BUS} --smooth -1", "smooth must be a positive number, not -1"),
    (f"{BUS} --scheme mpc", "--scheme must be rti or sqp, not 'mpc'"),
    (f"{BUS} --solver simplex", "unknown solver 'simplex'"),
    (f"{BUS} --objective geometrik", "unknown objective"),
    (f"{BUS} --bias left", "--bias left is neither"),
    (f"{BUS} --half-width 3 --left 2", "--half-width sets both limits; it cannot be combined with --left and --right"),
    (f"{BUS} --left 3", "--left needs --right"),
    (f"{BUS} --half-width -3", "must be a positive number of metres"),
    (f"{BUS} --half-width 1", "limits are 2.00 m apart; the bus is 2.54 m wide"),
    (f"{BUS} --leg-line last-axle", "uturn has no legs, and no use for --leg-line"),
    (f"{BUS} --out taken", "taken is a file"),
    (f"{BUS} --out taken/deeper", "cannot write to taken/deeper"),
    (f"{DRAWN} --sheet a7", "--sheet must be a4, a3"),
    (f"{DRAWN} --sheet a3 --scale big", "--scale 'big' is not a scale"),
    (f"{DRAWN} --sheet a3 --scale {5000 * '1'}", "is not a scale"),
    (f"{DRAWN} --sheet a3 --scale 2", "must lie between 10 and 5000"),
    (f"{DRAWN} --scale 200", "--scale 200 needs a sheet"),
    (f"{DRAWN} --format dwg", "--format must be png, pdf, svg, dxf or gpkg"),
    (f"{DRAWN} --sheet a4 --scale 10", "at 1:10 the sheet has no room for the bus"),
    (f"{NEED} --fix up", "--fix must be left or right"),
    (f"{NEED} --fix left", "the road has no edges of its own, so --fix left needs --left"),
    (f"{NEED} --fix left --left 2 --right 3", "--fix left asks for the least edge on the other side; --right says"),
    (f"{NEED} --fix left --half-width 3", "--fix left asks for the least edge on the other side; --half-width says"),
    (f"{NEED} --fix left --left -2", "--left must be a positive number of metres, not -2"),
    (f"{NEED} --left 2", "--left needs --right"),
    (f"{NEED} --clearance -1", "clearance must be zero or a positive number"),
    (f"{LEGS} --bias 0.1", "--bias is not for a drive of several legs, as turn is"),
    (f"{LEGS} --pass left", "--pass is not for a drive of several legs, as turn is"),
    (f"{LEGS} --clearance max", "--clearance max is not for a drive of several legs, as turn is"),
    (f"{LEGS} --tracking-error 0.1", "--tracking-error is not for a drive of several legs, as turn is"),
    (f"{LEGS} --vehicle bus,citaro", "--vehicle with several names is not for a drive of several legs, as turn is"),
    (f"{LEGS} --offset 1", "turn: a drive of several legs has no use for --offset"),
    (f"{LEGS} --reverse", "turn: a drive of several legs has no use for --reverse"),
    (f"{LEGS} --leg-line rear", "--leg-line must be lead-axle or last-axle, not 'rear'"),
    (f"{LEGS} --road-ids 1,2", "turn.geojson has no road ids and lanes to choose; OpenDRIVE files (.xodr) and Lanelet2 maps (.osm) have"),
    (f"{LEGS} --half-width 1", "limits are 2.00 m apart; the citaro-k is 2.55 m wide"),
    ("need turn.geojson --vehicle bus", "turn holds the legs of a drive forwards and backwards, which only `hdvplan plan` plans"),
    ("roads info turn.geojson", "turn holds the legs of a drive forwards and backwards, which only `hdvplan plan` plans"),
    ("judge nothing.csv short.csv --vehicle bus", "nothing.csv cannot be read: there is no such file"),
    ("turn", "--vehicle"),
    (TURN, "--template, or --radius and --angle"),
    (f"{TURN} --radius 12 --angle right", "--angle must be a number"),
    (f"{TURN} --radius least --angle 90", "--radius must be a number of metres or vehicle"),
    (f"{TURN} --radius -12 --angle 90", "radius = -12"),
    (f"{TURN} --radius 12 --angle 1e9", "km long"),
    (f"{TURN} --radius 12 --angle 90 --guide rear", "guide must be"),
    (f"{TURN} --radius 12 --template eu-circle", "--radius contradicts --template"),
    (f"{TURN} --template none", "unknown template 'none'"),
    (f"{TURN} --template aashto-90 --format bmp", "--format"),
    (f"{TURN} --template aashto-90 --out taken", "taken is a file"),
    (f"{TURN} --template eu-circle --width 20", "--width needs a template that reverses"),
    (f"{AWAY} --width -3", "width must be a positive number"),
    (f"{AWAY} --width 1e4", "more than any site has"),
    (f"{AWAY} --arm 20", "--arm means nothing for three-point"),
    (f"{AWAY} --radius 20", "--radius contradicts --template"),
    ("need --vehicle bus --template aashto-90", "--template must be three-point"),
    (f"{TURN} --template eu-circle --sheet a3", "--sheet is for the templates that reverse"),
    (f"{AWAY} --sheet a9", "--sheet must be a4"),
    ("need --vehicle bus --template three-point --width 20", "--width is what is sought"),
    ("need uturn --vehicle bus --template three-point", "has its own site"),
    ("need --vehicle bus", "missing argument 'ROAD'"),
    ("need uturn --vehicle bus --kerb-radius 3", "--kerb-radius needs a template that reverses"),
    ("reproduce bus", "bus"),
    ("reproduce bus-uturn --out taken", "taken"),
    ("compare base new --factor 0.9", "the factor of a regression must be above 1, not 0.9"),
    ("compare base new --floor -1", "the floor of a regression must be at least 0 ms, not -1"),
    ("compare base new --envelope-tolerance nan", "--envelope-tolerance must be at least 0, not nan"),
    ("compare base new --format tap", "--format must be"),
    ("roads info uturn --corners sharp", "the scenario uturn has no use for --corners"),
    ("roads info short.csv --corners blunt", "--corners must be auto, sharp or round, not 'blunt'"),
    ("roads info short.csv --corner-radius -1", "corner_radius must be zero or a positive number, not -1"),
    ("roads make uturn --radius 0", "--radius must be a finite number other than 0"),
    ("roads make uturn --radius 20 --max-curvature 0.05", "--radius and --max-curvature say the same thing"),
    ("roads make uturn --sharpness -1", "--sharpness must be a positive number"),
    ("roads make uturn --angle 0", "--angle must be a positive number"),
    ("roads make uturn --angle 1 --sharpness 0.001", ""),
    ("roads make uturn --half-width 0", ""),
    ("roads make uturn --lead-in -5", ""),
    ("roads make uturn --json --out -", "--json and --out - both write to stdout"),
    ("roads make uturn --out missing/folder.csv", "cannot write missing/folder.csv"),
    ("vehicles show bus mine.png", "--plot is not given"),
    ("vehicles show bus --plot mine.bmp", "png, pdf or svg"),
    ("vehicles show bus --plot mine", "png, pdf or svg"),
    ("vehicles show bus --plot none/mine.png", "cannot write none/mine.png"),
    ("vehicles show none.toml", "does not exist"),
    ("report nowhere", "nowhere is not a folder"),
    ("report .", ". has no plan, need or turn: summary.json is missing"),
    ("report nowhere --out .", "--out . is a folder, not a file"),
    ("report", "missing argument 'DIR'"),
]


@pytest.fixture
def _files(tmp_path: Path, short_road: str) -> None:
    assert short_road == "short.csv"
    (tmp_path / "taken").write_text("mine", encoding="utf-8")
    written(tmp_path, *turn_features())


@pytest.mark.usefixtures("_files")
@pytest.mark.parametrize(("command", "words"), REFUSED, ids=lambda text: text[:80])
def test_a_command_that_cannot_be_meant_is_refused_in_one_line(cli: Cli, tmp_path: Path, command: str, words: str) -> None:
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    outcome = cli(*shlex.split(command))
    told = "--json" in command
    assert (outcome.code, bool(outcome.out)) == (2, told)
    error, *hint = [line for line in outcome.err.splitlines() if not line.startswith("warning: ")]
    assert error.startswith("error: ")
    assert words in error
    assert not hint or (len(hint) == 1 and hint[0].startswith("hint: "))
    assert before == {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}


WITH_JSON = [  # a command that has --json, its exit code and the kind of its error
    ("plan nowhere.csv --vehicle bus", 2, "RoadError"),
    ("plan turn.geojson --vehicle nobody", 2, "VehicleError"),
    ("plan uturn --vehicle bus --steering 5 --no-plot", 2, "NoSuchOption"),
    ("judge nowhere.csv uturn --vehicle bus", 2, "RoadError"),
    ("need nowhere.csv --vehicle bus", 2, "RoadError"),
    ("turn --vehicle bus --radius 1 --angle 90", 1, "TurnError"),
    ("turn --vehicle bus --template nowhere", 2, "OptionError"),
    ("study nowhere.toml --out out", 2, "OptionError"),
    ("report nowhere", 2, "OptionError"),
    ("bench --roads nowhere", 2, "RoadError"),
    ("bench --against -", 2, "OptionError"),
    ("compare nowhere nowhere", 2, "OptionError"),
    ("reproduce nothing", 2, "OptionError"),
    ("solvers --check nobody", 2, "SolverError"),
    ("roads info nowhere", 2, "RoadError"),
    ("roads make uturn --angle 0", 2, "OptionError"),
    ("roads extract nowhere.osm", 2, "RoadError"),
    ("roads list --nonsense", 2, "NoSuchOption"),
    ("vehicles show nobody", 2, "VehicleError"),
    ("vehicles list --nonsense", 2, "NoSuchOption"),
]


def commands_with_json(group: Any, *names: str) -> Iterator[str]:  # noqa: ANN401 - click's, which Typer may carry itself
    """Yield the names of all commands that take --json."""
    for name, command in getattr(group, "commands", {}).items():
        yield from commands_with_json(command, *names, name)
    if any("--json" in parameter.opts for parameter in group.params):
        yield " ".join(names)


def test_every_command_with_json_is_refused_in_json_below() -> None:
    assert [name for name in commands_with_json(command_line()) if not any(f"{row[0]} ".startswith(f"{name} ") for row in WITH_JSON)] == []


@pytest.mark.usefixtures("_files")
@pytest.mark.parametrize(("command", "code", "kind"), WITH_JSON, ids=lambda text: str(text)[:80])
def test_with_json_a_refusal_is_one_object_on_stdout_and_the_usual_lines_on_stderr(cli: Cli, command: str, code: int, kind: str) -> None:
    """Only comparisons said anything on stdout: programs that parsed it found nothing."""
    outcome, usual = cli(*shlex.split(command), "--json"), cli(*shlex.split(command))
    told = json.loads(outcome.out)
    assert (outcome.code, usual.code, told["exit_code"], told["kind"]) == (code, code, code, kind)
    assert outcome.err == usual.err == f"error: {told['error']}\n" + f"hint: {told['hint']}\n" * bool(told["hint"])


ON_BUS = ("--vehicle", "bus", "--no-plot")


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
    outcome = cli("plan", "narrow.csv", *ON_BUS)
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
    refused(cli("plan", "uturn", *ON_BUS), "internal: IndexError: index 3 is out of bounds", "--debug", code=70)


@pytest.mark.parametrize("arguments", [("--debug", "plan", "nowhere", *ON_BUS), ("plan", "nowhere", *ON_BUS, "--debug")])
def test_debug_shows_the_traceback_on_either_side_of_the_command(cli: Cli, arguments: tuple[str, ...]) -> None:
    outcome = cli(*arguments)
    assert outcome.code == 2
    assert "Traceback (most recent call last)" in outcome.err
    assert "error: no road file" in outcome.err


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
