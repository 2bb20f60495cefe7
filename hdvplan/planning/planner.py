"""One planning step: linearise at the last plan, solve the QP, take the step. Once for RTI, to convergence for SQP.

RTI is the real-time iteration, SQP sequential quadratic programming. A step is halved as long as it does not improve the motion, and
an RTI plan that would break a limit gets a few QPs more: neither happens on a road with room, where RTI is one QP a step.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter, process_time

import numpy as np

from hdvplan.errors import PlanError, SolverError
from hdvplan.jit import FloatArray
from hdvplan.planning.assembly import assemble
from hdvplan.planning.merit import defect_price, l1_weights
from hdvplan.planning.motion import guess, shift, shift_rows, take_step
from hdvplan.planning.objectives import Goal
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.term import Horizon
from hdvplan.qp.judge import USABLE_RESIDUAL, Judge
from hdvplan.qp.program import StageSolution, by_stage
from hdvplan.qp.residuals import Residuals
from hdvplan.qp.workspace import QpResult, Status, WorkspaceMaker
from hdvplan.vehicle.model import Vehicle

_SHORTEST_STEP = 1.0 / 32.0  # a step is halved no further; some of it must be taken, as the vehicle has moved on
_REPAIRED_M = 0.01  # RTI leaves a smaller predicted violation to the next step
_STALLED = 1e-3  # SQP ends when a shortened step lowers the merit by a smaller share than this


@dataclass
class StepTimes:
    """Where one planning step spent its time [s]."""

    linearise: float = 0.0
    update: float = 0.0
    solve: float = 0.0
    check: float = 0.0
    total: float = 0.0  # of the step; without loading
    loading: float = 0.0  # code that a solver needed for the first time in this process
    cpu: float = 0.0  # processor time of the step, all threads; of one that had to load anything its total


@dataclass(frozen=True)
class Plan:
    """One planned motion over a horizon that starts at station ``first``."""

    first: int
    z: FloatArray  # (N+1, n) predicted states
    kappa: FloatArray  # (N,) [1/m], each held from its station to the next
    kappa_before: float
    status: Status  # of the last QP, as claimed by the solver
    reason: str  # why the last QP has no solution, in the solver's words
    usable: bool  # the last QP's recomputed residual allowed its step to be taken
    instead: str  # why another solver than the one that was asked for solved a QP of this step; the last such reason
    qp_count: int
    qp_iterations: int
    residuals: Residuals  # of the last QP, recomputed
    violation: float  # deepest predicted breach of a limit over all bodies' edges [m]; 0 when kept
    moved: float  # largest change of a state in the last iteration [m, rad]
    merit: float | None  # of the planned motion, at the last QP's weights; None where no limit binds, and nothing is judged by it
    halvings: int  # how often a step was halved
    times: StepTimes


class Planner:
    """Plans one vehicle along one drive; keeps the QP, the solver and the last plan between steps."""

    def __init__(self, vehicle: Vehicle, stations: Stations, goal: Goal, settings: PlannerSettings, make_workspace: WorkspaceMaker) -> None:
        """Prepare the memory of all steps of a drive."""
        self._scene, self._parts = assemble(vehicle, stations, goal, settings)
        self._rounds = min(settings.sqp_iterations, goal.rounds or settings.sqp_iterations)
        qp, motion = self._scene.qp, self._scene.motion
        workspace = make_workspace(qp.shape)
        self._workspace = workspace if isinstance(workspace, Judge) else Judge(workspace)
        self._guess = StageSolution.empty(qp.shape) if self._workspace.starts_warm else None
        multipliers = () if self._guess is None else self._guess.numbers
        memory = (array for part in self._parts for array in part.memory)
        self._moving = (by_stage(motion.stages), by_stage(qp.stages), *multipliers, *memory)
        wheels = [vehicle.units[axle] for axle in vehicle.active]
        self._most = np.array([vehicle.max_curvature, *(unit.max_steering_angle for unit in wheels)])
        self._change = settings.step * np.array([vehicle.max_curvature_rate, *(unit.max_steering_rate for unit in wheels)])
        self._states, self._curvatures = np.ascontiguousarray(stations.centring.states), stations.centring.kappa
        self._weights, self._before = np.zeros(vehicle.rigid_states), np.empty_like(motion.stages)
        self._last: int | None = None  # the last plan's first station
        self._binding = True  # whether limits bind in the last program
        self._priced = False  # whether a merit was ever asked for
        self._guessed = True  # whether the last solution helps with the next
        self._reaches = 0  # the station up to which some QP's solution was taken

    def plan(self, first: int, z_start: FloatArray, kappa_before: float) -> Plan:
        """Plan from state ``z_start`` at station ``first``; ``kappa_before`` is the curvature held until there [1/m].

        Linearises first at the last plan shifted along the road; at the stationary geometry where there is none.

        Raises:
            PlanError: a point of the vehicle has no foot on the road.
            SolverError: the first plan of a drive could not be solved, or none over the length of one.

        """
        began, began_cpu, times = perf_counter(), process_time(), StepTimes()
        settings, qp, motion = self._scene.settings, self._scene.qp, self._scene.motion
        by = None if self._last is None or first < self._last else first - self._last
        iterate = settings.scheme is Scheme.SQP or by is None  # the first plan has no predecessor to lean on
        self._last = None  # until this plan has succeeded
        road = self._scene.stations.points[first : first + settings.stages + 1]
        horizon = Horizon(first, road, kappa_before, 0 if iterate else settings.executed, by is None or self._binding)
        self._extend(horizon, z_start, by)
        times.linearise = perf_counter() - began
        qp_count, qp_iterations, halvings, violation, moved, merit, instead = 0, 0, 0, 0.0, np.inf, None, ""
        while qp_count < self._rounds:
            result, judged = self._solve(times)
            qp_count, qp_iterations, instead = qp_count + 1, qp_iterations + result.iterations, result.instead or instead
            usable = bool(judged.primal <= USABLE_RESIDUAL)  # False for NaN too
            if not usable:
                violation = self._violation()
                break
            mark = perf_counter()
            self._binding = l1_weights(qp.stages, result.point.stages, result.point.row_points, self._weights)
            horizon = horizon._replace(binding=self._binding)
            if self._binding and not self._priced:  # what prices a motion is loaded when limits first bind
                began_loading = perf_counter()
                self._merit(horizon)
                loading, self._priced = perf_counter() - began_loading, True
                times.loading, mark = times.loading + loading, mark + loading
            worth = self._merit(horizon) if self._binding else None
            moved, merit, halved = self._step(horizon, result.point, worth)
            halvings, violation = halvings + halved, self._violation()
            self._guessed = result.leaves_guess
            if self._guess is not None and self._guessed:  # the QP is in deviations from the motion: the next solution is near zero
                self._guess.copy_from(result.point)
            times.linearise += perf_counter() - mark
            iterating = iterate or (qp_count <= settings.rti_repairs and violation > _REPAIRED_M)
            stalled = worth is not None and merit is not None and halved and worth - merit < _STALLED * worth
            if not iterating or moved < settings.sqp_tolerance or stalled:
                break
        if usable or qp_count > 1:
            self._reaches = first + settings.stages
        elif by is None or (result.status is Status.FAILED and first + settings.executed > self._reaches):
            raise self._unsolved(result, judged, float(road["s"][0]), first=by is None)
        self._last = first
        z, kappa = motion.z.copy(), motion.kappa.copy()
        times.total = perf_counter() - began - times.loading
        times.cpu = times.total if times.loading else process_time() - began_cpu
        return Plan(
            first, z, kappa, kappa_before, status=result.status, reason=result.reason, usable=usable, instead=instead, qp_count=qp_count,
            qp_iterations=qp_iterations, residuals=judged, violation=violation, moved=moved, merit=merit, halvings=halvings, times=times,
        )  # fmt: skip

    def _unsolved(self, result: QpResult, judged: Residuals, s: float, *, first: bool) -> SolverError:
        """Return the error of a step without a motion that could be driven."""
        why = f" ({result.reason})" if result.reason else ""
        what = "the first plan could not be solved" if first else "no plan was solved since what the last one covered"
        msg = f"at s = {s:.1f} m {what}: {self._workspace.name} says {result.status}{why}, primal residual {judged.primal:.2g}"
        return SolverError(msg, status=str(result.status), s_m=s, hint="try another --solver")

    def _extend(self, horizon: Horizon, z_start: FloatArray, by: int | None) -> None:
        """Shift all that is known of the last plan ``by`` stages, and linearise at what it does not cover; all of it without one."""
        qp, motion, stages = self._scene.qp, self._scene.motion, self._scene.settings.stages
        kept = 0 if by is None else max(stages + 1 - by, 0)  # stages that the last plan still covers
        if by and kept:
            shift_rows(qp.stages, qp.rows, by)
            shift(self._moving, by)
        end = horizon.first + stages + 1
        guess(
            motion.stages, z_start, self._states[horizon.first : end], self._curvatures[horizon.first : end], kept, horizon.kappa_before,
            self._most, self._change,
        )  # fmt: skip
        for part in self._parts:
            self._found(part.extend(horizon, max(kept, 1)), horizon)

    def _linearise(self, horizon: Horizon) -> None:
        """Linearise at the motion: that judges all body edges, and is the next QP's data."""
        for part in self._parts:
            self._found(part.linearise(horizon), horizon)

    def _found(self, lost: int, horizon: Horizon) -> None:
        """Raise the error of a stage with a point that has no foot, if there is one."""
        if lost >= 0:
            s, name = float(horizon.road["s"][lost]), self._scene.vehicle.name
            msg = f"at s = {s:.1f} m a point of the {name} lies beyond the road's centre of curvature: the road bends too tightly for it"
            raise PlanError(msg, s_m=s, hint="smooth the road more (--smooth), or plan with a shorter vehicle")

    def _solve(self, times: StepTimes) -> tuple[QpResult, Residuals]:
        mark = perf_counter()
        result, judged, checking = self._workspace.judged(self._scene.qp, self._guess if self._guessed else None)
        times.update += perf_counter() - mark - result.solve_time - result.loading_time - checking
        times.solve += result.solve_time
        times.check += checking
        times.loading += result.loading_time
        return result, judged

    def _step(self, horizon: Horizon, point: StageSolution, worth: float | None) -> tuple[float, float | None, int]:
        """Move by a QP's solution, halved until the merit is no larger than ``worth``; return the move, merit and halvings.

        Without ``worth``, where no limit binds, the step is taken whole.
        """
        stages, settings, halvings = self._scene.motion.stages, self._scene.settings, 0
        if worth is None:
            moved = take_step(stages, point.stages, horizon.road, 1.0)
            self._linearise(horizon)
            return moved, None, 0
        self._before[:] = stages
        while True:
            moved = take_step(stages, point.stages, horizon.road, 0.5**halvings)
            self._linearise(horizon)
            merit = self._merit(horizon)
            if merit <= worth or moved < settings.sqp_tolerance or 0.5**halvings <= _SHORTEST_STEP:
                return moved, merit, halvings
            halvings += 1
            stages[:] = self._before

    def _violation(self) -> float:
        return max([part.violation for part in self._parts])

    def _merit(self, horizon: Horizon) -> float:
        return sum((part.price(horizon) for part in self._parts), defect_price(self._scene.qp.stages, self._weights))
