from __future__ import annotations

from pathlib import Path

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
