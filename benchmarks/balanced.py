"""What balancing the measured envelope gains over the stationary weight, and what it costs: S-turns, convergence, real roads.

Writes its tables (csv, md), figures and run.json into results/balanced. All numbers are of the exact simulation of the executed motion.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from balanced_drives import (
    CURVATURES,
    EXAMPLE,
    RTI,
    SHARPNESSES,
    SQP,
    VEHICLES,
    balanced_with,
    case_road,
    corrected,
    deferred,
    numbers,
    run,
)
from balanced_pictures import draw_convergence, draw_examples, draw_roads
from cases import options_of

from hdvplan.api import drive_case
from hdvplan.arrays import FloatArray
from hdvplan.bench.measuring.courses import with_limits
from hdvplan.bench.suite import ROADS, Suite
from hdvplan.case import Case
from hdvplan.errors import HdvplanError
from hdvplan.fileio import csv_bytes, write_atomically
from hdvplan.judging.result import Result
from hdvplan.machine import use_one_thread
from hdvplan.planning.objectives import balanced, geometric
from hdvplan.record import write_record
from hdvplan.report.grid import markdown_table
from hdvplan.reproduce.study import whole_manoeuvre
from hdvplan.road.load import load_road
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle

FINE = {"sharpness", "mean_abs_imbalance_m", "geometric_m", "balanced_m"}  # columns that need a tenth of a millimetre
WORDS = {"vehicle", "objective", "rule", "road", "limits"}  # columns that hold no numbers
CAPTIONS = {
    "s-turns": (
        "S-turns",
        (
            "Every S-turn (curvature [1/m], sharpness [1/m^2]) with every objective: imbalance of a place, mean and largest [m], "
            "furthest reach [m], sum of squared changes of curvature [1/m^2], largest curvature [1/m], quadratic programs a step."
        ),
    ),
    "summary": (
        "S-turns together",
        (
            "All S-turns together. gain: how much less the mean imbalance of a place is than with the geometric objective, on "
            "average and on the worst road; furthest: growth of the largest reach, likewise; ratios: against the geometric "
            "objective, the largest curvature on the worst road."
        ),
    ),
    "convergence": (
        "One horizon, planned repeatedly",
        (
            "One horizon on an S-turn, planned repeatedly with each rule: imbalance of a place, mean and largest [m], furthest "
            "reach [m], sum of squared changes of curvature [1/m^2] and largest curvature [1/m] after so many rounds."
        ),
    ),
    "trade-off": (
        "Gain against reach",
        (
            "S-turns together, for other parameters of the objective. rounding: up to which imbalance it is quadratic (1000 m: "
            "always); share: of the stationary residual; gain and growth of the largest reach on the worst road as in the summary."
        ),
    ),
    "step-times": (
        "Time of a planning step",
        "Mean step of the real-time iteration, each step with its fastest round, and the ratio of both objectives.",
    ),
    "roads": (
        "Real roads",
        (
            "The benchmark's ten roads with their limits, by the geometric and by the balanced objective: mean and worst imbalance "
            "of a place, furthest reach, least clearance [m]; ratio of the sums of squared changes of curvature."
        ),
    ),
}  # title, and what the columns are
ROUNDS = (1, 2, 3, 4, 6, 8, 10, 15, 20, 30, 50)
TIMED_ROUNDS = 8  # every step counts with the fastest: a busy machine only ever adds time


def family(driven: list[Case]) -> pd.DataFrame:
    """Return every S-turn driven with every candidate."""
    ways: dict[str, Callable[[Road, Vehicle], Result]] = {
        "geometric": lambda road, vehicle: run(road, vehicle, geometric, RTI, driven),
        "deferred correction": lambda road, vehicle: deferred(road, vehicle, RTI, driven),
        "balanced": lambda road, vehicle: run(road, vehicle, balanced, RTI, driven),
        "balanced, SQP": lambda road, vehicle: run(road, vehicle, balanced, SQP, driven),
        "no stationary share": lambda road, vehicle: run(road, vehicle, balanced_with(share=0.0), RTI, driven),
        "squares": lambda road, vehicle: run(road, vehicle, balanced_with(rounding=1e3, share=0.1), RTI, driven),
        "squares, no share": lambda road, vehicle: run(road, vehicle, balanced_with(rounding=1e3, share=0.0), RTI, driven),
        "step not relaxed": lambda road, vehicle: run(road, vehicle, balanced_with(relaxation=1.0), RTI, driven),
        "35 m ahead": lambda road, vehicle: run(road, vehicle, balanced_with(ahead=35.0), RTI, driven),
        "80 m ahead": lambda road, vehicle: run(road, vehicle, balanced_with(ahead=80.0), RTI, driven),
    }
    rows = []
    for name, curvature, sharpness in product(VEHICLES, CURVATURES, SHARPNESSES):
        road, vehicle = case_road(curvature, sharpness), load_vehicle(name)
        case = {"vehicle": name, "curvature": curvature, "sharpness": sharpness}
        rows += [case | {"objective": way} | numbers(drive(road, vehicle)) for way, drive in ways.items()]
        print(f"{name}, {curvature:g} 1/m, {sharpness:g} 1/m^2", file=sys.stderr)
    return pd.DataFrame(rows)


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return every candidate against the geometric weight, over the whole family."""
    keys = ["vehicle", "curvature", "sharpness"]
    base = table[table["objective"] == "geometric"].set_index(keys)
    rows = []
    for (name, way), mine in table.groupby(["vehicle", "objective"], sort=False):
        here = mine.set_index(keys)
        there = base.loc[here.index]
        gain = 100.0 * (1.0 - here["mean_abs_imbalance_m"] / there["mean_abs_imbalance_m"])
        reach = 100.0 * (here["furthest_m"] / there["furthest_m"] - 1.0)
        rows.append(
            {
                "vehicle": name,
                "objective": way,
                "mean_abs_imbalance_m": here["mean_abs_imbalance_m"].mean(),
                "gain_percent": 100.0 * (1.0 - here["mean_abs_imbalance_m"].mean() / there["mean_abs_imbalance_m"].mean()),
                "least_gain_percent": gain.min(),
                "max_abs_imbalance_m": here["max_abs_imbalance_m"].max(),
                "furthest_mean_percent": reach.mean(),
                "furthest_most_percent": reach.max(),
                "squared_changes_ratio": (here["sum_squared_changes"] / there["sum_squared_changes"]).mean(),
                "max_kappa_ratio": (here["max_kappa_per_m"] / there["max_kappa_per_m"]).max(),
                "programs": here["programs"].mean(),
            }
        )
    return pd.DataFrame(rows)


