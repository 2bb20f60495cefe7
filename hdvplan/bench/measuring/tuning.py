"""Compare solvers at the same accuracy: for every solver, the loosest tolerance that meets a distance from the optimum, in metres.

Equal tolerances are not equal accuracies: each solver measures in its own way. So each is tried on recorded programs of every class of
limits, from the loosest tolerance on, and tightened by a factor of ten wherever e_y lies too far from the reference's optimum. Recorded
programs come with the reference's guesses; where drives are measured, whose guesses are the solver's own, each is tried on drives too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace

import numpy as np

from hdvplan.bench.measuring.run import Workers
from hdvplan.bench.measuring.samples import CRASHED, DISTANCES, HUNG, OK, OUT_OF_MEMORY, OVER_BUDGET, UNRECORDED, Measurement
from hdvplan.bench.suite import AS_SET, Suite, tuning_key
from hdvplan.case import Case
from hdvplan.errors import SolverError
from hdvplan.qp.workspace import WorkspaceMaker
from hdvplan.solvers.registry import SolverMaker, solver_named

LADDER = tuple(10.0**-decade for decade in range(1, 12))
_PROGRAMS = 4  # of every course, unless the benchmark has its own sample
_BUDGET_S = 0.3  # for these programs by one solver: slow ones are tried on the first of them
_DRIVE_S = 1.0  # for a drive: of one of a slow solver the beginning is tried
_COURSES = 5  # of every class of limits, spread evenly


def tuned(suite: Suite, cases: Sequence[Case], on_progress: Callable[[float], None]) -> dict[str, float | None]:
    """Return, by ``tuning_key``, each solver's loosest tolerance of ``LADDER`` that meets ``suite.accuracy`` in a class of limits.

    A sample of the class's courses decides, of which those that the reference cannot drive do not count. None: the solver has no
    tolerance, or none of the ladder's serves, and it runs with its own. A class of which no course counts has no entries: see
    ``hdvplan.bench.measuring.timing.untuned``. ``cases`` are the suite's, ``on_progress`` receives the done share.
    """
    wanted = suite.accuracy or np.inf
    makers: dict[str, WorkspaceMaker] = {maker.name: maker for name in suite.solvers for maker in _makers(name)}
    short = replace(suite, sample=suite.sample or _PROGRAMS, budget=min(_BUDGET_S, suite.budget), rounds=1, accuracy=None)
    drives = replace(short, sample=0, budget=min(_DRIVE_S, suite.budget))
    every, classes = len(suite.schemes) * len(suite.solvers), suite.classes or (AS_SET,)
    found: dict[str, float | None] = {}
    with closing(Workers(short, cases, makers)) as sampling, closing(Workers(drives, cases, makers)) as driving:

        def serves(course: int, solver: str) -> tuple[bool, bool]:
            """Tell whether a solver meets the accuracy on a course, and whether the reference can drive that."""
            measured = sampling(course * every, judged=True, solver=solver)
            if suite.sample or measured.outcome == UNRECORDED or not meets(measured, wanted):
                return meets(measured, wanted), measured.outcome != UNRECORDED
            cells = range(course * every, (course + 1) * every, len(suite.solvers))  # one of each scheme
            return all(meets(driving(cell, judged=True, solver=solver), wanted) for cell in cells), True

        for done, limits in enumerate(classes):
            courses = np.array([number for number, course in enumerate(suite.courses()) if course[2] == limits])
            chosen = courses[np.unique(np.linspace(0, len(courses) - 1, _COURSES).round().astype(int))].tolist()
            ladders = {name: _makers(name) for name in suite.solvers}
            recorded = False
            for number, course in enumerate(chosen):
                for ladder in ladders.values():
                    while ladder:
                        met, known = serves(course, ladder[0].name)
                        recorded = recorded or known
                        if met:
                            break
                        del ladder[0]
                on_progress((done + (number + 1) / len(chosen)) / len(classes))
            if not recorded:
                continue
            found |= {tuning_key(name, limits): ladder[0].tolerance if ladder else None for name, ladder in ladders.items()}
    return found


def _makers(name: str) -> list[SolverMaker]:
    """Return a solver at all tolerances, the loosest first; nothing where it has none."""
    try:
        return [solver_named(name, tolerance) for tolerance in LADDER]
    except SolverError:
        return []


def meets(measured: Measurement, wanted: float) -> bool:
    """Tell whether all programs that were solved came within ``wanted`` [m] of their optima; those without a proved one do not count.

    Nor does a cell in which the solver hung or crashed, or for which the reference recorded nothing: no tolerance mends that, and its
    row in the tables says so.
    """
    if measured.outcome in {HUNG, CRASHED, OUT_OF_MEMORY, UNRECORDED}:
        return True
    rows = measured.distances[~np.isnan(measured.distances[:, DISTANCES.index("scale")])] if len(measured.distances) else measured.distances
    close = rows[:, DISTANCES.index("distance_m")] <= wanted  # False for NaN
    return measured.outcome in {OK, OVER_BUDGET} and bool(close.all())
