"""Drawings for CAD and maps, read back by the libraries that others read them with."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pyogrio
import pytest
import shapely
from ezdxf.document import Drawing
from ezdxf.entities.lwpolyline import LWPolyline
from ezdxf.entities.mtext import MText
from ezdxf.filemanagement import read
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from pyproj import Geod, Transformer

from hdvplan.answers import NO
from hdvplan.arrays import FloatArray
from hdvplan.judging.bodies import wheel_tracks
from hdvplan.judging.result import Result
from hdvplan.report.drawing import vehicle_figure
from hdvplan.report.files import drawn_bytes
from hdvplan.report.layers import drawing_system, drawn_features, map_system
from hdvplan.road.crs import to_plane
from hdvplan.road.load import load_road
from hdvplan.road.options import RoadOptions
from hdvplan.road.regions import Kind, Region
from hdvplan.vehicle.load import load_vehicle, preset_names
from tests.report.conftest import once

HAMNGATAN = np.array([[11.95, 57.7], [11.951, 57.7]])  # lon, lat: there the plane of the tests' roads lies


@pytest.fixture(scope="module")
def surveyed(kerbed: Result) -> Result:
    """The bus in the U-turn, as if the road had come in SWEREF 99 TM."""
    return replace(kerbed, drive=replace(kerbed.drive, road=replace(kerbed.drive.road, to_lonlat=to_plane(EAST, "EPSG:3006").to_lonlat)))


EAST = np.array([[319000.0, 6399000.0], [319100.0, 6399000.0]])


@pytest.fixture(scope="module")
def mapped(kerbed: Result) -> Result:
    """The same, as if the road had come in degrees, with an obstacle and a kerb beside it."""
    regions = (
        Region(Kind.OBSTACLE, shapely.box(10.0, 4.0, 14.0, 6.0), "van"),
        Region(Kind.SWEEPABLE, shapely.Polygon([(20, -6), (30, -6), (30, -3), (20, -3)], [[(22, -5), (28, -5), (28, -4), (22, -4)]])),
    )
    road = replace(kerbed.drive.road, to_lonlat=to_plane(HAMNGATAN).to_lonlat, regions=regions)
    return replace(kerbed, drive=replace(kerbed.drive, road=road))


@once
def opened(result: Result) -> Drawing:
    return read(StringIO(drawn_bytes(result, "dxf").decode()))


def polylines(drawing: Drawing, layer: str) -> list[FloatArray]:
    """Return the corners of a layer's polylines, x, y."""
    found = [entity for entity in drawing.modelspace() if isinstance(entity, LWPolyline) and entity.dxf.layer == layer]
    return [np.array(line.get_points("xy")) for line in found]


def notes(drawing: Drawing) -> str:
    (text,) = [entity for entity in drawing.modelspace() if isinstance(entity, MText)]
    return text.text


@pytest.mark.slow
def test_a_drawing_has_the_layers_that_a_draughtsman_switches(mapped: Result) -> None:
    drawing = opened(mapped)
    named = {layer.dxf.name for layer in drawing.layers}
    assert named - {"0", "Defpoints"} == {
        "ROAD", "OBSTACLES", "SWEEPABLE", "LIMITS", "ENVELOPE_1_BUS", "WHEEL_TRACKS", "VEHICLE_OUTLINES_1_BUS", "CLEARANCE", "CONFLICTS",
        "NOTES",
    }  # fmt: skip
    assert drawing.header["$INSUNITS"] == 6  # metres
    assert drawing.layers.get("ROAD").dxf.linetype == "CENTER"
    assert drawing.layers.get("CONFLICTS").dxf.color == 1  # red
    assert not drawing.audit().errors
    assert notes(drawing).startswith(NO)
    assert "EPSG:32632" in notes(drawing)  # the UTM zone of Göteborg


def test_a_drawing_is_where_the_road_file_was(surveyed: Result) -> None:
    """Coordinates in a projected system are written as they came."""
    path = surveyed.drive.road.path
    (centre,) = polylines(opened(surveyed), "ROAD")
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(centre, axis=0).T)))
    s, offset = path.project(centre[:, 0], centre[:, 1], along)
    assert np.max(np.abs(offset)) < 1e-6
    line = shapely.LineString(centre)
    dense = np.column_stack(path.to_plane(np.linspace(0.0, path.length, 2000), 0.0))
    assert np.max(shapely.distance(shapely.points(dense), line)) < 1e-3  # the file's promise
    assert s[0] == pytest.approx(0.0, abs=1e-6)


