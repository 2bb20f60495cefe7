"""A stage QP as sparse matrices for general solvers: pattern built once, values gathered in place.

    minimise 1/2 v'Pv + q'v  subject to  E v = b,  G v <= h,  low <= v <= high

Variables stand in stage order (x_0, u_0, x_1, sigma_1, u_1, ..., x_N, sigma_N), which banded and multistage
factorisations need. Matrices are CSC with sorted indices and keep their structural zeros, so the pattern never changes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from time import perf_counter
from typing import Any, ClassVar, NamedTuple

import numpy as np
import scipy.sparse as sp

from hdvplan.arrays import BoolArray, FloatArray, IntArray
from hdvplan.qp.program import NAMES, StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, Status

_ONE, _MINUS_ONE = -1, -2  # codes of constant entries


@dataclass(frozen=True)
class _Gather:
    """Copies entries of a program's buffer to fixed places of a value array; places not listed keep their constants."""

    values: FloatArray
    places: IntArray
    sources: IntArray
    sign: float = 1.0

    def __call__(self, buffer: FloatArray) -> None:
        self.values[self.places] = self.sign * buffer[self.sources]


@dataclass(frozen=True)
class SparseQp:
    """The sparse form of programs of one shape; ``load`` fills in the values of one of them.

    Without ``elastic`` rows are hard and have no columns: the same optimum wherever the rows can be kept.
    """

    shape: StageShape
    elastic: bool
    P: sp.csc_matrix  # upper triangle
    q: FloatArray
    E: sp.csc_matrix
    b: FloatArray
    G: sp.csc_matrix
    h: FloatArray
    low: FloatArray  # -inf where absent
    high: FloatArray  # +inf where absent
    x_columns: IntArray  # (N+1, n)
    u_columns: IntArray  # (N, m)
    sigma_columns: IntArray  # (N, p)
    bound_columns: IntArray  # (N, bounded)
    gathers: tuple[_Gather, ...]

    @classmethod
    def of(cls, shape: StageShape, *, elastic: bool) -> SparseQp:
        """Lay out the pattern of ``shape``."""
        return _lay_out(shape, elastic=elastic)

    def load(self, qp: StageQp) -> None:
        """Write the values of ``qp`` into the matrices and vectors."""
        for gather in self.gathers:
            gather(qp.buffer)

    def point(self, v: FloatArray, equality: FloatArray, rows: FloatArray, bounds: FloatArray, into: StageSolution) -> None:
        """Copy a solution into stage arrays. Multipliers follow L = f + equality'(Ev - b) + rows'(Gv - h) + bounds'v."""
        stages, n = self.shape.stages, self.shape.states
        into.x[:] = v[self.x_columns]
        into.u[:] = v[self.u_columns]
        into.sigma[:] = v[self.sigma_columns] if self.elastic else 0.0
        into.dynamics[0] = equality[:n]
        into.dynamics[1:] = -equality[n:].reshape(stages, n)
        into.rows[:] = rows.reshape(into.rows.shape)
        into.x_bounds[:] = bounds[self.bound_columns]
        into.u_bounds[:] = bounds[self.u_columns]

    def flatten(self, point: StageSolution) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return v, equality, rows and bounds multipliers of a point in stage arrays: the inverse of ``point``."""
        v, bounds = np.zeros(len(self.q)), np.zeros(len(self.q))
        v[self.x_columns], v[self.u_columns] = point.x, point.u
        bounds[self.bound_columns], bounds[self.u_columns] = point.x_bounds, point.u_bounds
        if self.elastic:
            v[self.sigma_columns] = point.sigma
        return v, np.concatenate([point.dynamics[0], -point.dynamics[1:].ravel()]), point.rows.ravel(), bounds


class Answer(NamedTuple):
    """What a solver returns, with multipliers as ``SparseQp.point`` takes them."""

    status: Status
    iterations: int
    v: FloatArray
    equality: FloatArray
    rows: FloatArray
    bounds: FloatArray


class SparseWorkspace(ABC):
    """A general solver behind the workspace protocol: a class says how it takes the loaded program, and how it is run."""

    starts_warm: ClassVar = False
    name: str

    def __init__(self, shape: StageShape, tolerance: float, *, elastic: bool) -> None:
        self._form, self._point = SparseQp.of(shape, elastic=elastic), StageSolution.empty(shape)
        self._tolerance = tolerance
        self._solver: Any = None  # a library's object; None: the next program sets it up

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve ``qp``; see ``QpWorkspace``.

        Raises:
            SolverError: the solver refuses to be set up.

        """
        started = perf_counter()
        qp.check()
        self._form.load(qp)
        self._update(guess)
        updated = perf_counter()
        answer = self._run()
        self._form.point(*answer[2:], self._point)
        if answer.status not in {Status.SOLVED, Status.INACCURATE}:
            self._solver = None  # such a run leaves iterates and a step size that spoil the next
        return QpResult(answer.status, self._point, answer.iterations, updated - started, perf_counter() - updated)

    @abstractmethod
    def _update(self, guess: StageSolution | None) -> None:
        """Hand the loaded program over, and the guess where the solver starts warm."""

    @abstractmethod
    def _run(self) -> Answer:
        """Solve what was handed over."""


