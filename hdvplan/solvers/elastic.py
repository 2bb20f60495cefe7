"""Elastic rows for solvers without a special place for them: hard rows first, elastic columns only where needed.

A column for every elastic row doubles a program, and its large price slows general solvers tenfold (OSQP: a hundredfold).
The program with hard rows has the same solution wherever its rows can be kept at multipliers no larger than their price, by the
optimality conditions of both; only where that is not so is the elastic one solved.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.residuals import residuals
from hdvplan.qp.workspace import QpResult, QpWorkspace, Status, WorkspaceMaker

_KEPT = 1e-3  # primal residual up to which a solution of the hard program is believed [m]


def hard_first(make: Callable[[StageShape, bool], QpWorkspace]) -> WorkspaceMaker:
    """Return the maker of workspaces that try hard rows first; ``make`` takes a shape and whether rows are elastic."""
    return lambda shape: _HardFirst(shape, make)


class _HardFirst:
    """Two workspaces of one solver; the elastic one is made when it is first needed."""

    def __init__(self, shape: StageShape, make: Callable[[StageShape, bool], QpWorkspace]) -> None:
        self._shape, self._make = shape, make
        self._hard = make(shape, False)
        self._elastic: QpWorkspace | None = None
        self.name, self.starts_warm = self._hard.name, self._hard.starts_warm

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve ``qp``; see ``QpWorkspace``. Times and iterations of both attempts count."""
        if self._shape.rows and not np.all(qp.linear > 0.0):  # a row that costs nothing at first is meant to be broken
            return self._with_columns().solve(qp, guess)
        first = self._hard.solve(qp, guess)
        believed = first.status in {Status.SOLVED, Status.INACCURATE} and residuals(qp, first.point).primal <= _KEPT
        if not self._shape.rows or (believed and np.all(first.point.rows <= qp.linear)):
            return first
        second = self._with_columns().solve(qp, None)
        return second._replace(
            iterations=first.iterations + second.iterations,
            update_time=first.update_time + second.update_time,
            solve_time=first.solve_time + second.solve_time,
            time_aside=first.time_aside + second.time_aside,
        )

    def _with_columns(self) -> QpWorkspace:
        if self._elastic is None:
            self._elastic = self._make(self._shape, True)
        return self._elastic
