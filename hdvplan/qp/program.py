"""A quadratic program in stages: the form in which one planning step reaches every solver.

The program is::

    minimise    sum_i  1/2 x_i'Q_i x_i + q_i'x_i + 1/2 u_i'R_i u_i + r_i'u_i + penalty(sigma_i)
    subject to  x_0 given,  x_{i+1} = A_i x_i + B_i u_i + c_i
                G_i x_i - sigma_i <= h_i,  sigma_i >= 0        (elastic rows)
                x_low <= x_i <= x_high (some states),  u_low <= u_i <= u_high

with penalty = linear sigma + 1/2 quadratic sigma^2 for each row: a large ``linear`` makes it an exact penalty, zero
whenever the row can be kept.

The core reads and writes records: one of ``stage_dtype`` for every stage 0..N, which has the dynamics and the input (A, B, c, R, r, bounds
of u) and the cost and bounds of the state (Q, q, bounds of x), and one of ``row_dtype`` for each of its rows. The first
state is given, so its rows and bounds are not used. All values are in one buffer; the named arrays are views into it, so that a
solver can gather its own matrices from fixed places.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache, cached_property

import numpy as np

from hdvplan import core
from hdvplan.arrays import BoolArray, FloatArray, IntArray, Records
from hdvplan.errors import QpDataError

MOST_STATES, MOST_INPUTS = core.number("HDV_MOST_STATES"), core.number("HDV_MOST_INPUTS")  # for which the core has room


@dataclass(frozen=True)
class StageShape:
    """Sizes and zero pattern, fixed for a whole drive."""

    stages: int  #: N: intervals; states exist at 0..N
    states: int
    inputs: int
    rows: int  #: elastic rows at each of the stages 1..N; the fixed first state has none
    bounded_states: tuple[int, ...] = ()  #: indices of the states with bounds
    a_pattern: BoolArray | None = None  #: (states, states); where A can be non-zero, None: everywhere
    q_pattern: BoolArray | None = None
    g_pattern: BoolArray | None = None  #: (states,)

    @property
    def sizes(self) -> IntArray:
        """The core's record of it: stages, states, inputs, rows, bounded states."""
        return np.array([self.stages, self.states, self.inputs, self.rows, len(self.bounded_states)], np.int64)

    def __post_init__(self) -> None:
        """Refuse sizes that make no program."""
        if min(self.stages, self.states, self.inputs) < 1 or self.rows < 0:
            msg = f"a stage QP needs at least one stage, state and input and no negative row count: {self}"
            raise QpDataError(msg)
        if self.states > MOST_STATES or self.inputs > MOST_INPUTS or not set(self.bounded_states) <= set(range(self.states)):
            msg = f"a stage QP has at most {MOST_STATES} states and {MOST_INPUTS} inputs, and bounds none but its own states: {self}"
            raise QpDataError(msg)


def stage_dtype(shape: StageShape) -> np.dtype[np.void]:
    """Return the record of one stage: all numbers of a program but its rows."""
    n, m, b = shape.states, shape.inputs, len(shape.bounded_states)
    sizes = {"A": (n, n), "B": (n, m), "c": (n,), "Q": (n, n), "q": (n,), "R": (m, m), "r": (m,), "live": (),
             "x_low": (b,), "u_low": (m,), "x_high": (b,), "u_high": (m,)}  # fmt: skip
    return np.dtype([(name, float, size) for name, size in sizes.items()])


def row_dtype(states: int) -> np.dtype[np.void]:
    """Return the record of one row g'x - sigma <= h, with the price of sigma."""
    return np.dtype([("g", float, (states,)), ("h", float), ("linear", float), ("quadratic", float)])


PROGRAM = core.record("hdv_program", shape=np.dtype((np.int64, 5)))


_ALL, _INTERVALS, _AHEAD = (
    slice(None),
    slice(None, -1),
    slice(1, None),
)  # of stages 0..N: all, those with an input, those behind the first


