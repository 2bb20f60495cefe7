"""Stage programs with random values, dense and solved by other means, and a workspace maker that keeps a copy of all it is given."""

from collections.abc import Callable
from dataclasses import dataclass

import clarabel
import numpy as np
import scipy.sparse as sp

from hdvplan.arrays import FloatArray
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, QpWorkspace, Status

PARTS = ("x", "u", "sigma", "dynamics", "rows", "x_bounds", "u_bounds")  # of a primal-dual point


def shape(*, rows: int = 3, stages: int = 6) -> StageShape:
    """Return sizes that share no number: four states, two inputs, the second and the last state bounded."""
    return StageShape(stages, 4, 2, rows, (1, 3))


def random_program(sizes: StageShape, seed: int, *, tightness: float = 1.0) -> StageQp:
    """Return a convex program with patterned zeros; its rows bind more the smaller ``tightness`` is."""
    random = np.random.default_rng(seed)
    qp = StageQp.empty(sizes)
    n, m = sizes.states, sizes.inputs
    a, q, g = (
        np.ones(s, bool) if p is None else p for s, p in (((n, n), sizes.a_pattern), ((n, n), sizes.q_pattern), (n, sizes.g_pattern))
    )
    qp.A[:] = 0.5 * random.normal(size=qp.A.shape) * a
    qp.B[:], qp.c[:], qp.x_first[:] = random.normal(size=qp.B.shape), 0.1 * random.normal(size=qp.c.shape), 0.3 * random.normal(size=n)
    root = random.normal(size=(sizes.stages + 1, n, 2))
    root[:, ~np.diag(q)] = 0.0
    qp.Q[:], qp.q[:] = root @ root.transpose(0, 2, 1), random.normal(size=qp.q.shape) * np.diag(q)
    root = random.normal(size=(sizes.stages, m, m))
    qp.R[:], qp.r[:] = root @ root.transpose(0, 2, 1) + 0.5 * np.eye(m), random.normal(size=qp.r.shape)
    qp.G[:], qp.h[:] = random.normal(size=qp.G.shape) * g, tightness * random.uniform(0.2, 1.0, qp.h.shape)
    qp.linear[:], qp.quadratic[:] = random.uniform(0.5, 5.0, qp.linear.shape), random.uniform(0.0, 2.0, qp.quadratic.shape)
    qp.x_low[:], qp.x_high[:] = -3.0 - random.uniform(size=qp.x_low.shape), 3.0 + random.uniform(size=qp.x_high.shape)
    qp.u_low[:], qp.u_high[:] = -random.uniform(0.2, 1.0, qp.u_low.shape), random.uniform(0.2, 1.0, qp.u_high.shape)
    return qp


def copied(point: StageSolution) -> StageSolution:
    """Return a point that nobody overwrites."""
    return StageSolution(point.stages.copy(), point.row_points.copy())


def same(one: StageSolution, other: StageSolution) -> bool:
    """Tell whether two points agree in every number."""
    return all(np.array_equal(getattr(one, part), getattr(other, part)) for part in PARTS)


