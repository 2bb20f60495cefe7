"""GeoJSON roads and answers of the Overpass API: choosing a line, joining its parts, and coordinates that cannot be right."""

from __future__ import annotations

import json
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest
import shapely

from hdvplan.errors import RoadError
from hdvplan.road.crs import ToLonLat
from hdvplan.road.line import RawRoad
from hdvplan.road.load import load_road
from hdvplan.road.load_json import json_object, read_overpass
from hdvplan.road.load_json import read_geojson as read_document
from hdvplan.road.options import RoadOptions
from hdvplan.road.regions import Kind

LINE = [[11.97, 57.70], [11.971, 57.701], [11.972, 57.7015]]


def read_geojson(text: str, name: str, **options: str) -> RawRoad:
    return read_document(json_object(text, name), name, RoadOptions(**options))  # type: ignore[arg-type]  # all of these are texts


def geometry(coordinates: Any = LINE, kind: str = "LineString") -> dict[str, Any]:  # noqa: ANN401
    return {"type": kind, "coordinates": coordinates}


def feature(shape: dict[str, Any] | None = None, **properties: object) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": shape or geometry()}


def collection(*features: dict[str, Any], **members: object) -> str:
    return json.dumps({"type": "FeatureCollection", "features": list(features), **members})


def test_geometry_feature_and_collection_give_the_same_road() -> None:
    expected = read_geojson(json.dumps(geometry()), "f").points
    for document in (json.dumps(feature()), collection(feature())):
        np.testing.assert_array_equal(read_geojson(document, "f").points, expected)
    three_dimensional = geometry([[*position, 12.0] for position in LINE])
    np.testing.assert_array_equal(read_geojson(json.dumps(three_dimensional), "f").points, expected)


def test_one_of_several_lines_is_chosen_by_name_or_id() -> None:
    text = collection(feature(name="north"), feature(geometry(LINE[::-1]), name="south", id=7))
    north, south = read_geojson(text, "f", feature="north"), read_geojson(text, "f", feature="7")
    np.testing.assert_allclose(north.points, south.points[::-1], atol=1e-9)  # the same line backwards
    with pytest.raises(RoadError, match="2 lines, and none is chosen: 'north', 'south'"):
        read_geojson(text, "f")
    with pytest.raises(RoadError, match="no line is called 'west'; there are 'north', 'south'"):
        read_geojson(text, "f", feature="west")


def test_parts_are_joined_in_their_direction_whatever_their_order() -> None:
    whole = read_geojson(json.dumps(geometry()), "f").points
    for parts in ([LINE[:2], LINE[1:]], [LINE[1:], LINE[:2]]):
        points = read_geojson(json.dumps(geometry(parts, "MultiLineString")), "f").points
        distinct = points[np.append(True, np.any(np.diff(points, axis=0) != 0.0, axis=1))]
        np.testing.assert_allclose(distinct, whole, atol=1e-9)


def test_a_track_goes_on_over_a_pause_no_longer_than_its_steps_and_that_is_told() -> None:
    parts = [[[11.97, 57.70], [11.9702, 57.70]], [[11.9703, 57.70], [11.9705, 57.70]]]  # steps of 12 m, 6 m apart
    raw = read_geojson(json.dumps(geometry(parts, "MultiLineString")), "f")
    assert len(raw.points) == 4
    assert raw.notes == ("f: the line's 2 parts are taken as one, over gaps of up to 6.0 m",)
    parts[1][0][0] = 11.9704  # no step is 12 m beyond it
    with pytest.raises(RoadError, match="do not join"):
        read_geojson(json.dumps(geometry(parts, "MultiLineString")), "f")


def test_parts_that_do_not_join_list_their_gaps() -> None:
    # 0.001 degrees of longitude at 57.7 degrees north are 59.6 m
    parts = [[[11.97, 57.70], [11.971, 57.70]], [[11.972, 57.70], [11.973, 57.70]]]
    with pytest.raises(RoadError, match=r"2 parts do not join to one; .* gaps of 59\.\d\d m"):
        read_geojson(json.dumps(geometry(parts, "MultiLineString")), "f")
    backwards = [LINE[:2], LINE[:0:-1]]
    with pytest.raises(RoadError, match="do not join"):
        read_geojson(json.dumps(geometry(backwards, "MultiLineString")), "f")


@pytest.mark.parametrize(
    ("properties", "sides"), [({"left_m": 4, "right_m": 2.5}, (4.0, 2.5)), ({"width_m": 7.0}, (3.5, 3.5)), ({"width": "?"}, None)]
)
def test_widths_come_from_properties(properties: dict[str, Any], sides: tuple[float, float] | None) -> None:
    raw = read_geojson(json.dumps(feature(**properties)), "f")
    if sides is None:
        assert raw.reaches is None
    else:
        assert raw.reaches is not None
        np.testing.assert_array_equal(raw.reaches[:, 1], [*sides, *sides])


