"""Does the gate cry wolf, and does it bark? Comparisons of the same program with itself, and with programs that are worse in some way.

Recorded: two copies of the working tree, both the same program, as pairs of processes of `hdvplan bench` that take turns, with the
gate's own suite, the copies in a new order each time; half of the pairs run while another process keeps a core busy in bursts.
Comparisons are drawn from what was recorded, each of pairs near in time as the gate would have measured them: five, ten where the
first five are not fine.
A change for the worse is made to the recorded numbers of the new side. At last the real command is run end to end,
`hdvplan bench --against`, in copies whose planner is patched.

Writes gate.csv, noise.csv, gate.md and run.json. What was recorded is kept in --record; the same command goes on from there.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from gate_patches import PATCHES, SAME, WORSE

from hdvplan.bench.comparing.against import SUITE
from hdvplan.bench.comparing.compare import Comparison, compare
from hdvplan.bench.comparing.counters import Tolerance
from hdvplan.bench.comparing.decision import BATCH, Rule, Verdict
from hdvplan.bench.comparing.processes import Started, Turns, ended_by_signals, in_turn, scratch_folder, shared_cores
from hdvplan.bench.comparing.programs import Program, present
from hdvplan.bench.comparing.sides import IMPORT, PEAK, Name, Side, Steps, read_side
from hdvplan.bench.comparing.work import ABOUT, SuiteWork, suite_entries, suite_text
from hdvplan.bench.measuring.courses import cases_of
from hdvplan.bench.suite import suite_of
from hdvplan.fileio import csv_bytes, json_bytes, write_atomically
from hdvplan.machine import load_average, machine_facts
from hdvplan.record import write_record
from hdvplan.report.grid import markdown_table

ROOT = Path(__file__).resolve().parents[1]
BASE = "base"
LOADS = ("quiet", "loaded")


@contextmanager
def copies(folder: Path, wanted: Sequence[str]) -> Iterator[dict[str, Program]]:
    """Provide programs: worktrees of the present commit with their patches, which go afterwards; BASE has none."""
    made: dict[str, Program] = {}
    try:
        for number, name in enumerate([BASE, *wanted]):
            tree = folder / f"tree{number}"
            shutil.rmtree(tree, ignore_errors=True)  # left by a run that was killed
            git("-C", str(ROOT), "worktree", "prune")
            git("-C", str(ROOT), "worktree", "add", "--detach", str(tree), "HEAD")
            made[name] = present(name, tree, tree)
            with (tree / "hdvplan" / "planning" / "planner.py").open("a", encoding="utf-8") as module:
                module.write(PATCHES.get(name, ""))
        yield made
    finally:
        for program in made.values():
            git("-C", str(ROOT), "worktree", "remove", "--force", str(program.source))


def git(*arguments: str) -> str:
    """Run git and return what it says."""
    return subprocess.run(["git", *arguments], capture_output=True, text=True, check=True).stdout.strip()  # noqa: S603, S607 - fixed


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


def record(programs: dict[str, Program], folder: Path, rounds: int) -> None:
    """Record ``rounds`` pairs of processes of BASE and SAME for each load, as the gate does; those that are already there are kept."""
    _write_suite(folder)
    _measure(programs, folder, {name: folder / f"warm-{name}" for name in (BASE, SAME)}, None)
    cores = shared_cores(one_is_enough=SuiteWork.on_one_thread)
    for situation in LOADS:
        with load(wanted=situation == "loaded"):
            for round_ in range(rounds):
                order = np.random.default_rng([round_, LOADS.index(situation)]).permutation([BASE, SAME])
                outs = {str(name): recorded(folder, situation, str(name), round_) for name in order}
                if not all((out / ABOUT).is_file() for out in outs.values()):
                    print(f"{situation}: pair {round_ + 1} of {rounds}", file=sys.stderr, flush=True)
                    _measure(programs, folder, outs, Turns(cores[round_ % len(cores)]))


def _write_suite(folder: Path) -> None:
    (folder / "suite.toml").write_text(suite_text(suite_entries(suite_of(SUITE), suite_of({}).to_dict())), encoding="utf-8")


def decided_once(out: Path) -> None:
    """Write gate.csv as drawn from one recorded process of this tree that stands for all: what the gate decides without noise."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _write_suite(folder)
        first = folder / "one"
        _measure({BASE: present(BASE, ROOT, ROOT)}, folder, {BASE: first}, None)
        for which, round_ in product((BASE, SAME), range(2 * BATCH)):
            shutil.copytree(first, recorded(folder, LOADS[0], which, round_))
        comparisons = {(one, LOADS[0]): found for one, found in drawn(folder, LOADS[0], 2 * BATCH, 50).items()}
    table = table_of(comparisons, 2 * BATCH, pd.DataFrame(columns=["program", "situation"]))
    write_atomically(out / "gate.csv", csv_bytes(table))


