"""One planning step: linearise at the last plan, solve the QP, take the step. Once for RTI, to convergence for SQP.

RTI is the real-time iteration, SQP sequential quadratic programming. A step is in the core (``hdvplan/core/step.c``), with our own
solver in one call; another solver solves a copy of the program, and the core judges its answer and takes the step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter
from typing import NamedTuple

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.errors import OptionError, PlanError, QpDataError, SolverError, refused_in
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import Goal
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.steering import bounds_of
from hdvplan.planning.terms.term import CorePart, PythonPart
from hdvplan.qp.program import StageQp, StageSolution
from hdvplan.qp.workspace import ENDINGS, Judge, Moment, QpResult, Residuals, Status, WorkspaceMaker, refusal
from hdvplan.vehicle.model import Vehicle

_ROUNDED = 1e-9  # of the largest eigenvalue: sums of squares are as negative by rounding, a billionth at most
_HORIZONS = 2  # of memory: the window of a plan is moved back once in so many
_ARRAY = core.record("hdv_array")
_PLANNER = core.record("hdv_planner", residuals=np.dtype((float, 3)))
_SOLVE, _REFUSED, _LOST = (core.number(f"HDV_{name}") for name in ("SOLVE", "REFUSED", "LOST"))
_step = core.function("hdv_step", core.POINTER, core.INT, core.REAL, returns=core.INT)
_leaps = core.function("hdv_leaps", core.POINTER, returns=core.INT)
_begin = core.function("hdv_begin", core.POINTER, core.INT, core.REAL, returns=core.INT)
_iterate = core.function("hdv_iterate", core.POINTER, returns=core.INT)
_judge = core.function("hdv_judge", core.POINTER, core.POINTER, returns=core.INT)
_accept = core.function("hdv_accept", core.POINTER, core.POINTER, core.INT, returns=core.INT)


@dataclass
class StepTimes:
    """Where one planning step spent its time [s]."""

    linearise: float = 0.0
    update: float = 0.0
    solve: float = 0.0
    check: float = 0.0
    total: float = 0.0  # of the step
    aside: float = 0.0  # no part of the step: copying the program for a foreign solver
    cpu: float = 0.0  # processor time of the step, all threads, without what is aside


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


class _Outcome(NamedTuple):
    """How a step went, as the core's record has it, read in one go: field by field takes a microsecond longer, of forty."""

    reaches: int
    lost: int
    programs: int
    iterations: int
    ending: int
    halvings: int
    usable: int
    priced: int
    violation: float
    moved: float
    merit: float
    seconds_linearise: float
    seconds_solve: float
    seconds_check: float


def planner_record(vehicle: Vehicle, goal: Goal, settings: PlannerSettings) -> Records:
    """Return the core's record of a planner before its first step, (1,) of ``hdv_planner``, without addresses; its budget is unlimited."""
    record = np.zeros(1, _PLANNER)
    record["wheels"], record["rounds"] = len(vehicle.active), min(settings.sqp_iterations, goal.rounds or settings.sqp_iterations)
    record["repairs"], record["executed"] = settings.rti_repairs, settings.executed
    record["converges"], record["tolerance"] = settings.scheme is Scheme.SQP, settings.sqp_tolerance
    record["most_factorisations"] = record["most_linearisations"] = np.iinfo(np.int64).max
    record["last"], record["binding"], record["guessed"] = -1, 1, 1
    return record


