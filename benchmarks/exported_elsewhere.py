"""The exported planner for other processors, and in single precision: do its drives end as here?

Compiles the sample of a road in every class of limits for aarch64 and armv7, with ziglang (`pip install ziglang`), runs it under qemu's
user emulation, and compares what it prints with what the same files print here. The same with every ``double`` a ``float``, here.
Writes elsewhere.csv, elsewhere.md and run.json. Needs cc, qemu-aarch64 and qemu-arm.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from cases import options_of, write_results
from export_c import CLASSES

from hdvplan.arrays import FloatArray
from hdvplan.bench.measuring.courses import with_limits
from hdvplan.bench.suite import Suite
from hdvplan.case import Case
from hdvplan.export import Budget
from hdvplan.export.write import PLANNER, exported
from hdvplan.report.grid import markdown_table
from hdvplan.road.load import find_road
from hdvplan.vehicle.load import load_vehicle

SOURCES = [f"{name}.c" for name in ("planner", "vehicle", *PLANNER, "simulate", "sample", "main")]
FLAGS = ["-std=c99", "-O2", "-ffp-contract=off", "-o", "sample"]
ZIG = [sys.executable, "-m", "ziglang", "cc", "-static"]
TARGETS = {  # how each is compiled, and what runs it
    "here": (["cc"], []),
    "aarch64": ([*ZIG, "-target", "aarch64-linux-musl"], ["qemu-aarch64"]),
    "armv7": ([*ZIG, "-target", "arm-linux-musleabihf"], ["qemu-arm"]),
    "here, single precision": (["cc"], []),
}
_ENDED = re.compile(r"(\d+) plans: (\d+) done, (\d+) with the budget spent, (\d+) kept")
_SINGLE = {r"\bdouble\b": "float", r"vector_size\(32\)": "vector_size(16)", r"aligned\(8\)": "aligned(4)"}  # vectors of four numbers


def driven(files: dict[str, str], target: str, folder: Path) -> tuple[FloatArray, tuple[int, ...]]:
    """Return the states and curvatures that a sample prints, and how many of its plans ended in which way."""
    compiler, runner = TARGETS[target]
    for name, content in files.items():
        text = content
        for pattern, other in _SINGLE.items() if target.endswith("single precision") else ():
            text = re.sub(pattern, other, text)
        (folder / name).write_text(text, encoding="utf-8")
    subprocess.run([*compiler, *FLAGS, *SOURCES, "-lm"], cwd=folder, check=True, capture_output=True)  # noqa: S603 - ours
    done = subprocess.run([*runner, "./sample"], cwd=folder, check=False, capture_output=True, text=True)  # noqa: S603 - ours
    ended = _ENDED.search(done.stderr)
    numbers = [[float(word) for word in line.split(",")] for line in done.stdout.splitlines()[1:]]
    return np.array(numbers), tuple(int(word) for word in ended.groups()) if ended else (0, 0, 0, 0)


def rows_of(limits: str, case: Case, targets: Sequence[str]) -> list[dict[str, object]]:
    """Return how far each target's drive lies from that here."""
    files, rows, here = exported(case, Budget()), [], np.zeros((0, 0))
    for target in targets:
        with tempfile.TemporaryDirectory() as made:
            states, (plans, done, spent, kept) = driven(files, target, Path(made))
        here = states if target == targets[0] else here
        apart = float(np.max(np.abs(states - here))) if states.shape == here.shape else np.nan
        row: dict[str, object] = {"road": case.road.name, "vehicle": case.vehicle.name, "limits": limits, "target": target}
        rows.append(row | {"plans": plans, "done": done, "spent": spent, "kept": kept, "difference": apart})
        print(rows[-1], file=sys.stderr)
    return rows


def main() -> None:
    """Measure and write."""
    parser = options_of(__doc__, "export-elsewhere")
    parser.add_argument("--road", default="monaco_fairmont_hairpin")
    parser.add_argument("--vehicle", default="bus")
    parser.add_argument("--limits", nargs="+", default=list(CLASSES), metavar="CLASS")
    parser.add_argument(
        "--targets", nargs="+", choices=list(TARGETS), default=list(TARGETS), help="the first is what others are compared with"
    )
    given = parser.parse_args()
    vehicle, road = load_vehicle(given.vehicle), find_road(given.road)()
    cases = {limits: Case(with_limits(road, vehicle, Suite(), limits), vehicle) for limits in given.limits}
    found = pd.DataFrame([row for limits, case in cases.items() for row in rows_of(limits, case, given.targets)])
    shown = found[found["target"] != "here"].drop(columns=["road", "vehicle"])
    shown["difference"] = shown["difference"].map("{:.1e}".format)
    page = (
        f"The {given.vehicle} along {given.road}: the largest difference of a state or curvature from the drive of the same files here, "
        f"and how the plans ended.\n\n{markdown_table(shown, text=('limits', 'target'))}\n"
    )
    write_results(given.out, {"elsewhere": found}, {"elsewhere": page}, list(cases.values()), form=None)


if __name__ == "__main__":
    main()
