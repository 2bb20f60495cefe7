from __future__ import annotations

import json
import re
from html import unescape
from pathlib import Path

import pytest

from tests.cli.conftest import Cli
from tests.road.drives import turn_features, written

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
    assert outcome.err.startswith("left out, as no folders: compared.csv\nwrote report.html: 2 folders, ")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<title>Two objectives</title>" in page
    assert page.count('class="plan"') == 2
    assert '<button type="button" data-show="1" aria-pressed="false">lead-axle</button>' in page


def test_the_report_says_as_json_what_it_wrote(cli: Cli, tmp_path: Path, plans: tuple[str, str]) -> None:
    outcome = cli("report", plans[0], "--out", "one.html", "--json")
    assert (outcome.code, outcome.err) == (0, "")
    assert json.loads(outcome.out) == {"file": "one.html", "bytes": (tmp_path / "one.html").stat().st_size, "plans": [plans[0]]}
    assert "<nav" not in (tmp_path / "one.html").read_text(encoding="utf-8")  # nothing to choose from


@pytest.mark.slow
def test_legs_needs_and_turns_come_with_their_answer_picture_and_numbers(cli: Cli, tmp_path: Path, short_road: str) -> None:
    written(tmp_path, *turn_features())
    commands = {
        "moves": ("plan", "turn.geojson", "--vehicle", "citaro-k", "--horizon", "40"),
        "room": ("need", short_road, "--vehicle", "bus"),
        "circle": ("turn", "--vehicle", "bus", "--radius", "12", "--angle", "90"),
        "head": ("turn", "--vehicle", "citaro-k", "--template", "three-point", "--no-plot"),
    }
    first = [cli(*command, "--out", folder).out.splitlines()[0] for folder, command in commands.items()]
    plan = "geometric"
    assert cli("plan", short_road, "--vehicle", "bus", *QUICK, "--out", plan).code == 0
    need = json.loads((tmp_path / "room" / "need.json").read_text(encoding="utf-8"))
    legs = json.loads((tmp_path / "moves" / "summary.json").read_text(encoding="utf-8"))["legs"]
    for folders in ([*commands], [*commands, plan]):
        outcome = cli("report", *folders)
        assert (outcome.code, outcome.err.startswith(f"wrote report.html: {len(folders)} folders, ")) == (0, True)
        page = (tmp_path / "report.html").read_text(encoding="utf-8")
        told = " ".join(unescape(re.sub(r"<[^>]*>", " ", page)).split())
        assert [line for line in first if line not in told] == []
        assert page.count('<img src="data:image/png;base64,') == 3  # the head was not drawn
        assert page.count("<canvas") == 2 * (plan in folders)
        assert f'<th scope="row">half width</th><td class="unit">m</td><td>{need["half_width_m"]:.3f}</td>' in page
        assert '<th scope="row">standstill</th><td class="unit"></td><td>no</td>' in page
        assert "".join(f"<td>{leg['length_m']:.3f}</td>" for leg in legs) in page


@pytest.mark.parametrize("content", ["[", '{"text": 5, "vehicle": "bus"}', '{"text": [], "legs": [1]}', '{"a.b": 1}'])
def test_a_damaged_need_is_refused(cli: Cli, tmp_path: Path, content: str) -> None:
    (tmp_path / "need.json").write_text(content, encoding="utf-8")
    outcome = cli("report", ".")
    assert (outcome.code, outcome.out) == (2, "")
    assert re.match(r"error: what \. holds? cannot be (read|shown): .*\nhint: ", outcome.err)


@pytest.mark.slow
def test_a_plan_brings_the_pictures_and_the_film_asked_for(cli: Cli, tmp_path: Path, short_road: str) -> None:
    arguments = ("plan", short_road, "--vehicle", "bus", "--horizon", "30", "--quiet", "--out", "made")
    assert cli(*arguments, "--format", "svg,pdf", "--animate").code == 0
    assert (tmp_path / "made" / "drive.gif").read_bytes().startswith(b"GIF89a")
    assert {path.name for path in (tmp_path / "made").glob("plan.*")} == {"plan.svg", "plan.pdf"}
    assert cli(*arguments, "--no-plot").code == 0
    assert not list((tmp_path / "made").glob("plan.*"))  # they belonged to the former plan
    assert not (tmp_path / "made" / "drive.gif").exists()
