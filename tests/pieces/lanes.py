"""Roads that are cut into pieces: as a file, and from one that is smoothed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from hdvplan.road.load import Found, find_road
from hdvplan.road.options import RoadOptions
from hdvplan.road.road import Road

PLANE = "+proj=tmerc +lat_0=47 +lon_0=8 +ellps=WGS84 +units=m"  # lengths are true around its origin


def lane_with_a_post(folder: Path, reach: float | None = 3.5) -> Found:
    """Return a road of 2 km beside which a post stands, 12 m before the second of four windows; ``reach`` are its limits [m]."""
    x = np.arange(0.0, 2001.0, 20.0)
    line = {"type": "LineString", "coordinates": np.column_stack([x, 10.0 * np.sin(x / 100.0)]).tolist()}
    post = {"type": "Polygon", "coordinates": [[[488.0, -16.0], [489.0, -16.0], [489.0, -15.0], [488.0, -15.0], [488.0, -16.0]]]}
    features = [
        {"type": "Feature", "properties": {} if reach is None else {"left_m": reach, "right_m": reach}, "geometry": line},
        {"type": "Feature", "properties": {"region": "obstacle", "name": "post"}, "geometry": post},
    ]
    crs = {"type": "name", "properties": {"name": PLANE}}
    (folder / "lane.geojson").write_text(json.dumps({"type": "FeatureCollection", "crs": crs, "features": features}), encoding="utf-8")
    return find_road(folder / "lane.geojson")


def found_of(road: Road) -> Found:
    """Return a road as one that was found."""
    return Found(lambda: road, RoadOptions())
