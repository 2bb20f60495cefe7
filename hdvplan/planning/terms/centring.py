"""Centring: the squared residual (lead e_y + aux e_aux - target)^2 of two axles' offsets at every station."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.errors import OptionError
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.term import CorePart, Place, Scene, Term, core_functions
from hdvplan.qp.program import by_stage
from hdvplan.vehicle.body import auxiliary_ahead
from hdvplan.vehicle.model import Vehicle

COEFFICIENTS = core.record("hdv_residual", [("lead", float), ("aux", float), ("target", float)])  # of one station; the target in metres
# Of one stage: of the auxiliary axle [m], and what is centred [m].
_MEMORY = core.record("hdv_centred", [("foot", float), ("residual", float)])
_POINTERS = [(name, core.ADDRESS) for name in ("curve", "residuals", "weights", "memory")]
_DATA = core.record("hdv_centring", [("unit", np.int64), ("ahead", float), ("beside", float), *_POINTERS])
_FUNCTIONS = core_functions("centring")


@dataclass(frozen=True)
class Residual:
    """Coefficients of the lateral error lead e_y + aux e_aux - target per station; shape (n,), ``target`` in metres.

    The auxiliary axle is that of unit number ``axle`` (from 0, or -1 for the last); for the lead unit it is the front axle.
    """

    lead: FloatArray
    aux: FloatArray
    target: FloatArray
    axle: int = -1

    def scaled(self, factor: float | FloatArray) -> Residual:
        """Return the residual at ``factor`` times its size, one or one a station."""
        return replace(self, lead=factor * self.lead, aux=factor * self.aux, target=factor * self.target)

    def about(self, stations: Stations, vehicle: Vehicle) -> Residual:
        """Return the residual about the stations' wanted bias.

        K (e_y - e_y*) + (e_aux - e_aux*) with the stationary offsets of the biased circle: those of the circle itself cancel by
        the choice of K, and what remains of the target is each axle's bias at its own place.
        """
        at_aux = np.interp(stations.s + auxiliary_ahead(vehicle, self.axle), stations.s, stations.bias)
        return replace(self, target=self.target + self.lead * stations.bias + self.aux * at_aux)


@dataclass(frozen=True)
class Centring(Term):
    """The squared residual of two axles' offsets, summed over the stations ([GEO] eq. 20)."""

    residual: Residual

    def part(self, scene: Scene, place: Place) -> CentringPart:  # noqa: ARG002 - needs no column of its own
        """Return the term in its place: see ``Term``."""
        residual, vehicle, count = self.residual, scene.vehicle, len(scene.stations.s)
        if not residual.lead.shape == residual.aux.shape == residual.target.shape == (count,):
            shapes = ", ".join(str(one.shape) for one in (residual.lead, residual.aux, residual.target))
            msg = f"a residual has one coefficient a station, in arrays of shape ({count},), not {shapes}"
            raise OptionError(msg)
        unit, stages = residual.axle % len(vehicle.units), scene.settings.stages + 1
        coefficients, memory, weights = np.zeros(len(residual.lead), COEFFICIENTS), np.zeros(scene.capacity, _MEMORY), np.ones(stages)
        coefficients["lead"], coefficients["aux"], coefficients["target"] = residual.lead, residual.aux, residual.target
        axle = (unit, vehicle.lead.wheelbase if unit == 0 else 0.0, auxiliary_ahead(vehicle, unit))
        arrays = (scene.stations.path.record, coefficients, weights, memory)
        data = np.array([(*axle, *map(core.address, arrays))], _DATA)
        return CentringPart(scene, _FUNCTIONS, data, coefficients, weights, memory, memory=(by_stage(memory),))


@dataclass(frozen=True)
class CentringPart(CorePart):
    """Centring in its place; see ``Part``."""

    coefficients: Records  #: (stations,) of ``COEFFICIENTS``
    weights: FloatArray  #: (N+1,), of the squared residuals
    stages: Records  #: (N+1,), feet and residuals

    def weighed(self, weights: FloatArray) -> CentringPart:
        """Return the same with other weights; both share what they know."""
        data = self.data.copy()
        data["weights"] = core.address(weights)
        return replace(self, data=data, weights=weights)
