"""Fuzz with atheris, which follows the branches that inputs take: ``python -m tests.fuzz.guided --minutes 60 [--seed N] [--keep DIR]``.

Needs ``pip install -e '.[fuzz]'``, on Linux or macOS. For half of the time the readers alone get damaged files, some hundreds a second:
what takes a branch of theirs for the first time goes into the corpus, and is damaged further. In the other half what was found is handed
to the commands and judged as in ``python -m tests.fuzz``. ``--corpus DIR`` keeps what was found, and begins with what is there. The exit
code is 1 where anything failed.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.fuzz.mutation import mutated
from tests.fuzz.readers import Reading, make_readings, watched
from tests.fuzz.tally import Tally, say
from tests.fuzz.targets import LIMIT_S, tried

_LONGEST = 1 << 17  # bytes; an empty GeoPackage has 98 kB
_TELL_S = 60.0


def main() -> int:
    """Find inputs, try the commands with them, and return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--corpus", type=Path)
    chosen = parser.parse_args()
    half, tally = 30.0 * chosen.minutes, Tally(chosen.keep and chosen.keep.resolve())
    with TemporaryDirectory() as name:
        corpus, failed = (chosen.corpus or Path(name, "corpus")).resolve(), Path(name, "failed").resolve()
        for folder in (corpus, failed):
            folder.mkdir(parents=True, exist_ok=True)
        readings = make_readings(Path(name))
        for number, one in enumerate(readings):  # the first byte of an input says which file it stands for
            (corpus / f"{number:02d}").write_bytes(bytes([number]) + one.path.read_bytes())
        guided = get_context("fork").Process(target=_guided, args=(readings, corpus, failed, chosen.seed, half))
        guided.start()
        guided.join()  # libFuzzer ends its process
        faults = sorted(failed.iterdir())
        for file in faults:
            tally.keep(file.name, file.read_bytes())
        _try(readings, corpus, tally, time.monotonic() + half)
    say(tally.told())
    return 1 if guided.exitcode or faults or tally.failures else 0


def _guided(readings: list[Reading], corpus: Path, failed: Path, seed: int, seconds: float) -> None:
    """Let atheris damage files for some time; inputs at which a reader fails go into a folder."""
    import atheris  # noqa: PLC0415 - an optional library, and its instructions cost time

    for function in watched():
        atheris.instrument_func(function)
    count, told = 0, time.monotonic()

    def one(data: bytes) -> None:
        nonlocal count, told
        if not data:
            return
        count += 1
        reading = readings[data[0] % len(readings)]
        fault = reading.fault(data[1:])
        if fault:
            say(f"FAILURE {reading.path.name}: {fault[:200]}")
            (failed / f"{count:07d}-{reading.path.name}").write_bytes(data[1:])
        if time.monotonic() - told > _TELL_S:
            told = time.monotonic()
            say(f"{count} read, {len(list(corpus.iterdir()))} in the corpus")

    def changed(data: bytes, most: int, chance: int) -> bytes:
        rng = random.Random(chance)  # noqa: S311 - no secret
        new = mutated(data[1:], rng) if rng.random() < 0.5 else bytes(atheris.Mutate(data[1:], most - 1))
        return (data[:1] + new)[:most]

    limits = (f"-max_total_time={seconds:.0f}", f"-max_len={_LONGEST}", "-len_control=0", f"-timeout={LIMIT_S:.0f}", "-rss_limit_mb=8000")
    told_where = (f"-artifact_prefix={failed}/", f"-seed={seed}", "-verbosity=0")
    atheris.Setup([sys.argv[0], str(corpus), *limits, *told_where], one, custom_mutator=changed)
    atheris.Fuzz()


def _try(readings: list[Reading], corpus: Path, tally: Tally, until: float) -> None:
    """Hand what was found to the commands, until it is all tried or the time is over."""
    told = time.monotonic()
    for file in sorted(corpus.iterdir()):  # named by digests: in no order
        data = file.read_bytes()
        target = readings[data[0] % len(readings)].command if data else None
        if time.monotonic() > until:
            break
        if target is not None:
            tally.note(target, data[1:], tried(target, data[1:]))
        if time.monotonic() - told > _TELL_S:
            told = time.monotonic()
            say(tally.told())


if __name__ == "__main__":
    sys.exit(main())
