"""Turning heads, three-point turns and docks: what room manoeuvres were found with, from many starts. Writes heads.csv, heads.md, run.json.

python benchmarks/turning_heads.py [--out results/turning-heads] [--starts 5] [--cases NAME,...]
"""

from __future__ import annotations

from time import process_time

import pandas as pd
from cases import options_of, words, write_results

from hdvplan.report.grid import markdown_table
from hdvplan.turning.reversing.answer import reversing
from hdvplan.turning.reversing.options import SiteOptions, Template
from hdvplan.vehicle.load import load_vehicle, parse_vehicle
from hdvplan.vehicle.model import Vehicle

_REFUSE = """
[[unit]]
wheelbase = 5.85
front_overhang = 1.5
rear_overhang = 3.85
width = 2.55
max_curvature = 0.16051364 # 1 / 6.23 m
"""
_ASKED = {("three-point", "walls"): 13.9, ("three-point", "kerbs, 0.5 m of overhang"): 12.9, ("hammerhead", "4.8 m, kerbs of 6 m"): 22.4}
_RIGS = ("rigid-truck", "WB-40", "WB-67")
_KINGSLEY = {3.5: 36.5, 4.0: 35.5, 4.5: 34.5, 5.0: 33.6, 5.5: 32.8}


def main() -> None:
    """Look for every manoeuvre and write the tables."""
    parser = options_of(__doc__, "turning-heads")
    parser.add_argument("--starts", type=int, default=5)
    parser.add_argument("--cases", type=words, help="names of the first column, with commas between them")
    asked = parser.parse_args()
    rows = [
        row
        for template, vehicle, place, options in _cases()
        if asked.cases is None or str(template) in asked.cases
        for row in _rows(template, vehicle, place, options, asked.starts)
    ]
    table = pd.DataFrame(rows)
    write_results(asked.out, {"heads": table}, {"heads": _page(table)}, [])


def _cases() -> list[tuple[Template, Vehicle, str, SiteOptions]]:
    refuse = parse_vehicle(_REFUSE, default_name="refuse")
    turned = [
        (Template.THREE_POINT, "walls", SiteOptions()),
        (Template.THREE_POINT, "kerbs, 0.5 m of overhang", SiteOptions(overhang=0.5)),
        (Template.HAMMERHEAD, "4.8 m, kerbs of 6 m", SiteOptions()),
        (Template.HAMMERHEAD, "the same, 0.6 m of overhang", SiteOptions(overhang=0.6)),
        (Template.SIDE_HEAD, "4.8 m, kerbs of 6 m", SiteOptions()),
    ]
    cases = [(template, refuse, place, options) for template, place, options in turned]
    cases += [(Template.THREE_POINT, load_vehicle(name), "walls", SiteOptions()) for name in ("citaro", "rigid-truck")]
    rigs = load_vehicle("tractor-semitrailer"), load_vehicle("WB-62")
    for template in (Template.DOCK_90, Template.DOCK_45):
        for spacing in _KINGSLEY:
            cases += [(template, vehicle, f"doors {spacing:g} m", SiteOptions(door_spacing=spacing)) for vehicle in rigs]
        cases += [(template, load_vehicle(name), "doors 4 m", SiteOptions(door_spacing=4.0)) for name in _RIGS]
    return cases


def _rows(template: Template, vehicle: Vehicle, place: str, options: SiteOptions, starts: int) -> list[dict[str, object]]:
    began = process_time()
    answer = reversing(vehicle, template, options, starts=starts, all_legs=True)
    taken = process_time() - began
    return [
        {
            "template": str(template),
            "vehicle": vehicle.name,
            "place": place,
            "legs": tried.legs,
            "fits_with_m": tried.manoeuvre.rounded,
            "best_m": tried.manoeuvre.size,
            "start_m": tried.sizes[0],
            "median_m": float(pd.Series(tried.sizes).median()),
            "worst_m": tried.sizes[-1],
            "found_by": f"{len(tried.sizes)} of {tried.starts}",
            "over_m": tried.manoeuvre.over_kerbs,
            "cpu_s": taken / sum(one.starts for one in answer.tried),
        }
        for tried in answer.tried
    ]


def _page(table: pd.DataFrame) -> str:
    about = (
        "The least room with which a manoeuvre of forward and backward legs was found: street width (three-point), length from tip "
        "to tip (hammerhead), the arm from the road's kerb line (side-head), the apron (docks) [m]. best: what a program made of the best "
        "start, where that is better; start, median, worst: of the starts of one search that found a way; less may do. over: how far "
        "bodies reach over kerbs that stand. cpu_s: processor time of a start, with its share of the program's. Only the best is judged, "
        "with poses 0.05 m apart."
    )
    cells = markdown_table(table.round(3), text=("template", "vehicle", "place", "found_by"))
    targets = " ".join(f"{name}, {place}: {size:g} m for the refuse vehicle." for (name, place), size in _ASKED.items())
    docks = (
        "Kingsley's table of aprons for an articulated vehicle: "
        + ", ".join(f"{far:g} m at {at:g} m" for at, far in _KINGSLEY.items())
        + "."
    )
    return f"# Turning heads and docks\n\n{about}\n\n{cells}\n\nFound before by others: {targets} {docks}\n"


if __name__ == "__main__":
    main()
