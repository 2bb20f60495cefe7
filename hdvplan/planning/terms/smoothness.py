"""Smooth steering: w (kappa_i - kappa_{i-1})^2, with the limits of curvature and of its change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan import core
from hdvplan.planning.terms.term import CorePart, Needs, Place, Scene, core_functions
from hdvplan.vehicle.model import Vehicle

_FUNCTIONS = core_functions("smoothness")
_DATA = core.record("hdv_smoothness", [(name, float) for name in ("weight", "most", "change")])


@dataclass(frozen=True)
class Smoothness:
    """The first term of the objective ([GEO] eq. 20) and what the front wheels can do."""

    def needs(self, vehicle: Vehicle) -> Needs:  # noqa: ARG002 - kappa and its change are columns of every program
        """Return nothing: see ``Term``."""
        return Needs()

    def part(self, scene: Scene, place: Place) -> CorePart:  # noqa: ARG002
        """Return the term in its place: see ``Term``."""
        settings, vehicle = scene.settings, scene.vehicle
        change = vehicle.max_curvature_rate * settings.step
        return CorePart(scene, _FUNCTIONS, np.array([(settings.smoothness, vehicle.max_curvature, change)], _DATA))
