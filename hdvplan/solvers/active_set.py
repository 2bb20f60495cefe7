"""A warm start for stage QPs: the active inequalities of the last plan are nearly always those of this plan.

A primal-dual active set method (Hintermüller, Ito, Kunisch 2003): active inequalities are equalities, kept by a stiff quadratic whose
centre moves by their multipliers (augmented Lagrangian), so that a Riccati pass solves for everything at once; then every inequality
is looked at, and those of the wrong status change it. Elastic rows have a third status, violated, where their penalty is a plain
quadratic. With the right guess one or two passes do what an interior point method needs twenty for. With a wrong one the method may
chatter: it is given a few passes, and where it has not settled by then it says so.
"""

from __future__ import annotations

import numpy as np

from hdvplan.jit import IntArray, Records, compiled, inner
from hdvplan.qp.program import StageShape
from hdvplan.solvers.recursion import adjoint, end_at, factorise, imbalance, load_weights, sweep_ahead, sweep_back

INACTIVE, ACTIVE, VIOLATED = range(3)
STIFF = 1e9  # of an active inequality [1/m^2]: an error of its multiplier by 100 leaves 1e-7 m
PASSES = 5
KEPT = 1e-7  # of an active or inactive inequality [m, 1/m]
_BALANCED = 1e-6  # of the Lagrangian's gradient by the inputs, relative: stiff quadratics turn rounding into multipliers
CARRIED = 1e-4  # a guess's multiplier beyond this means that its inequality was active
INEQUALITY = np.dtype([("status", np.int64), ("multiplier", float)])


def inequalities(shape: StageShape) -> Records:
    """Return the memory for the statuses of all inequalities, (N+1, rows + 2 bounds): rows, then every bound's upper and lower side.

    Bounds of the states come first. A bound of an input belongs to the stage that the input leaves, all others to their own stage.
    """
    return np.zeros((shape.stages + 1, shape.rows + 2 * (len(shape.bounded_states) + shape.inputs)), INEQUALITY)


@inner
def _guess_bound(inequality: Records, i: int, first: int, multiplier: float) -> None:
    """Write the guessed statuses of a bound's two sides."""
    for lower in range(2):
        own, one = inequality[i, first + lower], -multiplier if lower else multiplier
        own.status, own.multiplier = (ACTIVE, one) if one > CARRIED else (INACTIVE, 0.0)


@compiled
def guess_statuses(stages: Records, rows: Records, guess: Records, row_guess: Records, inequality: Records) -> bool:
    """Write the guessed status and multiplier of every inequality; return whether any is not inactive.

    A row without a linear price is never active: it costs nothing to begin with.
    """
    any_active, p, nb, last = False, rows.shape[1], guess[0].x_bounds.size, guess.size - 1
    for i in range(last + 1):  # most plans hold none: that costs no more than a look
        for b in range(nb):
            any_active |= i > 0 and abs(guess[i].x_bounds[b]) > CARRIED
        for j in range(guess[0].u.size):
            any_active |= i < last and abs(guess[i].u_bounds[j]) > CARRIED
        for row in range(p if i > 0 and stages[i].live > 0.0 else 0):
            any_active |= row_guess[i, row].multiplier > CARRIED
    if not any_active:
        return False
    for i in range(last + 1):
        if i > 0:
            for row in range(p):
                own, multiplier = inequality[i, row], row_guess[i, row].multiplier
                own.status, own.multiplier = INACTIVE, 0.0
                if multiplier > CARRIED and stages[i].live > 0.0:
                    violated = row_guess[i, row].sigma > KEPT or not rows[i, row].linear > 0.0
                    own.status, own.multiplier = VIOLATED if violated else ACTIVE, multiplier
            for b in range(nb):
                _guess_bound(inequality, i, p + 2 * b, guess[i].x_bounds[b])
        if i < last:
            for j in range(guess[0].u.size):
                _guess_bound(inequality, i, p + 2 * (nb + j), guess[i].u_bounds[j])
    return True


@inner
def _weigh(stages: Records, rows: Records, bounded: IntArray, inequality: Records, weights: Records) -> None:
    """Write the objective with the quadratics of all inequalities that are not inactive; Hessians in their lower triangles."""
    load_weights(stages, weights)
    p, nb, last = rows.shape[1], bounded.size, stages.size - 1
    for i in range(last + 1):
        stage, own = stages[i], weights[i]
        if i > 0:
            if stage.live > 0.0:
                for row in range(p):
                    status = inequality[i, row].status
                    if status == INACTIVE:
                        continue
                    one, active = rows[i, row], status == ACTIVE
                    weight = STIFF if active else one.quadratic
                    slope = (inequality[i, row].multiplier if active else one.linear) - weight * one.h
                    for j in range(own.q.size):
                        own.q[j] += slope * one.g[j]
                        for k in range(j + 1):
                            own.Q[j, k] += weight * one.g[j] * one.g[k]
            for b in range(nb):
                for lower in range(2):
                    side = inequality[i, p + 2 * b + lower]
                    if side.status == ACTIVE:
                        own.q[bounded[b]] += side.multiplier * (-1.0 if lower else 1.0) - STIFF * (
                            stage.x_low[b] if lower else stage.x_high[b]
                        )
                        own.Q[bounded[b], bounded[b]] += STIFF
        if i < last:
            for j in range(own.r.size):
                for lower in range(2):
                    side = inequality[i, p + 2 * (nb + j) + lower]
                    if side.status == ACTIVE:
                        own.r[j] += side.multiplier * (-1.0 if lower else 1.0) - STIFF * (stage.u_low[j] if lower else stage.u_high[j])
                        own.R[j, j] += STIFF


