"""A study of very many cells on a short road, every one of them planned: what a cell costs besides its work, and how the driver grows.

python benchmarks/study_cells.py [--out results/study-cells] [--cells 100000] [--workers 1]

Writes ``study_cells.csv``, a row for each tenth of the cells and one for the end, and run.json. The driver is the process that hands cells
out and writes the tables; its memory counts from where it has loaded what it needs to begin. The overhead of a cell is the time that the
processes had, less what they worked, for each cell.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

from hdvplan.case import Case
from hdvplan.machine import use_one_thread
from hdvplan.planning.settings import PlannerSettings
from hdvplan.record import write_record
from hdvplan.road.load import load_road
from hdvplan.study import LocalEngine, run
from hdvplan.vehicle.load import load_vehicle

VEHICLE = "P"
SHORT: dict[str, Any] = {"horizon": 5.0, "step": 0.5, "replan": 5.0}  # the car looks 5 m ahead
ROAD = "s,kappa\n0,0\n6,0\n9,0.02\n12,0\n20,0\n"  # 20 m
_WIDTHS, _FIRST_M, _BY_M = 100, 1.2, 0.01  # half widths, the least, and from one to the next; the rest are weights in the objective


def main() -> None:
    """Run the study, and write what it took."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/study-cells"))
    parser.add_argument("--cells", type=int, default=100_000)
    parser.add_argument("--workers", type=int, default=1)
    asked = parser.parse_args()
    use_one_thread()
    with tempfile.TemporaryDirectory() as name:
        (Path(name) / "short.csv").write_text(ROAD, encoding="utf-8")
        widths = [round(_FIRST_M + _BY_M * number, 5) for number in range(_WIDTHS)]
        weights = [PlannerSettings.smoothness + number for number in range(asked.cells // _WIDTHS)]
        settings = SHORT | {"smoothness": weights}
        entries = {"roads": [str(Path(name) / "short.csv")], "vehicles": [VEHICLE], "half_widths": widths, "settings": settings}
        rows: list[dict[str, float]] = []
        loaded, began, spent = memory(), perf_counter(), process_time()

        def tell(done: int, total: int) -> None:
            if done and done % max(1, total // 10) == 0:
                taken = {"wall_s": perf_counter() - began, "driver_cpu_s": process_time() - spent}
                rows.append({"cells": done, **taken, "mb": memory() - loaded})
                print(rows[-1], flush=True)

        results = run(entries, Path(name) / "out", LocalEngine(asked.workers), on_progress=tell)
        row = {"cells": asked.cells, "wall_s": perf_counter() - began, "driver_cpu_s": process_time() - spent}
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
        work = float(results.cells()["parallel_wall_s"].sum())
        overhead = 1e3 * (asked.workers * rows[-1]["wall_s"] - work) / asked.cells
        rows.append(row | {"mb": peak - loaded, "work_s": work, "workers": asked.workers, "overhead_ms_per_cell": overhead})
        road = load_road(Path(name) / "short.csv").with_limits(_FIRST_M, _FIRST_M)
    print(rows[-1], dict(results.outcomes), dict(results.fits))
    import pandas as pd  # noqa: PLC0415 - the driver loads it in the end, too

    asked.out.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(rows).to_csv(asked.out / "study_cells.csv", index=False, float_format="%.4g", lineterminator="\n")
    write_record(asked.out, [Case(road, load_vehicle(VEHICLE), settings=PlannerSettings(**SHORT))])


def memory() -> float:
    """Return the memory that this process has now [MB]."""
    return int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1]) * resource.getpagesize() / 1e6


if __name__ == "__main__":
    main()
