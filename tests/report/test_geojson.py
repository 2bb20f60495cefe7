from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
from pyproj import Geod
from shapely.geometry import shape

from hdvplan.arrays import FloatArray
from hdvplan.fileio import json_bytes
from hdvplan.judging.result import Result
from hdvplan.report.geojson import feature as feature_of
from hdvplan.report.geojson import swept_area, swept_geojson
from hdvplan.road.crs import to_plane
from hdvplan.road.path import from_curvature


def features(result: Result) -> list[dict[str, Any]]:
    """Return the features as a reader of the file gets them."""
    found = json.loads(json_bytes(swept_geojson(result)))["features"]
    assert isinstance(found, list)
    return found


def test_limits_and_their_breaches_are_lines_of_their_own(kerbed: Result, straight: Result) -> None:
    kinds = [feature["properties"]["kind"] for feature in features(kerbed)]
    breaches = kerbed.balance.breaches
    assert kinds == [
        "swept area",
        *["limit", "limit of overhangs"] * 2,
        *["broken limit"] * len(breaches),
        "road centre",
        "driven line",
        *["wheel track"] * 4,
    ]
    depths = {feature["properties"]["depth_m"] for feature in features(kerbed) if feature["properties"]["kind"] == "broken limit"}
    assert max(depths) == pytest.approx(kerbed.balance.violation, abs=1e-4)  # rounded there
    left = next(feature for feature in features(straight) if feature["properties"].get("side") == "left")
    (begin, y), (end, same) = left["geometry"]["coordinates"]  # straight: two points are enough
    assert (y, same) == (3.0, 3.0)
    vehicle, s, length = straight.drive.vehicle, straight.drive.poses_s, straight.drive.road.path.length
    assert (begin, end) == pytest.approx((s[0] - vehicle.reach_behind, length + vehicle.reach_ahead), abs=1e-3)  # rounded there


def test_every_feature_brings_its_style(kerbed: Result, trailer: Result) -> None:
    for feature in (*features(kerbed), *features(trailer)):
        properties = feature["properties"]
        colours = [properties["stroke"], *([properties["fill"]] if feature["geometry"]["type"].endswith("Polygon") else [])]
        assert all(re.fullmatch("#[0-9A-F]{6}", colour) for colour in colours)
        assert 0 < properties["stroke-width"] <= 5
    tractor, semitrailer, *_ = features(trailer)
    assert tractor["properties"]["fill"] != semitrailer["properties"]["fill"]


def test_areas_are_valid_where_the_road_crosses_itself(trailer: Result) -> None:
    for feature in features(trailer)[:2]:
        area = shape(feature["geometry"])
        assert area.geom_type in {"Polygon", "MultiPolygon"}
        assert area.is_valid
        for part in shapely.get_parts(area):
            assert part.exterior.is_ccw  # RFC 7946


def test_the_area_swept_in_a_full_circle_has_a_hole() -> None:
    path = from_curvature(np.array([0.0, 130.0]), np.array([0.05, 0.05]))  # radius 20 m: 125.7 m once round
    s = np.arange(0.0, 126.0, 0.25)
    ring = swept_area(path, s, np.full(len(s), 2.0), np.full(len(s), -2.0))
    assert ring.area == pytest.approx(np.pi * (22.0**2 - 18.0**2), rel=1e-4)  # chords of 0.25 m


def test_a_gap_in_the_envelope_is_a_gap_in_the_area() -> None:
    path = from_curvature(np.array([0.0, 100.0]), np.zeros(2))
    s = np.arange(0.0, 100.25, 0.25)
    left = np.where((s > 40.0) & (s < 60.0), np.nan, 1.0)
    area = swept_area(path, s, left, -left)
    assert area.geom_type == "MultiPolygon"
    assert area.area == pytest.approx(160.0)


def test_on_a_map_the_coordinates_are_degrees_and_carry_the_attribution(straight: Result) -> None:
    def to_lonlat(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        return 12.0 + x / 60e3, 57.0 + y / 111e3

    road = replace(straight.drive.road, to_lonlat=to_lonlat, notice="© the surveyors")
    area, *_, centre = features(replace(straight, drive=replace(straight.drive, road=road)))
    west, south, east, north = shape(area["geometry"]).bounds
    assert (west, east) == pytest.approx((12.0, 12.0 + 80.0 / 60e3), abs=1e-7)
    assert (south, north) == pytest.approx((57.0 - 1.27 / 111e3, 57.0 + 1.27 / 111e3), abs=1e-7)
    assert centre["properties"]["attribution"] == "© the surveyors"
    assert all(round(value, 7) == value for point in centre["geometry"]["coordinates"] for value in point)


def test_a_fine_area_keeps_its_size_in_degrees(straight: Result) -> None:
    plane = to_plane(np.array([[11.95, 57.7], [11.951, 57.7]]))
    road = replace(straight.drive.road, to_lonlat=plane.to_lonlat)
    sliver = shapely.box(10.0, 2.0, 14.3, 2.026)  # a kerb to be taken away: a grid of 1 cm would change a third of it
    drawn = shape(json.loads(json_bytes(feature_of(sliver, road, {}, fine=True)))["geometry"])
    area, _ = Geod(ellps="WGS84").geometry_area_perimeter(drawn)
    assert area == pytest.approx(sliver.area, rel=0.01)
