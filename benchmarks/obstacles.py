"""What obstacles cost: mean planning step on real roads with parked vans every so many metres, and without.

Writes obstacles.csv, obstacles.md and run.json.

python benchmarks/obstacles.py [--out results/obstacles] [--rounds 5]
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from cases import case_within, free_case, options_of, write_results

from hdvplan.api import drive_case
from hdvplan.case import Case
from hdvplan.judging.balance import balance_of
from hdvplan.report.grid import markdown_table
from hdvplan.road.limits import Limits
from hdvplan.road.road import Road

ROADS = {"goteborg_nya_allen": 3.0, "goteborg_tuvevagen_brunnsbo": 3.5}  # with their half widths [m]
VEHICLES = ("bus", "tractor-trailer")
APART_M = (500.0, 300.0, 150.0)
TITLE = """# What obstacles cost

Mean planning step (RTI, riccati) in milliseconds, every step with its fastest of the rounds, with and without vans, interleaved.

"""
VAN_LENGTH_M, VAN_EDGE_M = 6.0, -0.8  # from the right, to this offset: wheels must leave the middle of the road
FIRST_M, LAST_M = 120.0, 50.0  # from the road's start, and before its end


def main() -> None:
    """Drive all combinations interleaved and write the tables."""
    parser = options_of(__doc__, "obstacles")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    rows: list[dict[str, object]] = []
    driven: list[Case] = []
    for name, half_width in ROADS.items():
        for vehicle in VEHICLES:
            free = case_within(free_case(name, vehicle), half_width)
            for apart in APART_M:
                parked, vans = with_vans(free.road, half_width, apart)
                pair = free, replace(free, road=parked)
                rows.append({"road": name, "vehicle": vehicle, "apart_m": apart, "vans": vans} | compared(*pair, options.rounds))
                driven += pair
                print(*rows[-1].values(), sep="  ", flush=True)
    table = pd.DataFrame(rows)
    shown = table.assign(**{str(name): table[name].map("{:.3f}".format) for name in table.select_dtypes("float")})
    text = f"{TITLE}{markdown_table(shown, text=('road', 'vehicle'))}\n"
    write_results(options.out, {"obstacles": table}, {"obstacles": text}, driven)


def with_vans(road: Road, half_width: float, apart: float) -> tuple[Road, int]:
    """Return the road with vans parked on its right, and how many."""
    length = road.path.length
    vans = np.arange(FIRST_M, length - LAST_M, apart)
    corners = np.repeat(vans, 4) + np.tile([0.0, 0.0, VAN_LENGTH_M, VAN_LENGTH_M], len(vans))
    s = np.concatenate([[0.0], corners, [length]])
    edge = np.concatenate([[-half_width], np.tile([-half_width, VAN_EDGE_M, VAN_EDGE_M, -half_width], len(vans)), [-half_width]])
    left = np.full(len(s), half_width)
    return road.within(Limits(s, left, edge, left, edge)), len(vans)


def compared(free: Case, parked: Case, rounds: int) -> dict[str, object]:
    """Return of one row both mean steps, their ratio, and whether the vans were passed."""
    times: dict[Case, list[list[float]]] = {free: [], parked: []}
    for _ in range(rounds):
        for case, found in times.items():
            done = drive_case(case)
            found.append([1e3 * plan.times.total for plan in done.plans])
    without, with_them = (float(np.mean(np.min(found, axis=0))) for found in times.values())
    return {
        "free_ms": without,
        "parked_ms": with_them,
        "ratio": with_them / without,
        "violation_m": balance_of(done).violation,
    }


if __name__ == "__main__":
    main()
