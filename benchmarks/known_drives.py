"""Streets drawn around random drives that are known: how many a plan finds, and whether a YES crosses an edge. Writes known.csv, known.md.

python benchmarks/known_drives.py [--out results/known-drives] [--first 0] [--drives 60] [--vehicles a,b] [--margins 0.05,0.02,-0.1]

Edges lie so many metres outside what the drive sweeps; -0.1: inside, so that nothing fits for all that is known. Every street is planned
by RTI alone, with repairs, and with what ``replanned`` tries besides. Poses of every plan that fits are integrated anew, every 2 cm, and
held against the edges, the street's ends included. A seed whose drive meets itself is left out. Goes on where it stopped.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from time import process_time

import numpy as np
import pandas as pd
from cases import fill_by_seed, numbers, options_of, words
from random_drives import crosses, edges_around, random_drive, road_around

from hdvplan import api
from hdvplan.case import Case
from hdvplan.errors import HdvplanError
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.verdict import verdict_of
from hdvplan.planning.settings import PlannerSettings
from hdvplan.record import write_record
from hdvplan.report.grid import markdown_table
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle

VEHICLES = ("bus", "articulated-bus", "tractor-trailer", "a-double")
MARGINS_M = (0.05, 0.02, -0.1)
_CHORDS_M = 2e-3  # of the edges, and sweeps of the judge
_WAYS = ("rti", "repaired", "finer")


def main() -> None:
    """Plan along every known drive, and write a row a street."""
    parser = options_of(__doc__, "known-drives")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--drives", type=int, default=60)
    parser.add_argument("--vehicles", type=words, default=list(VEHICLES))
    parser.add_argument("--margins", type=numbers, default=list(MARGINS_M))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    table = options.out / "known.csv"
    for name in options.vehicles:
        vehicle = load_vehicle(name)
        for margin in options.margins:
            known, row_of = _known(table, name, margin), partial(_tried, vehicle, margin)
            fill_by_seed(table, known, row_of, first=options.first, most=options.drives, form="%.4f")
    (options.out / "known.md").write_text(_page(pd.read_csv(table, keep_default_na=False)), encoding="utf-8")
    write_record(options.out, [])  # a seed is all that a case needs


def _known(table: Path, name: str, margin: float) -> set[int]:
    """Return the seeds that are in the table."""
    if not table.exists():
        return set()
    rows = pd.read_csv(table)
    return set(rows["seed"][(rows["vehicle"] == name) & (rows["margin"] == margin)])


def _tried(vehicle: Vehicle, margin: float, seed: int) -> dict[str, object] | None:
    """Return the row of a street: what every way has to spare; None where the known drive meets itself."""
    poses = random_drive(vehicle, seed)
    edges = edges_around(vehicle, poses, margin)
    if edges is None:
        return None
    row: dict[str, object] = {"vehicle": vehicle.name, "margin": margin, "seed": seed}
    began, error = process_time(), ""
    spare = dict.fromkeys(_WAYS, -np.inf)
    crossed = False
    try:
        case = Case(road_around(vehicle, poses, edges), vehicle)
        for way, settings in (("rti", PlannerSettings(rti_repairs=0)), ("repaired", PlannerSettings())):
            result = api.plan(replace(case, settings=settings))
            spare[way] = spare["finer"] = verdict_of(result).spare or 0.0
            crossed |= bool(verdict_of(result).fits) and crosses(result, edges, KEPT_M + _CHORDS_M)
        if not verdict_of(result).fits:
            result = api.replanned(result)
            spare["finer"] = verdict_of(result).spare or 0.0
            crossed |= bool(verdict_of(result).fits) and crosses(result, edges, KEPT_M + _CHORDS_M)
    except HdvplanError as raised:
        error = str(raised)
    return row | spare | {"crossed": crossed, "cpu_s": process_time() - began, "error": error}


def _page(table: pd.DataFrame) -> str:
    """Return what known.md says."""
    shown = []
    for vehicle, margin in dict.fromkeys(zip(table["vehicle"].tolist(), table["margin"].tolist(), strict=True)):
        rows = table[(table["vehicle"] == vehicle) & (table["margin"] == margin)]
        by_rti, repaired, finer = (int(np.sum(rows[way] >= -KEPT_M)) for way in _WAYS)
        more = float(np.max(-rows["finer"])) - max(0.0, -margin)
        shown.append({
            "vehicle": vehicle, "outside [m]": f"{margin:g}", "drives": len(rows), "YES by RTI": by_rti, "with repairs": repaired,
            "planned again": finer, "false YES": int(np.sum(rows["crossed"])), "errors": int(np.sum(rows["error"] != "")),
            "lacking at most, more than the known drive [m]": f"{max(0.0, more):.3f}",
        })  # fmt: skip
    about = (
        "Streets whose edges lie so far outside what a random drive sweeps; negative: inside it, so that a YES would be false. False YES: "
        f"a body is more than {1e3 * (KEPT_M + _CHORDS_M):.0f} mm over an edge in poses every 2 cm."
    )
    return f"# Streets along known drives\n\n{about}\n\n{markdown_table(pd.DataFrame(shown), text=('vehicle',))}\n"


if __name__ == "__main__":
    main()
