"""A solver for this structure: Riccati recursion with screening, a warm active set, then an interior-point method around it.

A planning QP is a linear-quadratic control problem with few states. Without inequalities one backward and one forward
pass solve it; if that point breaks no inequality it *is* the optimum and nothing more is needed. Otherwise Mehrotra's
predictor-corrector method runs, with one Riccati factorisation an iteration: inequalities only add to a stage's Hessian
(Rao, Wright, Rawlings 1998; Frison, Diehl 2020), see ``interior``. All iterates keep the dynamics, so only inequalities
have residuals.

A guess from the last plan is tried before (``active_set``): where it holds, the interior point is not needed.

Screening goes further than the first pass. Only inequalities near the screened point enter the iteration; all others are
looked at after every step and join as soon as they come near. And the horizon behind the last of them is left out: the first
pass's cost-to-go replaces it exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple

import numpy as np

from hdvplan.jit import BoolArray, IntArray, Records, compiled, load
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, Status
from hdvplan.solvers.active_set import guess_statuses, inequalities, settle
from hdvplan.solvers.interior import clear, mean_after, move, newton_step, objective, publish, steps_of, weigh
from hdvplan.solvers.pairs import PAIR, join, worst
from hdvplan.solvers.recursion import adjoint, end_at, factorise, imbalance, recursion_of, sweep_ahead, sweep_back, weights_of

TOLERANCE = 1e-8  # of products or slacks, and of broken inequalities [m]
_ITERATIONS = 100
_START = 100.0  # complementarity of every pair at the start; the penalty of broken rows is 1e4, so less starts too near a wall
_BALANCED = 1e-7  # of the Lagrangian's gradient by the inputs, relative to the largest multiplier
_EXTRA = 3  # iterations that may go into balancing the inputs once all inequalities are settled
_STATUS = (Status.SOLVED, Status.ITERATION_LIMIT, Status.NUMERICAL, Status.INACCURATE)


class RiccatiWorkspace:
    """Our own structure-exploiting solver; the program is used where it stands, nothing is copied or converted."""

    name = "riccati"
    starts_warm = True
    settings = "screening, warm active set, interior point"
    screens = True  # leaves inequalities out that are far away, and all of them where none is broken

    def __init__(self, shape: StageShape, *, tolerance: float = TOLERANCE) -> None:
        """Allocate the factorisation and the iterates."""
        self._tolerance = tolerance
        self._point = StageSolution.empty(shape)
        self._work, self._weights, self._steps = recursion_of(shape), weights_of(shape), steps_of(shape)
        self._inequality = inequalities(shape)
        self._member = np.zeros(self._inequality.shape, np.bool_)
        self._pairs = np.zeros(self._member.size + 1, PAIR)  # one more to try the next inequality in
        self._loaded: set[str] = set()

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve ``qp``; see ``QpWorkspace``. Of ``guess`` only multipliers and elastic variables matter."""
        started = perf_counter()
        qp.check()
        checked = perf_counter()
        stages, rows, bounded, loading = qp.stages, qp.rows, qp.bounded, 0.0
        point, row_point, spent = self._point.stages, self._point.row_points, 0
        point[0]["x"] = qp.x_first
        if guess is not None and self.screens and guess_statuses(stages, rows, guess.stages, guess.row_points, self._inequality):
            program = (stages, rows, bounded, point, row_point, self._weights, self._work, self._inequality)
            loading += self._load(settle, *program)
            settled, spent = settle(*program)
            if settled:
                return QpResult(Status.SOLVED, self._point, spent, checked - started, perf_counter() - checked - loading, loading)
        code, more = _screen(stages, rows, bounded, point, row_point, self._work)
        binding = code == _BINDING or not self.screens
        if binding and code in {0, _BINDING}:
            memory = (self._weights, self._work, self._steps, _Taking(self._member, self._pairs, not self.screens))
            screened = (stages, rows, bounded, point, row_point, *memory, self._tolerance)
            loading += self._load(_solve, *screened)
            code, more = _solve(*screened)
        spent, solving = spent + more, perf_counter() - checked - loading
        return QpResult(_STATUS[code], self._point, spent, checked - started, solving, loading, binding)

    def _load(self, kernel: Callable[..., object], *arguments: object) -> float:
        """Load a kernel that only some roads need, when it is first needed; return the time that took [s]."""
        if kernel.__name__ in self._loaded:
            return 0.0
        self._loaded.add(kernel.__name__)
        return load(kernel, *arguments)


