"""Every solver that can be made here, with what can be asked of its accuracy."""

from dataclasses import dataclass

import pytest

from hdvplan.qp.program import StageQp, StageSolution
from hdvplan.qp.workspace import WorkspaceMaker
from hdvplan.solvers.registry import solver_infos, solver_named
from tests.core.programs import dense, staged


@dataclass(frozen=True)
class Contestant:
    """A maker of workspaces, and how far from the optimum its points may lie."""

    name: str
    make: WorkspaceMaker
    agree: float  # largest difference of a state or an input


# Interior points at 1e-8 on strongly convex inputs end within the root of it, times conditioning; splitting methods stop at
# 1e-5 or 1e-6 on residuals, which unscaled multipliers of 10 and chains of six stages turn into some 1e-3. HPIPM ends
# at 1e-6, called by acados, too.
NATIVE = {
    "riccati": 1e-5,
    "riccati-ipm": 1e-5,
    "riccati-warm": 1e-5,
    "piqp": 1e-5,
    "clarabel": 1e-5,
    "osqp": 2e-3,
    "hpipm": 1e-4,
    "acados": 1e-4,
    "daqp": 1e-5,
    "proxqp": 1e-3,
}
GENERIC = {
    "clarabel": 1e-5, "cvxopt": 1e-3, "daqp": 1e-5, "ecos": 1e-3, "highs": 1e-5, "osqp": 2e-3, "piqp": 1e-5,
    "proxqp": 1e-3, "qpalm": 1e-3, "quadprog": 1e-5, "scs": 2e-3,
}  # fmt: skip
_INSTALLED = {info.name for info in solver_infos() if info.version is not None}


def native(name: str) -> Contestant:
    """Return one of the persistent workspaces, or skip the test where its library is not installed."""
    if name not in _INSTALLED:
        pytest.skip(f"{name} is not installed")
    return Contestant(name, solver_named(name), NATIVE[name])


def generic(name: str) -> Contestant:
    """Return a solver through qpsolvers, or skip the test where it is not installed."""
    full = f"qpsolvers/{name}"
    if full not in _INSTALLED:
        pytest.skip(f"{name} is not installed")
    return Contestant(full, solver_named(full), GENERIC.get(name, 0.0))


def optimum(qp: StageQp) -> StageSolution:
    """Return the solution of the dense program, rows elastic, by another route."""
    return staged(qp, *dense(qp).solve())
