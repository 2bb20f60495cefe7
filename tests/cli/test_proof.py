"""A proof as users meet it: in the verdict and in files; see ``test_need`` for what is proved to be too little."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hdvplan.answers import NO
from tests.cli.conftest import Cli

BEND = ("bend.csv", "--vehicle", "bus", "--no-plot")
TOO_LITTLE_M, ENOUGH_M = "2.2", "2.4"  # the bus needs 2.36 m here: `hdvplan need`


@pytest.fixture
def bend(tmp_path: Path) -> Path:
    (tmp_path / "bend.csv").write_text("s,kappa\n0,0\n20,0\n28,0.06\n45,0.06\n53,0\n80,0\n", encoding="utf-8")
    return tmp_path


@pytest.mark.slow
def test_a_bus_that_cannot_pass_gets_a_proof_with_its_stretch(cli: Cli, bend: Path) -> None:
    outcome = cli("plan", *BEND, "--half-width", TOO_LITTLE_M, "--out", "out")
    assert outcome.code == 1
    summary = json.loads((bend / "out" / "summary.json").read_text(encoding="utf-8"))
    verdict, proof = summary["verdict"], summary["verdict"]["proof"]
    assert (verdict["fits"], verdict["proved"]) == (False, True)
    assert (proof["kind"], proof["unit"]) == ("motion", "bus")
    assert 0.0 <= proof["s_from_m"] < proof["s_to_m"] <= summary["length_m"]
    said = f"proved: between s = {proof['s_from_m']:.1f} and {proof['s_to_m']:.1f} m nothing that this vehicle can drive keeps the limits"
    assert outcome.out.splitlines()[0] == verdict["text"]
    assert verdict["text"].startswith(NO)
    assert verdict["details"].endswith(f"; {said}")
    without = json.loads(cli("plan", *BEND, "--half-width", TOO_LITTLE_M, "--json", "--no-proof").out)["verdict"]
    assert (without["proved"], without["proof"], without["spare_m"]) == (False, None, verdict["spare_m"])  # it changes nothing of the plan


def test_a_proof_says_which_clearance_it_is_about(cli: Cli, bend: Path) -> None:
    assert bend.is_dir()
    verdict = json.loads(cli("plan", *BEND, "--half-width", ENOUGH_M, "--clearance", "0.6", "--json").out)["verdict"]
    assert verdict["proved"]
    assert verdict["details"].endswith(" m nothing that this vehicle can drive stays 0.60 m off the limits")


def test_a_bad_plan_where_a_better_one_fits_is_not_called_proved(cli: Cli, bend: Path) -> None:
    assert bend.is_dir()
    options = (*BEND, "--half-width", ENOUGH_M, "--json")
    assert json.loads(cli("plan", *options).out)["verdict"]["fits"] is True
    short_sighted = cli("plan", *options, "--horizon", "12")  # it sees the bend too late to swing out
    verdict = json.loads(short_sighted.out)["verdict"]
    assert short_sighted.code == 1
    assert (verdict["fits"], verdict["proved"], verdict["proof"]) == (False, False, None)
    assert verdict["details"].endswith("; no plan was found, and none is excluded")
