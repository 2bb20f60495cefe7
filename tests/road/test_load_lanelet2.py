"""Lanelet2 maps that the library itself has written: routes over lanelets, and what is refused."""

from __future__ import annotations

import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import shapely

import hdvplan
from hdvplan.errors import RoadError
from hdvplan.road.load import load_road
from hdvplan.road.load_lanelet2 import read_lanelet2, with_centreline
from hdvplan.road.options import RoadOptions

core, io, projection = (pytest.importorskip(f"lanelet2.{part}") for part in ("core", "io", "projection"))

RADIUS_M, WIDTH_M, BEFORE_M = 20.0, 3.5, 40.0
TURN_M = 0.5 * np.pi * RADIUS_M
ORIGIN = (49.0, 8.4)


@pytest.fixture
def written(tmp_path: Path) -> Path:
    """Return a map of a lane that runs east, turns to the left and runs north: lanelets 1 to 3; 4 goes on from 1, 5 is a path."""
    map_ = core.LaneletMap()
    rows: dict[tuple[float, float], object] = {}

    def line(left: float, points: list[tuple[float, float, float]]) -> object:
        shifted = [(x - left * np.sin(psi), y + left * np.cos(psi)) for x, y, psi in points]
        found = []
        for x, y in shifted:
            key = (round(x, 6), round(y, 6))
            rows[key] = rows.get(key) or core.Point3d(core.getId(), x, y, 0.0)
            found.append(rows[key])
        return core.LineString3d(core.getId(), found)

    straight = [(x, 0.0, 0.0) for x in np.linspace(0.0, BEFORE_M, 5)]
    psi = np.linspace(0.0, 0.5 * np.pi, 13)
    turn = [(BEFORE_M + RADIUS_M * np.sin(angle), RADIUS_M * (1.0 - np.cos(angle)), angle) for angle in psi]
    north = [(BEFORE_M + RADIUS_M, RADIUS_M + y, 0.5 * np.pi) for y in np.linspace(0.0, BEFORE_M, 5)]
    aside = [(BEFORE_M + x, 0.0, 0.0) for x in np.linspace(0.0, BEFORE_M, 5)]
    away = [(x, -100.0, 0.0) for x in np.linspace(0.0, BEFORE_M, 5)]
    for number, points in enumerate((straight, turn, north, aside, away), start=1):
        lanelet = core.Lanelet(number, line(0.5 * WIDTH_M, points), line(-0.5 * WIDTH_M, points))
        subtype = "walkway" if number == 5 else "road"
        for key, value in {"subtype": subtype, "location": "urban", "one_way": "no" if number == 4 else "yes"}.items():
            lanelet.attributes[key] = value
        map_.add(lanelet)
    path = tmp_path / "map.osm"
    io.write(str(path), map_, projection.LocalCartesianProjector(io.Origin(*ORIGIN)))
    return path


def test_a_lane_is_its_middle_between_its_bounds(written: Path) -> None:
    raw = read_lanelet2(written, road_ids="1,3")
    assert raw.notes == ("map.osm: over lanelets 1, 2, 3",)
    length = float(np.sum(np.hypot(*np.diff(raw.points, axis=0).T)))
    assert length == pytest.approx(2.0 * BEFORE_M + TURN_M, abs=0.2)  # chords of the bend
    assert len(raw.edges) == 2
    road = load_road(written, RoadOptions(road_ids=("1", "3")))
    limits = road.limits
    assert limits is not None
    within = (limits.s > 5.0) & (limits.s < road.path.length - 5.0)
    np.testing.assert_allclose((limits.left - limits.right)[within], WIDTH_M, atol=0.05)
    lon, lat = road.to_lonlat(*road.path.to_plane(np.zeros(1), np.zeros(1)))  # type: ignore[misc] # it has a place
    assert (float(lat[0]), float(lon[0])) == pytest.approx(ORIGIN, abs=1e-6)


def test_a_car_is_planned_along_lanelets(written: Path) -> None:
    road = load_road(written, RoadOptions(road_ids="1,3"))
    result = hdvplan.plan(hdvplan.Case(road, hdvplan.load_vehicle("P")))
    assert result.balance.min_clearance is not None
    assert 0.3 < result.balance.min_clearance < 0.5 * WIDTH_M


