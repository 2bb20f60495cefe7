"""A planning step over the same terms, in memory of one horizon, and both methods of our solver on dense matrices: see ``core/step.c``."""

from dataclasses import dataclass

import numpy as np

from hdvplan.arrays import BoolArray, FloatArray
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import Goal
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.term import Horizon
from hdvplan.qp.program import StageSolution, by_stage
from hdvplan.qp.workspace import WorkspaceMaker, residuals
from hdvplan.vehicle.model import Vehicle
from tests.core.programs import Dense
from tests.core.scenes import defect_price, guess, l1_weights, take_step

USABLE, SHORTEST, REPAIRED, STALLED = 1e-3, 1.0 / 32.0, 0.01, 1e-3


@dataclass
class Planned:
    """What a step tells, under the names of ``Plan``."""

    z: FloatArray
    kappa: FloatArray
    qp_count: int = 0
    qp_iterations: int = 0
    violation: float = 0.0
    moved: float = np.inf
    merit: float | None = None
    halvings: int = 0
    usable: bool = False


class Step:
    """A planner of one vehicle along one drive."""

    def __init__(self, vehicle: Vehicle, stations: Stations, goal: Goal, settings: PlannerSettings, make: WorkspaceMaker) -> None:
        self.scene, self.parts = assemble(vehicle, stations, goal, settings)
        self.settings, self.rounds = settings, min(settings.sqp_iterations, goal.rounds or settings.sqp_iterations)
        self.workspace, self.guess = make(self.scene.qp.shape), StageSolution.empty(self.scene.qp.shape)
        wheels = [vehicle.units[axle] for axle in vehicle.active]
        self.most = np.array([vehicle.max_curvature, *(unit.max_steering_angle for unit in wheels)])
        self.change = settings.step * np.array([vehicle.max_curvature_rate, *(unit.max_steering_rate for unit in wheels)])
        self.weights = np.zeros(vehicle.rigid_states)
        self.last: int | None = None
        self.binding = self.guessed = True

    def plan(self, first: int, z_start: FloatArray, kappa_before: float) -> Planned:
        """Plan from a state at a station."""
        settings, qp, motion = self.settings, self.scene.qp, self.scene.motion
        by = None if self.last is None or first < self.last else first - self.last
        iterates, self.last = settings.scheme is Scheme.SQP or by is None, None
        road = self.scene.stations.points[first : first + settings.stages + 1]
        horizon = Horizon(first, road, kappa_before, 0 if iterates else settings.executed, by is None or self.binding)
        self._extend(horizon, z_start, by)
        found = Planned(motion.z, motion.kappa)
        while found.qp_count < self.rounds:
            result = self.workspace.solve(qp, self.guess if self.guessed else None)
            found.qp_count, found.qp_iterations = found.qp_count + 1, found.qp_iterations + result.iterations
            found.usable = bool(residuals(qp, result.point).primal <= USABLE)
            if not found.usable:
                found.violation = self._violation()
                break
            self.binding = l1_weights(qp, result.point, self.weights)
            horizon = horizon._replace(binding=self.binding)
            worth = self._merit(horizon) if self.binding else None
            halved = self._move(horizon, result.point, worth, found)
            found.violation, self.guessed = self._violation(), result.leaves_guess
            if self.guessed:
                self.guess.copy_from(result.point)
            repairs = found.qp_count <= settings.rti_repairs and found.violation > REPAIRED
            stalled = worth is not None and found.merit is not None and halved > 0 and worth - found.merit < STALLED * worth
            if not (iterates or repairs) or found.moved < settings.sqp_tolerance or stalled:
                break
        self.last, found.z, found.kappa = first, motion.z.copy(), motion.kappa.copy()
        return found

    def _extend(self, horizon: Horizon, z_start: FloatArray, by: int | None) -> None:
        """Shift all that is known, and linearise at what is new."""
        scene, count = self.scene, self.settings.stages + 1
        kept = 0 if by is None else max(count - by, 0)
        if by and kept:
            own = (scene.motion.stages, scene.qp.stages, scene.qp.rows)
            for array in (*map(by_stage, own), *(array for part in self.parts for array in part.memory)):
                array[:kept] = array[by:].copy()
        for array in self.guess.numbers:  # stages that the last plan does not reach are guessed to be like its last ones
            known = array[count - kept :].copy()
            array[:kept] = known
            for i in range(kept, count):
                array[i] = array[i - (count - kept)] if kept and i >= count - kept else 0.0
        centring, here = scene.stations.centring, slice(horizon.first, horizon.first + count)
        scene.begin(horizon)
        states, curvatures = (np.ascontiguousarray(array[here]) for array in (centring.states, centring.kappa))
        brought = guess(scene.record, z_start, states, curvatures, kept, self.most, self.change)
        assert all(part.extend(horizon, 1 if brought else max(kept, 1)) == -1 for part in self.parts)

    def _move(self, horizon: Horizon, point: StageSolution, worth: float | None, found: Planned) -> int:
        """Move by a solution, halved until the merit is no larger than ``worth``; return how often."""
        stages, halved = self.scene.motion.stages, 0
        before = stages.copy()
        while True:
            share = 0.5**halved
            found.moved = take_step(self.scene.record, point, share)
            assert all(part.linearise(horizon) == -1 for part in self.parts)
            found.merit = None if worth is None else self._merit(horizon)
            if (
                found.merit is None
                or worth is None
                or found.merit <= worth
                or found.moved < self.settings.sqp_tolerance
                or share <= SHORTEST
            ):
                found.halvings += halved
                return halved
            halved, stages[:] = halved + 1, before

    def _violation(self) -> float:
        return max(part.violation for part in self.parts)

    def _merit(self, horizon: Horizon) -> float:
        return sum((part.price(horizon) for part in self.parts), defect_price(self.scene.qp, self.weights))


