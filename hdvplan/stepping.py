"""Planning one step at a time, for a loop of your own: a simulator, a controller, a state that is measured.

``hdvplan.plan`` closes the loop itself, with an exact simulation. Here the caller says where the vehicle is before each plan.
"""

from __future__ import annotations

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.driving.drive import executed, ready
from hdvplan.errors import OptionError, PlanError
from hdvplan.passing.sides import choose_sides
from hdvplan.planning.objectives import objective_named
from hdvplan.planning.planner import Plan
from hdvplan.qp.workspace import USABLE_RESIDUAL
from hdvplan.road.path import ReferencePath
from hdvplan.solvers.registry import dependable


class Stepper:
    """A case's planner between two steps, and where its vehicle is.

    ``at`` is the station of the vehicle's lead rear axle, ``s`` its arclength [m], ``z`` the state there (n,): e_y [m], e_psi, the
    articulation angles, and the angles of wheels that the plan steers [rad]; ``kappa`` is the curvature that was driven until there
    [1/m]. Planning starts warm from the last plan, as in ``hdvplan.plan``.
    """

    def __init__(self, case: Case) -> None:
        """Prepare all that planning needs, and put the vehicle at the start of the road, where ``hdvplan.plan`` puts it.

        Raises:
            RoadError: the road is shorter than the vehicle, or an obstacle has no room on the side on which it must be passed.
            PlanError: the road begins in a bend into which the vehicle cannot be driven.
            OptionError: no such objective, or a bias that the road or the objective has no room for.
            SolverError: no such solver, or not installed.

        """
        road, _ = choose_sides(case)
        objective, solver = objective_named(case.objective), dependable(case.solver)
        self.case = case
        begun = ready(road, case.vehicle, objective, solver, case.settings, case.bias)
        self._stations, self._planner, (self.z, self.kappa) = begun.stations, begun.planner, begun.begin
        self._end = int(np.ceil(road.path.length / case.settings.step - 1e-9))
        self.at = 0

    @property
    def s(self) -> float:
        """The arclength of the vehicle's lead rear axle [m]."""
        return float(self._stations.s[self.at])

    @property
    def path(self) -> ReferencePath:
        """The road's path and its continuation beyond both ends, as far as the vehicle and its plans reach."""
        return self._stations.path

    @property
    def done(self) -> bool:
        """Whether the end of the road is reached."""
        return self.at >= self._end

    @property
    def count(self) -> int:
        """How many stations further the next plan is made: ``PlannerSettings.replan``, or what is left of the road."""
        return min(self.case.settings.executed, self._end - self.at)

    def plan(self) -> Plan:
        """Plan over one horizon from where the vehicle is: states ``z`` (N + 1, n) at the stations, curvatures ``kappa`` (N,) between.

        Where no program was solved, the last plan goes on, and the plan is not ``usable``. One that is refused leaves nothing to the next.

        Raises:
            PlanError: a point of the vehicle has no foot on the road, or the vehicle is too far from it for a plan to lead on, or its
                heading error reaches 90 degrees, where the road-aligned model ends.
            SolverError: the first plan could not be solved, or none over the length of one.

        """
        s, off, turned = self.s, abs(float(self.z[0])), float(np.rad2deg(self.z[1]))
        if abs(self.z[1]) >= 0.5 * np.pi:
            msg = f"at s = {s:z.1f} m a heading error of {turned:.0f} degrees: along the road's line a vehicle is planned below 90"
            raise PlanError(msg, s_m=s, hint="is the heading, less that of the road's line, known, and in radians?")
        plan = self._planner.plan(self.at, np.ascontiguousarray(self.z), self.kappa)
        if self._planner.leaps():
            msg = f"at s = {s:z.1f} m no plan was found that leads on from {off:.1f} m beside the road's line"
            msg += f", with a heading error of {turned:z.0f} degrees"
            raise PlanError(msg, s_m=s, hint="are the vehicle's place on the road and its heading known?")
        return plan

    def simulate(self, plan: Plan) -> FloatArray:
        """Return the exact states at this and the next ``count`` stations, (count + 1, n), while driving ``plan``; nothing moves.

        Raises:
            PlanError: the motion leaves the model's domain.

        """
        return executed(self.case.vehicle, self._stations, plan, slice(0, self.count), np.ascontiguousarray(self.z), 1)

    def arrive(self, z: FloatArray, kappa: float) -> None:
        """Put the vehicle ``count`` stations further, in the state ``z`` there, after driving the curvature ``kappa`` [1/m].

        Raises:
            OptionError: the state has another shape, or is not finite, or the vehicle cannot steer the curvature.

        """
        z = np.array(z, dtype=float)
        if z.shape != self.z.shape or not (np.all(np.isfinite(z)) and np.isfinite(kappa)):
            msg = f"a state of the {self.case.vehicle.name} is {len(self.z)} finite numbers, and a finite curvature"
            raise OptionError(msg)
        most = self.case.vehicle.max_curvature
        if abs(kappa) > most + USABLE_RESIDUAL:
            msg = f"a curvature of {kappa:.4g} 1/m was not driven: the {self.case.vehicle.name} steers up to {most:.4g} 1/m"
            raise OptionError(msg, hint="kappa is tan(front angle) / wheelbase, not the angle; of a noisy measurement, clip it")
        self.at, self.z, self.kappa = self.at + self.count, z, float(kappa)
