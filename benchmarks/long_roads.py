"""Roads of 10, 100 and 1,000 km piece by piece: memory, time a kilometre, and how near the plan is to the undivided one.

python benchmarks/long_roads.py [--out results/long-roads] [--lengths 10,100,1000] [--whole 100] [--vehicles bus,...] [--half-width 4]

A long line is that of a real road, end to end again and again. Every plan runs in a process of its own. Writes ``long_roads.csv`` (a row a
plan: CPU time, largest memory, distances of the plan in pieces from the undivided one) and run.json.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pandas as pd
from cases import numbers, options_of, words, write_table

from hdvplan.api import plan
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.pieces import pieces_of, planned
from hdvplan.record import write_record
from hdvplan.report.files import write_plan
from hdvplan.report.joined import write_pieces
from hdvplan.road.load import find_road, load_road
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle

ROAD = "liechtenstein_schaan_balzers"  # 11.9 km with five roundabouts
_FIRST_M = 2e3
_LINK_M = 30.0  # straight between one time and the next


def main() -> None:
    """Measure every length, and write the tables."""
    parser = options_of(__doc__, "long-roads")
    parser.add_argument("--lengths", type=numbers, default=[10.0, 100.0, 1000.0])
    parser.add_argument("--whole", type=float, default=100.0, help="longest that is planned undivided as well [km]")
    parser.add_argument("--vehicles", type=words, default=["bus", "tractor-trailer"])
    parser.add_argument("--half-width", type=float, default=4.0)
    parser.add_argument("--one", type=Path, help="plan this line, in pieces or --undivided, and print what it took")
    parser.add_argument("--undivided", action="store_true")
    options = parser.parse_args()
    if options.one is not None:
        print(json.dumps(measured(options.one, options.vehicles[0], options.half_width, options.out, undivided=options.undivided)))
        return
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for vehicle in options.vehicles:
        for km in options.lengths:
            rows += rows_of(km, vehicle, options.half_width, whole=km <= options.whole)
            write_table(options.out / "long_roads.csv", pd.DataFrame(rows), "%.5g")
    write_record(options.out, [case_of(load_road(ROAD), vehicle, options.half_width) for vehicle in options.vehicles])


def plan_line(line: Path, vehicle: str, half_width: float, out: Path, *, undivided: bool) -> dict[str, Any]:
    """Plan a line, whole or in pieces, write the plan, and return its summary."""
    if undivided:
        write_plan(plan(case_of(load_road(line), vehicle, half_width)), out)
        return dict(json.loads((out / "summary.json").read_text(encoding="utf-8")))
    like = case_of(load_road("uturn"), vehicle, half_width)
    pieces = pieces_of(find_road(line), like.vehicle, like.settings)
    return write_pieces(planned(pieces, lambda road: case_of(road, vehicle, half_width)), out)


def line_file(folder: Path, length: float) -> Path:
    """Write a long line into a folder, and return its file."""
    line = folder / "long.csv"
    points = long_line(length)
    line.write_text("x_m,y_m\n" + "\n".join(f"{x:.3f},{y:.3f}" for x, y in points) + "\n", encoding="utf-8")
    return line


def case_of(road: Road, vehicle: str, half_width: float) -> Case:
    """Return the run on a road."""
    return Case(road.with_limits(half_width, half_width), load_vehicle(vehicle))


def rows_of(km: float, vehicle: str, half_width: float, *, whole: bool) -> list[dict[str, object]]:
    """Return a row for the plan in pieces of a line this long, and one for the undivided plan."""
    rows: list[dict[str, object]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        line = line_file(folder, 1e3 * km)
        for way in (*([["--undivided"]] if whole else []), []):
            out = folder / ("whole" if way else "stretches")
            same = ["--vehicles", vehicle, "--half-width", str(half_width), "--out", str(out), "--one", str(line)]
            ended = subprocess.run([sys.executable, __file__, *same, *way], check=True, capture_output=True, text=True)  # noqa: S603 - ourselves
            rows.append({"km": km, "vehicle": vehicle, "plan": out.name} | json.loads(ended.stdout))
            print(rows[-1], flush=True)
        if whole:
            rows[-1] |= apart(folder / "whole", folder / "stretches")
            print(rows[-1], flush=True)
    return rows


def long_line(length: float) -> FloatArray:
    """Return the line of ``ROAD``, end to end again and again, cut at a length [m]."""
    line = find_road(ROAD).line
    assert line is not None  # noqa: S101 - for the type checker: the road is no scenario
    points, at, heading, parts = line.raw.points, np.zeros(2), 0.0, []
    first, last = (float(np.arctan2(*step[::-1])) for step in (points[1] - points[0], points[-1] - points[-2]))
    lap = float(np.sum(np.hypot(*np.diff(points, axis=0).T))) + _LINK_M
    for _ in range(int(np.ceil(length / lap))):
        turn = heading - first
        turned = (points - points[0]) @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) + at
        parts.append(turned)
        heading = last + turn
        at = turned[-1] + _LINK_M * np.array([np.cos(heading), np.sin(heading)])
    laps = np.concatenate(parts)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(laps, axis=0).T))])
    return laps[along <= length]


def measured(line: Path, vehicle: str, half_width: float, out: Path, *, undivided: bool) -> dict[str, object]:
    """Plan a line in this process; return its length [km], CPU time [s] and largest memory [MB]."""
    with tempfile.TemporaryDirectory() as name:  # what the first plan loads is loaded once, not by the kilometre
        plan_line(line_file(Path(name), _FIRST_M), vehicle, half_width, Path(name, "first"), undivided=undivided)
    began = process_time()
    summary = plan_line(line, vehicle, half_width, out, undivided=undivided)
    spent, km = process_time() - began, 1e-3 * summary["length_m"]
    return {
        "cpu_s": spent,
        "cpu_s_per_km": spent / km,
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        "files_mb": sum(file.stat().st_size for file in out.iterdir()) / 1e6,
        "pieces": summary.get("stretches", {"count": 1})["count"],
        "min_clearance_m": summary["min_clearance_m"],
    }


def apart(whole: Path, pieces: Path) -> dict[str, float]:
    """Return how far two plans of the same line lie apart across the road, as driven and as swept [mm]."""
    a, b = (pd.read_csv(folder / "path.csv") for folder in (whole, pieces))
    rows = min(len(a), len(b))
    a, b = a[:rows], b[:rows]
    across = np.abs((b.y - a.y) * np.cos(a.heading) - (b.x - a.x) * np.sin(a.heading))
    swept = [pd.read_csv(folder / "envelope.csv")[["left", "right"]].to_numpy(float) for folder in (whole, pieces)]
    samples = min(map(len, swept))
    reach = np.abs(swept[0][:samples] - swept[1][:samples])
    return {
        "path_apart_mm": 1e3 * float(np.max(across)),
        "path_apart_p999_mm": 1e3 * float(np.quantile(across, 0.999)),
        "swept_apart_mm": 1e3 * float(np.nanmax(reach)),
        "swept_apart_p999_mm": 1e3 * float(np.nanquantile(reach, 0.999)),
    }


if __name__ == "__main__":
    main()
