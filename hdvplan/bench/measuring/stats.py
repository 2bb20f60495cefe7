"""From samples to tables: pure functions over data frames, so that the tables can be tested with invented numbers.

A drive's first plan has no warm start and is iterated to convergence with any scheme; it is the cold start, has its own
column, and is no part of the other statistics. ``fastest``: every step counts with its fastest round. That is what the
planner needs; mean, percentiles and max are what it took, with whatever else the machine did.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from hdvplan.arrays import BoolArray
from hdvplan.bench.measuring.ranking import of_group, ranked_times, ranking, shifted_mean
from hdvplan.bench.measuring.referee import TUNED, WRONG_M, accepted, remembers
from hdvplan.bench.measuring.samples import FAILED, OK, OVER_BUDGET, UNFAIR, WRONG, WRONG_PATH, Judgement, Measurement
from hdvplan.bench.suite import COURSE, GROUP, KEY, Cell, key_of
from hdvplan.qp.workspace import Status

SOME_UNSOLVED, SOME_REFUSED = "some steps not solved", "some steps not accepted"
_PARTS = ("linearise", "update", "solve", "check")
REFERENCE = "riccati"  # if it takes part; else the first solver


@dataclass(frozen=True)
class Tables:
    """All tables of a benchmark; columns carry their units."""

    samples: pd.DataFrame  # one row a planning step
    timing: pd.DataFrame  # one row a cell
    envelope: pd.DataFrame  # one row a cell
    schemes: pd.DataFrame  # RTI against SQP: one row a road, vehicle, solver and class of limits
    summary: pd.DataFrame  # one row a vehicle, scheme, class of limits and solver, over all roads; the fastest first


def tables_of(cells: Sequence[Cell], rounds: Sequence[Sequence[Measurement]], accuracy: float | None = None) -> Tables:
    """Return the tables of a benchmark; ``rounds[i]`` are the measurements of ``cells[i]``, held to ``accuracy`` [m] if it is given."""
    samples = samples_of(cells, rounds, accuracy)
    envelope = envelope_table(cells, rounds, accuracy)
    timing = timing_table(samples, cells, rounds, envelope, accuracy)
    judged = dict(zip(cells, (measured[0].judgement for measured in rounds), strict=True))
    return Tables(samples, timing, envelope, scheme_table(timing, judged), summary_table(samples, timing, envelope))


def samples_of(cells: Sequence[Cell], rounds: Sequence[Sequence[Measurement]], accuracy: float | None = None) -> pd.DataFrame:
    """Return every planning step of every drive: road, vehicle, scheme, solver, limits, round, step, times, counters, residuals.

    ``accepted`` is decided by recomputed residuals, beside multipliers of the scale that the reference found in the judged round;
    where the reference has no proof itself a step counts as accepted that could be driven. With ``accuracy`` [m] the distance from the
    reference's optimum decides.
    """
    tables = []
    for cell, measured in zip(cells, rounds, strict=True):
        for number, drive in enumerate(measured):
            table = drive.table()
            table["accepted"] = accepted_steps(table, measured[0].table(), accuracy)
            table.insert(0, "round", number)
            for name, value in zip(reversed(KEY), reversed(key_of(cell)), strict=True):
                table.insert(0, name, value)
            tables.append(table)
    return pd.concat(tables, ignore_index=True)


def accepted_steps(table: pd.DataFrame, judged: pd.DataFrame, accuracy: float | None) -> BoolArray:
    """Return which steps of one drive are accepted; ``judged`` is the drive of its cell that was judged."""
    scale, distance = (judged[name].reindex(table.index).to_numpy(np.float64) for name in ("scale", "distance_m"))
    primal, dual, gap = (table[name].to_numpy(np.float64) for name in ("primal", "dual", "gap"))
    proved = accepted(primal, dual, gap, scale) == 1.0 if accuracy is None else distance <= TUNED * accuracy
    usable: BoolArray = table["usable"].to_numpy(np.bool_)
    return np.asarray(usable & (np.isnan(scale) | proved), np.bool_)


def timing_table(
    samples: pd.DataFrame,
    cells: Sequence[Cell],
    rounds: Sequence[Sequence[Measurement]],
    envelope: pd.DataFrame,
    accuracy: float | None = None,
) -> pd.DataFrame:
    """Return time, iterations, failures and residuals of every cell, in the order of ``cells``, whose ``envelope_table`` is given."""
    trusted = any(cell.solver == REFERENCE for cell in cells)
    groups = dict(tuple(samples.groupby(KEY, sort=False)))
    most = samples[samples["round"] == 0].groupby(KEY, sort=False).size().groupby(COURSE).max()
    rows = []
    for cell, measured, apart in zip(cells, rounds, envelope["path_difference_m"], strict=True):
        mine = groups.get(key_of(cell), samples.iloc[:0])
        statistics = step_statistics(mine)
        statistics["failures"] += sum(drive.outcome == FAILED for drive in measured)
        status, reason = status_of(measured, accuracy, float(apart) if trusted else np.nan)
        reached = len(measured[0].steps)
        whole = reached if status == OVER_BUDGET else most.get((cell.road, cell.vehicle, str(cell.scheme), cell.limits), 0)
        whole = max(whole, reached + 1) if measured[0].outcome not in {OK, OVER_BUDGET} else whole  # the step in which it ended
        first, every = mine[mine["round"] == 0], mine.groupby("step")["accepted"].all()
        good = every.reindex(first["step"]).sum()  # in every round
        rows.append(
            dict(zip(KEY, key_of(cell), strict=True))
            | {"status": status, "rounds": len(measured)}
            | statistics
            | {
                "accepted": int(good),
                "expected": int(whole),
                "success": good / whole if whole else 0.0,
                "distance_m": first["distance_m"].max(),
                "distance_u": first["distance_u"].max(),
                "nonzeros": measured[0].nonzeros,
                "message": reason,
            }
        )
    return pd.DataFrame(rows)


def status_of(measured: Sequence[Measurement], accuracy: float | None = None, apart: float = np.nan) -> tuple[str, str]:
    """Return how a cell went, and why: the first drive that did not reach its end decides, then what its steps are worth.

    ``apart`` is how far the executed path lies from the reference's [m], NaN where that is not known.
    """
    for drive in measured:
        if drive.outcome != OK:
            return drive.outcome, drive.message
    tables = [drive.table() for drive in measured]
    judged, count = tables[0], sum(map(len, tables))
    if refused := sum(int((~table["usable"]).sum()) for table in tables):
        return SOME_UNSOLVED, f"{refused} of {count} steps break their program by too much to be driven"
    if remembers([drive.steps for drive in measured]):
        return UNFAIR, "the solver remembers answers: the programs of its first round take it a fraction of the time when asked again"
    another = max(WRONG_M, TUNED * (accuracy or 0.0))
    wrong = int((judged["distance_m"] > another).sum())
    if wrong:
        return WRONG, f"{wrong} of {len(judged)} optima lie up to {judged['distance_m'].max():.1e} m from the reference's"
    bad = pd.concat([table[~accepted_steps(table, judged, accuracy)] for table in tables])
    if len(bad):
        words, scale = "are not proved optimal by their multipliers; the first: ", judged["scale"][bad.index[0]]
        first = f"dual residual {bad['dual'].iloc[0]:.1e}, gap {bad['gap'].iloc[0]:.1e}, multipliers up to {scale:.1e}"
        if accuracy is not None:
            words, first = f"lie further than {TUNED * accuracy:g} m from the optimum; at most ", f"{bad['distance_m'].max():.1e} m"
        return SOME_REFUSED, f"{len(bad)} of {count} steps {words}{first}"
    return (WRONG_PATH, f"its path lies up to {apart:.1e} m from that of {REFERENCE}") if apart > another else (OK, "")


def step_statistics(samples: pd.DataFrame) -> dict[str, float]:
    """Return the statistics of steps of one or several drives [ms]; NaN where there is no step but the first.

    ``step_ms``, ``median_ms`` and ``worst_ms``, by which solvers are ranked, are of accepted steps alone: NaN without any.
    """
    distinct = ranked_times(samples)
    ranked = distinct.loc[distinct["accepted"].astype(bool), "ms"]
    warm, cold = samples[samples["step"] > 0], samples[samples["step"] == 0]
    total = 1e3 * warm["total_s"]
    fastest = 1e3 * warm.groupby([*KEY, "step"], sort=False)["total_s"].min()
    p50, p95, p99, rarest = np.percentile(total, [50, 95, 99, 99.99]) if len(total) else 4 * (np.nan,)
    row: dict[str, float] = {
        "steps": len(warm),
        "failures": int((~samples["usable"]).sum()),
        "unsolved": int((samples["status"] != Status.SOLVED).sum()),
        "distinct_steps": len(distinct),
        "step_ms": shifted_mean(ranked),
        "median_ms": ranked.median(),
        "worst_ms": ranked.max(),
        "mean_ms": total.mean(),
        "p50_ms": p50,
        "p95_ms": p95,
        "p99_ms": p99,
        "p99_99_ms": rarest,
        "max_ms": total.max(),
        "fastest_mean_ms": fastest.mean(),
        "fastest_max_ms": fastest.max(),
        "cold_ms": 1e3 * (cold["total_s"] if len(cold) else warm["cold_s"]).mean(),
    }
    row |= {f"{part}_ms": 1e3 * warm[f"{part}_s"].mean() for part in _PARTS}
    for name, column in (("qps", "qp_count"), ("iterations", "iterations")):
        counts = warm[column].replace(0, np.nan)  # a solver that reports no iterations has none to show
        row |= {f"{name}_mean": counts.mean(), f"{name}_max": counts.max()}
    cpu = 1e3 * warm["cpu_s"]
    row |= {"cpu_ms": cpu.mean(), "wall_per_cpu": total.sum() / cpu.sum() if cpu.sum() > 0.0 else np.nan}
    row |= {"binding_share": warm["binding"].mean(), "binding_ms": 1e3 * warm.loc[warm["binding"], "cpu_s"].mean()}
    return row | {"primal_max": samples["primal"].max(skipna=False)}


def envelope_table(cells: Sequence[Cell], rounds: Sequence[Sequence[Measurement]], accuracy: float | None = None) -> pd.DataFrame:
    """Return the envelope balance of every cell; NaN where the drive did not reach its end.

    ``path_difference_m`` is the largest difference of the executed e_y from the reference solver's under the same scheme; NaN where that
    cell is not ok, a path that is wrong measures none, and of a cell with steps that cannot be driven or with wrong optima: its path is
    that of the last plan, or of a later iteration.
    """
    drives = dict(zip(cells, rounds, strict=True))
    known = {cell: measured[0].judgement for cell, measured in drives.items()}
    reference = reference_solver([cell.solver for cell in cells])
    sound = {cell for cell, measured in drives.items() if cell.solver == reference and status_of(measured, accuracy)[0] == OK}
    rows = []
    for cell, judgement in known.items():
        own = status_of(drives[cell], accuracy)[0] not in {SOME_UNSOLVED, WRONG}
        like = known[other] if own and (other := replace(cell, solver=reference)) in sound else None
        rows.append(dict(zip(KEY, key_of(cell), strict=True)) | _swept(judgement, like))
    return pd.DataFrame(rows)


_SWEPT = (
    "max_left_m", "max_right_m", "imbalance_m", "mean_abs_imbalance_m", "expected_half_width_m", "min_clearance_m",
    "limit_violation_m", "path_difference_m",
)  # fmt: skip


def _swept(own: Judgement | None, like: Judgement | None) -> dict[str, float]:
    if own is None:
        return dict.fromkeys(_SWEPT, np.nan)
    apart = np.nan if like is None else float(np.max(np.abs(own.e_y - like.e_y)))
    imbalance = own.max_left - own.max_right
    swept = own.max_left, own.max_right, imbalance, own.mean_abs_imbalance, own.expected_half_width, own.min_clearance, own.violation
    return dict(zip(_SWEPT, (*swept, apart), strict=True))


def reference_solver(solvers: Sequence[str]) -> str:
    """Return the solver whose paths the others' are compared with."""
    return REFERENCE if REFERENCE in solvers else solvers[0]


