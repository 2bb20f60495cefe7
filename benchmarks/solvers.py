"""Every QP solver on the same QPs: ten roads, two vehicles, four classes of limits, at strict tolerances and at equal accuracy.

Writes two benchmarks with their tables and pictures, strict/ and accuracy/, and solvers.md with both at a glance. Give the same command
again to go on with an interrupted one. Solvers that are not installed are named in the table; the extra ``solvers`` has those that pip
can install.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pandas as pd
from cases import options_of

from hdvplan.bench.measuring.stats import summary_table
from hdvplan.bench.measuring.timing import reasons_of
from hdvplan.bench.suite import CLASSES, ROADS, read_suite, suite_of
from hdvplan.cli.app import run
from hdvplan.fileio import write_atomically
from hdvplan.machine import use_one_thread
from hdvplan.report.grid import markdown_table
from hdvplan.solvers.registry import solver_infos

SOLVERS = (
    "riccati", "riccati-warm", "riccati-ipm", "hpipm", "acados", "piqp", "osqp", "clarabel", "daqp", "proxqp", "qpalm", "scs", "highs",
    "cvxopt", "quadprog", "ecos", "qpax",
)  # fmt: skip
SUITE = Path(__file__).with_name("solvers.toml")
ACCURACY_M = 1e-4  # a hundredth of the centimetre to which limits are judged
REGIMES = {
    "strict": ("Strict: each solver at its own tight tolerance; accepted by its residuals.", ()),
    "accuracy": (
        f"Equal accuracy: each solver at the loosest tolerance, by decades, that keeps e_y within {ACCURACY_M:g} m of the optimum.",
        ("--accuracy", str(ACCURACY_M)),
    ),
}


def chosen() -> tuple[list[str], list[str]]:
    """Return the solvers that take part, natively where hdvplan can, and those that are not installed."""
    versions = {info.name: info.version for info in solver_infos()}
    names = [name if name in versions else f"qpsolvers/{name}" for name in SOLVERS]
    return [name for name in names if versions.get(name)], [name for name in names if not versions.get(name)]


def summary_without(directory: Path, solver: str) -> pd.DataFrame:
    """Return the summary of a benchmark as it would be without one of its solvers."""
    tables = (pd.read_csv(directory / name) for name in ("samples.csv.gz", "timing.csv", "envelope.csv"))
    return summary_table(*(table[table["solver"] != solver] for table in tables))


def at_a_glance(summary: pd.DataFrame) -> pd.DataFrame:
    """Return of one benchmark, solver by solver, how many times as long as the fastest it takes, for every vehicle and class of limits."""
    order = summary.groupby("solver")["ratio"].median().sort_values(na_position="last").index
    rows: dict[str, dict[str, str]] = {str(solver): {"solver": str(solver)} for solver in order}
    for vehicle in summary["vehicle"].unique():
        for limits in CLASSES:
            here = summary[(summary["vehicle"] == vehicle) & (summary["limits"] == limits)]
            for solver, ratio, share, whole in here[["solver", "ratio", "success", "whole"]].itertuples(index=False, name=None):
                rows[str(solver)][f"{vehicle}, {limits}"] = _cell(float(ratio), float(share), whole=bool(whole))
    return pd.DataFrame(rows.values())


def _cell(ratio: float, share: float, *, whole: bool) -> str:
    stopped = "" if whole else "*"
    if ratio != ratio:  # noqa: PLR0124 - NaN
        return f"none accepted{stopped}"
    said = f"{ratio:.3g}" if ratio < 1e3 else f"{ratio:.0f}"  # noqa: PLR2004 - no exponents in a table
    return said + ("" if share == 1.0 else f" ({100.0 * share:.0f} %)") + stopped


def page(out: Path, absent: list[str]) -> str:
    """Return what solvers.md says."""
    suite = suite_of(read_suite(SUITE))
    parts = [
        f"How many times as long as the fastest solver each one takes for a QP: {suite.sample} QPs of every drive, recorded and shuffled, "
        f"the same for all, half of them where limits bind. Processor time, each QP with the faster of {suite.rounds} rounds, shifted "
        "geometric mean. In brackets: share of QPs accepted, where it is not all of them; the factor is over the accepted ones. "
        f"*: stopped after {suite.budget:g} s a drive, and compared over what it reached. Limits: "
        + "; ".join(f"{name}: {words}" for name, words in CLASSES.items() if name in suite.classes)
        + "."
    ]
    for regime, (title, _) in REGIMES.items():
        folder = out / regime
        table, record = at_a_glance(pd.read_csv(folder / "summary.csv")), json.loads((folder / "run.json").read_text(encoding="utf-8"))
        told = [record["load"]["warning"]] if record["load"]["warning"] else []
        told += [finding["text"] for finding in record["verdict"]] + record["solvers"] + reasons_of(pd.read_csv(folder / "timing.csv"))
        unscreened = at_a_glance(summary_without(folder, "riccati"))
        parts += [
            f"## {title}",
            markdown_table(table, text=("solver",)),
            "Without riccati, so that no solver screens or knows active sets:",
        ]
        parts += [markdown_table(unscreened, text=("solver",)), "\n".join(f"- {line}" for line in told)]
    parts += [f"Not installed: {', '.join(absent)}."] if absent else []
    return "\n\n".join(["# QP solvers", *parts]) + "\n"


def main() -> None:
    """Measure both regimes and write the page."""
    parser = options_of(__doc__, "solvers")
    parser.add_argument("--roads", default=",".join(ROADS), metavar="A,B")
    asked = parser.parse_args()
    solvers, absent = chosen()
    for regime, (_, options) in REGIMES.items():
        print(f"{regime}: {', '.join(solvers)}", file=sys.stderr)
        code = run([
            "bench", "--suite", str(SUITE), "--roads", asked.roads, "--solvers", ",".join(solvers), *options,
            "--out", str(asked.out / regime), "--plot",
        ])  # fmt: skip
        if code:
            sys.exit(code)
    write_atomically(asked.out / "solvers.md", page(asked.out, absent).encode())
    print(f"written to {asked.out / 'solvers.md'}", file=sys.stderr)


if __name__ == "__main__":
    use_one_thread()
    main()
