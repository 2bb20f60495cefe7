"""The vehicle's dynamics, linearised: the columns that every program has. The dynamics have no price: see ``merit``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan import core
from hdvplan.planning.terms.term import CorePart, Needs, Place, Scene, core_functions
from hdvplan.vehicle.model import Vehicle

_FUNCTIONS = core_functions("dynamics")
_DATA = core.record("hdv_dynamics", [("rule", np.int64)])


@dataclass(frozen=True)
class Dynamics:
    """x_{i+1} = A x_i + B u_i + defect; writes the motion's poses, and clears Q, q and ``live`` for the other terms."""

    def needs(self, vehicle: Vehicle) -> Needs:  # noqa: ARG002 - the vehicle's own columns are laid out by the assembler
        """Return nothing: see ``Term``."""
        return Needs()

    def part(self, scene: Scene, place: Place) -> CorePart:  # noqa: ARG002
        """Return the term in its place: see ``Term``."""
        qp, vehicle, n = scene.qp, scene.vehicle, scene.vehicle.states
        qp.stages["A"][:, n, n] = qp.stages["B"][:, n, 0] = 1.0
        for wheel in range(len(vehicle.active)):
            qp.stages["B"][:, vehicle.rigid_states + wheel, 1 + wheel] = 1.0
        return CorePart(scene, _FUNCTIONS, np.array([(scene.settings.discretisation.code,)], _DATA))
