"""One planning step: linearise at the last plan, solve the QP, take the step. Once for RTI, until it stands still for SQP."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from hdvplan.errors import PlanError, SolverError
from hdvplan.jit import FloatArray
from hdvplan.planning.linearise import (
    ROWS_PER_EDGE,
    linearise_dynamics,
    linearise_limits,
    linearise_objective,
    write_inputs,
)
from hdvplan.planning.objectives import Residual
from hdvplan.planning.qp import Residuals, StageQp, StageShape, StageSolution, residuals
from hdvplan.planning.settings import Discretisation, PlannerSettings, Scheme
from hdvplan.planning.stations import Stations
from hdvplan.solvers.workspace import QpWorkspace, Status
from hdvplan.vehicle.body import edge_points
from hdvplan.vehicle.model import Vehicle

USABLE_RESIDUAL = 1e-3  # a QP solution whose recomputed primal residual exceeds this is not driven [m]
_STEEPEST = 1.3  # largest heading error a plan may reach: the model's domain ends at pi/2 [rad]
_INSIDE = 0.05  # smallest 1 - e_y k a plan may reach
_LENGTHS = (*(0.5**n for n in range(10)), 0.0)  # of a step; 0: the last plan stands


@dataclass(frozen=True)
class StepTimes:
    """Where one planning step spent its time [s]."""

    linearise: float
    update: float
    solve: float
    check: float
    total: float


@dataclass(frozen=True)
class Plan:
    """One planned motion over a horizon that starts at station ``first``."""

    first: int
    z: FloatArray  # (N+1, n) predicted states
    kappa: FloatArray  # (N,) [1/m], each held from its station to the next
    kappa_before: float
    status: Status  # of the last QP, as claimed by the solver
    usable: bool  # the last QP's recomputed residual allowed its step to be taken
    qp_count: int
    qp_iterations: int
    residuals: Residuals  # of the last QP, recomputed
    violation: float  # deepest predicted breach of a limit over the sampled points [m]; 0 when kept
    moved: float  # largest change of a state in the last iteration [m, rad]
    times: StepTimes


class Planner:
    """Plans one vehicle along one drive; keeps the QP, the solver and the last plan between steps."""

    def __init__(
        self,
        vehicle: Vehicle,
        stations: Stations,
        residual: Residual,
        settings: PlannerSettings,
        make_workspace: Callable[[StageShape], QpWorkspace],
    ) -> None:
        """Prepare the memory of all steps of a drive."""
        self._vehicle, self._stations, self._residual, self._settings = vehicle, stations, residual, settings
        self._units, self._points = vehicle.table(), edge_points(vehicle)
        self._limited = stations.limits.values.size > 0
        stages, n = settings.stages, vehicle.states
        self._z, self._kappa = np.zeros((stages + 1, n)), np.zeros(stages)
        self._aux_feet, self._aux_offset = np.zeros(stages + 1), np.zeros(stages + 1)
        self._feet = np.zeros((stages + 1, *self._points.shape[:2], 2))
        self._gaps = np.full(self._feet.shape, np.inf)
        self._qp = StageQp.empty(qp_shape(vehicle, settings, limited=self._limited))
        self._qp.A[:, n, n] = self._qp.B[:, n, 0] = 1.0
        self._qp.linear[:] = settings.elastic_weight
        self._workspace = make_workspace(self._qp.shape)
        self._guess = StageSolution.empty(self._qp.shape) if self._workspace.starts_warm else None
        self._last: int | None = None  # the last plan's first station

    def plan(self, first: int, z_start: FloatArray, kappa_before: float) -> Plan:
        """Plan from state ``z_start`` at station ``first``; ``kappa_before`` is the curvature held until there [1/m].

        Linearises first at the last plan shifted along the road; at the stationary geometry where there is none.

        Raises:
            PlanError: a point of the vehicle has no foot on the road.
            SolverError: the first plan of a drive could not be solved.

        """
        began = perf_counter()
        settings, qp = self._settings, self._qp
        by = None if self._last is None or first < self._last else first - self._last
        iterate = settings.scheme is Scheme.SQP or by is None  # the first plan has no predecessor to lean on
        self._last = None  # until this plan has succeeded
        spent = np.zeros(4)  # linearise, update, solve, check
        qp_count, qp_iterations, moved = 0, 0, np.inf
        fresh = self._shift(first, by)
        self._z[0] = z_start
        self._linearise(first, 0, 1)
        self._linearise(first, max(fresh - 1, 1), settings.stages + 1)
        spent[0] += perf_counter() - began
        while qp_count < settings.sqp_iterations:
            mark = perf_counter()
            write_inputs(
                self._kappa, kappa_before, self._vehicle.max_curvature, self._vehicle.max_curvature_rate * settings.step,
                settings.smoothness, qp.R, qp.r, qp.x_low, qp.x_high, qp.u_low, qp.u_high,
            )  # fmt: skip
            result = self._workspace.solve(qp, self._guess)
            spent[1] += perf_counter() - mark - result.solve_time
            spent[2] += result.solve_time
            qp_count, qp_iterations = qp_count + 1, qp_iterations + result.iterations
            mark = perf_counter()
            judged = residuals(qp, result.point)
            usable = bool(judged.primal <= USABLE_RESIDUAL)  # False for NaN too
            spent[3] += perf_counter() - mark
            if not usable:
                break
            mark = perf_counter()
            moved = self._take(result.point, first)
            self._linearise(first, 0, settings.stages + 1)  # judges all body points, and is the next QP's data
            spent[0] += perf_counter() - mark
            if not iterate or moved < settings.sqp_tolerance:
                break
        if not usable and by is None and qp_count == 1:
            msg = f"the first plan could not be solved: {self._workspace.name} says {result.status}, primal residual {judged.primal:.2g}"
            raise SolverError(msg, status=str(result.status), hint="try another --solver")
        self._last = first
        violation = max(0.0, -float(np.min(self._gaps[1:])))
        return Plan(
            first, self._z.copy(), self._kappa.copy(), kappa_before, result.status, usable, qp_count, qp_iterations, judged, violation,
            moved, StepTimes(spent[0], spent[1], spent[2], spent[3], perf_counter() - began),
        )  # fmt: skip

    def _shift(self, first: int, by: int | None) -> int:
        """Move motion and QP ``by`` stations on, to ``first``; return the stage from which on the motion is a new guess."""
        kept = 0 if by is None else max(self._settings.stages + 1 - by, 0)
        qp = self._qp
        if by and kept:
            for array in (self._z, self._kappa, self._aux_feet, self._feet, self._gaps, qp.A, qp.B, qp.c, qp.Q, qp.q, qp.G, qp.h):
                array[:-by] = array[by:].copy()
            for array in self._guess.multipliers() if self._guess else ():
                array[:-by] = array[by:].copy()
        self._fill(first, kept)
        return kept

    def _fill(self, first: int, begin: int) -> None:
        """Set the motion from stage ``begin`` on, and the curvature that leads there, to the road's stationary geometry."""
        end = first + self._settings.stages
        horizon, held = slice(first + begin, end + 1), max(begin - 1, 0)
        geometry, s = self._stations.centering, self._stations.s[horizon]
        self._z[begin:, 0], self._z[begin:, 1], self._z[begin:, 2:] = geometry.e_y[horizon], 0.0, geometry.beta[horizon]
        self._kappa[held:] = geometry.kappa[first + held : end]
        behind = _axles_behind(self._vehicle)
        single = len(self._vehicle.units) == 1
        self._aux_feet[begin:] = s + (self._vehicle.lead.wheelbase if single else -behind[-1])
        self._feet[begin:] = s[:, None, None, None] + (self._points[:, :, 0] - behind[:, None])[None, :, :, None]

    def _linearise(self, first: int, begin: int, end: int) -> None:
        """Write dynamics of the intervals from ``begin``, objective and limits of the stages max(begin, 1) <= i < end.

        Raises:
            PlanError: a point of the vehicle has no foot on the road.

        """
        stations, settings, qp, path = self._stations, self._settings, self._qp, self._stations.path
        horizon = slice(first, first + settings.stages + 1)
        road, part, limits = stations.road[:, horizon], self._residual, stations.limits
        linearise_dynamics(
            self._units, road, stations.curvature_between[horizon], settings.step, settings.discretisation is Discretisation.MIDPOINT,
            self._z, self._kappa, begin, min(end, settings.stages), qp.A, qp.B, qp.c,
        )  # fmt: skip
        begin = max(begin, 1)
        lost = linearise_objective(
            self._units, path.coefficients, path.s_first, path.spacing, road, self._z, part.lead[horizon], part.aux[horizon],
            part.target[horizon], self._aux_feet, self._aux_offset, begin, end, qp.Q, qp.q,
        )  # fmt: skip
        if lost < 0 and self._limited:
            lost = linearise_limits(
                self._units, self._points, path.coefficients, path.s_first, path.spacing, road, limits.values, limits.s_first,
                limits.spacing, settings.margin, self._z, self._feet, self._gaps, begin, end, qp.G, qp.h,
            )  # fmt: skip
        if lost >= 0:
            s, name = float(stations.s[first + lost]), self._vehicle.name
            msg = f"at s = {s:.1f} m a point of the {name} lies beyond the road's centre of curvature: the road bends too tightly for it"
            raise PlanError(msg, s_m=s, hint="smooth the road more (--smooth), or plan with a shorter vehicle")

    def _take(self, point: StageSolution, first: int) -> float:
        """Move the motion by the QP's step, shortened where it would leave the model's domain; return the largest change."""
        n = self._vehicle.states
        step, kappa_step = point.x[:, :n], point.x[1:, n]
        step[0] = 0.0  # given; a solver's residual must not move it
        k = self._stations.road[4, first : first + self._settings.stages + 1]
        for length in _LENGTHS:
            z = self._z + length * step
            if np.all(np.abs(z[:, 1]) < _STEEPEST) and np.all(1.0 - z[:, 0] * k > _INSIDE):
                break
        self._z += length * step
        self._kappa += length * kappa_step
        if self._guess is not None:  # the QP is in deviations from the motion, so the next one's solution is near zero
            for mine, solved in zip(self._guess.multipliers(), point.multipliers(), strict=True):
                mine[:] = solved
        return length * float(np.max(np.abs(step))) if length else float("inf")


def qp_shape(vehicle: Vehicle, settings: PlannerSettings, *, limited: bool) -> StageShape:
    """Return the sizes and zero pattern of a vehicle's QP: states (dz, d kappa_{i-1}), one input, rows per body edge."""
    n = vehicle.states + 1
    a = np.tril(np.ones((n, n), bool))  # an articulation angle depends on itself and what is ahead of it
    a[:-1, -1] = a[0, 1] = True
    a[-1, :-1] = False
    q = np.ones((n, n), bool)
    q[-1, :] = q[:, -1] = False
    g = np.arange(n) < n - 1
    rows = 2 * ROWS_PER_EDGE * len(vehicle.units) if limited else 0
    return StageShape(settings.stages, n, 1, rows, (n - 1,), a_pattern=a, q_pattern=q, g_pattern=g)


def _axles_behind(vehicle: Vehicle) -> FloatArray:
    """Return every axle's distance behind the lead rear axle on a straight, shape (units,) [m]."""
    steps = [ahead.hitch_offset + unit.wheelbase for ahead, unit in zip(vehicle.units, vehicle.units[1:], strict=False)]
    return np.concatenate([[0.0], np.cumsum(steps)])
