"""Write a plan's files. Each appears whole or not at all, and ``summary.json`` comes last: where it is, all are."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import shapely

from hdvplan.answers import NO, without_word
from hdvplan.arrays import FloatArray
from hdvplan.fileio import Column, Together, json_bytes, table_bytes
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import verdict_details, verdict_line, verdict_of
from hdvplan.record import NAME, record_of
from hdvplan.report import DRAWINGS, PICTURES
from hdvplan.report.cad import drawing_bytes
from hdvplan.report.geojson import swept_geojson
from hdvplan.report.layers import conflict_features, drawn_features, kerb_features
from hdvplan.report.paper import SheetOptions
from hdvplan.report.summary import Json, summary_of
from hdvplan.road.regions import Region, outlines_of

SHEET = "sheet.pdf"
SWEPT, REGIONS, LIMITS = "swept.geojson", "regions.json", "limits.json"
FILM = "drive.gif"
FILES = Together(
    "summary.json",
    (*(f"plan.{kind}" for kind in (*PICTURES, *DRAWINGS)), SHEET, FILM, LIMITS),
    {NAME: "software", "summary.json": "sqp_iterations_max"},
)
_COARSE = ("%.4f", "%.6f")  # of what only drawings need: metres, angles and curvatures
_COARSE_M = 0.001  # likewise: lines leave out points that would move them by no more
_COUNTS = {"qps": "qp_count", "qp_iterations": "qp_iterations", "status": "status", "usable": "usable"}

Table = dict[str, Column]


def write_plan(
    result: Result,
    directory: Path,
    *,
    pictures: Collection[str] = (),
    drawings: Collection[str] = (),
    sheet: SheetOptions | None = None,
    animate: bool = False,
    on_progress: Callable[[float], None] | None = None,
    loop: Json | None = None,
) -> None:
    """Write all files of a plan into ``directory``, which is created if necessary.

    Pictures of a former plan that are not wanted now are deleted. A killed process leaves the former plan or this one.

    ``pictures`` are the formats of the picture, of ``PICTURES``, ``drawings`` those of layers in the road's coordinate system, of
    ``DRAWINGS``; ``sheet`` adds a drawing to scale, ``animate`` a film of the drive. ``on_progress`` receives the
    written share, 0 to 1. ``loop``: what a closed loop along the plan gave, which ``summary.json`` and the pictures' titles tell, too.

    Raises:
        OptionError: the sheet has no room for the vehicle at this scale, or the folder has files that hdvplan did not write.
        OSError: the folder or a file cannot be written.

    """
    fails = without_word(str(loop["text"]), NO).partition(";")[0] if loop is not None and loop["fits"] is False else ""
    contents: dict[str, Callable[[], bytes]] = {
        **{name: partial(lambda table_of: table_bytes(table_of(result)), table_of) for name, table_of in TABLES.items()},
        REGIONS: lambda: json_bytes(regions_json(result.drive.road.regions), indent=None),
        LIMITS: lambda: json_bytes(limits_json(result), indent=None),
        SWEPT: lambda: json_bytes(swept_geojson(result), indent=None),
        NAME: lambda: json_bytes(record_of([result.case])),
    }
    contents |= {f"plan.{kind}": partial(drawn_bytes, result, kind, fails) for kind in (*pictures, *drawings)}
    if sheet is not None:
        from hdvplan.report.sheet import sheet_bytes  # noqa: PLC0415 - Matplotlib takes a while to import

        contents[SHEET] = partial(sheet_bytes, result, sheet)
    if animate:
        from hdvplan.report.animation import film_bytes  # noqa: PLC0415 - as above

        contents[FILM] = partial(film_bytes, result)
    contents[FILES.last] = lambda: json_bytes(summary_of(result) | ({} if loop is None else {"loop": loop}))
    FILES.write(directory, contents, on_progress)


def path_table(result: Result) -> Table:
    """Return the executed path, one row a station: s, x, y, heading, e_y, e_psi, beta1, ..., steering1, ..., kappa, K [m, rad, 1/m].

    x, y and heading (continuous) are the lead unit's rear axle in the plane; row i's kappa is held to row i + 1, and the
    last row repeats the last one. The steering columns, one for every axle that the plan steers, are the angles of its wheels off its
    body (left positive), which change evenly to the next row. K is the geometric weight of the road's curvature there.
    """
    drive = result.drive
    n = len(drive.z)
    s = drive.stations.s[:n]
    x, y = drive.stations.path.to_plane(s, drive.z[:, 0])
    heading = np.unwrap(drive.stations.path.at(s).heading) + drive.z[:, 1]
    table = {"s": _metres(s), "x": _metres(x), "y": _metres(y), "heading": _radians(heading)}
    table |= {"e_y": _metres(drive.z[:, 0]), "e_psi": _radians(drive.z[:, 1])}
    table |= {f"beta{i}": _radians(beta) for i, beta in enumerate(drive.z[:, 2 : drive.vehicle.rigid_states].T, start=1)}
    table |= {f"steering{i}": _radians(angle) for i, angle in enumerate(drive.steering.T, start=1)}
    kappa = Column(np.append(drive.kappa, drive.kappa[-1]), "%.12f")  # finer: whoever drives it again adds up its rounding
    return table | {"kappa": kappa, "K": Column(drive.stations.centring.weight[:n], "%.9f")}


def envelope_table(result: Result) -> Table:
    """Return signed reaches over s [m]: s, left, right, their limits (empty without), the geometric expectation, and its width."""
    envelope, limits = result.envelope, result.drive.road.passable
    none = np.full(len(envelope.s), np.nan)
    left_limit, right_limit = (none, none) if limits is None else limits.table(envelope.s)[:2]
    columns = {
        "s": envelope.s,
        "left": envelope.reach_left,
        "right": envelope.reach_right,
        "left_limit": left_limit,
        "right_limit": right_limit,
        "expected_left": result.aim + result.expected.half_width,
        "expected_right": result.aim - result.expected.half_width,
        "needed_width": 2.0 * result.expected.half_width,
    }
    return {name: _metres(values) for name, values in columns.items()}


def profile_table(result: Result) -> Table:
    """Return what a drawing needs over the envelope's arclengths and the envelope's table has not, to 1e-4 m, 1e-6 rad or 1/m.

    s, least clearance to any limit and the limits of overhangs (empty without) [m], curvature of the road and of the balanced
    driving [1/m], its articulations expected_beta1, ... [rad], left and right reach of each body: left1, right1, left2, ...
    (empty where a body never was) [m].
    """
    envelope, limits, expected = result.envelope, result.drive.road.passable, result.expected
    none = np.full(len(envelope.s), np.nan)
    left_sweep, right_sweep = (none, none) if limits is None else limits.table(envelope.s)[2:]
    clearance = none if result.clearance is None else result.clearance
    metres = {"s": envelope.s, "clearance": clearance, "left_sweep_limit": left_sweep, "right_sweep_limit": right_sweep}
    bends = {"road_curvature": result.drive.road.path.at(envelope.s).curvature, "expected_curvature": expected.kappa}
    bends |= {f"expected_beta{number}": beta for number, beta in enumerate(expected.beta.T, start=1)}
    reaches: dict[str, FloatArray] = {}
    for number, (left, right) in enumerate(zip(envelope.left, envelope.right, strict=True), start=1):
        reaches |= {f"left{number}": left, f"right{number}": right}
    return {name: Column(values, _COARSE[name in bends]) for name, values in (metres | bends | reaches).items()}


def steps_table(result: Result) -> Table:
    """Return the planning steps in their order: where, times [ms], iterations, status, recomputed residuals, what the last QP moved."""
    plans = result.drive.plans
    times = {name: np.array([getattr(plan.times, name) for plan in plans]) for name in ("total", "linearise", "update", "solve", "check")}
    table = {"s": _metres(result.drive.stations.s[np.array([plan.first for plan in plans], dtype=int)])}
    table |= {f"{name}_ms": Column(1e3 * seconds, "%.6f") for name, seconds in times.items()}
    table |= {name: Column(np.array([getattr(plan, of) for plan in plans])) for name, of in _COUNTS.items()}
    table |= {
        f"{side}_residual": Column(np.array([getattr(plan.residuals, side) for plan in plans]), "%.3e") for side in ("primal", "dual")
    }
    table["moved"] = Column(np.array([plan.moved for plan in plans]), "%.3e")
    return table | {"predicted_violation_m": _metres(np.array([plan.violation for plan in plans]))}


TABLES: dict[str, Callable[[Result], Table]] = {
    "path.csv": path_table, "envelope.csv": envelope_table, "profile.csv": profile_table, "steps.csv": steps_table,
}  # fmt: skip


def _metres(values: FloatArray) -> Column:
    return Column(np.round(values, 6) + 0.0, "%.6f")  # -0 is 0


def _radians(values: FloatArray) -> Column:
    return Column(np.round(values, 9) + 0.0, "%.9f")


def regions_json(regions: Sequence[Region]) -> list[dict[str, object]]:
    """Return obstacles and sweepable regions with their rings, holes after the outline, in path.csv's plane to 1 mm."""
    return [
        {
            "region": str(region.kind),
            "name": region.label,
            "rings": [np.round(ring.coords, 3).tolist() for ring in outlines_of(region.polygon)],
        }
        for region in regions
    ]


