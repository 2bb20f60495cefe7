"""What ``hdvplan need`` says, draws and writes. Each file appears whole or not at all, and ``need.json`` comes last."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from rich.table import Table

from hdvplan.answers import NEEDS, NO, YES, worded
from hdvplan.fileio import Together, json_bytes
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.result import Result, body_name
from hdvplan.judging.verdict import proof_text, tracking_line
from hdvplan.need.answer import Need, Place
from hdvplan.need.land import Patch
from hdvplan.need.search import TOLERANCE_M, WIDE_M, on_road
from hdvplan.need.widening import Widening, Widenings
from hdvplan.record import NAME, record_of
from hdvplan.report import BREACH, DRAWINGS, PICTURES
from hdvplan.report.cad import drawing_bytes
from hdvplan.report.files import SHEET, driven_notes
from hdvplan.report.geojson import area_style, feature
from hdvplan.report.grid import grid
from hdvplan.report.layers import Drawn, Layer, Value, clearance_features, drawn_features
from hdvplan.report.paper import SheetOptions
from hdvplan.report.summary import passed_json, proof_json, tracking_json
from hdvplan.road.regions import Kind, called
from hdvplan.texts import place_text
from hdvplan.vehicle.model import Vehicle
from hdvplan.version import __version__

Json = dict[str, object]
_SUMMARY = "need.json"
_BESIDE_M = 0.1  # beyond the clearance: a widening may be needed because of an obstacle this near to its plan
_WIDENINGS = {"area": "widening.geojson", "depth": "widening_least_depth.geojson"}


def need_lines(need: Need) -> list[str]:
    """Return the answer in sentences, the most important first; each begins with its word."""
    lines = []
    if need.widenings is not None:
        lines.append(_widening_line(need, need.widenings))
    vehicle = need.case.vehicle.name
    kept = f", {need.case.settings.clearance:.2f} m of clearance included" if need.case.settings.clearance > 0.0 else ""
    if need.room.result is not None and need.place is not None:
        where = "to both sides of the line" if need.side is None else f"on the {need.side}"
        needed = f"{need.room.room:.2f} m {where} for the {vehicle}{kept}{_instead(need)}"
        lines.append(worded(NEEDS, f"{needed}: decided {_place_text(need, need.place)}"))
    elif need.side is None:
        lines.append(worded(NO, f"no plan was found for the {vehicle} at any half width up to {WIDE_M:.0f} m{kept}{_why(need)}"))
    else:
        lines.append(_held_line(need, vehicle))
    if need.bound is not None:
        words = proof_text(need.bound.proof, need.case)
        lines[-1] += f"; proved: {words}" if need.room.result is None else f"; {need.bound.room:.2f} m is proved to be too little: {words}"
    return lines


def _instead(need: Need) -> str:
    """Return that a half width is of another street than the road's own, where that has edges drawn or widths that change."""
    road = need.case.road
    even = road.limits is None or (road.drawn is None and all(np.ptp(reach) == 0.0 for reach in road.limits.table(road.limits.s)))
    return "" if even else ", were the street as wide as that throughout"


def _held_line(need: Need, vehicle: str) -> str:
    other = "right" if need.side == "left" else "left"
    none = worded(NO, f"no plan was found for the {vehicle} that keeps the {other} edge, however wide the {need.side} is")
    if need.held is None or need.held.result is None or need.place is None:
        return none
    return f"{none}; one was found with the {other} edge {need.held.room:.2f} m off, decided {_place_text(need, need.place)}"


def _widening_line(need: Need, widenings: Widenings) -> str:
    vehicle, clearance = need.case.vehicle.name, need.case.settings.clearance
    kept, included = (f" with {clearance:.2f} m of clearance", ", clearance included") if clearance > 0.0 else ("", "")
    if widenings.fitting is not None:
        return worded(YES, f"the {vehicle} fits within {need.asked}{kept}; {tracking_line(widenings.fitting)}")
    lacking = worded(NO, f"the {vehicle} does not fit{kept}")
    if widenings.area is None or widenings.depth is None:
        return f"{lacking}, and no widening of {need.asked} was found that would do{_why(need)}"
    area, depth = widenings.area, widenings.depth
    least = f"widening the road by {_area_text(area.area)} would do, {area.depth:.2f} m at the deepest{included}"
    other = "" if area.area == depth.area else f", or {_area_text(depth.area)} nowhere deeper than {depth.depth:.2f} m"
    stays = "; obstacles stay where they are" if any(region.kind is Kind.OBSTACLE for region in need.case.road.regions) else ""
    near = min(area.result.approaches, key=lambda one: one.distance, default=None)
    if near is not None and near.distance < clearance + _BESIDE_M:
        stays += f", such as {called(near.obstacle.label)}, {max(near.distance, 0.0):.2f} m off at s = {near.s:z.1f} m"
    return f"{lacking}; {least}{other}{stays}"


