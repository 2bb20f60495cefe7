from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import Cli

QUICK = ("--vehicle", "bus", "--horizon", "30", "--half-width", "3")


def test_a_plan_is_drawn_for_cad_maps_and_paper(cli: Cli, tmp_path: Path, short_road: str) -> None:
    assert cli("plan", short_road, *QUICK, "--format", "dxf,gpkg", "--sheet", "A4", "--scale", "1:500").code == 0
    folder = tmp_path / "short.bus"
    assert {file.name for file in folder.iterdir()} >= {"plan.dxf", "plan.gpkg", "sheet.pdf"}
    assert not (folder / "plan.png").exists()
    assert (folder / "sheet.pdf").read_bytes().startswith(b"%PDF")
    assert (folder / "plan.gpkg").read_bytes().startswith(b"SQLite")
    assert cli("plan", short_road, *QUICK, "--no-plot").code == 0
    assert not {file.name for file in folder.iterdir()} & {"plan.dxf", "plan.gpkg", "sheet.pdf"}  # of the former plan


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--sheet", "a7"), "--sheet must be a4, a3"),
        (("--sheet", "a3", "--scale", "big"), "--scale 'big' is not a scale"),
        (("--sheet", "a3", "--scale", 5000 * "1"), "is not a scale"),
        (("--sheet", "a3", "--scale", "2"), "must lie between 10 and 5000"),
        (("--scale", "200"), "--scale 200 needs a sheet"),
        (("--format", "dwg"), "--format must be png, pdf, svg, dxf or gpkg"),
        (("--sheet", "a4", "--scale", "10"), "at 1:10 the sheet has no room for the bus"),
    ],
)
def test_what_cannot_be_drawn_is_one_line(cli: Cli, short_road: str, options: tuple[str, ...], words: str) -> None:
    outcome = cli("plan", short_road, *QUICK, "--no-plot", *options)
    assert outcome.code == 2
    assert words in outcome.err
    assert "Traceback" not in outcome.err