class _Named:
    """A named array of a program or a point: a view of one field of its records, at the stages that have it."""

    def __init__(self, records: str, name: str, at: slice) -> None:
        self._records, self._name, self._at = records, name, at

    def __get__(self, owner: object, kind: type) -> FloatArray:
        found: FloatArray = getattr(owner, self._records)[self._name][self._at]
        return found


@dataclass(frozen=True)
class StageQp:
    """The values of one program, written in place; see the module's formula for the names.

    ``live`` of a stage is 1 where any of its rows may bind; at 0 all of them have g = 0 and h > 0, and solvers may pass them over.
    """

    shape: StageShape
    buffer: FloatArray
    stages: Records = field(init=False)  #: (N+1,) of ``stage_dtype``
    rows: Records = field(init=False)  #: (N+1, p) of ``row_dtype``
    x_first: FloatArray = field(init=False)  #: (n,)
    bounded: IntArray = field(init=False)  #: indices of the bounded states

    def __post_init__(self) -> None:
        """Lay the records over the buffer."""
        shape = self.shape
        stage, row = stage_dtype(shape), row_dtype(shape.states)
        count = shape.stages + 1
        first = count * stage.itemsize // 8
        last = first + count * shape.rows * row.itemsize // 8
        object.__setattr__(self, "stages", self.buffer[:first].view(stage))
        object.__setattr__(self, "rows", self.buffer[first:last].view(row).reshape(count, shape.rows))
        object.__setattr__(self, "x_first", self.buffer[last:])
        object.__setattr__(self, "bounded", np.asarray(shape.bounded_states, np.int64))

    @classmethod
    def empty(cls, shape: StageShape) -> StageQp:
        """Return a program of zeros, with all rows live."""
        stage, row = stage_dtype(shape), row_dtype(shape.states)
        size = (shape.stages + 1) * (stage.itemsize + shape.rows * row.itemsize) // 8 + shape.states
        qp = cls(shape, np.zeros(size))
        qp.stages["live"] = 1.0
        return qp

    def copy(self) -> StageQp:
        """Return a program that nobody else writes to."""
        return StageQp(self.shape, self.buffer.copy())

    @cached_property
    def record(self) -> Records:
        """The core's record of it, which holds addresses of the arrays above."""
        places = (core.address(array) for array in (self.stages, self.rows, self.x_first, self.bounded))
        return np.array([(self.shape.sizes, *places)], PROGRAM)

    @cached_property
    def address(self) -> int:
        """Where that record is."""
        return core.address(self.record)

    A = _Named("stages", "A", _INTERVALS)  #: (N, n, n)
    B = _Named("stages", "B", _INTERVALS)  #: (N, n, m)
    c = _Named("stages", "c", _INTERVALS)  #: (N, n)
    Q = _Named("stages", "Q", _ALL)  #: (N+1, n, n)
    q = _Named("stages", "q", _ALL)  #: (N+1, n)
    R = _Named("stages", "R", _INTERVALS)  #: (N, m, m)
    r = _Named("stages", "r", _INTERVALS)  #: (N, m)
    G = _Named("rows", "g", _AHEAD)  #: (N, p, n); entry i of this and those below belongs to stage i + 1
    h = _Named("rows", "h", _AHEAD)  #: (N, p)
    linear = _Named("rows", "linear", _AHEAD)  #: (N, p)
    quadratic = _Named("rows", "quadratic", _AHEAD)  #: (N, p)
    x_low = _Named("stages", "x_low", _AHEAD)  #: (N, bounded)
    x_high = _Named("stages", "x_high", _AHEAD)  #: (N, bounded)
    u_low = _Named("stages", "u_low", _INTERVALS)  #: (N, m)
    u_high = _Named("stages", "u_high", _INTERVALS)  #: (N, m)

    def check(self) -> None:
        """Refuse non-finite values and crossed bounds before any solver sees them.

        Raises:
            QpDataError: with the name of the array at fault.

        """
        if not np.isfinite(self.buffer).all():
            for name in NAMES:
                if not np.isfinite(getattr(self, name)).all():
                    msg = f"the QP holds a value that is not finite in {name!r}"
                    raise QpDataError(msg)
        if np.any(self.x_low > self.x_high) or np.any(self.u_low > self.u_high):
            msg = "the QP holds a lower bound above its upper bound"
            raise QpDataError(msg)


