"""The quadratic program of the smoothing: lateral offsets that make a base line fit its data with bounded curvature.

Unknowns, stacked in this order: the offsets n and the new line's curvatures kappa at stations of equal spacing h, and
one slack t.

    minimise    sum_j w_j (n(s_j) - e_j)^2  +  sum_i (kappa_{i+1} - kappa_i)^2 / h  +  c t
    subject to  kappa = k + n'' + k^2 n                       (the offset line's curvature to first order)
                |kappa| <= largest curvature
                e_j - d - t <= n <= e_j + d + t,  t >= 0      (at the station nearest to each datum)

n'' is the second derivative of the cubic spline through the offsets, m: (m_{i-1} + 4 m_i + m_{i+1})/6 equals the second
difference of n over h^2. Using the very operator of the spline that represents the line keeps the rounds from
amplifying its shortest waves. An open line keeps its ends; a closed one wraps.
"""

from __future__ import annotations

from dataclasses import dataclass

import clarabel
import numpy as np
import scipy.sparse as sp

from hdvplan.arrays import FloatArray, IntArray

_SLACK_PRICE = 10.0  # of a metre beyond the allowed deviation: dearer than any change of curvature that it could save


@dataclass(frozen=True)
class Stations:
    """Stations of equal ``spacing`` [m] along a line; a closed line's last one is not repeated at its end."""

    count: int
    spacing: float
    closed: bool

    @property
    def length(self) -> float:
        """The line's length [m]."""
        return self.spacing * (self.count if self.closed else self.count - 1)

    @property
    def s(self) -> FloatArray:
        """Their arclengths [m]."""
        return self.spacing * np.arange(self.count, dtype=np.float64)


def solve_offsets(
    stations: Stations,
    curvature: FloatArray,
    s: FloatArray,
    e: FloatArray,
    weights: FloatArray,
    *,
    max_deviation: float,
    max_curvature: float,
) -> tuple[FloatArray, float] | None:
    """Return the stations' offsets, shape (count,), and how much the data's farthest exceed ``max_deviation`` [m].

    ``curvature`` of the base line at the stations [1/m]; the data have arclengths ``s`` [m], offsets ``e`` [m] from the
    base line, left positive, and ``weights``: the length of line that each stands for [m] over the sixth power of the
    length below which features are smoothed away [m]. None: between its fixed ends the line turns too much.

    """
    count = stations.count
    at = s % stations.length if stations.closed else np.clip(s, 0.0, stations.length)
    fit = _interpolation(stations, at)
    weighted = sp.csr_array(fit.T * weights)
    change = _rows(stations, (-1.0, 1.0), first=0, stop=count if stations.closed else count - 1)
    hessian = sp.block_diag([weighted @ fit, (change.T @ change) / stations.spacing, sp.csr_array((1, 1))])
    gradient = np.concatenate([-(weighted @ e), np.zeros(count), [_SLACK_PRICE]])
    equalities, values = _curvature_rows(stations, curvature)
    inequalities, bounds = _bound_rows(stations, at, e, max_deviation, max_curvature)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cones = [clarabel.ZeroConeT(len(values)), clarabel.NonnegativeConeT(len(bounds))]
    rows = sp.csc_matrix(sp.vstack([equalities, inequalities]))
    solver = clarabel.DefaultSolver(sp.csc_matrix(sp.triu(hessian)), gradient, rows, np.concatenate([values, bounds]), cones, settings)
    solution = solver.solve()
    if solution.status not in {clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved}:
        return None
    unknowns = np.array(solution.x)
    return unknowns[:count], float(unknowns[-1])


def _interpolation(stations: Stations, at: FloatArray) -> sp.csr_array:
    """Return the matrix that interpolates linearly between stations at arclengths ``at``."""
    last = stations.count - (1 if stations.closed else 2)
    cell = np.clip((at / stations.spacing).astype(int), 0, last)
    part = at / stations.spacing - cell
    row = np.arange(len(at))
    columns = np.concatenate([cell, (cell + 1) % stations.count])
    return sp.csr_array((np.concatenate([1.0 - part, part]), (np.tile(row, 2), columns)), shape=(len(at), stations.count))


def _rows(stations: Stations, weights: tuple[float, ...], *, first: int, stop: int) -> sp.csr_array:
    """Return one row for each start from ``first`` to ``stop`` that weighs successive stations, wrapping around."""
    start = np.arange(first, stop)
    columns = (start[:, None] + np.arange(len(weights))) % stations.count
    row = np.repeat(np.arange(len(start)), len(weights))
    return sp.csr_array((np.tile(weights, len(start)), (row, columns.ravel())), shape=(len(start), stations.count))


def _curvature_rows(stations: Stations, curvature: FloatArray) -> tuple[sp.csr_array, FloatArray]:
    """Return the equalities: mean (kappa - k - k^2 n) = second difference of n; and an open line's fixed ends."""
    count, h = stations.count, stations.spacing
    stop = count if stations.closed else count - 2
    mean = _rows(stations, (1 / 6, 4 / 6, 1 / 6), first=0, stop=stop)
    second = _rows(stations, (1 / h**2, -2 / h**2, 1 / h**2), first=0, stop=stop)
    if not stations.closed:  # n'' goes on straight into the ends: the spline's not-a-knot condition
        straight = (1.0, -2.0, 1.0)
        ends = [_rows(stations, straight, first=start, stop=start + 1) for start in (0, count - 3)]
        mean = sp.csr_array(sp.vstack([mean, *ends]))
        second = sp.csr_array(sp.vstack([second, sp.csr_array((2, count))]))
    slack = sp.csr_array((mean.shape[0], 1))
    rows = sp.hstack([second + mean @ sp.diags_array(curvature**2), -mean, slack])
    values = -(mean @ curvature)
    if stations.closed:
        return sp.csr_array(rows), values
    fixed = sp.csr_array(([1.0, 1.0], ([0, 1], [0, count - 1])), shape=(2, 2 * count + 1))
    return sp.csr_array(sp.vstack([rows, fixed])), np.append(values, [0.0, 0.0])


def _bound_rows(
    stations: Stations, at: FloatArray, e: FloatArray, max_deviation: float, max_curvature: float
) -> tuple[sp.csr_array, FloatArray]:
    """Return the inequalities, rows <= bounds: curvature to both sides, deviation to both sides, slack not negative."""
    count = stations.count
    nearest: IntArray = np.rint(at / stations.spacing).astype(np.int64) % count
    highest, lowest = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(highest, nearest, e + max_deviation)
    np.maximum.at(lowest, nearest, e - max_deviation)
    seen = np.flatnonzero(np.isfinite(highest))
    unit = sp.eye_array(count)
    picked = sp.csr_array((np.ones(len(seen)), (np.arange(len(seen)), seen)), shape=(len(seen), count))
    other, slack = sp.csr_array((len(seen), count)), sp.csr_array(np.ones((len(seen), 1)))
    bend = sp.hstack([sp.csr_array((count, count)), unit, sp.csr_array((count, 1))])
    more, less = sp.hstack([picked, other, -slack]), sp.hstack([-picked, other, -slack])
    price = sp.csr_array(([-1.0], ([0], [2 * count])), shape=(1, 2 * count + 1))
    rows = sp.vstack([bend, -bend, more, less, price])
    bounds = np.concatenate([np.full(2 * count, max_curvature), highest[seen], -lowest[seen], [0.0]])
    return sp.csr_array(rows), bounds
