"""End a study again and again at random moments, let it go on each time, and compare its tables with those of an undisturbed run.

python benchmarks/study_kills.py benchmarks/studies/liechtenstein.toml --whole DIR --out OTHER [--kills 5] [--workers 2] [--record FILE.csv]

DIR holds the finished study that nobody disturbed, planned by the same hdvplan. Kills are of three kinds: SIGKILL to the study with all
its workers, SIGTERM to all, and SIGKILL to one worker alone, beside which the study runs on. Moments are drawn over the time that DIR
took. What is compared are all columns of both tables but those whose names begin with ``parallel_``, and the ranking. --record writes a
row for each kill. Exits with 1 if anything differs, or if a process outlives its study. Linux only: processes are found in /proc.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing, suppress
from datetime import datetime
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq

from hdvplan.study.cells import PARALLEL
from hdvplan.study.conduct import RANKING, RECORD
from hdvplan.study.store import CELLS, KEPT, PLACES

ALL_KILLED, ALL_ENDED, ONE_KILLED = "SIGKILL to all", "SIGTERM to all", "SIGKILL to a worker"
KINDS = (ONE_KILLED, ALL_KILLED, ALL_ENDED)
_LAST = 0.9  # of the whole time, when the last kill may come
_PATIENCE_S = 30.0  # until all processes of a group are gone, or a worker is there
_TRIES = 3  # of the last start, where cells have no answer


def start(file: Path, out: Path, workers: int) -> subprocess.Popen[bytes]:
    """Start a study, or let it go on, in a process group of its own."""
    command = ["-P", "-m", "hdvplan", "study", str(file), "--out", str(out), "--workers", str(workers), "--quiet"]
    return subprocess.Popen([sys.executable, *command], start_new_session=True)  # noqa: S603 - our own


def workers_of(process: subprocess.Popen[bytes]) -> list[int]:
    """Return the processes in which a study plans."""
    tasks = Path(f"/proc/{process.pid}/task").glob("*/children")  # each thread has its own
    found = []
    for child in " ".join(task.read_text(encoding="utf-8") for task in tasks).split():
        with suppress(OSError):
            found += [int(child)] if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes() else []
    return found


def kill(process: subprocess.Popen[bytes], kind: str, moments: random.Random) -> str:
    """Do to a study what ``kind`` says; return how it took it."""
    if kind == ONE_KILLED:
        until = time.monotonic() + _PATIENCE_S
        while not (workers := workers_of(process)) and time.monotonic() < until:
            time.sleep(0.1)
        if not workers:
            return "had no worker"
        os.kill(moments.choice(workers), signal.SIGKILL)
        return "goes on"
    os.killpg(process.pid, signal.SIGKILL if kind == ALL_KILLED else signal.SIGTERM)
    code = process.wait()
    until = time.monotonic() + _PATIENCE_S
    while (left := alive(process.pid)) and time.monotonic() < until:
        time.sleep(0.1)
    return f"ended with {code}" + (", and a process outlived it" if left else "")


def alive(group: int) -> bool:
    """Tell whether any process of a group is left; one that has ended and that nobody has asked for its code is none."""
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, _, of = stat.read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()[:3]
            if int(of) == group and state != "Z":
                return True
    return False


def kept(out: Path) -> int:
    """Return how many cells are on disk."""
    with suppress(sqlite3.OperationalError), closing(sqlite3.connect(out / KEPT)) as file:  # there is none yet
        return int(file.execute("SELECT count(*) FROM cells").fetchone()[0])
    return 0


def differences(whole: Path, other: Path) -> list[str]:
    """Return what two folders of a study differ in, besides what was measured beside other work."""
    found = []
    for name in (CELLS, PLACES):
        one, two = (pd.read_parquet(folder / name) for folder in (whole, other))
        columns = [column for column in one if not str(column).startswith(PARALLEL)]
        if len(one) != len(two) or list(one) != list(two):
            found.append(f"{name}: {len(one)} rows against {len(two)}")
        else:
            found += [f"{name}: {column}" for column in columns if not one[column].equals(two[column])]
    if (whole / RANKING).read_bytes() != (other / RANKING).read_bytes():
        found.append(RANKING)
    return found


def took(whole: Path) -> float:
    """Return how long an undisturbed study took [s]."""
    told = json.loads((whole / RECORD).read_text(encoding="utf-8"))
    began, finished = (datetime.fromisoformat(moment) for moment in (told["sessions"][0]["started"], told["finished"]))
    return (finished - began).total_seconds()


def main() -> int:
    """Kill, resume, compare; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--whole", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--kills", type=int, default=5, metavar="N")
    parser.add_argument("--workers", type=int, default=2, metavar="N")
    parser.add_argument("--seed", type=int, default=0, metavar="N")
    parser.add_argument("--record", type=Path)
    asked = parser.parse_args()
    moments = random.Random(asked.seed)  # noqa: S311 - not for secrets
    total, spent, rows = took(asked.whole), 0.0, []
    process = start(asked.file, asked.out, asked.workers)
    for number, moment in enumerate(sorted(moments.uniform(0.0, _LAST * total) for _ in range(asked.kills))):
        with suppress(subprocess.TimeoutExpired):
            process.wait(max(1.0, moment - spent))
        spent = max(spent + 1.0, moment)
        kind = KINDS[number % len(KINDS)]
        taken = "had ended before" if process.poll() is not None else kill(process, kind, moments)
        rows.append({"kill": number + 1, "after_s": round(spent, 1), "what": kind, "study": taken, "cells_kept": kept(asked.out)})
        print(*rows[-1].values(), sep="  ", flush=True)
        if process.poll() is not None:
            process = start(asked.file, asked.out, asked.workers)
    for _ in range(_TRIES):
        if process.wait() == 0:
            break
        process = start(asked.file, asked.out, asked.workers)
    code = process.wait()
    if asked.record is not None:
        pd.DataFrame(rows).to_csv(asked.record, index=False, lineterminator="\n")
    found = differences(asked.whole, asked.out)
    outlived = [row for row in rows if "outlived" in str(row["study"])]
    cells = pq.read_metadata(asked.out / CELLS)
    print(f"exit code {code}; {cells.num_rows} cells of {cells.num_columns} columns: {'; '.join(found) or 'nothing differs'}")
    return int(bool(found or outlived or code))


if __name__ == "__main__":
    sys.exit(main())