def _area_text(area: float) -> str:
    return f"{area:.{1 if area >= 1.0 else 2}f} m2"


def _why(need: Need) -> str:
    """Return what prevents every plan, as far as it is known; nothing where a plan was found."""
    room = need.room
    if room.result is not None:
        return ""
    if room.blocked is not None:
        return f": {called(room.blocked.obstacle.label)} is in the way at s = {room.blocked.s:z.1f} m"
    swept = any(region.kind is Kind.SWEEPABLE for region in need.case.road.regions)
    kept = "; wheels keep off sweepable areas, however wide the road is" if swept else ""
    return (f" ({room.failure})" if room.failure is not None else "") + kept


def _place_text(need: Need, place: Place) -> str:
    at = place_text(place.x, place.y, place.lonlat)
    return f"at s = {place.s:z.1f} m ({at}) by the {place.part} of the {body_name(need.case.vehicle, place.unit)} on the {place.side}"


def need_json(need: Need, seconds: float) -> Json:
    """Return the answer under the names that other programs read; ``seconds`` is the time that it took."""
    case, place, result = need.case, need.place, need.room.result
    found = need.room.room if result is not None else None
    named: Json = {"half_width_m": found} if need.side is None else {f"{need.side}_m": found}
    if need.held is not None:
        named[f"least_{'right' if need.side == 'left' else 'left'}_m"] = None if need.held.result is None else need.held.room
    widened = need.widenings
    shown = shown_plan(need)
    area, fits = (None, None) if widened is None else (widened.area, widened.fitting is not None)
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
        **tracking_json(None if widened is None else widened.fitting),
        **_place_json(place, case.vehicle),
        "objective": None if result is None else result.objective,
        "scheme": None if result is None else str(result.case.settings.scheme),
        "plans": need.room.plans,
        "passed": [] if shown is None else [passed_json(passed) for passed in shown.passed],
        "fits": fits,
        "widening_m2": 0.0 if fits else None if area is None else area.area,
        "widening": None if widened is None else {f"least_{kind}": _widening_json(getattr(widened, kind)) for kind in _WIDENINGS},
        "time_s": seconds,
        "notice": case.road.notice,
        "version": __version__,
    }


def _place_json(place: Place | None, vehicle: Vehicle) -> Json:
    if place is None:
        return dict.fromkeys(("s_m", "x", "y", "lon", "lat", "side", "unit", "part"))
    lon, lat = place.lonlat or (None, None)
    where = {"s_m": place.s, "x": place.x, "y": place.y, "lon": lon, "lat": lat}
    return {**where, "side": place.side, "unit": body_name(vehicle, place.unit), "part": place.part}


def _widening_json(widening: Widening | None) -> Json | None:
    if widening is None:
        return None
    result, places = widening.result, [patch_json(patch) for patch in widening.patches]
    planned = {"objective": result.objective, "scheme": str(result.case.settings.scheme)}
    return {"area_m2": widening.area, "depth_m": widening.depth, "fits_then": True, **planned, "places": places}


def patch_json(patch: Patch) -> Json:
    """Return a patch of a widening under the names that other programs read."""
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
    features = []
    for patch in widening.patches:
        measured = {name: round(value, 3) if isinstance(value, float) else value for name, value in patch_json(patch).items()}
        features.append(feature(patch.polygon, road, common | measured | area_style(BREACH), fine=True))
    return {"type": "FeatureCollection", "features": features}


def widening_tables(widenings: Widenings) -> list[Table]:
    """Return the places of both widenings, one a row; of one that is both, once."""
    area, depth = widenings.area, widenings.depth
    if area is None or depth is None:
        return []
    if area.area == depth.area:
        return [_table(area, "least area and depth found")]
    return [_table(area, "least area found"), _table(depth, "least depth found")]


def _table(widening: Widening, title: str) -> Table:
    regions = {patch.region for patch in widening.patches}
    columns = ["from [m]", "to [m]", "deepest [m]", "depth [m]", "area [m2]", "side"]
    rows = []
    for patch in widening.patches:
        place = [f"{s:z.1f}" for s in (patch.s_from, patch.s_to, patch.s_deepest)]
        rows.append([*place, f"{patch.depth:.2f}", _area_text(patch.polygon.area).removesuffix(" m2"), patch.side])
        if len(regions) > 1:
            rows[-1].append(f"of {'overhangs' if patch.region == 'sweepable' else 'wheels'}")
    if len(regions) > 1:
        columns.append("limit")
    total = f"{_area_text(widening.area)}, {widening.depth:.2f} m at the deepest"
    return grid(f"{title}: {total}", columns, rows, text=("side", "limit"))


