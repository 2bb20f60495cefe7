"""Plans that were missed, found by planning again and with stations nearer together: every unproved NO of ``results/proof``.

Writes roads.csv, finer.md, run.json.

python benchmarks/finer.py [--out results/finer] [--proof results/proof/widths.csv]
"""

from __future__ import annotations

from pathlib import Path
from time import process_time

import numpy as np
import pandas as pd
from cases import case_within, free_case, options_of, write_results

from hdvplan import api
from hdvplan.case import Case
from hdvplan.errors import HdvplanError
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import verdict_of
from hdvplan.report.grid import markdown_table


def main() -> None:
    """Plan, plan again where the limits are broken, and write the tables."""
    parser = options_of(__doc__, "finer")
    parser.add_argument("--proof", type=Path, default=Path("results/proof/widths.csv"))
    options = parser.parse_args()
    table = pd.read_csv(options.proof)
    unproved = table[~table["fits"] & table["kind"].isna()]
    unproved = unproved[["road", "vehicle", "half_width"]]
    cases = [
        case_within(free_case(str(road), str(vehicle)), float(half)) for road, vehicle, half in unproved.itertuples(index=False, name=None)
    ]
    roads = unproved.reset_index(drop=True).join(pd.DataFrame(map(_tried, cases)))
    write_results(options.out, {"roads": roads}, {"finer": _page(roads)}, cases)


def _lacking(result: Result) -> float:
    verdict = verdict_of(result)
    return 0.0 if verdict.fits else -(verdict.spare or 0.0)


def _tried(case: Case) -> dict[str, object]:
    """Return what a plan lacks, what the best of its further plans lacks, what the finer of them do, and what all cost."""
    began = process_time()
    try:
        result = api.plan(case)
    except HdvplanError as error:
        none = {"lacking": np.inf, "least": np.inf, "finer": "", "fits": False}
        return none | {"cpu_s": process_time() - began, "finer_cpu_s": 0.0, "error": str(error)}
    planned = process_time()
    last = api.replanned(result)
    return {
        "lacking": _lacking(result),
        "least": _lacking(last),
        "finer": " ".join(f"{one.step:g}:{one.lacking:.3f}" for one in last.attempts if one.step != case.settings.step),
        "fits": bool(verdict_of(last).fits),
        "cpu_s": planned - began,
        "finer_cpu_s": process_time() - planned,
        "error": "",
    }


def _page(roads: pd.DataFrame) -> str:
    """Return what finer.md says."""
    about = (
        "Every `NO` of `results/widths` without a proof, planned again as `hdvplan plan` does: with limits that give way, and stations "
        "0.25 and 0.1 m apart instead of 0.5 m. What is lacking, at least when planned again, and with stations so far apart [m]; the "
        "processor time [s]."
    )
    cells = markdown_table(roads.drop(columns="error").round(3), text=("road", "vehicle", "finer"))
    return f"# Plans with stations nearer together\n\n{about}\n\n{cells}\n"


if __name__ == "__main__":
    main()
