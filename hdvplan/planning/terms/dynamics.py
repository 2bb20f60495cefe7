"""The vehicle's dynamics, linearised: the columns that every program has. The dynamics have no price: see ``merit``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.jit import FloatArray, Records, compiled
from hdvplan.planning.discretisation import linearise_interval, memory
from hdvplan.planning.terms.term import Horizon, Needs, Place, Scene
from hdvplan.vehicle.kinematics import POSE, place
from hdvplan.vehicle.model import Vehicle


@dataclass(frozen=True)
class Dynamics:
    """x_{i+1} = A x_i + B u_i + defect; writes the motion's poses, and clears Q, q and ``live`` for the other terms."""

    def needs(self, vehicle: Vehicle) -> Needs:  # noqa: ARG002 - the vehicle's own columns are laid out by the assembler
        """Return nothing: see ``Term``."""
        return Needs()

    def part(self, scene: Scene, place: Place) -> _Part:  # noqa: ARG002
        """Return the term in its place: see ``Term``."""
        qp, vehicle, n = scene.qp, scene.vehicle, scene.vehicle.states
        qp.stages["A"][:, n, n] = qp.stages["B"][:, n, 0] = 1.0
        for wheel in range(len(vehicle.active)):
            qp.stages["B"][:, vehicle.rigid_states + wheel, 1 + wheel] = 1.0
        return _Part(scene, scene.settings.discretisation.code, memory(n))


@dataclass(frozen=True)
class _Part:
    scene: Scene
    rule: int
    work: Records
    memory: tuple[FloatArray, ...] = ()
    violation: float = 0.0

    def extend(self, horizon: Horizon, begin: int) -> int:
        scene, motion, qp = self.scene, self.scene.motion, self.scene.qp
        step = scene.settings.step
        linearise_dynamics(self.rule, scene.units, horizon.road, step, motion.stages, motion.poses, begin, qp.stages, self.work)
        return -1

    def linearise(self, horizon: Horizon) -> int:
        return self.extend(horizon, 1)

    def price(self, horizon: Horizon) -> float:  # noqa: ARG002
        return 0.0


@compiled
def linearise_dynamics(
    rule: int, units: Records, road: Records, step: float, motion: Records, poses: Records, begin: int, stages: Records, work: Records
) -> None:
    """Write A, B, c of the first interval and of those that lead to stage ``begin`` >= 1 and on; and poses of the stages they join."""
    last, probe = motion.size - 1, np.empty(units.size, POSE)
    for i in range(last + 1):
        if 0 < i < begin - 1:
            continue
        stage, at = stages[i], road[i]
        place(units, at.x, at.y, at.cos, at.sin, motion[i].z, poses[i])
        if i < last:
            linearise_interval(rule, units, at, step, motion[i], motion[i + 1].z, poses[i], stage, work[0], probe)
        if i >= begin:
            stage.live = 0.0
            for j in range(stage.q.size):
                stage.q[j] = 0.0
                for k in range(stage.q.size):
                    stage.Q[j, k] = 0.0
