"""A quadratic program in stages: the form in which one planning step reaches every solver.

    minimise    sum_i  1/2 x_i'Q_i x_i + q_i'x_i + 1/2 u_i'R_i u_i + r_i'u_i + penalty(sigma_i)
    subject to  x_0 given,  x_{i+1} = A_i x_i + B_i u_i + c_i
                G_i x_i - sigma_i <= h_i,  sigma_i >= 0        (elastic rows)
                x_low <= x_i <= x_high (some states),  u_low <= u_i <= u_high

with penalty = linear * sigma + 1/2 quadratic * sigma^2 for each row: a large ``linear`` makes it an exact penalty, zero
whenever the row can be kept. All values of all stages live in one buffer; the named arrays are views into it, so that a
solver can gather its own matrices from fixed places.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hdvplan.errors import QpDataError
from hdvplan.jit import BoolArray, FloatArray, compiled


@dataclass(frozen=True)
class StageShape:
    """Sizes and zero pattern, fixed for a whole drive."""

    stages: int  # N: intervals; states exist at 0..N
    states: int
    inputs: int
    rows: int  # elastic rows at each of the stages 1..N; the fixed first state has none
    bounded_states: tuple[int, ...] = ()  # indices of the states with bounds
    a_pattern: BoolArray | None = None  # (states, states); where A can be non-zero, None: everywhere
    q_pattern: BoolArray | None = None
    g_pattern: BoolArray | None = None  # (states,)

    def __post_init__(self) -> None:
        """Refuse sizes that make no program."""
        if min(self.stages, self.states, self.inputs) < 1 or self.rows < 0:
            msg = f"a stage QP needs at least one stage, state and input and no negative row count: {self}"
            raise QpDataError(msg)


@dataclass(frozen=True)
class StageQp:
    """The values of one program, written in place; see the module's formula for the names."""

    shape: StageShape
    buffer: FloatArray
    A: FloatArray = field(init=False)  # (N, n, n)
    B: FloatArray = field(init=False)  # (N, n, m)
    c: FloatArray = field(init=False)  # (N, n)
    x_first: FloatArray = field(init=False)  # (n,)
    Q: FloatArray = field(init=False)  # (N+1, n, n)
    q: FloatArray = field(init=False)  # (N+1, n)
    R: FloatArray = field(init=False)  # (N, m, m)
    r: FloatArray = field(init=False)  # (N, m)
    G: FloatArray = field(init=False)  # (N, p, n); entry i belongs to stage i+1
    h: FloatArray = field(init=False)  # (N, p)
    linear: FloatArray = field(init=False)  # (N, p)
    quadratic: FloatArray = field(init=False)  # (N, p)
    x_low: FloatArray = field(init=False)  # (N, bounded)
    x_high: FloatArray = field(init=False)  # (N, bounded)
    u_low: FloatArray = field(init=False)  # (N, m)
    u_high: FloatArray = field(init=False)  # (N, m)

    def __post_init__(self) -> None:
        """Lay the named views over the buffer."""
        start = 0
        for name, shape in view_shapes(self.shape).items():
            size = int(np.prod(shape))
            object.__setattr__(self, name, self.buffer[start : start + size].reshape(shape))
            start += size

    @classmethod
    def empty(cls, shape: StageShape) -> StageQp:
        """Return a program of zeros."""
        return cls(shape, np.zeros(sum(int(np.prod(s)) for s in view_shapes(shape).values())))

    def check(self) -> None:
        """Refuse non-finite values and crossed bounds before any solver sees them.

        Raises:
            QpDataError: with the name of the array at fault.

        """
        if not np.isfinite(self.buffer.sum()):  # one pass; a value that is not finite makes the sum so
            for name in view_shapes(self.shape):
                if not np.isfinite(getattr(self, name)).all():
                    msg = f"the QP holds a value that is not finite in {name!r}"
                    raise QpDataError(msg)
        if _crossed(self.x_low, self.x_high) or _crossed(self.u_low, self.u_high):
            msg = "the QP holds a lower bound above its upper bound"
            raise QpDataError(msg)


@compiled
def _crossed(low: FloatArray, high: FloatArray) -> bool:
    for i in range(low.shape[0]):
        for j in range(low.shape[1]):
            if low[i, j] > high[i, j]:
                return True
    return False


def view_shapes(shape: StageShape) -> dict[str, tuple[int, ...]]:
    """Return the shape of every named array of a ``StageQp``, in the order of its buffer."""
    stages, n, m, p, b = shape.stages, shape.states, shape.inputs, shape.rows, len(shape.bounded_states)
    return {
        "A": (stages, n, n),
        "B": (stages, n, m),
        "c": (stages, n),
        "x_first": (n,),
        "Q": (stages + 1, n, n),
        "q": (stages + 1, n),
        "R": (stages, m, m),
        "r": (stages, m),
        "G": (stages, p, n),
        "h": (stages, p),
        "linear": (stages, p),
        "quadratic": (stages, p),
        "x_low": (stages, b),
        "x_high": (stages, b),
        "u_low": (stages, m),
        "u_high": (stages, m),
    }


@dataclass(frozen=True)
class StageSolution:
    """A primal-dual point of a ``StageQp``. Multipliers of inequalities are >= 0; those of bounds are upper less lower."""

    x: FloatArray  # (N+1, n)
    u: FloatArray  # (N, m)
    sigma: FloatArray  # (N, p)
    dynamics: FloatArray  # (N+1, n): of x_0 given, then of each x_{i+1} = ...
    rows: FloatArray  # (N, p)
    x_bounds: FloatArray  # (N, bounded)
    u_bounds: FloatArray  # (N, m)

    @classmethod
    def empty(cls, shape: StageShape) -> StageSolution:
        """Return a point of zeros."""
        stages, n, m, p, b = shape.stages, shape.states, shape.inputs, shape.rows, len(shape.bounded_states)
        shapes = ((stages + 1, n), (stages, m), (stages, p), (stages + 1, n), (stages, p), (stages, b), (stages, m))
        return cls(*(np.zeros(s) for s in shapes))

    def multipliers(self) -> tuple[FloatArray, ...]:
        """Return the arrays of multipliers, and of the elastic variables that go with them."""
        return self.sigma, self.dynamics, self.rows, self.x_bounds, self.u_bounds