def test_widths_under_other_names_are_told_and_not_taken() -> None:
    raw = read_geojson(json.dumps(feature(width=3.6, Left="1.8", lanes=2)), "f")
    assert raw.reaches is None
    assert raw.notes == ("f: width, Left not read; widths are called left_m and right_m, or width_m, in metres",)


def test_an_old_crs_member_is_honoured_and_overridden() -> None:
    line = geometry([[500000.0, 6400000.0], [500100.0, 6400000.0]])
    member = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3006"}}
    raw = read_geojson(json.dumps({**line, "crs": member}), "f")
    np.testing.assert_array_equal(raw.points, line["coordinates"])
    assert raw.to_lonlat == ToLonLat("EPSG:3006")  # as it is told
    np.testing.assert_array_equal(read_geojson(json.dumps(line), "f", crs="EPSG:3006").points, raw.points)
    with pytest.raises(RoadError, match="outside \\+-180") as caught:
        read_geojson(json.dumps(line), "f")
    assert "--crs" in str(caught.value.hint)


def test_widths_may_be_given_for_each_point_and_change_where_a_point_is_there_twice() -> None:
    line = geometry([LINE[0], LINE[1], LINE[1], LINE[2]])
    raw = read_geojson(json.dumps(feature(line, left_m=[3, 3, 2, 2], right_m=[4, 4, 4.5, 4.5])), "f")
    np.testing.assert_array_equal(raw.reaches, [[3, 3, 2, 2], [4, 4, 4.5, 4.5]] * 2)


def test_polygons_with_a_region_come_along_in_the_road_s_plane() -> None:
    ring = geometry([[*LINE, LINE[0]]], "Polygon")
    raw = read_geojson(collection(feature(), feature(ring, region="obstacle", name="van"), feature(ring)), "f")
    assert [(region.kind, region.label) for region in raw.regions] == [(Kind.OBSTACLE, "van")]  # the other is none of ours
    corners = shapely.get_coordinates(raw.regions[0].polygon)
    np.testing.assert_allclose(np.unique(corners, axis=0), np.unique(raw.points, axis=0), atol=1e-9)  # the line's own vertices
    two = geometry([[[*LINE, LINE[0]]], [[*(np.array(LINE) + 0.01).tolist(), (np.array(LINE[0]) + 0.01).tolist()]]], "MultiPolygon")
    assert len(read_geojson(collection(feature(), feature(two, region="sweepable")), "f").regions) == 2


def test_a_polygon_that_crosses_itself_keeps_its_areas() -> None:
    bow_tie = geometry([[[11.97, 57.70], [11.972, 57.702], [11.972, 57.70], [11.97, 57.702], [11.97, 57.70]]], "Polygon")
    assert len(read_geojson(collection(feature(), feature(bow_tie, region="obstacle")), "f").regions) == 2


def test_the_notice_is_the_attribution_with_the_licence() -> None:
    raw = read_geojson(json.dumps(feature(attribution="© Some City. Contains data.", licence="CC-BY-4.0")), "f")
    assert raw.notice == "© Some City, CC BY 4.0"
    assert read_geojson(json.dumps(feature()), "f").notice is None


def test_geometries_in_each_other_are_refused_however_deep_they_are(tmp_path: Path) -> None:
    """Each version of Python gives up at depths of its own: while it reads the file, or later."""
    for depth in (100, *range(430, 500), 1500):
        shape = '{"type": "GeometryCollection", "geometries": [' * depth + "]}" * depth
        (tmp_path / "deep.geojson").write_text(shape, encoding="utf-8")
        with pytest.raises(RoadError):
            load_road(tmp_path / "deep.geojson")


def test_a_name_of_nothing_but_brackets_takes_no_time() -> None:
    began = process_time()
    assert len(read_geojson(json.dumps(feature(name="(" * 300_000)), "f").points) == len(LINE)
    assert process_time() - began < 10.0  # takes 0.1 s; where every bracket looked for its end it took minutes


def test_a_network_of_streets_in_one_line_is_refused_at_once() -> None:
    streets = [[[11.9 + 1e-4 * number, 57.7], [11.9 + 1e-4 * number, 57.70005]] for number in range(5001)]
    began = process_time()
    with pytest.raises(RoadError, match="5001 parts out of order"):
        read_geojson(json.dumps(geometry(streets, "MultiLineString")), "f")
    with pytest.raises(RoadError, match=r"3000 parts do not join to one; .* gaps of 8\.\d\d m"):
        read_geojson(json.dumps(geometry(streets[:3000], "MultiLineString")), "f")
    assert process_time() - began < 20.0  # takes 1 s; gap by gap it took half a minute, and an hour of 30,000 parts


