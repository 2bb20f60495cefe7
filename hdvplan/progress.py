"""What a longer work tells of its progress: the share of it that is done, 0 to 1."""

from __future__ import annotations

from collections.abc import Callable


def part_of(on_progress: Callable[[float], None] | None, start: float, end: float) -> Callable[[float], None] | None:
    """Return what hears the share of a part, which goes from ``start`` to ``end`` of the whole; None where nobody wants to hear it."""
    return None if on_progress is None else lambda share: on_progress(start + (end - start) * share)
