from __future__ import annotations

import json
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from hdvplan.judging.fit import facts_of
from hdvplan.legs import load_legs
from hdvplan.road.load import load_road
from hdvplan.road.scenarios import SCENARIOS, shipped
from tests.cli.conftest import Cli

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