@dataclass(frozen=True)
class Dense:
    """minimise 1/2 v'Pv + q'v subject to E v = b, G v <= h; all states first, then all inputs, then all slacks."""

    P: FloatArray
    q: FloatArray
    E: FloatArray
    b: FloatArray
    G: FloatArray
    h: FloatArray

    def solve(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return v, equality and inequality multipliers from another solver at its tightest."""
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
        cones = [clarabel.ZeroConeT(len(self.b)), clarabel.NonnegativeConeT(len(self.h))]
        matrix = sp.csc_matrix(np.vstack([self.E, self.G]))
        solver = clarabel.DefaultSolver(sp.csc_matrix(np.triu(self.P)), self.q, matrix, np.concatenate([self.b, self.h]), cones, settings)
        solution = solver.solve()
        multipliers = np.array(solution.z)
        return np.array(solution.x), multipliers[: len(self.b)], multipliers[len(self.b) :]


def dense(qp: StageQp) -> Dense:
    """Write a stage program out as the formula at the head of its module says, slacks and bounds as plain rows."""
    s = qp.shape
    N, n, m, p, bounded = s.stages, s.states, s.inputs, s.rows, s.bounded_states
    x = np.arange((N + 1) * n).reshape(N + 1, n)
    u = x.size + np.arange(N * m).reshape(N, m)
    sigma = x.size + u.size + np.arange(N * p).reshape(N, p)
    size = x.size + u.size + sigma.size
    P, q = np.zeros((size, size)), np.zeros(size)
    for i in range(N + 1):
        P[np.ix_(x[i], x[i])], q[x[i]] = qp.Q[i], qp.q[i]
    equal, b = [np.eye(size)[x[0, j]] for j in range(n)], list(qp.x_first)
    below: list[FloatArray] = []
    h: list[float] = []
    unit = np.eye(size)
    for i in range(N):
        P[np.ix_(u[i], u[i])], q[u[i]] = qp.R[i], qp.r[i]
        P[sigma[i], sigma[i]], q[sigma[i]] = qp.quadratic[i], qp.linear[i]
        for j in range(n):
            row = unit[x[i + 1, j]].copy()
            row[x[i]] -= qp.A[i, j]
            row[u[i]] -= qp.B[i, j]
            equal.append(row)
            b.append(float(qp.c[i, j]))
    for i in range(N):  # rows first, then their slacks, then bounds: upper before lower
        for j in range(p):
            row = -unit[sigma[i, j]]
            row[x[i + 1]] += qp.G[i, j]
            below.append(row)
            h.append(float(qp.h[i, j]))
    for i in range(N):
        for j in range(p):
            below.append(-unit[sigma[i, j]])
            h.append(0.0)
    for sign, x_limit, u_limit in ((1.0, qp.x_high, qp.u_high), (-1.0, qp.x_low, qp.u_low)):
        for i in range(N):
            below += [sign * unit[x[i + 1, j]] for j in bounded]
            h += list(sign * x_limit[i])
        for i in range(N):
            below += [sign * unit[column] for column in u[i]]
            h += list(sign * u_limit[i])
    return Dense(P, q, np.array(equal), np.array(b), np.array(below), np.array(h))


def staged(qp: StageQp, v: FloatArray, equality: FloatArray, inequality: FloatArray) -> StageSolution:
    """Sort a solution of ``dense`` into stage arrays; an equality row reads x_{i+1} - A x_i - B u_i = c."""
    s = qp.shape
    N, n, m, p, b = s.stages, s.states, s.inputs, s.rows, len(s.bounded_states)
    point = StageSolution.empty(s)
    point.x[:], rest = v[: (N + 1) * n].reshape(N + 1, n), v[(N + 1) * n :]
    point.u[:], point.sigma[:] = rest[: N * m].reshape(N, m), rest[N * m :].reshape(N, p)
    point.dynamics[:] = equality.reshape(N + 1, n)
    point.rows[:] = inequality[: N * p].reshape(N, p)
    bounds = inequality[2 * N * p :].reshape(2, -1)
    both = bounds[0] - bounds[1]
    point.x_bounds[:], point.u_bounds[:] = both[: N * b].reshape(N, b), both[N * b :].reshape(N, m)
    return point


Answer = Callable[[StageQp], StageSolution | None]


class Spy:
    """Call it to make its workspace. ``answer`` may return a point of its own, or None to let the solver solve."""

    def __init__(self, make: Callable[[StageShape], QpWorkspace], answer: Answer | None = None) -> None:
        """Stand between planning and the workspaces that ``make`` makes."""
        self.programs: list[StageQp] = []
        self.guessed: list[bool] = []  # whether a guess came with each
        self.answer = answer
        self._make = make
        self._workspace: QpWorkspace | None = None

    def __call__(self, shape: StageShape) -> "Spy":
        """Make the workspace."""
        self._workspace = self._make(shape)
        return self

    @property
    def name(self) -> str:
        """Return a name that no solver has."""
        return "spy"

    @property
    def starts_warm(self) -> bool:
        """Return what the made workspace says."""
        return self._workspace is not None and self._workspace.starts_warm

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Keep a copy of ``qp`` and have it solved."""
        self.programs.append(StageQp(qp.shape, qp.buffer.copy()))
        self.guessed.append(guess is not None)
        point = None if self.answer is None else self.answer(qp)
        if point is not None:
            return QpResult(Status.SOLVED, point, 1, 0.0, 0.0)
        assert self._workspace is not None
        return self._workspace.solve(qp, guess)
