"""Show that kernels compile: a bar that counts them at a terminal, else one line."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numba.core import event
    from rich.progress import Progress

ABOUT = 60  # kernels that a first plan compiles: fewer without limits, more where they bind
COMPILING = "compiling the planning kernels, once per installation and kind of vehicle"


def note_compiling(*, quiet: bool) -> None:
    """Say so in one line where no bar will, if the kernels of this installation are not compiled yet."""
    from hdvplan.jit import is_compiled

    if not (is_compiled() or quiet or sys.stderr.isatty()):
        sys.stderr.write(f"{COMPILING}\n")
        sys.stderr.flush()


@contextmanager
def compilation_shown(bar: Progress) -> Iterator[None]:
    """Add a line to ``bar`` that counts hdvplan's kernels as they compile in the block; none where all are compiled.

    Commands that have not loaded numba by then compile nothing.
    """
    if "numba" not in sys.modules:
        yield
        return
    from numba.core import event

    class Count(event.Listener):
        """Numba calls it when it begins and ends to compile any function; what is loaded from the cache it does not tell."""

        def __init__(self) -> None:
            self.task = bar.add_task("", total=ABOUT, visible=False)
            self.done = 0

        def on_start(self, told: event.Event) -> None:
            if _is_ours(told):
                self._show()

        def on_end(self, told: event.Event) -> None:
            if _is_ours(told):
                self.done += 1
                self._show()

        def _show(self) -> None:
            words = f"compiling, once per installation: {self.done} of about {max(ABOUT, self.done)} kernels"
            bar.update(self.task, completed=self.done, total=max(ABOUT, self.done), description=words, visible=True, refresh=True)

    with event.install_listener("numba:compile", Count()):
        yield


def _is_ours(told: event.Event) -> bool:
    return str(told.data["dispatcher"].py_func.__module__).startswith("hdvplan.")
