"""Smooth steering: w (kappa_i - kappa_{i-1})^2, with the limits of curvature and of its change."""

from __future__ import annotations

from dataclasses import dataclass

from hdvplan.jit import FloatArray, Records, compiled
from hdvplan.planning.terms.term import Horizon, Needs, Place, Scene
from hdvplan.vehicle.model import Vehicle


@dataclass(frozen=True)
class Smoothness:
    """The first term of the objective ([GEO] eq. 20) and what the front wheels can do."""

    def needs(self, vehicle: Vehicle) -> Needs:  # noqa: ARG002 - kappa and its change are columns of every program
        """Return nothing: see ``Term``."""
        return Needs()

    def part(self, scene: Scene, place: Place) -> _Part:  # noqa: ARG002
        """Return the term in its place: see ``Term``."""
        return _Part(scene, scene.vehicle.max_curvature, scene.vehicle.max_curvature_rate * scene.settings.step)


@dataclass(frozen=True)
class _Part:
    scene: Scene
    most: float  # curvature [1/m]
    change: float  # largest, from station to station [1/m]
    memory: tuple[FloatArray, ...] = ()
    violation: float = 0.0

    def extend(self, horizon: Horizon, begin: int) -> int:  # noqa: ARG002 - all stages: the first change depends on what was driven
        return self.linearise(horizon)

    def linearise(self, horizon: Horizon) -> int:
        scene = self.scene
        linearise_smoothness(scene.motion.stages, horizon.kappa_before, self.most, self.change, scene.settings.smoothness, scene.qp.stages)
        return -1

    def price(self, horizon: Horizon) -> float:
        return roughness(self.scene.motion.stages, horizon.kappa_before, self.scene.settings.smoothness)


@compiled
def linearise_smoothness(motion: Records, kappa_before: float, most: float, change: float, weight: float, stages: Records) -> None:
    """Write what a change of curvature costs, and the bounds of kappa_{i-1} (the vehicle's last state) and of its change."""
    before = kappa_before
    for i in range(motion.size - 1):
        stage, ahead, kappa = stages[i], stages[i + 1], motion[i].kappa
        changed = kappa - before
        stage.R[0, 0], stage.r[0] = 2.0 * weight, 2.0 * weight * changed
        stage.u_low[0], stage.u_high[0] = -change - changed, change - changed
        ahead.x_low[0], ahead.x_high[0] = -most - kappa, most - kappa
        before = kappa


@compiled
def roughness(motion: Records, kappa_before: float, weight: float) -> float:
    """Return what a motion's changes of curvature cost."""
    total, before = 0.0, kappa_before
    for i in range(motion.size - 1):
        total += weight * (motion[i].kappa - before) ** 2
        before = motion[i].kappa
    return total