def scheme_table(timing: pd.DataFrame, judged: dict[Cell, Judgement | None]) -> pd.DataFrame:
    """Return how much longer SQP takes than RTI, on average and at worst, and how far their executed envelopes differ.

    Every step counts with its fastest round. One row a road, vehicle and solver that has both schemes.
    """
    pair = ["road", "vehicle", "solver", "limits"]
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
                envelope_difference(swept[road, vehicle, "rti", solver, limits], swept[road, vehicle, "sqp", solver, limits])
                for road, vehicle, solver, limits in both[pair].itertuples(index=False, name=None)
            ],
        }
    )


def envelope_difference(one: Judgement | None, other: Judgement | None) -> float:
    """Return the largest difference of two envelopes' reaches, left or right [m]; NaN where one is missing."""
    if one is None or other is None:
        return float("nan")
    return float(max(np.max(np.abs(one.left - other.left)), np.max(np.abs(one.right - other.right))))


def summary_table(samples: pd.DataFrame, timing: pd.DataFrame, envelope: pd.DataFrame) -> pd.DataFrame:
    """Return one row a vehicle, scheme, class of limits and solver: all steps of all roads together, the worst of everything else.

    Solvers that did all steps come first, the fastest at the top; ``ratio`` is to the fastest, over the steps that both did, and
    ``won`` the share of steps in which a solver was the fastest of those with all steps accepted.
    """
    by_solver = [*GROUP, "solver"]
    steps, ranked = dict(tuple(samples.groupby(by_solver, sort=False))), ranked_times(samples)
    rows = []
    for key, cells in timing.merge(envelope, on=KEY).groupby(by_solver, sort=False):
        rows.append(
            dict(zip(by_solver, cells[by_solver].iloc[0], strict=True))
            | step_statistics(steps.get(key, samples.iloc[:0]))
            | {
                "failures": int(cells["failures"].sum()),
                "cells": len(cells),
                "cells_ok": int((cells["status"] == OK).sum()),
                "accepted": int(cells["accepted"].sum()),
                "expected": int(cells["expected"].sum()),
                "success": cells["accepted"].sum() / cells["expected"].sum() if cells["expected"].sum() else 0.0,
                "whole": bool((cells["status"] != OVER_BUDGET).all()),
                "distance_m": cells["distance_m"].max(),
                "limit_violation_m": cells["limit_violation_m"].max(),
                "path_difference_m": cells["path_difference_m"].max(),
                "first_reason": next((str(reason) for reason in cells["message"] if reason), ""),
            }
        )
    summary = pd.DataFrame(rows)
    found = [ranking(mine, of_group(ranked, mine)) for _, mine in summary.groupby(GROUP, sort=False)]
    return pd.concat(found, ignore_index=True)