def test_a_road_in_degrees_is_drawn_in_its_utm_zone(mapped: Result) -> None:
    path, to_lonlat = mapped.drive.road.path, mapped.drive.road.to_lonlat
    assert to_lonlat is not None
    (van,) = polylines(opened(mapped), "OBSTACLES")
    lonlat = to_lonlat(*(np.array(part) for part in shapely.box(10.0, 4.0, 14.0, 6.0).exterior.coords.xy))
    x, y = Transformer.from_crs("EPSG:4326", "EPSG:32632", always_xy=True).transform(*lonlat)
    assert {(round(a, 3), round(b, 3)) for a, b in zip(x, y, strict=True)} == {(round(a, 3), round(b, 3)) for a, b in van}
    (centre,) = polylines(opened(mapped), "ROAD")
    # The zone's lengths are 0.9996 to 1.001 times the true ones.
    assert np.sum(np.hypot(*np.diff(centre, axis=0).T)) == pytest.approx(path.length, rel=1e-3)


def test_areas_and_tracks_in_a_drawing_are_those_of_the_plan(surveyed: Result) -> None:
    drawing = opened(surveyed)
    (envelope,) = polylines(drawing, "ENVELOPE_1_BUS")
    s, left, right = surveyed.envelope.s, surveyed.envelope.reach_left, surveyed.envelope.reach_right
    k = surveyed.drive.road.path.at(s).curvature
    strip = (left - right) - 0.5 * k * (left**2 - right**2)  # of a curved strip, a metre of it
    planned = float(np.sum(0.5 * (strip[1:] + strip[:-1]) * np.diff(s)))
    assert shapely.Polygon(envelope).area == pytest.approx(planned, rel=1e-3)
    drawn = polylines(drawing, "WHEEL_TRACKS")
    for track, line in zip(wheel_tracks(surveyed.drive), drawn, strict=True):
        assert np.max(shapely.distance(shapely.points(track.points), shapely.LineString(line))) < 1e-3  # the file's promise
    assert len(polylines(drawing, "CONFLICTS")) >= len(surveyed.balance.breaches) > 0  # an area may have several parts


def test_what_is_drawn_can_be_planned_along_again(surveyed: Result, tmp_path: Path) -> None:
    (tmp_path / "plan.dxf").write_bytes(drawn_bytes(surveyed, "dxf"))
    road = load_road(tmp_path / "plan.dxf", RoadOptions(layer="ROAD", crs="EPSG:3006"))
    assert road.path.length == pytest.approx(surveyed.drive.road.path.length, abs=0.1)  # smoothed again


@pytest.mark.slow
def test_a_geopackage_has_a_layer_for_every_kind_in_the_road_s_coordinates(mapped: Result, surveyed: Result, tmp_path: Path) -> None:
    for result, code in ((mapped, "EPSG:4326"), (surveyed, "EPSG:3006")):
        file = tmp_path / "plan.gpkg"
        file.write_bytes(drawn_bytes(result, "gpkg"))
        layers = dict(pyogrio.list_layers(file))
        assert set(layers) == {str(feature.layer) for feature in drawn_features(result)}
        assert layers["road"] == layers["wheel_tracks"] == "LineString"
        assert layers["envelope"] == "MultiPolygon"
        assert {pyogrio.read_info(file, layer=layer)["crs"] for layer in layers} == {code}


