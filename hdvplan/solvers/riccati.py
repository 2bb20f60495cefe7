"""A solver for this structure: Riccati recursion with screening, a warm active set, then an interior-point method around it.

A planning QP is a linear-quadratic control problem with few states. Without inequalities one backward and one forward
pass solve it; if that point breaks no inequality it *is* the optimum and nothing more is needed. Otherwise Mehrotra's
predictor-corrector method runs, with one Riccati factorisation an iteration: inequalities only add to a stage's Hessian
(Rao, Wright, Rawlings 1998; Frison, Diehl 2020), see ``interior``. All iterates keep the dynamics, so only inequalities
have residuals.

A guess from the last plan is tried before (``active_set``): where it holds, the interior point is not needed.

Screening goes further than the first pass. Only inequalities near the screened point enter the iteration; all others are
looked at after every step and join as soon as they come near. And the horizon behind the last of them is left out: the first
pass's cost-to-go stands for it exactly.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np

from hdvplan.jit import BoolArray, FloatArray, IntArray, compiled
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, Status
from hdvplan.solvers.active_set import settle, sides_of
from hdvplan.solvers.interior import FIELDS, join, mean_after, move, newton_step, objective, publish, weigh, worst
from hdvplan.solvers.recursion import adjoint, factorise, imbalance, sweep_ahead, sweep_back

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

    def __init__(self, shape: StageShape) -> None:
        """Allocate the factorisation and the iterates."""
        stages, n, m = shape.stages, shape.states, shape.inputs
        self._bounded = np.asarray(shape.bounded_states, np.int64)
        self._point = StageSolution.empty(shape)
        self._gain, self._root = np.empty((stages, m, n)), np.empty((stages, m, m))
        self._value, self._slope = np.empty((stages + 1, n, n)), np.empty((stages + 1, n))
        self._hessian_x, self._hessian_u = np.empty((stages + 1, n, n)), np.empty((stages + 1, m, m))
        self._step_x, self._step_u, self._slope_u = np.empty((stages + 1, n)), np.empty((stages, m)), np.empty((stages, m))
        self._feed = np.empty((stages, m))
        self._side = np.zeros((stages, shape.rows + 2 * len(shape.bounded_states) + 2 * m), np.int64)
        self._prices = np.zeros(self._side.shape)
        self._member = np.zeros((stages, shape.rows + 2 * len(shape.bounded_states) + 2 * m), np.bool_)
        self._chosen, self._pairs = np.empty((3, self._member.size), np.int64), np.empty((FIELDS, self._member.size))

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve ``qp``; see ``QpWorkspace``. Of ``guess`` only multipliers and elastic variables matter."""
        started = perf_counter()
        qp.check()
        checked = perf_counter()
        point, spent = self._point, 0
        point.x[0] = qp.x_first
        if guess is not None and sides_of(qp.linear, guess.rows, guess.sigma, guess.x_bounds, guess.u_bounds, self._side, self._prices):
            settled, spent = settle(
                qp.A, qp.B, qp.c, qp.Q, qp.q, qp.R, qp.r, qp.G, qp.h, qp.linear, qp.quadratic, self._bounded, qp.x_low, qp.x_high,
                qp.u_low, qp.u_high, point.x, point.u, point.sigma, point.dynamics, point.rows, point.x_bounds, point.u_bounds,
                self._gain, self._root, self._value, self._slope, self._feed, self._hessian_x, self._hessian_u, self._step_x,
                self._slope_u, self._side, self._prices,
            )  # fmt: skip
            if settled:
                return QpResult(Status.SOLVED, point, spent, checked - started, perf_counter() - checked)
        for array in (point.sigma, point.rows, point.x_bounds, point.u_bounds, self._member):
            array.fill(0)
        self._value[-1], self._slope[-1] = qp.Q[-1], qp.q[-1]
        code, iterations = _solve(
            qp.A, qp.B, qp.c, qp.Q, qp.q, qp.R, qp.r, qp.G, qp.h, qp.linear, qp.quadratic, self._bounded,
            qp.x_low, qp.x_high, qp.u_low, qp.u_high, point.x, point.u, point.sigma, point.dynamics, point.rows, point.x_bounds,
            point.u_bounds, self._gain, self._root, self._value, self._slope, self._hessian_x, self._hessian_u, self._step_x,
            self._step_u, self._slope_u, self._feed, self._member, self._chosen, self._pairs,
        )  # fmt: skip
        return QpResult(_STATUS[code], point, spent + iterations, checked - started, perf_counter() - checked)