def trade_off(driven: list[Case]) -> pd.DataFrame:
    """Return gain against growth of the largest reach, for shares of the stationary residual with and without rounding."""
    rows = []
    for name, rounding, share in product(VEHICLES, (0.05, 1e3), (0.0, 0.005, 0.01, 0.015, 0.03, 0.1, 0.3)):
        vehicle, gains, reaches = load_vehicle(name), [], []
        for curvature, sharpness in product(CURVATURES, SHARPNESSES):
            road = case_road(curvature, sharpness)
            base, mine = (
                numbers(run(road, vehicle, objective, RTI, driven))
                for objective in (geometric, balanced_with(rounding=rounding, share=share))
            )
            gains.append((mine["mean_abs_imbalance_m"], base["mean_abs_imbalance_m"]))
            reaches.append(mine["furthest_m"] / base["furthest_m"])
        left, before = np.array(gains).sum(axis=0)
        rows.append(
            {
                "vehicle": name,
                "rounding_m": rounding,
                "share": share,
                "gain_percent": 100.0 * (1.0 - left / before),
                "furthest_most_percent": 100.0 * (max(reaches) - 1.0),
            }
        )
    return pd.DataFrame(rows)


def convergence(driven: list[Case]) -> pd.DataFrame:
    """Return the imbalance that so many programs leave when the whole example is planned in one horizon, from the geometric plan on."""
    rows = []
    for name in VEHICLES:
        vehicle, road = load_vehicle(name), case_road(*EXAMPLE)
        settings = whole_manoeuvre(road, RTI.step)
        settings = replace(settings, horizon=settings.horizon + 50.0, replan=settings.horizon)
        start = numbers(run(road, vehicle, geometric, settings, driven))
        for relaxation, rounds in product((1.0, 4.0 / 3.0), ROUNDS):
            objective = balanced_with(ahead=np.inf, rounds=rounds, relaxation=relaxation)
            found = numbers(run(road, vehicle, objective, settings, driven))
            rows.append({"vehicle": name, "rule": f"balanced, step x {relaxation:.2f}", "rounds": rounds} | found)
        rows.append({"vehicle": name, "rule": "geometric", "rounds": 0} | start)
        target: FloatArray | None = None
        for rounds in range(1, max(ROUNDS) + 1):
            found_c, target = corrected(Case(road, vehicle, f"geometric, target corrected {rounds - 1} times", settings=settings), target)
            driven.append(found_c.case)
            if rounds in ROUNDS:
                rows.append({"vehicle": name, "rule": "deferred correction", "rounds": rounds} | numbers(found_c))
    return pd.DataFrame(rows)


