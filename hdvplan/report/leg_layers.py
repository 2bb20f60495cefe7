"""What a drawing of a drive of several legs holds: every leg's features with its number and direction, what lies beside them once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from hdvplan.judging.bodies import corners
from hdvplan.judging.legs import LegsResult
from hdvplan.report.geojson import REGION, region_feature, swept_features
from hdvplan.report.layers import Drawn, Layer, Value, drawn_features, of_body
from hdvplan.road.regions import Kind

_ONCE = (Layer.OBSTACLES, Layer.SWEEPABLE)
_OWN = (*_ONCE, Layer.ENVELOPE, Layer.VEHICLES)  # layers that a drive along one line draws otherwise

Json = dict[str, Any]


def leg_features(driven: LegsResult) -> tuple[Drawn, ...]:
    """Return all features of the drawing, in the order of its layers, x, y [m]; those of a leg have ``leg`` and ``direction``."""
    found = [one for at in range(len(driven.results)) for one in _of_leg(driven, at)]
    for region in driven.legs.regions:
        layer = Layer.OBSTACLES if region.kind is Kind.OBSTACLE else Layer.SWEEPABLE
        found.append(Drawn(layer, region.polygon, {"name": region.label or None}, region.label))
    return tuple(sorted(found, key=lambda one: list(Layer).index(one.layer)))


def _of_leg(driven: LegsResult, at: int) -> Iterator[Drawn]:
    result, leg = driven.results[at], driven.legs.legs[at]
    drive, vehicle = result.drive, result.drive.vehicle
    named: dict[str, Value] = {"leg": at + 1, "direction": leg.direction}
    for one in drawn_features(result):
        if one.layer not in _OWN:
            yield replace(one, properties=named | one.properties)
    for unit, area in enumerate(result.swept):
        yield Drawn(Layer.ENVELOPE, area, named | of_body(vehicle, unit) | {"area_m2": float(shapely.area(area))})
    ends = np.array([0, len(drive.poses_s) - 1])
    for pose, bodies in zip(ends, corners(drive, ends), strict=True):
        for unit, outline in enumerate(bodies):
            yield Drawn(Layer.VEHICLES, shapely.Polygon(outline), named | of_body(vehicle, unit) | {"s_m": float(drive.poses_s[pose])})


def legs_geojson(driven: LegsResult) -> Json:
    """Return a FeatureCollection as of a road, with ``leg`` and ``direction``; swept areas include what lies beyond the lines' ends."""
    name, features = driven.legs.name, list[Json]()
    for number, (result, leg) in enumerate(zip(driven.results, driven.legs.legs, strict=True), start=1):
        of_leg = swept_features(result, result.swept, {"road": name, "leg": number, "direction": leg.direction})
        features += [one for one in of_leg if one["properties"]["kind"] != REGION]  # a leg's are cut
    regions = [region_feature(region, driven.legs.legs[0].road, {"road": name}) for region in driven.legs.regions]
    return {"type": "FeatureCollection", "features": features + regions}
