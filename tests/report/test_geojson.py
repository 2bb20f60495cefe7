"""Kerbs in drawings, what was swept beyond them, and both as GeoJSON."""

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
from hdvplan.judging.bodies import corners, pose_at
from hdvplan.judging.result import Result, result_of
from hdvplan.judging.sentences import breach_text
from hdvplan.judging.verdict import verdict_of, verdict_text
from hdvplan.report.geojson import feature as feature_of
from hdvplan.report.geojson import swept_area, swept_geojson
from hdvplan.report.kerbs import beyond_kerb, broken_kerb, shown_kerbs
from hdvplan.report.rooms import room_at, tightness
from hdvplan.road.crs import to_plane
from hdvplan.road.path import from_curvature
from hdvplan.road.pieces import Kerb
from hdvplan.road.regions import Kind, Region


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


def between(straight: Result, *kerbs: list[tuple[float, float]]) -> Result:
    """Return the straight drive, 1.27 m to either side, between a left and a right kerb."""
    made = tuple(Kerb(np.array(points), np.array(points)[:, 0], left) for points, left in zip(kerbs, (True, False), strict=True))
    road = replace(straight.drive.road).with_kerbs(made)
    return result_of(replace(straight.drive, road=road), solver="riccati", objective="geometric")


def test_a_conflict_is_what_bodies_swept_beyond_the_kerb_and_nothing_within_it(straight: Result) -> None:
    notched = [(-20.0, 3.0), (40.0, 3.0), (40.5, 1.0), (44.5, 1.0), (45.0, 3.0), (110.0, 3.0)]
    result = between(straight, notched, [(-20.0, -3.0), (110.0, -3.0)])
    (breach,) = result.balance.breaches
    area = beyond_kerb(result, breach)
    street = shapely.Polygon([*notched, (110.0, -3.0), (-20.0, -3.0)])
    side = straight.balance.max_left  # along a straight line, to the solver's tolerance
    wanted = shapely.intersection(shapely.box(0.0, -side, 90.0, side), shapely.Polygon(notched[1:-1]))
    assert breach.depth == pytest.approx(side - 1.0, abs=1e-3)  # as above
    assert area.area == pytest.approx(wanted.area, abs=4.5e-3)  # a millimetre along the notch, as above
    assert shapely.intersection(area, street).area < 1e-6  # rounding of coordinates


def test_what_lies_beyond_the_end_is_judged_told_and_drawn_there(straight: Result) -> None:
    narrow = [(-20.0, 3.0), (84.0, 3.0), (84.0, 1.0), (110.0, 1.0)]
    result = between(straight, narrow, [(-20.0, -3.0), (110.0, -3.0)])
    (breach,) = result.balance.breaches
    room = room_at(result, int(np.argmax(tightness(result))))
    assert 84.0 <= breach.s_deepest == room.s
    assert room.ends[0] == pytest.approx(breach.place)
    assert np.hypot(*(room.ends[1] - room.ends[0])) == pytest.approx(breach.depth, abs=1e-6)  # micrometres of rounding
    assert beyond_kerb(result, breach).bounds[0] == pytest.approx(84.0)
    (left, _) = (kerb.line for kerb in shown_kerbs(result))
    reached = corners(result.drive, np.array([pose_at(result.drive, result.drive.road.path.length)]))[0, 0, :, 0].max()
    assert left.bounds[2] >= reached > 84.0
    bridge = np.array([narrow[1], narrow[2]])
    drive = replace(result.drive, road=replace(result.drive.road, bridges=(bridge,)))
    bridged = [kerb.line for kerb in shown_kerbs(replace(result, drive=drive)) if kerb.bridged]
    assert [line.length for line in bridged] == [pytest.approx(2.0, abs=1e-3)]  # a quarter of a millimetre around it


def test_overhangs_beyond_the_kerbs_of_wheels_are_no_conflict(kerbed: Result) -> None:
    assert {kerb.binds for kerb in shown_kerbs(kerbed)} == {"wheels", "overhangs"}
    poses = np.arange(len(kerbed.drive.poses_s))
    wheels = shapely.union_all(shapely.polygons(corners(kerbed.drive, poses, axles_only=True)[:, 0]))
    breaches = [one for one in kerbed.balance.breaches if one.region == "drivable"]
    assert breaches
    for breach in breaches:
        area = beyond_kerb(kerbed, breach)
        assert area.area > 0.0
        # Between two poses, 0.25 m apart, a corner that turns with a radius of 10 m leaves the chord by a millimetre.
        assert shapely.difference(area, shapely.buffer(wheels, 0.03)).is_empty


def test_beside_an_island_that_overhangs_may_cross_limits_are_its_outline_and_the_kerbs_once(straight: Result) -> None:
    island = shapely.box(40.0, 1.6, 50.0, 2.4)
    road = replace(straight.drive.road, regions=(Region(Kind.SWEEPABLE, island),)).with_limits(4.0, 1.2)
    result = result_of(replace(straight.drive, road=road), solver="riccati", objective="geometric")
    kerbs = shown_kerbs(result)
    away = [(kerb.side, kerb.binds) for kerb in kerbs if shapely.distance(kerb.line, island) > 0.1]
    assert away == [("left", "wheels"), ("right", "wheels")]
    street = shapely.boundary(shapely.box(-500.0, -1.2, 500.0, 4.0) - island)
    assert all(shapely.covers(shapely.buffer(street, 1e-3), kerb.line) for kerb in kerbs)  # nothing across it behind the island
    assert {breach_text(result, breach).partition(" by ")[0].rpartition("the ")[2] for breach in result.balance.breaches} == {"right limit"}
    assert "beyond the right limit;" in verdict_text(result, verdict_of(result))


def test_a_conflict_on_the_inside_of_a_bend_is_as_deep_as_its_breach(bus: Result) -> None:
    road = bus.drive.road.with_limits(2.3, 4.0)
    result = result_of(replace(bus.drive, road=road), solver="riccati", objective="geometric")
    (breach,) = [one for one in result.balance.breaches if one.side == "left"]
    kerb, area = broken_kerb(result, breach, 1.0), beyond_kerb(result, breach)
    furthest = np.max(shapely.distance(shapely.points(shapely.get_coordinates(area)), kerb))
    # Between two poses, 0.25 m apart, a side comes nearer to the centre by less than a millimetre, and the kerb has chords as short.
    assert furthest == pytest.approx(breach.depth, abs=2e-3)
