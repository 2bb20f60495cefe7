"""What a drawing of a plan holds, layer by layer, in the road's plane: the same for every file that has layers."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray
from hdvplan.judging.balance import Breach
from hdvplan.judging.bodies import TRACK_NOTE, corners, pose_at, wheel_tracks
from hdvplan.judging.result import Result, body_name, breach_text, entered_text
from hdvplan.report.geojson import swept_area
from hdvplan.report.kerbs import beyond_kerb, shown_kerbs
from hdvplan.report.rooms import approach_of, room_at, shared_with, tightness
from hdvplan.report.windows import peaks
from hdvplan.road.regions import Kind
from hdvplan.road.road import Road

SIMPLER_M = 2.5e-4  # lines leave out points that would move them by no more
APART = 1.25  # vehicle lengths from outline to outline: they do not touch
_SPACING_M = 0.2  # of lines along the road: on a radius of 8 m, chords are off by 0.6 mm
_CLEARANCES = 12  # tightest places that are dimensioned
_CLEARANCES_APART_M = 20.0

Value = str | float | int | None


class Layer(StrEnum):
    """The layers, from the ground up."""

    ROAD = "road"
    OBSTACLES = "obstacles"
    SWEEPABLE = "sweepable"
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
    return (
        *_road(result),
        *_regions(result.drive.road),
        *_envelopes(result),
        *_limits(result),
        *_tracks(result),
        *_vehicles(result),
        *_clearances(result),
        *_conflicts(result),
    )


def outline_places(result: Result, s_from: float, s_to: float) -> list[float]:
    """Return arclengths of the lead rear axle [m] at which the vehicle's outlines stand behind each other without touching."""
    vehicle = result.drive.vehicle
    apart = APART * (vehicle.reach_ahead + vehicle.reach_behind)
    count = max(1, int((s_to - s_from) / apart))
    first = 0.5 * (s_from + s_to) - 0.5 * (count - 1) * apart
    return [first + number * apart for number in range(count)]


def line_at(road: Road, s: FloatArray, offset: FloatArray) -> shapely.LineString:
    """Return the line at signed offsets from the road's centre [m], without the points that it does not need."""
    line = shapely.simplify(shapely.LineString(np.column_stack(road.path.to_plane(s, offset))), SIMPLER_M, preserve_topology=False)
    assert isinstance(line, shapely.LineString)  # noqa: S101 - a line stays one
    return line


def _stations(road: Road) -> FloatArray:
    return np.linspace(0.0, road.path.length, max(2, int(np.ceil(road.path.length / _SPACING_M)) + 1))


def _road(result: Result) -> list[Drawn]:
    road, s = result.drive.road, _stations(result.drive.road)
    properties: dict[str, Value] = {
        "road": road.name,
        "vehicle": result.drive.vehicle.name,
        "status": result.status,
        "length_m": road.path.length,
        "attribution": road.notice,
    }
    return [Drawn(Layer.ROAD, line_at(road, s, np.zeros(len(s))), properties)]


def _regions(road: Road) -> list[Drawn]:
    layers = {Kind.OBSTACLE: Layer.OBSTACLES, Kind.SWEEPABLE: Layer.SWEEPABLE}
    ordered = sorted(road.regions, key=lambda region: list(layers).index(region.kind))
    return [Drawn(layers[region.kind], region.polygon, {"name": region.label or None}, region.label) for region in ordered]


def _envelopes(result: Result) -> list[Drawn]:
    envelope, found = result.envelope, []
    for unit, (left, right) in enumerate(zip(envelope.left, envelope.right, strict=True)):
        area = swept_area(result.drive.road.path, envelope.s, left, right)
        properties: dict[str, Value] = {
            "body": unit + 1,
            "unit": body_name(result.drive.vehicle, unit),
            "max_left_m": float(np.nanmax(left)),
            "max_right_m": -float(np.nanmin(right)),
            "area_m2": float(shapely.area(area)),
        }
        found.append(Drawn(Layer.ENVELOPE, area, properties))
    return found


def _limits(result: Result) -> list[Drawn]:
    kerbs = shown_kerbs(result)
    return [Drawn(Layer.LIMITS, kerb.line, {"side": kerb.side, "binds": kerb.binds}) for kerb in kerbs]


def _tracks(result: Result) -> list[Drawn]:
    found = []
    for track in wheel_tracks(result.drive):
        wheel = track.wheel
        line = shapely.simplify(shapely.LineString(track.points), SIMPLER_M, preserve_topology=False)
        unit = body_name(result.drive.vehicle, wheel.unit)
        properties: dict[str, Value] = {"body": wheel.unit + 1, "unit": unit, "axle": wheel.axle, "side": wheel.side, "note": TRACK_NOTE}
        found.append(Drawn(Layer.TRACKS, line, properties))
    return found


def _vehicles(result: Result) -> list[Drawn]:
    drive = result.drive
    places = outline_places(result, 0.0, drive.road.path.length)
    found = []
    for s, bodies in zip(places, corners(drive, np.array([pose_at(drive, s) for s in places])), strict=True):
        for unit, outline in enumerate(bodies):
            named: dict[str, Value] = {"body": unit + 1, "unit": body_name(drive.vehicle, unit), "s_m": s}
            found.append(Drawn(Layer.VEHICLES, shapely.Polygon(outline), named))
    return found


def _clearances(result: Result) -> list[Drawn]:
    """Return lines across the room at the tightest places, where limits are kept."""
    if not result.gaps:
        return []
    found = []
    for at in peaks(result.envelope.s, tightness(result), _CLEARANCES_APART_M, _CLEARANCES):
        room = room_at(result, at)
        if room.broken:  # a conflict
            continue
        properties: dict[str, Value] = {
            "s_m": room.s,
            "clearance_m": -room.depth,
            "side": room.side,
            "unit": body_name(result.drive.vehicle, room.unit),
            "obstacle": room.obstacle,
        }
        found.append(Drawn(Layer.CLEARANCE, shapely.LineString(room.ends), properties, f"{max(-room.depth, 0.0):.2f}"))
    return found


def _conflicts(result: Result) -> list[Drawn]:
    """Return what was swept beyond an edge, and the parts of obstacles that bodies entered."""
    vehicle, found = result.drive.vehicle, []
    for breach in result.balance.breaches:
        properties: dict[str, Value] = {
            "depth_m": breach.depth,
            "s_m": breach.s_deepest,
            "s_from_m": breach.s_from,
            "s_to_m": breach.s_to,
            "side": breach.side,
            "unit": body_name(vehicle, breach.unit),
            "obstacle": breach.obstacle,
            "text": breach_text(result, breach),
        }
        found.append(Drawn(Layer.CONFLICTS, conflict_area(result, breach), properties, f"{breach.depth:.2f}"))
    for approach in result.entered:
        properties = {
            "depth_m": -approach.distance,
            "s_m": approach.s,
            "s_from_m": approach.s_from,
            "s_to_m": approach.s_to,
            "side": approach.side,
            "unit": body_name(vehicle, approach.unit),
            "obstacle": approach.obstacle.label,
            "text": entered_text(result, approach),
        }
        found.append(Drawn(Layer.CONFLICTS, shared_with(result, approach), properties, f"{-approach.distance:.2f}"))
    return found


def conflict_area(result: Result, breach: Breach) -> BaseGeometry:
    """Return the part of an obstacle that was entered, or the area that was swept beyond a kerb."""
    return beyond_kerb(result, breach) if breach.obstacle is None else shared_with(result, approach_of(result, breach))
