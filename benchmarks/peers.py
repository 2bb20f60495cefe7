"""Hold hdvplan's SQP against CasADi with IPOPT and with fatrop on the same problem: the optimum's distance, and the time to it.

The first plan of a drive, from nothing: horizon 100 m, step 0.5 m. Writes peers.csv, peers.md and run.json.
Needs the extra ``peers``: pip install -e .[peers]
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from typing import get_args

import numpy as np
import pandas as pd
from cases import options_of, words, write_results
from exact_nlp import Method, Optimum, deepest_cut, exact_nlp

from hdvplan.bench.measuring.courses import with_limits
from hdvplan.bench.suite import Suite
from hdvplan.case import Case
from hdvplan.centring.stationary import CentringTable
from hdvplan.machine import machine_facts, use_one_thread
from hdvplan.planning.objectives import geometric
from hdvplan.planning.planner import Plan, Planner
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.planning.stations import stations_of
from hdvplan.report.grid import markdown_table
from hdvplan.road.load import load_road
from hdvplan.solvers.registry import solver_named
from hdvplan.vehicle.load import load_vehicle

CASES = {
    "no limits": Suite(limits=False),
    "limits inactive": Suite(slack=0.5),  # limits that bind: tests/bench/test_peers.py; a pinch's kerbs are not parallel to the road
}
USER = PlannerSettings(scheme=Scheme.SQP)  # SQP ends when nothing moves by 1e-4 m
CONVERGED = replace(USER, sqp_tolerance=1e-9)
METHODS: tuple[Method, ...] = get_args(Method)
SAME_TOLERANCE, CONVERGED_TOLERANCE = 1e-4, 1e-10  # the peers', for the comparison of times and of optima


def compare(case: Case, repeats: int) -> dict[str, object]:
    """Return of one row optimum against optimum, and the times of both, alternating; the fastest of ``repeats`` counts."""
    units = case.vehicle
    stations = stations_of(case.road, units, CentringTable.of(units), step=USER.step, horizon=USER.horizon)
    goal, make = geometric(stations, units), solver_named(case.solver)
    z_start = np.concatenate([[stations.centring.e_y[0], 0.0], stations.centring.beta[0]])
    kappa_before = float(stations.centring.kappa[0])

    def planned(settings: PlannerSettings) -> Plan:
        return Planner(units, stations, goal, settings, make).plan(0, z_start, kappa_before)

    def solved(method: Method, tolerance: float) -> Callable[[], Optimum]:
        return exact_nlp(units, case.road, stations, goal, USER, kappa_before, tolerance=tolerance, method=method).solve

    plan, again = planned(CONVERGED), {method: solved(method, SAME_TOLERANCE) for method in METHODS}
    plans: list[Plan] = []
    optima: dict[Method, list[Optimum]] = {method: [] for method in METHODS}
    for _ in range(repeats):
        plans.append(planned(USER))
        for method in METHODS:
            optima[method].append(again[method]())
    sqp = min(one.times.total for one in plans)
    row: dict[str, object] = {
        "sqp_ms": 1e3 * sqp,
        "sqp_max_ms": 1e3 * max(one.times.total for one in plans),
        "sqp_qps": plans[0].qp_count,
    }
    exact = {method: solved(method, CONVERGED_TOLERANCE)() for method in METHODS}
    for method, found in optima.items():
        fastest = min(found, key=lambda one: one.seconds)
        row |= {
            f"{method}_ms": 1e3 * fastest.seconds,
            f"{method}_evaluating_ms": 1e3 * fastest.evaluating,
            f"{method}_max_ms": 1e3 * max(one.seconds for one in found),
            f"{method}_iterations": found[0].iterations,
            f"{method}_ratio": fastest.seconds / sqp,
            f"{method}_own_ratio": (fastest.seconds - fastest.evaluating) / sqp,
            f"{method}_solved": exact[method].solved and all(one.solved for one in found),
            f"{method}_differs_m": float(np.max(np.abs(exact[method].z[:, 0] - plan.z[:, 0]))),
        }
    return row | {
        "sqp_off_m": float(np.max(np.abs(exact["ipopt"].z[:, 0] - plans[0].z[:, 0]))),
        "violation_m": plan.violation,
        "ipopt_cuts_m": deepest_cut(units, stations, exact["ipopt"].z),
    }


def markdown(table: pd.DataFrame) -> str:
    """Return the table as Markdown, with what a reader must know above it."""
    facts = machine_facts()
    caption = (
        "A drive's first plan from nothing, horizon 100 m, step 0.5 m. SQP: riccati, until no state moves by 1e-4. IPOPT (with MUMPS) and "
        f"fatrop: the exact NLP with its exact Hessian by CasADi, tolerance {SAME_TOLERANCE:g}, building and differentiating it not "
        "counted. ms: fastest of the repeats, in turn; evaluating: the part of it in functions and derivatives, by CasADi's statistics. "
        "ratio: to SQP's time; own ratio: of the rest, the solver's own. differs: largest difference of e_y with both converged "
        f"(SQP {CONVERGED.sqp_tolerance:g}, the others {CONVERGED_TOLERANCE:g}); sqp off: of SQP at the user's tolerance from IPOPT; "
        "ipopt cuts: how deep IPOPT's optimum breaks limits, at stations, between the points at which the exact program looks. There the "
        "planner, which looks between them and between stations too, plans another path. "
        f"One thread, {facts['processor']}, {facts['python']}."
    )
    counts = ("sqp_qps", *(f"{method}_{what}" for method in METHODS for what in ("iterations", "solved")))
    forms = dict.fromkeys(("road", "vehicle", "case", *counts), "{}")
    forms |= {f"{method}_{what}": "{:.0f}" for method in METHODS for what in ("ratio", "own_ratio")}
    forms |= dict.fromkeys(("sqp_off_m", "violation_m", "ipopt_cuts_m", *(f"{method}_differs_m" for method in METHODS)), "{:.1e}")
    text = pd.DataFrame({str(name): table[name].map(forms.get(str(name), "{:.2f}").format) for name in table}, dtype=str)
    text.columns = pd.Index([name.replace("_", " ") for name in text.columns])
    return f"{caption}\n\n{markdown_table(text, text=('road', 'vehicle', 'case'))}\n"


def main() -> None:
    """Compare on the papers' scenarios and write the table."""
    parser = options_of(__doc__, "peers")
    parser.add_argument("--roads", type=words, default="uturn,sturn", metavar="A,B")  # bends within the first horizon
    parser.add_argument("--vehicles", type=words, default="bus,tractor-trailer", metavar="A,B")
    parser.add_argument("--repeats", type=int, default=5, metavar="N")
    asked = parser.parse_args()
    rows, cases = [], []
    for road in asked.roads:
        for vehicle in asked.vehicles:
            for case, suite in CASES.items():
                print(f"{road}, {vehicle}, {case}", file=sys.stderr)
                units = load_vehicle(vehicle)
                cases.append(Case(with_limits(load_road(road), units, suite), units, settings=USER))
                rows.append({"road": road, "vehicle": vehicle, "case": case} | compare(cases[-1], asked.repeats))
    table = pd.DataFrame(rows)
    write_results(asked.out, {"peers": table}, {"peers": markdown(table)}, cases, form=None)
    print(markdown(table))


if __name__ == "__main__":
    use_one_thread()
    main()
