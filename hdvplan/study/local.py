"""The engine of one machine: a pool of processes that are started once, each of which plans one cell after the other."""

from __future__ import annotations

import multiprocessing as mp
import signal
import threading
from collections.abc import Iterable
from concurrent.futures import Future, TimeoutError  # noqa: A004 - of futures, an alias of the built-in one
from contextlib import closing, suppress
from dataclasses import dataclass

import pebble

from hdvplan.machine import usable_cores, use_one_thread
from hdvplan.serving import serve_parent
from hdvplan.study.cells import Cell
from hdvplan.study.engine import Ending, outcome_of, run_in
from hdvplan.study.outcome import FAILED, HUNG, KILLED, Outcome, ended

_AHEAD = 3  # cells for every worker: one that it plans, and what it finds when it is done


@dataclass(frozen=True)
class LocalEngine:
    """``workers`` processes with one thread each; None: as many as this process may use cores.

    A cell that takes longer than ``limit`` [s] costs its process, which is replaced, as is one that is killed.
    """

    workers: int | None = None
    limit: float = 1800.0
    retries: int = 1

    @property
    def processes(self) -> int:
        """The number of processes."""
        return usable_cores() if self.workers is None else self.workers

    def run(self, cells: Iterable[Cell]) -> Ending:
        """Yield every cell as it ends; see ``Engine``."""
        with closing(_LocalPool(self.processes, self.limit)) as pool:
            yield from run_in(pool, cells, self.retries)


class _LocalPool:
    """A pool of processes that is replaced where it breaks."""

    def __init__(self, workers: int, limit: float) -> None:
        """Start nothing yet: the first cell does."""
        self._workers, self._limit = workers, limit
        self.width = _AHEAD * workers
        self._pool = self._new()

    def submit(self, cell: Cell) -> Future[Outcome]:
        """Hand a cell to the process that is free first."""
        future: Future[Outcome] = self._pool.schedule(outcome_of, args=(cell,), timeout=self._limit)
        return future

    def outcome_of(self, error: BaseException) -> Outcome:
        """Return what an error of the pool says of a cell."""
        if isinstance(error, TimeoutError):
            return ended(HUNG, f"it took longer than {self._limit:g} s")
        if isinstance(error, pebble.ProcessExpired):
            return ended(KILLED, f"its process ended with {_exit_name(error.exitcode)}")
        return ended(FAILED, f"{type(error).__name__}: {error}")

    def renewed(self) -> bool:
        """Replace the pool where it has broken: processes were killed while they took a cell or gave one back."""
        if self._pool.active:
            return False
        threading.Thread(target=_end, args=(self._pool,), daemon=True).start()  # a broken pool may never end: nobody waits for it
        self._pool = self._new()
        return True

    def close(self) -> None:
        """End all processes."""
        _end(self._pool)

    def _new(self) -> pebble.ProcessPool:
        use_one_thread()  # the processes inherit it before they load anything
        spawned = mp.get_context("spawn")  # a forked process would share threads and locks with libraries that may be loaded here
        return pebble.ProcessPool(max_workers=self._workers, initializer=serve_parent, context=spawned)


def _end(pool: pebble.ProcessPool) -> None:
    """End the processes of a pool."""
    pool.stop()  # type: ignore[no-untyped-call] # it takes and returns nothing
    pool.join()


def _exit_name(code: int | None) -> str:
    """Return how a process ended: the signal's name, else the code."""
    if code is not None and code < 0:
        with suppress(ValueError):
            return signal.Signals(-code).name
    return f"code {code}"
