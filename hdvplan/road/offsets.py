"""The quadratic program of the smoothing: lateral offsets that make a base line fit its data with bounded curvature.

Unknowns: the coefficients b of the offsets' cubic spline at stations of equal spacing h, and one slack t.

    minimise    sum_j w_j (n(s_j) - e_j)^2  +  sum_i (kappa_{i+1} - kappa_i)^2 / h  +  c t
    subject to  |kappa| <= largest curvature
                e_j - d - t <= n <= e_j + d + t,  t >= 0      (at the station nearest to each datum)

where n = (b_{i-1} + 4 b_i + b_{i+1})/6 are the offsets, n'' = (b_{i-1} - 2 b_i + b_{i+1})/h^2 their second derivatives, and
kappa = k + n'' + k^2 n is the offset line's curvature to first order. Using the very spline that represents the line keeps the rounds
from amplifying its shortest waves. An open line keeps its ends; a closed one wraps.

On most roads no bound is reached. So the program is first solved without them and with t = 0: one banded Cholesky factorisation. The
least of all points, where it keeps the bounds, is the least of those that keep them; a positive definite Hessian makes it the only one.
Where it breaks a bound, however little, Clarabel solves the program: either way gives the same point, so the check needs no tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass

import clarabel
import numpy as np
import scipy.sparse as sp
from scipy.linalg import LinAlgError, solveh_banded

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


@dataclass(frozen=True)
class Program:
    """Minimise x'Hx/2 + g'x over spline coefficients x, subject to |k + K x| <= ``max_curvature`` and ``lowest`` <= N x <= ``highest``.

    Offsets are N x [m], curvatures k + K x [1/m]; ``lowest`` and ``highest`` are infinite at stations that no datum is near to [m].
    """

    hessian: sp.csc_array
    gradient: FloatArray
    offsets: sp.csr_array
    bends: sp.csr_array
    curvature: FloatArray
    max_curvature: float
    lowest: FloatArray
    highest: FloatArray
    closed: bool


def solve_offsets(program: Program) -> tuple[FloatArray, float] | None:
    """Return the stations' offsets, shape (count,), and how much the data's farthest exceed the largest deviation [m].

    None: between its fixed ends the line turns too much.
    """
    offsets = unbounded(program)
    return bounded(program) if offsets is None else (offsets, 0.0)


def program_of(
    stations: Stations,
    curvature: FloatArray,
    s: FloatArray,
    e: FloatArray,
    weights: FloatArray,
    *,
    max_deviation: float,
    max_curvature: float,
) -> Program:
    """Return the program of a base line with ``curvature`` at its stations [1/m] and data at arclengths ``s`` [m].

    The data have offsets ``e`` [m] from the base line, left positive, and ``weights``: the length of line that each stands for [m] over
    the sixth power of the length below which features are smoothed away [m].
    """
    count, h = stations.count, stations.spacing
    at = s % stations.length if stations.closed else np.clip(s, 0.0, stations.length)
    mean, second = np.outer([1 / 6, 4 / 6, 1 / 6], np.ones(count)), np.outer([1 / h**2, -2 / h**2, 1 / h**2], np.ones(count))
    spline = _spline(stations)
    offsets, bends = _windows(mean) @ spline, _windows(second + curvature**2 * mean) @ spline
    ahead = np.arange(1, count + stations.closed) % count
    change, given = bends[ahead] - bends[: len(ahead)], curvature[ahead] - curvature[: len(ahead)]
    root = np.sqrt(weights)  # what is minimised is a sum of squares, (rows x - wanted)^2
    rows = sp.csr_array(sp.vstack([sp.diags_array(root) @ _interpolation(stations, at) @ offsets, change / np.sqrt(h)]))
    wanted = np.concatenate([root * e, -given / np.sqrt(h)])
    nearest: IntArray = np.rint(at / h).astype(np.int64) % count
    highest, lowest = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(highest, nearest, e + max_deviation)
    np.maximum.at(lowest, nearest, e - max_deviation)
    hessian, gradient = sp.csc_array(rows.T @ rows), -(rows.T @ wanted)
    return Program(hessian, gradient, offsets, bends, curvature, max_curvature, lowest, highest, stations.closed)


def unbounded(program: Program) -> FloatArray | None:
    """Return the offsets that are best without bounds [m], or None where they break one, or the data do not determine them."""
    entries, size = sp.coo_array(program.hessian), len(program.gradient)
    number = np.arange(size)  # a closed line is folded: what stands next to each other across its end stays near the diagonal
    place = np.minimum(2 * number, 2 * (size - 1 - number) + 1) if program.closed else number
    row, column = place[entries.row], place[entries.col]
    below = row - column
    bands = np.zeros((int(np.max(below, initial=0)) + 1, size))
    bands[below[below >= 0], column[below >= 0]] = entries.data[below >= 0]
    gradient = np.empty(size)
    gradient[place] = program.gradient
    try:
        found = -solveh_banded(bands, gradient, lower=True)[place]
    except LinAlgError:
        return None
    offsets, curvature = program.offsets @ found, program.curvature + program.bends @ found
    kept = np.all((program.lowest <= offsets) & (offsets <= program.highest) & (np.abs(curvature) <= program.max_curvature))
    return offsets if kept else None


def bounded(program: Program) -> tuple[FloatArray, float] | None:
    """Return what ``solve_offsets`` returns, as Clarabel finds it."""
    seen = np.flatnonzero(np.isfinite(program.highest))
    near, bends, unknowns = program.offsets[seen], program.bends, len(program.gradient)
    slack = np.append(np.zeros(2 * bends.shape[0]), np.full(2 * len(seen) + 1, -1.0))
    rows = sp.hstack([sp.vstack([bends, -bends, near, -near, sp.csr_array((1, unknowns))]), sp.csr_array(slack[:, None])])
    given, most = program.curvature, program.max_curvature
    bounds = np.concatenate([most - given, most + given, program.highest[seen], -program.lowest[seen], [0.0]])
    hessian = sp.triu(sp.block_diag([program.hessian, sp.csr_array((1, 1))]))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cones = [clarabel.NonnegativeConeT(len(bounds))]
    gradient = np.append(program.gradient, _SLACK_PRICE)
    solution = clarabel.DefaultSolver(sp.csc_matrix(hessian), gradient, sp.csc_matrix(rows), bounds, cones, settings).solve()
    if solution.status not in {clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved}:
        return None
    found = np.array(solution.x)
    return program.offsets @ found[:unknowns], float(found[-1])


def _spline(stations: Stations) -> sp.csr_array:
    """Return the matrix from the unknowns to the spline's coefficients, from one before the first station to one beyond the last.

    Of a closed line, the unknowns are the stations' coefficients. Of an open one, those of all stations but the first and the last: the
    others follow from offsets of zero at its ends, and n'' that goes on straight into them, the spline's not-a-knot condition.
    """
    count = stations.count
    if stations.closed:
        return sp.csr_array((np.ones(count + 2), (np.arange(count + 2), np.arange(-1, count + 1) % count)))
    ends, size = np.array([-3.5, 2.0, -0.5, 0.625, -0.5, 0.125]), count - 2  # of the first two coefficients; mirrored, of the last two
    (row, column), inner = np.divmod(np.arange(6), 3), np.arange(size)
    places = np.concatenate([row, 2 + inner, count + 1 - row]), np.concatenate([column, inner, size - 1 - column])
    return sp.csr_array((np.concatenate([ends, np.ones(size), ends]), places))


def _windows(weights: FloatArray) -> sp.dia_array:
    """Return the matrix that weighs three successive coefficients for each station; ``weights`` has shape (3, count)."""
    count = weights.shape[1]
    return sp.diags_array(list(weights), offsets=[0, 1, 2], shape=(count, count + 2))


def _interpolation(stations: Stations, at: FloatArray) -> sp.csr_array:
    """Return the matrix that interpolates linearly between stations at arclengths ``at``."""
    last = stations.count - (1 if stations.closed else 2)
    cell = np.clip((at / stations.spacing).astype(int), 0, last)
    part = at / stations.spacing - cell
    row = np.arange(len(at))
    columns = np.concatenate([cell, (cell + 1) % stations.count])
    return sp.csr_array((np.concatenate([1.0 - part, part]), (np.tile(row, 2), columns)), shape=(len(at), stations.count))
