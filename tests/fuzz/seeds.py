"""Small valid files of every kind that hdvplan reads: what a fuzzer begins with. Each is planned, or read, as it stands."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import numpy as np
import pyogrio
import shapely

_LON, _LAT = 11.95, 57.7
_DEGREES = np.array([1.0 / 59500.0, 1.0 / 111300.0])  # a metre east and north, there
POINTS = np.stack([np.linspace(0.0, 80.0, 17), 4.0 * np.sin(np.linspace(0.0, 1.5, 17))], axis=1)  # [m]

VEHICLE = """name = "artic"
[[unit]]
wheelbase = 3.6
front_overhang = 1.4
rear_overhang = 0.9
width = 2.55
hitch_offset = -0.6
max_curvature = 0.15
max_curvature_rate = 0.1
[[unit]]
wheelbase = 8.1
front_overhang = 1.5
rear_overhang = 4.0
width = 2.55
"""
SUITE = """roads = ["uturn"]
vehicles = ["bus"]
schemes = ["rti"]
solvers = ["riccati"]
rounds = 1
budget = 1.0
half_width = 3.2
"""
BIAS = "s,bias\n0,0\n40,0.3\n80,-0.2\n"


def road_texts() -> dict[str, str]:
    """Return the text files by their name."""
    rows = [f"{x:.3f},{y:.3f}" for x, y in POINTS]
    degrees = [[_LON + x, _LAT + y] for x, y in POINTS * _DEGREES]
    track = "".join(f'<trkpt lat="{lat:.7f}" lon="{lon:.7f}"/>' for lon, lat in degrees)
    where = " ".join(f"{lon:.7f},{lat:.7f}" for lon, lat in degrees)
    nodes = [{"type": "node", "id": i, "lon": lon, "lat": lat} for i, (lon, lat) in enumerate(degrees, start=1)]
    way = {"type": "way", "id": 99, "nodes": list(range(1, len(nodes) + 1)), "tags": {"highway": "service", "name": "A"}}
    return {
        "plain.csv": "x,y\n" + "\n".join(rows) + "\n",
        "tum.csv": "# x_m,y_m,w_tr_right_m,w_tr_left_m\n" + "\n".join(f"{row},3.5,3.5" for row in rows) + "\n",
        "excel.csv": "sep=;\nEast;North;Bredd\n" + "\n".join(row.replace(",", ";").replace(".", ",") + ";7,5" for row in rows) + "\n",
        "degrees.csv": "lat,lon\n" + "\n".join(f"{lat:.7f},{lon:.7f}" for lon, lat in degrees) + "\n",
        "profile.csv": "s,kappa,left,right\n0,0,3.5,3.5\n30,0,3.5,3.5\n45,0.03,4,4\n60,0.03,4,4\n80,0,3.5,3.5\n",
        "sweeps.csv": "x,y,left,right,left_sweep,right_sweep\n" + "\n".join(f"{row},3,3,4,4" for row in rows) + "\n",
        "legs.csv": "x,y,direction\n" + "".join(f"{row},1\n" for row in rows) + "".join(f"{row},-1\n" for row in rows[-2::-1]),
        "legs.geojson": json.dumps(_legs(degrees)),
        "line.geojson": json.dumps(_collection(degrees, [])),
        "obstacles.geojson": json.dumps(_collection(degrees, [_box(30.0, 0.5), _box(55.0, 8.0), _box(50.0, -4.0, "sweepable")])),
        "grid.geojson": json.dumps(
            {"type": "FeatureCollection", "crs": {"type": "name", "properties": {"name": "EPSG:3006"}}, "features": [_grid_line()]}
        ),
        "overpass.json": json.dumps({"version": 0.6, "elements": [*nodes, way]}),
        "track.gpx": '<gpx version="1.1" creator="g" xmlns="http://www.topografix.com/GPX/1/1"><trk><name>A</name><trkseg>'
        f"{track}</trkseg></trk></gpx>",
        "place.kml": '<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark><name>A</name><LineString><coordinates>'
        f"{where}</coordinates></LineString></Placemark></Document></kml>",
        "lane.xodr": (Path(__file__).parents[1] / "road" / "files" / "bendplatz.xodr").read_text(encoding="utf-8"),
    }


def road_options(name: str) -> tuple[str, ...]:
    """Return the options that a road file needs beside its name."""
    return ("--road-ids", "2", "--lane", "0") if name.endswith(".xodr") else ()


def write_binary(folder: Path) -> list[Path]:
    """Write the files that only GDAL makes into a folder, and return them."""
    line = shapely.LineString(POINTS + np.array([319000.0, 6400000.0]))
    files = []
    for name in ("line.gpkg", "line.shp", "line.fgb", "line.dxf"):
        path = folder / name
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a DXF file has no coordinate system
            fields = {} if name.endswith("dxf") else {"field_data": [np.array(["A"], dtype=object)], "fields": ["name"]}
            pyogrio.raw.write(
                path, geometry=shapely.to_wkb(np.array([line], dtype=object)), geometry_type="LineString", crs="EPSG:3006",
                **({"field_data": [], "fields": []} | fields),
            )  # fmt: skip
        files.append(path)
    return files


def _collection(degrees: list[list[float]], others: list[dict[str, object]]) -> dict[str, object]:
    line = {
        "type": "Feature",
        "properties": {"name": "A", "left_m": 4.0, "right_m": 4.0},
        "geometry": {"type": "LineString", "coordinates": degrees},
    }
    return {"type": "FeatureCollection", "features": [line, *others]}


def _legs(degrees: list[list[float]]) -> dict[str, object]:
    kerb = (POINTS[[0, -1]] + [[-40.0, 6.0], [40.0, 6.0]]) * _DEGREES + [_LON, _LAT]
    lines = [
        ({"leg": 1, "direction": "forward"}, degrees),
        ({"leg": 2, "direction": "backward"}, degrees[::-1]),
        ({"edge": "left"}, kerb.tolist()),
    ]
    features = [{"type": "Feature", "properties": said, "geometry": {"type": "LineString", "coordinates": line}} for said, line in lines]
    return {"type": "FeatureCollection", "features": [*features, _box(50.0, -9.0)]}


def _box(x: float, y: float, region: str = "obstacle") -> dict[str, object]:
    corners = np.array([[x, y], [x + 3.0, y], [x + 3.0, y + 1.0], [x, y + 1.0], [x, y]]) * _DEGREES + np.array([_LON, _LAT])
    return {"type": "Feature", "properties": {"region": region}, "geometry": {"type": "Polygon", "coordinates": [corners.tolist()]}}


def _grid_line() -> dict[str, object]:
    points = POINTS + np.array([319000.0, 6400000.0])
    return {"type": "Feature", "properties": {"width_m": 7.5}, "geometry": {"type": "LineString", "coordinates": points.tolist()}}
