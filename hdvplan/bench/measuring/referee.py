"""What a solver may not do while it is measured, however right its answers are: wait, change clocks, remember answers.

Each is told from the outside, and none depends on how busy the machine is. A solver that waits gives its core away of its own accord,
which the system counts apart from what it takes away; one that remembers answers the same programs much faster from the second round on.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from types import BuiltinFunctionType

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.bench.measuring.samples import NUMBERS

if sys.platform != "win32":
    import resource

_CLOCKS = ("perf_counter", "process_time", "monotonic")
_WAITS = 1.5  # times as long by the clock as by the processor
_OFTEN = 0.5  # of a drive's steps in which a solver waits
_REMEMBERS = 4.0  # times as long in the first round as later: caches that are cold and a busy machine make up to twice
_FEWEST = 4  # steps from which that is told


class Watch:
    """Watches one measured drive from when it is made."""

    def __init__(self) -> None:
        """Begin."""
        self._began = _spent()

    def fault(self, steps: int) -> str:
        """Return what the solver did in ``steps`` that forbids ranking it, in words; nothing of a fair one."""
        if changed := changed_clocks():
            return f"the solver changes clocks: {', '.join(changed)}"
        wall, cpu, given_away = (now - then for now, then in zip(_spent(), self._began, strict=True))
        if given_away >= max(1.0, _OFTEN * steps) and wall > _WAITS * cpu:
            return f"the solver waits instead of working, or works elsewhere: {wall / max(cpu, 1e-9):.3g} times as long by the clock"
        return ""


def _spent() -> tuple[float, float, float]:
    """Return clock time, processor time [s], and how often this thread has given its core away of its own accord."""
    if sys.platform == "win32":
        return time.perf_counter(), time.process_time(), 0.0  # there a solver that waits is not told
    given_away = resource.getrusage(getattr(resource, "RUSAGE_THREAD", resource.RUSAGE_SELF)).ru_nvcsw
    return time.perf_counter(), time.process_time(), float(given_away)


def changed_clocks() -> list[str]:
    """Return the clocks of this process that are no longer the system's, ``module.name``."""
    ours = [(name, module) for name, module in sorted(sys.modules.items()) if name == "time" or name.startswith("hdvplan")]
    return [
        f"{name}.{clock}"
        for name, module in ours
        for clock in _CLOCKS
        if (found := getattr(module, clock, None)) is not None and not _genuine(found, clock)
    ]


def _genuine(found: object, clock: str) -> bool:
    """Tell whether a function is the clock of that name in C."""
    return isinstance(found, BuiltinFunctionType) and found.__self__ is time and found.__name__ == clock


def remembers(rounds: Sequence[FloatArray]) -> bool:
    """Tell whether a solver answers out of its memory what it was asked before; ``rounds`` are a cell's ``Measurement.steps``."""
    count = min(map(len, rounds))
    if len(rounds) < 2 or count < _FEWEST:  # noqa: PLR2004 - a round and another
        return False
    first, *later = (steps[:count, NUMBERS.index("cpu_s")] for steps in rounds)
    ratio = first / np.maximum(np.min(later, axis=0), 1e-9)
    return bool(np.median(ratio) > _REMEMBERS)
