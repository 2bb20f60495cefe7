"""Two programs that are measured in turn: a drive of one, then the same drive of the other, a moment later.

A machine that others share changes its speed within a second, by a third or more. Programs that are measured one after the other
meet different speeds; those that take turns meet the same, drive by drive. The variable ``TURNS`` names a descriptor. A process asks for
its turn by a byte on it, and has it when it receives one; the turn ends when it asks again, closes the descriptor, or ends itself.
"""

from __future__ import annotations

import os
import select
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress

from hdvplan.bench.processes import TURNS, Started

_ASK, _GO = b"?", b"!"
_LOOK_S = 0.2  # how often it is looked whether a process has ended whose children still have the descriptor


@contextmanager
def turns() -> Iterator[Callable[[], None]]:
    """Provide what waits for this process's next turn; where nobody hands out turns, it has one at any time.

    At the end of the block it waits once more: what follows does not disturb the other's last turn.
    """
    told = os.environ.pop(TURNS, "")  # the descriptor is not for what this process starts
    if not told.isdecimal():
        yield lambda: None
        return
    descriptor = int(told)

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


def in_turn(starting: Iterable[Started]) -> None:
    """Let processes take turns until none asks for one any more.

    Each is started when the one before waits for its first turn, or has ended: so what loads the next does not disturb it, and
    programs that know nothing of turns run one after the other.
    """
    waiting = deque(one for one in starting if _asks(one))
    while waiting:
        one = waiting.popleft()
        if one.turns is None:
            continue
        with suppress(OSError):  # it has ended
            one.turns.send(_GO)
            if _asks(one):
                waiting.append(one)


def shared_cores(*, one_is_enough: bool) -> Sequence[int | None]:
    """Return the cores that pairs of processes use one after the other; None: any, where one is too little or the system gives no choice.

    Cores differ in speed too, if others use their other half.
    """
    return sorted(os.sched_getaffinity(0)) if one_is_enough and hasattr(os, "sched_getaffinity") else [None]


def _asks(one: Started) -> bool:
    """Wait until a process asks for a turn, or does not any more; tell which."""
    while one.turns is not None:
        ready, _, _ = select.select([one.turns], [], [], _LOOK_S)
        if ready:
            with suppress(OSError):
                return bool(one.turns.recv(1))
            return False
        if one.process.poll() is not None:
            return False
    return False
