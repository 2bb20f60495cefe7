"""Vector files of other programs: the same street from every format, and what is beside it."""

from __future__ import annotations

import json
import re
import sqlite3
import warnings
from collections.abc import Sequence
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyogrio
import pytest
import shapely
from ezdxf.filemanagement import new
from pyproj import Transformer
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray
from hdvplan.errors import OptionError, RoadError
from hdvplan.road.line import RawRoad
from hdvplan.road.load import find_road, load_road
from hdvplan.road.load_vector import read_vector
from hdvplan.road.options import RoadOptions
from hdvplan.road.recorded import smoothed_in_time
from hdvplan.road.regions import Kind

LONLAT = np.array([[11.950, 57.700], [11.9505, 57.700], [11.951, 57.700], [11.9513, 57.70005], [11.95138, 57.7002], [11.95138, 57.7008]])
METRES = np.stack(Transformer.from_crs("OGC:CRS84", "EPSG:3006", always_xy=True).transform(*LONLAT.T), axis=1)
LINE, GRID_LINE = shapely.LineString(LONLAT), shapely.LineString(METRES)
HOARDING = shapely.box(11.95131, 57.70023, 11.95136, 57.70036)
SAME_M = 1e-3  # GML and MapInfo files round to 1e-9 degrees or a like share of their extent
GRID_M = 0.05  # SWEREF 99 TM and the local projection differ in scale by 1e-5, and in direction

TRACK = "<trk><name>A</name><trkseg>{}</trkseg></trk>"
GPX = '<gpx version="1.1" creator="g" xmlns="http://www.topografix.com/GPX/1/1"><wpt lat="57.6" lon="11.9"/>' + TRACK + "</gpx>"
PLACEMARK = "<Placemark><name>A</name><LineString><coordinates>{}</coordinates></LineString></Placemark>"
KML = '<kml xmlns="http://www.opengis.net/kml/2.2"><Document>' + PLACEMARK + "</Document></kml>"


def write(
    path: Path,
    geometries: Sequence[BaseGeometry],
    *,
    crs: str | None = "EPSG:4326",
    layer: str | None = None,
    driver: str | None = None,
    **columns: list[Any],
) -> Path:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # writing is not under test: a missing system and short field names are meant
        pyogrio.raw.write(
            path,
            geometry=shapely.to_wkb(np.array(geometries, dtype=object)),
            field_data=[np.array(values, dtype=object if isinstance(values[0], str) else float) for values in columns.values()],
            fields=list(columns),
            geometry_type=geometries[0].geom_type,
            crs=crs,
            layer=layer,
            driver=driver,
            append=path.exists(),
        )
    return path


def reference(tmp_path: Path, **properties: object) -> Path:
    document = {"type": "Feature", "properties": properties, "geometry": shapely.geometry.mapping(LINE)}
    path = tmp_path / "reference.geojson"
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("name", "driver"),
    [
        ("road.gpkg", None),
        ("road.shp", None),
        ("road.fgb", None),
        ("road.kml", "KML"),
        ("road.gml", None),
        ("road.sqlite", None),
        ("ROAD.GPKG", None),
        ("road.tab", "MapInfo File"),
        ("road.geojsonl", "GeoJSONSeq"),
    ],
)
def test_every_format_gives_the_road_that_geojson_gives(tmp_path: Path, name: str, driver: str | None) -> None:
    expected = load_road(reference(tmp_path)).path
    road = load_road(write(tmp_path / name, [LINE], driver=driver))
    assert road.path.length == pytest.approx(expected.length, abs=SAME_M)
    assert road.to_lonlat is not None
    assert not road.notes


def test_tracks_and_placemarks_are_roads_and_waypoints_are_not(tmp_path: Path) -> None:
    points = "".join(f'<trkpt lat="{lat}" lon="{lon}"/>' for lon, lat in LONLAT)
    (tmp_path / "a.gpx").write_text(GPX.format(points), encoding="utf-8")
    (tmp_path / "a.kml").write_text(KML.format(" ".join(f"{lon},{lat},0" for lon, lat in LONLAT)), encoding="utf-8")
    expected = load_road(reference(tmp_path)).path.length
    for name in ("a.gpx", "a.kml"):
        assert load_road(tmp_path / name).path.length == pytest.approx(expected, abs=SAME_M)


def test_projected_files_keep_their_own_coordinates(tmp_path: Path) -> None:
    road = load_road(write(tmp_path / "grid.gpkg", [GRID_LINE], crs="EPSG:3006"))
    assert (float(road.path.at(0.0).x), float(road.path.at(0.0).y)) == pytest.approx(tuple(METRES[0]), abs=1e-6)
    assert road.path.length == pytest.approx(load_road(reference(tmp_path)).path.length, abs=GRID_M)


