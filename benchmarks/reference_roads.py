"""What the behaviour reference holds of roads, read and smoothed from files, and of prescribed turns."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from reference_scenes import Quantities, Told, error_of

from hdvplan.errors import HdvplanError
from hdvplan.road.load import load_road
from hdvplan.road.options import RoadOptions
from hdvplan.road.road import Road
from hdvplan.turning.manoeuvre import GuidePoint, Manoeuvre
from hdvplan.turning.turn import load_template, turn
from hdvplan.vehicle.load import load_vehicle

_ROOT = Path(__file__).parents[1]
_SHARES = (0.2, 0.4, 0.6, 0.8)  # of the road, where the line is compared
_SPACING_M = 0.1  # of the stations over which limits are averaged: limits hold some decimetres further where they jump


def loaded(told: Told) -> Quantities:
    """Return the line and the limits of a road.

    ``file`` is a path from the repository's root, or a shipped road's name; else ``points`` make a GeoJSON file in metres, with
    ``properties`` of the line, and ``edges``, ``obstacles`` and ``kerbs`` beside it, each a list of points.
    """
    options = RoadOptions(**told.get("options", {}))
    try:
        if "file" in told:
            shipped = _ROOT / told["file"]
            return _of_road(load_road(shipped if shipped.is_file() else told["file"], options))
        with TemporaryDirectory() as folder:
            file = Path(folder) / "reference.geojson"
            file.write_text(json.dumps(_collection(told)), encoding="utf-8")
            return _of_road(load_road(file, options))
    except HdvplanError as error:
        return error_of(error)


def _collection(told: Told) -> dict[str, object]:
    features = [_feature("LineString", told["points"], {"name": "line"} | told.get("properties", {}))]
    features += [_feature("LineString", points, {"name": "kerb"}) for points in told.get("edges", ())]
    for regions, region in (("obstacles", "obstacle"), ("kerbs", "sweepable")):
        features += [_feature("Polygon", [points], {"region": region}) for points in told.get(regions, ())]
    return {
        "type": "FeatureCollection",
        "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32633"}},
        "features": features,
    }


def _feature(kind: str, coordinates: object, properties: dict[str, object]) -> dict[str, object]:
    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": coordinates}}


def _of_road(road: Road) -> Quantities:
    path, smoothing = road.path, road.smoothing
    found: Quantities = {"length": path.length, "closed": str(path.closed), "notes": len(road.notes), "regions": len(road.regions)}
    if smoothing is not None:
        found |= {"moved most": smoothing.max_deviation, "moved at": smoothing.max_deviation_s, "moved rms": smoothing.rms_deviation}
        found |= {"duplicates": smoothing.duplicates}
    s = np.linspace(0.0, path.length, int(path.length / _SPACING_M) + 1)
    curvature = path.at(s).curvature
    found |= {"curvature least": float(np.min(curvature)), "curvature most": float(np.max(curvature))}
    found["bending"] = float(np.mean(np.gradient(curvature, s) ** 2)) * 1e6
    for share in _SHARES:
        here = path.at(share * path.length)
        found |= {f"x at {share:g}": float(here.x), f"y at {share:g}": float(here.y), f"curvature at {share:g}": float(here.curvature)}
    for name, limits in (("limits", road.passable), ("edges", road.beside)):
        if limits is not None:
            for column, row in zip(("left", "right", "left_sweep", "right_sweep"), limits.table(s), strict=True):
                sign = 1.0 if column.startswith("left") else -1.0
                found |= {f"{name} {column} least": float(np.min(sign * row)), f"{name} {column} mean": float(np.mean(sign * row))}
    for number, passage in enumerate(road.passages, start=1):
        found |= {f"s_from {number}": passage.s_from, f"s_to {number}": passage.s_to, f"usual {number}": str(passage.usual)}
        found |= {f"offset low {number}": passage.low, f"offset high {number}": passage.high}
    return found


def turned(told: Told) -> Quantities:
    """Return the figures of a standard's ``template``, or of a turn of ``radius`` and ``angle`` in degrees; without one a full circle."""
    vehicle = load_vehicle(told["vehicle"])
    try:
        if "template" in told:
            found = turn(vehicle, load_template(told["template"]))
        else:
            angle = None if told.get("angle") is None else float(np.deg2rad(told["angle"]))
            point = GuidePoint(told.get("point", "front-axle"))
            found = turn(vehicle, Manoeuvre(told["radius"], angle, point, told.get("ramp", 0.0), standstill=told.get("standstill", False)))
    except HdvplanError as error:
        return error_of(error)
    figures = found.figures
    radii = {f"{name} {way}": getattr(one, way) for name, one in (("wheels", figures.wheels), ("bodies", figures.bodies)) for way in _WAYS}
    rows: Quantities = {**radii, "swept_width": figures.swept_width, "steering": figures.steering, "complies": str(found.complies)}
    for name, values in (
        ("off_tracking", figures.off_tracking),
        ("tail_swing", figures.tail_swing),
        ("articulation", figures.articulation),
    ):
        rows |= {f"{name} {number}": value for number, value in enumerate(values, start=1)}
    if figures.frontal_swing is not None:
        rows["frontal_swing"] = figures.frontal_swing
    return rows


_WAYS = ("inside", "outside")
