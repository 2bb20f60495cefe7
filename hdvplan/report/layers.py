"""What a drawing of a plan holds, layer by layer, in the road's plane, and the coordinate systems that it is written in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import chain

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray
from hdvplan.judging.bodies import TRACK_NOTE, corners, pose_at, wheel_tracks
from hdvplan.judging.result import Result, body_name
from hdvplan.judging.sentences import breach_text, entered_text
from hdvplan.report.geojson import swept_area
from hdvplan.report.kerbs import beyond_kerb, shown_kerbs, simple_line
from hdvplan.report.rooms import approach_of, peaks, room_at, shared_with, tightness
from hdvplan.road.crs import IntoPlane, ToLonLat, is_local
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.vehicle.model import Vehicle

APART = 1.25  # vehicle lengths from outline to outline: they do not touch
LONLAT_CODE = "EPSG:4326"
_UTM_LATITUDES = (-80.0, 84.0)  # [deg]
_SPACING_M = 0.2  # of lines along the road: on a radius of 8 m, chords are off by 0.6 mm
_CLEARANCES = 12  # tightest places that are dimensioned
_CLEARANCES_APART_M = 20.0

Value = str | float | int | None


class Layer(StrEnum):
    """The layers, from the ground up."""

    ROAD = "road"
    OBSTACLES = "obstacles"
    SWEEPABLE = "sweepable"
    KERBS = "kerbs"  # as drawn, of legs
    ENVELOPE = "envelope"
    LIMITS = "limits"
    TRACKS = "wheel_tracks"
    VEHICLES = "vehicle_outlines"
    CLEARANCE = "clearance"
    CONFLICTS = "conflicts"
    GUIDED_PATH = "guided_path"  # of a prescribed turn
    WIDENING = "widening"  # of a need: those of least area, and of least depth
    WIDENING_LEAST_DEPTH = "widening_least_depth"


@dataclass(frozen=True)
class Drawn:
    """A line, or an area, on its layer; every feature of a layer has the same properties."""

    layer: Layer
    geometry: BaseGeometry
    properties: dict[str, Value]
    label: str = ""  # what is written beside it


def drawn_features(result: Result) -> tuple[Drawn, ...]:
    """Return all features of a plan's drawing, in the order of their layers, x, y [m]."""
    ground = (_road(result), region_features(result.drive.road.regions), _envelopes(result), kerb_features(result))
    return tuple(chain(*ground, _tracks(result), _vehicles(result), _clearances(result), conflict_features(result)))


def outline_places(result: Result, s_from: float, s_to: float) -> list[float]:
    """Return arclengths of the lead rear axle [m] at which the vehicle's outlines stand behind each other without touching."""
    vehicle = result.drive.vehicle
    apart = APART * (vehicle.reach_ahead + vehicle.reach_behind)
    count = max(1, int((s_to - s_from) / apart))
    first = 0.5 * (s_from + s_to) - 0.5 * (count - 1) * apart
    return [first + number * apart for number in range(count)]


def of_body(vehicle: Vehicle, unit: int) -> dict[str, Value]:
    """Return which body of a vehicle a feature is of."""
    return {"body": unit + 1, "unit": body_name(vehicle, unit)}


def _road(result: Result) -> Iterator[Drawn]:
    road, length = result.drive.road, result.drive.road.path.length
    centre = np.column_stack(road.path.to_plane(np.linspace(0.0, length, max(2, int(np.ceil(length / _SPACING_M)) + 1)), 0.0))
    named: dict[str, Value] = {"road": road.name, "vehicle": result.drive.vehicle.name, "status": result.status}
    yield Drawn(Layer.ROAD, simple_line(centre), named | {"length_m": length, "attribution": road.notice})


def region_features(regions: Sequence[Region]) -> Iterator[Drawn]:
    """Yield obstacles and sweepable areas, x, y [m]; of what lies behind edges those, each once: how far it goes on nobody has drawn."""
    for kind, layer in ((Kind.OBSTACLE, Layer.OBSTACLES), (Kind.SWEEPABLE, Layer.SWEEPABLE)):
        for region in regions:
            if region.kind is kind and not region.edges:
                yield Drawn(layer, region.polygon, {"name": region.label or None}, region.label)
    for edge in dict.fromkeys(edge for region in regions for edge in region.edges):
        yield Drawn(Layer.KERBS, edge.line, {"name": edge.label}, edge.label)


def _envelopes(result: Result) -> Iterator[Drawn]:
    envelope, drive = result.envelope, result.drive
    for unit, (left, right) in enumerate(zip(envelope.left, envelope.right, strict=True)):
        area = swept_area(drive.road.path, envelope.s, left, right)
        reach: dict[str, Value] = {"max_left_m": float(np.nanmax(left)), "max_right_m": -float(np.nanmin(right))}
        yield Drawn(Layer.ENVELOPE, area, of_body(drive.vehicle, unit) | reach | {"area_m2": float(shapely.area(area))})


def kerb_features(result: Result) -> Iterator[Drawn]:
    """Yield the limits of a plan's drawing, x, y [m]."""
    for kerb in shown_kerbs(result):
        yield Drawn(Layer.LIMITS, kerb.line, {"side": kerb.side, "binds": kerb.binds, "bridged": kerb.bridged})