@pytest.mark.parametrize("system", ["EPSG:3857", "EPSG:2263"])
def test_systems_without_true_metres_are_brought_to_longitude_and_latitude_first(tmp_path: Path, system: str) -> None:
    turn = Transformer.from_crs("OGC:CRS84", system, always_xy=True)
    shift = np.array([-74.0 - 11.95, 40.7 - 57.7])  # EPSG:2263 is New York, in feet
    there = shapely.LineString(np.stack(turn.transform(*(LONLAT + shift).T), axis=1))
    plain = write(tmp_path / "plain.gpkg", [shapely.LineString(LONLAT + shift)])
    road = load_road(write(tmp_path / "there.gpkg", [there], crs=system))
    assert road.path.length == pytest.approx(load_road(plain).path.length, abs=SAME_M)
    (tmp_path / "there.csv").write_text("x,y\n" + "\n".join(f"{x!r},{y!r}" for x, y in there.coords))
    table = load_road(tmp_path / "there.csv", RoadOptions(crs=system))
    assert table.path.length == pytest.approx(road.path.length, abs=1e-9)  # one way for all files


def test_a_drawing_without_a_system_is_in_metres_and_crs_places_it(tmp_path: Path) -> None:
    drawing = write(tmp_path / "a.dxf", [GRID_LINE], crs=None)
    road = load_road(drawing)
    assert road.to_lonlat is None
    assert road.notes == ("a.dxf says no unit; its coordinates are read as metres, unless --unit says otherwise",)  # GDAL means none
    placed = load_road(drawing, RoadOptions(crs="EPSG:3006"))
    assert placed.to_lonlat is not None
    lon, lat = placed.to_lonlat(*(np.array([value]) for value in METRES[0]))
    assert (lon[0], lat[0]) == pytest.approx(tuple(LONLAT[0]), abs=1e-8)


