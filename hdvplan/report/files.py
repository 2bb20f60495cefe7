"""Write a plan's files. Each appears whole or not at all, and ``summary.json`` comes last: where it is, all are."""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from hdvplan.fileio import csv_bytes, json_bytes, write_atomically
from hdvplan.jit import FloatArray
from hdvplan.judging.result import Result
from hdvplan.record import NAME, record_of
from hdvplan.report.geojson import swept_geojson
from hdvplan.report.summary import summary_of
from hdvplan.road.road import Road

PICTURES = ("png", "pdf", "svg")
FILM = "drive.gif"


def write_plan(
    result: Result,
    directory: Path,
    *,
    pictures: Collection[str] = (),
    animate: bool = False,
    on_progress: Callable[[float], None] | None = None,
) -> None:
    """Write all files of a plan into ``directory``, made if need be; a former plan's pictures that are not asked for go.

    ``pictures`` are the formats of the picture, of ``PICTURES``; ``animate`` adds the drive as a film. ``on_progress``
    receives the written share, 0 to 1.

    Raises:
        OSError: the folder or a file cannot be written.

    """
    directory.mkdir(parents=True, exist_ok=True)
    summary = directory / "summary.json"
    summary.unlink(missing_ok=True)  # a killed run must not leave it beside another plan's files
    for former in (*(directory / f"plan.{kind}" for kind in PICTURES), directory / FILM):
        former.unlink(missing_ok=True)
    contents: dict[str, Callable[[], bytes]] = {
        "path.csv": lambda: csv_bytes(path_table(result)),
        "envelope.csv": lambda: csv_bytes(envelope_table(result)),
        "profile.csv": lambda: csv_bytes(profile_table(result)),
        "steps.csv": lambda: csv_bytes(steps_table(result)),
        "regions.json": lambda: json_bytes(regions_json(result.drive.road), indent=None),
        "swept.geojson": lambda: json_bytes(swept_geojson(result), indent=None),
        NAME: lambda: json_bytes(record_of([result.case])),
    }
    contents |= {f"plan.{kind}": partial(picture_bytes, result, kind) for kind in pictures}
    if animate:
        contents[FILM] = partial(_film, result)
    for number, (name, content) in enumerate(contents.items(), start=1):
        write_atomically(directory / name, content())
        if on_progress is not None:
            on_progress(number / (len(contents) + 1))
    write_atomically(summary, json_bytes(summary_of(result)))


def path_table(result: Result) -> pd.DataFrame:
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
    columns = {"s": s, "x": x, "y": y, "heading": heading, "e_y": drive.z[:, 0], "e_psi": drive.z[:, 1]}
    columns |= {f"beta{i}": beta for i, beta in enumerate(drive.z[:, 2 : drive.vehicle.rigid_states].T, start=1)}
    columns |= {f"steering{i}": angle for i, angle in enumerate(drive.steering.T, start=1)}
    columns |= {"kappa": np.append(drive.kappa, drive.kappa[-1]), "K": drive.stations.centring.weight[:n]}
    return pd.DataFrame(columns)


def envelope_table(result: Result) -> pd.DataFrame:
    """Return signed reaches over s [m]: s, left, right, their limits (empty without), the geometric expectation, and its width."""
    envelope, limits = result.envelope, result.drive.road.limits
    none = np.full(len(envelope.s), np.nan)
    left_limit, right_limit = (none, none) if limits is None else limits.table(envelope.s)[:2]
    return pd.DataFrame(
        {
            "s": envelope.s,
            "left": envelope.reach_left,
            "right": envelope.reach_right,
            "left_limit": left_limit,
            "right_limit": right_limit,
            "expected_left": result.aim + result.expected.half_width,
            "expected_right": result.aim - result.expected.half_width,
            "needed_width": 2.0 * result.expected.half_width,
        }
    )


def profile_table(result: Result) -> pd.DataFrame:
    """Return what a drawing needs over the envelope's arclengths and the envelope's table has not, rounded to 1e-4 m, 1e-6 1/m.

    s, least clearance to any limit and the limits of overhangs (empty without) [m], curvature of the road and of the balanced
    driving [1/m], its articulations expected_beta1, ... [rad], left and right reach of each body: left1, right1, left2, ...
    (empty where a body never was) [m].
    """
    envelope, limits, expected = result.envelope, result.drive.road.limits, result.expected
    none = np.full(len(envelope.s), np.nan)
    left_sweep, right_sweep = (none, none) if limits is None else limits.table(envelope.s)[2:]
    clearance = none if result.clearance is None else result.clearance
    metres = {"s": envelope.s, "clearance": clearance, "left_sweep_limit": left_sweep, "right_sweep_limit": right_sweep}
    bends = {"road_curvature": result.drive.road.path.at(envelope.s).curvature, "expected_curvature": expected.kappa}
    bends |= {f"expected_beta{number}": beta for number, beta in enumerate(expected.beta.T, start=1)}
    reaches: dict[str, FloatArray] = {}
    for number, (left, right) in enumerate(zip(envelope.left, envelope.right, strict=True), start=1):
        reaches |= {f"left{number}": left, f"right{number}": right}
    return pd.concat([pd.DataFrame(metres).round(4), pd.DataFrame(bends).round(6), pd.DataFrame(reaches).round(4)], axis=1)


def steps_table(result: Result) -> pd.DataFrame:
    """Return the planning steps in their order: where, their times [ms], iterations, status and recomputed residuals."""
    drive = result.drive
    rows = [
        {
            "s": drive.stations.s[plan.first],
            "total_ms": 1e3 * plan.times.total,
            "linearise_ms": 1e3 * plan.times.linearise,
            "update_ms": 1e3 * plan.times.update,
            "solve_ms": 1e3 * plan.times.solve,
            "check_ms": 1e3 * plan.times.check,
            "qps": plan.qp_count,
            "qp_iterations": plan.qp_iterations,
            "status": str(plan.status),
            "usable": plan.usable,
            "primal_residual": plan.residuals.primal,
            "dual_residual": plan.residuals.dual,
            "predicted_violation_m": plan.violation,
        }
        for plan in drive.plans
    ]
    return pd.DataFrame(rows).round({name: 6 for name in rows[0] if name.endswith("_ms")})


def regions_json(road: Road) -> list[dict[str, object]]:
    """Return the road's obstacles and sweepable regions with their rings, holes after the outline, in path.csv's plane to 1 mm."""
    return [
        {
            "region": str(region.kind),
            "name": region.label,
            "rings": [np.round(ring.coords, 3).tolist() for ring in (region.polygon.exterior, *region.polygon.interiors)],
        }
        for region in road.regions
    ]


def picture_bytes(result: Result, kind: str) -> bytes:
    """Return the picture of a plan as a file of one of ``PICTURES``."""
    from hdvplan.report.plots import plan_figure  # noqa: PLC0415 - Matplotlib takes half a second to import
    from hdvplan.report.style import figure_bytes  # noqa: PLC0415 - as above

    return figure_bytes(plan_figure(result), kind)


def _film(result: Result) -> bytes:
    from hdvplan.report.animation import film_bytes  # noqa: PLC0415 - as above

    return film_bytes(result)
