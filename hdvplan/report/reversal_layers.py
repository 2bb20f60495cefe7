"""What a drawing of a manoeuvre of forward and backward legs holds, layer by layer, in its plane."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray
from hdvplan.report.layers import Drawn, Layer, of_body
from hdvplan.report.turn_layers import swept_by
from hdvplan.road.legs import direction_of
from hdvplan.turning.reversing.answer import Answer
from hdvplan.turning.reversing.legs import Leg
from hdvplan.vehicle.body import corners_at

_ROOM_M = 4.0  # of the place that is shown around what is swept
_LINE_M = 0.5  # between points of a leg's line: on a radius of 6 m off by 5 mm
_SWEPT_M = 0.2  # between the poses that a swept area is joined from: short by 0.7 mm at a radius of 7 m


def view_of(answer: Answer) -> shapely.Polygon:
    """Return the box of the place that is shown."""
    corners = np.concatenate([corners_at(answer.vehicle, leg.poses).reshape(-1, 2) for leg in answer.chosen.manoeuvre.legs])
    box: shapely.Polygon = shapely.box(*(corners.min(axis=0) - _ROOM_M), *(corners.max(axis=0) + _ROOM_M))
    return box


def reversal_features(answer: Answer) -> tuple[Drawn, ...]:
    """Return all features of a manoeuvre's drawing, x, y [m]: what stands, legs, swept areas, and the vehicle where legs begin and end."""
    vehicle, legs, view = answer.vehicle, answer.chosen.manoeuvre.legs, view_of(answer)
    found = [Drawn(Layer.OBSTACLES, block.area(view), {"name": block.name}) for block in answer.blocks]
    for number, leg in enumerate(legs, start=1):
        direction = direction_of(backward=leg.backward)
        line = shapely.LineString(line_of(leg))
        found.append(Drawn(Layer.ROAD, line, {"leg": number, "direction": direction}, f"{number} {direction}"))
    for unit in range(len(vehicle.units)):
        area = shapely.union_all([leg_area(answer, leg, unit) for leg in legs])
        found.append(Drawn(Layer.ENVELOPE, area, of_body(vehicle, unit)))
    shown = np.concatenate([legs[0].poses[:1], *(leg.poses[-1:] for leg in legs)])
    for bodies in corners_at(vehicle, shown):
        found += [Drawn(Layer.VEHICLES, shapely.Polygon(outline), of_body(vehicle, unit)) for unit, outline in enumerate(bodies)]
    return tuple(found)


def line_of(leg: Leg) -> FloatArray:
    """Return the lead rear axle's line in the order of driving (n, 2) [m]."""
    every = _every(leg, _LINE_M)
    return np.asarray(leg.lead[every, :2])


def leg_area(answer: Answer, leg: Leg, unit: int) -> BaseGeometry:
    """Return the plane area that a body sweeps on a leg [m]."""
    return swept_by(corners_at(answer.vehicle, leg.poses[_every(leg, _SWEPT_M)])[:, unit])


def _every(leg: Leg, spacing: float) -> list[int]:
    """Return the poses about ``spacing`` apart [m], the first and the last among them."""
    count = max(2, 1 + int(np.ceil(leg.length / spacing)))
    return sorted(set(np.searchsorted(leg.s, np.linspace(0.0, leg.length, count)).clip(0, len(leg.s) - 1).tolist()))
