"""Does the gate cry wolf, and does it bark? Comparisons of the same program with itself, and with slower ones.

Patched copies of the working tree are made in git worktrees: the same program, one whose planning step takes 10 % longer,
one 20 %, one with an SQP that iterates further. Every process is `hdvplan bench` with the gate's own suite, the programs in
turns in a new order each time. Half of them run while another process keeps the other core busy in bursts. Comparisons are
then drawn from what was recorded, each with neighbours in time as the gate would have measured them: five pairs, ten where
the first five are not fine. At last the real command is run end to end, `hdvplan bench --against`.

Writes gate.csv, gate.md and run.json. What was recorded is kept in --record; the same command goes on from there.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pandas as pd

from hdvplan.bench.against import SUITE, options_of
from hdvplan.bench.compare import Comparison, Side, compare, read_side
from hdvplan.bench.counters import Tolerance
from hdvplan.bench.courses import cases_of
from hdvplan.bench.environment import Program
from hdvplan.bench.gate import BATCH, Rule, Verdict
from hdvplan.bench.suite import suite_of
from hdvplan.fileio import csv_bytes, write_atomically
from hdvplan.machine import load_average, machine_facts
from hdvplan.record import write_record
from hdvplan.report.markdown import markdown_table

ROOT = Path(__file__).resolve().parents[1]
BASE, COUNTED = "base", "more SQP iterations"
LOADS = ("quiet", "loaded")

# What is appended to the planner's module in the copies.
_SLOWER = """

from dataclasses import replace


def _slowed(plan, factor):
    def slower(self, *arguments):
        began = perf_counter()
        planned = plan(self, *arguments)
        end = began + factor * (perf_counter() - began)
        while perf_counter() < end:
            pass
        return replace(planned, times=replace(planned.times, total=perf_counter() - began))

    return slower


Planner.plan = _slowed(Planner.plan, {factor})
"""
_FURTHER = """

from dataclasses import replace


def _further(made):
    def init(self, vehicle, stations, centred, settings, make_workspace):
        made(self, vehicle, stations, centred, replace(settings, sqp_tolerance=1e-3 * settings.sqp_tolerance), make_workspace)

    return init


Planner.__init__ = _further(Planner.__init__)
"""
PATCHES = {
    BASE: "",
    "same": "",
    "10 % slower": _SLOWER.format(factor=1.1),
    "20 % slower": _SLOWER.format(factor=1.2),
    COUNTED: _FURTHER,
}


@contextmanager
def copies(folder: Path) -> Iterator[dict[str, Program]]:
    """Provide the programs: worktrees of the present commit with their patches, which go afterwards."""
    made: dict[str, Program] = {}
    try:
        for number, (name, patch) in enumerate(PATCHES.items()):
            tree = folder / f"tree{number}"
            shutil.rmtree(tree, ignore_errors=True)  # left by a run that was killed
            git("-C", str(ROOT), "worktree", "prune")
            git("-C", str(ROOT), "worktree", "add", "--detach", str(tree), "HEAD")
            made[name] = Program(name, Path(sys.executable), tree, {"NUMBA_CACHE_DIR": str(folder / "compiled")})
            with (tree / "hdvplan" / "planning" / "planner.py").open("a", encoding="utf-8") as module:
                module.write(patch)
            made[name].check()
        yield made
    finally:
        for program in made.values():
            git("-C", str(ROOT), "worktree", "remove", "--force", str(program.source))


def git(*arguments: str) -> str:
    """Run git and return what it says."""
    return subprocess.run(["git", *arguments], capture_output=True, text=True, check=True).stdout.strip()  # noqa: S603, S607 - fixed


@contextmanager
def load(wanted: bool) -> Iterator[None]:
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
    """Record ``rounds`` processes of every program for each load; those that are already there are kept."""
    arguments = ("bench", *options_of(suite_of(SUITE)), "--quiet", "--fresh", "--out")
    for situation in LOADS:
        with load(situation == "loaded"):
            for round_ in range(rounds):
                order = np.random.default_rng([round_, LOADS.index(situation)]).permutation(list(programs))
                for name in order:
                    if round_ >= processes_of(str(name), rounds):
                        continue
                    program, out = programs[str(name)], recorded(folder, situation, str(name), round_)
                    if not (out / "timing.csv").is_file():
                        print(f"{situation}: {name}, process {round_ + 1} of {rounds}", file=sys.stderr, flush=True)
                        program.finish(program.start(*arguments, str(out)))


def processes_of(name: str, rounds: int) -> int:
    """Return how many processes of a program are recorded under each load; counters are the same in every one."""
    return 2 * BATCH if name == COUNTED else rounds


def recorded(folder: Path, situation: str, name: str, round_: int) -> Path:
    """Return where one process's run is kept."""
    return folder / situation / name.replace(" ", "-").replace("%", "percent") / f"{round_:03d}"


