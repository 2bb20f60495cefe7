"""The exported planner against hdvplan's own: the same plans, what they take, what a budget costs, sizes and times.

Writes plans.csv (a row a road, vehicle and class of limits), sizes.csv, export-c.md and run.json. Needs a C compiler, cc.

hdvplan's core is the one without fused operations; beside the other: HDVPLAN_CORE=avx2 python benchmarks/export_c.py --jobs 2 --out
results/export-c/fused
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import cast

os.environ.setdefault("HDVPLAN_CORE", "baseline")  # before the core is loaded: the same instructions as what is compiled here

import numpy as np
import pandas as pd
from cases import options_of, suite_roads, words, write_results
from exported_planner import ROUNDING, ExportedPlanner, compared, driven

from hdvplan.api import drive_case
from hdvplan.bench.measuring.courses import with_limits
from hdvplan.bench.suite import Suite
from hdvplan.case import Case
from hdvplan.driving.drive import Drive
from hdvplan.export import UNLIMITED, Budget
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.result import result_of
from hdvplan.machine import use_one_thread
from hdvplan.report.grid import markdown_table
from hdvplan.report.summary import summary_of
from hdvplan.road.load import find_road
from hdvplan.vehicle.load import load_vehicle

VEHICLES = ("bus", "tractor-trailer", "a-double")
CLASSES = ("off", "inactive", "binding", "unkeepable")
OPTIMISED = ("-O3", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math")  # as hdvplan's own core
DEFAULT = Budget()
HALF = Budget(DEFAULT.factorisations // 2, DEFAULT.linearisations // 2)


def cases(roads: Sequence[str], vehicles: Sequence[str]) -> Iterator[tuple[str, Case]]:
    """Return all cases with their class of limits."""
    for name in roads:
        road = find_road(name)()
        for vehicle in map(load_vehicle, vehicles):
            for limits in CLASSES:
                yield limits, Case(with_limits(road, vehicle, Suite(), limits), vehicle)


def judged(drive: Drive, case: Case) -> float:
    """Return how deep a drive breaks its limits, as simulated [m]."""
    broken = summary_of(result_of(drive, solver=case.solver, objective=case.objective))["limit_violation_m"]
    return float(cast("float", broken))


def row_of(limits: str, case: Case) -> dict[str, object]:
    """Return how the exported plans of a case compare with hdvplan's, and what they took; and the same with half the budget."""
    own = drive_case(case)
    row: dict[str, object] = {"road": case.road.name, "vehicle": case.vehicle.name, "limits": limits, "plans": len(own.plans)}
    row["breach_m"] = judged(own, case)
    with tempfile.TemporaryDirectory() as folder:
        planner = ExportedPlanner(case, Path(folder), flags=OPTIMISED)
        drive = driven(case, planner)
        row["difference"] = max(float(np.max(np.abs(drive.z - own.z))), float(np.max(np.abs(drive.kappa - own.kappa))))
        most = np.max([counts[2:] for counts in planner.counts], axis=0)
        row["factorisations"], row["linearisations"], row["memory_bytes"] = int(most[0]), int(most[1]), planner.memory
        planner.begin(UNLIMITED)
        row["plan_difference"], row["beyond_rounding"], row["recounted"] = compared(case, planner)
        for name, budget in (("default", DEFAULT), ("half", HALF)):
            planner.begin(budget)
            row[f"breach_{name}_m"] = judged(driven(case, planner), case)
            row[f"spent_{name}"] = sum(status == "spent" for status, *_ in planner.counts)
    print(f"{row}", file=sys.stderr)
    return row


def sizes(vehicle: str, folder: Path) -> dict[str, object]:
    """Return bytes of code and of memory of a vehicle's planner on this machine, compiled for size."""
    case = Case(find_road("uturn")(), load_vehicle(vehicle))
    planner = ExportedPlanner(case, folder)
    subprocess.run(["make", "freestanding", "CFLAGS=-std=c99 -Os"], cwd=folder, check=True, capture_output=True)  # noqa: S607 - fixed
    stack = max(int(line.split("\t")[1]) for path in folder.glob("*.su") for line in path.read_text().splitlines())
    return {
        "vehicle": vehicle,
        "memory_bytes": planner.memory,
        "code_bytes": code_bytes(folder.glob("*.o")),
        "largest_frame_bytes": stack,
    }


def code_bytes(compiled: Iterable[Path]) -> int:
    """Return the bytes of code in objects or libraries."""
    listed = subprocess.run(["size", *map(str, compiled)], check=True, capture_output=True, text=True)  # noqa: S603, S607 - ours
    return sum(int(line.split()[0]) for line in listed.stdout.splitlines()[1:])


def text(plans: pd.DataFrame, size: pd.DataFrame) -> str:
    """Return the page."""
    kept = plans[plans["breach_m"] <= KEPT_M]
    lost = kept[kept["breach_half_m"] > KEPT_M]
    classes = plans.groupby(["vehicle", "limits"], sort=False)
    most = classes[["factorisations", "linearisations", "plan_difference", "difference"]].max()
    for name in ("plan_difference", "difference"):
        most[name] = most[name].map("{:.1e}".format)
    most = classes[["road"]].nunique().join(most).join(classes[["plans", "beyond_rounding", "recounted"]].sum()).reset_index()
    most = most.rename(columns={"road": "roads"})
    named = ", ".join(f"{row.vehicle} on {row.road}, {row.limits} ({row.breach_half_m:.3f} m)" for row in lost.itertuples()) or "none"
    default = kept["breach_default_m"] <= KEPT_M
    return (
        "The most that one step took, and the largest difference of a state or curvature from "
        "hdvplan: of a plan from the same state, and of a whole drive. Of the plans, those that differ by more than "
        f"{ROUNDING:g}, and those that took another number of factorisations.\n\n"
        f"{markdown_table(most, text=('vehicle', 'limits'))}\n\n"
        f"The default budget is {DEFAULT.factorisations} factorisations and {DEFAULT.linearisations} linearisations a step: "
        f"{int(default.sum())} of the {len(kept)} drives that keep their limits keep them. With half of it {len(kept) - len(lost)} do; "
        f"the others: {named}.\n\n"
        "Compiled for size on this machine (`-Os`), without the road's tables:\n\n"
        f"{markdown_table(size, text=('vehicle',))}\n"
    )


def main() -> None:
    """Measure and write."""
    parser = options_of(__doc__, "export-c")
    parser.add_argument("--roads", type=words, default=suite_roads())
    parser.add_argument("--vehicles", type=words, default=list(VEHICLES))
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time: there is nothing that is timed")
    given = parser.parse_args()
    use_one_thread()
    found = list(cases(given.roads, given.vehicles))
    with ProcessPoolExecutor(given.jobs) as pool:
        plans = pd.DataFrame(pool.map(row_of, *zip(*found, strict=True)))
    with tempfile.TemporaryDirectory() as folder:
        rows = []
        for vehicle in given.vehicles:
            (place := Path(folder) / vehicle).mkdir()
            rows.append(sizes(vehicle, place))
    size = pd.DataFrame(rows)
    pages = {"export-c": text(plans, size)}
    write_results(given.out, {"plans": plans, "sizes": size}, pages, [case for _, case in found], form=None)


if __name__ == "__main__":
    main()
