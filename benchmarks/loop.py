"""Plans in a closed loop: a simulated driver and two controllers, with delay, noise and gain errors; what they err by, judged.

python benchmarks/loop.py [--out results/loop] [--roads a,b] [--vehicles a,b]

Streets and clearances are those of results/tracking/roads.csv. Writes loop.csv, loop.md and run.json.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from cases import case_within, free_case, options_of, words, write_results

import hdvplan
from hdvplan.case import Case
from hdvplan.judging.tracking import tracking_of
from hdvplan.loop import LoopSettings
from hdvplan.loop.closed import NOISES
from hdvplan.report.grid import markdown_table
from hdvplan.settings import any_of

STREETS = Path(__file__).parents[1] / "results" / "tracking" / "roads.csv"
FOLLOWERS = {"driver": "driver", "pure pursuit": "pure-pursuit", "Stanley": "stanley"}
SETTINGS = LoopSettings(seed=5)


def rows_of(case: Case) -> list[dict[str, object]]:
    """Return a row for each follower of a case's plan: what it erred by in all runs, and the verdict on the widest one."""
    result, found = hdvplan.plan(case), []
    for name, follower in FOLLOWERS.items():
        loop = hdvplan.closed_loop(result, follower, SETTINGS)
        errors, lengths = loop.frame["error_m"], loop.frame["length_m"]
        widest = int(np.argmax(errors))
        allowed, judged = tracking_of(result.drive, result.balance, lengths[widest]), loop.results[widest]
        row: dict[str, object] = {"road": case.road.name, "vehicle": case.vehicle.name, "follower": name}
        row |= {
            "deviation_m": float(np.nanstd(loop.driven.offset)),
            "error_m": float(np.median(errors)),
            "length_m": float(np.median(lengths)),
        }
        row |= {"error_widest_m": errors[widest], "length_widest_m": lengths[widest]}
        row |= {"allowed_m": None if allowed is None else allowed.error, "spare_planned_m": result.balance.min_clearance}
        row |= {"spare_driven_m": None if judged is None else judged.balance.min_clearance}
        print(*row.values(), sep="  ", flush=True)
        found.append(row)
    return found


def main() -> None:
    """Follow a plan on every road with every vehicle and write the table."""
    parser = options_of(__doc__, "loop")
    parser.add_argument("--roads", type=words)
    parser.add_argument("--vehicles", type=words)
    options = parser.parse_args()
    rows, cases = [], []
    for street in pd.read_csv(STREETS).to_dict("records"):
        if street["road"] in (options.roads or [street["road"]]) and street["vehicle"] in (options.vehicles or [street["vehicle"]]):
            case = case_within(free_case(street["road"], street["vehicle"]), street["half_width_m"])
            cases.append(replace(case, settings=replace(case.settings, clearance=street["clearance_m"])))
            rows += rows_of(cases[-1])
    table = pd.DataFrame(rows)
    write_results(options.out, {"loop": table}, {"loop": markdown(table)}, cases)


def markdown(table: pd.DataFrame) -> str:
    """Return the table as it is read."""
    names = {
        "deviation_m": "deviation [m]", "error_m": "E [m]", "length_m": "l [m]", "error_widest_m": "widest E [m]",
        "length_widest_m": "its l [m]", "allowed_m": "E that the bound allows [m]", "spare_planned_m": "spare, planned [m]",
        "spare_driven_m": "spare, driven [m]",
    }  # fmt: skip
    shown = table.rename(columns=names)
    for name in names.values():
        shown[name] = shown[name].map("{:.2f}".format)
    held, fits = table["error_widest_m"] <= table["allowed_m"], table["spare_driven_m"] >= 0.0
    offset, *angles = (deviation for deviation, _ in NOISES.values())
    heading, wheels = np.degrees(angles)
    runs, gains = len(SETTINGS.gains), any_of([f"{gain:.1f}" for gain in dict.fromkeys(SETTINGS.gains)])
    return f"""# Plans in a closed loop

A simulated driver, pure pursuit and Stanley's controller follow the plans with the largest clearance of [the ten
roads](../tracking/roads.md), {runs} runs each, at up to {SETTINGS.speed:.0f} km/h and {SETTINGS.sideways:g} m/s2 sideways.
Delay {SETTINGS.delay} s; wheels turn by {gains} times what is wanted; noise with standard deviations of
{offset:g} m in what is seen of the offset, {heading:.1f} degrees in the heading, {wheels:.1f} degrees in the wheels.

The deviation is the standard deviation of the front axle's offset. E is a run's largest offset, l that over its largest change a metre,
both the median of the runs. The widest run is judged as a path of one's own: of {len(table)} such runs {held.sum()} keep to the E that
the bound allows for their l, of which {(held & fits).sum()} keep the street, as they must; of the others {(~held & fits).sum()} of
{(~held).sum()} do.

{markdown_table(shown, text=("road", "vehicle", "follower"))}
"""


if __name__ == "__main__":
    main()
