"""The quadratic programs of a drive as they came to the solver, with its guesses and its solutions."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from hdvplan.case import Case
from hdvplan.driving.drive import drive
from hdvplan.errors import HdvplanError
from hdvplan.planning.objectives import objective_named
from hdvplan.planning.planner import Plan
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, QpWorkspace, WorkspaceMaker
from hdvplan.solvers.registry import solver_named

LIMITS = ("off", "inactive", "binding", "unkeepable")  # the roles of limits in a program
ACTIVE = 1e-6  # a multiplier beyond this belongs to an active inequality
_BROKEN_M = 1e-6  # an elastic variable beyond this means that its row cannot be kept


@dataclass(frozen=True)
class Recorded:
    """One program of a drive: what the solver was given and what it returned, copied."""

    qp: StageQp
    guess: StageSolution | None  # what the planner knew of the solution: the last one, shifted; None at a start, and where nothing bound
    point: StageSolution
    first: int  # the station at which its plan begins
    number: int  # of the program within its plan, from 0
    limited: bool = True  # whether the road has limits; without any, no row can bind

    @property
    def limits(self) -> str:
        """Which role limits play, one of ``LIMITS``."""
        if not self.limited:
            return "off"
        if np.any(self.point.sigma > _BROKEN_M):
            return "unkeepable"
        return "binding" if np.any(self.point.rows > ACTIVE) else "inactive"


def record(case: Case, most: int | None = None) -> list[Recorded]:
    """Return the programs of a case's drive in their order, at most the first ``most``; one that ends early has those until there.

    Raises:
        OptionError: no such objective.
        SolverError: no such solver, or not installed.

    """
    recorder = _Recorder(solver_named(case.solver), most, limited=case.road.street is not None)

    def note(plan: Plan) -> None:
        recorder.first = plan.first + case.settings.executed
        recorder.number = 0

    objective = objective_named(case.objective)
    with suppress(_EnoughError, HdvplanError):
        drive(case.road, case.vehicle, objective, recorder.make, case.settings, bias=case.bias, on_plan=note)
    return recorder.found


class _EnoughError(Exception):
    """All programs that are wanted are recorded."""


class _Recorder:
    """A workspace that copies what passes through it."""

    def __init__(self, make: WorkspaceMaker, most: int | None, *, limited: bool) -> None:
        self.found: list[Recorded] = []
        self.first, self.number = 0, 0
        self._make, self._most, self._limited = make, most, limited
        self._own: QpWorkspace

    def make(self, shape: StageShape) -> QpWorkspace:
        """Return itself, around a workspace for ``shape``; a drive that first comes along a way records that way too."""
        self._own = self._make(shape)
        self.name, self.starts_warm = self._own.name, self._own.starts_warm
        return self

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve ``qp``; see ``QpWorkspace``."""
        if self._most is not None and len(self.found) >= self._most:
            raise _EnoughError
        cold = guess is None or not any(np.any(part) for part in guess.numbers)  # the planner's memory before its first plan
        asked, known = StageQp(qp.shape, qp.buffer.copy()), None if guess is None or cold else copied(guess)
        result = self._own.solve(qp, guess)
        self.found.append(Recorded(asked, known, copied(result.point), self.first, self.number, self._limited))
        self.number += 1
        return result


def copied(point: StageSolution) -> StageSolution:
    """Return a point that nobody overwrites."""
    return StageSolution(point.stages.copy(), point.row_points.copy())