def at_active_set(program: Dense, active: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return the point at which the ``active`` inequalities hold with equality, all others left out, and all multipliers of G v <= h."""
    held = np.vstack([program.E, program.G[active]])
    system = np.block([[program.P, held.T], [held, np.zeros((len(held), len(held)))]])
    found = np.linalg.solve(system, np.concatenate([-program.q, program.b, program.h[active]]))
    multipliers = np.zeros(len(program.h))
    multipliers[active] = found[len(program.q) + len(program.b) :]
    return found[: len(program.q)], multipliers


def interior(program: Dense, tolerance: float = 1e-9, most: int = 60) -> tuple[FloatArray, FloatArray]:
    """Return the optimum and the multipliers of G v <= h by Mehrotra's predictor-corrector method."""
    v = np.asarray(np.linalg.lstsq(program.E, program.b)[0], float)
    y, z = np.zeros(len(program.b)), np.ones(len(program.h))
    s: FloatArray = np.maximum(program.h - program.G @ v, 1.0)
    for _ in range(most):
        dual = program.P @ v + program.q + program.E.T @ y + program.G.T @ z
        equal, below, mean = program.E @ v - program.b, program.G @ v + s - program.h, float(s @ z) / len(s)
        if max(mean, *(float(np.max(np.abs(part))) for part in (dual, equal, below))) < tolerance:
            return v, z
        weights = z / s
        system = np.block([[program.P + program.G.T * weights @ program.G, program.E.T], [program.E, np.zeros((len(y), len(y)))]])
        products = s * z
        for corrects in (False, True):  # towards no products; then towards those that the first leaves, with its second order
            pushed = weights * below - products / s
            found = np.linalg.solve(system, -np.concatenate([dual + program.G.T @ pushed, equal]))
            d_v, d_y = found[: len(v)], found[len(v) :]
            d_s = -below - program.G @ d_v
            d_z = -(products + z * d_s) / s
            length = min(1.0, 1.0 / max(1e-300, float(np.max(-d_s / s)), float(np.max(-d_z / z))))
            left = float((s + length * d_s) @ (z + length * d_z)) / len(s)
            products = products if corrects else s * z + d_s * d_z - mean * (left / mean) ** 3
        length = min(1.0, 0.995 * length)
        v, y, z, s = v + length * d_v, y + length * d_y, z + length * d_z, s + length * d_s
    msg = f"no optimum after {most} iterations"
    raise AssertionError(msg)
