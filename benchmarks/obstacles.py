"""What obstacles cost: mean planning step on real roads with parked vans every so many metres, and without. Writes ``obstacles.*``.

python benchmarks/obstacles.py [--out results] [--rounds 5]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from hdvplan.driving.drive import drive
from hdvplan.judging.balance import balance_of
from hdvplan.judging.envelope import envelope_of
from hdvplan.planning.objectives import geometric
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.load import RoadOptions, load_road
from hdvplan.road.road import Limits, Road
from hdvplan.solvers.registry import DEFAULT, solver_named
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle

ROADS = {"goteborg_nya_allen": 3.0, "goteborg_tuvevagen_brunnsbo": 3.5}  # with their half widths [m]
VEHICLES = ("bus", "tractor-trailer")
APART_M = (500.0, 300.0, 150.0)
TITLE = """# What obstacles cost

Mean planning step (RTI, riccati) in milliseconds, every step with its fastest of the rounds, with and without vans in turns.

"""
VAN_LENGTH_M, VAN_EDGE_M = 6.0, -0.8  # from the right, to this offset: wheels must leave the middle of the road
FIRST_M, LAST_M = 120.0, 50.0  # from the road's start, and before its end


def main(arguments: Sequence[str] | None = None) -> None:
    """Drive every combination in turns and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results"))
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args(arguments)
    rows = []
    for name, half_width in ROADS.items():
        for vehicle in map(load_vehicle, VEHICLES):
            road = load_road(name, RoadOptions(max_curvature=1.25 * vehicle.max_curvature)).with_limits(half_width, half_width)
            for apart in APART_M:
                rows.append(compared(road, vehicle, half_width, apart, options.rounds))
                print(*rows[-1].values(), sep="  ", flush=True)
    table = pd.DataFrame(rows)
    options.out.mkdir(parents=True, exist_ok=True)
    table.to_csv(options.out / "obstacles.csv", index=False, float_format="%.4f", lineterminator="\n")
    (options.out / "obstacles.md").write_text(TITLE + table.to_markdown(index=False, floatfmt=".3f") + "\n", encoding="utf-8")


def with_vans(road: Road, half_width: float, apart: float) -> tuple[Road, int]:
    """Return the road with vans parked on its right, and how many."""
    length = road.path.length
    vans = np.arange(FIRST_M, length - LAST_M, apart)
    corners = np.repeat(vans, 4) + np.tile([0.0, 0.0, VAN_LENGTH_M, VAN_LENGTH_M], len(vans))
    s = np.concatenate([[0.0], corners, [length]])
    edge = np.concatenate([[-half_width], np.tile([-half_width, VAN_EDGE_M, VAN_EDGE_M, -half_width], len(vans)), [-half_width]])
    left = np.full(len(s), half_width)
    return replace(road, limits=Limits(s, left, edge, left, edge)), len(vans)


def compared(road: Road, vehicle: Vehicle, half_width: float, apart: float, rounds: int) -> dict[str, object]:
    """Return one row: both mean steps, their ratio, and whether the vans were passed."""
    parked, count = with_vans(road, half_width, apart)
    times: dict[str, list[list[float]]] = {"free": [], "parked": []}
    for _ in range(rounds):
        for key, track in (("free", road), ("parked", parked)):
            done = drive(track, vehicle, geometric, solver_named(DEFAULT), PlannerSettings())
            times[key].append([1e3 * plan.times.total for plan in done.plans])
    without, with_them = (float(np.mean(np.min(times[key], axis=0))) for key in ("free", "parked"))
    return {
        "road": road.name,
        "vehicle": vehicle.name,
        "apart_m": apart,
        "vans": count,
        "free_ms": without,
        "parked_ms": with_them,
        "ratio": with_them / without,
        "violation_m": balance_of(done, envelope_of(done)).violation,
    }


if __name__ == "__main__":
    main()