def compile_all(programs: dict[str, Program], folder: Path) -> None:
    """Run every program once, two at a time, so that no recorded process compiles."""
    arguments = ("bench", *options_of(suite_of(SUITE)), "--quiet", "--fresh", "--rounds", "1", "--out")
    waiting = list(enumerate(programs.values()))
    while waiting:
        couple, waiting = waiting[:2], waiting[2:]
        print(f"compiling: {', '.join(program.name for _, program in couple)}", file=sys.stderr, flush=True)
        started = [(program, program.start(*arguments, str(folder / f"warm{number}"))) for number, program in couple]
        for program, process in started:
            program.finish(process)


def drawn(folder: Path, name: str, situation: str, rounds: int, count: int) -> list[Comparison]:
    """Return ``count`` comparisons of BASE with ``name``: of consecutive processes from a random one on, in random order."""
    rounds = processes_of(name, rounds)
    sides = {which: [read_side(recorded(folder, situation, which, round_)) for round_ in range(rounds)] for which in (BASE, name)}
    random = np.random.default_rng([len(name), LOADS.index(situation)])
    found = []
    for _ in range(count):
        first = random.integers(rounds - 2 * BATCH + 1)
        window = first + random.permutation(2 * BATCH)
        pairs = [[sides[which][round_] for round_ in window] for which in (BASE, name)]
        found.append(gated(pairs[0], pairs[1]))
    return found


def gated(base: Sequence[Side], new: Sequence[Side]) -> Comparison:
    """Return what `--against` would say of these processes: of the first five pairs if they are fine, else of all ten."""
    for pairs in (BATCH, 2 * BATCH):
        sides = [Side(side[0].counters, tuple(one.processes[0] for one in side[:pairs])) for side in (base, new)]
        comparison = compare(sides[0], sides[1], Rule(), Tolerance(), expect_changes=False)
        if all(entry.decision is None or entry.decision.verdict is Verdict.FINE for entry in comparison.times):
            break
    return comparison


def end_to_end(programs: dict[str, Program], folder: Path, runs: int) -> pd.DataFrame:
    """Run the real command in the copies, half of the runs under load; those that are already there are kept."""
    file = folder / "end_to_end.csv"
    rows = pd.read_csv(file).to_dict("records") if file.is_file() else []
    verdicts = {0: Verdict.FINE, 1: Verdict.REGRESSED, 3: Verdict.UNMEASURABLE}
    for run in range(runs):
        situation = LOADS[run % 2]
        for name in ("same", "20 % slower"):
            if any((row["run"], row["program"]) == (run, name) for row in rows):
                continue
            print(f"end to end, {situation}: {name}, run {run + 1} of {runs}", file=sys.stderr, flush=True)
            program = programs[name]
            command = program.command("bench", "--against", "HEAD", "--quiet", "--out", str((folder / "against").resolve()))
            with load(situation == "loaded"):
                began = time.monotonic()
                ended = subprocess.run(  # noqa: S603 - our own
                    command, cwd=program.source, env=program.environment(), capture_output=True, text=True, check=False
                )
                seconds = time.monotonic() - began
            said = (ended.stdout or ended.stderr).strip().splitlines()[-1]
            verdict = verdicts.get(ended.returncode, "failed")
            rows.append({"program": name, "situation": situation, "run": run, "verdict": verdict, "seconds": seconds, "said": said})
            write_atomically(file, csv_bytes(pd.DataFrame(rows)))
    return pd.DataFrame(rows, columns=["program", "situation", "run", "verdict", "seconds", "said"])


