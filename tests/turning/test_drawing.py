"""A prescribed turn as a drawing for CAD."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import shapely
from ezdxf.entities.lwpolyline import LWPolyline
from ezdxf.entities.mtext import MText
from ezdxf.filemanagement import readfile

from tests.cli.conftest import Cli, cli  # noqa: F401 - a fixture

GATE = """
name = "gate"
source = "our own"
[manoeuvre]
radius = 14
angle = 90
[limits]
inside_radius = 6.5
outside_radius = 18
"""
CHORDS_M = 1e-3  # by which polylines that stand for arcs may be off


def test_a_turn_is_drawn_with_the_figures_that_are_told(cli: Cli, tmp_path: Path) -> None:  # noqa: F811 - the fixture
    (tmp_path / "gate.toml").write_text(GATE, encoding="utf-8")
    outcome = cli("turn", "--vehicle", "tractor-semitrailer", "--template", "gate.toml", "--no-plot", "--format", "png,dxf", "--out", "out")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"poses.csv", "width.csv", "turn.geojson", "turn.json", "turn.dxf"}
    drawing = readfile(tmp_path / "out" / "turn.dxf")
    assert drawing.header["$INSUNITS"] == 6  # metres
    assert not drawing.audit().errors
    lines: dict[str, list[shapely.LineString]] = {}
    for entity in drawing.modelspace():
        if isinstance(entity, LWPolyline):
            points = np.array(entity.get_points("xy"))
            lines.setdefault(entity.dxf.layer, []).append(shapely.LineString(points if not entity.closed else [*points, points[0]]))
    assert {layer: len(found) for layer, found in lines.items()} == {
        "GUIDED_PATH": 1, "LIMITS": 2, "WHEEL_TRACKS": 6, "ENVELOPE_1_TRACTOR": 1, "ENVELOPE_2_SEMITRAILER": 1,
        "VEHICLE_OUTLINES_1_TRACTOR": 3, "VEHICLE_OUTLINES_2_SEMITRAILER": 3,
    }  # fmt: skip
    centre = lines["LIMITS"][0].envelope.centroid
    radii = sorted(shapely.hausdorff_distance(ring, centre) for ring in lines["LIMITS"])
    assert radii == pytest.approx([6.5, 18.0], abs=CHORDS_M)
    told = json.loads((tmp_path / "out" / "turn.json").read_text(encoding="utf-8"))
    swept = shapely.union_all([shapely.Polygon(ring) for name in lines if name.startswith("ENVELOPE") for ring in lines[name]])
    assert shapely.distance(swept, centre) == pytest.approx(told["min_inside_radius_m"], abs=CHORDS_M)
    assert shapely.distance(lines["GUIDED_PATH"][0], centre) == pytest.approx(14.0, abs=CHORDS_M)
    (notes,) = [entity for entity in drawing.modelspace() if isinstance(entity, MText)]
    assert notes.text.startswith(outcome.out.splitlines()[0])
    assert "mirror it for one to the right" in notes.text
