"""All drives of a benchmark, in an order that lets drift affect all cells equally, each in a process that may die."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from hdvplan.bench.measure import Bench
from hdvplan.bench.samples import CRASHED, HUNG, OUT_OF_MEMORY, OVER_BUDGET, Measurement, part_file, write_part
from hdvplan.bench.suite import Suite, visits
from hdvplan.bench.turns import turns
from hdvplan.bench.worker import Worker
from hdvplan.case import Case
from hdvplan.qp.workspace import WorkspaceMaker

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
    """Provide what measures a cell: a worker, or this process."""
    if in_process:
        try:
            yield Bench(suite, cases, makers, lambda _: None)
        finally:
            gc.unfreeze()
    else:
        with Worker(suite, cases, makers) as worker:
            yield worker


def remaining(suite: Suite, directory: Path) -> int:
    """Return how many drives are still to be measured."""
    return sum(not part_file(directory, cell, round_).exists() for cell in range(len(suite.cells())) for round_ in range(suite.rounds))