def stack(*parts: sp.csc_matrix | sp.csr_array) -> tuple[sp.csc_matrix, IntArray]:
    """Return matrices on top of each other, and where each value of the result stands in the parts' values laid end to end.

    The parts' values count in CSC order, which for selections of the identity is also their row order.
    """
    sizes = np.cumsum([0] + [part.nnz for part in parts])
    coded = [sp.csc_matrix(part) for part in parts]
    for part, begin in zip(coded, sizes, strict=False):
        part.data = np.arange(begin, begin + part.nnz, dtype=float) + 1.0  # from one, so that no place counts as a zero
    stacked = sp.csc_matrix(sp.vstack(coded, format="csc"))
    stacked.sort_indices()
    places = stacked.data.astype(np.int64) - 1
    stacked.data = np.zeros(len(places))
    return stacked, places


Part = tuple[IntArray, IntArray, IntArray | int, BoolArray | bool]  # rows, columns, places in the buffer or a constant, and which to keep


def _matrix(shape: tuple[int, int], *parts: Part) -> tuple[sp.csc_matrix, _Gather]:
    """Return a matrix of some parts, and the gather of its variable entries."""
    entries = [[array[kept].ravel() for array in arrays] for *arrays, kept in (np.broadcast_arrays(*part) for part in parts)]
    rows, columns, codes = (np.concatenate(column) for column in zip(*entries, strict=True))
    matrix = sp.csc_matrix((codes + 3.0, (rows, columns)), shape=shape)  # from one, so that no place counts as a zero
    matrix.sort_indices()
    codes = matrix.data.astype(np.int64) - 3
    matrix.data = np.where(codes == _MINUS_ONE, -1.0, 1.0)
    variable = np.flatnonzero(codes >= 0)
    return matrix, _Gather(matrix.data, variable, codes[variable])


def _lay_out(shape: StageShape, *, elastic: bool) -> SparseQp:
    stages, n, m, p = shape.stages, shape.states, shape.inputs, shape.rows
    slacks = p if elastic else 0
    code = StageQp(shape, np.arange(StageQp.empty(shape).buffer.size, dtype=float))  # every value is its own place
    codes = {name: getattr(code, name).astype(np.int64) for name in NAMES}
    block = n + slacks + m  # columns of one stage: x_i, sigma_i, u_i; the first stage has no sigma
    start = np.concatenate([[0], n + m + block * np.arange(stages)])
    x_columns = start[:, None] + np.arange(n)
    sigma_columns = start[1:, None] + n + np.arange(slacks)
    u_columns = np.concatenate([[n], start[1:-1] + n + slacks])[:, None] + np.arange(m)
    size = int(start[-1]) + n + slacks

    upper_n, upper_m = np.triu(np.ones((n, n), bool)), np.triu(np.ones((m, m), bool))
    q_keep = upper_n if shape.q_pattern is None else upper_n & (shape.q_pattern | np.eye(n, dtype=bool))
    cost: list[Part] = [
        (x_columns[:, :, None], x_columns[:, None, :], codes["Q"], q_keep),
        (u_columns[:, :, None], u_columns[:, None, :], codes["R"], upper_m),
    ]
    rows = n + np.arange(stages * n).reshape(stages, n)
    equal: list[Part] = [
        (np.arange(n), x_columns[0], _ONE, True),
        (rows[:, :, None], x_columns[:-1, None, :], codes["A"], True if shape.a_pattern is None else shape.a_pattern),
        (rows[:, :, None], u_columns[:, None, :], codes["B"], True),
        (rows, x_columns[1:], _MINUS_ONE, True),
    ]
    inequality = np.arange(stages * p).reshape(stages, p)
    g_keep = True if shape.g_pattern is None else shape.g_pattern
    below: list[Part] = [(inequality[:, :, None], x_columns[1:, None, :], codes["G"], g_keep)]
    if elastic:
        cost.append((sigma_columns, sigma_columns, codes["quadratic"], True))
        below.append((inequality, sigma_columns, _MINUS_ONE, True))
    cost_matrix, cost_gather = _matrix((size, size), *cost)
    equal_matrix, equal_gather = _matrix((n + stages * n, size), *equal)
    below_matrix, below_gather = _matrix((stages * p, size), *below)

    def vector(length: int, fill: float, *parts: tuple[IntArray, IntArray]) -> tuple[FloatArray, list[_Gather]]:
        values = np.full(length, fill)
        return values, [_Gather(values, places.ravel(), sources.ravel()) for places, sources in parts]

    slack_costs = ((sigma_columns, codes["linear"]),) if elastic else ()
    q, q_gathers = vector(size, 0.0, (x_columns, codes["q"]), (u_columns, codes["r"]), *slack_costs)
    b, first = vector(n + stages * n, 0.0, (np.arange(n), codes["x_first"]))
    dynamics = _Gather(b, rows.ravel(), codes["c"].ravel(), -1.0)
    h, h_gathers = vector(stages * p, 0.0, (inequality, codes["h"]))
    bound_columns = x_columns[1:, list(shape.bounded_states)]
    low, low_gathers = vector(size, -np.inf, (bound_columns, codes["x_low"]), (u_columns, codes["u_low"]))
    high, high_gathers = vector(size, np.inf, (bound_columns, codes["x_high"]), (u_columns, codes["u_high"]))
    low[sigma_columns] = 0.0
    for columns in (bound_columns, u_columns):  # present from the start: solvers choose their rows by what is finite
        low[columns] = high[columns] = 0.0
    gathers = (cost_gather, equal_gather, below_gather, *q_gathers, *first, dynamics, *h_gathers, *low_gathers, *high_gathers)
    return SparseQp(
        shape, elastic, cost_matrix, q, equal_matrix, b, below_matrix, h, low, high,
        x_columns, u_columns, sigma_columns, bound_columns, gathers,
    )  # fmt: skip
