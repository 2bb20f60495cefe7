"""Every QP solver by the name that users give it, loaded only when asked for: one row a solver."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module, metadata
from importlib.util import find_spec
from typing import TYPE_CHECKING

from hdvplan.errors import SolverError, did_you_mean

if TYPE_CHECKING:  # names are listed and refused without loading the QP's kernels
    from hdvplan.qp.program import StageShape
    from hdvplan.qp.workspace import QpWorkspace, WorkspaceMaker

DEFAULT = "riccati"
_THROUGH = "qpsolvers/"


@dataclass(frozen=True)
class SolverInfo:
    """What a solver is and can do, as told by ``hdvplan solvers``."""

    name: str
    version: str | None  # None: not installed
    native: bool  # a workspace kept and updated in place, not rebuilt for every step
    warm_start: bool  # as used here
    detects_infeasible: bool
    note: str = ""


@dataclass(frozen=True)
class _Native:
    """A class of our own around a solver. Its parameters beside the shape may be ``elastic`` and ``tolerance``; see ``solver_named``."""

    home: str  # module:class
    distribution: str
    warm_start: bool
    detects_infeasible: bool
    note: str


@dataclass(frozen=True)
class _Generic:
    """A solver of qpsolvers: ``options`` are passed on, and each name in ``accuracy`` gets the tolerance."""

    distribution: str
    module: str
    note: str
    accuracy: tuple[str, ...] = ()
    tolerance: float | None = None  # None: the solver's own default
    options: Mapping[str, float] = field(default_factory=dict)


_NATIVE = {
    "riccati": _Native("hdvplan.solvers.riccati:RiccatiWorkspace", "hdvplan", True, False, "active set and interior point; our own"),
    "piqp": _Native("hdvplan.solvers.piqp:PiqpWorkspace", "piqp", False, True, "proximal interior point, sparse"),
    "clarabel": _Native("hdvplan.solvers.clarabel:ClarabelWorkspace", "clarabel", False, True, "interior point, sparse"),
    "osqp": _Native("hdvplan.solvers.osqp:OsqpWorkspace", "osqp", True, True, "operator splitting, sparse"),
}

# The solvers of qpsolvers that users may have; whichever is installed is offered. The tolerances bring each one to the same accuracy in
# metres, as ``path difference`` of a bench shows.
_GENERIC = {
    "clarabel": _Generic("clarabel", "clarabel", "interior point", ("tol_feas", "tol_gap_abs")),
    "cvxopt": _Generic("cvxopt", "cvxopt", "interior point", ("feastol", "abstol")),
    "daqp": _Generic("daqp", "daqp", "dual active set, dense", ("primal_tol",)),
    "ecos": _Generic("ecos", "ecos", "interior point; refuses absent bounds", ("feastol", "abstol")),
    "highs": _Generic("highspy", "highspy", "active set", ("primal_feasibility_tolerance", "dual_feasibility_tolerance")),
    "osqp": _Generic("osqp", "osqp", "operator splitting", ("eps_abs",), 1e-5, {"eps_rel": 0.0, "max_iter": 20_000}),
    "piqp": _Generic("piqp", "piqp", "proximal interior point", ("eps_abs", "eps_duality_gap_abs")),
    "proxqp": _Generic("proxsuite", "proxsuite", "augmented Lagrangian", ("eps_abs",), 1e-6, {"eps_rel": 0.0}),
    "qpalm": _Generic("qpalm", "qpalm", "augmented Lagrangian", ("eps_abs",), 1e-6, {"eps_rel": 0.0}),
    "quadprog": _Generic("quadprog", "quadprog", "dual active set; dense matrices only"),
    "scs": _Generic("scs", "scs", "operator splitting, as a cone program", ("eps_abs",), 1e-6, {"eps_rel": 0.0, "max_iters": 50_000}),
}


def solver_infos() -> list[SolverInfo]:
    """Return every solver that hdvplan knows, installed or not; the default first."""
    native = [
        SolverInfo(name, _version(row.distribution), True, row.warm_start, row.detects_infeasible, row.note)
        for name, row in _NATIVE.items()
    ]
    generic = [SolverInfo(_THROUGH + name, _version(row.distribution), False, False, True, row.note) for name, row in _GENERIC.items()]
    return native + generic


@dataclass(frozen=True)
class NamedSolver:
    """What makes workspaces of the solver called ``name``: a value that pickles, and is called with the programs' shape."""

    name: str
    tolerance: float | None = None  # None: the solver's own

    def __call__(self, shape: StageShape) -> QpWorkspace:
        """Return a workspace for programs of ``shape``."""
        return self._maker()(shape)

    def _maker(self) -> WorkspaceMaker:
        make, wanted = _maker(self.name), {} if self.tolerance is None else {"tolerance": self.tolerance}
        parameters = inspect.signature(make).parameters
        if wanted and "tolerance" not in parameters:
            msg = f"solver {self.name!r} has no tolerance that could be set"
            raise SolverError(msg)
        if "elastic" not in parameters:
            return lambda shape: make(shape, **wanted)
        from hdvplan.solvers.elastic import hard_first  # noqa: PLC0415 - loads the QP's kernels

        return hard_first(lambda shape, elastic: make(shape, elastic=elastic, **wanted))