def real_roads(driven: list[Case]) -> pd.DataFrame:
    """Return both objectives on the benchmark's real roads, with its limits."""
    rows = []
    suite = Suite()
    for name, road_name in product(VEHICLES, ROADS):
        vehicle = load_vehicle(name)
        road = with_limits(load_road(road_name), vehicle, suite)
        for way, objective in (("geometric", geometric), ("balanced", balanced)):
            try:
                found = run(road, vehicle, objective, RTI, driven)
            except HdvplanError as error:
                print(f"{road_name}, {name}, {way}: {error}", file=sys.stderr)
                continue
            left, right = road.limits.table(found.envelope.s)[:2] if road.limits is not None else (np.inf, -np.inf)
            room = float(min(np.min(left - found.envelope.reach_left), np.min(found.envelope.reach_right - right)))
            rows.append({"vehicle": name, "road": road_name, "objective": way, "clearance_m": room} | numbers(found))
        print(f"{name}, {road_name}", file=sys.stderr)
    return pd.DataFrame(rows)


def step_times(driven: list[Case]) -> pd.DataFrame:
    """Return the mean RTI step of both objectives [ms] on the example, without limits and within the benchmark's; rounds alternate."""
    rows = []
    for name in VEHICLES:
        vehicle, free = load_vehicle(name), case_road(*EXAMPLE)
        for limits, road in (("none", free), ("0.5 m beyond", with_limits(free, vehicle, Suite()))):
            fastest: dict[str, FloatArray] = {}
            cases = [Case(road, vehicle, objective, settings=RTI) for objective in ("geometric", "balanced")]
            driven += cases
            for _ in range(TIMED_ROUNDS):
                for case in cases:
                    gc.collect()
                    gc.disable()
                    plans = drive_case(case).plans[1:]
                    gc.enable()
                    times = 1e3 * np.array([plan.times.total for plan in plans])
                    fastest[case.objective_name] = np.minimum(fastest.get(case.objective_name, np.full(len(times), np.inf)), times)
            means = {f"{way}_ms": float(np.mean(times)) for way, times in fastest.items()}
            rows.append({"vehicle": name, "limits": limits} | means | {"ratio": means["balanced_ms"] / means["geometric_ms"]})
    return pd.DataFrame(rows)


def road_gains(table: pd.DataFrame) -> pd.DataFrame:
    """Return one row a road and vehicle, both objectives beside each other."""
    rows = []
    for (name, road), mine in table.groupby(["vehicle", "road"], sort=False):
        by = mine.set_index("objective")
        base, ours = by.loc["geometric"], by.loc["balanced"]
        rows.append(
            {
                "vehicle": name,
                "road": road,
                "geometric_m": base["mean_abs_imbalance_m"],
                "balanced_m": ours["mean_abs_imbalance_m"],
                "gain_percent": 100.0 * (1.0 - ours["mean_abs_imbalance_m"] / base["mean_abs_imbalance_m"]),
                "worst_geometric_m": base["max_abs_imbalance_m"],
                "worst_balanced_m": ours["max_abs_imbalance_m"],
                "furthest_geometric_m": base["furthest_m"],
                "furthest_balanced_m": ours["furthest_m"],
                "clearance_geometric_m": base["clearance_m"],
                "clearance_balanced_m": ours["clearance_m"],
                "squared_changes_ratio": ours["sum_squared_changes"] / base["sum_squared_changes"],
            }
        )
    return pd.DataFrame(rows)


def write(out: Path, name: str, table: pd.DataFrame) -> None:
    """Write a table as CSV and Markdown."""
    write_atomically(out / f"{name}.csv", csv_bytes(table))
    text = table.copy()
    for column in text.columns:
        if text[column].dtype == float:
            digits = 1 if column.endswith("percent") else 6 if column == "sum_squared_changes" else 4 if column in FINE else 3
            text[column] = text[column].map(f"{{:.{digits}f}}".format)
    title, about = CAPTIONS[name]
    write_atomically(out / f"{name}.md", f"# {title}\n\n{about}\n\n{markdown_table(text, text=WORDS)}\n".encode())


def main() -> None:
    """Measure everything and write it."""
    parser = options_of(__doc__, "balanced")
    alone: dict[str, Callable[[list[Case]], pd.DataFrame]] = {
        "s-turns": family,
        "roads": lambda driven: road_gains(real_roads(driven)),
        "step-times": step_times,
    }
    parser.add_argument("--only", choices=alone, help="make this table alone")
    asked = parser.parse_args()
    out: Path = asked.out
    out.mkdir(parents=True, exist_ok=True)
    driven: list[Case] = []
    if asked.only:
        write(out, asked.only, alone[asked.only](driven))
        return
    cases = family(driven)
    write(out, "s-turns", cases)
    write(out, "summary", summary(cases))
    rounds, trades = convergence(driven), trade_off(driven)
    write(out, "convergence", rounds)
    write(out, "trade-off", trades)
    write(out, "step-times", step_times(driven))
    roads = real_roads(driven)
    write(out, "roads", road_gains(roads))
    draw_examples(out / "example.png")
    draw_convergence(rounds, trades, out / "convergence.png")
    draw_roads(roads, out / "roads.png")
    write_record(out, driven)
    print((out / "summary.md").read_text())


if __name__ == "__main__":
    use_one_thread()
    main()
