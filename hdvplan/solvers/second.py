"""Which solver stands behind which: for what the first one fails at, see ``hdvplan.qp.judge``."""

from __future__ import annotations

from hdvplan.qp.judge import backed
from hdvplan.qp.workspace import WorkspaceMaker
from hdvplan.solvers.registry import DEFAULT, SolverClass, home_of, solver_named

LIMIT_S = 10.0  # for one program: a thousand times what the slowest known solver needs


def dependable(solver: str | SolverClass) -> WorkspaceMaker:
    """Return the maker of a solver's workspaces that has another solver solve what it fails at; with a time limit where it is not ours.

    Raises:
        SolverError: unknown, not installed, or cannot be loaded.

    """
    maker = solver_named(solver)
    ours = isinstance(maker.solver, str) and home_of(maker.solver) is not None
    alike = isinstance(maker.solver, str) and maker.solver.startswith(DEFAULT)
    return backed(maker, solver_named("piqp" if alike else DEFAULT), limit_s=None if ours else LIMIT_S)
