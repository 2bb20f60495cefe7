"""The geometric weight K along a road of varying curvature, and the stationary geometry that goes with it.

The stationary circle is solved once per vehicle on a grid of curvatures and interpolated: one root search a stage
would cost more than the whole planning step.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from hdvplan.arrays import BoolArray, FloatArray
from hdvplan.centring.stationary import Stationary, ratio, stationary, tightest_road
from hdvplan.vehicle.model import Vehicle

_GRID = np.linspace(0.0, 0.5, 2001)  # road curvatures [1/m]; linear interpolation errs by less than 1e-6 in K up to 0.1 1/m
_KEPT = 64  # tables of some 200 kB


@dataclass(frozen=True)
class Centring:
    """Balanced driving at every point of a road, signed: positive curvature turns left. Shape (n,) each."""

    lead: FloatArray  # coefficients of the residual to centre, see ``coefficients``
    aux: FloatArray
    target: FloatArray  # [m]
    kappa: FloatArray  # tan(front angle) / wheelbase [1/m]
    e_y: FloatArray  # [m]
    axle: int  # which axle the auxiliary one is, see ``auxiliary_axle``
    e_aux: FloatArray  # [m]
    e_psi: FloatArray  # [rad]
    beta: FloatArray  # shape (n, couplings) [rad]
    steering: FloatArray  # of the axles that the plan steers, shape (n, active) [rad]
    half_width: FloatArray  # [m]
    saturated: BoolArray  # the road is tighter than any balanced circle

    @property
    def weight(self) -> FloatArray:
        """K, the lead axle's coefficient per auxiliary axle's; held at +-1000 where the lead axle alone is centred."""
        return ratio(self.lead, self.aux)

    @cached_property
    def states(self) -> FloatArray:
        """The vehicle's road-aligned states, shape (n, states)."""
        return np.column_stack([self.e_y, self.e_psi, self.beta, self.steering])


@dataclass(frozen=True)
class CentringTable:
    """One vehicle's stationary geometry over curvature."""

    grid: Stationary
    tightest_road: float  # [1/m]

    @classmethod
    @lru_cache(maxsize=_KEPT)
    def of(cls, vehicle: Vehicle) -> CentringTable:
        """Tabulate the balanced circles of ``vehicle``; the last vehicles' tables are kept."""
        return cls(stationary(vehicle, _GRID), tightest_road(vehicle))

    def at(self, road_curvature: FloatArray) -> Centring:
        """Return the geometry at signed road curvatures [1/m]; beyond the tightest circle it is held."""
        grid, sign, k = self.grid, np.sign(road_curvature), np.abs(road_curvature)

        def column(values: FloatArray) -> FloatArray:
            return np.interp(k, grid.road_curvature, values)

        def columns(values: FloatArray) -> FloatArray:
            return np.stack([sign * column(one) for one in values.T], axis=-1) if values.size else np.empty((len(k), 0))

        return Centring(
            lead=column(grid.lead),
            aux=column(grid.aux),
            target=sign * column(grid.target),
            kappa=sign * column(grid.kappa),
            e_y=sign * column(grid.e_y),
            axle=grid.axle,
            e_aux=sign * column(grid.e_aux),
            e_psi=sign * column(grid.e_psi),
            beta=columns(grid.beta),
            steering=columns(grid.steering),
            half_width=column(grid.half_width),
            saturated=k >= self.tightest_road,
        )
