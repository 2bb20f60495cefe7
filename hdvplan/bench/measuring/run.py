"""All drives of a benchmark, in an order that lets drift affect all cells equally, each in a process that may die."""

from __future__ import annotations

import gc
import multiprocessing as mp
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from multiprocessing.connection import Connection, wait
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from hdvplan.bench import turns
from hdvplan.bench.measuring.measure import Alive, Bench, maker_name
from hdvplan.bench.measuring.samples import CRASHED, HUNG, OUT_OF_MEMORY, OVER_BUDGET, Measurement, ended, part_file, write_part
from hdvplan.bench.suite import Suite, visits
from hdvplan.case import Case
from hdvplan.plugins import name_of
from hdvplan.process import serve_parent
from hdvplan.qp.workspace import WorkspaceMaker
from hdvplan.solvers.registry import SolverMaker

_FATAL = (CRASHED, HUNG, OUT_OF_MEMORY)


def run(
    suite: Suite,
    cases: Sequence[Case],
    makers: Mapping[str, WorkspaceMaker],
    directory: Path,
    on_progress: Callable[[float], None],
    *,
    in_process: bool = False,
) -> None:
    """Measure every cell and round whose part is not yet in ``directory``; ``on_progress`` receives the done share.

    ``cases`` as ``cases_of(suite)`` returns them, ``makers`` by the solvers' names. A cell that cannot be planned is
    measured as far as it goes and noted as such; it does not end the run. Nor does one that crashes or hangs, unless all is measured
    ``in_process``: its other rounds are then taken to end alike, as are those of a solver that its budget stopped in a sample.

    Raises:
        OSError: a part cannot be written.

    """
    courses = len(suite.courses())
    order = [
        (index, round_)
        for round_, index in visits(courses, len(cases) // courses, suite.rounds)
        if not part_file(directory, index, round_).exists()
    ]
    lengths = np.array([cases[index].road.path.length for index, _ in order])
    with turns() as take_turn, _measuring(suite, cases, makers, in_process=in_process) as measured_by:
        for number, (index, round_) in enumerate(order):
            if not part_file(directory, index, round_).exists():  # such a round fills in the others
                take_turn()
                measured = measured_by(index, judged=round_ == 0)
                only = measured.outcome in _FATAL or (suite.sample and measured.outcome == OVER_BUDGET)  # another round would end alike
                last = suite.rounds if only else round_ + 1
                for filled in range(round_, last):
                    write_part(part_file(directory, index, filled), measured)
            on_progress(float(np.sum(lengths[: number + 1]) / np.sum(lengths)))


@contextmanager
def _measuring(
    suite: Suite, cases: Sequence[Case], makers: Mapping[str, WorkspaceMaker], *, in_process: bool
) -> Iterator[Callable[..., Measurement]]:
    if in_process:
        try:
            yield Bench(suite, cases, makers, lambda _: None)
        finally:
            gc.unfreeze()
    else:
        with closing(Workers(suite, cases, makers)) as workers:
            yield workers


def remaining(suite: Suite, directory: Path) -> int:
    """Return how many drives are still to be measured."""
    return sum(not part_file(directory, cell, round_).exists() for cell in range(len(suite.cells())) for round_ in range(suite.rounds))


FIRST = 4.0  # times as long as any other: a first step is iterated to convergence, and a solver may compile
_LOOK_S = 0.2  # how often the limits are looked at
_SINCE, _ALLOWED, _STEPS = range(3)  # of the shared memory: when the last sign of life came, how long the next may take, steps done


class Workers:
    """Measures cells as ``Worker`` does, each solver from outside hdvplan in a process of its own: others never see what it changes."""

    def __init__(self, suite: Suite, cases: Sequence[Case], makers: Mapping[str, WorkspaceMaker]) -> None:
        """Prepare; each process starts with its first cell, and knows no solvers but its own."""
        self._suite, self._cases = suite, cases
        self._homes = {name: _home(name, maker) for name, maker in makers.items()}
        self._workers = {
            home: Worker(suite, cases, {name: maker for name, maker in makers.items() if self._homes[name] == home})
            for home in set(self._homes.values())
        }

    def close(self) -> None:
        """End the processes."""
        for worker in self._workers.values():
            worker.close()

    def __call__(self, index: int, *, judged: bool, solver: str | None = None) -> Measurement:
        """Return the measurement of a case by its own solver or another; see ``Worker``."""
        name = maker_name(self._homes, self._cases[index], self._suite.cells()[index].limits, solver)
        return self._workers[self._homes[name]](index, judged=judged, solver=solver)


def _home(name: str, maker: WorkspaceMaker) -> str:
    """Return what names the process of a maker: hdvplan's own share one, a foreign solver's of all tolerances another."""
    if not isinstance(maker, SolverMaker):
        return name
    return "" if maker.is_ours else name_of(maker.solver)


class Worker:
    """Measures cells in a separate process; call it with a case's index and whether the drive is judged.

    Cases and makers must pickle. ``close`` ends the process.
    """

    def __init__(self, suite: Suite, cases: Sequence[Case], makers: Mapping[str, WorkspaceMaker]) -> None:
        """Prepare; the process starts with the first cell."""
        self._suite, self._cases, self._makers = suite, cases, makers
        self._context = mp.get_context("spawn")  # a forked process would share threads and locks with libraries that may be loaded here
        self._life = self._context.RawArray("d", 3)
        self._process: Any = None  # of the context's class, which has no public name
        self._pipe: Connection | None = None

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
                self.close()
                return ended(HUNG, f"step {steps} took longer than {self._suite.step_limit * (1.0 if steps else FIRST):g} s")
            if now - began > self._suite.cell_limit:
                self.close()
                return ended(HUNG, f"the cell took longer than {self._suite.cell_limit:g} s, and ended after {steps} steps")

    def _received(self, pipe: Connection) -> Measurement:
        answer = pipe.recv()
        if isinstance(answer, Measurement):
            return answer
        raise answer  # a bug of ours: it belongs to the caller

    def _start(self) -> Connection:
        self.close()
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
        if self._process is None:
            return ended(CRASHED, "the process ended while it was started")
        self._process.join()
        code, steps = int(self._process.exitcode or 0), int(self._life[_STEPS])
        self.close()
        name = signal.Signals(-code).name if code < 0 else f"code {code}"
        killed = code == -signal.SIGKILL.value if hasattr(signal, "SIGKILL") else False
        reason = f"the process ended with {name} in step {steps}"
        return ended(OUT_OF_MEMORY, f"{reason}, as systems end what takes too much memory") if killed else ended(CRASHED, reason)

    def close(self) -> None:
        """End the process; the next cell starts another one."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process.close()
            self._process = None
        if self._pipe is not None:
            self._pipe.close()
            self._pipe = None


def _serve(pipe: Connection, life: Any, suite: Suite, cases: Sequence[Case], makers: Mapping[str, WorkspaceMaker]) -> None:  # noqa: ANN401 - ctypes array
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
    try:
        import resource  # noqa: PLC0415 - not on Windows
    except ImportError:
        return
    limit = int(gigabytes * 1e9)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
