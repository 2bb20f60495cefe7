"""Every shipped road at several widths: which vehicles fit, and where not. Writes ``widths.csv``, ``widths.md``, run.json.

python benchmarks/widths.py [--out results/widths] [--roads a,b] [--vehicles a,b] [--half-widths 1.75,3]
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from cases import case_within, free_case, numbers, options_of, words, write_results

from hdvplan.api import plan
from hdvplan.case import Case
from hdvplan.errors import HdvplanError
from hdvplan.judging.result import Result
from hdvplan.judging.sentences import breach_text
from hdvplan.report.grid import markdown_table
from hdvplan.road.scenarios import shipped

VEHICLES = ("bus", "tractor-trailer", "tractor-trailer-24m")
HALF_WIDTHS_M = (1.75, 2.25, 3.0, 3.5, 4.5, 6.0)  # roads 3.5, 4.5 and 6 m wide, and limits that far to each side


def main() -> None:
    """Drive every combination and write the tables."""
    parser = options_of(__doc__, "widths")
    parser.add_argument("--roads", type=words, default=list(shipped()))
    parser.add_argument("--vehicles", type=words, default=list(VEHICLES))
    parser.add_argument("--half-widths", type=numbers, default=list(HALF_WIDTHS_M))
    options = parser.parse_args()
    rows, cases = [], []
    for name in options.roads:
        for vehicle in options.vehicles:
            for half_width in options.half_widths:
                cases.append(case_within(free_case(name, vehicle), half_width))
                rows.append(driven(cases[-1], half_width))
                print(*rows[-1].values(), sep="  ", flush=True)
    table = pd.DataFrame(rows)
    write_results(options.out, {"widths": table}, {"widths": markdown(table)}, cases)


def driven(case: Case, half_width: float) -> dict[str, object]:
    """Return one row: the verdict, what the plan swept and broke, and how the planner fared."""
    row: dict[str, object] = {"road": case.road.name, "vehicle": case.vehicle.name, "half_width": half_width}
    try:
        result = plan(case)
    except HdvplanError as error:
        return row | {"verdict": "refused", "message": str(error)}
    return row | _numbers(result)


def _numbers(result: Result) -> dict[str, object]:
    breaches, plans = result.balance.breaches, result.drive.plans
    deepest = max(breaches, key=lambda breach: breach.depth, default=None)
    return {
        "verdict": "kept" if deepest is None else "broken",
        "message": "" if deepest is None else breach_text(result, deepest),
        "max_left": result.balance.max_left,
        "max_right": result.balance.max_right,
        "violation": result.balance.violation if breaches else 0.0,
        "breaches": len(breaches),
        "broken_length": sum(breach.s_to - breach.s_from for breach in breaches),
        "plans": len(plans),
        "failed_steps": len(result.failed),
        "unsolved_programs": sum(plan.status != "solved" for plan in plans),
        "programs_mean": float(np.mean([plan.qp_count for plan in plans])),
        "steps_halved": sum(plan.halvings for plan in plans),
    }


def markdown(table: pd.DataFrame) -> str:
    """Return the verdicts, a road a row: kept, or by how much the limits are broken at the deepest place."""
    shown = table.assign(cell=[_cell(row) for _, row in table.iterrows()])
    parts = ["# Every shipped road at several widths\n"]
    parts.append(
        "Limits at so many metres to each side of the line as given. `ok`: all limits kept, to 1 cm, as simulated; a number: how"
        " far the deepest violation is beyond its limit [m], reported with its place in `widths.csv`.\n"
    )
    for name, group in shown.groupby("vehicle", sort=False):
        cells = group.pivot_table(index="road", columns="half_width", values="cell", aggfunc="first", sort=False)
        counts = group["verdict"].value_counts()
        total = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
        parts.append(f"## {name}\n\n{len(group)} runs: {total}; {int(group['failed_steps'].sum())} planning steps failed.\n")
        parts.append(markdown_table(cells.reset_index(), text=("road",)) + "\n")
    return "\n".join(parts)


def _cell(row: pd.Series) -> str:
    return {"kept": "ok", "refused": "refused"}.get(str(row["verdict"]), f"{row['violation']:.2f}")


if __name__ == "__main__":
    main()
