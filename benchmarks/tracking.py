"""How far a driver may stray on the ten roads, before and after a plan with the largest clearance. Writes roads.csv, roads.md, run.json.

Limits lie 0.6 m beyond what a plan without limits sweeps, to 0.1 m.

python benchmarks/tracking.py [--out results/tracking] [--roads a,b] [--vehicles a,b]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from cases import case_within, free_case, suite_roads, words, write_results

from hdvplan.api import plan
from hdvplan.case import Case
from hdvplan.finer import clearest
from hdvplan.judging.result import Result, body_name
from hdvplan.judging.tracking import Tracking
from hdvplan.report.grid import markdown_table

VEHICLES = ("bus", "tractor-trailer")
ROOM_M = 0.6


def main(arguments: Sequence[str] | None = None) -> None:
    """Drive every road with every vehicle and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/tracking"))
    parser.add_argument("--roads", type=words, default=suite_roads())
    parser.add_argument("--vehicles", type=words, default=list(VEHICLES))
    options = parser.parse_args(arguments)
    rows, cases = [], []
    for road in options.roads:
        for vehicle in options.vehicles:
            free = free_case(road, vehicle)
            half_width = float(np.ceil(10.0 * (plan(free).balance.half_width + ROOM_M))) / 10.0
            cases.append(case_within(free, half_width))
            rows.append(row_of(cases[-1], half_width))
            print(*rows[-1].values(), sep="  ", flush=True)
    table = pd.DataFrame(rows)
    write_results(options.out, "roads", table, markdown(table), cases)


def row_of(case: Case, half_width: float) -> dict[str, object]:
    """Return what a plan leaves its driver, the share of the drive's time that it took to find that, and what most clearance leaves."""
    begin = time.process_time()
    first = plan(case)
    planned = time.process_time()
    spare, tracking = first.balance.min_clearance, first.tracking
    share = (time.process_time() - planned) / (planned - begin)
    most = clearest(first)
    found: dict[str, object] = {"road": case.road.name, "vehicle": case.vehicle.name, "half_width_m": half_width, "spare_m": spare}
    found |= _told(first, tracking) | {"share_of_drive": share, "clearance_m": most.case.settings.clearance}
    return found | {f"{name}_then": value for name, value in _told(most, most.tracking).items()}


def _told(result: Result, tracking: Tracking | None) -> dict[str, object]:
    if tracking is None:
        return {"error_m": None, "s_m": None, "part": None}
    name = body_name(result.drive.vehicle, tracking.unit)
    return {"error_m": tracking.error, "s_m": tracking.s, "part": f"{tracking.part} of the {name}" if tracking.decided else "none known"}


def markdown(table: pd.DataFrame) -> str:
    """Return the table as it is read."""
    shown = pd.DataFrame({"road": table["road"], "vehicle": table["vehicle"], "half width [m]": table["half_width_m"].map("{:.1f}".format)})
    shown["spare [m]"], shown["E [m]"] = (table[name].map("{:.2f}".format) for name in ("spare_m", "error_m"))
    shown["spare / E"] = (
        (table["spare_m"] / table["error_m"]).where(table["error_m"] > 0.0).map("{:.2f}".format, na_action="ignore").fillna("-")
    )
    shown["decided by, at s"] = table["part"] + table["s_m"].map(", {:.0f} m".format)
    shown["largest clearance [m]"] = table["clearance_m"].map("{:.2f}".format)
    shown["E then [m]"] = table["error_m_then"].map("{:.2f}".format)
    shown["decided then by, at s"] = table["part_then"] + table["s_m_then"].map(", {:.0f} m".format)
    shown["search / drive"] = table["share_of_drive"].map("{:.2f}".format)
    return f"""# How far a driver may stray

E is the largest lateral error of the front axle, its direction within E / 6 m, with which every body provably stays within limits that lie
{ROOM_M:g} m beyond what the vehicle sweeps without any; at most 1 m is looked for. Then the same with the largest clearance that a plan can
keep. The last column is CPU time of finding E over that of the drive.

{markdown_table(shown, text=("road", "vehicle", "decided by, at s", "decided then by, at s"))}
"""


if __name__ == "__main__":
    main()