def table_of(comparisons: dict[tuple[str, str], list[Comparison]], processes: int, ends: pd.DataFrame) -> pd.DataFrame:
    """Return how often every program was judged how, by load; of the recorded processes and of the real command."""
    rows: list[dict[str, object]] = []
    for (name, situation), found in comparisons.items():
        verdicts = [str(comparison.verdict) for comparison in found]
        recorded_runs = processes_of(name, processes)
        rows.append({"how": "drawn", "program": name, "situation": situation, "processes a side": recorded_runs} | _counts(verdicts))
    for key, mine in ends.groupby(["program", "situation"], sort=False):
        what = dict(zip(("program", "situation"), key, strict=True))
        longest = {"longest [s]": round(float(mine["seconds"].max()), 1)}
        rows.append({"how": "end to end"} | what | _counts([str(verdict) for verdict in mine["verdict"]]) | longest)
    return pd.DataFrame(rows)


def _counts(verdicts: Sequence[str]) -> dict[str, object]:
    names = [str(verdict) for verdict in Verdict]
    return {"comparisons": len(verdicts), **{name: verdicts.count(name) for name in names}}


def noise_of(folder: Path, rounds: int) -> str:
    """Return how much processes of the same program differ in the gate's statistic, in words, for each load."""
    words = []
    for situation in LOADS:
        processes = [read_side(recorded(folder, situation, BASE, round_)).processes[0] for round_ in range(rounds)]
        spreads = {}
        for name, statistic in (("min", np.min), ("mean", np.mean)):
            logs = [[np.log(statistic(times, axis=0).mean()) for times in process.values()] for process in processes]
            spreads[name] = 100.0 * np.std(logs, axis=0, ddof=1).max()
        words.append(f"{situation} {spreads['min']:.1f} % (of the plain mean: {spreads['mean']:.1f} %)")
    return f"Standard deviation of a cell between processes, every step with its fastest round, in the worst cell: {', '.join(words)}."


def markdown(table: pd.DataFrame, noise: str) -> str:
    """Return the table with what a reader must know to believe it."""
    facts, rule = machine_facts(), Rule()
    text = table.astype(object).where(table.notna(), "").map(lambda value: f"{value:g}" if isinstance(value, float) else str(value))
    caption = (
        f"How often `hdvplan bench --against` calls a program regressed: factor {rule.factor:g}, floor {1e3 * rule.floor:g} ms, eight "
        "cells. drawn: from recorded processes, each comparison from ten neighbours in time; end to end: the real command, with checkout "
        f"and compilation. loaded: another process keeps the other core busy in bursts. {noise} "
        f"{facts['processor']}, {facts['usable_cores']} cores, {facts['python']}; load average at the end "
        f"{', '.join(f'{value:.1f}' for value in load_average() or [])}."
    )
    return f"{caption}\n\n{markdown_table(text, text=('how', 'program', 'situation'))}\n"


def main() -> None:
    """Record, draw, run end to end, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/gate"), metavar="DIR")
    parser.add_argument("--record", type=Path, default=Path("gate-record"), metavar="DIR", help="where runs are kept")
    parser.add_argument("--processes", type=int, default=60, metavar="N", help="of every program, half of them under load")
    parser.add_argument("--draws", type=int, default=100, metavar="N", help="comparisons of every program, half of them under load")
    parser.add_argument("--runs", type=int, default=10, metavar="N", help="end to end, of the same and of a slower program")
    asked = parser.parse_args()
    rounds = asked.processes // len(LOADS)
    if rounds < 2 * BATCH:
        parser.error(f"--processes must be at least {2 * BATCH * len(LOADS)}")
    folder = asked.record.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    with copies(folder) as programs:
        compile_all(programs, folder)
        record(programs, folder, rounds)
        ends = end_to_end(programs, folder, asked.runs)
    comparisons = {
        (name, situation): drawn(folder, name, situation, rounds, asked.draws // len(LOADS))
        for name in list(PATCHES)[1:]
        for situation in LOADS
    }
    table = table_of(comparisons, rounds, ends)
    asked.out.mkdir(parents=True, exist_ok=True)
    write_atomically(asked.out / "gate.csv", csv_bytes(table))
    write_atomically(asked.out / "gate.md", markdown(table, noise_of(folder, rounds)).encode())
    write_record(asked.out, cases_of(suite_of(SUITE)))
    print(markdown(table, noise_of(folder, rounds)))


if __name__ == "__main__":
    main()
