"""Terms of objectives: centring, the squared residual of two axles' offsets at every station, and the largest reach of any point.

The residual is (lead e_y + aux e_aux - target)^2. The largest reach is an epigraph variable t >= |offset| of every watched point at every
stage: hdvplan/core/reach.c. t is one state more, which the first stage's last input sets and all others keep: its rows then look like those
of any limit, and every solver takes the program as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.errors import OptionError
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.term import Columns, CorePart, Needs, Scene, Term, core_functions
from hdvplan.qp.program import by_stage
from hdvplan.vehicle.kinematics import auxiliary_ahead, axle_points, axles_behind, edge_points
from hdvplan.vehicle.model import Vehicle

COEFFICIENTS = core.record("hdv_residual")  # of one station; the target in metres
# Of one stage: of the auxiliary axle [m], and what is centred [m].
_MEMORY = core.record("hdv_centred")
_DATA = core.record("hdv_centring")
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
        at_aux = stations.ahead(stations.bias, auxiliary_ahead(vehicle, self.axle))
        return replace(self, target=self.target + self.lead * stations.bias + self.aux * at_aux)


@dataclass(frozen=True)
class Centring(Term):
    """The squared residual of two axles' offsets, summed over the stations ([GEO] eq. 20)."""

    residual: Residual

    def part(self, scene: Scene, columns: Columns) -> CentringPart:  # noqa: ARG002 - needs no column of its own
        """Return the term as part of the program: see ``Term``."""
        residual, vehicle, count = self.residual, scene.vehicle, len(scene.stations.s)
        found = [np.shape(one) for one in (residual.lead, residual.aux, residual.target)]
        if found != 3 * [(count,)]:
            shapes = ", ".join(map(str, found))
            msg = f"a residual has one coefficient a station, in arrays of shape ({count},), not {shapes}"
            raise OptionError(msg)
        ahead = auxiliary_ahead(vehicle, residual.axle)
        unit, stages = residual.axle % len(vehicle.units), scene.settings.stages + 1
        coefficients, memory, weights = np.zeros(len(residual.lead), COEFFICIENTS), np.zeros(scene.capacity, _MEMORY), np.ones(stages)
        coefficients["lead"], coefficients["aux"], coefficients["target"] = residual.lead, residual.aux, residual.target
        axle = (unit, vehicle.lead.wheelbase if unit == 0 else 0.0, ahead)
        arrays = (scene.stations.path.record, coefficients, weights, memory)
        data = np.array([(*axle, *map(core.address, arrays))], _DATA)
        return CentringPart(scene, _FUNCTIONS, data, coefficients, weights, memory, memory=(by_stage(memory),))


@dataclass(frozen=True)
class CentringPart(CorePart):
    """Centring as part of a program; see ``Part``."""

    coefficients: Records  #: (stations,) of ``COEFFICIENTS``
    weights: FloatArray  #: (N+1,), of the squared residuals
    stages: Records  #: (N+1,), feet and residuals

    def weighed(self, weights: FloatArray) -> CentringPart:
        """Return the same with other weights; both share what they know."""
        data = self.data.copy()
        data["weights"] = core.address(weights)
        return replace(self, data=data, weights=weights)


_FURTHEST_M = 100.0  # more than any vehicle can reach off its road; bounds of a variable that needs none
_REACH = core.record("hdv_reach")
_REACHING = core_functions("reach")


@dataclass(frozen=True)
class Reach(Term):
    """The largest distance t of any watched point from the road's centre over the horizon of N stages, at the cost N t^2."""

    bodies: bool  # watch the points of both edges of every body; else the axles alone

    def points(self, vehicle: Vehicle) -> Records:
        """Return the watched points, as ``edge_points``."""
        return edge_points(vehicle) if self.bodies else axle_points(vehicle)

    def needs(self, vehicle: Vehicle) -> Needs:
        """Return t, the input that sets it, and two rows a point: see ``Term``."""
        return Needs(states=1, inputs=1, rows=2 * self.points(vehicle).size)

    def part(self, scene: Scene, columns: Columns) -> CorePart:
        """Return the term as part of the program: see ``Term``. Its rows are priced above their multipliers, which add up to 2 N t."""
        qp, t, u, count = scene.qp, columns.state, columns.input, scene.settings.stages
        qp.stages["R"][:, u, u] = 1.0  # the other stages' last inputs do nothing, and are 0
        qp.stages["u_low"][:, u], qp.stages["u_high"][:, u] = -_FURTHEST_M, _FURTHEST_M
        rows = qp.rows[:, columns.row : columns.row + self.needs(scene.vehicle).rows]
        rows["g"][:, :, t], rows["linear"] = -1.0, 2.0 * count * _FURTHEST_M
        points = self.points(scene.vehicle)
        half = np.ascontiguousarray(scene.units["half_width"]) if self.bodies else np.zeros(len(scene.units))
        ahead = points["ahead"] - axles_behind(scene.vehicle)[:, None]
        feet = np.zeros((scene.capacity, *points.shape, 2))
        curve, more = scene.stations.path.record, (half, ahead)
        data = np.array(
            [(core.address(curve), core.address(points), points.shape[1], *map(core.address, more), t, u, columns.row, core.address(feet))],
            _REACH,
        )
        return CorePart(scene, _REACHING, data, kept=(curve, points, *more), memory=(by_stage(feet),))
