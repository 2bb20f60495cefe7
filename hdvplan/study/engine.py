"""What runs cells: how cells end, the protocol of engines, and what those have in common that hand out futures.

It loads nothing that plans: the process that hands cells out stays small.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import dataclass
from time import monotonic
from typing import Protocol

from hdvplan.errors import HdvplanError
from hdvplan.study.cells import Cell, Row, Smoothed

_LOOK_S = 0.5  # how often a pool is asked whether it still works
_RENEWALS = 5  # of a pool that breaks again and again before any cell ends
_WAITING = 1000  # cells, at most, that wait for their roads
_PATIENCE_S = 30.0  # for which they wait: what takes longer is a long road, whose cells smooth it each for itself
_OPENED = 16  # roads that count as smoothed, the latest

PLANNED, NO_PLAN, REFUSED = "planned", "no plan", "refused"
FAILED, HUNG, KILLED = "failed", "hung", "killed"
UNANSWERED = (FAILED, HUNG, KILLED)  # what another try may mend


@dataclass(frozen=True)
class Outcome:
    """What came of a cell: the columns of its row that its coordinates do not fill, and its places."""

    row: Row
    places: tuple[Row, ...] = ()

    @property
    def ending(self) -> str:
        """How it ended: one of PLANNED, NO_PLAN, REFUSED, FAILED, HUNG and KILLED."""
        return str(self.row["outcome"])


def ended(ending: str, reason: str) -> Outcome:
    """Return the outcome of a cell that has nothing but a reason to tell."""
    return Outcome({"outcome": ending, "reason": reason})


@dataclass(frozen=True)
class Done:
    """A cell that ended, and at which attempt."""

    cell: Cell
    outcome: Outcome
    attempts: int


Ending = Generator[Done, None, None]


class Engine(Protocol):
    """Runs cells somewhere, on one machine or many."""

    def run(self, cells: Iterable[Cell]) -> Ending:
        """Yield every cell once, in any order; cells are taken as they are needed. Closing the generator ends what is under way."""
        ...


class Pool(Protocol):
    """Where futures of cells come from."""

    @property
    def width(self) -> int:
        """How many cells are under way at a time, those included that wait at a worker."""
        ...

    def submit(self, cell: Cell) -> Future[Outcome]:
        """Hand a cell over."""
        ...

    def outcome_of(self, error: BaseException) -> Outcome:
        """Return what an error of a future means for its cell: something happened to its process."""
        ...

    def renewed(self) -> bool:
        """Replace the pool if it broke, and tell whether it did: what was submitted before is then lost."""
        ...


def run_in(pool: Pool, cells: Iterable[Cell], retries: int) -> Ending:
    """Yield every cell once as it ends; one that is not answered is tried ``retries`` times more.

    Raises:
        HdvplanError: the pool breaks again and again.

    """
    queue, under_way = _Queue(cells), dict[Future[Outcome], tuple[Cell, int]]()
    renewals = 0
    while True:
        while len(under_way) < pool.width and (following := queue.take()) is not None:
            try:
                under_way[pool.submit(following[0])] = following
            except RuntimeError:  # the pool broke since it was last looked at
                queue.again(*following)
                break
        if not under_way and queue.empty:
            return
        ready, _ = wait(under_way, timeout=_LOOK_S, return_when=FIRST_COMPLETED)
        for future in ready:
            cell, attempt = under_way.pop(future)
            error = CancelledError() if future.cancelled() else future.exception()
            outcome = future.result() if error is None else pool.outcome_of(error)
            if outcome.ending in UNANSWERED and attempt <= retries:
                queue.again(cell, attempt + 1)
                continue
            queue.ended(cell)
            renewals = 0
            yield Done(cell, outcome, attempt)
        if not ready and pool.renewed():
            renewals += 1
            if renewals > _RENEWALS:
                msg = f"the processes that plan ended {renewals} times before any cell did"
                raise HdvplanError(msg, hint="plan one of the cells with `hdvplan plan` to see why")
            for cell, attempt in under_way.values():  # through no fault of theirs
                queue.again(cell, attempt)
            under_way.clear()


class _Queue:
    """Cells in the order in which they are handed out: the first of a road alone, which smooths it, then the others that wait for it."""

    def __init__(self, cells: Iterable[Cell]) -> None:
        self._ahead = iter(cells)
        self._ready = deque[tuple[Cell, int]]()
        self._waiting: defaultdict[Smoothed, list[Cell]] = defaultdict(list)
        self._opening: dict[Smoothed, tuple[str, float]] = {}  # roads that are smoothed now, for which cell's key, and since when
        self._opened = deque[Smoothed](maxlen=_OPENED)
        self._used_up = False

    @property
    def empty(self) -> bool:
        """Whether no cell will come any more, unless one that is under way comes again."""
        return self._used_up and not self._ready and not self._opening

    def take(self) -> tuple[Cell, int] | None:
        """Return the next cell and its attempt; None where there is none, or all wait for their roads."""
        for road in [road for road, (_, since) in self._opening.items() if monotonic() - since > _PATIENCE_S]:
            self._open(road)
        while not self._ready and sum(map(len, self._waiting.values())) < _WAITING:
            cell = next(self._ahead, None)
            if cell is None:
                self._used_up = True
                return None
            road = cell.smoothed
            if road in self._opening:
                self._waiting[road].append(cell)
                continue
            if road not in self._opened:
                self._opening[road] = cell.key, monotonic()
            self._ready.append((cell, 1))
        return self._ready.popleft() if self._ready else None

    def again(self, cell: Cell, attempt: int) -> None:
        self._ready.append((cell, attempt))

    def ended(self, cell: Cell) -> None:
        """Let the cells go on that waited for the road of this one."""
        road = cell.smoothed
        if road in self._opening and self._opening[road][0] == cell.key:
            self._open(road)

    def _open(self, road: Smoothed) -> None:
        del self._opening[road]
        self._opened.append(road)
        self._ready.extend((other, 1) for other in self._waiting.pop(road, []))
