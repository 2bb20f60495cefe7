"""Every solver of qpsolvers, one new solver for each program: the fallback, and a witness against the native workspaces."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from time import perf_counter

import numpy as np
import scipy.sparse as sp

from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, Status
from hdvplan.solvers.sparse import SparseQp

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of whichever solver is installed, wanted or not: qpsolvers imports all of them
    import qpsolvers


class GenericWorkspace:
    """One solver of qpsolvers behind the workspace protocol; nothing persists between solves."""

    starts_warm = False

    def __init__(self, shape: StageShape, solver: str, options: Mapping[str, float], *, elastic: bool) -> None:
        """Lay out the pattern; ``options`` are the solver's own, by the names that qpsolvers passes on."""
        self.name = f"qpsolvers/{solver}"
        self._solver, self._options = solver, options
        self._form = SparseQp.of(shape, elastic=elastic)
        self._point = StageSolution.empty(shape)

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:  # noqa: ARG002 - qpsolvers cannot pass multipliers on
        """Solve ``qp``; see ``QpWorkspace``. Whatever the solver throws becomes ``Status.FAILED``."""
        started = perf_counter()
        qp.check()
        form = self._form
        form.load(qp)
        full = (form.P + sp.triu(form.P, 1).T).tocsc()
        rows, right = (form.G, form.h) if len(form.h) else (None, None)
        problem = qpsolvers.Problem(full, form.q, rows, right, form.E, form.b, form.low, form.high)
        updated = perf_counter()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # about conversions to dense, which are the solver's own price
                solution = qpsolvers.solve_problem(problem, self._solver, **self._options)  # type: ignore[arg-type] # options differ by solver
        except Exception:  # noqa: BLE001 - eleven solvers leak exceptions of their own; one bad solve must not end a benchmark
            return QpResult(Status.FAILED, self._failed(), 0, updated - started, perf_counter() - updated)
        if solution.x is None:
            return QpResult(Status.FAILED, self._failed(), 0, updated - started, perf_counter() - updated)
        parts = ((solution.x, form.q), (solution.y, form.b), (solution.z, form.h), (solution.z_box, form.q))
        v, equality, multipliers, bounds = (
            np.zeros(len(like)) if part is None or len(part) == 0 else np.array(part) for part, like in parts
        )
        form.point(v, equality, multipliers, bounds, self._point)
        status = Status.SOLVED if solution.found else Status.FAILED
        return QpResult(status, self._point, _iterations(solution.extras), updated - started, perf_counter() - updated)

    def _failed(self) -> StageSolution:
        self._point.x[:] = np.nan
        return self._point


def _iterations(extras: dict[str, object]) -> int:
    """Return the iterations that a solver reports, or 0 where it reports none."""
    info = extras.get("info", extras)
    for name in ("iter", "iterations", "iter_count"):
        value = info.get(name) if isinstance(info, dict) else getattr(info, name, None)
        if isinstance(value, int):
            return value
    return 0
