"""What every program has: the vehicle's linearised dynamics, and what is steered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray
from hdvplan.planning.terms.term import Columns, CorePart, Scene, Term, core_functions
from hdvplan.vehicle.kinematics import auxiliary_ahead
from hdvplan.vehicle.model import Vehicle

_DYNAMICS = core_functions("dynamics")
_RULE = core.record("hdv_dynamics")


@dataclass(frozen=True)
class Dynamics(Term):
    """The vehicle: x_{i+1} = A x_i + B u_i + defect; writes the motion's poses, and clears Q, q and ``live`` for the others. No price."""

    def part(self, scene: Scene, columns: Columns) -> CorePart:  # noqa: ARG002
        """Return the term as part of the program: see ``Term``."""
        qp, vehicle, n = scene.qp, scene.vehicle, scene.vehicle.states
        qp.stages["A"][:, n, n] = qp.stages["B"][:, n, 0] = 1.0
        for wheel in range(len(vehicle.active)):
            qp.stages["B"][:, vehicle.rigid_states + wheel, 1 + wheel] = 1.0
        return CorePart(scene, _DYNAMICS, np.array([(scene.settings.discretisation.code,)], _RULE))


CHANGE_WEIGHT = 20.0  # of the square of a change between stations: as smooth for 7 m of trailer as 1e3 is for curvature [m^2]
ANGLE_WEIGHT = 10.0  # of the squared difference from the wanted angle; ten times more or less changes no reach by 2 cm [m^2]

_FUNCTIONS = core_functions("steering")
_DATA = core.record("hdv_steering")


@dataclass(frozen=True)
class Steering(Term):
    """What is steered: curvature, at w (kappa_i - kappa_{i-1})^2 ([GEO] eq. 20), and the wheels of axles that the plan steers itself.

    With the limits of all and of their changes. Their columns belong to the vehicle.

    Beside the objective the wheels are wanted at the angles of the balanced circle of the road beside each axle: a trailer then steers
    where it is, not where its tractor is, and a straight leaves its wheels straight. Turning them costs, as it does for the front
    wheels. The objective and the limits decide the rest. Wheel angles are states of the motion; between stations they change
    evenly, and each change is a separate input.

    With this wish alone the semitrailer's worst reach and mean imbalance came out as low as with its axle's offset as a second residual.
    """

    def part(self, scene: Scene, columns: Columns) -> CorePart:  # noqa: ARG002 - needs no column of its own
        """Return the term as part of the program: see ``Term``."""
        vehicle, stations, settings = scene.vehicle, scene.stations, scene.settings
        wanted = zip(vehicle.active, stations.centring.steering.T, strict=True)
        angles = [stations.ahead(angle, auxiliary_ahead(vehicle, axle)) for axle, angle in wanted]
        aim = np.column_stack([np.empty((len(stations.s), 0)), *angles])  # (stations, active), left positive [rad]
        kept = (aim, *bounds_of(vehicle, settings.step))
        weights = (settings.smoothness, ANGLE_WEIGHT, CHANGE_WEIGHT)
        data = np.array([(len(angles), *map(core.address, kept), *weights)], _DATA)
        return CorePart(scene, _FUNCTIONS, data, kept=kept)


def bounds_of(vehicle: Vehicle, step: float) -> tuple[FloatArray, FloatArray]:
    """Return the largest curvature, then the largest angle of every axle that the plan steers, and the most that each changes a step."""
    axles = [vehicle.units[axle] for axle in vehicle.active]
    most = np.array([vehicle.max_curvature, *(axle.max_steering_angle for axle in axles)])
    return most, step * np.array([vehicle.max_curvature_rate, *(axle.max_steering_rate for axle in axles)])
