"""Every QP solver by its public name, loaded only when it is used."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib import import_module, metadata
from importlib.util import find_spec
from typing import cast

from hdvplan import plugins
from hdvplan.errors import SolverError
from hdvplan.qp.program import StageShape
from hdvplan.qp.workspace import QpWorkspace, WorkspaceMaker, backed
from hdvplan.solvers.catalogue import GENERIC, NATIVE, THROUGH, Generic, Native
from hdvplan.solvers.guards import LIMIT_S, ForeignWorkspace, hard_first

SolverClass = Callable[..., QpWorkspace]  # called with a shape, and with ``elastic`` and ``tolerance`` where it has them
DEFAULT = "riccati"


@dataclass(frozen=True)
class SolverInfo:
    """What a solver is and can do, as ``hdvplan solvers`` prints it."""

    name: str
    version: str | None  # None: not installed
    native: bool  # a workspace kept and updated in place, not rebuilt for every step
    warm_start: bool | None  # as used here; None: nothing is said before it is loaded
    detects_infeasible: bool | None
    note: str = ""


def solver_infos() -> list[SolverInfo]:
    """Return every solver that hdvplan knows, installed or not, the default first, and those that installed packages offer."""
    native = [SolverInfo(name, _version(row), True, row.warm_start, row.detects_infeasible, row.note) for name, row in NATIVE.items()]
    generic = [SolverInfo(THROUGH + name, _version(row), False, False, True, row.note) for name, row in GENERIC.items()]
    offered = [
        SolverInfo(name, point.dist.version if point.dist else "?", True, None, None, f"offered by {point.value}")
        for name, point in plugins.offers(plugins.SOLVER).items()
        if name not in NATIVE
    ]
    return native + generic + offered


@dataclass(frozen=True)
class SolverMaker:
    """What makes workspaces of one solver: a value that pickles where the solver does, and is called with the programs' shape."""

    solver: str | SolverClass
    tolerance: float | None = None  # None: the solver's own

    @property
    def name(self) -> str:
        """What records call the solver."""
        name = plugins.name_of(self.solver)
        return name if self.tolerance is None else f"{name}(tolerance={self.tolerance:g})"

    @property
    def is_ours(self) -> bool:
        """Whether the class around the solver is hdvplan's own."""
        return isinstance(self.solver, str) and self.solver in _ours()

    def __call__(self, shape: StageShape) -> QpWorkspace:
        """Return a workspace for programs of ``shape``."""
        return self.loaded()(shape)

    def loaded(self) -> WorkspaceMaker:
        """Return the same as a function whose library is loaded.

        Raises:
            SolverError: not installed, cannot be loaded, or without a tolerance that could be set.

        """
        make, wanted = _class(self.solver), {} if self.tolerance is None else {"tolerance": self.tolerance}
        parameters = _parameters(make)
        if wanted and "tolerance" not in parameters:
            msg = f"solver {self.name!r} has no tolerance that could be set"
            raise SolverError(msg)
        if "elastic" not in parameters:
            return lambda shape: self._guarded(make, shape, wanted)
        return hard_first(lambda shape, elastic: self._guarded(make, shape, {**wanted, "elastic": elastic}))

    def _guarded(self, make: SolverClass, shape: StageShape, given: Mapping[str, object]) -> QpWorkspace:
        if self.is_ours:
            return make(shape, **given)
        return ForeignWorkspace(self.name, lambda: make(shape, **given), shape)


def is_foreign(make: WorkspaceMaker) -> bool:
    """Tell whether a maker's solver comes from outside hdvplan, so that its times are measured here."""
    return isinstance(make, SolverMaker) and not make.is_ours


def solver_named(solver: str | SolverClass, tolerance: float | None = None) -> SolverMaker:
    """Return what makes workspaces of a solver, and load it.

    ``solver`` is a name of ``solver_infos``, ``package.module:Class``, ``file.py:Class``, or a class: called with the programs' shape, and
    with ``elastic`` and ``tolerance`` where it has parameters of these names. One with ``elastic`` makes programs with hard rows first
    (``hdvplan.solvers.guards``). ``tolerance`` is absolute, and each solver measures it in its own way.

    Raises:
        SolverError: unknown, not installed, cannot be loaded, or without a tolerance that could be set.

    """
    maker = solver if isinstance(solver, SolverMaker) else SolverMaker(solver)
    maker = maker if tolerance is None else replace(maker, tolerance=tolerance)
    if isinstance(maker.solver, str):
        check_solver(maker.solver)
    maker.loaded()  # an error now is better than one in the first plan
    return maker


def check_solver(name: str) -> None:
    """Refuse what ``solver_named`` would; of what is not the user's own nothing is loaded.

    Raises:
        SolverError: unknown, not installed, or cannot be loaded.

    """
    row = _row(name)
    if row is None:
        _class(name)
        return
    distribution, module = _wheel(row)
    if find_spec(module) is None:
        msg = f"solver {name!r} is not installed"
        raise SolverError(msg, hint=f"pip install {distribution}")


