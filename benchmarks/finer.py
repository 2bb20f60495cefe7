"""Plans that were missed, found with stations nearer together: cases that a known drive fits, and every unproved NO of ``results/proof``.

Writes random.csv, roads.csv, finer.md, run.json.

python benchmarks/finer.py [--out results/finer] [--first 0] [--seeds 80] [--room 0.05] [--proof results/proof/widths.csv]

A known drive is no plan: it may steer faster than the vehicle's rate allows, so that not every missed one can be found.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np
import pandas as pd
from cases import case_within, free_case
from proof_cases import fitting

from hdvplan import api
from hdvplan.case import Case
from hdvplan.driving.drive import Drive
from hdvplan.errors import HdvplanError
from hdvplan.finer import replanned
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import verdict_of
from hdvplan.planning.objectives import Goal
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.centring import Centring, Residual
from hdvplan.record import write_record
from hdvplan.report.grid import markdown_table
from hdvplan.road.limits import Limits
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle

VEHICLES = ("bus", "rigid-truck", "tractor-trailer", "articulated-bus")
_RATE = 1.001  # of the vehicle's largest change of curvature: rounding


def main(arguments: Sequence[str] | None = None) -> None:
    """Plan, plan again where the limits are broken, and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/finer"))
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seeds", type=int, default=80)
    parser.add_argument("--room", type=float, default=0.05)
    parser.add_argument("--proof", type=Path, default=Path("results/proof/widths.csv"))
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    seeds = pd.DataFrame(filter(None, (_driven(seed, options.room) for seed in range(options.first, options.first + options.seeds))))
    table = pd.read_csv(options.proof)
    unproved = table[~table["fits"] & table["kind"].isna()]
    unproved = unproved[["road", "vehicle", "half_width"]]
    cases = [
        case_within(free_case(str(road), str(vehicle)), float(half)) for road, vehicle, half in unproved.itertuples(index=False, name=None)
    ]
    roads = unproved.reset_index(drop=True).join(pd.DataFrame(map(_tried, cases)))
    for name, rows in (("random", seeds), ("roads", roads)):
        rows.to_csv(options.out / f"{name}.csv", index=False, float_format="%.4f", lineterminator="\n")
    (options.out / "finer.md").write_text(_page(seeds, roads, options.room), encoding="utf-8")
    write_record(options.out, cases)


def _driven(seed: int, room: float) -> dict[str, object] | None:
    """Return the row of a random case with ``room`` [m] more than a known drive takes; None where there is none, or it steers at once."""
    found = fitting(seed, load_vehicle(VEHICLES[seed % len(VEHICLES)]))
    if found is None or found.way == "bang-bang":
        return None
    case, drive = found.case, found.result.drive
    limits = case.road.limits
    if limits is None:
        return None
    wider = Limits(limits.s, limits.left + room, limits.right - room, limits.left_sweep + room, limits.right_sweep - room)
    rate = float(np.max(np.abs(np.diff(drive.kappa)), initial=0.0)) / case.settings.step
    row = {"seed": seed, "vehicle": case.vehicle.name, "way": found.way, "drivable": rate <= _RATE * case.vehicle.max_curvature_rate}
    case = replace(case, road=case.road.within(wider), objective="geometric")
    return row | _tried(case) | {"following": _following(case, drive)}


def _following(case: Case, drive: Drive) -> float:
    """Return what a plan lacks that keeps its lead axle as near as it can to a known drive's: no start could be better [m]."""

    def objective(stations: Stations, vehicle: Vehicle) -> Goal:  # noqa: ARG001 - every objective is told both
        one = np.ones(len(stations.s))
        return Goal((Centring(Residual(one, 0.0 * one, np.interp(stations.s, drive.stations.s[: len(drive.z)], drive.z[:, 0]))),))

    try:
        return _lacking(api.plan(replace(case, objective=objective)))
    except HdvplanError:
        return np.inf


def _lacking(result: Result) -> float:
    verdict = verdict_of(result)
    return 0.0 if verdict.fits else -(verdict.spare or 0.0)


def _tried(case: Case) -> dict[str, object]:
    """Return what a plan lacks, what the best of its further plans lacks, what the finer of them do, and what all cost."""
    began = process_time()
    try:
        result = api.plan(case)
    except HdvplanError as error:
        none = {"lacking": np.inf, "least": np.inf, "finer": "", "fits": False}
        return none | {"cpu_s": process_time() - began, "finer_cpu_s": 0.0, "error": str(error)}
    planned = process_time()
    last = replanned(result)
    return {
        "lacking": _lacking(result),
        "least": _lacking(last),
        "finer": " ".join(f"{one.step:g}:{one.lacking:.3f}" for one in last.attempts if one.step != case.settings.step),
        "fits": bool(verdict_of(last).fits),
        "cpu_s": planned - began,
        "finer_cpu_s": process_time() - planned,
        "error": "",
    }


def _page(seeds: pd.DataFrame, roads: pd.DataFrame, room: float) -> str:
    """Return what finer.md says."""
    shown = []
    for vehicle, rows in seeds.groupby("vehicle", sort=False):
        missed = rows[rows["lacking"] > 0.0]
        drivable = missed["drivable"]
        shown.append({
            "vehicle": vehicle, "cases": len(rows), "missed": len(missed), "found by following the drive": sum(missed["following"] == 0.0),
            "found by planning again": sum(missed["fits"]), "missed, and within the steering rate": sum(drivable),
            "of these found": sum(drivable & missed["fits"]),
        })  # fmt: skip
    about = (
        f"Winding roads with {room:g} m more room on both sides than a known drive takes, planned with stations 0.5 m apart; missed: that "
        "plan breaks the limits. It was then planned again as `hdvplan plan` does: with limits that give way, and stations 0.25 and 0.1 m "
        "apart."
    )
    below = (
        "Every `NO` of `results/widths` without a proof: what is lacking, at least when planned again, and with stations so far apart [m]; "
        "the processor time [s]."
    )
    told = roads.drop(columns="error").round(3)
    cells = markdown_table(told, text=("road", "vehicle", "finer"))
    parts = ["# Plans with stations nearer together", about, markdown_table(pd.DataFrame(shown), text=("vehicle",)), below, cells]
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    main()