def shown_plan(need: Need) -> Result | None:
    """Return the plan to draw; None where no plan was found."""
    widened, road = need.widenings, need.case.road
    if widened is not None and (widened.area is not None or widened.fitting is not None):
        return widened.fitting if widened.area is None else widened.area.result
    best = need.room.result or (None if need.held is None else need.held.result)
    if best is None:
        return None
    return on_road(best, replace(road, limits=None, drawn=None, regions=(), faces=None))


def need_features(need: Need, shown: Result) -> tuple[Drawn, ...]:
    """Return all features of a need's drawing: those of the plan ``shown`` on the road as it is, and the areas to be widened.

    Where these are known, room is that to the kerbs as widened, and what the plan sweeps beyond the present ones is left out: it is the
    same with less around it.
    """
    widened = need.widenings
    areas = () if widened is None or widened.area is None else _areas(widened.area, Layer.WIDENING)
    depths = () if widened is None or widened.depth is None else _areas(widened.depth, Layer.WIDENING_LEAST_DEPTH)
    plan = drawn_features(shown)
    if widened is not None and widened.area is not None:
        kept = (feature for feature in plan if feature.layer not in {Layer.CONFLICTS, Layer.CLEARANCE})
        plan = (*kept, *clearance_features(widened.area.then))
    return (*plan, *areas, *depths)


def _areas(widening: Widening, layer: Layer) -> tuple[Drawn, ...]:
    found = []
    for patch in widening.patches:
        area = float(patch.polygon.area)
        where: dict[str, Value] = {"s_m": patch.s_deepest, "s_from_m": patch.s_from, "s_to_m": patch.s_to}
        what: dict[str, Value] = {"side": patch.side, "region": patch.region, "fits_then": 1}
        properties = {"depth_m": patch.depth, "area_m2": area} | where | what
        found.append(Drawn(layer, patch.polygon, properties, f"{patch.side}: {area:.1f} m2, {patch.depth:.2f} m deep"))
    return tuple(found)


def write_need(need: Need, answer: Json, directory: Path, kinds: Sequence[str] = ("png",), sheet: SheetOptions | None = None) -> None:
    """Write ``answer``, that of ``need_json``, with widenings as polygons into ``directory``, made if need be.

    ``kinds`` are those of ``PICTURES`` and ``DRAWINGS`` that are drawn as well, and ``sheet`` adds a drawing to scale; where no plan was
    found there is nothing to draw. An ``OptionError``: the folder holds files of others, or the sheet has no room at its scale.
    """
    contents: dict[str, Callable[[], bytes]] = {NAME: lambda: json_bytes(record_of([need.case]))}
    for kind, name in _WIDENINGS.items():
        widening = None if need.widenings is None else getattr(need.widenings, kind)
        if widening is not None:
            contents[name] = partial(json_bytes, widening_geojson(need, widening), indent=None)
    shown = shown_plan(need) if kinds or sheet else None
    if shown is not None:
        contents |= {f"need.{kind}": partial(_drawn, need, shown, kind) for kind in kinds}
    if shown is not None and sheet is not None:
        contents[SHEET] = partial(_sheet, need, shown, sheet)
    contents[_SUMMARY] = lambda: json_bytes(answer)
    names = (*(f"need.{kind}" for kind in (*PICTURES, *DRAWINGS)), SHEET, *_WIDENINGS.values())
    Together(_SUMMARY, names, {NAME: "software", _SUMMARY: "tolerance_m"}).write(directory, contents)


def _drawn(need: Need, shown: Result, kind: str) -> bytes:
    from hdvplan.report.atlas import need_figure  # noqa: PLC0415 - Matplotlib takes half a second to import

    features, lines, s = need_features(need, shown), need_lines(need), 0.0 if need.place is None else need.place.s
    figure = partial(need_figure, shown, features, lines, s, fits=need.fits)
    return drawing_bytes(kind, figure, lambda: features, [*lines, *driven_notes(shown)], shown.drive.road)


def _sheet(need: Need, shown: Result, options: SheetOptions) -> bytes:
    from hdvplan.report.sheet import Answer, sheet_bytes  # noqa: PLC0415 - as above

    answer, *more = need_lines(need)
    text, _, rest = answer.replace(": decided", "; decided").partition("; ")
    details = "; ".join(more if need.fits or not rest else [rest, *more])  # of a plan that fits, the driver has a row of its own
    widened = None if need.widenings is None else need.widenings.area
    patches = () if widened is None else [
        f"s = {patch.s_from:z.0f} to {patch.s_to:z.0f} m {patch.side}, {_area_text(patch.polygon.area)}, {patch.depth:.2f} m deep"
        for patch in widened.patches
    ]  # fmt: skip
    crosses = (shown.balance.min_clearance or 0.0) < -KEPT_M  # what is to be cut is enlarged; else the room once the street is widened
    then = None if widened is None or crosses else widened.then
    rows = (("to widen", "; ".join(patches)),) if patches else ()
    return sheet_bytes(shown, options, answer=Answer(need.fits, text, details, need_features(need, shown), rows, then))
