"""Fuzz what hdvplan reads: ``python -m tests.fuzz --minutes 60 [--seed N] [--keep DIR]``.

Damages small valid files of every kind, hands each to its command, and counts what came of it. Exit code 1 where any input was met by a
traceback, a warning of a library, an exit code that there is not, more than one error line, impossible numbers, or more than 90 s of CPU
time; ``--keep`` writes those inputs down.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.fuzz.mutation import mutated
from tests.fuzz.tally import Tally, say
from tests.fuzz.targets import make_targets, tried


def main() -> int:
    """Damage files at random until the time is over, and return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path)
    chosen = parser.parse_args()
    tally = Tally(chosen.keep and chosen.keep.resolve())
    rng, until, told = random.Random(chosen.seed), time.monotonic() + 60.0 * chosen.minutes, time.monotonic()  # noqa: S311 - no secret
    with TemporaryDirectory() as name:
        targets = make_targets(Path(name))
        while time.monotonic() < until:
            target = rng.choice(targets)
            content = mutated(target.path.read_bytes(), rng)
            tally.note(target, content, tried(target, content))
            if time.monotonic() - told > 60.0:
                told = time.monotonic()
                say(tally.told())
    say(tally.told())
    return 1 if tally.failures else 0


if __name__ == "__main__":
    sys.exit(main())
