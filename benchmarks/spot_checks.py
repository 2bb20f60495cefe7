"""Make one random row of every folder of results again, and compare it with the committed one; exit code 1 where one differs.

python benchmarks/spot_checks.py [--seed N] [--only FOLDER...]

benchmarks/results.toml says of every folder how a row is made. Times are not compared. A folder that results/stale.txt lists may differ:
it is told, and is no error.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import random
import re
import shlex
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
from check_results import listed_stale

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "results"
FOLDERS = tomllib.loads(Path(__file__).with_name("results.toml").read_text(encoding="utf-8"))

# Times, memory, and sentences that repeat other columns; the path's difference is from the first solver that was asked for.
_SKIPPED = re.compile(r"_ms$|cpu_s|^time_s$|_mb$|wall|^ratio$|^(ipopt|fatrop)\w*_ratio$|\[s\]$|^path_difference_m$|^(remark|text|case)$")
_NUMBER = re.compile(r"(-?\d+(?:\.\d+)?(?:e[+-]?\d+)?)")
# What a number may differ by, absolutely and of its value: the first pattern that its column's name has counts.
_TOLERANCES = (
    (re.compile(r"residual|primal|^distance_[mu]$|differs|_off_m$|apart\w*_mm$"), 1e-4, 0.0),  # rounding: as small, whatever it is
    (re.compile(r"iterations|qps|programs|binding_share|halved|cells_mean"), 1.0, 0.1),  # rounding decides about the last iteration
    (re.compile(r"squared|kappa|curvature|sharpness|heading|psi|^K$|median_m|max_m"), 1e-6, 2e-3),  # small: 0.2 %
    (re.compile(r"^s$|^s_|_s$|_s_m$|_length$|^examined_m$|^proved_(from|to)|^message$"), 0.5, 0.0),  # two stations of the envelope
    (re.compile(r"half_width|proved_below|out_of_reach"), 0.01, 0.0),  # to which needs are searched
    (re.compile(r"^mb$"), 20.0, 0.0),  # of 130: the driver with its tables, however many cells they have
    (re.compile(""), 1e-3, 1e-4),  # a millimetre: a tenth of what counts as kept
)

Row = dict[str, str]


@dataclass(frozen=True)
class Spot:
    """How the rows of a file are made again: see benchmarks/results.toml."""

    file: str
    key: Sequence[str] = ()
    run: str = ""
    where: str = ""
    made: str = ""  # the file in which the new row is, if not ``file``
    only: Sequence[str] = ()  # columns to compare


class FailedError(Exception):
    """A row that cannot be made again, and why."""


def rows_of(file: Path) -> list[Row]:
    """Return the rows of a CSV file, or the one of a JSON object, its lists as text."""
    if file.suffix == ".json":
        flat = pd.json_normalize(json.loads(file.read_text(encoding="utf-8"))).iloc[0]
        return [{str(name): json.dumps(value) if isinstance(value, list) else str(value) for name, value in flat.items()}]
    with file.open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


def chosen(folder: Path, spots: Sequence[Spot], seed: int) -> tuple[Spot, Row]:
    """Return a random row of a folder, and how it is made again."""
    dice = random.Random(f"{seed} {folder.name}")  # noqa: S311 - no secret
    spot = dice.choice(spots)
    rows = rows_of(folder / spot.file)
    places = pd.read_csv(folder / spot.file).query(spot.where).index if spot.where else range(len(rows))
    return spot, rows[dice.choice(list(places))]


def again(command: str, spot: Spot, row: Row, out: Path) -> Row:
    """Return a row made anew: the folder's command, asked for little more than that row, into another folder.

    Raises:
        FailedError: the command fails, or does not make that row.

    """
    own = spot.run.startswith(("python ", "hdvplan "))
    words = [word.format_map(row) for word in shlex.split(spot.run if own else f"{command} {spot.run}")]
    program = [sys.executable, *(["-m", "hdvplan"] if words[0] == "hdvplan" else []), *words[1:], "--out", str(out)]
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    ended = subprocess.run(program, cwd=ROOT, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, check=False)  # noqa: S603 - ours
    file = out / (spot.made or spot.file).format_map(row)
    if ended.returncode or not file.is_file():
        raise FailedError((ended.stderr or ended.stdout).strip().rpartition("\n")[2] or f"no {file.name}")
    found = [made for made in rows_of(file) if all(made[name] == row[name] for name in spot.key)]
    if not found:
        msg = f"{file.name} has no such row now"
        raise FailedError(msg)
    return found[-1]


def compared(spot: Spot, then: Row, now: Row) -> dict[str, float]:
    """Return by how many times its tolerance every column differs: at most 1 where it is the same, infinite where words are others."""
    names = spot.only or [name for name in now if name in then and name not in spot.key and not _SKIPPED.search(name)]
    return {name: _apart(name, then[name], now[name]) for name in names}


def _apart(name: str, then: str, now: str) -> float:
    absolute, relative = next(bounds for pattern, *bounds in _TOLERANCES if pattern.search(name))
    parts = [_NUMBER.split(text) for text in (then, now)]
    if parts[0][::2] != parts[1][::2]:
        return float("inf")
    numbers = [(float(one), float(other)) for one, other in zip(parts[0][1::2], parts[1][1::2], strict=True)]
    return max((abs(other - one) / (absolute + relative * abs(one)) for one, other in numbers), default=0.0)


def check(folder: Path, table: Mapping[str, object], seed: int) -> tuple[str, str, bool]:
    """Return which row of a folder was made again, what was compared, and whether it is the same."""
    spots = [Spot(**entry) for entry in table["again"]]  # type: ignore[attr-defined] # TOML's lists of tables
    spot, row = chosen(folder, spots, seed)
    about = ", ".join([spot.file, *(row[name] for name in spot.key)])
    with tempfile.TemporaryDirectory() as out:
        try:
            now = again(str(table["command"]), spot, row, Path(out))
        except FailedError as error:
            return about, f"cannot be made again: {error}", False
    apart = compared(spot, row, now)
    worst = max(apart, key=lambda name: apart[name])
    said = f"{len(apart)} columns, most {worst}: {row[worst]}" + (f" -> {now[worst]}" if row[worst] != now[worst] else "")
    return about, said, apart[worst] <= 1.0


def main(arguments: Sequence[str] | None = None, results: Path = RESULTS) -> int:
    """Check the folders, and print a row for each."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seed", type=int, default=random.randrange(10**6), metavar="N", help="which rows [default: others each time]")  # noqa: S311
    parser.add_argument("--only", nargs="+", choices=list(FOLDERS), default=list(FOLDERS), metavar="FOLDER")
    asked = parser.parse_args(arguments)
    stale, wrong = listed_stale(results), 0
    print(f"seed {asked.seed}\nverdict  folder: row: compared")
    for name in asked.only:
        about, said, same = check(results / name, FOLDERS[name], asked.seed)
        verdict = "same" if same else "stale" if name in stale else "DIFFERS"
        wrong += verdict == "DIFFERS"
        print(f"{verdict:<8} {name}: {about}: {said}", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
