"""Signals that end a program: heard as exceptions, so that it cleans up, and held back while it must not be disturbed."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class _SignalError(KeyboardInterrupt):
    """A signal that ends a block, with the exit code. Who guards against other people's code lets it through as Ctrl-C, unlike sys.exit."""


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end the block as an exception does, so that it cleans up; the exit code is as shells report it.

    A signal that is ignored stays so, as SIGHUP behind nohup.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def leave(number: int, _: FrameType | None) -> None:
        raise _SignalError(128 + number)

    heard = [number for number in _SIGNALS if number != signal.SIGINT and signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, leave) for number in heard}
    try:
        yield
    except _SignalError as error:
        raise SystemExit(*error.args) from None
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Hold SIGINT, SIGTERM and SIGHUP back until the block has ended."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []
    before = {number: signal.signal(number, lambda number, _: held.append(number)) for number in _SIGNALS}
    try:
        yield
    finally:
        for number in reversed(before):
            signal.signal(number, before[number])
        if held:
            signal.raise_signal(held[0])