def test_a_geopackage_reopened_has_the_planned_places_and_areas(mapped: Result, tmp_path: Path) -> None:
    file = tmp_path / "plan.gpkg"
    file.write_bytes(drawn_bytes(mapped, "gpkg"))
    to_lonlat, path = mapped.drive.road.to_lonlat, mapped.drive.road.path
    assert to_lonlat is not None
    geod = Geod(ellps="WGS84")
    (centre,) = shapely.from_wkb(pyogrio.raw.read(file, layer="road")[2])
    first, last = (to_lonlat(*path.to_plane(s, 0.0)) for s in (0.0, path.length))
    for (lon, lat), (lon_planned, lat_planned) in ((centre.coords[0], first), (centre.coords[-1], last)):
        assert geod.inv(lon, lat, float(lon_planned), float(lat_planned))[2] < 1e-3
    meta, _, areas, fields = pyogrio.raw.read(file, layer="envelope")
    values = dict(zip(meta["fields"], fields, strict=True))
    area, _ = geod.geometry_area_perimeter(shapely.normalize(shapely.from_wkb(areas[0])))
    assert abs(area) == pytest.approx(values["area_m2"][0], rel=1e-3)
    assert values["max_left_m"][0] == mapped.balance.max_left
    kerb = shapely.from_wkb(pyogrio.raw.read(file, layer="sweepable")[2][0])
    assert len(kerb.geoms[0].interiors) == 1
    meta, _, _, fields = pyogrio.raw.read(file, layer="conflicts")
    depths = dict(zip(meta["fields"], fields, strict=True))["depth_m"]
    assert max(depths) == mapped.balance.violation


def test_a_road_of_no_place_is_written_in_its_own_metres(kerbed: Result, tmp_path: Path) -> None:
    file = tmp_path / "plan.gpkg"
    file.write_bytes(drawn_bytes(kerbed, "gpkg"))
    assert "metres of the road file" in pyogrio.read_info(file, layer="road")["crs"]
    assert "names no coordinate system" in notes(opened(kerbed))


def test_clearances_are_drawn_from_the_body_to_the_limit(bus: Result) -> None:
    rooms = [feature for feature in drawn_features(bus) if feature.layer == "clearance"]
    assert rooms
    for room in rooms:
        assert room.geometry.length == pytest.approx(room.properties["clearance_m"], abs=1e-6)
    assert min(float(room.properties["clearance_m"] or 0.0) for room in rooms) == bus.balance.min_clearance


def test_a_road_across_the_antimeridian_does_not_go_round_the_world(kerbed: Result) -> None:
    fiji = np.array([[179.9999, -16.5], [180.0001, -16.5]])
    road = replace(kerbed.drive.road, to_lonlat=to_plane(fiji).to_lonlat)
    placed = map_system(road).place(shapely.LineString(np.column_stack(road.path.to_plane(np.linspace(0.0, 50.0, 11), 0.0))))
    assert np.max(np.abs(np.diff(shapely.get_coordinates(placed)[:, 0]))) < 1e-4  # 5 m; a degree is 107 km there
    assert drawing_system(road).name == "EPSG:32701"


def written(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.axes[0].texts if text.get_text()]


@pytest.mark.parametrize("name", preset_names())
def test_every_dimension_of_a_vehicle_stands_in_its_drawing(name: str) -> None:
    vehicle = load_vehicle(name)
    texts = written(vehicle_figure(vehicle))
    assert f"{vehicle.reach_ahead + vehicle.reach_behind:.2f} m" in texts
    for unit in vehicle.units:
        for length in (unit.wheelbase, unit.rear_overhang, unit.front_overhang):
            assert length == 0.0 or f"{length:.2f}" in texts
        assert unit.hitch_offset == 0.0 or f"hitch {unit.hitch_offset:.2f}" in texts


def test_bodies_are_drawn_to_scale_one_behind_the_other() -> None:
    vehicle = load_vehicle("truck-dolly-semitrailer")
    figure = vehicle_figure(vehicle)
    axes = figure.axes[0]
    assert axes.get_aspect() == 1.0
    bodies = [patch for patch in axes.patches if isinstance(patch, Rectangle) and patch.get_height() > 2.0]
    ends = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in bodies]
    assert ends[0] == pytest.approx((-3.40, 6.70))
    assert ends[2][0] == pytest.approx(-vehicle.reach_behind)
    assert ends[2][1] - ends[2][0] == pytest.approx(13.59)
    low, high = sorted(axes.get_xlim())
    assert low < -vehicle.reach_behind
    assert high > vehicle.reach_ahead


def test_what_steers_is_said_in_words() -> None:
    figure = vehicle_figure(load_vehicle("semitrailer-steered"))
    legend = " ".join(text.get_text() for text in figure.texts)
    assert "steered by 0.50 of the articulation angle, to 20°" in legend
    assert "Directive 96/53/EC" in legend
    active = " ".join(text.get_text() for text in vehicle_figure(load_vehicle("semitrailer-active")).texts)
    assert "axle steered by the plan, aiming at 0.60 of the articulation angle, to 20°" in active
