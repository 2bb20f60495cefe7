"""What drawings of manoeuvres hold, layer by layer, in their plane: of a turn, and of forward and backward legs in their site."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray, IntArray
from hdvplan.judging.bodies import swept_pieces, united
from hdvplan.report.kerbs import simple_line
from hdvplan.report.layers import Drawn, Layer, Value, of_body
from hdvplan.turning.follow import Followed
from hdvplan.turning.reversing.answer import Answer
from hdvplan.turning.reversing.legs import DrivenLeg
from hdvplan.turning.swept import chart_of
from hdvplan.turning.turn import Turn
from hdvplan.vehicle.kinematics import corners_at, tracks_at
from hdvplan.vehicle.model import Vehicle

_RING_SEGMENTS = 128  # a quarter: on a radius of 15 m chords are off by 0.3 mm
_AREA_M = 0.2  # between the poses that a swept area is joined from: short by 0.7 mm at a radius of 7 m
_TRACK_M = 0.25
_LINE_M = 0.5  # between points of a leg's line: on a radius of 6 m off by 5 mm
_ROOM_M = 4.0  # of the site that is shown around what is swept and stands at its ends


def turn_features(turn: Turn) -> tuple[Drawn, ...]:
    """Return all features of a turn's drawing, x, y [m]: path, swept areas, the limits' circles, wheel tracks, a few poses."""
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
