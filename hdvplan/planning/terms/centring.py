"""Centring: the squared residual (lead e_y + aux e_aux - target)^2 of two axles' offsets at every station."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from hdvplan.jit import FloatArray, Record, Records, compiled, inner
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.term import Horizon, Needs, Place, Scene
from hdvplan.qp.program import by_stage
from hdvplan.road.path import PLANNING_STEP_M, Curve, project
from hdvplan.vehicle.body import auxiliary_ahead
from hdvplan.vehicle.kinematics import body_point, point_gradient
from hdvplan.vehicle.model import Vehicle

COEFFICIENTS = np.dtype([("lead", float), ("aux", float), ("target", float)])  # of one station; the target in metres
_MEMORY = np.dtype([("foot", float), ("residual", float)])  # of one stage: of the auxiliary axle [m], and what is centred [m]


@dataclass(frozen=True)
class Residual:
    """Coefficients of the lateral error lead e_y + aux e_aux - target per station; shape (n,), ``target`` in metres.

    The auxiliary axle is that of unit number ``axle`` (from 0, or -1 for the last); for the lead unit it is the front axle.
    """

    lead: FloatArray
    aux: FloatArray
    target: FloatArray
    axle: int = -1

    def scaled(self, factor: float) -> Residual:
        """Return the residual at ``factor`` times its size."""
        return replace(self, lead=factor * self.lead, aux=factor * self.aux, target=factor * self.target)

    def about(self, stations: Stations, vehicle: Vehicle) -> Residual:
        """Return the residual about the stations' wanted bias.

        K (e_y - e_y*) + (e_aux - e_aux*) with the stationary offsets of the biased circle: those of the circle itself cancel by
        the choice of K, and what remains of the target is each axle's bias at its own place.
        """
        at_aux = np.interp(stations.s + auxiliary_ahead(vehicle, self.axle), stations.s, stations.bias)
        return replace(self, target=self.target + self.lead * stations.bias + self.aux * at_aux)


@dataclass(frozen=True)
class Centring:
    """The squared residual of two axles' offsets, summed over the stations ([GEO] eq. 20)."""

    residual: Residual

    def needs(self, vehicle: Vehicle) -> Needs:  # noqa: ARG002 - a protocol's method
        """Return nothing: see ``Term``."""
        return Needs()

    def part(self, scene: Scene, place: Place) -> CentringPart:  # noqa: ARG002 - needs no column of its own
        """Return the term in its place: see ``Term``."""
        residual, unit = self.residual, self.residual.axle % len(scene.vehicle.units)
        coefficients = np.zeros(len(residual.lead), COEFFICIENTS)
        coefficients["lead"], coefficients["aux"], coefficients["target"] = residual.lead, residual.aux, residual.target
        return CentringPart(
            scene,
            Axle(unit, scene.vehicle.lead.wheelbase if unit == 0 else 0.0, scene.stations.path.curve),
            coefficients,
            auxiliary_ahead(scene.vehicle, residual.axle),
            np.zeros(scene.settings.stages + 1, _MEMORY),
            np.ones(scene.settings.stages + 1),
        )


class Axle(NamedTuple):
    """Which axle the auxiliary one is, and what its offset is measured from."""

    unit: int
    ahead: float  #: of its unit's axle: the front axle of the lead unit, else the unit's own [m]
    curve: Curve


@dataclass(frozen=True)
class CentringPart:
    """Centring in its place; see ``Part``."""

    scene: Scene
    axle: Axle
    coefficients: Records  #: (stations,) of ``COEFFICIENTS``
    ahead: float  #: of the auxiliary axle, see ``auxiliary_ahead`` [m]
    stages: Records  #: (N+1,)
    weights: FloatArray  #: (N+1,), of the squared residuals
    violation: float = 0.0

    @property
    def memory(self) -> tuple[FloatArray, ...]:
        """The feet and residuals."""
        return (by_stage(self.stages),)

    def extend(self, horizon: Horizon, begin: int) -> int:
        """See ``Part``."""
        return self._linearise(horizon, begin, self.ahead)

    def linearise(self, horizon: Horizon) -> int:
        """See ``Part``."""
        return self._linearise(horizon, 1, np.nan)

    def price(self, horizon: Horizon) -> float:  # noqa: ARG002 - a protocol's method
        """Return the sum of the weighted squares: see ``Part``."""
        return float(np.sum(self.weights[1:] * np.square(self.stages["residual"][1:])))

    def _linearise(self, horizon: Horizon, begin: int, guessed: float) -> int:
        scene = self.scene
        coefficients = self.coefficients[horizon.first : horizon.first + len(horizon.road)]
        return linearise_centring(
            self.axle, guessed, horizon.road, scene.motion.stages, scene.motion.poses, coefficients, self.weights, begin, self.stages,
            scene.qp.stages,
        )  # fmt: skip


@compiled
def linearise_centring(
    axle: Axle, guessed: float, road: Records, motion: Records, poses: Records, coefficients: Records, weights: FloatArray, begin: int,
    memory: Records, stages: Records,
) -> int:  # fmt: skip
    """Add Q, q of the squared residual times its stage's weight at stages i >= ``begin``.

    Returns -1, or the stage whose point has no foot. ``memory`` holds the last feet, and receives feet and residuals; without last
    feet they are ``guessed`` to lie so far ahead of each station [m], else that is NaN.
    """
    n = motion[0].z.size
    gradient = np.empty(n)
    for i in range(begin, motion.size):
        own, at, stage, z = coefficients[i], road[i], stages[i], motion[i].z
        x, y = body_point(poses[i, axle.unit], axle.ahead, 0.0)
        foot, offset, cos, sin, _ = project(axle.curve, x, y, memory[i].foot if np.isnan(guessed) else at.s + guessed, PLANNING_STEP_M)
        if np.isnan(offset):
            return i
        point_gradient(poses[i], axle.unit, x, y, at, -sin, cos, gradient)
        for j in range(n):
            gradient[j] *= own.aux
        gradient[0] += own.lead
        residual = own.lead * z[0] + own.aux * offset - own.target
        memory[i].foot, memory[i].residual = foot, residual
        add_square(gradient, residual, weights[i], stage)
    return -1


@inner
def add_square(gradient: FloatArray, residual: float, weight: float, stage: Record) -> None:
    """Add Q, q of weight * residual^2 with the given derivative of the residual by the stage's first states."""
    for j in range(gradient.size):
        stage.q[j] += 2.0 * weight * gradient[j] * residual
        for k in range(gradient.size):
            stage.Q[j, k] += 2.0 * weight * gradient[j] * gradient[k]
