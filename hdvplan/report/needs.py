"""What ``hdvplan need`` says and writes: its sentence, its JSON, its table, and the widening as polygons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from rich.table import Table
from shapely.geometry.base import BaseGeometry

from hdvplan import __version__
from hdvplan.arrays import FloatArray
from hdvplan.judging.result import body_name
from hdvplan.judging.verdict import place_text, proof_text
from hdvplan.need.answer import Need, Place
from hdvplan.need.bound import Bound
from hdvplan.need.measure import ROWS
from hdvplan.need.search import TOLERANCE_M, WIDE_M, Least
from hdvplan.need.widening import Widening
from hdvplan.report.colours import BREACH
from hdvplan.report.geojson import area_style, feature, swept_area
from hdvplan.report.grid import grid
from hdvplan.report.summary import proof_json
from hdvplan.road.path import ReferencePath
from hdvplan.road.regions import called
from hdvplan.road.road import Limits, Road

Json = dict[str, object]


@dataclass(frozen=True)
class Patch:
    """A stretch over which one limit moves outwards: a polygon in the road's plane [m]."""

    side: str
    region: str  # "drivable" or "sweepable", see ``Breach``
    s_from: float  # [m]
    s_to: float  # [m]
    s_deepest: float  # [m]
    depth: float  # [m]
    polygon: BaseGeometry


def patches_of(widening: Widening, own: Limits, path: ReferencePath) -> tuple[Patch, ...]:
    """Return the polygons by which a widening extends the limits ``own``, in order of s; of overhangs where theirs differs from wheels'."""
    found = []
    table = own.table(widening.s)
    for number, name in enumerate(ROWS):
        side, outwards = name.removesuffix("_sweep"), widening.outwards[number]
        if number > 1 and np.array_equal(outwards, widening.outwards[number - 2]) and not own.two_regions:
            continue
        edges = np.flatnonzero(np.diff(np.concatenate([[False], outwards > 0.0, [False]]).astype(int)))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            part = slice(max(0, begin - 1), end + 1)  # to where it begins and ends
            region = "sweepable" if number > 1 else "drivable"
            found.append(_patch(path, widening.s[part], table[number, part], outwards[part], side, region))
    return tuple(sorted(found, key=lambda patch: (patch.s_from, patch.side)))


def _patch(path: ReferencePath, s: FloatArray, limit: FloatArray, outwards: FloatArray, side: str, region: str) -> Patch:
    moved = limit + outwards * (1.0 if side == "left" else -1.0)
    left, right = (moved, limit) if side == "left" else (limit, moved)
    deepest = int(np.argmax(outwards))
    area = shapely.union_all(swept_area(path, s, left, right))
    return Patch(side, region, float(s[0]), float(s[-1]), float(s[deepest]), float(outwards[deepest]), area)


def area_of(patches: tuple[Patch, ...]) -> float:
    """Return the area of all patches together [m2]; what several cover counts once."""
    return float(shapely.union_all([patch.polygon for patch in patches]).area)


def need_lines(need: Need) -> list[str]:
    """Return the answer in sentences, the most important first; each begins with YES, NO or NEEDS."""
    lines = []
    if need.widenings is not None:
        lines.append(_widening_line(need))
    vehicle = need.case.vehicle.name
    kept = f", {need.case.settings.clearance:.2f} m of clearance included" if need.case.settings.clearance > 0.0 else ""
    if need.room.result is not None and need.place is not None:
        where = "to both sides of the line" if need.side is None else f"on the {need.side}"
        lines.append(f"NEEDS {need.room.room:.2f} m {where} for the {vehicle}{kept}: decided {_place_text(need, need.place)}")
    elif need.side is None:
        lines.append(f"NO: no plan was found for the {vehicle} at any half width up to {WIDE_M:.0f} m{kept}{_why(need.room)}")
    else:
        lines.append(_held_line(need, vehicle))
    if need.bound is not None:
        lines[-1] += f"; {_bound_text(need, need.bound)}"
    return lines


def _bound_text(need: Need, bound: Bound) -> str:
    told = proof_text(bound.proof, need.case.vehicle)
    return f"proved: {told}" if need.room.result is None else f"{bound.room:.2f} m is proved to be too little: {told}"


def _held_line(need: Need, vehicle: str) -> str:
    other = "right" if need.side == "left" else "left"
    if need.held is None or need.held.result is None or need.place is None:
        return f"NO: no plan was found for the {vehicle} that keeps the {other} edge, however wide the {need.side} is"
    least = f"one was found with the {other} edge {need.held.room:.2f} m off, decided {_place_text(need, need.place)}"
    return f"NO: no plan was found for the {vehicle} that keeps the {other} edge, however wide the {need.side} is; {least}"


def _widening_line(need: Need) -> str:
    widenings, vehicle = need.widenings, need.case.vehicle.name
    assert widenings is not None  # noqa: S101 - for the type checker
    if widenings.fitting is not None:
        return f"YES: the {vehicle} fits within the road's own limits"
    if widenings.area is None or widenings.depth is None:
        return f"NO: the {vehicle} does not fit, and no widening of the road's own limits was found that would do{_why(need.room)}"
    area, depth = (area_of(_patches(need, widening)) for widening in (widenings.area, widenings.depth))
    both = widenings.area.result is not None and widenings.depth.result is not None
    least = f"widening the road by {area:.1f} m2 would do" if both else f"at least {area:.1f} m2 of road are lacking"
    deep = f"{widenings.area.depth:.2f} m at the deepest, or {depth:.1f} m2 nowhere deeper than {widenings.depth.depth:.2f} m"
    rest = "" if both else "; no plan along the whole road was found with it"
    return f"NO: the {vehicle} does not fit; {least}, {deep}{rest}"