def _measure(programs: dict[str, Program], folder: Path, outs: Mapping[str, Path], turns: Turns | None) -> None:
    """Run a process of each program that has a folder in ``outs``, in turn; without ``turns`` to warm up."""
    with scratch_folder() as scratch:

        def begin(name: str) -> Started:
            shutil.rmtree(outs[name], ignore_errors=True)
            command = SuiteWork(folder / "suite.toml").command(programs[name], outs[name], scratch.folder / name, warm=turns is None)
            return programs[name].start(command, scratch, turns)

        in_turn(begin(name) for name in outs)
        for name, started in zip(outs, list(scratch.started), strict=True):
            ended = programs[name].finish(started)
            took = float((scratch.folder / name).read_text(encoding="utf-8"))
            write_atomically(outs[name] / ABOUT, json_bytes({PEAK: ended.peak_bytes, IMPORT: took}))


def recorded(folder: Path, situation: str, name: str, round_: int) -> Path:
    """Return where one process's run is kept."""
    return folder / situation / name / f"{round_:03d}"


def drawn(folder: Path, situation: str, rounds: int, count: int) -> dict[str, list[Comparison]]:
    """Return ``count`` comparisons of BASE with every change for the worse: of consecutive processes from a random one on, shuffled."""
    sides = {which: [read_side(recorded(folder, situation, which, round_)) for round_ in range(rounds)] for which in (BASE, SAME)}
    found: dict[str, list[Comparison]] = {}
    for number, (name, worse) in enumerate(WORSE.items()):
        random = np.random.default_rng([number, LOADS.index(situation)])
        found[name] = []
        for _ in range(2 * count if name == SAME else count):
            window = random.integers(rounds - 2 * BATCH + 1) + random.permutation(2 * BATCH)
            swapped = bool(random.integers(2))  # either of two equal programs may be the new one
            base, new = ([sides[which][round_] for round_ in window] for which in ((SAME, BASE) if swapped else (BASE, SAME)))
            changed = [worse((side.processes[0], side.about[0]), random) for side in new]
            found[name].append(
                gated(base, [replace(side, processes=(steps,), about=(about,)) for side, (steps, about) in zip(new, changed, strict=True)])
            )
        print(f"{situation}: {name}: {_counts([str(one.verdict) for one in found[name]])}", file=sys.stderr, flush=True)
    return found


def gated(base: Sequence[Side], new: Sequence[Side]) -> Comparison:
    """Return what `--against` would say of these processes: of the first five pairs if they are fine, else of all ten."""
    for pairs in (BATCH, 2 * BATCH):
        here, there = (
            Side(side[0].counters, tuple(one.processes[0] for one in side[:pairs]), tuple(one.about[0] for one in side[:pairs]))
            for side in (base, new)
        )
        comparison = compare(here, there, Rule(), Tolerance(), expect_changes=False)
        if comparison.verdict is Verdict.FINE:
            break
    return comparison


def end_to_end(programs: dict[str, Program], folder: Path, runs: Mapping[str, int]) -> pd.DataFrame:
    """Run the real command in the copies, one of each after the other; those that are already there are kept.

    Half of the runs of the same program are under load.
    """
    file = folder / "end_to_end.csv"
    rows = pd.read_csv(file).to_dict("records") if file.is_file() else []
    verdicts = {0: Verdict.FINE, 1: Verdict.REGRESSED, 3: Verdict.UNMEASURABLE}
    for run, name in sorted(((run, name) for name, count in runs.items() for run in range(count)), key=lambda one: one[0]):
        situation = LOADS[run % 2] if name == SAME else LOADS[0]
        if any((row["run"], row["program"]) == (run, name) for row in rows):
            continue
        print(f"end to end, {situation}: {name}, run {run + 1} of {runs[name]}", file=sys.stderr, flush=True)
        program = programs[name]
        command = [
            str(program.python),
            "-P",
            "-m",
            "hdvplan",
            "bench",
            "--against",
            "HEAD",
            "--quiet",
            "--out",
            str(folder / "against"),
        ]
        with load(wanted=situation == "loaded"):
            began = time.monotonic()
            ended = subprocess.run(  # noqa: S603 - our own
                command, cwd=program.folder, env=program.environment(), capture_output=True, text=True, check=False
            )
            seconds = time.monotonic() - began
        said = (ended.stdout or ended.stderr).strip().splitlines()[-1]
        verdict = verdicts.get(ended.returncode, f"ended with {ended.returncode}")
        rows.append({"program": name, "situation": situation, "run": run, "verdict": str(verdict), "seconds": seconds, "said": said})
        write_atomically(file, csv_bytes(pd.DataFrame(rows)))
    return pd.DataFrame(rows, columns=["program", "situation", "run", "verdict", "seconds", "said"])


