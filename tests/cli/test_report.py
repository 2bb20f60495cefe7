from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.conftest import Cli

QUICK = ("--horizon", "30", "--no-plot", "--quiet")


@pytest.fixture
def plans(cli: Cli, short_road: str) -> tuple[str, str]:
    """Two plans of one road, by different objectives."""
    for objective in ("geometric", "lead-axle"):
        assert cli("plan", short_road, "--vehicle", "bus", *QUICK, "--objective", objective, "--out", objective).code == 0
    return "geometric", "lead-axle"


def test_plans_become_one_file(cli: Cli, tmp_path: Path, plans: tuple[str, str]) -> None:
    (tmp_path / "compared.csv").touch()  # as the shell's DIR/* gives it too
    outcome = cli("report", "compared.csv", *plans, "--title", "Two objectives")
    assert (outcome.code, outcome.out) == (0, "")
    assert outcome.err.startswith("left out, as no folders: compared.csv\nwrote report.html: 2 plans, ")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<title>Two objectives</title>" in page
    assert page.count('class="plan"') == 2
    assert '<button type="button" data-show="1" aria-pressed="false">lead-axle</button>' in page


def test_the_report_says_as_json_what_it_wrote(cli: Cli, tmp_path: Path, plans: tuple[str, str]) -> None:
    outcome = cli("report", plans[0], "--out", "one.html", "--json")
    assert (outcome.code, outcome.err) == (0, "")
    assert json.loads(outcome.out) == {"file": "one.html", "bytes": (tmp_path / "one.html").stat().st_size, "plans": [plans[0]]}
    assert "<nav" not in (tmp_path / "one.html").read_text(encoding="utf-8")  # nothing to choose from


def test_a_report_that_cannot_be_written_is_refused(cli: Cli, plans: tuple[str, str]) -> None:
    outcome = cli("report", *plans, "--out", "missing/report.html")
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err.startswith("error: cannot write missing/report.html: ")


@pytest.mark.slow
def test_a_plan_brings_the_pictures_and_the_film_asked_for(cli: Cli, tmp_path: Path, short_road: str) -> None:
    arguments = ("plan", short_road, "--vehicle", "bus", "--horizon", "30", "--quiet", "--out", "made")
    assert cli(*arguments, "--format", "svg,pdf", "--animate").code == 0
    assert (tmp_path / "made" / "drive.gif").read_bytes().startswith(b"GIF89a")
    assert {path.name for path in (tmp_path / "made").glob("plan.*")} == {"plan.svg", "plan.pdf"}
    assert cli(*arguments, "--no-plot").code == 0
    assert not list((tmp_path / "made").glob("plan.*"))  # they belonged to the former plan
    assert not (tmp_path / "made" / "drive.gif").exists()
