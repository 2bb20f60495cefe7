"""Turns of a process that is compared with another: it asks for each by a byte on a descriptor, and waits for one back."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

TURNS = "HDVPLAN_TURNS"  # the variable that tells a process of its descriptor
_ASK = b"?"


@contextmanager
def turns() -> Iterator[Callable[[], None]]:
    """Provide what waits for this process's next turn; where nobody hands out turns, it has one at any time.

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
