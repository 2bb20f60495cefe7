"""Kill commands at random moments: ``python -m tests.fuzz.kills [--kills 50] [--seed N]``.

Every command runs over what an earlier run has left, and ends by SIGINT, SIGTERM or SIGKILL between its first moment and its last. What is
there then must be the former result or the new one, whole, and the same command must afterwards end as if nothing had happened; cells of a
study that were kept are not planned again. Exit code 1 where it is not so. Needs a system with signals.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
import zlib
from collections.abc import Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory

import pyarrow as pa
import pyarrow.parquet as pq

import hdvplan
from hdvplan.fileio import settle
from hdvplan.study.store import KEPT

_PACKAGE = Path(hdvplan.__file__).parent
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
_HIDDEN = "."  # how names of files begin that are only there while a command runs


def say(text: str) -> None:
    """Write a line at once."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


@dataclass(frozen=True)
class Job:
    """A command that writes ``out`` in one of two ways, so that a former result can be told from a new one."""

    name: str
    out: str
    ways: tuple[tuple[str, ...], ...]  # two
    together: bool = True  # all files change at once; else one by one


JOBS = (
    Job("plan", "plan", tuple(("plan", "uturn", "--vehicle", "bus", "--half-width", w, "--no-proof", "--out", "plan") for w in ("4", "5"))),
    Job("report", "page.html", tuple(("report", name, "--out", "page.html") for name in ("one", "two"))),
    Job("need", "need", tuple(("need", "uturn", "--vehicle", name, "--no-proof", "--out", "need") for name in ("bus", "rigid-truck"))),
    Job("reproduce", "studies", (("reproduce", "bus-uturn", "--out", "studies"), ("reproduce", "overhang", "--out", "studies")), False),
    Job(
        "bench",
        "bench",
        tuple(
            ("bench", "--roads", "uturn", "--vehicles", "bus", "--solvers", "riccati", "--rounds", n, "--out", "bench", "--fresh")
            for n in ("1", "2")
        ),
        False,
    ),
    Job("study", "study", tuple(("study", f"{name}.toml", "--out", "study", "--workers", "2") for name in ("one", "two")), False),
)
_STUDY = 'roads = ["uturn", "sturn"]\nvehicles = ["bus", "rigid-truck"]\nhalf_widths = [{}]\n'


def main() -> int:
    """Kill, look, and run to the end, again and again; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=lambda text: text.split(","), default=[job.name for job in JOBS])
    chosen = parser.parse_args()
    rng, failures = random.Random(chosen.seed), 0  # noqa: S311 - no secret
    jobs = [job for job in JOBS if job.name in chosen.jobs]
    with TemporaryDirectory() as name:
        folder = Path(name)
        for study, widths in (("one", "3.0, 3.5, 4.0"), ("two", "4.0, 4.5, 5.0")):
            (folder / f"{study}.toml").write_text(_STUDY.format(widths), encoding="utf-8")
        for plan, width in (("one", "4"), ("two", "5")):
            _whole(("plan", "uturn", "--vehicle", "bus", "--half-width", width, "--no-proof", "--out", plan), folder)
        known = {job.name: [_known(job, way, folder) for way in (0, 1)] for job in jobs}
        for number in range(chosen.kills):
            job, way, by = jobs[number % len(jobs)], rng.randrange(2), rng.choice(SIGNALS)
            after = rng.uniform(0.0, 1.05) * known[job.name][way].seconds
            fault = _killed(job, way, by, after, folder, known[job.name])
            failures += bool(fault)
            say(f"{job.name}, way {way}, {by.name} after {after:.1f} s: {fault or 'as it should be'}")
    say(f"{chosen.kills} kills, {failures} failures")
    return 1 if failures else 0


@dataclass(frozen=True)
class Known:
    """What an undisturbed run leaves: names of files, the digests of those that are the same every time, and how long it took."""

    names: frozenset[str]
    digests: dict[str, str]
    seconds: float


def _known(job: Job, way: int, folder: Path) -> Known:
    found = []
    for _ in range(2):
        _remove(folder / job.out)
        began = time.monotonic()
        _whole(job.ways[way], folder)
        seconds = time.monotonic() - began
        found.append(digests(folder / job.out))
    same = {name: digest for name, digest in found[0].items() if found[1].get(name) == digest}
    return Known(frozenset(found[0]), same, seconds)


def _killed(job: Job, way: int, by: signal.Signals, after: float, folder: Path, known: Sequence[Known]) -> str:
    """Kill a run over the other way's result; return what is wrong then, or after the run that follows."""
    out = folder / job.out
    _remove(out)
    _whole(job.ways[1 - way], folder)
    process = _started(job.ways[way], folder)
    with suppress(subprocess.TimeoutExpired):
        process.wait(after)
    process.send_signal(by)
    said = process.communicate(timeout=60)[1]
    if process.returncode not in {0, 1, 130, 143, -by} or ("Traceback" in said and not before_us(process.returncode, said)):
        return f"exit {process.returncode}: {said[-300:]}"
    if job.together:
        if out.is_dir():
            settle(out)  # as the next command would
        left = digests(out)
        if not any(_matches(left, one) for one in known):
            return f"neither the former result nor the new one: {sorted(left)}"
    torn = [name for name in _names(out) if is_torn(out / name if out.is_dir() else out)]
    if torn:
        return f"torn: {torn}"
    kept = _kept(out / KEPT)
    _whole(job.ways[way], folder)
    again = [key for key, seconds in _cells(out / "cells.parquet").items() if kept.get(key, seconds) != seconds]
    if again:
        return f"planned again, though they were kept: {again}"
    left = digests(out)
    wrong = [name for name, digest in known[way].digests.items() if left.get(name) != digest]
    return f"the next run differs in {wrong}" if wrong else ""


