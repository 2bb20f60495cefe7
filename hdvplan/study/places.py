"""Where on a road something decides: breaches, tightest places, dead ends and widenings, as rows of ``places.parquet``."""

from __future__ import annotations

import struct

import numpy as np

from hdvplan.judging.balance import Breach
from hdvplan.judging.result import Result, body_name
from hdvplan.judging.verdict import point_of, verdict_of
from hdvplan.need.answer import Need
from hdvplan.report.needs import Patch, patches_of
from hdvplan.road.road import Road
from hdvplan.study.cells import Row

TIGHTEST, BREACH, DEAD_END, WIDENING = "tightest", "breach", "no plan", "widening"


def places_of(result: Result) -> list[Row]:
    """Return the tightest place of a plan, then its breaches in order of s, then obstacles entered beyond the road's ends."""
    verdict, vehicle = verdict_of(result), result.drive.vehicle
    tightest: Row = {
        "kind": TIGHTEST,
        "s_m": verdict.s,
        **_at(verdict.x, verdict.y, verdict.lonlat),
        "spare_m": verdict.spare,
        "side": verdict.side,
        "unit": body_name(vehicle, verdict.unit),
        "part": verdict.part,
        "region": verdict.region,
        "obstacle": verdict.obstacle,
    }
    entered: list[Row] = [
        {
            "kind": BREACH,
            "s_m": near.s,
            "s_from_m": near.s_from,
            "s_to_m": near.s_to,
            **_at(near.x, near.y, _lonlat(result.drive.road, near.x, near.y)),
            "depth_m": -near.distance,
            "spare_m": near.distance,
            "side": near.side,
            "unit": body_name(vehicle, near.unit),
            "part": near.part,
            "obstacle": near.obstacle.label,
        }
        for near in result.entered
    ]
    return [tightest, *(_breach(result, breach) for breach in result.balance.breaches), *entered]


def dead_end(road: Road, s: float) -> Row:
    """Return the place at arclength ``s`` [m] from which no plan goes on: on the road's line."""
    x, y = (float(value[0]) for value in road.path.to_plane(np.array([s]), np.zeros(1)))
    return {"kind": DEAD_END, "s_m": s, **_at(x, y, _lonlat(road, x, y))}


def widening_places(need: Need) -> list[Row]:
    """Return the middles of the stretches that the widening of least area consists of; none where there is no widening."""
    own, widenings = need.case.road.own_limits, need.widenings
    if own is None or widenings is None or widenings.area is None:
        return []
    return [_widening(need.case.road, patch) for patch in patches_of(widenings.area, own, need.case.road.path)]


def _breach(result: Result, breach: Breach) -> Row:
    hit = next((near for near in result.approaches if near.s == breach.s_deepest and near.obstacle.label == breach.obstacle), None)
    if breach.obstacle is not None and hit is not None:
        x, y, lonlat = hit.x, hit.y, _lonlat(result.drive.road, hit.x, hit.y)
    else:
        x, y, lonlat = point_of(result, breach.unit, breach.side, breach.s_deepest)
    return {
        "kind": BREACH,
        "s_m": breach.s_deepest,
        "s_from_m": breach.s_from,
        "s_to_m": breach.s_to,
        **_at(x, y, lonlat),
        "depth_m": breach.depth,
        "spare_m": -breach.depth,
        "side": breach.side,
        "unit": body_name(result.drive.vehicle, breach.unit),
        "part": breach.part,
        "region": breach.region,
        "obstacle": breach.obstacle,
    }


def _widening(road: Road, patch: Patch) -> Row:
    middle = patch.polygon.representative_point()
    return {
        "kind": WIDENING,
        "s_m": patch.s_deepest,
        "s_from_m": patch.s_from,
        "s_to_m": patch.s_to,
        **_at(middle.x, middle.y, _lonlat(road, middle.x, middle.y)),
        "depth_m": patch.depth,
        "area_m2": float(patch.polygon.area),
        "side": patch.side,
        "region": patch.region,
    }


def _at(x: float, y: float, lonlat: tuple[float, float] | None) -> Row:
    """Return a point's columns; its geometry is WKB in longitude and latitude."""
    lon, lat = lonlat or (None, None)
    return {"x": x, "y": y, "lon": lon, "lat": lat, "geometry": None if lonlat is None else struct.pack("<BIdd", 1, 1, *lonlat)}


def _lonlat(road: Road, x: float, y: float) -> tuple[float, float] | None:
    if road.to_lonlat is None:
        return None
    lon, lat = road.to_lonlat(np.array([x]), np.array([y]))
    return (float(lon[0]) + 180.0) % 360.0 - 180.0, float(lat[0])  # roads go on across the antimeridian
