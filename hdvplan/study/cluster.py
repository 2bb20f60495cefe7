"""The engine of many machines: a Dask cluster, by its own client. Scheduling, transport and replacing workers are Dask's."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterable
from concurrent.futures import CancelledError, Future
from dataclasses import dataclass
from typing import Any

from hdvplan.errors import HdvplanError, OptionError
from hdvplan.machine import software
from hdvplan.plugins import said
from hdvplan.study.cells import Cell
from hdvplan.study.engine import Ending, outcome_of, run_in
from hdvplan.study.outcome import FAILED, KILLED, Outcome, ended

_AHEAD = 3  # cells for every worker: one that it plans, and what it finds when it is done
_TOO_LONG = 75  # exit code of a worker whose cell took too long (EX_TEMPFAIL of sysexits.h)


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
        """How many cells are under way: the cluster may grow and shrink.

        Raises:
            HdvplanError: the scheduler does not answer.

        """
        try:
            return max(1, _AHEAD * len(self._client.nthreads()))
        except Exception as error:  # Dask and Tornado raise many kinds
            msg = f"the Dask scheduler does not answer any more: {said(error)}"
            raise HdvplanError(msg, hint="start it, then the same command again: it continues with the cells that are missing") from error

    def submit(self, cell: Cell) -> Future[Outcome]:
        """Hand a cell to the scheduler."""
        future: Future[Outcome] = self._executor.submit(_within, cell, self._limit, self._source)
        return future

    def outcome_of(self, error: BaseException) -> Outcome:
        """Return what an error of Dask's says of a cell."""
        if type(error).__name__ == "KilledWorker":
            return ended(KILLED, f"its workers ended: they were killed, or it took longer than {self._limit:g} s")
        if isinstance(error, CancelledError):
            return ended(KILLED, "Dask gave it up: its scheduler ended, or somebody cancelled it")
        return ended(FAILED, f"{type(error).__name__}: {error}")

    def renewed(self) -> bool:
        """Dask replaces what breaks by itself."""
        return False


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
