"""A separate process for what may hang or crash: when a solver fails, the tables have a row, and the benchmark continues.

One long-lived process measures one cell after the other, as loading libraries takes a second; where it dies or must be
ended, the next cell gets a new one. It gives a sign of life after every planning step, outside of what is timed.
"""

from __future__ import annotations

import multiprocessing as mp
import signal
from collections.abc import Mapping, Sequence
from multiprocessing.connection import Connection, wait
from time import monotonic
from typing import Any, Self

from hdvplan.bench.measure import Alive, Bench
from hdvplan.bench.samples import CRASHED, HUNG, OUT_OF_MEMORY, Measurement, ended
from hdvplan.bench.suite import Suite
from hdvplan.case import Case
from hdvplan.qp.workspace import WorkspaceMaker
from hdvplan.serving import serve_parent

FIRST = 4.0  # times as long as any other: a first step is iterated to convergence, and a solver may compile
_LOOK_S = 0.2  # how often the limits are looked at
_SINCE, _ALLOWED, _STEPS = range(3)  # of the shared memory: when the last sign of life came, how long the next may take, steps done


class Worker:
    """Measures cells in a separate process; call it with a case's index and whether the drive is judged.

    Cases and makers must pickle. Use it in a ``with`` block, which ends the process.
    """

    def __init__(self, suite: Suite, cases: Sequence[Case], makers: Mapping[str, WorkspaceMaker]) -> None:
        """Prepare; the process starts with the first cell."""
        self._suite, self._cases, self._makers = suite, cases, makers
        self._context = mp.get_context("spawn")  # a forked process would share threads and locks with libraries that may be loaded here
        self._life = self._context.RawArray("d", 3)
        self._process: Any = None  # of the context's class, which has no public name
        self._pipe: Connection | None = None

    def __enter__(self) -> Self:
        """Do nothing yet."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the process."""
        self._end()

    def __call__(self, index: int, *, judged: bool, solver: str | None = None) -> Measurement:
        """Return the measurement of a case by its own solver or another; one without steps where the process did not survive it."""
        try:
            pipe = self._pipe if self._pipe is not None and self._process.is_alive() else self._start()
            self._life[:] = [monotonic(), self._suite.cell_limit, 0.0]
            pipe.send((index, judged, solver))
        except ConnectionError:
            return self._crashed()
        began = monotonic()
        while True:
            if pipe in wait([pipe, self._process.sentinel], timeout=_LOOK_S):
                try:
                    return self._received(pipe)
                except (EOFError, ConnectionError):
                    return self._crashed()
            if not self._process.is_alive():
                return self._crashed()
            now, steps = monotonic(), int(self._life[_STEPS])
            if now - self._life[_SINCE] > self._life[_ALLOWED] and self._life[_ALLOWED] < self._suite.cell_limit:
                self._end()
                return ended(HUNG, f"step {steps} took longer than {self._suite.step_limit * (1.0 if steps else FIRST):g} s")
            if now - began > self._suite.cell_limit:
                self._end()
                return ended(HUNG, f"the cell took longer than {self._suite.cell_limit:g} s, and ended after {steps} steps")

    def _received(self, pipe: Connection) -> Measurement:
        answer = pipe.recv()
        if isinstance(answer, Measurement):
            return answer
        raise answer  # a bug of ours: it belongs to the caller

    def _start(self) -> Connection:
        self._end()
        pipe, theirs = self._context.Pipe()
        process = self._context.Process(
            target=_serve, args=(theirs, self._life, self._suite, self._cases, self._makers), daemon=True, name="hdvplan bench"
        )
        try:
            process.start()
        except BaseException:
            pipe.close()
            raise
        finally:
            theirs.close()  # so that its end is seen here
        self._process, self._pipe = process, pipe
        return pipe

    def _crashed(self) -> Measurement:
        """Return the row of a cell in which the process died, or before which it did."""
        if self._process is None:
            return ended(CRASHED, "the process ended while it was started")
        self._process.join()
        code, steps = int(self._process.exitcode or 0), int(self._life[_STEPS])
        self._end()
        name = signal.Signals(-code).name if code < 0 else f"code {code}"
        killed = code == -signal.SIGKILL.value if hasattr(signal, "SIGKILL") else False
        reason = f"the process ended with {name} in step {steps}"
        return ended(OUT_OF_MEMORY, f"{reason}, as systems end what takes too much memory") if killed else ended(CRASHED, reason)

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process.close()
            self._process = None
        if self._pipe is not None:
            self._pipe.close()
            self._pipe = None


def _serve(pipe: Connection, life: Any, suite: Suite, cases: Sequence[Case], makers: Mapping[str, WorkspaceMaker]) -> None:  # noqa: ANN401 - ctypes array
    """Measure what is asked for until the pipe is closed."""
    serve_parent()
    if suite.memory_limit is not None:
        _limit_memory(suite.memory_limit)
    bench = Bench(suite, cases, makers, _alive(life, suite))
    while True:
        try:
            index, judged, solver = pipe.recv()
        except EOFError:
            return
        try:
            answer: Measurement | Exception = bench(index, judged=judged, solver=solver)
        except Exception as error:  # noqa: BLE001 - raised again where it can be reported
            answer = error
        pipe.send(answer)


def _alive(life: Any, suite: Suite) -> Alive:  # noqa: ANN401 - ctypes array
    def alive(steps: int) -> None:
        life[_STEPS], life[_ALLOWED] = steps, suite.step_limit * (1.0 if steps else FIRST)
        life[_SINCE] = monotonic()

    return alive


def _limit_memory(gigabytes: float) -> None:
    """Refuse allocations beyond a limit, where the system can."""
    try:
        import resource  # noqa: PLC0415 - not on Windows
    except ImportError:
        return
    limit = int(gigabytes * 1e9)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
