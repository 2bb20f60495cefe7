"""What came of the inputs of a fuzzer."""

from __future__ import annotations

import resource
import sys
from collections import Counter
from pathlib import Path

from tests.fuzz.targets import Outcome, Target


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


def say(text: str) -> None:
    """Write a line at once."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()
