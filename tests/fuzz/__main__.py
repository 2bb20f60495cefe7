"""Fuzz what hdvplan reads: ``python -m tests.fuzz --minutes 60 [--seed N] [--keep DIR]``.

Damages small valid files of every kind, hands each to its command, and counts what came of it. Exit code 1 where any input was met by a
traceback, a warning of a library, an exit code that there is not, more than one error line, impossible numbers, or more than 90 s of CPU
time; ``--keep`` writes those inputs down.
"""

from __future__ import annotations

import argparse
import random
import resource
import sys
import time
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.fuzz.kills import say
from tests.fuzz.mutation import mutated
from tests.fuzz.targets import Outcome, Target, make_targets, tried


class Tally:
    """Counts what came of the inputs, tells what failed, and keeps those inputs in a folder."""

    def __init__(self, keep: Path | None) -> None:
        self.codes: Counter[int] = Counter()
        self.planned, self.failures, self.slowest = 0, 0, 0.0
        self._keep = keep

    def note(self, target: Target, content: bytes, outcome: Outcome) -> None:
        """Count one input."""
        self.codes[outcome.code] += 1
        self.planned += outcome.planned
        self.slowest = max(self.slowest, outcome.seconds)
        if outcome.fault:
            self.failures += 1
            say(f"FAILURE {target.name}: {outcome.fault}: {outcome.error[:200]}")
            self.keep(f"{self.failures:03d}-{target.path.name}", content)
            if outcome.trace:
                self.keep(f"{self.failures:03d}-{target.path.name}.trace", outcome.trace.encode())

    def keep(self, name: str, content: bytes) -> None:
        """Write an input that failed into the folder for those, if there is one."""
        if self._keep is not None:
            self._keep.mkdir(parents=True, exist_ok=True)
            (self._keep / name).write_bytes(content)

    @property
    def total(self) -> int:
        """The number of inputs."""
        return sum(self.codes.values())

    def told(self) -> str:
        """Return the counts in a line."""
        codes = ", ".join(f"{count} exit {code}" for code, count in sorted(self.codes.items()))
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        return (
            f"{self.total} inputs: {codes}; {self.planned} ({self.planned / max(self.total, 1):.0%}) answered; {self.failures} failures; "
            f"slowest {self.slowest:.1f} s of CPU, {memory:.0f} MB"
        )


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