@inner
def _review_bound(inequality: Records, i: int, at: int, over: float) -> bool:
    """Move a bound's multiplier by what it lacks, change a wrong status; return whether it was right and is kept."""
    own = inequality[i, at]
    if own.status == INACTIVE:
        if over > KEPT:
            own.status, own.multiplier = ACTIVE, 0.0
            return False
        return True
    own.multiplier += STIFF * over
    if own.multiplier < 0.0:
        own.status, own.multiplier = INACTIVE, 0.0
        return False
    return abs(over) <= KEPT


@inner
def _review(stages: Records, rows: Records, bounded: IntArray, points: Records, inequality: Records) -> bool:
    """Move multipliers by what active inequalities lack, change wrong statuses; return whether all were right and are kept."""
    settled, p, nb, last = True, rows.shape[1], bounded.size, stages.size - 1
    for i in range(last + 1):
        stage, x = stages[i], points[i].x
        if i > 0:
            for row in range(p if stage.live > 0.0 else 0):
                own, one = inequality[i, row], rows[i, row]
                over, priced = -one.h, one.linear > 0.0
                for j in range(x.size):
                    over += one.g[j] * x[j]
                if own.status == INACTIVE:
                    if over > KEPT:
                        own.status, own.multiplier, settled = ACTIVE if priced else VIOLATED, 0.0, False
                elif own.status == ACTIVE:
                    settled = settled and abs(over) <= KEPT
                    own.multiplier += STIFF * over
                    if own.multiplier < 0.0:
                        own.status, own.multiplier, settled = INACTIVE, 0.0, False
                    elif own.multiplier > one.linear:
                        own.status, settled = VIOLATED, False
                elif over < 0.0:
                    own.status, own.multiplier, settled = ACTIVE if priced else INACTIVE, one.linear, False
            for b in range(nb):
                v = x[bounded[b]]
                settled &= _review_bound(inequality, i, p + 2 * b, v - stage.x_high[b])
                settled &= _review_bound(inequality, i, p + 2 * b + 1, stage.x_low[b] - v)
        if i < last:
            for j in range(stage.r.size):
                v = points[i].u[j]
                settled &= _review_bound(inequality, i, p + 2 * (nb + j), v - stage.u_high[j])
                settled &= _review_bound(inequality, i, p + 2 * (nb + j) + 1, stage.u_low[j] - v)
    return settled


@inner
def _publish(stages: Records, rows: Records, inequality: Records, points: Records, row_points: Records) -> None:
    """Write elastic variables and multipliers to where the program has them."""
    p, nb, last = rows.shape[1], points[0].x_bounds.size, stages.size - 1
    for i in range(last + 1):
        point = points[i]
        if i > 0:
            for row in range(p):
                own, one, to = inequality[i, row], rows[i, row], row_points[i, row]
                to.sigma, to.multiplier = 0.0, own.multiplier
                if own.status == VIOLATED:
                    over = -one.h
                    for j in range(point.x.size):
                        over += one.g[j] * point.x[j]
                    to.sigma, to.multiplier = over, one.linear + one.quadratic * over
            for b in range(nb):
                point.x_bounds[b] = inequality[i, p + 2 * b].multiplier - inequality[i, p + 2 * b + 1].multiplier
        if i < last:
            for j in range(point.u.size):
                at = p + 2 * (nb + j)
                point.u_bounds[j] = inequality[i, at].multiplier - inequality[i, at + 1].multiplier


@compiled
def settle(
    stages: Records, rows: Records, bounded: IntArray, points: Records, row_points: Records, weights: Records, work: Records,
    inequality: Records,
) -> tuple[bool, int]:  # fmt: skip
    """Solve a program from guessed statuses and multipliers; return whether they settled, and the number of factorisations.

    Only then are multipliers and elastic variables written.
    """
    last = stages.size - 1
    for iteration in range(PASSES):
        _weigh(stages, rows, bounded, inequality, weights)
        end_at(weights, work, last)
        if not factorise(stages, weights, work, last):
            return False, iteration + 1
        sweep_back(stages, weights, work, last, True)
        sweep_ahead(stages, work, points, 0, last, True)
        if _review(stages, rows, bounded, points, inequality):
            _publish(stages, rows, inequality, points, row_points)
            adjoint(stages, rows, bounded, points, row_points)
            return bool(imbalance(stages, points) < _BALANCED), iteration + 1
    return False, PASSES