class Planner:
    """Plans one vehicle along one drive; keeps the QP, the solver and the last plan between steps."""

    def __init__(self, vehicle: Vehicle, stations: Stations, goal: Goal, settings: PlannerSettings, make_workspace: WorkspaceMaker) -> None:
        """Prepare the memory of all steps of a drive."""
        with refused_in(goal.owner):
            scene, parts = assemble(vehicle, stations, goal, settings, _HORIZONS * (settings.stages + 1))
            if not all(isinstance(part, CorePart) for part in parts):  # a part in Python sees its window where the memory begins
                scene, parts = assemble(vehicle, stations, goal, settings)
        self._scene, self._parts, self._owner = scene, parts, goal.owner
        shape = replace(scene.qp.shape, stages=settings.stages)
        workspace = make_workspace(shape)
        self._judge = workspace if isinstance(workspace, Judge) else Judge(workspace)
        self._program, self._points = StageQp.empty(shape), StageSolution.empty(scene.qp.shape)
        callees = [part if isinstance(part, CorePart) else PythonPart(part, scene) for part in parts]
        self._python = [part for part in callees if isinstance(part, PythonPart)]
        terms = [part.term for part in callees]
        most, change = bounds_of(vehicle, settings.step)
        own = (scene.qp.stages, scene.qp.rows, scene.motion.stages, scene.motion.poses, self._points.stages, self._points.row_points)
        arrays = [*own, *(array for part in parts for array in part.memory)]
        self._start, self._states = np.zeros(vehicle.states), np.ascontiguousarray(stations.centring.states)
        kept = {
            "arrays": np.array([(core.address(array), array.nbytes // len(array)) for array in arrays], _ARRAY),
            "terms": np.concatenate(terms),
            "scene": scene.record,
            "stations": stations.points,
            "states": self._states,
            "curvatures": np.ascontiguousarray(stations.centring.kappa),
            "most": most,
            "change": change,
            "start": self._start,
            "weights": np.zeros(vehicle.rigid_states),
            "before": np.zeros((settings.stages + 1, vehicle.states + 1)),
        }
        self._kept = kept, arrays
        record = self._record = planner_record(vehicle, goal, settings)
        for name, array in kept.items():
            record[name] = core.address(array)
        record["array_count"], record["term_count"], record["capacity"] = len(arrays), len(terms), scene.capacity
        record["solver"] = self._judge.core_solver
        self._address = core.address(record)
        # the same memory: all of it, and what every step reads
        self._own, self._outcome, self._last, self._recomputed = (
            record[0],
            record[list(_Outcome._fields)],
            record["last"],
            record["residuals"][0],
        )

    def plan(self, first: int, z_start: FloatArray, kappa_before: float) -> Plan:
        """Plan from state ``z_start`` at station ``first``; ``kappa_before`` is the curvature held until there [1/m].

        Linearises first at the last plan along the road; at the stationary geometry where there is none.

        Raises:
            PlanError: a point of the vehicle has no foot on the road.
            SolverError: the first plan of a drive could not be solved, or none over the length of one.

        """
        began, times = Moment.now(), StepTimes()
        self._start[:] = z_start
        own, ours = self._own, self._judge.core_solver
        known = 0 <= self._last[0] <= first
        stop = (_step if ours else _begin)(self._address, first, kappa_before)
        result: QpResult | None = None  # of another solver than ours
        instead, iterations = "", 0
        while stop in {_SOLVE, _REFUSED}:
            if stop == _SOLVE and ours:
                stop, result = _iterate(self._address), None
                continue
            result = self._solved(times, refused=stop == _REFUSED)
            if self._owner and (result.instead or result.status is Status.FAILED):
                self._check_objective(first)
            instead, iterations = result.instead or instead, iterations + result.iterations
            stop = _accept(self._address, result.point.address_for(self._program.shape), result.leaves_guess)
            if result.leaves_guess and own["usable"]:
                self._last_point().copy_from(result.point)
        for part in self._python:  # what it has raised while the core called it
            raised, part.raised = part.raised, None
            if raised is not None:
                with refused_in(self._owner):
                    raise raised
        step = _Outcome._make(self._outcome.item())
        if stop == _LOST:
            raise self._footless(first + step.lost)
        status, reason = (ENDINGS[step.ending], "") if result is None else (result.status, result.reason)
        ended = status is Status.FAILED and first + self._scene.settings.executed > step.reaches
        if not step.usable and step.programs <= 1 and (not known or ended):
            self._last[0] = -1
            raise self._unsolved(status, reason, first, first_plan=not known)
        motion = self._scene.motion.stages[self._window()]
        z, kappa = motion["z"].copy(), motion["kappa"][:-1].copy()
        times.linearise, times.check, times.solve = step.seconds_linearise, step.seconds_check, times.solve + step.seconds_solve
        passed = began.passed()
        times.total, times.cpu = passed.clock - times.aside, times.cpu + passed.cpu
        return Plan(
            first, z, kappa, kappa_before, status=status, reason=reason, usable=bool(step.usable), instead=instead,
            qp_count=step.programs, qp_iterations=iterations + step.iterations, residuals=self._residuals(),
            violation=step.violation, moved=step.moved, merit=step.merit if step.priced else None, halvings=step.halvings, times=times,
        )  # fmt: skip

    def leaps(self) -> bool:
        """Return whether the last plan's motion does not reach its start, so far from the line; it is then forgotten."""
        return bool(_leaps(self._address))

    def _solved(self, times: StepTimes, *, refused: bool) -> QpResult:
        """Return a judged solution of the program, which solvers are given a copy of; ``refused`` is that of our solver."""
        began, window = Moment.now(), self._window()
        self._program.stages[:], self._program.rows[:] = self._scene.qp.stages[window], self._scene.qp.rows[window]
        if refused:
            ours = QpResult(ENDINGS[self._own["ending"]], self._last_point(), 0, 0.0, 0.0)
            result = self._judge.instead(self._program, refusal(ours, self._residuals()), self._judged, began)
            times.update += result.update_time
        else:
            copied, mark, checked = began.passed(), perf_counter(), float(self._own["seconds_check"])
            guess = self._last_point() if self._judge.starts_warm and self._own["guessed"] else None
            result = self._judge.judged(self._program, guess, self._judged)
            checked = float(self._own["seconds_check"]) - checked
            times.update += perf_counter() - mark - result.solve_time - result.time_aside - checked
            result = result.beside(copied)
        times.aside += result.time_aside
        times.cpu -= result.cpu_aside
        times.solve += result.solve_time
        return result

    def _check_objective(self, station: int) -> None:
        """Refuse a program that was failed at because of a user's objective: its terms are not finite, or not convex."""
        place, program = f"{self._owner}, in the plan at s = {self._scene.stations.s[station]:z.1f} m", self._program
        try:
            program.check()
        except QpDataError as error:
            msg = f"{place}: {error}"
            raise OptionError(msg, hint="no solver can help: look for NaN and infinity in the objective's terms") from error
        for name, part in (("Q", program.Q), ("R", program.R)):
            values = np.linalg.eigvalsh(part)
            if values.min() < -_ROUNDED * values.max():
                msg = f"{place}: its terms are not convex: {name} has the eigenvalue {values.min():.3g}"
                raise OptionError(msg, hint="no solver of convex programs can help: a term's second derivative must not be negative")

    def _judged(self, point: StageSolution) -> Residuals:
        """Return the residuals of a point, by the program that no solver can write to."""
        _judge(self._address, point.address_for(self._program.shape))
        return self._residuals()

    def _residuals(self) -> Residuals:
        return Residuals(*self._recomputed.tolist())

    def _window(self) -> slice:
        """Return where the program's stages are in the memory."""
        at = int(self._scene.record["at"][0])
        return slice(at, at + self._scene.settings.stages + 1)

    def _last_point(self) -> StageSolution:
        """Return the last solution along the road: the guess of the next."""
        return StageSolution(self._points.stages[self._window()], self._points.row_points[self._window()])

    def _footless(self, station: int) -> PlanError:
        s, name = float(self._scene.stations.s[station]), self._scene.vehicle.name
        msg = f"at s = {s:z.1f} m a point of the {name} lies beyond the road's centre of curvature: the road bends too tightly for it"
        return PlanError(msg, s_m=s, hint="smooth the road more (--smooth), or plan with a shorter vehicle")

    def _unsolved(self, status: Status, reason: str, station: int, *, first_plan: bool) -> SolverError:
        s, why = float(self._scene.stations.s[station]), f" ({reason})" if reason else ""
        what = "the first plan could not be solved" if first_plan else "no plan was solved since what the last one covered"
        msg = f"at s = {s:z.1f} m {what}: {self._judge.name} says {status}{why}, primal residual {self._residuals().primal:.2g}"
        return SolverError(msg, status=str(status), s_m=s, hint="try another --solver")
