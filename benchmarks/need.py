"""The least half width of the benchmark roads, checked from both sides. Writes ``need.csv``, ``need.md``, run.json.

python benchmarks/need.py [--out results/need] [--roads a,b] [--vehicles a,b] [--hunted a,b]

Every answer is planned again 1 cm wider, as ``hdvplan plan`` does by default: that must fit. On the roads in ``--hunted`` 20 objectives,
schemes and starts look for a plan 2 cm narrower: none may fit.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from time import process_time

import pandas as pd
from cases import case_within, free_case, options_of, suite_roads, words, write_results

from hdvplan.api import plan, replanned
from hdvplan.case import Case
from hdvplan.errors import PlanError
from hdvplan.judging.result import body_name
from hdvplan.judging.verdict import verdict_of
from hdvplan.need.answer import Need, need_of
from hdvplan.planning.bias import Bias
from hdvplan.planning.settings import Scheme
from hdvplan.report.grid import markdown_table

VEHICLES = ("bus", "tractor-trailer", "tractor-trailer-24m")
HUNTED = ("monaco_fairmont_hairpin", "goteborg_lindholmsallen_uturn", "newyork_columbus_circle")
_WIDER_M, _NARROWER_M = 0.01, 0.02
_OBJECTIVES = ("geometric", "balanced", "lead-axle", "trail-axle", "art-weighted", "geometric-fixed", "axle-max", "body-max")
_STARTS_M = (-0.3, 0.3)  # biases that begin the search elsewhere


def main() -> None:
    """Find and check every need, and write the tables."""
    parser = options_of(__doc__, "need")
    parser.add_argument("--roads", type=words, default=suite_roads())
    parser.add_argument("--vehicles", type=words, default=list(VEHICLES))
    parser.add_argument("--hunted", type=words, default=list(HUNTED))
    options = parser.parse_args()
    rows, cases = [], []
    for name in options.roads:
        for vehicle in options.vehicles:
            cases.append(free_case(name, vehicle))
            rows.append(checked(cases[-1], hunted=name in options.hunted))
            print(*rows[-1].values(), sep="  ", flush=True)
    table = pd.DataFrame(rows)
    write_results(options.out, {"need": table}, {"need": markdown(table)}, cases)


def checked(case: Case, *, hunted: bool) -> dict[str, object]:
    """Return one row: the need, where it is decided, and what plans a little wider and narrower say."""
    began = process_time()
    need = need_of(case)
    row = {"road": case.road.name, "vehicle": case.vehicle.name, "cpu_s": process_time() - began}
    if need.room.result is None or need.place is None:
        return row | {"message": str(need.room.failure)}
    at = {"s": need.place.s, "body": body_name(case.vehicle, need.place.unit), "part": need.place.part, "side": need.place.side}
    row |= {"half_width": need.room.room, "plans": need.room.plans, **at, "by": need.room.result.objective}
    wider = replanned(plan(case_within(case, need.room.room + _WIDER_M)))
    row["fits_1_cm_wider"] = bool(verdict_of(wider).fits)
    if hunted:
        tried = list(_hunted(case, need))
        row |= {"tried_2_cm_narrower": len(tried), "fitting_2_cm_narrower": sum(tried)}
    return row


def _hunted(case: Case, need: Need) -> Iterator[bool]:
    """Yield whether a plan fits 2 cm less than the need, for every objective, scheme and start; a plan that cannot be made does not."""
    narrow = case_within(case, need.room.room - _NARROWER_M)
    ways = [(objective, scheme, 0.0) for objective in _OBJECTIVES for scheme in Scheme]
    ways += [("geometric", scheme, start) for scheme in Scheme for start in _STARTS_M]
    for objective, scheme, start in ways:
        settings = replace(narrow.settings, scheme=scheme)
        try:
            made = plan(replace(narrow, objective=objective, settings=settings, bias=Bias.constant(start)))
        except PlanError:
            yield False
        else:
            yield bool(verdict_of(made).fits)


def markdown(table: pd.DataFrame) -> str:
    """Return the needs as a table, and the checks in two sentences."""
    shown = pd.DataFrame(
        {
            "road": table["road"],
            "vehicle": table["vehicle"],
            "half width [m]": table["half_width"].map("{:.2f}".format),
            "decided at s [m]": table["s"].map("{:.1f}".format),
            "by": table["body"] + ", " + table["part"] + ", " + table["side"],
            "CPU time [s]": table["cpu_s"].map("{:.1f}".format),
        }
    )
    found = table[table["half_width"].notna()]
    hunted = found[found.get("tried_2_cm_narrower", pd.Series(index=found.index, dtype=float)).notna()]
    parts = ["# The least half width of the benchmark roads\n"]
    parts.append("Least half width about the line as given for which a plan was found, to 1 cm, clearance 0.\n")
    parts.append(markdown_table(shown, text=("road", "vehicle", "by")) + "\n")
    parts.append(f"One centimetre wider, `hdvplan plan` says YES on {int(found['fits_1_cm_wider'].sum())} of {len(found)}.\n")
    if len(hunted):
        tried, fitting = int(hunted["tried_2_cm_narrower"].sum()), int(hunted["fitting_2_cm_narrower"].sum())
        parts.append(
            f"Two centimetres narrower, {fitting} of {tried} plans fit (objectives, schemes and starts on {len(hunted)} of them).\n"
        )
    return "\n".join(parts)


if __name__ == "__main__":
    main()
