"""Plan one stretch and judge its core: what goes back to the process that joins is small, and is the whole road's."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hdvplan.api import drive_case
from hdvplan.arrays import FloatArray
from hdvplan.errors import HdvplanError, PlanError, RoadError, SolverError
from hdvplan.fileio import table_bytes
from hdvplan.judging.bodies import corners, pose_at
from hdvplan.judging.result import Result, result_of
from hdvplan.judging.verdict import verdict_of
from hdvplan.passing.sides import choose_sides
from hdvplan.report.files import envelope_table, path_table, profile_table, regions_json, steps_table
from hdvplan.report.geojson import swept_geojson
from hdvplan.report.summary import smoothing_of, summary_of, verdict_json
from hdvplan.stretches.clipping import clipped
from hdvplan.stretches.cutting import Stretch

_PLACES = {"s_m", "s_from", "s_to", "s_deepest", "s_from_m", "s_to_m", "s_worst_m", "max_deviation_s_m", "max_curvature_s_m"}
_LISTS = {"nearly_all", "lock_to_lock", "failed_steps"}  # of arclengths, or pairs of them
TABLES = {"path.csv": path_table, "envelope.csv": envelope_table, "profile.csv": profile_table, "steps.csv": steps_table}
_ENDS = {"path.csv", "envelope.csv", "profile.csv"}  # whose last row is the first of the next stretch

Json = dict[str, Any]


@dataclass(frozen=True)
class Kept:
    """What is kept of a judged stretch until all are joined: a summary as of a road of its own, at arclengths of the whole road.

    ``times`` are those of its planning steps [s], measured in the process ``process``. ``enters`` and ``leaves`` are the corners of all
    bodies where its core begins and ends, shape (units, 4, 2), x, y [m].
    """

    key: str  # of its case
    summary: Json
    obstacles: dict[bytes, Json]  # nearest approaches, by the obstacles' outlines
    regions: dict[bytes, Json]  # all regions beside it, likewise
    times: FloatArray
    process: int
    enters: FloatArray
    leaves: FloatArray


@dataclass(frozen=True)
class Judged:
    """A stretch that was planned: what is kept of it, and what is written at once."""

    kept: Kept
    headers: dict[str, bytes]  # of the files of ``TABLES``, and
    rows: dict[str, bytes]  # what lies below them
    features: list[Json]  # of swept.geojson


def planned(stretch: Stretch) -> Result:
    """Plan a stretch from the begin of its run-in, and judge its core; arclengths count from the begin of that.

    Raises:
        HdvplanError: what ``hdvplan.plan`` raises; ``s_m`` is the whole road's.

    """
    case = stretch.case
    with _counted_from(stretch.begins):
        road, passed = choose_sides(case)
        driven = drive_case(replace(case, road=road))
    here = [one for one in passed if stretch.core[0] <= 0.5 * (one.s_from + one.s_to) < stretch.core[1]]
    moved = tuple(replace(one, s_from=one.s_from - stretch.core[0], s_to=one.s_to - stretch.core[0]) for one in here)
    with _counted_from(stretch.core_begins):
        return result_of(clipped(driven, *stretch.core), solver=case.solver, objective=case.objective, passed=moved)


def kept_of(result: Result, stretch: Stretch) -> Kept:
    """Return what is kept of a judged stretch."""
    drive, summary = result.drive, _summary(result, stretch)
    ends = corners(drive, np.array([pose_at(drive, 0.0), pose_at(drive, drive.road.path.length)]))
    outlines = [one.obstacle.polygon.wkb for one in result.approaches]
    obstacles = dict(zip(outlines, summary.pop("obstacles"), strict=True))
    regions = dict(zip([one.polygon.wkb for one in drive.road.regions], regions_json(drive.road), strict=True))
    times = np.array([plan.times.total for plan in drive.plans])
    return Kept(stretch.case.key, summary, obstacles, regions, times, os.getpid(), ends[0], ends[1])


def judged(stretch: Stretch) -> Judged:
    """Plan a stretch as ``planned``, and return it as it is written and joined."""
    result = planned(stretch)
    parts = {name: _rows(result, name, stretch).partition(b"\n") for name in TABLES}
    features = swept_geojson(result)["features"]
    assert isinstance(features, list)  # noqa: S101 - for the type checker
    headers = {name: header + end for name, (header, end, _) in parts.items()}
    return Judged(kept_of(result, stretch), headers, {name: rows for name, (_, _, rows) in parts.items()}, features)


@contextmanager
def _counted_from(begins: float) -> Iterator[None]:
    """Let errors in the block have the whole road's arclengths: theirs count from ``begins`` [m], which a message that has one says."""
    try:
        yield
    except HdvplanError as error:
        moved = copy(error)
        if isinstance(moved, RoadError | PlanError | SolverError) and moved.s_m is not None:
            moved.s_m += begins
        elif "s = " not in str(error):
            raise
        moved.args = (f"{error}; this s counts from {begins:.0f} m along the road",)
        raise moved from error


def _rows(result: Result, name: str, stretch: Stretch) -> bytes:
    """Return the rows of one table of the core, at the whole road's arclengths and headings."""
    table = dict(TABLES[name](result))
    table["s"] = replace(table["s"], content=np.round(table["s"].content + stretch.core_begins, 6))
    if "heading" in table:
        full = 2.0 * np.pi * np.round((stretch.turned - float(result.drive.road.path.at(0.0).heading)) / (2.0 * np.pi))
        table["heading"] = replace(table["heading"], content=np.round(table["heading"].content + full, 9))
    if name in _ENDS and not stretch.last:
        table = {title: replace(column, content=column.content[:-1]) for title, column in table.items()}
    return table_bytes(table)


def _summary(result: Result, stretch: Stretch) -> Json:
    """Return the core's summary at the whole road's arclengths."""
    by = stretch.core_begins
    summary = _moved(summary_of(result), by)
    assert isinstance(summary, dict)  # noqa: S101 - for the type checker
    verdict = verdict_of(result)
    summary["verdict"] = verdict_json(result, replace(verdict, s=verdict.s + by))
    summary["smoothing"] = smoothing_of(replace(result.drive.road, smoothing=stretch.smoothing))
    return summary


def _moved(value: object, by: float, key: str = "") -> object:
    """Return a value of a summary with every arclength in it moved by ``by`` [m]."""
    match value:
        case dict():
            return {name: _moved(one, by, name) for name, one in value.items()}
        case list():
            return [_moved(one, by, key) for one in value]
        case float() if key in _PLACES | _LISTS:
            return value + by
    return value
