"""Drawn drives of several legs, made of arcs and straights whose cusps are known."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hdvplan.arrays import FloatArray

EAST, NORTH = 674_000.0, 6_580_000.0  # in EPSG:3006, which has metres
PLACE = np.array([EAST, NORTH])
RADIUS = 12.0
BAY = np.array([(18, 4.5), (12, 4.5), (9, 4.4), (6, 3.7), (3.5, 2), (1, -0.8), (0.1, -4.5), (0, -8), (0, -18)])
Piece = tuple[float, float]  # length, negative: rear first [m], and curvature of the rear axle's path, left positive [1/m]


def drawn(
    start: tuple[float, float, float], pieces: Sequence[Piece], spacing: float = 0.5
) -> tuple[FloatArray, tuple[float, float, float]]:
    """Return the points of a rear axle's path in the order of driving, and the pose x, y, heading at its end."""
    x, y, heading = start
    points = [(x, y)]
    for length, kappa in pieces:
        steps = max(1, round(abs(length) / spacing))
        for _ in range(steps):
            step = length / steps
            turned = step * kappa
            chord = step if abs(turned) < 1e-12 else 2.0 * np.sin(0.5 * turned) / kappa
            x, y = x + chord * np.cos(heading + 0.5 * turned), y + chord * np.sin(heading + 0.5 * turned)
            heading += turned
            points.append((x, y))
    return np.array(points), (x, y, heading)


def three_point(radius: float = RADIUS, lead: float = 4.0) -> tuple[list[FloatArray], list[tuple[float, float, float]]]:
    """Return the three lines of a turn to the left, each turning by 60 degrees, and the poses at its start, its cusps and its end."""
    arc, pose = radius * np.pi / 3.0, (0.0, 0.0, 0.0)
    lines, poses = [], [pose]
    for pieces in ([(lead, 0.0), (arc, 1.0 / radius)], [(-arc, -1.0 / radius)], [(arc, 1.0 / radius), (lead, 0.0)]):
        line, pose = drawn(pose, pieces)
        lines.append(line)
        poses.append(pose)
    return lines, poses


def leg(number: object, direction: object, points: FloatArray, **more: object) -> dict[str, Any]:
    """Return a leg as a feature in metres."""
    return line_feature(points, leg=number, direction=direction, **more)


def line_feature(points: FloatArray, **properties: object) -> dict[str, Any]:
    """Return a line as a feature in metres."""
    placed = (np.asarray(points) + PLACE).tolist()
    return {"type": "Feature", "properties": properties, "geometry": {"type": "LineString", "coordinates": placed}}


def area_feature(points: Sequence[tuple[float, float]], **properties: object) -> dict[str, Any]:
    """Return a polygon as a feature in metres."""
    placed = (np.array([*points, points[0]]) + PLACE).tolist()
    return {"type": "Feature", "properties": properties, "geometry": {"type": "Polygon", "coordinates": [placed]}}


def written(folder: Path, *features: dict[str, Any], name: str = "turn.geojson") -> Path:
    """Write features into a file, and return its path."""
    crs = {"type": "name", "properties": {"name": "EPSG:3006"}}
    path = folder / name
    path.write_text(json.dumps({"type": "FeatureCollection", "crs": crs, "features": list(features)}), encoding="utf-8")
    return path


def turn_features(**more: object) -> list[dict[str, Any]]:
    """Return the legs of the turn in three moves."""
    lines, _ = three_point()
    return [
        leg(number, direction, line, **more)
        for number, direction, line in zip((1, 2, 3), ("forward", "backward", "forward"), lines, strict=True)
    ]