def before_us(code: int, said: str) -> bool:
    """Tell whether Ctrl-C came while Python itself was starting, before it had come to hdvplan."""
    return code == -signal.SIGINT and str(_PACKAGE) not in said


def _matches(left: dict[str, str], one: Known) -> bool:
    visible = {name for name in left if not name.startswith(_HIDDEN)}
    return visible == one.names and all(left[name] == digest for name, digest in one.digests.items())


def is_torn(path: Path) -> bool:
    """Tell whether a file that a reader would open ends in the middle."""
    if path.name.startswith(_HIDDEN) or "/." in str(path):
        return False
    content = path.read_bytes()
    match path.suffix:
        case ".json" | ".geojson" | ".parquet":
            try:
                pq.ParquetFile(path).read() if path.suffix == ".parquet" else json.loads(content)
            except (OSError, ValueError, pa.ArrowException):
                return True
        case ".png":
            return not content.endswith(b"IEND\xaeB`\x82")
        case ".html":
            return not content.rstrip().endswith(b"</html>")
        case ".csv" | ".md":
            return not content.endswith(b"\n")
        case _:
            pass
    return False


def _whole(words: Sequence[str], folder: Path) -> None:
    """Run a command to its end.

    Raises:
        RuntimeError: it does not end with 0 or 1.

    """
    process = _started(words, folder)
    said = process.communicate()[1]
    if process.returncode not in {0, 1}:
        msg = f"{' '.join(words)}: exit {process.returncode}: {said}"
        raise RuntimeError(msg)


def _started(words: Sequence[str], folder: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-P", "-m", "hdvplan", *words, "--quiet"]
    return subprocess.Popen(  # noqa: S603 - our own
        command, cwd=folder, env=os.environ | {"MPLBACKEND": "agg"}, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )


def _names(out: Path) -> list[str]:
    """Return the names of all files in the folder; of a file its own."""
    if not out.is_dir():
        return [out.name] if out.exists() else []
    return sorted(str(path.relative_to(out)) for path in out.rglob("*") if path.is_file())


def digests(out: Path) -> dict[str, str]:
    """Return the digests of all files by their names; of a table of a study without its times."""
    return {name: sha256(_content(out / name if out.is_dir() else out)).hexdigest() for name in _names(out)}


def _content(path: Path) -> bytes:
    if path.suffix != ".parquet":
        return path.read_bytes()
    table = pq.ParquetFile(path).read()
    return repr(table.select([name for name in table.column_names if not name.startswith("parallel_")]).to_pylist()).encode()


def _cells(path: Path) -> dict[str, float]:
    """Return how long the cells in the table of a study took, by their keys: times tell whether they were planned anew."""
    if not path.exists():
        return {}
    table = pq.ParquetFile(path).read(["key", "parallel_wall_s"]).to_pydict()
    return dict(zip(table["key"], table["parallel_wall_s"], strict=True))


def _kept(path: Path) -> dict[str, float]:
    """Return the same of the cells that a study keeps."""
    if not path.exists():
        return {}
    with closing(sqlite3.connect(path)) as file:
        if not file.execute("SELECT 1 FROM sqlite_master").fetchone():
            return {}
        kept = file.execute("SELECT key, content FROM cells")
        return {key: json.loads(zlib.decompress(content))[0]["parallel_wall_s"] for key, content in kept}


def _remove(out: Path) -> None:
    if out.is_dir():
        shutil.rmtree(out)
    else:
        out.unlink(missing_ok=True)


if __name__ == "__main__":
    sys.exit(main())
