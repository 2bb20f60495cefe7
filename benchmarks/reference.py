"""Hold the program to what it does: run the cases of reference.toml, and compare their numbers with reference.csv.

    python benchmarks/reference.py [--area AREA ...] [--only CASE ...]
    python benchmarks/reference.py --renew --reason "why the numbers moved"

Exit code 1 where a number moved beyond its tolerance, or a word, a count or a row is another. ``--renew`` writes down the rows that moved,
and raises the integers of their areas in hdvplan/behaviour.toml: results that were made with a lower one are stale.
"""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import process_time

from hdvplan.machine import BEHAVIOUR, use_one_thread

use_one_thread()  # before NumPy is loaded: the sums of several threads come in any order

import reference_bench  # noqa: E402 - see above
import reference_drives  # noqa: E402
import reference_roads  # noqa: E402
from reference_rows import (  # noqa: E402
    AREAS,
    Row,
    behaviour_text,
    moves_of,
    raised,
    read_behaviour,
    read_rows,
    renewed,
    rows_of,
    rows_text,
    tolerances_of,
)
from reference_scenes import Quantities, Told  # noqa: E402

from hdvplan.fileio import write_atomically  # noqa: E402

_HERE = Path(__file__).parent
CASES, RECORDED = _HERE / "reference.toml", _HERE / "reference.csv"
_RUN: Mapping[str, Callable[[Told], Quantities]] = {
    "planning": reference_drives.planned,
    "judging": reference_drives.judged,
    "tracking": reference_drives.tracked,
    "regions": lambda told: {**reference_drives.planned(told), **reference_drives.judged(told)},
    "passing": reference_drives.passed,
    "need": reference_drives.needed,
    "proof": reference_drives.proved,
    "roads": reference_roads.loaded,
    "turning": reference_roads.turned,
    "bench": reference_bench.decided,
    "suites": reference_bench.limited,
}
_HEAD = "# What the program does, area by area: benchmarks/reference.py --renew raises a number when the behaviour reference moved there.\n"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, compare, and renew where that is asked for; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--area", nargs="+", choices=AREAS, default=AREAS)
    parser.add_argument("--only", nargs="+", metavar="CASE", help="cases, by the names in reference.toml")
    parser.add_argument("--renew", action="store_true", help="write down what moved")
    parser.add_argument("--reason", help="why it moved, one sentence")
    parser.add_argument("--times", action="store_true", help="tell the processor time of every case")
    options = parser.parse_args(arguments)
    document = tomllib.loads(CASES.read_text(encoding="utf-8"))
    wanted = {
        (area, name) for area in AREAS for name in document[area] if area in options.area and (not options.only or name in options.only)
    }
    unknown = {*(options.only or ())} - {name for _, name in wanted}
    if unknown:
        parser.error(f"unknown: {', '.join(sorted(unknown))}")
    everything = len(wanted) == sum(len(document[area]) for area in AREAS)
    measured = _measured(document, wanted, tell=options.times)
    recorded = read_rows(RECORDED)
    looked = recorded if everything else [row for row in recorded if (row.area, row.case) in wanted]
    moves = moves_of(looked, measured)
    for move in moves:
        print(move.text)
    areas = [area for area in AREAS if any(move.behaves and move.row.area == area for move in moves)]
    where = f" in {', '.join(areas)}" if areas else ""
    print(f"{len(wanted)} cases, {len(measured)} rows, {len(moves)} moved{where}; {process_time():.0f} s of CPU")
    if not moves:
        return 0
    if not options.renew:
        print('is this meant? python benchmarks/reference.py --renew --reason "..."', file=sys.stderr)
        return 1
    behaviour = read_behaviour(BEHAVIOUR)
    if areas and not (options.reason or "").strip():
        parser.error(f"--renew raises {', '.join(areas)}: say why with --reason")
    beside = [row for row in recorded if row not in looked]
    order = {(area, name): at for at, (area, name) in enumerate((area, name) for area in AREAS for name in document[area])}
    rows = sorted([*beside, *renewed(looked, measured, moves)], key=lambda row: order.get((row.area, row.case), len(order)))
    write_atomically(RECORDED, rows_text(rows).encode())
    write_atomically(BEHAVIOUR, behaviour_text(raised(behaviour, moves, options.reason or ""), _HEAD).encode())
    return 0


def _measured(document: Mapping[str, Mapping[str, Told]], wanted: set[tuple[str, str]], *, tell: bool) -> list[Row]:
    tolerances, rows = tolerances_of(document["tolerance"]), []  # type: ignore[arg-type]
    for area in AREAS:
        for name, told in document[area].items():
            if (area, name) in wanted:
                began = process_time()
                rows += rows_of(name, area, _RUN[area](told), tolerances)
                if tell:
                    print(f"{process_time() - began:7.2f} s  {area}: {name}", flush=True)
    return rows


if __name__ == "__main__":
    sys.exit(main())
