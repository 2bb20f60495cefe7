"""What drawings hold, layer by layer, in their plane: of a plan, a turn, legs in their site; and the coordinate systems of files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray, IntArray
from hdvplan.judging.bodies import TRACK_NOTE, corners, pose_at, swept_pieces, united, wheel_tracks
from hdvplan.judging.result import Result, body_name
from hdvplan.judging.sentences import breach_text, entered_text
from hdvplan.report.geojson import swept_area
from hdvplan.report.kerbs import beyond_kerb, shown_kerbs, simple_line
from hdvplan.report.rooms import approach_of, peaks, room_at, shared_with, tightness
from hdvplan.road.crs import IntoPlane, ToLonLat, is_local
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.vehicle.kinematics import corners_at, tracks_at
from hdvplan.vehicle.model import Vehicle

if TYPE_CHECKING:
    from hdvplan.turning.follow import Followed
    from hdvplan.turning.reversing.answer import Answer
    from hdvplan.turning.reversing.legs import DrivenLeg
    from hdvplan.turning.turn import Turn

APART = 1.25  # vehicle lengths from outline to outline: they do not touch
LONLAT_CODE = "EPSG:4326"
_UTM_LATITUDES = (-80.0, 84.0)  # [deg]
_SPACING_M = 0.2  # of lines along the road: on a radius of 8 m, chords are off by 0.6 mm
_CLEARANCES = 12  # tightest places that are dimensioned
_CLEARANCES_APART_M = 20.0
_RING_SEGMENTS = 128  # a quarter: on a radius of 15 m chords are off by 0.3 mm
_AREA_M = 0.2  # between the poses that a swept area is joined from: short by 0.7 mm at a radius of 7 m
_TRACK_M = 0.25
_LINE_M = 0.5  # between points of a leg's line: on a radius of 6 m off by 5 mm
_ROOM_M = 4.0  # of the site that is shown around what is swept and stands at its ends

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
    return tuple(chain(*ground, _tracks(result), _vehicles(result), clearance_features(result), conflict_features(result)))


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


def clearance_features(result: Result) -> Iterator[Drawn]:
    """Yield the room at the tightest places, as lines from a body to what it comes near, x, y [m]."""
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


def turn_features(turn: Turn) -> tuple[Drawn, ...]:
    """Return all features of a turn's drawing, x, y [m]: path, swept areas, the limits' circles, wheel tracks, a few poses."""
    from hdvplan.turning.swept import chart_of  # noqa: PLC0415 - SciPy takes a while to import, and plans need none of it

    driven, vehicle = turn.driven, turn.driven.vehicle
    found = [Drawn(Layer.GUIDED_PATH, simple_line(driven.guide[:, :2]), {"point": str(driven.manoeuvre.point)})]
    found += [Drawn(Layer.ENVELOPE, _turned_area(driven, unit), of_body(vehicle, unit)) for unit in range(len(vehicle.units))]
    for limit in turn.circles:
        ring = shapely.Point(chart_of(driven).centre).buffer(limit.value, quad_segs=_RING_SEGMENTS).exterior
        found.append(Drawn(Layer.LIMITS, ring, {"limit": limit.words, "limit_m": limit.value}))
    for track in tracks_at(vehicle, driven.poses[_spaced(driven.s, _TRACK_M)]):
        side = f"front {track.wheel.side}" if track.wheel.axle == "front" else track.wheel.side
        found.append(Drawn(Layer.TRACKS, simple_line(track.points), of_body(vehicle, track.wheel.unit) | {"side": side}))
    return (*found, *_standing(vehicle, corners_at(vehicle, driven.poses[shown_poses(driven)])))


def _turned_area(driven: Followed, unit: int) -> BaseGeometry:
    """Return the plane area that a body sweeps [m]. Of a full circle those of its first and last round: the others lie in between."""
    spaced, around = _spaced(driven.s, _AREA_M), 2.0 * np.pi * driven.manoeuvre.radius
    corners, s = corners_at(driven.vehicle, driven.poses[spaced])[:, unit], driven.s[spaced]
    rounds = [corners]
    if driven.manoeuvre.angle is None and s[-1] >= 2.0 * around:
        rounds = [corners[s < driven.manoeuvre.lead_in + around], corners[s > s[-1] - around]]
    return united(np.concatenate([swept_pieces(one) for one in rounds]))


def shown_poses(driven: Followed) -> list[int]:
    """Return the pose at the begin, the one when the turn ends, and the last."""
    if driven.manoeuvre.angle is None:
        return [0, len(driven.s) - 1]
    out = driven.path.starts[-1] - driven.manoeuvre.lead_out_of(driven.vehicle)
    return [0, int(driven.s.searchsorted(out)), len(driven.s) - 1]


def reversal_features(answer: Answer) -> tuple[Drawn, ...]:
    """Return all features of a drawing of legs, x, y [m]: what stands, legs, swept areas, and the vehicle where legs begin and end."""
    vehicle, legs, view = answer.vehicle, answer.chosen.manoeuvre.legs, view_of(answer)
    found = [Drawn(Layer.OBSTACLES, block.area(view), {"name": block.name}) for block in answer.blocks]
    for number, leg in enumerate(legs, start=1):
        named: dict[str, Value] = {"leg": number, "direction": leg.direction}
        found.append(Drawn(Layer.ROAD, shapely.LineString(line_of(leg)), named, f"{number} {leg.direction}"))
    for unit in range(len(vehicle.units)):
        area = shapely.union_all([leg_area(answer, leg, unit) for leg in legs])
        found.append(Drawn(Layer.ENVELOPE, area, of_body(vehicle, unit)))
    stops = np.concatenate([legs[0].poses[:1], *(leg.poses[-1:] for leg in legs)])
    return (*found, *_standing(vehicle, corners_at(vehicle, stops)))


def view_of(answer: Answer) -> shapely.Polygon:
    """Return the box of the site that is shown: around what is swept, and the walls at its ends."""
    corners = [corners_at(answer.vehicle, leg.poses).reshape(-1, 2) for leg in answer.chosen.manoeuvre.legs]
    points = np.concatenate([*corners, *(np.array(wall.tips) for wall in answer.walls)])
    box: shapely.Polygon = shapely.box(*(points.min(axis=0) - _ROOM_M), *(points.max(axis=0) + _ROOM_M))
    return box


def line_of(leg: DrivenLeg) -> FloatArray:
    """Return the lead rear axle's line in the order of driving (n, 2) [m]."""
    return np.asarray(leg.lead[_spaced(leg.s, _LINE_M), :2])


def leg_area(answer: Answer, leg: DrivenLeg, unit: int) -> BaseGeometry:
    """Return the plane area that a body sweeps on a leg [m]."""
    return united(swept_pieces(corners_at(answer.vehicle, leg.poses[_spaced(leg.s, _AREA_M)])[:, unit]))


def _standing(vehicle: Vehicle, outlines: FloatArray) -> list[Drawn]:
    """Return the vehicle's outlines (poses, units, 4, 2) [m]."""
    return [Drawn(Layer.VEHICLES, shapely.Polygon(body), of_body(vehicle, unit)) for bodies in outlines for unit, body in enumerate(bodies)]


def _spaced(s: FloatArray, apart: float) -> IntArray:
    """Return the numbers of poses at arclengths ``s`` that lie about ``apart`` from each other [m], the first and the last among them."""
    count = max(2, 1 + int(np.ceil(s[-1] / apart)))
    return np.unique(np.searchsorted(s, np.linspace(0.0, s[-1], count)).clip(0, len(s) - 1))


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