def test_well_known_text_in_a_csv_is_read_and_its_degrees_are_noticed(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(f'WKT,name\n"{LINE.wkt}",A\n', encoding="utf-8")
    road = load_road(tmp_path / "a.csv")
    assert road.path.length == pytest.approx(load_road(reference(tmp_path)).path.length, abs=SAME_M)
    assert "read as longitude and latitude" in road.notes[0]


def test_texts_in_an_old_encoding_are_read_and_those_in_none_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(f'WKT,name\n"{LINE.wkt}",Hafenstra\xdfe\n"{LINE.wkt}",Kai\n'.encode("latin-1"))
    assert load_road(tmp_path / "a.csv", RoadOptions(feature="Hafenstraße")).path.length > 0.0
    (tmp_path / "b.csv").write_bytes(f'WKT,name\n"{LINE.wkt}",\x81\n'.encode("latin-1"))
    with pytest.raises(RoadError, match=r"b\.csv cannot be read"):
        load_road(tmp_path / "b.csv")


def test_spreadsheets_are_tables_of_points_with_a_sheet_to_choose(tmp_path: Path) -> None:
    for layer in ("Blatt1", "Blatt2"):
        pyogrio.raw.write(
            tmp_path / "a.xlsx",
            geometry=None,
            field_data=[*LONLAT.T.copy(), np.full(len(LONLAT), 7.0)],
            fields=["Längengrad", "Breitengrad", "Breite"],
            geometry_type=None,
            layer=layer,
            append=(tmp_path / "a.xlsx").exists(),
        )
    with pytest.raises(RoadError, match="2 sheets, and none is chosen: 'Blatt1', 'Blatt2'"):
        load_road(tmp_path / "a.xlsx")
    road = load_road(tmp_path / "a.xlsx", RoadOptions(layer="Blatt2"))
    assert road.path.length == pytest.approx(load_road(reference(tmp_path)).path.length, abs=SAME_M)
    assert road.limits is not None
    assert road.limits.left[0] == pytest.approx(3.5)


def test_widths_come_from_columns_in_any_case(tmp_path: Path) -> None:
    shape = load_road(write(tmp_path / "a.shp", [LINE], WIDTH_M=[7.0]))
    text = load_road(write(tmp_path / "a.gpkg", [LINE], Left_m=["3,5"], RIGHT_M=["3.5"]))
    for road in (shape, text):
        assert road.limits is not None
        assert (road.limits.left[0], road.limits.right[0]) == pytest.approx((3.5, -3.5))


def test_one_of_several_lines_is_asked_for_and_chosen_by_name_layer_or_number(tmp_path: Path) -> None:
    other = shapely.LineString(LONLAT + 0.01)
    file = write(tmp_path / "a.gpkg", [LINE, other], layer="streets", name=["North", "South"])
    write(file, [other], layer="paths", name=["West"])
    with pytest.raises(RoadError, match="3 lines, and none is chosen: 'North' in 'streets', 'South' in 'streets', 'West'") as caught:
        load_road(file)
    assert caught.value.hint == "choose one with --name or --id or --layer"
    start = [load_road(file, options).to_lonlat is not None for options in (RoadOptions(feature="South"), RoadOptions(layer="paths"))]
    assert start == [True, True]
    assert load_road(file, RoadOptions(feature="2", layer="streets")).path.length > 0.0
    with pytest.raises(RoadError, match="no line in a layer called 'lanes'; there are 'paths', 'streets'"):
        load_road(file, RoadOptions(layer="lanes"))


def test_polygons_are_regions_by_property_by_layer_and_by_role(tmp_path: Path) -> None:
    by_property = write(tmp_path / "a.gpkg", [LINE], layer="road")
    write(by_property, [HOARDING], layer="things", region=["Obstacle"])
    by_layer = write(tmp_path / "b.gpkg", [LINE], layer="road")
    write(by_layer, [HOARDING], layer="Buildings", name=["hoarding"])
    by_role = write(tmp_path / "c.gpkg", [LINE], layer="road")
    write(by_role, [HOARDING], layer="sheds", name=["hoarding"])
    for file, roles in ((by_property, ()), (by_layer, ()), (by_role, ("sheds=obstacle",)), (by_role, ("hoarding=obstacle",))):
        (region,) = load_road(file, RoadOptions(roles=roles)).regions
        assert region.kind is Kind.OBSTACLE
    assert not load_road(by_role).regions
    with pytest.raises(OptionError, match="a role is obstacle, sweepable or edge"):
        load_road(by_role, RoadOptions(roles=("hoarding=wall",)))
    with pytest.raises(RoadError, match="nothing is called 'hording', which has the role obstacle"):
        load_road(by_role, RoadOptions(roles=("hording=obstacle",)))


def test_a_closed_line_of_a_drawing_is_an_area(tmp_path: Path) -> None:
    van = shapely.LineString(shapely.box(METRES[0, 0] + 20.0, METRES[0, 1] - 3.0, METRES[0, 0] + 26.0, METRES[0, 1] - 1.0).exterior)
    drawing = write(tmp_path / "a.dxf", [GRID_LINE, van], crs=None, Layer=["ROAD", "HINDER"])
    (region,) = load_road(drawing, RoadOptions(layer="ROAD")).regions
    assert region.polygon.area == pytest.approx(12.0, abs=1e-6)
    assert region.label == "HINDER"  # not the number that the drawing program gives it


def outline(*rows: int) -> list[shapely.LineString]:
    """Lines between the corners of a parked car, 6 m long, its side 1 m from the line, which is driven to the east."""
    x, y = METRES[0]
    corners = np.array([(x + 20.0, y - 3.0), (x + 26.0, y - 3.0), (x + 26.0, y - 1.0), (x + 20.0, y - 1.0), (x + 20.0, y - 3.0)])
    return [shapely.LineString(corners[first : last + 1]) for first, last in pairwise(rows)]


@pytest.mark.parametrize(
    ("car", "area", "told"),
    [
        pytest.param(outline(0, 3), 0.14, "1 line of", id="open"),  # three sides, 1 cm thick
        pytest.param(outline(0, 1, 2, 3, 4), 12.08, "4 lines of", id="line by line"),
        pytest.param([shapely.MultiLineString(outline(0, 1, 2, 3, 4))], 12.08, "4 lines of", id="a block of lines"),
        pytest.param(outline(2, 3), 0.06, "1 line of", id="a wall"),
        pytest.param(outline(0, 3) + outline(0, 4), 12.07, "1 line of", id="one closed, one open"),
    ],
)
def test_what_a_drawing_has_of_an_obstacle_is_in_the_way_closed_or_not(
    tmp_path: Path, car: list[BaseGeometry], area: float, told: str
) -> None:
    drawing = write(tmp_path / "a.dxf", [GRID_LINE, *car], crs=None, Layer=["ROAD", *["HINDER"] * len(car)])
    road = load_road(drawing, RoadOptions(layer="ROAD"))
    assert {region.label for region in road.regions} == {"HINDER"}
    assert shapely.union_all([region.polygon for region in road.regions]).area == pytest.approx(area, abs=1e-3)  # of mitred corners
    assert [note for note in road.notes if f"{told} 'HINDER' with open ends: taken as walls, and what they enclose" in note]


def test_a_surface_that_is_an_edge_bounds_the_street_by_its_outline_and_its_holes_are_islands(tmp_path: Path) -> None:
    x, y = METRES[0]
    line, island = shapely.LineString([(x, y), (x + 60.0, y)]), shapely.box(x + 30.0, y + 1.5, x + 34.0, y + 2.5)
    surface = shapely.difference(shapely.box(x - 10.0, y - 4.0, x + 70.0, y + 5.0), island)
    write(tmp_path / "a.gpkg", [line], crs="EPSG:3006", layer="road")
    write(tmp_path / "a.gpkg", [surface], crs="EPSG:3006", layer="surface")
    road = load_road(tmp_path / "a.gpkg", RoadOptions(layer="road", roles=("surface=edge",)))
    assert road.limits is not None
    np.testing.assert_allclose([road.limits.left[100], road.limits.right[100]], [5.0, -4.0], atol=1e-3)
    (region,) = road.regions
    assert region.kind is Kind.OBSTACLE
    assert region.polygon.area == pytest.approx(4.0, abs=1e-3)


@pytest.mark.parametrize(
    ("ring", "island"),
    [
        pytest.param((30.0, -1.5, 38.0, 0.5), True, id="on the line, between kerbs"),
        pytest.param((30.0, 1.0, 38.0, 2.0), False, id="beside the line"),  # a kerb: it stays on that side
        pytest.param((10.0, -7.0, 90.0, 7.0), False, id="around the kerbs"),
        pytest.param((-5.0, -1.5, 38.0, 0.5), False, id="around the start"),
    ],
)
def test_a_closed_kerb_on_the_line_between_others_is_an_island(
    tmp_path: Path, ring: tuple[float, float, float, float], island: bool
) -> None:
    kerbs = [shapely.LineString([(-10.0, y), (110.0, y)]) for y in (-5.0, 5.0)]
    lines = [shapely.LineString([(0.0, 0.0), (100.0, 0.0)]), *kerbs, shapely.box(*ring).exterior]
    drawing = write(tmp_path / "a.dxf", [shapely.LineString(line) for line in lines], crs=None, Layer=["ROAD", *["KERB"] * 3])
    line = find_road(drawing, RoadOptions(layer="ROAD")).line
    assert line is not None
    raw = line.raw
    assert [(region.label, region.polygon.area) for region in raw.regions] == ([("KERB", 16.0)] if island else [])
    assert len(raw.edges) == 3 - island


@pytest.mark.parametrize("order", [[0, 1, 2, 3, 4], [1, 3, 0, 2, 4], [4, 2, 0, 3, 1]])
@pytest.mark.parametrize("turned", [0, 2])
def test_a_kerb_is_the_same_in_whatever_order_and_direction_its_pieces_are_drawn(tmp_path: Path, order: list[int], turned: int) -> None:
    kerb = [(0.0, 3.0), (30.0, 3.0), (30.0, 1.0), (35.0, 1.0), (35.0, 3.0), (100.0, 3.0)]
    pieces = [shapely.LineString(kerb[at : at + 2]) for at in order]
    pieces[turned] = pieces[turned].reverse()
    pieces[4] = shapely.affinity.translate(pieces[4], 4e-4)  # as exact as drawings are
    line, other = (shapely.LineString([(0.0, y), (100.0, y)]) for y in (0.0, 3.0))  # another layer's ends are at the kerb's
    over = shapely.LineString([(20.0, 3.0), (30.0, 3.0)])  # the end of another one
    shapes = [line, *pieces, pieces[1], over, other]  # one is drawn twice
    drawing = write(tmp_path / "a.dxf", shapes, crs=None, Layer=["ROAD", *["KERB"] * 7, "WALL"])
    found = find_road(drawing, RoadOptions(layer="ROAD", roles=("WALL=edge",))).line
    assert found is not None
    assert sorted(found.raw.edge_names) == ["KERB", "WALL"]
    own = shapely.LineString(found.raw.edges[found.raw.edge_names.index("KERB")])
    assert own.simplify(1e-6).normalize().equals_exact(shapely.LineString(kerb).normalize(), tolerance=1e-3)


def test_kerbs_that_cross_stay_whole_where_one_is_drawn_twice(tmp_path: Path) -> None:
    """A road that passes over itself was refused for a piece between two of its kerbs: it lay across the other arm."""
    kerbs = [shapely.LineString(points) for points in ([(0.0, 3.0), (100.0, 21.0)], [(50.0, -30.0), (53.0, 50.0)])]
    line, over = shapely.LineString([(0.0, 0.0), (100.0, 18.0)]), shapely.LineString([(20.0, 6.6), (30.0, 8.4)])
    drawing = write(tmp_path / "a.dxf", [line, *kerbs, over], crs=None, Layer=["ROAD", *["KERB"] * 3])
    found = find_road(drawing, RoadOptions(layer="ROAD")).line
    assert found is not None
    assert sorted(shapely.LineString(edge).length for edge in found.raw.edges) == pytest.approx(sorted(kerb.length for kerb in kerbs))


@pytest.mark.parametrize("beginning", [3.0, 4.5])  # at the kerb, where pieces of it meet, or behind it
def test_fences_behind_a_kerb_bound_nothing_and_are_told(tmp_path: Path, beginning: float) -> None:
    """Two of them were joined to a kerb of their own, and a street that fits was a NO by 20 m."""
    kerbs = [shapely.LineString([(x, y) for x in xs]) for y, xs in ((3.0, (-1.0, 40.0)), (3.0, (40.0, 101.0)), (-3.0, (-1.0, 101.0)))]
    fences = [shapely.LineString([(40.0, beginning), (45.0, 12.0)]), shapely.LineString([(60.0, beginning), (60.0, 9.0)])]
    lines = [shapely.LineString([(0.0, 0.0), (100.0, 0.0)]), *kerbs, *fences]
    drawing = write(tmp_path / "a.dxf", lines, crs=None, Layer=["ROAD", *["KERB"] * 5])
    found = find_road(drawing, RoadOptions(layer="ROAD")).line
    assert found is not None
    assert sorted(float(edge[0, 1]) for edge in found.raw.edges) == [-3.0, 3.0]
    assert "2 edges left out where behind others" in found.raw.notes[0]


@pytest.mark.parametrize(
    "drawn",
    [
        pytest.param([(40.0, 3.0), (40.0, 1.0)], id="into the street"),
        pytest.param([(98.0, 4.0), (104.0, 6.0)], id="beyond the line's end"),
        pytest.param([(40.0, 23.0), (41.0, 24.0)], id="far away"),
    ],
)
def test_what_can_be_met_from_the_street_or_beyond_its_end_is_an_edge(tmp_path: Path, drawn: list[tuple[float, float]]) -> None:
    kerbs = [shapely.LineString([(-1.0, y), (101.0, y)]) for y in (3.0, -3.0)]
    lines = [shapely.LineString([(0.0, 0.0), (100.0, 0.0)]), *kerbs, shapely.LineString(drawn)]
    drawing = write(tmp_path / "a.dxf", lines, crs=None, Layer=["ROAD", *["KERB"] * 3])
    found = find_road(drawing, RoadOptions(layer="ROAD")).line
    assert found is not None
    assert len(found.raw.edges) == 3


def test_an_area_that_may_be_swept_needs_an_outline(tmp_path: Path) -> None:
    for name, rows in (("lines", (0, 1, 2, 3, 4)), ("open", (0, 3))):
        lines = outline(*rows)
        write(tmp_path / f"{name}.dxf", [GRID_LINE, *lines], crs=None, Layer=["ROAD", *["ISLAND"] * len(lines)])
    roles = RoadOptions(layer="ROAD", roles=("ISLAND=Sweepable",))
    (island,) = load_road(tmp_path / "lines.dxf", roles).regions
    assert island.kind is Kind.SWEEPABLE
    assert island.polygon.area == pytest.approx(12.08, abs=0.001)
    with pytest.raises(RoadError, match="1 line of 'ISLAND' with open ends: a sweepable area has an outline"):
        load_road(tmp_path / "open.dxf", roles)


def test_points_of_a_drawing_have_no_size_and_are_told(tmp_path: Path) -> None:
    document = new("R2010")
    space = document.modelspace()
    space.add_lwpolyline(METRES.tolist(), dxfattribs={"layer": "ROAD"})
    space.add_point((METRES[0, 0] + 20.0, METRES[0, 1] + 1.0), dxfattribs={"layer": "TREES"})
    space.add_text("a text", dxfattribs={"layer": "TREES"})
    document.saveas(tmp_path / "a.dxf")
    (unread,) = load_road(tmp_path / "a.dxf", RoadOptions(layer="ROAD")).notes
    assert "NOT READ: layer 'TREES' (1 entity)" in unread
    (sizeless,) = load_road(tmp_path / "a.dxf", RoadOptions(layer="ROAD", roles=("TREES=obstacle",))).notes
    assert "NOT READ: 1 point of 'TREES', without a size: draw circles" in sizeless


def test_a_drawing_that_was_cut_off_is_called_so_wherever_that_was(tmp_path: Path) -> None:
    whole = write(tmp_path / "a.dxf", [GRID_LINE], crs=None, Layer=["ROAD"]).read_bytes()
    for share in (0.3, 0.6, 0.98):
        (tmp_path / "part.dxf").write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(RoadError, match=r"part\.dxf is cut off"):
            load_road(tmp_path / "part.dxf")


def test_an_entity_that_gdal_fails_at_is_named(tmp_path: Path) -> None:
    """The hint was to convert the drawing with GDAL, which fails alike; the entity may lie in a layer that nobody asked for."""
    document = new("R2000")
    document.modelspace().add_lwpolyline(METRES.tolist(), dxfattribs={"layer": "ROAD"})
    document.modelspace().add_spline(
        [(0.0, 0.0), (30.0, 1.0), (60.0, 0.0), (90.0, 1.0)], dxfattribs={"layer": "TREES"}
    )  # no control points
    document.modelspace().add_line((0.0, 5.0), (90.0, 5.0), dxfattribs={"layer": "KERB"})
    document.saveas(tmp_path / "a.dxf")
    with pytest.raises(RoadError, match=r"a\.dxf cannot be read: error at line \d+ of a\.dxf, in a SPLINE in layer 'TREES'\n") as caught:
        load_road(tmp_path / "a.dxf", RoadOptions(layer="ROAD"))
    assert caught.value.hint == "in CAD, explode or delete that one, and save the drawing again"


def test_a_drawing_of_several_lines_lists_its_layers_and_the_options_that_choose_among_them(tmp_path: Path) -> None:
    drawing = write(tmp_path / "a.dxf", [GRID_LINE, GRID_LINE], crs=None, Layer=["ONE", "TWO"])
    with pytest.raises(RoadError, match="2 lines, and none is chosen; they are in layers 'ONE', 'TWO'") as caught:
        load_road(drawing)
    assert "--role LAYER=edge" in (caught.value.hint or "")


def test_a_kerb_is_no_line_to_drive_along_without_a_word(tmp_path: Path) -> None:
    lines = [GRID_LINE, shapely.affinity.translate(GRID_LINE, 0.0, 6.0)]
    drawing = write(tmp_path / "a.dxf", lines, crs=None, Layer=["KERB", "KERB"])
    with pytest.raises(RoadError, match="2 lines, all of them kerbs or obstacles by --role or their names") as caught:
        load_road(drawing)
    assert "draw the line that is driven along" in (caught.value.hint or "")
    alone = write(tmp_path / "c.dxf", lines[:1], crs=None, Layer=["KERB"])
    assert any("is a kerb by its name or layer" in note for note in load_road(alone).notes)
    named = write(tmp_path / "b.dxf", lines, crs=None, Layer=["AXIS", "KERB"])
    assert not any("is a kerb" in note for note in load_road(named).notes)


def test_the_pieces_of_a_drawing_s_layer_are_one_line_whichever_way_they_run(tmp_path: Path) -> None:
    pieces = [shapely.LineString(METRES[rows]) for rows in (slice(0, 3), slice(4, 1, -1), slice(4, None))]
    drawing = write(tmp_path / "a.dxf", pieces, crs=None, Layer=["AXIS"] * 3)
    with pytest.raises(RoadError, match="3 lines, and none is chosen"):
        load_road(drawing)
    path = load_road(drawing, RoadOptions(layer="AXIS")).path
    assert (float(path.at(0.0).x), float(path.at(0.0).y)) == pytest.approx(tuple(METRES[0]), abs=1e-6)
    assert path.length == pytest.approx(load_road(write(tmp_path / "b.dxf", [GRID_LINE], crs=None)).path.length, abs=1e-6)
    apart = write(tmp_path / "c.dxf", [pieces[0], pieces[2]], crs=None, Layer=["AXIS"] * 2)
    with pytest.raises(RoadError, match="2 parts do not join") as caught:
        load_road(apart, RoadOptions(layer="AXIS"))
    assert caught.value.hint == "join them, or choose one with --id"


def test_lines_beside_the_road_are_its_edges_whichever_way_they_are_drawn(tmp_path: Path) -> None:
    centre = shapely.LineString([(0.0, 0.0), (100.0, 0.0)])
    left, right = shapely.LineString([(120.0, 3.0), (50.0, 3.0), (-20.0, 4.0)]), shapely.LineString([(-20.0, -2.5), (120.0, -2.5)])
    by_layer = write(tmp_path / "a.dxf", [centre, left, right], crs=None, Layer=["CL", "LEFT_EDGE", "RIGHT_EDGE"])
    by_role = write(tmp_path / "b.dxf", [centre, left, right], crs=None, Layer=["CL", "W1", "W2"])
    for file, roles in ((by_layer, ()), (by_role, ("W1=edge", "W2=edge"))):
        limits = load_road(file, RoadOptions(roles=roles)).limits
        assert limits is not None
        np.testing.assert_allclose(limits.table(np.array([0.0, 25.0, 75.0]))[0], [3.0 + 50 / 70, 3.0 + 25 / 70, 3.0], atol=1e-6)
        np.testing.assert_allclose(limits.right, -2.5, atol=1e-6)


def test_regions_in_another_system_are_refused(tmp_path: Path) -> None:
    file = write(tmp_path / "a.gpkg", [GRID_LINE], crs="EPSG:3006", layer="road")
    write(file, [HOARDING], layer="obstacles", name=["hoarding"])
    with pytest.raises(RoadError, match="region 'hoarding' has EPSG:4326, the road has EPSG:3006") as caught:
        load_road(file)
    assert "ogr2ogr" in str(caught.value.hint)


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
@pytest.mark.parametrize("name", ["a.gpkg", "a.fgb", "a.kml", "a.gml", "a.dxf", "a.shp"])
def test_a_file_that_was_cut_off_is_refused_in_one_line(tmp_path: Path, name: str, share: float) -> None:
    file = write(tmp_path / name, [LINE], crs=None if name == "a.dxf" else "EPSG:4326", driver="KML" if name == "a.kml" else None)
    content = file.read_bytes()
    file.write_bytes(content[: int(share * len(content))])
    with pytest.raises(RoadError) as caught:
        load_road(file)
    assert "\n" not in str(caught.value)
    assert str(tmp_path) not in str(caught.value)
    assert caught.value.hint is not None


def test_what_no_driver_reads_names_the_command_that_converts_it(tmp_path: Path) -> None:
    (tmp_path / "a.dwg").write_bytes(b"AC1032" + bytes(200))
    with pytest.raises(RoadError, match=r"a\.dwg is not a vector file that can be read") as caught:
        load_road(tmp_path / "a.dwg")
    assert "ogr2ogr road.gpkg a.dwg" in str(caught.value.hint)


def test_a_file_that_points_to_other_data_is_not_followed(tmp_path: Path) -> None:
    source = write(tmp_path / "a.gpkg", [LINE])
    text = f"<OGRVRTDataSource><OGRVRTLayer name='a'><SrcDataSource>{source}</SrcDataSource></OGRVRTLayer></OGRVRTDataSource>"
    (tmp_path / "a.vrt").write_text(text, encoding="utf-8")
    with pytest.raises(RoadError, match="names other data"):
        load_road(tmp_path / "a.vrt")


@pytest.mark.parametrize("name", ["old!road.gpkg", "road.gpkg;1.gpkg", "ro\tad.gpkg", "\udcff.gpkg"])
def test_a_name_that_would_lead_to_another_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """Pyogrio takes paths for addresses: of the first three it would read the file beside it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_bytes(write(tmp_path / "road.gpkg", [LINE]).read_bytes())
    with pytest.raises(RoadError, match="its path has the sign"):
        load_road(name)


def test_a_name_that_begins_as_an_address_is_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "http:road.gpkg").write_bytes(write(tmp_path / "road.gpkg", [LINE]).read_bytes())
    assert load_road("http:road.gpkg").path.length == pytest.approx(load_road("road.gpkg").path.length)


def test_without_gdal_the_refusal_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = write(tmp_path / "a.gpkg", [LINE])

    def missing(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr("hdvplan.road.load_vector.import_module", missing)
    with pytest.raises(RoadError, match="needs GDAL") as caught:
        load_road(file)
    assert "pip install pyogrio" in str(caught.value.hint)


@pytest.mark.parametrize("only", ["", " WHERE n < 0"])
def test_a_view_without_end_is_refused_and_other_views_are_not(tmp_path: Path, only: str) -> None:
    path = write(tmp_path / "road.gpkg", [LINE])
    with closing(sqlite3.connect(path)) as base:
        base.execute("CREATE VIEW named AS SELECT * FROM road")
        base.commit()
        assert load_road(path).path.length > 50.0
        base.execute(f"CREATE VIEW a AS WITH RECURSIVE c(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM c) SELECT n FROM c{only}")  # noqa: S608 - fixed
        base.commit()
    with pytest.raises(RoadError, match=r"road\.gpkg: view 'a' has no end"):
        load_road(path)


def test_a_database_whose_own_words_are_damaged_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "road.gpkg", [LINE])
    damaged = path.read_bytes().replace(b'CREATE TABLE "road"', b'CREATE TABL\xd6 "road"')  # SQLite quotes it when it complains
    assert damaged != path.read_bytes()
    path.write_bytes(damaged)
    with pytest.raises(RoadError, match=r"road\.gpkg is damaged or cut off"):
        load_road(path)


def test_measures_beside_the_coordinates_are_dropped_without_a_warning(tmp_path: Path) -> None:
    path = write(tmp_path / "road.gpkg", [GRID_LINE], crs="EPSG:3006")
    with closing(sqlite3.connect(path)) as base:
        base.execute("UPDATE gpkg_geometry_columns SET m = 1")
        base.commit()
    assert load_road(path).path.length == pytest.approx(load_road(reference(tmp_path)).path.length, rel=1e-4)  # of two projections


@pytest.mark.parametrize(
    "error",
    [type("CPLE_AppDefinedError", (Exception,), {"__module__": "pyogrio._err"})("is malformed"), ValueError("year 0 is out of range")],
)
def test_whatever_gdal_says_of_damage_is_a_refusal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    path = write(tmp_path / "road.gpkg", [LINE])
    monkeypatch.setattr(pyogrio.raw, "read", fail)
    with pytest.raises(RoadError, match=r"^road\.gpkg (is damaged or cut off|cannot be read: year 0 is out of range)\n"):
        load_road(path)


def track(path: Path, *segments: FloatArray, timed: bool = False) -> RawRoad:
    """Return the road of a track; its points are a second apart where it is ``timed``."""
    parts, second = list[str](), 0
    for segment in segments:
        part = ""
        for lon, lat in segment:
            time = f"<time>2026-05-04T09:{second // 60:02d}:{second % 60:02d}Z</time>" if timed else ""
            part, second = f'{part}<trkpt lat="{lat:.9f}" lon="{lon:.9f}">{time}</trkpt>', second + 1
        parts.append(part)
    path.write_text(GPX.format("</trkseg><trkseg>".join(parts)), encoding="utf-8")
    return read_vector(path, RoadOptions())


def test_a_track_is_read_without_its_stops_and_its_segments_of_one_point(tmp_path: Path) -> None:
    path = tmp_path / "t.gpx"
    moving = np.column_stack([11.97 + np.arange(30) * 1e-4, np.full(30, 57.7)])  # steps of 6 m
    whole = track(path, moving)
    assert whole.notes == ()
    np.testing.assert_allclose(track(path, moving[:1], moving).points, whole.points, atol=1e-6)
    scatter = np.random.default_rng(1).normal(0.0, 8e-6, (40, 2)) * [1.0, 0.5]  # 0.5 m
    stopped = track(path, np.concatenate([moving[:12], moving[12] + scatter, moving[13:]]))
    assert re.fullmatch(r"t.gpx: 39 points where the recorder stood left out; they scatter by up to 1\.\d m", stopped.notes[0])
    np.testing.assert_allclose(stopped.points, whole.points, atol=0.3)  # the mean of 40 points of 0.5 m, both ways
    np.testing.assert_allclose(track(path, moving, moving[-2::-1]).points[:30], whole.points, atol=1e-6)  # out and back is no stop


def test_a_track_without_points_is_no_line_and_changes_no_other_one(tmp_path: Path) -> None:
    path = tmp_path / "t.gpx"
    points = "".join(f'<trkpt lat="57.7" lon="{11.97 + 1e-4 * step:.4f}"/>' for step in range(9))
    empty, whole = "<trk><name>B</name></trk>", TRACK.format(points)
    path.write_text(GPX.format("").replace(TRACK.format(""), empty + whole), encoding="utf-8")
    assert len(read_vector(path, RoadOptions()).points) == 9
    path.write_text(GPX.format("").replace(TRACK.format(""), empty), encoding="utf-8")
    with pytest.raises(RoadError, match=r"t\.gpx has no lines"):
        read_vector(path, RoadOptions())


def test_a_recorded_track_is_smoothed_over_its_times_and_its_scatter_is_told(tmp_path: Path) -> None:
    path, second = tmp_path / "t.gpx", np.arange(100.0)
    along = 5.0 * np.cumsum(np.clip(np.abs(second - 50.0) / 5.0 - 1.0, 0.0, 1.0))  # 5 m/s, and a stop of ten seconds
    metres = np.column_stack([60.0 * np.sin(along / 60.0), 60.0 - 60.0 * np.cos(along / 60.0)])
    degrees = np.array([1.0 / 59.7e3, 1.0 / 111.4e3])
    exact = track(path, [11.97, 57.7] + metres * degrees, timed=True)
    assert exact.notes == ()
    steps = np.hypot(*np.diff(exact.points, axis=0).T)
    assert np.min(steps[:-1]) > 1.9
    line = shapely.LineString(metres[np.append(True, np.diff(along) > 0.0)])
    for seed in range(4):
        scatter = np.random.default_rng(seed).normal(0.0, 0.5, (100, 2))
        raw = track(path, [11.97, 57.7] + (metres + scatter) * degrees, timed=True)
        assert re.match(r"t.gpx: the track is smoothed over its times; its points scatter by 0\.[4-8]\d m \(rms\)", raw.notes[0])
        assert raw.to_lonlat is not None
        off = shapely.distance(line, shapely.points((np.column_stack(raw.to_lonlat(*raw.points.T)) - [11.97, 57.7]) / degrees))
        assert float(np.sqrt(np.mean(off**2))) < 0.35  # 0.5 m across the line as recorded
        assert np.max(np.abs(np.diff(np.unwrap(np.arctan2(*np.diff(raw.points, axis=0).T[::-1]))))) < 0.7  # nor zigzag
    pause = track(
        path, degrees * metres[:30] + [11.97, 57.7], degrees * metres[33:] + [11.97, 57.7], timed=True
    )  # 20 m of arc, steps of 5 m
    assert pause.notes[0] == "t.gpx: the line's 2 parts are taken as one, over gaps of up to 19.9 m"
    backwards = track(path, np.array([[11.97, 57.7], [11.98, 57.7], [11.99, 57.7]]))
    times = np.array([0.0, 5.0, 3.0])
    assert smoothed_in_time(backwards.points, times, "f") == (backwards.points, ())


@pytest.mark.parametrize("radius", [30.0, 10.0])  # behind the kerb, or further than what is looked at there
def test_a_wall_through_a_kerb_is_a_wall_as_far_as_the_kerb(tmp_path: Path, radius: float) -> None:
    """What of it lies behind the kerb made a NO by 20 m of a closed street that fits."""
    line, left, right = (shapely.Point(0.0, 0.0).buffer(r, quad_segs=45).exterior for r in (40.0, 44.0, 36.0))
    wall = shapely.LineString([(0.0, 37.0), (0.0, 32.0), (radius, 0.0), (radius, 5.0)])
    drawing = write(tmp_path / "a.dxf", [line, left, right, wall], crs=None, Layer=["ROAD", *["KERB"] * 3])
    found = find_road(drawing, RoadOptions(layer="ROAD")).line
    assert found is not None
    (stub,) = found.raw.regions  # the road is on both sides of it
    np.testing.assert_allclose(stub.polygon.bounds, [0.0, 36.0, 0.0, 37.0], atol=0.01)  # its thickness
    assert "1 edge left out where behind others" in found.raw.notes[0]
