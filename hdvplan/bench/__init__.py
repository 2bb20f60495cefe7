"""Measuring planning time honestly: what both rooms agree on, and turns of a process that is compared with another."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

FACTOR, FLOOR_S = 1.08, 1e-6  # by which a planning step must be slower to count as a regression; steps of 12 us show the factor
ENVELOPE_M = 1e-4  # by which envelopes of one program may differ unreported
PATIENCE_S = 300.0  # for so long two programs are measured on where noise hides the answer
TIME_LIMIT_S = 600.0  # of a process of theirs, without waiting for its turns
PICTURE = "bench.png"  # of a run, in its directory
TURNS = "HDVPLAN_TURNS"  # the variable that tells a process of its descriptor
_ASK = b"?"


@contextmanager
def turns() -> Iterator[Callable[[], None]]:
    """Provide what waits for this process's next turn; where nobody hands out turns, it has one at any time.

    It asks for each by a byte on a descriptor, and waits for one back.
    At the end of the block it waits once more: what follows does not disturb the other's last turn.
    """
    number = os.environ.pop(TURNS, "")  # the descriptor is not for what this process starts
    if not number.isdecimal():
        yield lambda: None
        return
    descriptor = int(number)

    def take() -> None:
        with suppress(OSError):  # who hands out turns is gone: so is the comparison
            os.write(descriptor, _ASK)
            os.read(descriptor, 1)

    try:
        yield take
        take()
    finally:
        with suppress(OSError):
            os.close(descriptor)
