"""A user's own vehicle, from its file to a plan."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from tests.cli.conftest import Cli

FIVE = """
name = "road train"
source = "mine"

[[unit]]
wheelbase = 4.2
front_overhang = 1.4
rear_overhang = 1.0
width = 2.5
hitch_offset = -0.4

[[unit]]
wheelbase = 7.0
front_overhang = 1.2
rear_overhang = 2.0
width = 2.5
hitch_offset = 1.5
steering_ratio = 0.4
max_steering_angle = 0.3

[[unit]]
name = "dolly"
wheelbase = 3.5
front_overhang = -2.4
length = 2.0
width = 2.4
hitch_offset = 0

[[unit]]
wheelbase = 6.0
front_overhang = 1.2
rear_overhang = 2.0
width = 2.5
hitch_offset = 1.5

[[unit]]
wheelbase = 5.0
front_overhang = -0.5
rear_overhang = 1.5
width = 2.3
steered = true
steering_ratio = 1.0
"""


@pytest.fixture
def five(tmp_path: Path) -> str:
    (tmp_path / "five.toml").write_text(FIVE, encoding="utf-8")
    return "five.toml"


@pytest.mark.slow  # kernels are compiled for five units
def test_five_units_are_planned_drawn_and_described(cli: Cli, five: str, tmp_path: Path) -> None:
    outcome = cli("plan", "roundabout", "--vehicle", five, "--half-width", "6", "--out", "plan", "--json")
    assert outcome.code == 0, outcome.err
    summary = json.loads(outcome.out)
    assert summary["status"] == "ok"
    assert summary["vehicle"] == "road train"
    path = pd.read_csv(tmp_path / "plan" / "path.csv")
    assert list(path.columns) == ["s", "x", "y", "heading", "e_y", "e_psi", "beta1", "beta2", "beta3", "beta4", "kappa", "K"]
    assert (tmp_path / "plan" / "plan.png").is_file()
    swept = json.loads((tmp_path / "plan" / "swept.geojson").read_text(encoding="utf-8"))
    swept_by = [feature["properties"]["unit"] for feature in swept["features"] if feature["properties"]["kind"] == "swept area"]
    assert swept_by == ["unit 1", "unit 2", "dolly", "unit 4", "unit 5"]
    described = json.loads(cli("vehicles", "show", five, "--json").out)
    assert described["length_m"] == pytest.approx(5.6 - 0.4 + 7.0 + 1.5 + 3.5 + 6.0 + 1.5 + 5.0 + 1.5)
    assert described["units"][4]["steering_ratio"] == 1.0
    assert cli("vehicles", "show", five, "--plot").code == 0


@pytest.mark.slow  # kernels are compiled for five units and two of these wheels
def test_wheels_that_the_plan_steers_are_written_with_the_path(cli: Cli, tmp_path: Path) -> None:
    """The dolly by the plan, the trailer behind it by a law, the last one by the plan again."""
    active = 'steered = "active"\nmax_steering_angle = 0.3\nmax_steering_rate = 0.05\n'
    text = FIVE.replace("width = 2.4\n", "width = 2.4\n" + active).replace("steered = true\nsteering_ratio = 1.0\n", active)
    (tmp_path / "active.toml").write_text(text, encoding="utf-8")
    outcome = cli("plan", "roundabout", "--vehicle", "active.toml", "--half-width", "6", "--out", "plan", "--json")
    assert outcome.code == 0, outcome.err
    path = pd.read_csv(tmp_path / "plan" / "path.csv")
    assert list(path.columns)[6:] == ["beta1", "beta2", "beta3", "beta4", "steering1", "steering2", "kappa", "K"]
    steering = path[["steering1", "steering2"]]
    assert (steering.abs().max() <= 0.3 + 1e-6).all()  # a solver may leave 1e-7 of a bound
    assert (steering.diff().abs().max() <= 0.05 * 0.5 + 1e-6).all()
    assert (steering.abs().max() > 0.05).all()
    assert cli("report", "plan").code == 0


def test_a_vehicle_that_hardly_steers_is_told_so_and_not_to_smooth_the_road(cli: Cli, tmp_path: Path) -> None:
    slow = "[[unit]]\nwheelbase = 6\nfront_overhang = 3\nrear_overhang = 3\nwidth = 2.5\nmax_curvature = 0.1\nmax_curvature_rate = 1e-9\n"
    (tmp_path / "slow.toml").write_text(slow, encoding="utf-8")
    outcome = cli("plan", "goteborg_lindholmsallen_uturn", "--vehicle", "slow.toml", "--no-plot", "--quiet", "--no-refine")
    assert outcome.code == 1
    assert outcome.err.splitlines()[1:] == [
        "hint: the slow steers too slowly for any way along the line: max_curvature_rate = 1e-09 1/m^2, per metre travelled"
    ]


@pytest.mark.parametrize("command", [("plan", "uturn", "--vehicle", "fleet/b.toml"), ("study", "study.toml", "--out", "out")])
def test_a_vehicle_that_is_refused_is_told_with_its_file(cli: Cli, five: str, command: tuple[str, ...]) -> None:
    """In a fleet of files the name inside, of a copy often another's, says little."""
    Path("fleet").mkdir()
    Path("fleet/a.toml").write_text(Path(five).read_text(encoding="utf-8"), encoding="utf-8")
    Path("fleet/b.toml").write_text(FIVE.replace("wheelbase = 4.2", "wheelbase = -4.2"), encoding="utf-8")
    Path("study.toml").write_text('roads = ["uturn"]\nvehicles = ["fleet/*.toml"]\n', encoding="utf-8")
    outcome = cli(*command)
    assert outcome.code == 2
    (line, _) = outcome.err.splitlines()
    assert line.startswith(f"error: {Path('fleet/b.toml')}: vehicle 'road train', unit 1: wheelbase = -4.2")
