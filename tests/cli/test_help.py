"""Help texts and tables read well in 80 and 120 columns, and in a pipe; names are listed, and completed by the shell."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from hdvplan.cli import options
from hdvplan.judging.fit import facts_of
from hdvplan.legs import load_legs
from hdvplan.planning.settings import Scheme
from hdvplan.road.load import load_road
from hdvplan.road.scenarios import SCENARIOS, shipped
from hdvplan.vehicle.load import preset_names
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


LISTS = [("vehicles", "list"), ("solvers",), ("roads", "list"), ("roads", "info", "roundabout")]


@pytest.mark.parametrize("arguments", LISTS)
def test_a_list_is_there_as_json_too(cli: Cli, arguments: tuple[str, ...]) -> None:
    outcome = cli(*arguments, "--json")
    assert (outcome.code, outcome.err) == (0, "")
    assert json.loads(outcome.out)


def test_every_shipped_road_and_scenario_is_listed_whole(cli: Cli) -> None:
    names = {road["name"] for road in json.loads(cli("roads", "list", "--json").out)}
    assert names >= {"goteborg_nya_allen", *SCENARIOS}
    table = cli("roads", "list").out
    assert all(name in table for name in names)


def test_nothing_is_cut_or_broken_where_no_terminal_limits_the_width(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("COLUMNS")
    listed, table = json.loads(cli("roads", "list", "--json").out), cli("roads", "list").out
    assert all(road["kind"] in table for road in listed)
    lines = cli("solvers").out.splitlines()
    for solver in json.loads(cli("solvers", "--json").out):
        assert any(line.split()[0] == solver["name"] and solver["note"] in line for line in lines if line.strip())


def test_the_listed_sizes_of_examples_and_scenarios_are_those_of_their_roads(cli: Cli) -> None:
    listed = [road for road in json.loads(cli("roads", "list", "--json").out) if road["source"] in {"example", "scenario"}]
    assert len(listed) == len(shipped("examples")) + len(SCENARIOS)
    drives = [road for road in listed if road["kind"] == "drive of several legs"]
    for road in drives:
        parts = [facts_of(leg.road) for leg in load_legs(road["name"]).legs]
        assert road["length_m"] == pytest.approx(sum(part.length for part in parts), abs=0.05)
        assert road["min_radius_m"] == pytest.approx(min(1.0 / part.max_curvature for part in parts), abs=0.05)
    for road in (one for one in listed if one not in drives):
        facts = facts_of(load_road(road["name"]))
        assert road["length_m"] == pytest.approx(facts.length, abs=0.05)  # a decimetre is listed
        if road["min_radius_m"] is None:
            assert facts.max_curvature < 1e-4  # what drawing a straight line leaves
        else:
            assert road["min_radius_m"] == pytest.approx(1.0 / facts.max_curvature, abs=0.05)


def test_a_preset_is_shown_verbatim(cli: Cli) -> None:
    preset = resources.files("hdvplan.vehicle") / "presets" / "papers" / "bus.toml"
    assert cli("vehicles", "show", "bus").out == preset.read_text(encoding="utf-8")
    assert json.loads(cli("vehicles", "show", "bus", "--json").out)["units"][0]["wheelbase"] == 6.0
    outcome = cli("vehicles", "show", "buss")
    assert outcome.code == 2
    assert "did you mean 'bus'" in outcome.err


def test_the_list_of_vehicles_tells_units_length_and_what_steers(cli: Cli) -> None:
    listed = {vehicle["name"]: vehicle for vehicle in json.loads(cli("vehicles", "list", "--json").out)}
    assert len(listed["a-double"]["units"]) == 4
    assert listed["truck-dolly-semitrailer"]["length_m"] == pytest.approx(25.25)
    table = cli("vehicles", "list").out
    assert all(name in table for name in listed)
    row = next(line for line in table.splitlines() if "semitrailer-steered" in line)
    assert row.split() == ["semitrailer-steered", "2", "16.50", "2.55", "3.7+7.7*", "10.0"]


def test_a_vehicle_is_drawn_where_asked_or_under_its_name(cli: Cli, tmp_path: Path) -> None:
    outcome = cli("vehicles", "show", "a-double", "--plot")
    assert (outcome.code, outcome.out) == (0, "")
    assert "wrote a-double.png" in outcome.err
    assert (tmp_path / "a-double.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads(cli("vehicles", "show", "bus", "--plot", "mine.svg", "--json").out)["file"] == "mine.svg"
    assert (tmp_path / "mine.svg").read_text(encoding="utf-8").lstrip().startswith("<?xml")


def test_info_tells_which_vehicles_fit(cli: Cli) -> None:
    info = json.loads(cli("roads", "info", "uturn", "--json").out)
    assert info["length_m"] == pytest.approx(173.26, abs=0.01)  # printed digits
    assert info["max_curvature_per_m"] == pytest.approx(0.06)
    verdicts = {vehicle["vehicle"]: vehicle["fits"] for vehicle in info["vehicles"]}
    assert verdicts["bus"] is True
    assert verdicts["tractor-trailer-24m"] is False
    bus = next(vehicle for vehicle in info["vehicles"] if vehicle["vehicle"] == "bus")
    assert bus["half_width_m"] == pytest.approx(2.486, abs=1e-3)  # the published expectation's digits


def test_info_reports_what_smoothing_did(cli: Cli) -> None:
    outcome = cli("roads", "info", "goteborg_lindholmsallen_uturn")
    assert "line moved by" in outcome.out
    assert "OpenStreetMap" in outcome.out
    info = json.loads(cli("roads", "info", "goteborg_lindholmsallen_uturn", "--json").out)
    assert info["smoothing"]["max_deviation_m"] > 0
    assert info["point_spacing_m"] > 0


@pytest.mark.parametrize("name", ["uturn", "roundabout", "sturn"])
def test_a_scenario_made_without_options_is_the_shipped_one(cli: Cli, tmp_path: Path, name: str) -> None:
    assert cli("roads", "make", name).code == 0
    made, shipped = load_road(tmp_path / f"{name}.csv").path, load_road(name).path
    assert made.length == shipped.length
    s = np.linspace(0.0, shipped.length, 200)
    np.testing.assert_array_equal(made.at(s).curvature, shipped.at(s).curvature)


@pytest.mark.parametrize("name", ["uturn", "roundabout", "sturn"])
def test_a_scenario_turns_by_the_angle_and_radius_asked_for(cli: Cli, tmp_path: Path, name: str) -> None:
    arguments = ("--radius", "-20", "--sharpness", "0.01", "--angle", "90", "--half-width", "4", "--out", "made.csv")
    assert cli("roads", "make", name, *arguments).code == 0
    road = load_road(tmp_path / "made.csv")
    s = np.linspace(0.0, road.path.length, 20001)
    kappa = road.path.at(s).curvature
    assert np.min(kappa) == pytest.approx(-0.05, rel=5e-3)  # to the right; knots 0.5 m apart round a ramp's end
    turned = np.trapezoid(np.minimum(kappa, 0.0), s)
    assert np.rad2deg(turned) == pytest.approx(-90.0, abs=0.01)  # the trapezoidal rule at 1 cm
    assert road.limits is not None
    assert float(road.limits.left[0]) == 4.0


COMMAND = "import sys; sys.argv[0] = 'hdvplan'; from hdvplan.cli.entry import main; main()"


def completed(*words: str) -> list[str]:
    """Return what bash is offered for the last of ``words``."""
    asked = {"_HDVPLAN_COMPLETE": "complete_bash", "COMP_WORDS": " ".join(words), "COMP_CWORD": str(len(words) - 1)}
    path = os.pathsep.join(path for path in sys.path if path)
    ended = subprocess.run(  # noqa: S603 - our own
        [sys.executable, "-c", COMMAND], env=os.environ | asked | {"PYTHONPATH": path}, capture_output=True, text=True, check=True
    )
    return ended.stdout.split()


@pytest.mark.slow
def test_the_shell_completes_commands_roads_and_the_last_of_a_list() -> None:
    assert completed("hdvplan", "rep") == ["report", "reproduce"]
    assert completed("hdvplan", "plan", "goteborg_ny") == ["goteborg_nya_allen"]
    assert completed("hdvplan", "bench", "--solvers", "riccati,pi") == ["riccati,piqp"]


@pytest.mark.skipif(sys.platform == "win32", reason="bash")
def test_completion_installs_itself(tmp_path: Path) -> None:
    environment = os.environ | {"HOME": str(tmp_path), "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    environment |= {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    arguments = [sys.executable, "-c", COMMAND, "--install-completion", "bash"]
    ended = subprocess.run(arguments, env=environment, capture_output=True, text=True, check=True)  # noqa: S603 - our own
    assert "bash completion installed" in ended.stdout
    assert "hdvplan.sh" in (tmp_path / ".bashrc").read_text(encoding="utf-8")


def test_names_are_those_that_the_commands_know() -> None:
    assert set(options.offered_roads("")) > set(SCENARIOS)
    assert options.offered_roads("monaco") == ["monaco_fairmont_hairpin"]
    assert options.offered_vehicles("") == preset_names()
    assert options.listed(options.offered_vehicles)("bus,tractor-trailer-2") == ["bus,tractor-trailer-24m"]
    assert options.listed(options.offered_roads)("uturn,st") == ["uturn,street_corner", "uturn,sturn"]
    assert "riccati" in options.offered_solvers("")
    assert options.offered_objectives("axle") == ["axle-max"]
    assert options.one_of(list(Scheme))("s") == ["sqp"]
    assert options.offered_roads("nowhere") == []
