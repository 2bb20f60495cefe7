"""``hdvplan plan --beside``: two vehicles that meet on one street, as users run it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import shapely
from shapely.geometry import shape
from shapely.geometry.base import BaseGeometry

from tests.cli.conftest import Cli


def _swept(folder: Path) -> BaseGeometry:
    features = json.loads((folder / "swept.geojson").read_text(encoding="utf-8"))["features"]
    return shapely.union_all([shape(one["geometry"]) for one in features if one["properties"]["kind"] == "swept area"])


def _meeting(cli: Cli, road: str, half: float) -> tuple[int, str]:
    """Drive a road with kerbs ``half`` to either side of its line [m] on the right, and then back, beside what was swept."""
    own = ("plan", road, "--vehicle", "bus", "--offset", "-1.75", "--left", f"{half + 1.75}", "--right", f"{half - 1.75}", "--no-plot")
    assert cli(*own, "--quiet", "--out", "there").code == 0
    back = cli(*own, "--reverse", "--beside", "there", "--no-proof", "--no-refine", "--out", "back")
    return back.code, back.out.splitlines()[0]


def test_two_vehicles_meet_where_the_street_is_wide_enough(cli: Cli, tmp_path: Path, short_road: str) -> None:
    code, line = _meeting(cli, short_road, 3.8)
    assert (code, line[:3]) == (0, "YES")
    first, second = _swept(tmp_path / "there"), _swept(tmp_path / "back")
    assert shapely.distance(first, second) > 0.0  # in one plane, whichever way the line was driven
    told = json.loads((tmp_path / "back" / "summary.json").read_text(encoding="utf-8"))
    (met,) = told["obstacles"]
    assert met["name"] == "bus, plan there"
    assert met["distance_m"] == pytest.approx(shapely.distance(first, second), abs=0.02)  # files round to 1 mm, outlines have chords
    assert [(one["name"], one["side"]) for one in told["passed"]] == [("bus, plan there", "right")]


@pytest.mark.slow
def test_where_they_cannot_meet_the_place_is_told(cli: Cli, short_road: str) -> None:
    code, line = _meeting(cli, short_road, 3.05)
    assert code == 1
    assert line.startswith("NO: ")
    own = (short_road, "--vehicle", "bus", "--offset", "-1.75", "--left", "4", "--right", "0.1", "--no-plot")
    again = cli("plan", *own, "--reverse", "--beside", "there", "--no-refine", "--out", "proved")
    assert again.out.splitlines()[1].endswith("that keeps the limits beside the plan in there")
    assert again.err.splitlines()[-1] == "hint: the plan in there takes its share: --meeting FROM:TO lets the two meet elsewhere"


@pytest.mark.slow
def test_two_that_cannot_meet_in_the_bend_may_where_one_waits(cli: Cli, tmp_path: Path) -> None:
    own = ("plan", "uturn", "--vehicle", "bus", "--offset", "-1.75", "--left", "5.05", "--right", "1.55", "--no-plot", "--no-proof")
    cli(*own, "--quiet", "--no-refine", "--out", "there")
    back = (*own, "--reverse", "--no-refine", "--beside", "there", "--out", "back")
    assert cli(*back).code == 1
    assert cli(*back, "--meeting", "0:30").out.startswith("YES")
    assert "stays between s = 0.0 and 30.0 m, as this one drives" in cli(*back, "--meeting", "0:30").err
    met = json.loads((tmp_path / "back" / "summary.json").read_text(encoding="utf-8"))["obstacles"]
    assert [one["name"] for one in met] == ["bus, plan there"]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        pytest.param(("--meeting", "0:30"), "--meeting needs --beside DIR", id="nobody"),
        pytest.param(("--beside", "there", "--meeting", "30"), "two places of the road in metres", id="one place"),
        pytest.param(("--beside", "there", "--meeting", "30:10"), "the first one before the other", id="backwards"),
        pytest.param(("--beside", "there", "--meeting", "20:31"), "the other vehicle is 12.0 m long", id="shorter than a bus"),
        pytest.param(("--beside", "there", "--meeting", "900:950"), "and the road is ", id="beyond the road"),
        pytest.param(("--beside", "there", "--meeting", "a:b"), "such as 20:60, not 'a:b'", id="words"),
    ],
)
def test_a_meeting_is_a_stretch_beside_somebody(cli: Cli, short_road: str, given: tuple[str, ...], told: str) -> None:
    own = ("plan", short_road, "--vehicle", "bus", "--half-width", "6", "--no-plot", "--no-refine", "--no-proof")
    cli(*own, "--out", "there", "--quiet")
    outcome = cli(*own, *given)
    assert outcome.code == 2
    assert told in outcome.err


def test_a_meeting_needs_to_know_how_long_the_other_vehicle_is(cli: Cli, tmp_path: Path, short_road: str) -> None:
    own = ("plan", short_road, "--vehicle", "bus", "--half-width", "6", "--no-plot", "--no-refine", "--no-proof")
    cli(*own, "--out", "there", "--quiet")
    for content in (None, "{", '{"bodies": []}', '{"bodies": 1}'):
        (tmp_path / "there" / "summary.json").unlink()
        if content is not None:
            (tmp_path / "there" / "summary.json").write_text(content, encoding="utf-8")
        outcome = cli(*own, "--beside", "there", "--meeting", "0:30", "--out", "back")
        assert outcome.code == 2
        assert "says how long the other vehicle is" in outcome.err
        (tmp_path / "there" / "summary.json").touch()


def test_a_vehicle_that_does_not_keep_its_own_street_is_no_silent_company(cli: Cli, short_road: str) -> None:
    own = ("plan", short_road, "--vehicle", "bus", "--no-plot", "--no-proof", "--no-refine")
    assert cli(*own, "--half-width", "1.3", "--offset", "4", "--out", "there").code == 1
    back = cli(*own, "--reverse", "--half-width", "6", "--beside", "there", "--out", "back")
    assert "warning: the plan in there does not keep its own limits: NO: " in back.err
    assert json.loads(Path("back/summary.json").read_text(encoding="utf-8"))["notes"][-1].startswith("the plan in there does not keep")


def test_what_is_no_plan_or_lies_elsewhere_is_refused(cli: Cli, tmp_path: Path, short_road: str) -> None:
    own = ("plan", short_road, "--vehicle", "bus", "--half-width", "3", "--no-plot")
    none = cli(*own, "--beside", "nowhere")
    assert (none.code, none.err.splitlines()[0]) == (2, "error: nowhere has no swept.geojson with the area that a plan swept")
    (tmp_path / "swept.geojson").write_text('{"features": [{"properties": null}]}', encoding="utf-8")
    assert cli(*own, "--beside", ".").code == 2
    cli("plan", "goteborg_lindholmsallen_uturn", "--vehicle", "bus", "--no-plot", "--quiet", "--out", "earth")
    apart = cli(*own, "--beside", "earth")
    assert apart.code == 2
    assert "swept is in degrees, and short is not" in apart.err
    cli(*own, "--quiet", "--out", "near")
    (tmp_path / "far.csv").write_text("x,y\n0,500\n60,500\n", encoding="utf-8")
    far = cli("plan", "far.csv", "--vehicle", "bus", "--half-width", "3", "--no-plot", "--beside", "near")
    assert far.code == 2
    assert "swept lies more than 20 m from far" in far.err