# Every named array of a program.
NAMES = ("A", "B", "c", "x_first", "Q", "q", "R", "r", "G", "h", "linear", "quadratic", "x_low", "x_high", "u_low", "u_high")


@cache
def point_dtype(states: int, inputs: int, bounded: int) -> np.dtype[np.void]:
    """Return the record of one stage of a primal-dual point."""
    n, m, b = (states,), (inputs,), (bounded,)
    return np.dtype([("x", float, n), ("u", float, m), ("dynamics", float, n), ("x_bounds", float, b), ("u_bounds", float, m)])


POINT = core.record("hdv_point")
ROW_POINT = np.dtype([("sigma", float), ("multiplier", float)])  # of one row of a primal-dual point


def by_stage(array: Records | FloatArray) -> FloatArray:
    """Return a view of shape (stages, numbers) of numbers, or records of numbers, whose first axis counts stages."""
    flat = array.view(np.float64)
    return flat.reshape(len(array), flat.size // len(array))


@dataclass(frozen=True)
class StageSolution:
    """A primal-dual point of a ``StageQp``. Multipliers of inequalities are >= 0; those of bounds are upper less lower."""

    stages: Records  #: (N+1,) of ``point_dtype``
    row_points: Records  #: (N+1, p) of ``ROW_POINT``
    x = _Named("stages", "x", _ALL)  #: (N+1, n)
    u = _Named("stages", "u", _INTERVALS)  #: (N, m)
    sigma = _Named("row_points", "sigma", _AHEAD)  #: (N, p)
    dynamics = _Named("stages", "dynamics", _ALL)  #: multipliers of x_0 given, then of each x_{i+1} = ..., (N+1, n)
    rows = _Named("row_points", "multiplier", _AHEAD)  #: (N, p)
    x_bounds = _Named("stages", "x_bounds", _AHEAD)  #: (N, bounded)
    u_bounds = _Named("stages", "u_bounds", _INTERVALS)  #: (N, m)

    @classmethod
    def empty(cls, shape: StageShape) -> StageSolution:
        """Return a point of zeros."""
        count = shape.stages + 1
        return cls(
            np.zeros(count, point_dtype(shape.states, shape.inputs, len(shape.bounded_states))), np.zeros((count, shape.rows), ROW_POINT)
        )

    @cached_property
    def numbers(self) -> tuple[FloatArray, FloatArray]:
        """All numbers of the point, (N+1, numbers a stage), and of its rows."""
        return by_stage(self.stages), by_stage(self.row_points)

    @cached_property
    def record(self) -> Records:
        """The core's record of it, which holds addresses of the arrays above."""
        return np.array([(core.address(self.stages), core.address(self.row_points))], POINT)

    def check(self, shape: StageShape) -> None:
        """Refuse a point that is none of a program of that shape.

        Raises:
            QpDataError: it is of another shape.

        """
        stage = point_dtype(shape.states, shape.inputs, len(shape.bounded_states))
        core_needs = ((self.stages, stage, (shape.stages + 1,)), (self.row_points, ROW_POINT, (shape.stages + 1, shape.rows)))
        for array, kind, size in core_needs:
            if array.dtype != kind or array.shape != size or not array.flags.c_contiguous:
                msg = f"a point of another shape: {array.shape} of {array.dtype} instead of {size} of {kind}"
                raise QpDataError(msg)

    def address_for(self, shape: StageShape) -> int:
        """Return where that record is, for the core to read it as a point of a program of that shape.

        Raises:
            QpDataError: it is of another shape.

        """
        self.check(shape)
        return core.address(self.record)

    def copy(self) -> StageSolution:
        """Return a point that nobody overwrites."""
        return StageSolution(self.stages.copy(), self.row_points.copy())

    def copy_from(self, other: StageSolution) -> None:
        """Take over another point of the same shape."""
        for mine, theirs in zip(self.numbers, other.numbers, strict=True):
            mine[:] = theirs
