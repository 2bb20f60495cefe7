"""From samples to tables: pure functions over data frames, so that what the tables say can be tested on made-up numbers.

A drive's first plan is made from nothing, iterated to convergence whatever the scheme; it is the cold start, has its own
column, and is no part of the other statistics. ``fastest``: every step counts with its fastest round. That is what the
planner needs; mean, percentiles and max are what it took, with whatever else the machine did.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from hdvplan.bench.samples import FAILED, OK, Judgement, Measurement
from hdvplan.bench.suite import Cell
from hdvplan.qp.workspace import Status

KEY = ["road", "vehicle", "scheme", "solver"]
SOME_UNSOLVED = "some steps not solved"
_PARTS = ("linearise", "update", "solve", "check")
REFERENCE = "riccati"  # if it takes part; else the first solver


@dataclass(frozen=True)
class Tables:
    """All tables of a benchmark; columns carry their units."""

    samples: pd.DataFrame  # one row a planning step
    timing: pd.DataFrame  # one row a cell
    envelope: pd.DataFrame  # one row a cell
    schemes: pd.DataFrame  # RTI against SQP: one row a road, vehicle and solver
    summary: pd.DataFrame  # one row a vehicle, scheme and solver, over all roads


def tables_of(cells: Sequence[Cell], rounds: Sequence[Sequence[Measurement]]) -> Tables:
    """Return the tables of a benchmark; ``rounds[i]`` are the measurements of ``cells[i]``."""
    samples = samples_of(cells, rounds)
    timing, envelope = timing_table(samples, cells, rounds), envelope_table(cells, [measured[0].judgement for measured in rounds])
    judged = dict(zip(cells, (measured[0].judgement for measured in rounds), strict=True))
    return Tables(samples, timing, envelope, scheme_table(timing, judged), summary_table(samples, timing, envelope))


def key_of(cell: Cell) -> tuple[str, str, str, str]:
    """Return a cell as the tables name it, in the order of ``KEY``."""
    return cell.road, cell.vehicle, str(cell.scheme), cell.solver


def samples_of(cells: Sequence[Cell], rounds: Sequence[Sequence[Measurement]]) -> pd.DataFrame:
    """Return every planning step of every drive: road, vehicle, scheme, solver, round, step, times, counters, residuals."""
    tables = []
    for cell, measured in zip(cells, rounds, strict=True):
        for number, drive in enumerate(measured):
            table = drive.table()
            table.insert(0, "round", number)
            for name, value in zip(reversed(KEY), reversed(key_of(cell)), strict=True):
                table.insert(0, name, value)
            tables.append(table)
    return pd.concat(tables, ignore_index=True)


def timing_table(samples: pd.DataFrame, cells: Sequence[Cell], rounds: Sequence[Sequence[Measurement]]) -> pd.DataFrame:
    """Return time, iterations, failures and residuals of every cell, in the order of ``cells``."""
    groups = dict(tuple(samples.groupby(KEY, sort=False)))
    rows = []
    for cell, measured in zip(cells, rounds, strict=True):
        statistics = step_statistics(groups.get(key_of(cell), samples.iloc[:0]))
        statistics["failures"] += sum(drive.outcome == FAILED for drive in measured)
        rows.append(
            dict(zip(KEY, key_of(cell), strict=True))
            | {"status": status_of(measured), "rounds": len(measured)}
            | statistics
            | {"nonzeros": measured[0].nonzeros, "message": next((drive.message for drive in measured if drive.message), "")}
        )
    return pd.DataFrame(rows)


def status_of(measured: Sequence[Measurement]) -> str:
    """Return how a cell went: the first drive that did not reach its end decides, then steps without a usable solution."""
    for drive in measured:
        if drive.outcome != OK:
            return drive.outcome
    usable = all(bool(drive.table()["usable"].all()) for drive in measured)
    return OK if usable else SOME_UNSOLVED


def step_statistics(samples: pd.DataFrame) -> dict[str, float]:
    """Return the statistics of steps of one or several drives [ms]; NaN where there is no step but the first."""
    warm, cold = samples[samples["step"] > 0], samples[samples["step"] == 0]
    total = 1e3 * warm["total_s"]
    fastest = 1e3 * warm.groupby([*KEY, "step"], sort=False)["total_s"].min()
    p50, p95, p99 = np.percentile(total, [50, 95, 99]) if len(total) else (np.nan, np.nan, np.nan)
    row: dict[str, float] = {
        "steps": len(warm),
        "failures": int((~samples["usable"]).sum()),
        "unsolved": int((samples["status"] != Status.SOLVED).sum()),
        "mean_ms": total.mean(),
        "p50_ms": p50,
        "p95_ms": p95,
        "p99_ms": p99,
        "max_ms": total.max(),
        "fastest_mean_ms": fastest.mean(),
        "fastest_max_ms": fastest.max(),
        "cold_ms": 1e3 * cold["total_s"].mean(),
    }
    row |= {f"{part}_ms": 1e3 * warm[f"{part}_s"].mean() for part in _PARTS}
    for name, column in (("qps", "qp_count"), ("iterations", "iterations")):
        counts = warm[column].replace(0, np.nan)  # a solver that reports no iterations has none to show
        row |= {f"{name}_mean": counts.mean(), f"{name}_max": counts.max()}
    return row | {"primal_max": samples["primal"].max(skipna=False)}


def envelope_table(cells: Sequence[Cell], judged: Sequence[Judgement | None]) -> pd.DataFrame:
    """Return the envelope balance of every cell; NaN where the drive did not reach its end.

    ``path_difference_m`` is the largest difference of the executed e_y from the reference solver's under the same scheme.
    """
    known = dict(zip(cells, judged, strict=True))
    reference = reference_solver([cell.solver for cell in cells])
    rows = []
    for cell, judgement in known.items():
        row: dict[str, object] = dict(zip(KEY, key_of(cell), strict=True))
        if judgement is not None:
            like = known.get(Cell(cell.road, cell.vehicle, cell.scheme, reference))
            row |= {
                "max_left_m": judgement.max_left,
                "max_right_m": judgement.max_right,
                "imbalance_m": judgement.max_left - judgement.max_right,
                "mean_abs_imbalance_m": judgement.mean_abs_imbalance,
                "expected_half_width_m": judgement.expected_half_width,
                "min_clearance_m": judgement.min_clearance,
                "limit_violation_m": judgement.violation,
                "path_difference_m": np.nan if like is None else float(np.max(np.abs(judgement.e_y - like.e_y))),
            }
        rows.append(row)
    names = (
        "max_left_m", "max_right_m", "imbalance_m", "mean_abs_imbalance_m", "expected_half_width_m", "min_clearance_m",
        "limit_violation_m", "path_difference_m",
    )  # fmt: skip
    return pd.DataFrame(rows, columns=[*KEY, *names])


def reference_solver(solvers: Sequence[str]) -> str:
    """Return the solver whose paths the others' are compared with."""
    return REFERENCE if REFERENCE in solvers else solvers[0]


