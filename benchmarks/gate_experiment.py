"""Does the gate cry wolf, and does it bark? The real command compares a toy program with itself, and with dishonest and careless changes.

The toy (``gate_patches.py``) is a planner of its own in a repository of its own. Every run is ``hdvplan bench --against HEAD --command``
from end to end, in a working tree that is patched. Half of the comparisons of the toy with itself, and those of a quarter more work, run
while another process keeps a core busy in bursts. Writes gate.csv, gate.md and run.json. Rows are kept in --record; the same command goes
on from there.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pandas as pd
from cases import options_of, write_results, write_table
from gate_patches import HEAVY, HELPER, LATE, PATCHES, QUARTER, SAME, TOY, make_repository, patched

from hdvplan.bench.comparing.decision import GateVerdict
from hdvplan.fileio import json_bytes, read_json, write_atomically
from hdvplan.machine import load_average, machine_facts
from hdvplan.report.grid import markdown_table

QUIET, LOADED = "as it is", "one busy process more"
VERDICTS = {0: GateVerdict.FINE, 1: GateVerdict.REGRESSED, 3: GateVerdict.UNMEASURABLE}
LIMITS = ("--time-limit", "20", "--patience", "60")  # [s]; a process of the toy takes 0.2


@contextmanager
def load(*, wanted: bool) -> Iterator[None]:
    """Keep one core busy in bursts of a few tenths of a second while the block runs."""
    if not wanted:
        yield
        return
    burst = (
        "import random, time\n"
        "while True:\n"
        "    end = time.time() + random.expovariate(2.0)\n"
        "    while time.time() < end: sum(range(1000))\n"
        "    time.sleep(random.expovariate(5.0))\n"
    )
    process = subprocess.Popen([sys.executable, "-c", burst])  # noqa: S603 - our own
    try:
        yield
    finally:
        process.kill()
        process.wait()


def compared(folder: Path, program: str, situation: str) -> dict[str, object]:
    """Run the gate once for a change and return a row: how it ended, in what time, and what it said."""
    top = Path(tempfile.mkdtemp(dir=folder)) / "toy"
    make_repository(top, {"toy.py": TOY, "helper.py": HELPER, "late.py": LATE, "heavy.py": HEAVY})
    (top / "toy.py").write_text(TOY if program == SAME else patched(PATCHES[program]), encoding="utf-8")
    command = [sys.executable, "-P", "-m", "hdvplan", "bench", "--against", "HEAD", "--command", "python toy.py", *LIMITS]
    with load(wanted=situation == LOADED):
        began = time.monotonic()
        variables = os.environ | {"XDG_CACHE_HOME": str(top.parent / "cache")}
        words = [*command, "--quiet", "--out", str(top.parent / "out")]
        ended = subprocess.run(words, cwd=top, env=variables, capture_output=True, text=True, check=False)  # noqa: S603 - our own
    verdict = str(VERDICTS.get(ended.returncode, f"ended with {ended.returncode}"))
    said = ((ended.stdout or ended.stderr).strip().splitlines() or ["nothing"])[-1]
    row = {"program": program, "situation": situation, "verdict": verdict, "seconds": time.monotonic() - began}
    print(f"{program}, {situation}: {verdict} in {row['seconds']:.0f} s: {said}", file=sys.stderr, flush=True)
    return row | {"said": said.partition(": ")[2]}


def kept(record: Path, folder: Path, program: str, situation: str, number: int) -> dict[str, object]:
    """Return the row of a comparison, from the record if it is there."""
    file = record / f"{situation}, {program}, {number}.json".replace(" ", "-")
    if not file.exists():
        write_atomically(file, json_bytes(compared(folder, program, situation)))
    return dict(read_json(file))


def table_of(rows: Sequence[Mapping[str, object]]) -> pd.DataFrame:
    """Return how often every program was judged how, in each situation, and what was said of the first of its runs that was not fine."""
    found = []
    for (program, situation), mine in pd.DataFrame(rows).groupby(["program", "situation"], sort=False):
        verdicts = mine["verdict"].tolist()
        told = mine.loc[mine["verdict"] != str(GateVerdict.FINE), "said"]
        found.append(
            {"program": program, "situation": situation, "comparisons": len(mine)}
            | {str(name): verdicts.count(str(name)) for name in GateVerdict}
            | {"longest [s]": round(float(mine["seconds"].max()), 1), "said": "" if told.empty else told.iloc[0]}
        )
    return pd.DataFrame(found)


def markdown(table: pd.DataFrame, jobs: int) -> str:
    """Return the table with what a reader must know to believe it."""
    facts, asked = machine_facts(), " ".join(LIMITS)
    caption = (
        f"How often `hdvplan bench --against HEAD --command 'python toy.py' {asked}` calls a toy program regressed, from end to end: the "
        "program itself, and changes of it for the worse (`benchmarks/gate_patches.py`); what it said first. A planning step of the toy "
        f"takes 0.3 ms, a process 0.2 s. {facts['processor']}, {facts['usable_cores']} cores, {facts['python']}; {jobs} comparisons at a "
        f"time, load average at the end {', '.join(f'{value:.1f}' for value in load_average() or [])}."
    )
    return "\n\n".join((caption, markdown_table(table.astype(str), text=("program", "situation", "said")))) + "\n"


def main() -> None:
    """Compare, and write the table; ``--only`` prints the row of one change."""
    parser = options_of(__doc__, "gate")
    parser.add_argument("--same", type=int, default=50, metavar="N", help="comparisons of the program with itself, half of them loaded")
    parser.add_argument("--quarters", type=int, default=10, metavar="N", help="loaded comparisons with a quarter more work")
    parser.add_argument("--record", type=Path, default=Path("gate-record"), metavar="DIR", help="where rows are kept")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="comparisons at the same time, which disturb each other")
    parser.add_argument("--only", choices=sorted(PATCHES), metavar="PROGRAM", help="one change alone, once")
    asked = parser.parse_args()
    wanted = [(program, QUIET, 0) for program in ([asked.only] if asked.only else PATCHES)]
    if not asked.only:
        wanted += [(QUARTER, LOADED, number) for number in range(asked.quarters)]
        wanted += [(SAME, (QUIET, LOADED)[number % 2], number) for number in range(asked.same)]
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(asked.jobs) as pool:
        folder = Path(name) if asked.only else asked.record
        folder.mkdir(parents=True, exist_ok=True)
        table = table_of(list(pool.map(lambda one: kept(folder, Path(name), *one), wanted)))
    if asked.only:
        asked.out.mkdir(parents=True, exist_ok=True)
        write_table(asked.out / "gate.csv", table, form=None)
        return
    page = markdown(table, asked.jobs)
    write_results(asked.out, {"gate": table}, {"gate": page}, [], form=None)
    print(page)


if __name__ == "__main__":
    main()
