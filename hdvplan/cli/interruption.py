"""Ctrl-C at any moment: an interrupted command says so and nothing else."""

from __future__ import annotations

import signal
import sys
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType


@contextmanager
def interruption_noted() -> Iterator[Callable[[], bool]]:
    """Note a Ctrl-C in the block, which raises ``KeyboardInterrupt`` as ever; yield what tells whether there was one.

    Compiled libraries turn that exception into one of their own, or lose it: in their imports, callbacks and destructors. Where it is lost
    Python would print a traceback.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler or threading.current_thread() is not threading.main_thread():
        yield lambda: False  # it is ignored, as behind nohup, or somebody else's
        return
    seen: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        seen.append(number)
        signal.default_int_handler(number, frame)

    tell = sys.unraisablehook

    def tell_others(lost: sys.UnraisableHookArgs) -> None:
        if not isinstance(lost.exc_value, KeyboardInterrupt):
            tell(lost)

    signal.signal(signal.SIGINT, note)
    sys.unraisablehook = tell_others
    try:
        yield lambda: bool(seen)
    finally:
        sys.unraisablehook = tell
        signal.signal(signal.SIGINT, signal.default_int_handler)