class InteriorWorkspace(RiccatiWorkspace):
    """The interior point alone: every inequality takes part from the start, and no guess is used.

    What other interior-point solvers do, and so what ours is compared with where the method is meant and not the screening.
    """

    name = "riccati-ipm"
    starts_warm = False
    settings = "interior point over all inequalities: no screening, no active set"
    screens = False


_BINDING = -1


@compiled
def _screen(stages: Records, rows: Records, bounded: IntArray, points: Records, row_points: Records, work: Records) -> tuple[int, int]:
    """Solve a program without its inequalities; return ``_BINDING`` where that breaks one, else as ``_solve``."""
    last = stages.size - 1
    end_at(stages, work, last)
    if not factorise(stages, stages, work, last):
        return 2, 0
    sweep_back(stages, stages, work, last, True)
    sweep_ahead(stages, work, points, 0, last, True)
    if worst(stages, rows, bounded, points) > 0.0:
        return _BINDING, 1
    clear(points, row_points)
    adjoint(stages, rows, bounded, points, row_points)
    return 0, 1


class _Taking(NamedTuple):
    """The inequalities that take part: which of them (stages, inequalities), their pairs, and whether all do, however far away."""

    member: BoolArray
    pairs: Records
    everything: bool


@compiled
def _solve(
    stages: Records, rows: Records, bounded: IntArray, points: Records, row_points: Records, weights: Records, work: Records,
    steps: Records, taking: _Taking, tolerance: float,
) -> tuple[int, int]:  # fmt: skip
    """Solve a screened program; return the place of its status in ``_STATUS`` and the number of factorisations."""
    member, pairs, everything = taking
    last, n, m = stages.size - 1, stages[0].c.size, stages[0].r.size
    for i in range(last + 1):
        for at in range(member.shape[1]):
            member[i, at] = False
    tail_P, tail_p = np.empty((n, n)), np.empty(n)
    count, end, mean, code, iterations, refined = 0, 0, _START, 1, 1, 0
    while iterations <= _ITERATIONS:
        iterations += 1
        count, joined = join(stages, rows, bounded, points, mean, member, pairs, count, everything)
        chosen = pairs[:count]
        if joined > end:  # beyond ``end`` P and p are still the first pass's
            end = joined
            for j in range(n):
                tail_p[j] = work[end].p[j]
                for k in range(n):
                    tail_P[j, k] = work[end].P[j, k]
        objective(stages, points, weights, steps, end)
        own, last_step = weights[end], steps[end]
        for j in range(n):
            total = tail_p[j]
            for k in range(n):
                own.Q[j, k] = tail_P[j, k]
                total += tail_P[j, k] * points[end].x[k]
            last_step.gradient_x[j] = total
        mean, error = weigh(rows, bounded, points, chosen, weights)
        if error < tolerance and np.isfinite(mean):
            publish(chosen, points, row_points)
            adjoint(stages, rows, bounded, points, row_points)
            balanced = imbalance(stages, points) < _BALANCED
            refined += 1
            if balanced or refined > _EXTRA:
                return 0 if balanced else 3, iterations
        for j in range(n):
            for k in range(j + 1):
                work[end].P[j, k] = work[end].P[k, j] = own.Q[j, k]
        if not (np.isfinite(mean) and factorise(stages, weights, work, end)):
            code = 2
            break

        # The predictor aims at complementarity 0; the corrector at ``target``, with the predictor's second-order term.
        target, length = 0.0, 1.0
        for phase in range(2):
            length = newton_step(stages, rows, bounded, chosen, weights, work, steps, end, target, phase == 1)
            if phase == 0:
                ahead = mean_after(chosen, length)
                target = max(mean * (ahead / mean) ** 3, 0.01 * tolerance)  # no pair may run far ahead of the others
        length = min(1.0, 0.995 * length)
        move(chosen, length)
        for i in range(end):  # states are computed again: the rounding of iterates far away must not stay
            stage, point = stages[i], points[i]
            for j in range(m):
                point.u[j] += length * steps[i].u[j]
            for j in range(n):
                total = stage.c[j]
                for k in range(n):
                    total += stage.A[j, k] * point.x[k]
                for k in range(m):
                    total += stage.B[j, k] * point.u[k]
                points[i + 1].x[j] = total
        sweep_ahead(stages, work, points, end, last, True)

    publish(pairs[:count], points, row_points)
    adjoint(stages, rows, bounded, points, row_points)
    return code, iterations
