"""Roads and vehicles as the cases of the behaviour reference describe them: curvature, limits and regions, or a street's line; no file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.errors import HdvplanError
from hdvplan.planning.bias import Bias
from hdvplan.planning.settings import Discretisation, PlannerSettings, Scheme
from hdvplan.road.limits import Limits
from hdvplan.road.line import Line, RawRoad, smoothed
from hdvplan.road.options import RoadOptions
from hdvplan.road.path import ReferencePath, from_curvature, from_samples
from hdvplan.road.regions import Kind, Region, Side
from hdvplan.road.road import Road
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.vehicle.load import load_vehicle

Told = Mapping[str, Any]  # a case, as its table in reference.toml says it
Quantities = dict[str, float | int | str]
_RING_M = 0.25  # of samples of a ring
_BEYOND_M = 20.0


def road_of(told: Told) -> Road:
    """Return the road of a case.

    ``road`` is a scenario's name, or ``profile`` has points (s, curvature) [m, 1/m], or ``ring`` the mean radius, and by how much it grows
    and shrinks twice a lap [m]. ``limits`` are two positive reaches, or points (s, left, right) or (s, left, right, left_sweep,
    right_sweep), positive too. ``obstacles`` and ``kerbs`` are boxes: (s, offset, length, width) of their middle along the road [m], and
    the side on which an obstacle must be passed, where one is given. ``street`` has a line's points instead [m], which is smoothed, and
    ``half_width`` is the street's, measured from the line as it is.
    """
    if "street" in told:
        line = np.array(told["street"], float)
        return smoothed(Line("reference", RawRoad(line, np.full((4, len(line)), told["half_width"])), RoadOptions()))[0]
    if "profile" in told:
        path = from_curvature(*np.array(told["profile"], float).T)
    elif "ring" in told:
        path = _ring(*told["ring"])
    else:
        path = from_curvature(*SCENARIOS[told["road"]].profile)
    regions = (*_boxes(path, Kind.OBSTACLE, told.get("obstacles", ())), *_boxes(path, Kind.SWEEPABLE, told.get("kerbs", ())))
    road = Road("reference", path, regions=regions)
    return road.within(_limits(told.get("limits"), path.length)) if "limits" in told or regions else road


def case_of(told: Told) -> Case:
    """Return the case: its road, ``vehicle``, ``max_curvature`` where it is not the vehicle's own [1/m], ``objective``, and ``settings``.

    ``bias`` is a number, or points (s, offset) [m].
    """
    given = dict(told.get("settings", {}))
    for name, kind in (("scheme", Scheme), ("discretisation", Discretisation)):
        given |= {name: kind(given[name])} if name in given else {}
    settings = PlannerSettings(**given)
    bias = np.array(told.get("bias", 0.0), float)
    wanted = Bias.constant(float(bias)) if bias.ndim == 0 else Bias(*bias.T)
    vehicle = load_vehicle(told["vehicle"])
    vehicle = replace(vehicle, max_curvature=told.get("max_curvature", vehicle.max_curvature))
    return Case(road_of(told), vehicle, told.get("objective", "geometric"), told.get("solver", "riccati"), settings, wanted)


def limits_of(rows: Sequence[Sequence[float]]) -> Limits:
    """Return limits from points (s, left, right) or (s, left, right, left_sweep, right_sweep), all positive [m]."""
    s, *reaches = np.array(rows, float).T
    left, right = reaches[:2]
    left_sweep, right_sweep = reaches[2:] or reaches
    return Limits(s, left, -right, left_sweep, -right_sweep)


def _limits(given: Any, length: float) -> Limits | None:  # noqa: ANN401 - what TOML has
    if given is None:
        return None
    return limits_of(given) if isinstance(given[0], list) else Limits.constant(float(given[0]), float(given[1]), length)


def _ring(radius: float, swell: float) -> ReferencePath:
    """Return a closed path about the origin: r = ``radius`` + ``swell`` cos 2 phi, at equal arclengths."""
    fine = np.linspace(0.0, 2.0 * np.pi, 20_001)
    speed = np.hypot(*_polar(fine, radius, swell)[1])
    along = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(fine))])
    count = round(along[-1] / _RING_M)
    phi = np.interp(np.linspace(0.0, along[-1], count + 1), along, fine)
    (x, y), (dx, dy), (ddx, ddy) = _polar(phi, radius, swell)
    heading = np.unwrap(np.arctan2(dy, dx))
    return from_samples(x, y, heading, (dx * ddy - dy * ddx) / np.hypot(dx, dy) ** 3, along[-1] / count, closed=True)


def _polar(phi: FloatArray, radius: float, swell: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the points of a ring, and their first and second derivatives by the angle, shape (2, n) each."""
    r, dr, ddr = radius + swell * np.cos(2.0 * phi), -2.0 * swell * np.sin(2.0 * phi), -4.0 * swell * np.cos(2.0 * phi)
    out, aside = np.stack([np.cos(phi), np.sin(phi)]), np.stack([-np.sin(phi), np.cos(phi)])
    return r * out, dr * out + r * aside, (ddr - r) * out + 2.0 * dr * aside


def _boxes(path: ReferencePath, kind: Kind, boxes: Sequence[Sequence[Any]]) -> list[Region]:
    """Return rectangles along the tangent at their middles, which may lie beyond the road's ends."""
    regions, path = [], path.extended(_BEYOND_M, _BEYOND_M)
    for number, (s, offset, length, width, *side) in enumerate(boxes, start=1):
        heading = float(path.at(s).heading)
        x, y = (float(one) for one in path.to_plane(s, offset))
        box = shapely.box(-0.5 * length, -0.5 * width, 0.5 * length, 0.5 * width)
        turned = shapely.affinity.rotate(box, heading, origin=(0.0, 0.0), use_radians=True)
        placed = shapely.affinity.translate(turned, x, y)
        regions.append(Region(kind, placed, f"{kind} {number}", Side(side[0]) if side else None))
    return regions


def error_of(error: HdvplanError) -> Quantities:
    """Return what a refusal is, and where on the road; its words may change."""
    s = getattr(error, "s_m", None)
    return {"error": type(error).__name__} | ({} if s is None else {"s": float(s)})