def test_a_lanelet_is_driven_against_its_direction_where_the_map_allows_it(written: Path) -> None:
    there, back = (read_lanelet2(written, road_ids=road_ids) for road_ids in ("4", "-4"))
    np.testing.assert_allclose(back.points[0] - back.points[-1], there.points[-1] - there.points[0], atol=1e-6)


@pytest.mark.parametrize(("road_ids", "driven"), [("1,3", [1, 2, 3]), ("-4", [-4])])
def test_a_driven_line_is_the_centreline_of_the_lanelets_that_it_crosses(written: Path, road_ids: str, driven: list[int]) -> None:
    """Each lanelet has its part, in its own direction; the parts meet, and no point of the line is lost."""
    raw = read_lanelet2(written, road_ids=road_ids)
    assert raw.to_lonlat is not None
    lon, lat = raw.to_lonlat(*raw.points.T)
    lat += 3e-6 * np.linspace(0.0, 1.0, len(lat))  # up to 0.3 m aside
    path = written.with_name("centred.osm")
    line = np.column_stack((lon, lat))
    path.write_bytes(with_centreline(written, road_ids, shapely.LineString(line)))
    projector = projection.LocalCartesianProjector(io.Origin(*ORIGIN))
    lanelets, errors = io.loadRobust(str(path), projector)
    assert not list(errors)
    ways = [lanelets.laneletLayer[abs(number)] for number in driven]
    lines = [list((way if number > 0 else way.invert()).centerline) for way, number in zip(ways, driven, strict=True)]
    assert all(before[-1].id == after[0].id for before, after in pairwise(lines))
    points = [projector.reverse(point.basicPoint()) for line in lines for point in line]
    found = np.array([(point.lon, point.lat) for point in points])
    np.testing.assert_allclose(found[[0, -1]], line[[0, -1]], atol=1e-8)  # 1 mm, to which maps are written
    assert all(np.min(np.hypot(*(found - place).T)) < 1e-8 for place in line)
    assert lanelets.laneletLayer[5].centerline.id == 0  # none is in the map, as before


@pytest.mark.parametrize(
    ("road_ids", "told"),
    [
        (
            None,
            r"4 lanelets that vehicles drive, and none is chosen; long ways are 1,3 \(111 m\), -4 \(40 m\)\nhint: .*--road-ids 1,3",
        ),
        ("1,9", "vehicles drive no lanelet '9'; there are 1, 2, 3, 4"),
        ("5", "vehicles drive no lanelet '5'"),
        ("-1", "lanelet 1 is one-way"),
        ("-9", "vehicles drive no lanelet '-9'"),
        ("3,1", "no way leads from lanelet 3 to 1"),
    ],
)
def test_ways_that_are_none_are_refused(written: Path, road_ids: str | None, told: str) -> None:
    with pytest.raises(RoadError, match=told):
        read_lanelet2(written, road_ids=road_ids)


def spoilt(spoil: Callable[[str], str], path: Path) -> Path:
    path.write_text(spoil(path.read_text(encoding="utf-8")), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (lambda text: text[: len(text) // 2], "no Lanelet2 map that can be read"),
        (lambda text: text.replace(' lat="', ' latitude="', 1), "the map's first node has no latitude and longitude"),
    ],
)
def test_damaged_maps_are_refused(written: Path, spoil: Callable[[str], str], told: str) -> None:
    with pytest.raises(RoadError, match=told):
        read_lanelet2(spoilt(spoil, written), road_ids="1")


def test_without_the_library_it_is_told_what_to_install(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "lanelet2.core", None)
    with pytest.raises(RoadError, match="read by lanelet2") as caught:
        hdvplan.load_road(written, RoadOptions(road_ids="1"))
    assert caught.value.hint == "pip install 'hdvplan[lanelet2]'"


def test_options_of_vector_files_have_no_use(written: Path) -> None:
    with pytest.raises(RoadError, match="a Lanelet2 map has no use for --layer"):
        load_road(written, RoadOptions(layer="roads", road_ids="1"))