@compiled
def _solve(
    A: FloatArray, B: FloatArray, c: FloatArray, Q: FloatArray, q: FloatArray, R: FloatArray, r: FloatArray,
    G: FloatArray, h: FloatArray, linear: FloatArray, quadratic: FloatArray, bounded: IntArray, x_low: FloatArray, x_high: FloatArray,
    u_low: FloatArray, u_high: FloatArray, x: FloatArray, u: FloatArray, sigma: FloatArray, dynamics: FloatArray, rows: FloatArray,
    x_bounds: FloatArray, u_bounds: FloatArray, gain: FloatArray, root: FloatArray, value: FloatArray, slope: FloatArray,
    hessian_x: FloatArray, hessian_u: FloatArray, step_x: FloatArray, step_u: FloatArray, slope_u: FloatArray, feed: FloatArray,
    member: BoolArray, chosen: IntArray, pairs: FloatArray,
) -> tuple[int, int]:  # fmt: skip
    """Solve a program; return the place of its status in ``_STATUS`` and the number of factorisations."""
    stages, n, m = B.shape
    if not factorise(A, B, stages, Q, R, gain, root, value):
        return 2, 0
    sweep_back(A, B, c, True, stages, gain, root, value, q, r, slope, feed)
    sweep_ahead(A, B, c, True, 0, stages, gain, feed, x, u)
    if worst(G, h, bounded, x_low, x_high, u_low, u_high, x, u) <= 0.0:
        adjoint(A, Q, q, G, bounded, x, rows, x_bounds, dynamics)
        return 0, 1

    tail_value, tail_slope = np.empty((n, n)), np.empty(n)
    gradient_x, gradient_u, slope_x = np.empty((stages + 1, n)), np.empty((stages, m)), np.empty((stages + 1, n))
    count, end, mean, code, iterations, refined = 0, 0, _START, 1, 1, 0
    while iterations <= _ITERATIONS:
        iterations += 1
        count, last = join(G, h, linear, quadratic, bounded, x_low, x_high, u_low, u_high, x, u, mean, member, chosen, pairs, count)
        if last + 1 > end:  # beyond ``end`` value and slope are still the first pass's
            end = last + 1
            for j in range(n):
                tail_slope[j] = slope[end, j]
                for k in range(n):
                    tail_value[j, k] = value[end, j, k]
        objective(Q, q, R, r, x, u, end, hessian_x, hessian_u, gradient_x, gradient_u)
        for j in range(n):
            total = tail_slope[j]
            for k in range(n):
                hessian_x[end, j, k] = tail_value[j, k]
                total += tail_value[j, k] * x[end, k]
            gradient_x[end, j] = total
        mean, error = weigh(G, bounded, x, u, chosen, pairs, count, hessian_x, hessian_u)
        if error < TOLERANCE and np.isfinite(mean):
            publish(chosen, pairs, count, sigma, rows, x_bounds, u_bounds)
            adjoint(A, Q, q, G, bounded, x, rows, x_bounds, dynamics)
            balanced = imbalance(B, R, r, u, u_bounds, dynamics) < _BALANCED
            refined += 1
            if balanced or refined > _EXTRA:
                return 0 if balanced else 3, iterations
        for j in range(n):
            for k in range(j + 1):
                value[end, j, k] = value[end, k, j] = hessian_x[end, j, k]
        if not (np.isfinite(mean) and factorise(A, B, end, hessian_x, hessian_u, gain, root, value)):
            code = 2
            break

        # The predictor aims at complementarity 0; the corrector at ``target``, with the predictor's second-order term.
        target, length = 0.0, 1.0
        for phase in range(2):
            length = newton_step(
                A, B, c, G, bounded, end, gain, root, value, gradient_x, gradient_u, slope, feed, step_x, step_u, slope_x, slope_u,
                chosen, pairs, count, target, phase == 1,
            )  # fmt: skip
            if phase == 0:
                ahead = mean_after(chosen, pairs, count, length)
                target = max(mean * (ahead / mean) ** 3, 0.01 * TOLERANCE)  # no pair may run far ahead of the others
        length = min(1.0, 0.995 * length)
        move(chosen, pairs, count, length)
        for i in range(end):  # states follow anew: the rounding of iterates far away must not stay
            for j in range(m):
                u[i, j] += length * step_u[i, j]
            for j in range(n):
                total = c[i, j]
                for k in range(n):
                    total += A[i, j, k] * x[i, k]
                for k in range(m):
                    total += B[i, j, k] * u[i, k]
                x[i + 1, j] = total
        sweep_ahead(A, B, c, True, end, stages, gain, feed, x, u)

    publish(chosen, pairs, count, sigma, rows, x_bounds, u_bounds)
    adjoint(A, Q, q, G, bounded, x, rows, x_bounds, dynamics)
    return code, iterations