def tolerance_of(name: str) -> float | None:
    """Return the absolute tolerance that the solver called ``name`` is run with; None for its own default, or where it has none.

    Each solver measures it in its own way: equal numbers are not equal accuracies.
    """
    row = _row(name)
    if isinstance(row, Generic):
        return row.tolerance
    parameter = _parameters(_class(name)).get("tolerance")
    return None if parameter is None or parameter.default is parameter.empty else float(parameter.default)


def version_of(name: str) -> str | None:
    """Return the version of the solver called ``name``, of a file its content's digest; None where it is not installed or has none."""
    row = _row(name)
    return plugins.version_of(plugins.SOLVER, name) if row is None else _version(row)


def known_version(name: str) -> str | None:
    """Return ``version_of``, and None for a name that means nothing here: a record may be of another machine's solver, or of an object."""
    try:
        return version_of(name)
    except SolverError:
        return None


def settings_of(name: str) -> str:
    """Return version and settings of the solver called ``name`` for the foot of a table: what a reader needs to run it alike."""
    row, used = _row(name), tolerance_of(name)
    parts = [f"{name} {version_of(name) or ''}".rstrip()]
    if isinstance(row, Generic):
        parts += [] if used is None else [f"{option} {used:g}" for option in row.accuracy]
        parts += [f"{option} {value:g}" for option, value in row.options.items()] or ([] if used is not None else ["defaults"])
        parts += [what.replace("_", " ") if value is True else f"{what} {value:g}" for what, value in row.fitting.items()]
    else:
        parts += [] if used is None else [f"tolerance {used:g}"]
        parts += [str(settings)] if (settings := getattr(_class(name), "settings", "")) else []
    return ", ".join(parts)


def _ours() -> set[str]:
    return {*NATIVE, *(THROUGH + name for name in GENERIC)}


def _row(name: str) -> Native | Generic | None:
    """Return what is known of a solver; None of one that a reference or an installed package's offer names."""
    row = GENERIC.get(name.removeprefix(THROUGH)) if name.startswith(THROUGH) else NATIVE.get(name)
    if row is not None or plugins.is_reference(name) or name in plugins.offers(plugins.SOLVER):
        return row
    if name.startswith(THROUGH):
        msg = f"unknown solver {name!r}"
        raise SolverError(msg, hint=f"through qpsolvers: {', '.join(GENERIC)}")
    raise plugins.unknown(plugins.SOLVER, name, [info.name for info in solver_infos()])


def _class(solver: str | SolverClass) -> SolverClass:
    if not isinstance(solver, str):
        return solver
    row = _row(solver)
    if row is None:
        return cast("SolverClass", plugins.load(plugins.SOLVER, solver))
    if isinstance(row, Native):
        module, _, workspace = row.home.partition(":")
        return cast("SolverClass", getattr(import_module(module), workspace))
    from hdvplan.solvers.generic import Fitting, GenericWorkspace  # noqa: PLC0415 - qpsolvers imports every solver it finds

    fitting = Fitting(**row.fitting)  # type: ignore[arg-type] # its fields by their names

    def generic(shape: StageShape, *, elastic: bool, tolerance: float | None = row.tolerance) -> QpWorkspace:
        accuracy = {} if tolerance is None else dict.fromkeys(row.accuracy, tolerance)
        return GenericWorkspace(shape, solver.removeprefix(THROUGH), {**accuracy, **row.options}, fitting, elastic=elastic)

    def exact(shape: StageShape, *, elastic: bool) -> QpWorkspace:
        return generic(shape, elastic=elastic)

    return generic if row.accuracy else exact


def _parameters(make: SolverClass) -> Mapping[str, inspect.Parameter]:
    """Return the parameters of a solver's class; none where it does not tell them."""
    try:
        return inspect.signature(make).parameters
    except (TypeError, ValueError):
        return {}


def _wheel(row: Native | Generic) -> tuple[str, str]:
    """Return the distribution that brings a solver, and its module; of several the first that is installed."""
    if isinstance(row, Generic):
        return row.distribution, row.module
    known = row.modules or {row.distribution: row.distribution}
    return next(((name, module) for name, module in known.items() if find_spec(module)), next(iter(known.items())))


def _version(row: Native | Generic) -> str | None:
    try:
        return metadata.version(_wheel(row)[0])
    except metadata.PackageNotFoundError:
        return None


def dependable(solver: str | SolverClass) -> WorkspaceMaker:
    """Return the maker of a solver's workspaces that has another solver solve what it fails at; with a time limit where it is not ours.

    Raises:
        SolverError: unknown, not installed, or cannot be loaded.

    """
    maker = solver_named(solver)
    alike = isinstance(maker.solver, str) and maker.solver.startswith(DEFAULT)
    return backed(maker, SolverMaker("piqp" if alike else DEFAULT), limit_s=None if maker.is_ours else LIMIT_S)
