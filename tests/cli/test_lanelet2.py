"""``hdvplan plan --centreline``: a Lanelet2 map with the planned line in it, as users run it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import Cli

core, io, projection = (pytest.importorskip(f"lanelet2.{part}") for part in ("core", "io", "projection"))


@pytest.fixture
def lane(tmp_path: Path) -> Path:
    """Return a map of one straight lane of 40 m, 3.5 m wide."""
    left, right = (
        core.LineString3d(core.getId(), [core.Point3d(core.getId(), x, y, 0.0) for x in np.linspace(0.0, 40.0, 5)]) for y in (1.75, -1.75)
    )
    lanelet, lanelets, path = core.Lanelet(1, left, right), core.LaneletMap(), tmp_path / "lane.osm"
    for key, value in {"subtype": "road", "location": "urban"}.items():
        lanelet.attributes[key] = value
    lanelets.add(lanelet)
    io.write(str(path), lanelets, projection.LocalCartesianProjector(io.Origin(49.0, 8.4)))
    return path


def test_the_map_is_written_with_the_line_that_is_driven(cli: Cli, lane: Path) -> None:
    assert cli("plan", str(lane), "--vehicle", "P", "--no-plot", "--centreline", "centred.osm").code == 0
    assert lane.with_name("centred.osm").read_text(encoding="utf-8").count('role="centerline"') == 1


@pytest.mark.parametrize(("road", "vehicle"), [("uturn", "P"), ("lane.osm", "P,bus")])
def test_other_roads_and_several_vehicles_have_no_such_line(cli: Cli, lane: Path, road: str, vehicle: str) -> None:
    ended = cli("plan", road, "--vehicle", vehicle, "--centreline", "centred.osm")
    assert ended.code == 2
    assert f"not of {vehicle.replace(',', ', ')} on {road}" in " ".join(ended.err.split())
    assert not lane.with_name("centred.osm").exists()