def _tracks(result: Result) -> Iterator[Drawn]:
    for track in wheel_tracks(result.drive):
        wheel: dict[str, Value] = {"axle": track.wheel.axle, "side": track.wheel.side, "note": TRACK_NOTE}
        yield Drawn(Layer.TRACKS, simple_line(track.points), of_body(result.drive.vehicle, track.wheel.unit) | wheel)


def _vehicles(result: Result) -> Iterator[Drawn]:
    drive, places = result.drive, outline_places(result, 0.0, result.drive.road.path.length)
    for s, bodies in zip(places, corners(drive, np.array([pose_at(drive, s) for s in places])), strict=True):
        for unit, outline in enumerate(bodies):
            yield Drawn(Layer.VEHICLES, shapely.Polygon(outline), of_body(drive.vehicle, unit) | {"s_m": s})


def _clearances(result: Result) -> Iterator[Drawn]:
    for at in peaks(result.envelope.s, tightness(result), _CLEARANCES_APART_M, _CLEARANCES) if result.gaps else ():
        room = room_at(result, at)
        if not room.broken:  # else a conflict
            where: dict[str, Value] = {"s_m": room.s, "clearance_m": -room.depth, "side": room.side}
            named = where | {"unit": body_name(result.drive.vehicle, room.unit), "obstacle": room.obstacle}
            yield Drawn(Layer.CLEARANCE, shapely.LineString(room.ends), named, f"{max(-room.depth, 0.0):.2f}")


def conflict_features(result: Result) -> Iterator[Drawn]:
    """Yield what was swept beyond an edge, and the parts of obstacles that bodies entered, x, y [m]."""
    vehicle = result.drive.vehicle
    for breach in result.balance.breaches:
        area = beyond_kerb(result, breach) if breach.obstacle is None else shared_with(result, approach_of(result, breach))
        where: dict[str, Value] = {"depth_m": breach.depth, "s_m": breach.s_deepest, "s_from_m": breach.s_from, "s_to_m": breach.s_to}
        what: dict[str, Value] = {"obstacle": breach.obstacle, "text": breach_text(result, breach)}
        named = where | {"side": breach.side, "unit": body_name(vehicle, breach.unit)} | what
        yield Drawn(Layer.CONFLICTS, area, named, f"{breach.depth:.2f}")
    for near in result.entered:
        where = {"depth_m": -near.distance, "s_m": near.s, "s_from_m": near.s_from, "s_to_m": near.s_to}
        what = {"obstacle": near.obstacle.label, "text": entered_text(result, near)}
        named = where | {"side": near.side, "unit": body_name(vehicle, near.unit)} | what
        yield Drawn(Layer.CONFLICTS, shared_with(result, near), named, f"{-near.distance:.2f}")


@dataclass(frozen=True)
class System:
    """A coordinate system for a file about a road, and the way there from the road's plane."""

    name: str | None  # a code or a PROJ string; None: metres of no known place
    note: str  # what the file and its reader are told
    plane: str | None = None  # of the road, where that is another one

    def place(self, geometry: BaseGeometry) -> BaseGeometry:
        """Return a geometry of the road's plane in this system."""
        if self.plane is None or self.name is None:
            return geometry
        if self.name == LONLAT_CODE:  # across the antimeridian longitudes go on, else a line would go round the world
            to_lonlat = ToLonLat(self.plane)
            return shapely.transform(geometry, lambda points: np.column_stack(to_lonlat(points[:, 0], points[:, 1])))
        return shapely.transform(geometry, IntoPlane(self.plane, self.name))


def map_system(road: Road) -> System:
    """Return the system of a map: the road's own, or longitude and latitude where the road came in degrees."""
    if isinstance(road.to_lonlat, ToLonLat) and is_local(road.to_lonlat):
        return System(LONLAT_CODE, f"longitude and latitude, {LONLAT_CODE}", road.to_lonlat.plane)
    return drawing_system(road)


def drawing_system(road: Road) -> System:
    """Return the system of a drawing in metres: the road's own, or its UTM zone on WGS 84 where the road came in degrees."""
    if not isinstance(road.to_lonlat, ToLonLat):
        return System(None, "metres of the road file, which names no coordinate system")
    plane = road.to_lonlat.plane
    if not is_local(road.to_lonlat):
        return System(plane, f"metres in {plane}, the system of the road file")
    middle = np.array([np.median(part) for part in road.path.to_plane(np.linspace(0.0, road.path.length, 101), 0.0)])
    lon, lat = (float(value[0]) for value in road.to_lonlat(middle[:1], middle[1:]))
    if not _UTM_LATITUDES[0] <= lat <= _UTM_LATITUDES[1]:
        return System(plane, f"metres in {plane}")
    zone = int(np.floor((lon + 180.0) / 6.0)) % 60 + 1
    code = f"EPSG:{(32600 if lat >= 0.0 else 32700) + zone}"
    return System(code, f"metres in {code}, WGS 84 / UTM zone {zone}{'N' if lat >= 0.0 else 'S'}{_stretch(plane, code, middle)}", plane)


def _stretch(plane: str, code: str, middle: FloatArray) -> str:
    """Return what a true length is multiplied by in a system, as a remark."""
    ends = IntoPlane(plane, code)(np.stack([middle, middle + np.array([100.0, 0.0])]))
    return f": lengths times {float(np.hypot(*(ends[1] - ends[0]))) / 100.0:.5f}"