def test_a_scribble_of_thousands_of_points_is_refused_at_once_and_a_clean_outline_is_not() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 5000, endpoint=False)
    ring = np.stack([11.98 + 1e-3 * np.cos(angle), 57.70 + 1e-3 * np.sin(angle)], axis=1)
    scribble = np.random.default_rng(0).permutation(ring)
    assert len(read_geojson(collection(feature(), feature(geometry([ring.tolist()], "Polygon"), region="obstacle")), "f").regions) == 1
    began = process_time()
    with pytest.raises(RoadError, match="region 1 crosses itself, and has 5001 points"):
        read_geojson(collection(feature(), feature(geometry([scribble.tolist()], "Polygon"), region="obstacle")), "f")
    assert process_time() - began < 10.0  # takes 0.1 s; to take it apart a minute and gigabytes


def test_names_of_megabytes_are_told_by_their_beginnings() -> None:
    document = collection(feature(name="a" * 100_000), feature(name="b" * 100_000))
    with pytest.raises(RoadError, match="2 lines, and none is chosen") as caught:
        read_geojson(document, "f")
    assert len(str(caught.value)) < 300
    square = geometry([[[11.97, 57.7], [11.971, 57.7], [11.971, 57.701], [11.97, 57.7]]], "Polygon")
    (region,) = read_geojson(collection(feature(), feature(square, region="obstacle", name="c" * 100_000)), "f").regions
    assert region.label == "c" * 250


PLACES = [{"lat": 57.7, "lon": 11.95}, {"lat": 57.7, "lon": 11.951}, {"lat": 57.701, "lon": 11.952}]
WAY = {"type": "way", "id": 7, "geometry": PLACES, "tags": {"name": "Hamngatan", "region": "west", "edge": "left"}}


def read(*elements: Any, feature: str | None = None) -> Any:  # noqa: ANN401 - JSON
    return read_overpass({"elements": list(elements)}, "f", RoadOptions(feature=feature))


def test_a_way_with_its_geometry_is_a_road_with_the_attribution_of_the_map() -> None:
    raw = read(WAY)
    lon, lat = raw.to_lonlat(*raw.points.T)
    np.testing.assert_allclose(np.stack([lon, lat], axis=1), [[place["lon"], place["lat"]] for place in PLACES], atol=1e-9)
    assert raw.notice == "© OpenStreetMap contributors, ODbL 1.0"


def test_ways_are_chosen_by_name_or_id_and_may_take_their_places_from_nodes() -> None:
    nodes = [{"type": "node", "id": number, **place} for number, place in enumerate(PLACES)]
    other = {"type": "way", "id": 8, "nodes": [2, 1, 0]}
    np.testing.assert_allclose(read(WAY, other, *nodes, feature="8").points, read(WAY, other, feature="Hamngatan").points[::-1])
    with pytest.raises(RoadError, match="2 lines, and none is chosen: 'Hamngatan', '8'"):
        read(WAY, other, *nodes)


def test_a_relation_joins_its_ways_without_its_platforms() -> None:
    first, second = {"type": "way", "geometry": PLACES[:2], "role": ""}, {"type": "way", "geometry": PLACES[1:], "role": ""}
    platform = {"type": "way", "geometry": [{"lat": 57.6, "lon": 11.9}, {"lat": 57.6, "lon": 11.91}], "role": "platform"}
    relation = {"type": "relation", "id": 1, "members": [first, platform, second, {"type": "node", "ref": 3, "role": "stop"}]}
    assert len(read(relation).points) == 4


@pytest.mark.parametrize("elements", [[], [{"type": "way", "id": 1, "nodes": [1, 2]}], [5, {"type": "relation", "members": 3}]])
def test_an_answer_without_geometry_says_how_to_ask_for_it(elements: list[Any]) -> None:
    with pytest.raises(RoadError, match="no way with a geometry") as caught:
        read(*elements)
    assert "out geom" in str(caught.value.hint)


def test_nodes_and_roles_that_are_lists_are_no_nodes_and_no_roles() -> None:
    node: dict[str, Any] = {"type": "node", "id": [7], "lon": 12.0, "lat": 57.0}
    way = {"type": "way", "id": 1, "nodes": [[7], [7]]}
    relation = {"type": "relation", "id": 2, "members": [{"type": "way", "role": ["stop"], "nodes": [[7]]}]}
    with pytest.raises(RoadError, match="no way with a geometry among 4 elements"):
        read_overpass({"elements": [node, {**node, "id": 8}, way, relation]}, "road")