def solver_named(name: str, tolerance: float | None = None) -> NamedSolver:
    """Return what makes a workspace of the solver called ``name``, and load it.

    ``tolerance`` is the one that the class names so: absolute, and measured by each solver in its own way. A class with a parameter
    ``elastic`` makes programs with hard rows first (``hdvplan.solvers.elastic``).

    Raises:
        SolverError: unknown, not installed, or without a tolerance that could be set.

    """
    check_solver(name)
    solver = NamedSolver(name, tolerance)
    solver._maker()  # noqa: SLF001 - an error now is better than one in the first plan
    return solver


def check_solver(name: str) -> None:
    """Refuse what ``solver_named`` would, without loading anything.

    Raises:
        SolverError: unknown, or not installed.

    """
    row = _row(name)
    module = row.module if isinstance(row, _Generic) else row.distribution
    if find_spec(module) is None:
        msg = f"solver {name!r} is not installed"
        raise SolverError(msg, hint=f"pip install {row.distribution}")


def tolerance_of(name: str) -> float | None:
    """Return the absolute tolerance that the solver called ``name`` is run with; None for its own default.

    Each solver measures it in its own way: equal numbers are not equal accuracies.
    """
    row = _row(name)
    if isinstance(row, _Generic):
        return row.tolerance
    parameter = inspect.signature(_maker(name)).parameters.get("tolerance")
    return None if parameter is None else float(parameter.default)


def settings_of(name: str, tolerance: float | None = None) -> str:
    """Return version and settings of the solver called ``name`` for the foot of a table: what a reader needs to run it alike."""
    row, used = _row(name), tolerance_of(name) if tolerance is None else tolerance
    said = [f"{name} {_version(row.distribution) or 'not installed'}"]
    if isinstance(row, _Generic):
        said += [] if used is None else [f"{option} {used:g}" for option in row.accuracy]
        said += [f"{option} {value:g}" for option, value in row.options.items()] or ([] if used is not None else ["defaults"])
    else:
        said += [] if used is None else [f"tolerance {used:g}"]
        said += [settings] if (settings := getattr(_maker(name), "settings", "")) else []
    return ", ".join(said)


def _row(name: str) -> _Native | _Generic:
    """Return what is known of a solver.

    Raises:
        SolverError: nothing.

    """
    row = _GENERIC.get(name.removeprefix(_THROUGH)) if name.startswith(_THROUGH) else _NATIVE.get(name)
    if row is not None:
        return row
    msg = f"unknown solver {name!r}"
    if name.startswith(_THROUGH):
        raise SolverError(msg, hint=f"through qpsolvers: {', '.join(_GENERIC)}")
    known = [info.name for info in solver_infos()]
    raise SolverError(msg, hint=did_you_mean(name, known, f"solvers: {', '.join(known)}"))


def _maker(name: str) -> Callable[..., QpWorkspace]:
    """Return the class of a solver, loaded now."""
    row = _row(name)
    if isinstance(row, _Native):
        module, _, workspace = row.home.partition(":")
        make: Callable[..., QpWorkspace] = getattr(import_module(module), workspace)
        return make
    from hdvplan.solvers.generic import GenericWorkspace  # noqa: PLC0415 - qpsolvers imports every solver it finds

    def generic(shape: StageShape, *, elastic: bool, tolerance: float | None = row.tolerance) -> QpWorkspace:
        accuracy = {} if tolerance is None else dict.fromkeys(row.accuracy, tolerance)
        return GenericWorkspace(shape, name.removeprefix(_THROUGH), {**accuracy, **row.options}, elastic=elastic)

    def exact(shape: StageShape, *, elastic: bool) -> QpWorkspace:
        return generic(shape, elastic=elastic)

    return generic if row.accuracy else exact


def _version(distribution: str) -> str | None:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return None
