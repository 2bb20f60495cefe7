"""One planning step: linearise at the last plan, solve the QP, take the step. Once for RTI, until it stands still for SQP.

A step is halved as long as it does not improve the motion, and an RTI plan that would break a limit gets a few QPs more: neither
happens on a road with room, where RTI is one QP a step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from hdvplan.errors import PlanError, SolverError
from hdvplan.jit import FloatArray
from hdvplan.planning.balanced import Balancing
from hdvplan.planning.limits import ROWS_PER_EDGE
from hdvplan.planning.linearise import linearise, write_inputs
from hdvplan.planning.merit import defect_prices, merit
from hdvplan.planning.motion import Motion, flat_stages, keep_steering, shift_stages, take_step
from hdvplan.planning.objectives import Balanced, Furthest, Residual
from hdvplan.planning.reach import linearise_reach, watched_points, write_epigraph
from hdvplan.planning.settings import Discretisation, PlannerSettings, Scheme
from hdvplan.planning.stations import Stations
from hdvplan.planning.steering import Steering
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.residuals import Residuals, residuals
from hdvplan.qp.workspace import QpWorkspace, Status
from hdvplan.vehicle.body import axis_points, edge_points
from hdvplan.vehicle.model import Vehicle

USABLE_RESIDUAL = 1e-3  # a QP solution whose recomputed primal residual exceeds this is not driven [m]
_SHORTEST_STEP = 1.0 / 32.0  # a step is halved no further; some of it must be taken, as the vehicle has moved on
_REPAIRED_M = 0.01  # RTI leaves a smaller predicted violation to the next step
_STALLED = 1e-3  # SQP ends when a shortened step lowers the merit by a smaller share than this


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
    violation: float  # deepest predicted breach of a limit over all bodies' edges [m]; 0 when kept
    moved: float  # largest change of a state in the last iteration [m, rad]
    merit: float  # of the planned motion, at the last QP's prices
    halvings: int  # how often a step was halved
    times: StepTimes


class Planner:
    """Plans one vehicle along one drive; keeps the QP, the solver and the last plan between steps."""

    def __init__(
        self,
        vehicle: Vehicle,
        stations: Stations,
        centred: Residual | Furthest | Balanced,
        settings: PlannerSettings,
        make_workspace: Callable[[StageShape], QpWorkspace],
    ) -> None:
        """Prepare the memory of all steps of a drive."""
        self._vehicle, self._stations, self._settings = vehicle, stations, settings
        self._units, self._points, self._axis = vehicle.table(), edge_points(vehicle), axis_points(vehicle)
        self._limited = stations.limits.values.size > 0
        self._margin = stations.margin + settings.margin
        self._max_change = vehicle.max_curvature_rate * settings.step
        self._residual = centred if isinstance(centred, Residual) else centred.beside
        self._reach_points, self._reach_half = watched_points(vehicle, centred)
        self._balancing = Balancing.of(vehicle, stations, centred, settings.stages) if isinstance(centred, Balanced) else None
        self._steering = Steering.of(vehicle, stations) if vehicle.active else None
        self._rounds = min(settings.sqp_iterations, centred.rounds) if isinstance(centred, Balanced) else settings.sqp_iterations
        self._motion = Motion.empty(vehicle, settings.stages, self._reach_points, axle=self._residual.axle)
        self._midpoint = settings.discretisation is Discretisation.MIDPOINT
        watched = self._reach_points.shape[0] * self._reach_points.shape[1]
        rows = rows_per_edge(settings, limited=self._limited, two_regions=stations.limits.two_regions)
        qp = self._qp = StageQp.empty(qp_shape(vehicle, settings, rows_per_edge=rows, watched=watched))
        n, own = vehicle.states, qp.shape.rows - 2 * watched  # rows of limits come first
        qp.A[:, n, n] = qp.B[:, n, 0] = 1.0
        for wheel in range(len(vehicle.active)):
            qp.B[:, vehicle.rigid_states + wheel, 1 + wheel] = 1.0
        for row in range(own):
            soft = row % rows >= ROWS_PER_EDGE
            qp.linear[:, row] = 0.0 if soft else settings.elastic_weight
            qp.quadratic[:, row] = 2.0 * settings.overhang_cost if soft else settings.elastic_growth
        self._limit_rows, self._reach_rows = (qp.G[:, :own], qp.h[:, :own]), (qp.G[:, own:], qp.h[:, own:])
        self._workspace = make_workspace(qp.shape)
        self._guess = StageSolution.empty(qp.shape) if self._workspace.starts_warm else None
        multipliers = self._guess.multipliers() if self._guess else ()
        self._moving = self._motion.by_stage() + flat_stages((qp.A, qp.B, qp.c, qp.Q, qp.q, qp.G, qp.h, *multipliers))
        self._last: int | None = None  # the last plan's first station
        self._fixed = 0
        self._before, self._prices = (np.empty_like(self._motion.z), np.empty_like(self._motion.kappa)), np.zeros(vehicle.rigid_states)

    def plan(self, first: int, z_start: FloatArray, kappa_before: float) -> Plan:
        """Plan from state ``z_start`` at station ``first``; ``kappa_before`` is the curvature held until there [1/m].

        Linearises first at the last plan shifted along the road; at the stationary geometry where there is none.

        Raises:
            PlanError: a point of the vehicle has no foot on the road.
            SolverError: the first plan of a drive could not be solved.

        """
        began = perf_counter()
        settings, qp, motion = self._settings, self._qp, self._motion
        by = None if self._last is None or first < self._last else first - self._last
        iterate = settings.scheme is Scheme.SQP or by is None  # the first plan has no predecessor to lean on
        self._last = None  # until this plan has succeeded
        linearising, updating, solving, checking = 0.0, 0.0, 0.0, 0.0  # [s]
        qp_count, qp_iterations, moved, halvings, violation = 0, 0, np.inf, 0, 0.0
        k = self._stations.road[4, first : first + settings.stages + 1]
        kept = 0 if by is None else max(settings.stages + 1 - by, 0)  # stages that the last plan still covers
        if by and kept:
            shift_stages(self._moving, by)
        if self._balancing is not None and by is None:
            self._balancing.begin()
        self._fixed = 0 if iterate else settings.executed  # stages that no later program can change
        if self._reach_points.size:
            write_epigraph(qp, self._vehicle.states + 1, self._reach_rows[0])
        motion.guess(self._stations, first, kept)
        keep_steering(motion.kappa, kappa_before, max(kept - 1, 0), self._vehicle.max_curvature, self._max_change)
        motion.z[0] = z_start
        if self._steering is not None:
            self._steering.keep(motion.z, max(kept, 1))
        self._linearise(first, max(kept, 1))
        linearising += perf_counter() - began
        while qp_count < self._rounds:
            mark = perf_counter()
            write_inputs(
                motion.kappa, kappa_before, self._vehicle.max_curvature, self._max_change, settings.smoothness, qp.R, qp.r, qp.x_low,
                qp.x_high, qp.u_low, qp.u_high,
            )  # fmt: skip
            if self._steering is not None:
                self._steering.write(first, motion.z, qp)
            result = self._workspace.solve(qp, self._guess)
            updating += perf_counter() - mark - result.solve_time
            solving += result.solve_time
            qp_count, qp_iterations = qp_count + 1, qp_iterations + result.iterations
            mark = perf_counter()
            judged = residuals(qp, result.point)
            usable = bool(judged.primal <= USABLE_RESIDUAL)  # False for NaN too
            checking += perf_counter() - mark
            if not usable:
                violation = self._violation()
                break
            mark = perf_counter()
            held = defect_prices(result.point.dynamics, result.point.rows, self._prices)
            worth = self._merit(first, kappa_before) if held else np.inf
            moved, value, halved = self._step(first, result.point.x, k, kappa_before, worth)
            halvings, violation = halvings + halved, self._violation()
            if self._guess is not None:  # the QP is in deviations from the motion: the next solution is near zero
                for mine, solved in zip(self._guess.multipliers(), result.point.multipliers(), strict=True):
                    mine[:] = solved
            linearising += perf_counter() - mark
            iterating = iterate or (qp_count <= settings.rti_repairs and violation > _REPAIRED_M)
            if not iterating or moved < settings.sqp_tolerance or (halved and worth - value < _STALLED * worth):
                break
        if not usable and by is None and qp_count == 1:
            msg = f"the first plan could not be solved: {self._workspace.name} says {result.status}, primal residual {judged.primal:.2g}"
            raise SolverError(msg, status=str(result.status), hint="try another --solver")
        self._last = first
        return Plan(
            first, motion.z.copy(), motion.kappa.copy(), kappa_before, result.status, usable, qp_count, qp_iterations, judged,
            violation, moved, self._merit(first, kappa_before), halvings,
            StepTimes(linearising, updating, solving, checking, perf_counter() - began),
        )  # fmt: skip

    def _step(self, first: int, x: FloatArray, k: FloatArray, kappa_before: float, worth: float) -> tuple[float, float, int]:
        """Move by a QP's solution ``x``, halved until the merit is no larger than ``worth``; return the move, merit and halvings.

        Linearises at the motion that it leaves: that judges all body edges, and is the next QP's data. With ``worth`` infinite,
        where no limit holds the motion, the step is taken whole.
        """
        motion, settings, halvings = self._motion, self._settings, 0
        if np.isinf(worth):
            moved = take_step(motion.z, motion.kappa, x, k, 1.0)
            self._linearise(first, 1)
            return moved, worth, 0
        for kept, array in zip(self._before, (motion.z, motion.kappa), strict=True):
            kept[:] = array
        while True:
            moved = take_step(motion.z, motion.kappa, x, k, 0.5**halvings)
            self._linearise(first, 1)
            value = self._merit(first, kappa_before)
            if value <= worth or moved < settings.sqp_tolerance or 0.5**halvings <= _SHORTEST_STEP:
                return moved, value, halvings
            halvings += 1
            motion.z[:], motion.kappa[:] = self._before

    def _violation(self) -> float:
        return max(0.0, -float(np.min(self._motion.gaps[1:]))) if self._limited else 0.0

    def _merit(self, first: int, kappa_before: float) -> float:
        qp, balancing, steering = self._qp, self._balancing, self._steering
        measured, stages = (0.0, 0) if balancing is None else (float(balancing.value[0]), balancing.stages)
        if steering is not None:
            measured += steering.cost(first, self._motion.z)
        return merit(
            qp.Q, qp.q, qp.c, qp.h, qp.linear, qp.quadratic, self._limit_rows[1].shape[1], self._motion.kappa, kappa_before,
            self._settings.smoothness, self._prices, measured, stages,
        )  # fmt: skip

    def _linearise(self, first: int, begin: int) -> None:
        """Linearise at the motion from stage ``begin`` on, and at its first state.

        Raises:
            PlanError: a point of the vehicle has no foot on the road.

        """
        stations, settings, qp, motion = self._stations, self._settings, self._qp, self._motion
        path, limits, part = stations.path, stations.limits, self._residual
        horizon = slice(first, first + settings.stages + 1)
        lost = linearise(
            self._units, part.axle, self._points, self._axis, path.coefficients, path.s_first, path.spacing, stations.road[:, horizon],
            stations.curvature_between[horizon], stations.around[:, horizon], settings.step, self._midpoint, part.lead[horizon],
            part.aux[horizon], part.target[horizon], limits.values, limits.s_first, limits.spacing, self._margin[horizon], motion.z,
            motion.kappa, motion.aux_feet, motion.axis_feet, motion.feet, motion.gaps, begin, qp.A, qp.B, qp.c, qp.Q, qp.q,
            *self._limit_rows,
        )  # fmt: skip
        if lost < 0 and begin == 1 and self._balancing is not None:
            self._balancing.write(first, self._fixed, motion.z, qp.Q, qp.q)
        if lost < 0 and self._reach_points.size:
            lost = linearise_reach(
                self._units, self._reach_points, self._reach_half, path.coefficients, path.s_first, path.spacing,
                stations.road[:, horizon], motion.z, motion.reach_feet, begin, len(motion.z), *self._reach_rows,
            )  # fmt: skip
        if lost >= 0:
            s, name = float(stations.s[first + lost]), self._vehicle.name
            msg = f"at s = {s:.1f} m a point of the {name} lies beyond the road's centre of curvature: the road bends too tightly for it"
            raise PlanError(msg, s_m=s, hint="smooth the road more (--smooth), or plan with a shorter vehicle")


def rows_per_edge(settings: PlannerSettings, *, limited: bool, two_regions: bool) -> int:
    """Return how many rows every edge of a body has: none without limits; two more where overhangs may reach further at a cost."""
    if not limited:
        return 0
    return 2 * ROWS_PER_EDGE if two_regions and settings.overhang_cost > 0.0 else ROWS_PER_EDGE


def qp_shape(vehicle: Vehicle, settings: PlannerSettings, *, rows_per_edge: int, watched: int = 0) -> StageShape:
    """Return the sizes and zero pattern of a vehicle's QP: states (dz, d kappa_{i-1}), one input, rows per body edge.

    Every axle that the plan steers has one input more, the change of its wheels' angle, which is a bounded state. With ``watched``
    points there is one state more, their largest reach t, one input more that sets it, and two rows a point.
    """
    n, rigid, more = vehicle.states, vehicle.rigid_states, int(watched > 0)
    size = n + 1 + more
    a, q = np.zeros((size, size), bool), np.zeros((size, size), bool)
    a[:rigid, :rigid] = np.tril(np.ones((rigid, rigid), bool))  # an articulation angle depends on itself and what is ahead of it
    a[0, 1] = a[n, n] = a[-1, -1] = True
    a[:rigid, n] = q[:rigid, :rigid] = True
    wheels = np.arange(rigid, n)
    for unit, wheel in zip(vehicle.active, wheels, strict=True):
        a[1 + unit : rigid, wheel] = a[wheel, wheel] = q[wheel, wheel] = True
    g = np.arange(size) != n
    g[wheels] = False
    rows = 2 * rows_per_edge * len(vehicle.units)
    return StageShape(
        settings.stages, size, 1 + len(wheels) + more, rows + 2 * watched, (n, *map(int, wheels)), a_pattern=a, q_pattern=q, g_pattern=g
    )
