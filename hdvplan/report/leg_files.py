"""Write the files of a drive of several legs: those of a road's plan, with the number and the direction of the leg in every row."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from hdvplan.fileio import Column, json_bytes, table_bytes
from hdvplan.judging.bodies import corners
from hdvplan.judging.legs import JACKKNIFE, LegsResult
from hdvplan.judging.result import Result
from hdvplan.record import NAME, record_of
from hdvplan.report.cad import drawing_bytes
from hdvplan.report.files import FILES, FILM, REGIONS, SHEET, SWEPT, TABLES, Table, path_table, regions_json
from hdvplan.report.geojson import region_feature, swept_features
from hdvplan.report.layers import Drawn, Layer, Value, drawn_features, of_body, region_features
from hdvplan.report.paper import SheetOptions
from hdvplan.report.summary import summary_of, verdict_json
from hdvplan.road.legs import Leg

Json = dict[str, Any]
_COMMON = ("road", "vehicle", "scheme", "solver", "objective", "settings", "bodies", "wheels", "notice", "clearance_wanted_m", "version")
_OWN = (Layer.OBSTACLES, Layer.SWEEPABLE, Layer.KERBS, Layer.ENVELOPE, Layer.VEHICLES)  # a drive along one line draws them otherwise


def write_legs(
    driven: LegsResult,
    directory: Path,
    *,
    pictures: Collection[str] = (),
    drawings: Collection[str] = (),
    sheet: SheetOptions | None = None,
    animate: bool = False,
    on_progress: Callable[[float], None] | None = None,
) -> None:
    """Write all files of a drive of several legs into ``directory``, as ``write_plan`` does those of a road.

    Raises:
        OptionError: the sheet has no room for the drive, or the folder has files that hdvplan did not write.
        OSError: the folder or a file cannot be written.

    """
    contents: dict[str, Callable[[], bytes]] = {name: partial(_table, driven, table_of) for name, table_of in TABLES.items()}
    contents |= {
        REGIONS: lambda: json_bytes(regions_json(driven.legs.regions), indent=None),
        SWEPT: lambda: json_bytes(legs_geojson(driven), indent=None),
        NAME: lambda: json_bytes(record_of([result.case for result in driven.results])),
    }
    contents |= {f"plan.{kind}": partial(_drawn, driven, kind) for kind in (*pictures, *drawings)}
    if sheet is not None:
        from hdvplan.report.leg_sheet import legs_sheet_bytes  # noqa: PLC0415 - as below

        contents[SHEET] = partial(legs_sheet_bytes, driven, sheet)
    if animate:
        from hdvplan.report.leg_plots import legs_film_bytes  # noqa: PLC0415 - as below

        contents[FILM] = partial(legs_film_bytes, driven)
    contents[FILES.last] = lambda: json_bytes(summary_of_legs(driven))
    FILES.write(directory, contents, on_progress)


def summary_of_legs(driven: LegsResult) -> Json:
    """Return the summary, ready for ``json.dumps``: the verdict over all legs, and ``legs`` with what a road's summary has of each.

    Their articulations at the ends are in the order of driving. The bound on the tracking error holds along one line that is driven
    forwards: nothing is told of it.
    """
    summaries = [summary_of(result, forecast=False, tracking=False) for result in driven.results]
    legs = [_summary(driven, at, one) for at, one in enumerate(summaries)]
    at, whole = driven.worst, summaries[0]
    verdict = verdict_json(driven.results[at], driven.verdicts[at])
    decided = {"text": driven.text, "details": driven.details, "word": driven.word, "fits": driven.fits}
    return {
        "verdict": verdict | decided | {name: legs[at][name] for name in ("leg", "direction", "jackknife")},
        **{name: whole[name] for name in _COMMON},
        "road": driven.legs.name,
        "status": legs[at]["status"],
        "length_m": sum(leg["length_m"] for leg in legs),
        "plans": sum(leg["plans"] for leg in legs),
        "min_clearance_m": min((leg["min_clearance_m"] for leg in legs if leg["min_clearance_m"] is not None), default=None),
        "limit_violation_m": max(leg["limit_violation_m"] for leg in legs),
        "legs": legs,
        "cusps_past_m": list(driven.past),
        "notes": list(driven.legs.notes),
    }


def _summary(driven: LegsResult, at: int, summary: Json) -> Json:
    leg, folded = driven.legs.legs[at], driven.jackknives[at]
    begin, end = (np.degrees(angles).tolist() for angles in driven.articulation(at))
    own = {name: value for name, value in summary.items() if name not in _COMMON}
    own |= {} if folded is None else {"status": JACKKNIFE}
    off, turned = driven.off_line(at)
    ends = {
        "articulation_begin_deg": begin,
        "articulation_end_deg": end,
        "off_line_end_m": off,
        "off_line_end_deg": float(np.degrees(turned)),
    }
    jackknife = None
    if folded is not None:
        jackknife = {"s_m": folded.s, "x": folded.x, "y": folded.y, "coupling": folded.coupling + 1}
        jackknife |= {"angle_deg": float(np.degrees(folded.angle)), "critical_deg": float(np.degrees(folded.critical))}
    return {"leg": at + 1, "direction": leg.direction} | own | ends | {"jackknife": jackknife}


def _table(driven: LegsResult, table_of: Callable[[Result], Table]) -> bytes:
    """Return the tables of all legs as one; the path's rows in the order of driving, those over s in the order of s."""
    tables = [table_of(result) for result in driven.results]
    if table_of is path_table:
        tables = [_driven(table, leg) for table, leg in zip(tables, driven.legs.legs, strict=True)]
    rows = [len(next(iter(table.values())).content) for table in tables]
    directions = np.array([-1 if leg.backward else 1 for leg in driven.legs.legs])
    whole = {"leg": Column(np.repeat(np.arange(1, len(rows) + 1), rows)), "direction": Column(np.repeat(directions, rows))}
    for name, column in tables[0].items():
        whole[name] = Column(np.concatenate([table[name].content for table in tables]), column.form)
    return table_bytes(whole)


