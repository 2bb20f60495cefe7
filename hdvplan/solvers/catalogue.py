"""The QP solvers that hdvplan knows: where each one is found, what it can do, and how it is run here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

THROUGH = "qpsolvers/"  # before the name of a solver that is run by qpsolvers


@dataclass(frozen=True)
class Native:
    """A class of our own around a solver. Its parameters beside the shape may be ``elastic`` and ``tolerance``; see ``solver_named``."""

    home: str  # module:class
    distribution: str
    warm_start: bool
    detects_infeasible: bool
    note: str
    modules: Mapping[str, str] = field(default_factory=dict)  # of distributions that bring it, the best first; none: all are alike


@dataclass(frozen=True)
class Generic:
    """A solver of qpsolvers: ``options`` are passed on, and each name in ``accuracy`` gets the tolerance."""

    distribution: str
    module: str
    note: str
    accuracy: tuple[str, ...] = ()
    tolerance: float | None = None  # None: the solver's own default
    options: Mapping[str, float] = field(default_factory=dict)
    fitting: Mapping[str, bool | float] = field(default_factory=dict)  # of ``hdvplan.solvers.generic.Fitting``


NATIVE = {
    "riccati": Native("hdvplan.solvers.riccati:RiccatiWorkspace", "hdvplan", True, False, "active set and interior point; our own"),
    "riccati-ipm": Native("hdvplan.solvers.riccati:InteriorWorkspace", "hdvplan", False, False, "the interior point of riccati alone"),
    "riccati-warm": Native("hdvplan.solvers.riccati:WarmWorkspace", "hdvplan", True, False, "riccati without its screening"),
    "piqp": Native("hdvplan.solvers.piqp:PiqpWorkspace", "piqp", False, True, "proximal interior point, sparse"),
    "clarabel": Native("hdvplan.solvers.clarabel:ClarabelWorkspace", "clarabel", False, True, "interior point, sparse"),
    "hpipm": Native(
        "hdvplan.solvers.hpipm:HpipmWorkspace",
        "comma-deps-acados",
        False,
        False,
        "interior point with OCP structure; from acados' wheel or CasADi's",
        {"comma-deps-acados": "acados", "casadi": "casadi"},
    ),
    "acados": Native(
        "hdvplan.solvers.acados:AcadosWorkspace",
        "comma-deps-acados",
        False,
        False,
        "acados' layer of QPs: partial condensing and HPIPM",
        {"comma-deps-acados": "acados"},
    ),
    "daqp": Native("hdvplan.solvers.daqp:DaqpWorkspace", "daqp", False, True, "dual active set, dense, states eliminated"),
    "osqp": Native("hdvplan.solvers.osqp:OsqpWorkspace", "osqp", True, True, "operator splitting, sparse"),
    "proxqp": Native("hdvplan.solvers.proxqp:ProxqpWorkspace", "proxsuite", True, True, "augmented Lagrangian, sparse"),
}

# The solvers of qpsolvers that users may have; whichever is installed is offered. The tolerances bring each one to the same accuracy in
# metres, as ``path difference`` of a bench shows.
GENERIC = {
    "clarabel": Generic("clarabel", "clarabel", "interior point", ("tol_feas", "tol_gap_abs")),
    "cvxopt": Generic("cvxopt", "cvxopt", "interior point", ("feastol", "abstol"), None, {}, {"bounds_as_rows": True}),
    "daqp": Generic("daqp", "daqp", "dual active set, dense", ("primal_tol",)),
    "ecos": Generic(
        "ecos",
        "ecos",
        "interior point, as a cone program",
        ("feastol", "abstol"),
        None,
        {},
        {"dense": True, "bounds_as_rows": True, "ridge": 1e-9},
    ),
    "highs": Generic("highspy", "highspy", "active set", ("primal_feasibility_tolerance", "dual_feasibility_tolerance")),
    "osqp": Generic("osqp", "osqp", "operator splitting", ("eps_abs",), 1e-5, {"eps_rel": 0.0, "max_iter": 20_000}),
    "piqp": Generic("piqp", "piqp", "proximal interior point", ("eps_abs", "eps_duality_gap_abs")),
    "proxqp": Generic("proxsuite", "proxsuite", "augmented Lagrangian", ("eps_abs",), 1e-6, {"eps_rel": 0.0}),
    "qpalm": Generic("qpalm", "qpalm", "augmented Lagrangian", ("eps_abs",), 1e-6, {"eps_rel": 0.0}),
    "jaxopt_osqp": Generic(
        "jaxopt", "jaxopt", "operator splitting in JAX", ("tol",), 1e-5, {"maxiter": 20_000}, {"dense": True, "double": True}
    ),
    "qpax": Generic(
        "qpax", "qpax", "interior point in JAX", ("solver_tol",), 1e-6, {}, {"dense": True, "bounds_as_rows": True, "double": True}
    ),
    "quadprog": Generic(
        "quadprog", "quadprog", "dual active set, dense", (), None, {}, {"dense": True, "bounds_as_rows": True, "ridge": 1e-8}
    ),
    "scs": Generic("scs", "scs", "operator splitting, as a cone program", ("eps_abs",), 1e-6, {"eps_rel": 0.0, "max_iters": 50_000}),
}