def _why(room: Least) -> str:
    """Return what prevents every plan, as far as it is known; nothing where a plan was found."""
    if room.result is None and room.blocked is not None:
        return f": {called(room.blocked.obstacle.label)} is in the way at s = {room.blocked.s:.1f} m"
    return f" ({room.failure})" if room.result is None and room.failure is not None else ""


def _patches(need: Need, widening: Widening) -> tuple[Patch, ...]:
    own = need.case.road.own_limits
    assert own is not None  # noqa: S101 - for the type checker: there is a widening
    return patches_of(widening, own, need.case.road.path)


def _place_text(need: Need, place: Place) -> str:
    at = place_text(place.x, place.y, place.lonlat)
    return f"at s = {place.s:.1f} m ({at}) by the {place.part} of the {body_name(need.case.vehicle, place.unit)} on the {place.side}"


def need_json(need: Need, seconds: float) -> Json:
    """Return the answer under the names that other programs read; ``seconds`` is the time that it took."""
    case, place, result = need.case, need.place, need.room.result
    found = need.room.room if result is not None else None
    named: Json = {"half_width_m": found} if need.side is None else {f"{need.side}_m": found}
    if need.held is not None:
        named[f"least_{'right' if need.side == 'left' else 'left'}_m"] = None if need.held.result is None else need.held.room
    lon, lat = (place.lonlat if place is not None else None) or (None, None)
    widened = need.widenings
    return {
        "road": case.road.name,
        "vehicle": case.vehicle.name,
        "text": need_lines(need),
        **named,
        "tolerance_m": TOLERANCE_M,
        "proved_below_m": None if need.bound is None else need.bound.room,
        "proof": None if need.bound is None else proof_json(need.bound.proof, case.vehicle),
        "out_of_reach_m": WIDE_M if result is None else need.room.out_of_reach if need.room.out_of_reach < need.room.room else None,
        "clearance_wanted_m": case.settings.clearance,
        "s_m": None if place is None else place.s,
        "x": None if place is None else place.x,
        "y": None if place is None else place.y,
        "lon": lon,
        "lat": lat,
        "side": None if place is None else place.side,
        "unit": None if place is None else body_name(case.vehicle, place.unit),
        "part": None if place is None else place.part,
        "objective": None if result is None else result.objective,
        "scheme": None if result is None else str(result.case.settings.scheme),
        "plans": need.room.plans,
        "fits": None if widened is None else widened.fitting is not None,
        "widening_m2": _widening_m2(need),
        "widening": None
        if widened is None
        else {
            name: None if widening is None else _widening_json(need, widening)
            for name, widening in (("least_area", widened.area), ("least_depth", widened.depth))
        },
        "time_s": seconds,
        "notice": case.road.notice,
        "version": __version__,
    }


def _widening_m2(need: Need) -> float | None:
    if need.widenings is None:
        return None
    if need.widenings.fitting is not None:
        return 0.0
    return None if need.widenings.area is None else area_of(_patches(need, need.widenings.area))


def _widening_json(need: Need, widening: Widening) -> Json:
    patches = _patches(need, widening)
    return {
        "area_m2": area_of(patches),
        "depth_m": widening.depth,
        "fits_then": widening.result is not None,
        "objective": None if widening.result is None else widening.result.objective,
        "scheme": None if widening.result is None else str(widening.result.case.settings.scheme),
        "places": [_patch_json(patch) for patch in patches],
    }


def _patch_json(patch: Patch) -> Json:
    return {
        "s_from": patch.s_from,
        "s_to": patch.s_to,
        "s_deepest": patch.s_deepest,
        "depth_m": patch.depth,
        "area_m2": float(patch.polygon.area),
        "side": patch.side,
        "region": patch.region,
    }


def widening_geojson(need: Need, widening: Widening) -> Json:
    """Return the polygons of a widening as a FeatureCollection, in the coordinates of ``swept.geojson``."""
    road = need.case.road
    common: Json = {"road": road.name, "vehicle": need.case.vehicle.name, "kind": "widening"}
    if road.notice is not None:
        common["attribution"] = road.notice
    return {"type": "FeatureCollection", "features": [_feature(patch, road, common) for patch in _patches(need, widening)]}


def _feature(patch: Patch, road: Road, common: Json) -> Json:
    measured = {name: round(value, 3) if isinstance(value, float) else value for name, value in _patch_json(patch).items()}
    return feature(patch.polygon, road, common | measured | area_style(BREACH), fine=True)


def widening_table(need: Need, widening: Widening, title: str) -> Table:
    """Return the places of a widening, one a row."""
    patches = _patches(need, widening)
    regions = {patch.region for patch in patches}
    columns = ["from [m]", "to [m]", "deepest [m]", "depth [m]", "area [m2]", "side"]
    rows = []
    for patch in patches:
        place = [f"{s:.1f}" for s in (patch.s_from, patch.s_to, patch.s_deepest)]
        rows.append([*place, f"{patch.depth:.2f}", f"{patch.polygon.area:.1f}", patch.side])
        if len(regions) > 1:
            rows[-1].append(f"of {'overhangs' if patch.region == 'sweepable' else 'wheels'}")
    if len(regions) > 1:
        columns.append("limit")
    total = f"{area_of(patches):.1f} m2, {widening.depth:.2f} m at the deepest"
    caption = None if widening.result is not None else "no plan along the whole road was found with it: this is where room is lacking"
    return grid(f"{title}: {total}", columns, rows, text=("side", "limit"), caption=caption)
