"""Time what users wait for: commands, a study of the ten real roads of suite.toml, needs, proofs, and a long road.

python benchmarks/seconds.py [--rounds 3] [--only plan,study]

Prints the processor time of each in each round [s] as ``hdvplan bench --command`` reads it: so two revisions take turns by

    hdvplan bench --against REV --command "python $PWD/benchmarks/seconds.py" --time-limit 1200
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

_HERE = Path(__file__).resolve().parent
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
_LONG_KM = 100
_BENDS = 0.02  # [1/m] of the long road: 50 m, left and right, a bend every 500 m
_NARROW = "plan monaco_fairmont_hairpin --vehicle bus --half-width 3.2 --no-plot --no-refine"  # a NO, proved or not
COMMANDS = {
    "help": "--help",
    "roads list": "roads list",
    "refusal": "plan uturn --vehicle bsu",
    "plan": "plan uturn --vehicle bus",
    "plan without picture": "plan uturn --vehicle bus --no-plot",
    "need that fits": "need goteborg_nya_allen --vehicle bus --half-width 2.5",
    "proof": f"{_NARROW} --proof",
    "no proof": f"{_NARROW} --no-proof",
    "long road": "plan long.csv --vehicle bus --half-width 4 --no-plot",
}


def main() -> None:
    """Time everything in rounds, each in processes of its own and a folder that is new, and print the times."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", help="names, with commas between them", default=",".join((*COMMANDS, "study")))
    options = parser.parse_args()
    tasks: dict[str, Callable[[Path], float]] = {name: partial(_command, words.split()) for name, words in COMMANDS.items()}
    tasks["study"] = _study
    names: list[str] = options.only.split(",")
    times: dict[str, list[list[float]]] = {name: [] for name in names}
    for _ in range(options.rounds):
        for name in names:
            with tempfile.TemporaryDirectory() as folder:
                times[name].append([tasks[name](Path(folder))])
    print(json.dumps({"cells": {name: {"steps_s": taken} for name, taken in times.items()}}))


def _command(words: Sequence[str], folder: Path) -> float:
    """Return the processor time of a command and of all processes that it waits for [s]; it keeps nothing from other runs."""
    if "long.csv" in words:
        (folder / "long.csv").write_text(_long_road(), encoding="utf-8")
    before = _spent()
    own = os.environ | _ONE_THREAD | {"TMPDIR": str(folder), "XDG_CACHE_HOME": str(folder)}
    command = [sys.executable, "-m", "hdvplan", *words]
    ended = subprocess.run(command, cwd=folder, env=own, capture_output=True, text=True, check=False)  # noqa: S603 - our own
    if ended.returncode not in {0, 1, 2}:
        sys.exit(ended.stderr)
    return _spent() - before


def _spent() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _study(folder: Path) -> float:
    """Return what the cells of a study took, in one process and without its start and its tables [s]."""
    import pyarrow.parquet as pq  # noqa: PLC0415 - slow to load

    roads = tomllib.loads((_HERE / "suite.toml").read_text(encoding="utf-8"))["roads"]
    (folder / "study.toml").write_text(f'roads = {json.dumps(roads)}\nvehicles = ["bus"]\nhalf_widths = [4]\n', encoding="utf-8")
    _command(["study", "study.toml", "--workers", "1", "--out", "out"], folder)
    return float(sum(pq.read_table(folder / "out" / "cells.parquet")["parallel_cpu_s"].to_pylist()))


def _long_road() -> str:
    """Return a curvature profile: a straight, then a bend to the left or to the right by 90 degrees, again and again."""
    rows, s, sign, ramp, arc = ["s,kappa", "0,0"], 0.0, 1.0, 20.0, 1.5708 / _BENDS - 20.0
    while s < 1e3 * _LONG_KM - 500.0:  # of the profile: it ends with a straight
        for length, kappa in ((400.0, 0.0), (ramp, sign * _BENDS), (arc, sign * _BENDS), (ramp, 0.0)):
            s += length
            rows.append(f"{s:.4f},{kappa}")
        sign = -sign
    return "\n".join([*rows, f"{s + 400.0:.4f},0", ""])


if __name__ == "__main__":
    main()