def table_of(comparisons: Mapping[tuple[str, str], list[Comparison]], processes: int, ends: pd.DataFrame) -> pd.DataFrame:
    """Return how often every program was judged how, by load; of the recorded processes and of the real command."""
    rows: list[dict[str, object]] = []
    for (name, situation), found in comparisons.items():
        verdicts = [str(comparison.verdict) for comparison in found]
        rows.append({"how": "drawn", "program": name, "situation": situation, "pairs": processes} | _counts(verdicts))
    for key, mine in ends.groupby(["program", "situation"], sort=False):
        what = dict(zip(("program", "situation"), key, strict=True))
        longest = {"longest [s]": round(float(mine["seconds"].max()), 1)}
        rows.append({"how": "end to end"} | what | _counts([str(verdict) for verdict in mine["verdict"]]) | longest)
    return pd.DataFrame(rows)


def _counts(verdicts: Sequence[str]) -> dict[str, object]:
    names = [str(verdict) for verdict in Verdict]
    return {"comparisons": len(verdicts), **{name: verdicts.count(name) for name in names}}


def noise_of(folder: Path, rounds: int) -> pd.DataFrame:
    """Return how much processes of the same program differ in the gate's statistic of the worst cell, for each load [%]."""
    rows = []
    for situation in LOADS:
        alone, other = (
            np.array([_cells(read_side(recorded(folder, situation, name, round_)).processes[0]) for round_ in range(rounds)])
            for name in (BASE, SAME)
        )
        apart, together = (100.0 * float(np.std(logs, axis=0, ddof=1).max()) for logs in (alone, other - alone))
        rows.append({"situation": situation, "between pairs [%]": round(apart, 1), "within a pair [%]": round(together, 1)})
    return pd.DataFrame(rows)


def _cells(process: Mapping[Name, Steps]) -> list[float]:
    """Return the logarithm of every cell's mean step, each step with its fastest round."""
    return [float(np.log(steps.total.min(axis=0).mean())) for steps in process.values()]


def markdown(table: pd.DataFrame, noise: pd.DataFrame) -> str:
    """Return the tables with what a reader must know to believe them."""
    facts, rule = machine_facts(), Rule()
    caption = (
        f"How often `hdvplan bench --against` calls a program regressed: factor {rule.factor:g}, floor {1e3 * rule.floor:g} ms, eight "
        "cells. drawn: from recorded pairs of processes of one program that took turns, each comparison from ten pairs near in time, its "
        "new side made worse by calculation; end to end: the real command in a patched copy, with checkout and compilation. loaded: "
        "another process keeps a core busy in bursts. "
        f"{facts['processor']}, {facts['usable_cores']} cores, {facts['python']}; load average at the end "
        f"{', '.join(f'{value:.1f}' for value in load_average() or [])}."
    )
    below = "Standard deviation of a cell's time, every step with its fastest round, in the worst cell, of processes of one program:"
    tables = (markdown_table(_told(one), text=("how", "program", "situation")) for one in (table, noise))
    return "\n\n".join((caption, next(tables), below, next(tables))) + "\n"


def _told(table: pd.DataFrame) -> pd.DataFrame:
    return table.astype(object).where(table.notna(), "").map(lambda value: f"{value:g}" if isinstance(value, float) else str(value))


def main() -> None:
    """Record, draw, run end to end, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/gate"), metavar="DIR")
    parser.add_argument("--record", type=Path, default=Path("gate-record"), metavar="DIR", help="where runs are kept")
    parser.add_argument("--processes", type=int, default=60, metavar="N", help="of both copies, half of them under load")
    parser.add_argument("--draws", type=int, default=100, metavar="N", help="comparisons of every program, twice as many of the same one")
    parser.add_argument("--runs", type=int, default=3, metavar="N", help="end to end, of every program; 20 of the same one")
    parser.add_argument("--once", action="store_true", help="write gate.csv of one process alone, without noise: seconds")
    asked = parser.parse_args()
    if asked.once:
        asked.out.mkdir(parents=True, exist_ok=True)
        decided_once(asked.out)
        return
    rounds = asked.processes // len(LOADS)
    if rounds < 2 * BATCH:
        parser.error(f"--processes must be at least {2 * BATCH * len(LOADS)}")
    folder = asked.record.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    runs = {name: asked.runs * 20 // 3 if name == SAME else asked.runs for name in PATCHES} if asked.runs else {}
    with ended_by_signals(), copies(folder, list(runs) or [SAME]) as programs:
        record(programs, folder, rounds)
        ends = end_to_end(programs, folder, runs)
    comparisons = {
        (name, situation): found
        for situation in LOADS
        for name, found in drawn(folder, situation, rounds, asked.draws // len(LOADS)).items()
    }
    table = table_of(comparisons, rounds, ends)
    asked.out.mkdir(parents=True, exist_ok=True)
    write_atomically(asked.out / "gate.csv", csv_bytes(table))
    noise = noise_of(folder, rounds)
    write_atomically(asked.out / "noise.csv", csv_bytes(noise))
    write_atomically(asked.out / "gate.md", markdown(table, noise).encode())
    write_record(asked.out, cases_of(suite_of(SUITE)))
    print(markdown(table, noise))


if __name__ == "__main__":
    main()
