"""Every solver of qpsolvers, one new solver for each program: the fallback, and a witness against the native workspaces."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from importlib import import_module
from time import perf_counter
from typing import cast

import numpy as np
import scipy.sparse as sp

from hdvplan.plugins import error_text
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, Status
from hdvplan.solvers.sparse import SparseQp

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of whichever solver is installed, wanted or not: qpsolvers imports all of them
    import qpsolvers


@dataclass(frozen=True)
class Fitting:
    """What a solver cannot take as it is, and gets otherwise."""

    dense: bool = False  # dense matrices
    bounds_as_rows: bool = False  # finite bounds as rows: absent ones are no numbers that it understands
    double: bool = False  # double precision asked of JAX, which has single by default
    ridge: float = 0.0  # added to the Hessian's diagonal, of a solver that wants it positive definite


class GenericWorkspace:
    """One solver of qpsolvers behind the workspace protocol; nothing persists between solves."""

    starts_warm = False

    def __init__(self, shape: StageShape, solver: str, options: Mapping[str, float], fitting: Fitting, *, elastic: bool) -> None:
        """Lay out the pattern; ``options`` are the solver's own, by the names that qpsolvers passes on."""
        self.name = f"qpsolvers/{solver}"
        self._solver, self._options, self._fitting = solver, options, fitting
        self._form = SparseQp.of(shape, elastic=elastic)
        self._point = StageSolution.empty(shape)
        self._above, self._below = np.flatnonzero(np.isfinite(self._form.high)), np.flatnonzero(np.isfinite(self._form.low))
        eye = sp.eye_array(len(self._form.q), format="csr")
        self._bounds = sp.vstack([eye[self._above], -eye[self._below]], format="csc")

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:  # noqa: ARG002 - qpsolvers cannot pass multipliers on
        """Solve ``qp``; see ``QpWorkspace``. Whatever the solver throws becomes ``Status.FAILED`` with its reason."""
        started = perf_counter()
        qp.check()
        form = self._form
        form.load(qp)
        problem = self._problem()
        updated = perf_counter()
        try:
            with warnings.catch_warnings(), ExitStack() as doubled:
                warnings.simplefilter("ignore")  # about conversions to dense, which are the solver's own price
                if self._fitting.double:
                    doubled.enter_context(_in_double())
                solution = qpsolvers.solve_problem(problem, self._solver, **self._options)  # type: ignore[arg-type] # options differ by solver
        except Exception as error:  # noqa: BLE001 - a dozen solvers leak exceptions of their own; one bad solve must not end a benchmark
            return self._failed(updated - started, perf_counter() - updated, error_text(error))
        if solution.x is None:
            return self._failed(updated - started, perf_counter() - updated, "it returns no point")
        parts = ((solution.x, form.q), (solution.y, form.b), (solution.z, problem.h), (solution.z_box, form.q))
        v, equality, multipliers, bounds = (
            np.zeros(0 if like is None else len(like)) if part is None or len(part) == 0 else np.array(part) for part, like in parts
        )
        if self._fitting.bounds_as_rows:
            rows = len(form.h)
            bounds[self._above] += multipliers[rows : rows + len(self._above)]
            bounds[self._below] -= multipliers[rows + len(self._above) :]
        form.point(v, equality, multipliers[: len(form.h)], bounds, self._point)
        status = Status.SOLVED if solution.found else Status.FAILED
        reason = "" if solution.found else "it does not call its point a solution"
        return QpResult(status, self._point, _iterations(solution.extras), updated - started, perf_counter() - updated, reason=reason)

    def _problem(self) -> qpsolvers.Problem:
        form, fitting = self._form, self._fitting
        full = (form.P + sp.triu(form.P, 1).T + fitting.ridge * sp.eye_array(len(form.q))).tocsc()
        rows, right = form.G, form.h
        if fitting.bounds_as_rows:
            right = np.concatenate([right, form.high[self._above], -form.low[self._below]])
            rows = sp.csc_matrix(sp.vstack([rows, self._bounds], format="csc"))
        cost, equal, below = (part.toarray() if fitting.dense else part for part in (full, form.E, rows))
        G, h = (below, right) if len(right) else (None, None)
        low, high = (None, None) if fitting.bounds_as_rows else (form.low, form.high)
        return qpsolvers.Problem(cost, form.q, G, h, equal, form.b, low, high)

    def _failed(self, update_time: float, solve_time: float, reason: str) -> QpResult:
        self._point.x[:] = np.nan
        return QpResult(Status.FAILED, self._point, 0, update_time, solve_time, reason=reason)


def _in_double() -> AbstractContextManager[object]:
    return cast("AbstractContextManager[object]", import_module("jax").enable_x64(True))


def _iterations(extras: dict[str, object]) -> int:
    """Return the iterations that a solver reports, or 0 where it reports none."""
    info = extras.get("info", extras)
    for name in ("iter", "iterations", "iter_count"):
        value = info.get(name) if isinstance(info, dict) else getattr(info, name, None)
        if isinstance(value, int):
            return value
    return 0
