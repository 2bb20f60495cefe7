"""Write a plan's files. Each appears whole or not at all, and ``summary.json`` comes last: where it is, all are."""

from __future__ import annotations

import json
import os
from io import BytesIO
from pathlib import Path

import numpy as np
import pandas as pd

from hdvplan.report.geojson import swept_geojson
from hdvplan.report.result import Result
from hdvplan.report.summary import summary_of

PLOT_DPI = 150


def write_plan(result: Result, directory: Path, *, plot: bool) -> None:
    """Write all files of a plan into ``directory``, made if need be; without ``plot`` a former plan's picture goes.

    Raises:
        OSError: the folder or a file cannot be written.

    """
    directory.mkdir(parents=True, exist_ok=True)
    summary = directory / "summary.json"
    summary.unlink(missing_ok=True)  # a killed run must not leave it beside another plan's files
    write_atomically(directory / "path.csv", csv_bytes(path_table(result)))
    write_atomically(directory / "envelope.csv", csv_bytes(envelope_table(result)))
    write_atomically(directory / "swept.geojson", json_bytes(swept_geojson(result), indent=None))
    picture = directory / "plan.png"
    if plot:
        write_atomically(picture, png_bytes(result))
    else:
        picture.unlink(missing_ok=True)
    write_atomically(summary, json_bytes(summary_of(result)))


def path_table(result: Result) -> pd.DataFrame:
    """Return the executed path, one row a station: s, x, y, heading, e_y, e_psi, beta1, ..., kappa, K [m, rad, 1/m].

    x, y and heading (continuous) are the lead unit's rear axle in the plane; row i's kappa is held to row i + 1, and the
    last row repeats the last one. K is the geometric weight of the road's curvature there.
    """
    drive = result.drive
    n = len(drive.z)
    s = drive.stations.s[:n]
    x, y = drive.stations.path.to_plane(s, drive.z[:, 0])
    heading = np.unwrap(drive.stations.path.at(s).heading) + drive.z[:, 1]
    columns = {"s": s, "x": x, "y": y, "heading": heading, "e_y": drive.z[:, 0], "e_psi": drive.z[:, 1]}
    columns |= {f"beta{i}": beta for i, beta in enumerate(drive.z[:, 2:].T, start=1)}
    columns |= {"kappa": np.append(drive.kappa, drive.kappa[-1]), "K": drive.stations.centering.weight[:n]}
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
            "expected_left": result.expected.half_width,
            "expected_right": -result.expected.half_width,
            "needed_width": 2.0 * result.expected.half_width,
        }
    )


def csv_bytes(table: pd.DataFrame) -> bytes:
    """Return a table as CSV whose numbers read back exactly; missing ones are empty."""
    return table.to_csv(index=False, lineterminator="\n").encode()


def json_bytes(value: object, *, indent: int | None = 2) -> bytes:
    """Return JSON in UTF-8 with a newline at its end.

    Raises:
        ValueError: a number is not finite, which JSON cannot say.

    """
    return (json.dumps(value, indent=indent, ensure_ascii=False, allow_nan=False) + "\n").encode()


def png_bytes(result: Result) -> bytes:
    """Return the picture of a plan."""
    from hdvplan.report.plots import plan_figure  # noqa: PLC0415 - Matplotlib takes half a second to import

    buffer = BytesIO()
    plan_figure(result).savefig(buffer, format="png", dpi=PLOT_DPI)
    return buffer.getvalue()


def write_atomically(path: Path, content: bytes) -> None:
    """Replace ``path`` by ``content`` at once, so that no reader and no crash sees half a file.

    Raises:
        OSError: the file cannot be written.

    """
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        partial.write_bytes(content)
        partial.replace(path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
