"""Roads, vehicles and obstacles that are valid and as nasty as that allows: what hypothesis draws must be planned, not refused."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from hypothesis import strategies as st

_ORIGINS = ((0.0, 0.0), (319000.0, 6400000.0), (-9e6, 4e6), (1e7, -1e7))  # [m]
_EDGES = (0.0, 1e-9, -1e-9, 1e-6, -1e-4)


@st.composite
def road_profiles(draw: st.DrawFn) -> str:
    """Return a curvature profile as CSV: gentle to tight, jumps, tiny and long steps, widths that jump."""
    steps = draw(st.lists(st.sampled_from([1e-3, 0.05, 1.0, 7.3, 20.0, 60.0]), min_size=3, max_size=8))
    s = np.concatenate([[0.0], np.cumsum([30.0, *steps])])
    curvature = [0.0, *(draw(st.sampled_from([*_EDGES, 0.004, -0.01, 0.02, -0.04, 0.06])) for _ in s[1:])]
    left, right = (draw(st.lists(st.sampled_from([3.0, 3.5, 5.0, 20.0, 1e3]), min_size=len(s), max_size=len(s))) for _ in range(2))
    rows = [f"{a!r},{b!r},{c},{d}" for a, b, c, d in zip(s.tolist(), curvature, left, right, strict=True)]
    return "\n".join([draw(st.sampled_from(["s,kappa,left,right", "# a\ns, kappa, left_m, right_m"])), *rows, ""])


@st.composite
def road_tables(draw: st.DrawFn) -> str:
    """Return points as CSV: far from the origin, unevenly spaced, repeated, with any separator, decimal sign and line end."""
    x0, y0 = draw(st.sampled_from(_ORIGINS))
    steps = draw(st.lists(st.sampled_from([0.0, 1e-4, 0.3, 2.0, 5.0, 9.0]), min_size=10, max_size=30))
    x = np.concatenate([[0.0, 20.0, 40.0], 40.0 + np.cumsum(steps)])
    y = draw(st.sampled_from([0.0, 2.0, 6.0])) * np.sin(x / draw(st.sampled_from([15.0, 30.0, 80.0])))
    separator, comma = draw(st.sampled_from([(",", False), (";", False), (";", True), ("\t", True), ("|", False)]))
    end = draw(st.sampled_from(["\n", "\r\n", "\n\n"]))
    rows = [f"{x0 + a:.4f}{separator}{y0 + b:.4f}" for a, b in zip(x, y, strict=True)]
    text = end.join([f"x{separator}y", *(row.replace(".", ",") if comma else row for row in rows)])
    return draw(st.sampled_from(["", "\ufeff"])) + text + draw(st.sampled_from(["", end]))


@st.composite
def road_documents(draw: st.DrawFn) -> str:
    """Return a line with obstacles as GeoJSON: slivers, holes, crossing and repeated rings, a hundred corners, odd names."""
    points = np.stack([np.linspace(0.0, 120.0, 40), 3.0 * np.sin(np.linspace(0.0, 3.0, 40))], axis=1) + np.array([319000.0, 6400000.0])
    features: list[dict[str, Any]] = [_feature("LineString", points.tolist(), {"left_m": 5.0, "right_m": 5.0})]
    for _ in range(draw(st.integers(0, 3))):
        x, y = 319000.0 + draw(st.floats(10.0, 110.0)), 6400000.0 + draw(st.floats(-8.0, 12.0))
        size, corners = draw(st.sampled_from([1e-3, 0.1, 1.0, 4.0])), draw(st.sampled_from([3, 5, 7, 101]))
        turn = np.linspace(
            0.0, 2.0 * np.pi * draw(st.sampled_from([1, 2])), corners, endpoint=False
        )  # twice around crosses itself; an even number would be a line
        ring = np.stack([x + size * np.cos(turn), y + draw(st.sampled_from([1.0, 1e-3])) * size * np.sin(turn)], axis=1).tolist()
        named: dict[str, object] = {
            "region": draw(st.sampled_from(["obstacle", "sweepable"])),
            "name": draw(st.sampled_from(["", "van", "=1|$x$", "\x1b[1m"])),
        }
        features.append(_feature("Polygon", [[*ring, ring[0]]], named))
    crs = {"type": "name", "properties": {"name": "EPSG:3006"}}
    return json.dumps({"type": "FeatureCollection", "crs": crs, "features": features})


@st.composite
def vehicle_files(draw: st.DrawFn) -> str:
    """Return a vehicle of one to three bodies as TOML: short and long, with no overhang or much, coupled before, at or behind the axle."""
    units = []
    for number in range(draw(st.integers(1, 3))):
        lines = [
            f"wheelbase = {draw(st.sampled_from([0.9, 3.5, 6.0, 9.5]))}",
            f"width = {draw(st.sampled_from([0.6, 1.8, 2.55]))}",
            f"front_overhang = {draw(st.sampled_from([0, 0.5, 2.7]))}",
            f"rear_overhang = {draw(st.sampled_from([0, 1e-9, 1.2, 3.3]))}",
            f"hitch_offset = {draw(st.sampled_from([0, -0.5, 1e-9, 0.6, 1.5]))}",
        ]
        if number == 0:
            lines += [
                f"max_curvature = {draw(st.sampled_from([0.09, 0.15, 0.3]))}",
                f"max_curvature_rate = {draw(st.sampled_from([0.05, 0.1, 1]))}",
            ]
        units.append("[[unit]]\n" + "\n".join(lines))
    return f"name = {json.dumps(draw(st.sampled_from(['truck', 'a b', '=x', 'ä', '$y$'])))}\n" + "\n".join(units) + "\n"


def _feature(kind: str, coordinates: object, properties: dict[str, object]) -> dict[str, object]:
    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": coordinates}}