def scheme_table(timing: pd.DataFrame, judged: dict[Cell, Judgement | None]) -> pd.DataFrame:
    """Return how much longer SQP takes than RTI, on average and at worst, and how far their executed envelopes differ.

    Every step counts with its fastest round. One row a road, vehicle and solver that has both schemes.
    """
    pair = ["road", "vehicle", "solver"]
    times = timing[[*KEY, "fastest_mean_ms", "fastest_max_ms"]].rename(columns=lambda name: name.removeprefix("fastest_"))
    rti, sqp = (times[times["scheme"] == scheme].drop(columns="scheme") for scheme in ("rti", "sqp"))
    both = rti.merge(sqp, on=pair, suffixes=("_rti", "_sqp"))
    swept = {key_of(cell): judgement for cell, judgement in judged.items()}
    return pd.DataFrame(
        {
            **both[pair],
            "rti_mean_ms": both["mean_ms_rti"],
            "sqp_mean_ms": both["mean_ms_sqp"],
            "mean_ratio": both["mean_ms_sqp"] / both["mean_ms_rti"],
            "rti_max_ms": both["max_ms_rti"],
            "sqp_max_ms": both["max_ms_sqp"],
            "max_ratio": both["max_ms_sqp"] / both["max_ms_rti"],
            "envelope_difference_m": [
                envelope_difference(swept[road, vehicle, "rti", solver], swept[road, vehicle, "sqp", solver])
                for road, vehicle, solver in both[pair].itertuples(index=False, name=None)
            ],
        }
    )


def envelope_difference(one: Judgement | None, other: Judgement | None) -> float:
    """Return the largest difference of two envelopes' reaches, left or right [m]; NaN where one is missing."""
    if one is None or other is None:
        return float("nan")
    return float(max(np.max(np.abs(one.left - other.left)), np.max(np.abs(one.right - other.right))))


def summary_table(samples: pd.DataFrame, timing: pd.DataFrame, envelope: pd.DataFrame) -> pd.DataFrame:
    """Return one row a vehicle, scheme and solver: all steps of all roads together, the worst of everything else."""
    group = ["vehicle", "scheme", "solver"]
    steps = dict(tuple(samples.groupby(group, sort=False)))
    rows = []
    for key, cells in timing.merge(envelope, on=KEY).groupby(group, sort=False):
        rows.append(
            dict(zip(group, cells[group].iloc[0], strict=True))
            | step_statistics(steps.get(key, samples.iloc[:0]))
            | {
                "failures": int(cells["failures"].sum()),
                "cells": len(cells),
                "cells_ok": int((cells["status"] == OK).sum()),
                "limit_violation_m": cells["limit_violation_m"].max(),
                "path_difference_m": cells["path_difference_m"].max(),
            }
        )
    return pd.DataFrame(rows)
