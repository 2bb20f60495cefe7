"""The geometric weight K along a road of varying curvature, and the stationary geometry that goes with it.

The stationary circle is solved once per vehicle on a grid of curvatures and interpolated: one root search a stage
would cost more than the whole planning step.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.centring.stationary import Centring, stationary, tightest_road
from hdvplan.vehicle.model import Vehicle

_GRID = np.linspace(0.0, 0.5, 2001)  # road curvatures [1/m]; linear interpolation errs by less than 1e-6 in K up to 0.1 1/m
_KEPT = 64  # tables of some 200 kB


@dataclass(frozen=True)
class CentringTable:
    """One vehicle's stationary geometry over curvature."""

    grid: Centring  # over ``_GRID``
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
            return np.interp(k, _GRID, values)

        def columns(values: FloatArray) -> FloatArray:
            return np.stack([sign * column(one) for one in values.T], axis=-1) if values.size else np.empty((len(k), 0))

        even = {name: column(getattr(grid, name)) for name in ("lead", "aux", "half_width")}
        odd = {name: sign * column(getattr(grid, name)) for name in ("target", "kappa", "e_y", "e_aux", "e_psi")}
        saturated = k >= self.tightest_road
        return Centring(**even, **odd, axle=grid.axle, beta=columns(grid.beta), steering=columns(grid.steering), saturated=saturated)
