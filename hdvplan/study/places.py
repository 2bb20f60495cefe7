"""Where on a road something decides: breaches, tightest places, dead ends and widenings, as rows of ``places.parquet``."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hdvplan.judging.balance import Breach
from hdvplan.judging.result import Result, body_name
from hdvplan.judging.verdict import lonlat_of, verdict_of
from hdvplan.need.answer import Need
from hdvplan.need.widening import Patch
from hdvplan.report.summary import verdict_json
from hdvplan.road.road import Road
from hdvplan.study.cells import Row

TIGHTEST, BREACH, DEAD_END, WIDENING = "tightest", "breach", "no plan", "widening"
_VERDICT = ("s_m", "x", "y", "lon", "lat", "spare_m", "side", "unit", "part", "region", "obstacle")  # of a place


def places_of(result: Result) -> list[Row]:
    """Return the tightest place of a plan, then its breaches in order of s, then obstacles entered beyond the road's ends."""
    vehicle = result.drive.vehicle
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
    tightest = tightest_place(verdict_json(result, verdict_of(result)))
    return [tightest, *(_breach(result, breach) for breach in result.balance.breaches), *entered]


def tightest_place(verdict: Mapping[str, Any]) -> Row:
    """Return the tightest place of a plan from the verdict in its summary."""
    lonlat = None if verdict["lon"] is None else (verdict["lon"], verdict["lat"])
    return {"kind": TIGHTEST} | {name: verdict[name] for name in _VERDICT} | {"geometry": _point(lonlat)}


def moved(place: dict[str, Any], by: float) -> Row:
    """Return a place with its arclengths moved by ``by`` [m]."""
    return place | {name: place[name] + by for name in ("s_m", "s_from_m", "s_to_m")}


def joined_places(places: Sequence[dict[str, Any]], summary: Mapping[str, Any]) -> list[Row]:
    """Return the places of a road that was planned in stretches, from those of its stretches and its summary.

    ``places`` are breaches, at arclengths of the whole road [m]. A breach that goes on over a cut is one; an obstacle beyond the end of a
    stretch counts where the road ends there.
    """
    deepest = {_breached(place["s_m"], place["depth_m"], place): place for place in places}
    breaches = [
        deepest[_breached(one["s_deepest"], one["depth_m"], one)] | {"s_from_m": one["s_from"], "s_to_m": one["s_to"]}
        for one in summary["breaches"]
    ]
    entered = [place for place in places if not 0.0 <= place["s_m"] <= summary["length_m"]]
    return [tightest_place(summary["verdict"]), *breaches, *entered]


def _breached(s: object, depth: object, told: Mapping[str, object]) -> tuple[object, ...]:
    return (s, depth, *(told.get(name) for name in ("side", "region", "obstacle")))


def dead_end(road: Road, s: float, begins: float = 0.0) -> Row:
    """Return the place at arclength ``s`` [m] from which no plan goes on: on the line of a road that begins at arclength ``begins``."""
    x, y = (float(value[0]) for value in road.path.to_plane(np.array([s - begins]), np.zeros(1)))
    return {"kind": DEAD_END, "s_m": s, **_at(x, y, _lonlat(road, x, y))}


def widening_places(need: Need) -> list[Row]:
    """Return the middles of the stretches that the widening of least area consists of; none where there is no widening."""
    widening = None if need.widenings is None else need.widenings.area
    return [] if widening is None else [_widening(need.case.road, patch) for patch in widening.patches]


def _breach(result: Result, breach: Breach) -> Row:
    x, y = breach.place
    lonlat = lonlat_of(result, x, y)
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
    return {"x": x, "y": y, "lon": lon, "lat": lat, "geometry": _point(lonlat)}


def _point(lonlat: tuple[float, float] | None) -> bytes | None:
    return None if lonlat is None else struct.pack("<BIdd", 1, 1, *lonlat)


def _lonlat(road: Road, x: float, y: float) -> tuple[float, float] | None:
    if road.to_lonlat is None:
        return None
    lon, lat = road.to_lonlat(np.array([x]), np.array([y]))
    return (float(lon[0]) + 180.0) % 360.0 - 180.0, float(lat[0])  # roads go on across the antimeridian
