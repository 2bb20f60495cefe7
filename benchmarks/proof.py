"""What is proved impossible, beside what was planned: least half widths from both sides, and every NO of ``results/widths``.

Writes need.csv, widths.csv, proof.md, run.json.

python benchmarks/proof.py [--out results/proof] [--roads a,b] [--vehicles a,b] [--half-widths 1.75,3] [--skip need|widths]
    [--widths results/widths/widths.csv]

Goes on where it stopped. A cell that is planned within its limits is examined too: a proof there would be a contradiction.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from itertools import product
from pathlib import Path
from time import process_time

import pandas as pd
from cases import append_row, case_within, free_case, numbers, options_of, suite_roads, words

from hdvplan.api import plan
from hdvplan.case import Case
from hdvplan.errors import HdvplanError
from hdvplan.judging.clearance import SIDES
from hdvplan.judging.result import Proof
from hdvplan.judging.verdict import verdict_of
from hdvplan.need.answer import need_of, proved_below
from hdvplan.need.search import even
from hdvplan.proof.answer import proof_of, stretches_of
from hdvplan.record import write_record
from hdvplan.report.grid import markdown_table

VEHICLES = ("bus", "citaro-k", "tractor-trailer")

Row = dict[str, object]


def main() -> None:
    """Prove, and write the tables."""
    parser = options_of(__doc__, "proof")
    parser.add_argument("--roads", type=words)
    parser.add_argument("--vehicles", type=words)
    parser.add_argument("--half-widths", type=numbers, help="of the runs in --widths")
    parser.add_argument("--widths", type=Path, default=Path("results/widths/widths.csv"))
    parser.add_argument("--skip", choices=("need", "widths"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    pairs = []
    if options.skip != "need":
        wanted = list(product(options.roads or suite_roads(), options.vehicles or VEHICLES))
        _filled(options.out / "need.csv", ["road", "vehicle"], wanted, lambda road, vehicle: bounded(free_case(road, vehicle)))
        pairs += wanted
    if options.skip != "widths":
        runs = pd.read_csv(options.widths)
        runs = runs[runs["verdict"] != "refused"]
        for name, asked in (("road", options.roads), ("vehicle", options.vehicles), ("half_width", options.half_widths)):
            runs = runs if asked is None else runs[runs[name].isin(asked)]
        keys = list(runs[["road", "vehicle", "half_width"]].itertuples(index=False, name=None))
        _filled(
            options.out / "widths.csv",
            ["road", "vehicle", "half_width"],
            keys,
            lambda road, vehicle, half_width: examined(free_case(road, vehicle), float(half_width)),
        )
        pairs += [(road, vehicle) for road, vehicle, _ in keys]
    (options.out / "proof.md").write_text(markdown(options.out), encoding="utf-8")
    write_record(options.out, [free_case(road, vehicle) for road, vehicle in dict.fromkeys(pairs)])


def _filled(table: Path, keys: list[str], wanted: Iterable[tuple[object, ...]], row_of: Callable[..., Row]) -> None:
    """Append to ``table`` a row for every key of ``wanted`` that it has none for."""
    done = set(pd.read_csv(table)[keys].itertuples(index=False, name=None)) if table.exists() else set()
    for key in wanted:
        if key not in done:
            row = dict(zip(keys, key, strict=True)) | row_of(*key)
            append_row(table, row)
            print(*row.values(), sep="  ", flush=True)


def bounded(case: Case) -> Row:
    """Return the least half width that was planned, and the largest that is proved to be too small."""
    began = process_time()
    need = need_of(case)
    between = process_time()
    bound = proved_below(case, even(case.road), need.room, SIDES, None)
    row: Row = {"half_width": need.room.room, "proved_below": None if bound is None else bound.room}
    row |= _told(None if bound is None else bound.proof)
    return row | {"need_cpu_s": between - began, "proof_cpu_s": process_time() - between}


def examined(case: Case, half_width: float) -> Row:
    """Return what a plan within a half width comes to, and what is proved on its tight stretches, whether it fits or not."""
    began = process_time()
    try:
        result = plan(case_within(case, half_width))
    except HdvplanError:
        return {"fits": "", **_told(None), "stretches": 0, "examined_m": 0.0, "plan_cpu_s": process_time() - began, "proof_cpu_s": 0.0}
    between = process_time()
    stretches, seen, proof = stretches_of(result), 0.0, None
    for stretch in stretches:
        seen += stretch.s_to - stretch.s_from
        proof = proof_of(result.case, stretch.s_from, stretch.s_to)
        if proof is not None:
            break
    row: Row = {"fits": bool(verdict_of(result).fits), **_told(proof), "stretches": len(stretches), "examined_m": seen}
    return row | {"plan_cpu_s": between - began, "proof_cpu_s": process_time() - between}


def _told(proof: Proof | None) -> Row:
    if proof is None:
        return {"kind": "", "s_from": None, "s_to": None, "unit": None}
    return {"kind": proof.kind, "s_from": proof.s_from, "s_to": proof.s_to, "unit": proof.unit}


def markdown(directory: Path) -> str:
    """Return both tables, as far as they are there."""
    parts = ["# What is proved impossible\n"]
    if (directory / "need.csv").exists():
        parts += _need_parts(pd.read_csv(directory / "need.csv"))
    if (directory / "widths.csv").exists():
        parts += _widths_parts(pd.read_csv(directory / "widths.csv"))
    return "\n".join(parts)


def _need_parts(table: pd.DataFrame) -> list[str]:
    gap = table["half_width"] - table["proved_below"]
    shown = pd.DataFrame(
        {
            "road": table["road"],
            "vehicle": table["vehicle"],
            "planned within [m]": table["half_width"].map("{:.2f}".format),
            "proved impossible within [m]": _metres(table["proved_below"]),
            "between [m]": _metres(gap),
            "proved at s [m]": [_stretch(row) for row in table.to_dict("records")],
            "CPU time [s]": table["proof_cpu_s"].map("{:.0f}".format),
        }
    )
    medians = gap.groupby(table["vehicle"], sort=False).median()
    said = ", ".join(f"{vehicle} {median:.2f} m" for vehicle, median in medians.items())
    about = "Half widths about the line: the least for which a plan was found, and the largest for which there is a proof that none exists."
    return [
        f"## Least half widths\n\n{about} Median of what lies between: {said}.\n",
        markdown_table(shown, text=("road", "vehicle")) + "\n",
    ]


def _metres(values: pd.Series[float]) -> list[str]:
    return [f"{value:.2f}" if value == value else "-" for value in values]  # noqa: PLR0124 - NaN is where nothing is proved


def _stretch(row: Mapping[Hashable, object]) -> str:
    if row["kind"] == "place":
        return f"{row['s_to']:.0f}"
    return f"{row['s_from']:.0f} to {row['s_to']:.0f}" if row["kind"] == "motion" else "-"


def _widths_parts(table: pd.DataFrame) -> list[str]:
    fits, proved = table["fits"].astype(str) == "True", table["kind"].notna() & (table["kind"] != "")
    rows = []
    for vehicle, group in table.groupby("vehicle", sort=False):
        no = ~fits[group.index]
        rows.append(
            {
                "vehicle": vehicle,
                "runs": len(group),
                "planned within the limits": int((~no).sum()),
                "of these proved impossible": int((~no & proved[group.index]).sum()),
                "not planned within them": int(no.sum()),
                "of these proved impossible (NO)": int((no & proved[group.index]).sum()),
                "share": f"{100.0 * (no & proved[group.index]).sum() / max(1, no.sum()):.0f} %",
                "CPU time, mean [s]": f"{group['proof_cpu_s'].mean():.1f}",
                "largest [s]": f"{group['proof_cpu_s'].max():.1f}",
            }
        )
    about = "The runs of `results/widths`, each planned once more; its tight stretches were examined whether the plan fits or not."
    return [f"## Every road at several widths\n\n{about}\n", markdown_table(pd.DataFrame(rows), text=("vehicle",)) + "\n"]


if __name__ == "__main__":
    main()
