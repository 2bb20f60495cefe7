"""Where on a road something decides: breaches, tightest places, dead ends and widenings, as rows of ``places.parquet``."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

from hdvplan.judging.balance import KEPT_M
from hdvplan.need.answer import Need
from hdvplan.report.needs import patch_json
from hdvplan.road.road import Road
from hdvplan.study.cells import Row

TIGHTEST, BREACH, DEAD_END, WIDENING = "tightest", "breach", "no plan", "widening"
_VERDICT = ("s_m", "x", "y", "lon", "lat", "spare_m", "side", "unit", "part", "region", "obstacle")  # of a place


def places_of(summary: Mapping[str, Any], road: Road) -> list[Row]:
    """Return the tightest place of a plan, its breaches in order of s, and obstacles entered beyond the road's ends, from its summary.

    ``road`` is the plan's, or a part of it: all lie in one plane.
    """
    verdict = summary["verdict"]
    lonlat = None if verdict["lon"] is None else (verdict["lon"], verdict["lat"])
    tightest = {"kind": TIGHTEST} | {name: verdict[name] for name in _VERDICT} | {"geometry": _point(lonlat)}
    breaches = [_stretch(BREACH, road, (one["x"], one["y"]), one) | {"spare_m": -one["depth_m"]} for one in summary["breaches"]]
    entered = [
        _place(BREACH, road, near["s_m"], (near["x"], near["y"]))
        | {name: near[name] for name in ("s_from_m", "s_to_m", "side", "unit", "part")}
        | {"depth_m": -near["distance_m"], "spare_m": near["distance_m"], "obstacle": near["name"]}
        for near in summary["obstacles"]
        if near["distance_m"] < -KEPT_M and not 0.0 <= near["s_m"] <= summary["length_m"]
    ]
    return [tightest, *breaches, *entered]


def dead_end(road: Road, s: float, begins: float = 0.0) -> Row:
    """Return the place at arclength ``s`` [m] from which no plan goes on: on the line of a road that begins at arclength ``begins``."""
    x, y = (float(value[0]) for value in road.path.to_plane(np.array([s - begins]), np.zeros(1)))
    return _place(DEAD_END, road, s, (x, y))


def widening_places(need: Need) -> list[Row]:
    """Return the middles of the stretches that the widening of least area consists of; none where there is no widening."""
    widening, road = None if need.widenings is None else need.widenings.area, need.case.road
    middles = [] if widening is None else [(patch, patch.polygon.representative_point()) for patch in widening.patches]
    return [_stretch(WIDENING, road, (middle.x, middle.y), patch_json(patch)) for patch, middle in middles]


def _stretch(kind: str, road: Road, at: tuple[float, float], stretch: Mapping[str, object]) -> Row:
    """Return a place with what is told of its stretch of road, the deepest point being its s."""
    rest = {name: value for name, value in stretch.items() if name not in {"s_from", "s_to", "s_deepest"}}
    return _place(kind, road, stretch["s_deepest"], at) | {"s_from_m": stretch["s_from"], "s_to_m": stretch["s_to"]} | rest


def _place(kind: str, road: Road, s: object, at: tuple[float, float]) -> Row:
    """Return a point's columns; its geometry is WKB in longitude and latitude."""
    lonlat = road.lonlat(*at)
    lon, lat = lonlat or (None, None)
    return {"kind": kind, "s_m": s, "x": at[0], "y": at[1], "lon": lon, "lat": lat, "geometry": _point(lonlat)}


def _point(lonlat: tuple[float, float] | None) -> bytes | None:
    return None if lonlat is None else struct.pack("<BIdd", 1, 1, *lonlat)