def _driven(table: Table, leg: Leg) -> Table:
    """Return a leg's path in the order of driving: a row's curvature is held to the next row."""
    if not leg.backward:
        return table
    turned = {name: Column(column.content[::-1], column.form) for name, column in table.items()}
    held = turned["kappa"].content[1:]
    return turned | {"kappa": Column(np.append(held, held[-1]), table["kappa"].form)}


def _drawn(driven: LegsResult, kind: str) -> bytes:
    from hdvplan.report.leg_plots import legs_figure  # noqa: PLC0415 - Matplotlib takes a while to import

    first, legs = driven.results[0].drive, driven.legs
    road = f"road: {legs.name}, {len(legs.legs)} legs, {sum(leg.road.path.length for leg in legs.legs):.1f} m"
    notes = [driven.text, driven.details, road, f"vehicle: {first.vehicle.name}"]
    return drawing_bytes(kind, partial(legs_figure, driven), partial(leg_features, driven), notes, first.road)


def leg_features(driven: LegsResult) -> tuple[Drawn, ...]:
    """Return all features of the drawing, in the order of its layers, x, y [m]; those of a leg have ``leg`` and ``direction``."""
    found = [one for at in range(len(driven.results)) for one in _of_leg(driven, at)]
    return tuple(sorted((*found, *region_features(driven.legs.regions)), key=lambda one: list(Layer).index(one.layer)))


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
        features += swept_features(result, result.swept, {"road": name, "leg": number, "direction": leg.direction})
    regions = [region_feature(region, driven.legs.legs[0].road, {"road": name}) for region in driven.legs.regions]
    return {"type": "FeatureCollection", "features": features + regions}
