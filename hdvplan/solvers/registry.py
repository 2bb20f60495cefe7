"""Every QP solver by the name that users give it, loaded only when asked for."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import metadata
from importlib.util import find_spec
from typing import TYPE_CHECKING

from hdvplan import __version__
from hdvplan.errors import SolverError, did_you_mean

if TYPE_CHECKING:  # names are listed and refused without loading the QP's kernels
    from hdvplan.qp.workspace import WorkspaceMaker

DEFAULT = "riccati"
_NATIVE = ("riccati", "piqp", "clarabel", "osqp")
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
class _Generic:
    distribution: str
    module: str
    note: str


# The solvers of qpsolvers that users may have; whichever is installed is offered.
_GENERIC = {
    "clarabel": _Generic("clarabel", "clarabel", "interior point"),
    "cvxopt": _Generic("cvxopt", "cvxopt", "interior point"),
    "daqp": _Generic("daqp", "daqp", "dual active set, dense"),
    "ecos": _Generic("ecos", "ecos", "interior point; refuses absent bounds"),
    "highs": _Generic("highspy", "highspy", "active set"),
    "osqp": _Generic("osqp", "osqp", "operator splitting"),
    "piqp": _Generic("piqp", "piqp", "proximal interior point"),
    "proxqp": _Generic("proxsuite", "proxsuite", "augmented Lagrangian"),
    "qpalm": _Generic("qpalm", "qpalm", "augmented Lagrangian"),
    "quadprog": _Generic("quadprog", "quadprog", "dual active set; dense matrices only"),
    "scs": _Generic("scs", "scs", "operator splitting, as a cone program"),
}


def solver_infos() -> list[SolverInfo]:
    """Return every solver that hdvplan knows, installed or not; the default first."""
    native = [
        SolverInfo("riccati", __version__, True, True, False, "active set and interior point; our own"),
        SolverInfo("piqp", _version("piqp"), True, False, True, "proximal interior point, sparse"),
        SolverInfo("clarabel", _version("clarabel"), True, False, True, "interior point, sparse"),
        SolverInfo("osqp", _version("osqp"), True, True, True, "operator splitting, sparse"),
    ]
    generic = [
        SolverInfo(f"{_THROUGH}{name}", _version(entry.distribution), False, False, True, entry.note) for name, entry in _GENERIC.items()
    ]
    return native + generic


def solver_named(name: str) -> WorkspaceMaker:
    """Return what makes a workspace of the solver called ``name``.

    Raises:
        SolverError: unknown, or not installed.

    """
    check_solver(name)
    match name:
        case "riccati":
            from hdvplan.solvers.riccati import RiccatiWorkspace  # noqa: PLC0415 - only the chosen solver is loaded

            return RiccatiWorkspace
        case "piqp":
            from hdvplan.solvers.elastic import hard_first  # noqa: PLC0415
            from hdvplan.solvers.piqp import PiqpWorkspace  # noqa: PLC0415

            return hard_first(lambda shape, elastic: PiqpWorkspace(shape, elastic=elastic))
        case "clarabel":
            from hdvplan.solvers.clarabel import ClarabelWorkspace  # noqa: PLC0415
            from hdvplan.solvers.elastic import hard_first  # noqa: PLC0415

            return hard_first(lambda shape, elastic: ClarabelWorkspace(shape, elastic=elastic))
        case "osqp":
            from hdvplan.solvers.elastic import hard_first  # noqa: PLC0415
            from hdvplan.solvers.osqp import OsqpWorkspace  # noqa: PLC0415

            return hard_first(lambda shape, elastic: OsqpWorkspace(shape, elastic=elastic))
    from hdvplan.solvers.elastic import hard_first  # noqa: PLC0415
    from hdvplan.solvers.generic import GenericWorkspace  # noqa: PLC0415 - qpsolvers imports every solver it finds

    solver = name.removeprefix(_THROUGH)
    return hard_first(lambda shape, elastic: GenericWorkspace(shape, solver, elastic=elastic))


def check_solver(name: str) -> None:
    """Refuse what ``solver_named`` would, without loading anything.

    Raises:
        SolverError: unknown, or not installed.

    """
    solver = name.removeprefix(_THROUGH)
    if name in _NATIVE:
        return
    if not name.startswith(_THROUGH):
        known = [info.name for info in solver_infos()]
        msg = f"unknown solver {name!r}"
        raise SolverError(msg, hint=did_you_mean(name, known, f"solvers: {', '.join(known)}"))
    if solver not in _GENERIC:
        msg = f"unknown solver {name!r}"
        raise SolverError(msg, hint=f"through qpsolvers: {', '.join(_GENERIC)}")
    if find_spec(_GENERIC[solver].module) is None:
        msg = f"solver {name!r} is not installed"
        raise SolverError(msg, hint=f"pip install {_GENERIC[solver].distribution}")


def tolerance_of(name: str) -> float | None:
    """Return the absolute tolerance that the solver called ``name`` is run with; None for its own default.

    Each solver measures it in its own way: equal numbers are not equal accuracies.
    """
    match name:
        case "riccati":
            from hdvplan.solvers.riccati import TOLERANCE as tolerance  # noqa: N811, PLC0415 - see above
        case "piqp":
            from hdvplan.solvers.piqp import TOLERANCE as tolerance  # noqa: N811, PLC0415
        case "clarabel":
            from hdvplan.solvers.clarabel import TOLERANCE as tolerance  # noqa: N811, PLC0415
        case "osqp":
            from hdvplan.solvers.osqp import TOLERANCE as tolerance  # noqa: N811, PLC0415
        case _:
            from hdvplan.solvers.generic import OPTIONS  # noqa: PLC0415

            return OPTIONS.get(name.removeprefix(_THROUGH), {}).get("eps_abs")
    return tolerance


def _version(distribution: str) -> str | None:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return None
