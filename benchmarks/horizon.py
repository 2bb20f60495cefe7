"""How the cost of one planning step grows with the horizon: 100 to 1600 stages of 0.5 m, every solver, limits inactive.

Writes horizon.csv, horizon.md, horizon.png and run.json. The growth that a line of slope 1 in the picture stands for is linear.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from cases import options_of, words, write_results
from matplotlib.figure import Figure

from hdvplan.bench.measuring.courses import cases_of
from hdvplan.bench.measuring.measure import measure
from hdvplan.bench.measuring.samples import Measurement
from hdvplan.bench.measuring.stats import tables_of
from hdvplan.bench.suite import Suite
from hdvplan.case import Case
from hdvplan.machine import machine_facts, use_one_thread
from hdvplan.report.grid import markdown_table
from hdvplan.report.style import styled
from hdvplan.solvers.registry import solver_named

STAGES = (100, 200, 400, 800, 1600)
SOLVERS = ("riccati", "piqp", "clarabel", "osqp")
STEP_M = 0.5
BUDGET_S = 60.0  # of one drive


def suites_of(road: str, vehicle: str, solvers: tuple[str, ...], rounds: int) -> dict[int, Suite]:
    """Return what is measured for every number of stages."""
    base = Suite(roads=(road,), vehicles=(vehicle,), schemes=("rti",), solvers=solvers, rounds=rounds, step=STEP_M, budget=BUDGET_S)
    return {stages: replace(base, horizon=stages * STEP_M) for stages in STAGES}


def table_of(suites: Mapping[int, Suite], cases: Mapping[int, Sequence[Case]]) -> pd.DataFrame:
    """Return the mean step of every solver and horizon, each step counted with its fastest round; rounds alternate all."""
    measured: dict[Case, list[Measurement]] = {}
    for round_ in range(suites[STAGES[0]].rounds):
        for stages, suite in suites.items():
            for case in cases[stages]:
                print(f"round {round_ + 1}: {case.vehicle.name}, {stages} stages, {case.solver}", file=sys.stderr)
                drive = measure(case, solver_named(case.solver), budget=suite.budget, judged=False)
                measured.setdefault(case, []).append(drive)
    rows = []
    for stages, suite in suites.items():
        timing = tables_of(suite.cells(), [measured[case] for case in cases[stages]]).timing
        rows.append(timing.assign(stages=stages))
    columns = [
        "vehicle", "solver", "stages", "status", "steps", "fastest_mean_ms", "fastest_max_ms", "p99_ms", "iterations_mean", "failures"
    ]  # fmt: skip
    return pd.concat(rows)[columns].sort_values(["vehicle", "solver", "stages"], kind="stable")


def growth(table: pd.DataFrame) -> pd.Series[float]:
    """Return the exponent b of time = a * stages^b for every vehicle and solver, by least squares in logarithms."""

    def slope(mine: pd.DataFrame) -> float:
        return float(np.polyfit(np.log(mine["stages"]), np.log(mine["fastest_mean_ms"]), 1)[0])

    return pd.Series({key: slope(mine) for key, mine in table.groupby(["vehicle", "solver"])})


def markdown(table: pd.DataFrame, road: str, rounds: int) -> str:
    """Return milliseconds by solver and stages, and the exponent of growth."""
    wide = table.pivot_table(index=["vehicle", "solver"], columns="stages", values="fastest_mean_ms")
    text = wide.map("{:.3f}".format).assign(exponent=growth(table).map("{:.2f}".format)).reset_index()
    text.columns = pd.Index([str(name) for name in text.columns])
    facts = machine_facts()
    caption = (
        f"Mean RTI step [ms] against stages of {STEP_M:g} m on {road}, limits inactive, each step with the fastest of {rounds} rounds; "
        f"exponent: of time over stages, 1 is linear. One thread, {facts['processor']}, {facts['python']}."
    )
    return f"{caption}\n\n{markdown_table(text, text=('vehicle', 'solver'))}\n"


def draw(table: pd.DataFrame, path: Path) -> None:
    """Draw time over stages, one panel a vehicle, with a line of linear growth through the last solver's first point."""
    with styled():
        vehicles = list(dict.fromkeys(table["vehicle"]))
        figure = Figure(figsize=(4.5 * len(vehicles), 4.0), layout="constrained")
        for axes, vehicle in zip(np.atleast_1d(figure.subplots(1, len(vehicles), sharey=True)), vehicles, strict=True):
            mine = table[table["vehicle"] == vehicle]
            for solver, line in mine.groupby("solver", sort=False):
                axes.loglog(line["stages"], line["fastest_mean_ms"], marker="o", label=solver)
            first = mine[mine["solver"] == mine["solver"].max()].iloc[0]
            axes.loglog(STAGES, first["fastest_mean_ms"] * np.array(STAGES) / STAGES[0], color="0.6", linestyle="--", label="linear")
            axes.set(title=vehicle, xlabel="stages", xticks=STAGES, xticklabels=STAGES)
            axes.minorticks_off()
            axes.grid(visible=True, alpha=0.3)
        figure.axes[0].set_ylabel("mean step [ms]")
        figure.axes[0].legend()
        figure.savefig(path, dpi=150)


def main() -> None:
    """Measure and write the table and the picture."""
    parser = options_of(__doc__, "horizon")
    parser.add_argument("--road", default="goteborg_nya_allen", metavar="ROAD")
    parser.add_argument("--vehicles", type=words, default="bus,tractor-trailer", metavar="A,B")
    parser.add_argument("--solvers", type=words, default=",".join(SOLVERS), metavar="A,B")
    parser.add_argument("--rounds", type=int, default=3, metavar="N")
    asked = parser.parse_args()
    tables, driven = [], []
    for vehicle in asked.vehicles:
        suites = suites_of(asked.road, vehicle, tuple(asked.solvers), asked.rounds)
        cases = {stages: cases_of(suite) for stages, suite in suites.items()}
        tables.append(table_of(suites, cases))
        driven += [case for some in cases.values() for case in some]
    table = pd.concat(tables)
    page = markdown(table, asked.road, asked.rounds)
    write_results(asked.out, {"horizon": table}, {"horizon": page}, driven, form=None)
    draw(table, asked.out / "horizon.png")
    print(page)


if __name__ == "__main__":
    use_one_thread()
    main()