def limits_json(result: Result) -> list[Json]:
    """Return kerbs, and what was swept beyond them or in obstacles, as drawings show them, in path.csv's plane to 1 mm."""
    return [
        {
            "layer": str(drawn.layer),
            **{name: drawn.properties[name] for name in ("side", "binds", "bridged", "depth_m") if name in drawn.properties},
            "lines": [np.round(line.coords, 3).tolist() for line in outlines_of(shapely.simplify(drawn.geometry, _COARSE_M))],
        }
        for drawn in (*kerb_features(result), *conflict_features(result))
    ]


def drawn_bytes(result: Result, kind: str, fails: str = "") -> bytes:
    """Return a plan as a file of one of ``PICTURES`` or ``DRAWINGS``; ``fails``: see ``plan_figure``."""
    from hdvplan.report.plots import plan_figure  # noqa: PLC0415 - as above

    verdict = verdict_of(result)
    notes = [verdict_line(result, verdict), verdict_details(result, verdict), *filter(None, [fails]), *driven_notes(result)]
    return drawing_bytes(kind, partial(plan_figure, result, fails), partial(drawn_features, result), notes, result.drive.road)


def driven_notes(result: Result) -> list[str]:
    """Return the lines of a drawing's notes about what is driven."""
    road = result.drive.road
    return [f"road: {road.name}, {road.path.length:.1f} m", f"vehicle: {result.drive.vehicle.name}"]
