"""A solver for this structure: Riccati recursion with screening, then a primal-dual interior-point method around it.

A planning QP is a linear-quadratic control problem with few states. Without inequalities one backward and one forward
pass solve it; if that point breaks no inequality it *is* the optimum and nothing more is needed. Otherwise Mehrotra's
predictor-corrector method runs, with one Riccati factorisation an iteration: inequalities only add W G'G to a stage's
Hessian (Rao, Wright, Rawlings 1998; Frison, Diehl 2020). The elastic variable of a row is eliminated by hand,

    W = w v / (w + v),   w = mu / s,   v = nu / sigma + quadratic,

which stays exact however large the weights grow. All iterates keep the dynamics, so only inequalities have residuals.

Screening goes further than the first pass. Only inequalities near the screened point enter the iteration; all others are
looked at after every step and join as soon as they come near. And the horizon behind the last of them is left out: the first
pass's cost-to-go stands for it exactly.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np

from hdvplan.jit import BoolArray, FloatArray, IntArray, compiled
from hdvplan.planning.qp import StageQp, StageShape, StageSolution
from hdvplan.solvers.recursion import adjoint, factorise, sweep_ahead, sweep_back
from hdvplan.solvers.workspace import QpResult, Status

_TOLERANCE = 1e-8  # largest complementarity product, and largest broken inequality [m]
_ITERATIONS = 60
_NEAR_ROWS = 0.1  # rows closer than this join the working set [m]
_NEAR_BOUNDS = 0.1  # bounds closer than this share of their range do
_START = 100.0  # complementarity of every pair at the start; the penalty of broken rows is 1e4, so less starts too near a wall
_START_SLACK = 0.1  # least slack at the start, for rows [m] and as a share of a bound's range
_STATUS = (Status.SOLVED, Status.ITERATION_LIMIT, Status.NUMERICAL)


class RiccatiWorkspace:
    """Our own structure-exploiting solver; the program is used where it stands, nothing is copied or converted."""

    name = "riccati"
    starts_warm = False

    def __init__(self, shape: StageShape) -> None:
        """Allocate the factorisation and the iterates."""
        stages, n, m = shape.stages, shape.states, shape.inputs
        self._bounded = np.asarray(shape.bounded_states, np.int64)
        self._point = StageSolution.empty(shape)
        self._gain, self._root = np.empty((stages, m, n)), np.empty((stages, m, m))
        self._value, self._slope = np.empty((stages + 1, n, n)), np.empty((stages + 1, n))
        self._hessian_x, self._hessian_u = np.empty((stages + 1, n, n)), np.empty((stages, m, m))
        self._step_x, self._step_u, self._slope_u = np.empty((stages + 1, n)), np.empty((stages, m)), np.empty((stages, m))
        self._feed = np.empty((stages, m))
        self._member = np.zeros((stages, shape.rows + 2 * len(shape.bounded_states) + 2 * m), np.bool_)
        self._chosen, self._pairs = np.empty((3, self._member.size), np.int64), np.empty((_D_NU + 1, self._member.size))

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:  # noqa: ARG002 - an interior point starts from the middle
        """Solve ``qp``; see ``QpWorkspace``."""
        started = perf_counter()
        qp.check()
        checked = perf_counter()
        point = self._point
        code, iterations = _solve(
            qp.A, qp.B, qp.c, qp.x_first, qp.Q, qp.q, qp.R, qp.r, qp.G, qp.h, qp.linear, qp.quadratic, self._bounded,
            qp.x_low, qp.x_high, qp.u_low, qp.u_high, point.x, point.u, point.sigma, point.dynamics, point.rows, point.x_bounds,
            point.u_bounds, self._gain, self._root, self._value, self._slope, self._hessian_x, self._hessian_u, self._step_x,
            self._step_u, self._slope_u, self._feed, self._member, self._chosen, self._pairs,
        )  # fmt: skip
        return QpResult(_STATUS[code], point, iterations, checked - started, perf_counter() - checked)


# What an inequality is: value <= limit, with value a row's G x or a bound's +-x or +-u.
_ROW, _X_HIGH, _X_LOW, _U_HIGH, _U_LOW = range(5)
# What is kept of every chosen inequality: slack, multiplier, elastic variable and its multiplier; then the Newton step's parts.
_S, _MU, _SIGMA, _NU, _LIMIT, _LINEAR, _QUADRATIC, _RESIDUAL, _W, _V, _FIRST, _SECOND, _D_S, _D_MU, _D_SIGMA, _D_NU = range(16)


@compiled
def _value_of(kind: int, i: int, index: int, G: FloatArray, bounded: IntArray, x: FloatArray, u: FloatArray) -> float:
    """Return the left-hand side of an inequality of interval i: rows and states belong to stage i + 1."""
    value = 0.0
    if kind == _ROW:
        for j in range(x.shape[1]):
            value += G[i, index, j] * x[i + 1, j]
    elif kind <= _X_LOW:
        value = x[i + 1, bounded[index]] if kind == _X_HIGH else -x[i + 1, bounded[index]]
    else:
        value = u[i, index] if kind == _U_HIGH else -u[i, index]
    return value


@compiled
def _worst(
    G: FloatArray, h: FloatArray, bounded: IntArray, x_low: FloatArray, x_high: FloatArray, u_low: FloatArray, u_high: FloatArray,
    x: FloatArray, u: FloatArray,
) -> float:  # fmt: skip
    """Return how far the point breaks its tightest inequality; negative or zero when it keeps all."""
    worst = -np.inf
    for i in range(u.shape[0]):
        for row in range(G.shape[1]):
            worst = max(worst, _value_of(_ROW, i, row, G, bounded, x, u) - h[i, row])
        for b in range(bounded.size):
            v = x[i + 1, bounded[b]]
            worst = max(worst, v - x_high[i, b], x_low[i, b] - v)
        for j in range(u.shape[1]):
            worst = max(worst, u[i, j] - u_high[i, j], u_low[i, j] - u[i, j])
    return worst


@compiled
def _join(
    G: FloatArray, h: FloatArray, linear: FloatArray, quadratic: FloatArray, bounded: IntArray, x_low: FloatArray, x_high: FloatArray,
    u_low: FloatArray, u_high: FloatArray, x: FloatArray, u: FloatArray, product: float, member: BoolArray, chosen: IntArray,
    pairs: FloatArray, count: int,
) -> tuple[int, int]:  # fmt: skip
    """Add the inequalities that have come near the point to the ``count`` chosen ones, each with complementarity ``product``.

    Returns the new count and the last interval with an inequality that joined, or -1.
    """
    last, p, nb = -1, G.shape[1], bounded.size
    for i in range(u.shape[0]):
        before = count
        for row in range(p):
            gap = h[i, row] - _value_of(_ROW, i, row, G, bounded, x, u)
            if gap <= _NEAR_ROWS and not member[i, row]:
                member[i, row] = True
                s = max(gap, _START_SLACK)
                mu, penalty = product / s, linear[i, row]
                if penalty > 0.0:
                    mu = min(mu, 0.5 * penalty)
                nu = max(penalty - mu, 1e-3 * _START)
                pairs[_LINEAR, count], pairs[_QUADRATIC, count] = penalty, quadratic[i, row]
                pairs[_NU, count], pairs[_SIGMA, count] = nu, product / nu
                pairs[_S, count], pairs[_MU, count], pairs[_LIMIT, count] = s, mu, h[i, row]
                chosen[0, count], chosen[1, count], chosen[2, count] = _ROW, i, row
                count += 1
        for bound in range(nb + u.shape[1]):
            if bound < nb:
                v, low, high = x[i + 1, bounded[bound]], x_low[i, bound], x_high[i, bound]
            else:
                v, low, high = u[i, bound - nb], u_low[i, bound - nb], u_high[i, bound - nb]
            width = min(high - low, 1.0)
            for side in range(2):
                gap = high - v if side == 0 else v - low
                if gap <= _NEAR_BOUNDS * width and not member[i, p + 2 * bound + side]:
                    member[i, p + 2 * bound + side] = True
                    s = max(gap, _START_SLACK * width, 1e-6)
                    pairs[_S, count], pairs[_MU, count], pairs[_LIMIT, count] = s, product / s, high if side == 0 else -low
                    chosen[0, count] = side + (_X_HIGH if bound < nb else _U_HIGH)
                    chosen[1, count], chosen[2, count] = i, bound if bound < nb else bound - nb
                    count += 1
        if count > before:
            last = i
    return count, last


@compiled
def _solve(
    A: FloatArray, B: FloatArray, c: FloatArray, x_first: FloatArray, Q: FloatArray, q: FloatArray, R: FloatArray, r: FloatArray,
    G: FloatArray, h: FloatArray, linear: FloatArray, quadratic: FloatArray, bounded: IntArray, x_low: FloatArray, x_high: FloatArray,
    u_low: FloatArray, u_high: FloatArray, x: FloatArray, u: FloatArray, sigma: FloatArray, dynamics: FloatArray, rows: FloatArray,
    x_bounds: FloatArray, u_bounds: FloatArray, gain: FloatArray, root: FloatArray, value: FloatArray, slope: FloatArray,
    hessian_x: FloatArray, hessian_u: FloatArray, step_x: FloatArray, step_u: FloatArray, slope_u: FloatArray, feed: FloatArray,
    member: BoolArray, chosen: IntArray, pairs: FloatArray,
) -> tuple[int, int]:  # fmt: skip
    """Solve a program; return the place of its status in ``_STATUS`` and the number of factorisations."""
    stages, n, m = B.shape
    sigma[:], rows[:], x_bounds[:], u_bounds[:] = 0.0, 0.0, 0.0, 0.0
    value[stages], slope[stages], x[0] = Q[stages], q[stages], x_first
    if not factorise(A, B, stages, Q, R, gain, root, value):
        return 2, 0
    sweep_back(A, B, c, True, stages, gain, root, value, q, r, slope, feed)
    sweep_ahead(A, B, c, True, 0, stages, gain, feed, x, u)
    if _worst(G, h, bounded, x_low, x_high, u_low, u_high, x, u) <= 0.0:
        adjoint(A, Q, q, G, bounded, x, rows, x_bounds, dynamics)
        return 0, 1

    member[:] = False
    tail_value, tail_slope, slope_x = np.empty((n, n)), np.empty(n), np.empty((stages + 1, n))
    count, end, average, code, iterations = 0, 0, _START, 1, 1
    while iterations <= _ITERATIONS:
        iterations += 1
        joined, last = _join(G, h, linear, quadratic, bounded, x_low, x_high, u_low, u_high, x, u, average, member, chosen, pairs, count)
        if last + 1 > end:  # beyond ``end`` value and slope are still the first pass's
            end = last + 1
            tail_value[:], tail_slope[:] = value[end], slope[end]

        # Measure, and weigh the Newton matrix.
        products = 0
        total, largest, broken = 0.0, 0.0, 0.0
        hessian_x[: end + 1] = Q[: end + 1]
        hessian_x[end] = tail_value
        hessian_u[:end] = R[:end]
        count = joined
        for item in range(count):
            kind, i, index = chosen[0, item], chosen[1, item], chosen[2, item]
            s, mu = pairs[_S, item], pairs[_MU, item]
            residual = _value_of(kind, i, index, G, bounded, x, u) + s - pairs[_LIMIT, item]
            total += mu * s
            products += 1
            largest = max(largest, mu * s)
            weight = mu / s
            pairs[_W, item] = weight
            if kind == _ROW:
                elastic, nu = pairs[_SIGMA, item], pairs[_NU, item]
                residual -= elastic
                total += nu * elastic
                products += 1
                largest = max(largest, nu * elastic)
                v = nu / elastic + pairs[_QUADRATIC, item]
                pairs[_V, item] = v
                weight = weight * v / (weight + v)
                for j in range(n):
                    for k in range(n):
                        hessian_x[i + 1, j, k] += weight * G[i, index, j] * G[i, index, k]
            elif kind <= _X_LOW:
                hessian_x[i + 1, bounded[index], bounded[index]] += weight
            else:
                hessian_u[i, index, index] += weight
            pairs[_RESIDUAL, item] = residual
            broken = max(broken, abs(residual))
        if largest < _TOLERANCE and broken < _TOLERANCE:
            code = 0
            break
        value[end] = hessian_x[end]
        if not (np.isfinite(total) and factorise(A, B, end, hessian_x, hessian_u, gain, root, value)):
            code = 2
            break
        average = total / products

        # The predictor aims at complementarity 0; the corrector at ``target``, with the predictor's second-order term.
        target, length = 0.0, 1.0
        for phase in range(2):
            for i in range(end + 1):
                for j in range(n):
                    total = q[i, j] if i < end else tail_slope[j]
                    for t in range(n):
                        total += (Q[i, j, t] if i < end else tail_value[j, t]) * x[i, t]
                    slope_x[i, j] = total
                if i < end:
                    for j in range(m):
                        total = r[i, j]
                        for t in range(m):
                            total += R[i, j, t] * u[i, t]
                        slope_u[i, j] = total
            for item in range(count):
                kind, i, index = chosen[0, item], chosen[1, item], chosen[2, item]
                over = pairs[_MU, item] * pairs[_S, item] - target
                if phase == 1:
                    over += pairs[_D_MU, item] * pairs[_D_S, item]
                first = pairs[_W, item] * pairs[_RESIDUAL, item] - over / pairs[_S, item]
                pairs[_FIRST, item] = first
                if kind == _ROW:
                    under = pairs[_NU, item] * pairs[_SIGMA, item] - target
                    if phase == 1:
                        under += pairs[_D_NU, item] * pairs[_D_SIGMA, item]
                    second = (
                        -(pairs[_LINEAR, item] + pairs[_QUADRATIC, item] * pairs[_SIGMA, item] - pairs[_MU, item] - pairs[_NU, item])
                        - under / pairs[_SIGMA, item]
                    )
                    pairs[_SECOND, item] = second
                    move = pairs[_MU, item] + (pairs[_V, item] * first - pairs[_W, item] * second) / (pairs[_W, item] + pairs[_V, item])
                    for j in range(n):
                        slope_x[i + 1, j] += G[i, index, j] * move
                else:
                    move = pairs[_MU, item] + first
                    if kind in (_X_LOW, _U_LOW):
                        move = -move
                    if kind <= _X_LOW:
                        slope_x[i + 1, bounded[index]] += move
                    else:
                        slope_u[i, index] += move
            slope[end] = slope_x[end]
            sweep_back(A, B, c, False, end, gain, root, value, slope_x, slope_u, slope, feed)
            step_x[0] = 0.0
            sweep_ahead(A, B, c, False, 0, end, gain, feed, step_x, step_u)

            # Recover the eliminated steps, and how far the point may go.
            length = 1.0
            for item in range(count):
                kind = chosen[0, item]
                along = _value_of(kind, chosen[1, item], chosen[2, item], G, bounded, step_x, step_u)
                d_s = -pairs[_RESIDUAL, item] - along
                d_mu = pairs[_W, item] * along + pairs[_FIRST, item]
                if kind == _ROW:
                    under = pairs[_NU, item] * pairs[_SIGMA, item] - target
                    if phase == 1:
                        under += pairs[_D_NU, item] * pairs[_D_SIGMA, item]
                    d_sigma = (d_mu + pairs[_SECOND, item]) / (pairs[_W, item] + pairs[_V, item])
                    d_s += d_sigma
                    d_mu = (pairs[_V, item] * d_mu - pairs[_W, item] * pairs[_SECOND, item]) / (pairs[_W, item] + pairs[_V, item])
                    d_nu = -(under + pairs[_NU, item] * d_sigma) / pairs[_SIGMA, item]
                    pairs[_D_SIGMA, item], pairs[_D_NU, item] = d_sigma, d_nu
                    if d_sigma < 0.0:
                        length = min(length, -pairs[_SIGMA, item] / d_sigma)
                    if d_nu < 0.0:
                        length = min(length, -pairs[_NU, item] / d_nu)
                pairs[_D_S, item], pairs[_D_MU, item] = d_s, d_mu
                if d_s < 0.0:
                    length = min(length, -pairs[_S, item] / d_s)
                if d_mu < 0.0:
                    length = min(length, -pairs[_MU, item] / d_mu)
            if phase == 0:
                ahead = 0.0
                for item in range(count):
                    ahead += (pairs[_S, item] + length * pairs[_D_S, item]) * (pairs[_MU, item] + length * pairs[_D_MU, item])
                    if chosen[0, item] == _ROW:
                        ahead += (pairs[_SIGMA, item] + length * pairs[_D_SIGMA, item]) * (pairs[_NU, item] + length * pairs[_D_NU, item])
                target = max(average * (ahead / products / average) ** 3, 0.01 * _TOLERANCE)  # no pair may run far ahead of the others

        length = min(1.0, 0.995 * length)
        for item in range(count):
            pairs[_S, item] += length * pairs[_D_S, item]
            pairs[_MU, item] += length * pairs[_D_MU, item]
            if chosen[0, item] == _ROW:
                pairs[_SIGMA, item] += length * pairs[_D_SIGMA, item]
                pairs[_NU, item] += length * pairs[_D_NU, item]
        for i in range(end):
            for j in range(m):
                u[i, j] += length * step_u[i, j]
            for j in range(n):
                x[i + 1, j] += length * step_x[i + 1, j]
        sweep_ahead(A, B, c, True, end, stages, gain, feed, x, u)

    for item in range(count):
        kind, i, index = chosen[0, item], chosen[1, item], chosen[2, item]
        mu = pairs[_MU, item]
        if kind == _ROW:
            sigma[i, index], rows[i, index] = pairs[_SIGMA, item], mu
        elif kind <= _X_LOW:
            x_bounds[i, index] += mu if kind == _X_HIGH else -mu
        else:
            u_bounds[i, index] += mu if kind == _U_HIGH else -mu
    adjoint(A, Q, q, G, bounded, x, rows, x_bounds, dynamics)
    return code, iterations
