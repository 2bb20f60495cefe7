"""The engines: processes on this machine, each of which plans one cell after the other, or a Dask cluster of many machines.

Scheduling, transport and replacing workers are Dask's on a cluster, and Pebble's here.
"""

from __future__ import annotations

import multiprocessing as mp
import os
import signal
import threading
from collections.abc import Iterable
from concurrent.futures import CancelledError, Future, TimeoutError  # noqa: A004 - of futures, an alias of the built-in one
from contextlib import closing, suppress
from dataclasses import dataclass
from typing import Any

import pebble

from hdvplan.errors import HdvplanError, OptionError
from hdvplan.machine import software, usable_cores, use_one_thread
from hdvplan.plugins import error_text
from hdvplan.process import fail_at_exit, serve_parent
from hdvplan.study.cells import Cell
from hdvplan.study.engine import FAILED, HUNG, KILLED, Ending, Outcome, ended, run_in

_AHEAD = 3  # cells for every worker: one that it plans, and what it finds when it is done
_TOO_LONG = 75  # exit code of a worker whose cell took too long (EX_TEMPFAIL of sysexits.h)


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
        self._workers, self._limit = workers, limit
        self.width = _AHEAD * workers
        self._pool = self._new()

    def submit(self, cell: Cell) -> Future[Outcome]:
        future: Future[Outcome] = self._pool.schedule(outcome_of, args=(cell,), timeout=self._limit)
        return future

    def outcome_of(self, error: BaseException) -> Outcome:
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
        _end(self._pool)

    def _new(self) -> pebble.ProcessPool:
        use_one_thread()  # the processes inherit it before they load anything
        spawned = mp.get_context("spawn")  # a forked process would share threads and locks with libraries that may be loaded here
        return pebble.ProcessPool(max_workers=self._workers, initializer=_serve, context=spawned)


def _serve() -> None:
    """Make this process a worker, and its end one that is seen: of a process that ends with 0 the pool believes that it works on."""
    serve_parent()
    fail_at_exit(1)


def _end(pool: pebble.ProcessPool) -> None:
    pool.stop()
    pool.join()


def _exit_name(code: int | None) -> str:
    """Return how a process ended: the signal's name, else the code."""
    if code is not None and code < 0:
        with suppress(ValueError):
            return signal.Signals(-code).name
    return f"code {code}"


@dataclass(frozen=True)
class DaskEngine:
    """The workers of a Dask cluster, one thread each; ``client`` is a ``distributed.Client``.

    A cell that takes longer than ``limit`` [s] ends its worker, because nothing else can end a solver that hangs; Dask's nanny starts a
    new one. How often Dask tries a cell whose worker ended is the scheduler's ``distributed.scheduler.allowed-failures``.
    """

    client: Any  # distributed has no types
    limit: float = 1800.0

    def run(self, cells: Iterable[Cell]) -> Ending:
        """Yield every cell as it ends; see ``Engine``."""
        yield from run_in(_DaskPool(self.client, self.limit), cells, retries=0)


def connected(cluster: object, limit: float = DaskEngine.limit) -> DaskEngine:
    """Return the engine of a cluster: its scheduler's address, a Dask cluster object, or a client.

    Raises:
        OptionError: Dask is not installed, nobody answers at the address, or its workers have several threads.

    """
    try:
        from distributed import Client  # noqa: PLC0415 - an optional extra
    except ImportError as error:
        msg = "a cluster needs Dask, which is not installed"
        raise OptionError(msg, hint="pip install 'hdvplan[dask]', here and where the workers run") from error
    try:
        client = cluster if isinstance(cluster, Client) else Client(cluster, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:  # OSError: nobody answers, in time or at all
        msg = f"no Dask scheduler at {cluster}: {error}"
        raise OptionError(msg, hint="`dask scheduler` prints its address, such as tcp://10.0.0.1:8786") from error
    threads = client.nthreads()
    if any(count > 1 for count in threads.values()):
        msg = f"the cluster's workers have up to {max(threads.values())} threads; a study needs one each"
        raise OptionError(msg, hint="start more of them instead: dask worker --nthreads 1 --nworkers N ADDRESS")
    return DaskEngine(client, limit)


class _DaskPool:
    """Futures of Dask as the standard library's."""

    def __init__(self, client: Any, limit: float) -> None:  # noqa: ANN401 - see ``DaskEngine``
        self._client, self._limit = client, limit
        self._executor = client.get_executor(pure=False)
        self._source = str(software(())["source"])

    @property
    def width(self) -> int:
        """How many cells are under way: the cluster may grow and shrink."""
        try:
            return max(1, _AHEAD * len(self._client.nthreads()))
        except Exception as error:  # Dask and Tornado raise many kinds
            msg = f"the Dask scheduler does not answer any more: {error_text(error)}"
            raise HdvplanError(msg, hint="start it, then the same command again: it continues with the cells that are missing") from error

    def submit(self, cell: Cell) -> Future[Outcome]:
        future: Future[Outcome] = self._executor.submit(_within, cell, self._limit, self._source)
        return future

    def outcome_of(self, error: BaseException) -> Outcome:
        if type(error).__name__ == "KilledWorker":
            return ended(KILLED, f"its workers ended: they were killed, or it took longer than {self._limit:g} s")
        if isinstance(error, CancelledError):
            return ended(KILLED, "Dask gave it up: its scheduler ended, or somebody cancelled it")
        return ended(FAILED, f"{type(error).__name__}: {error}")

    def renewed(self) -> bool:
        return False  # Dask replaces what breaks


def _within(cell: Cell, limit: float, source: str) -> Outcome:
    """Work on a cell in a Dask worker, which ends where that takes too long.

    ``source`` is the digest of the source of hdvplan that is in the cell's key.
    """
    if software(())["source"] != source:
        return ended(FAILED, "this worker has another version of hdvplan than the process that hands cells out")
    watch = threading.Timer(limit, os._exit, (_TOO_LONG,))
    watch.daemon = True
    watch.start()
    try:
        return outcome_of(cell)
    finally:
        watch.cancel()


def outcome_of(cell: Cell) -> Outcome:
    """Work on a cell in a process of an engine's; see ``hdvplan.study.work``."""
    from hdvplan.study.work import work  # noqa: PLC0415 - the process that hands cells out loads nothing that plans, and stays small

    return work(cell)
