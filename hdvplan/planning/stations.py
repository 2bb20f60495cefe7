"""Everything about road and vehicle that planning needs at the sampled stations of a whole drive.

Stations are ``step`` metres apart from s = 0 to one horizon beyond the road's end, so that the horizon of each planning
step is a slice and nothing about the road is computed twice.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from hdvplan.centering.weights import Centering, CenteringTable
from hdvplan.jit import FloatArray
from hdvplan.planning.bias import NONE, Bias, shifted
from hdvplan.road.path import ReferencePath, evaluate_many
from hdvplan.road.road import Road
from hdvplan.vehicle.model import Vehicle

LIMIT_SPACING_M = 0.25  # limits are tabulated this finely along s; jumps become ramps of this length
_ROOM_M = 10.0  # table beyond the vehicle's ends, for bodies that stand askew


@dataclass(frozen=True)
class LimitTable:
    """Signed limits on a uniform grid: rows left, right, left_sweep, right_sweep; shape (4, n) or (4, 0) without limits."""

    values: FloatArray
    s_first: float  # [m]
    spacing: float  # [m]


@dataclass(frozen=True)
class Stations:
    """The stations of a drive. ``road`` has rows x, y, cos(psi), sin(psi), curvature; shape (5, n).

    ``around`` bounds what the vehicle can meet anywhere along its length when its lead axle is at a station; rows narrowest
    left and right reach [m], smallest and largest signed curvature [1/m]; shape (4, n).
    """

    path: ReferencePath
    step: float  # [m]
    s: FloatArray  # (n,)
    road: FloatArray  # (5, n)
    curvature_between: FloatArray  # half-way to the next station, (n,) [1/m]
    centering: Centering
    limits: LimitTable
    around: FloatArray
    bias: FloatArray  # wanted middle of the swept envelope, (n,) [m]; ``centering`` is that of the line there


def stations_of(road: Road, vehicle: Vehicle, table: CenteringTable, *, step: float, horizon: float, bias: Bias = NONE) -> Stations:
    """Sample ``road`` for driving ``vehicle`` along all of it with the given step and horizon [m], balanced about ``bias``.

    Raises:
        OptionError: the bias lies beyond the road's centre of curvature.

    """
    count = int(np.ceil(road.path.length / step - 1e-9)) + round(horizon / step) + 1
    last = step * count
    before, after = vehicle.reach_behind + _ROOM_M, last - road.path.length + vehicle.reach_ahead + _ROOM_M
    path = road.path.extended(before, after)
    s = step * np.arange(count, dtype=np.float64)
    at_stations = evaluate_many(path.coefficients, path.s_first, path.spacing, s)
    between = evaluate_many(path.coefficients, path.s_first, path.spacing, s + 0.5 * step)[4]
    limits = limit_table(road, path)
    around = _around(path, limits, s, vehicle)
    offset = bias.at(s)
    balanced = table.at(shifted(at_stations[4], offset, s))
    centering = replace(balanced, e_y=balanced.e_y + offset, e_aux=balanced.e_aux + offset)
    return Stations(path, step, s, at_stations, between, centering, limits, around, offset)


def _around(path: ReferencePath, limits: LimitTable, s: FloatArray, vehicle: Vehicle) -> FloatArray:
    """Return the extremes of limits and curvature over the vehicle's length, with room for bodies that stand askew."""
    grid = np.arange(path.s_first, path.s_last, LIMIT_SPACING_M)
    k = evaluate_many(path.coefficients, path.s_first, path.spacing, grid)[4]
    reach = max(vehicle.reach_ahead, vehicle.reach_behind) + _ROOM_M
    size = 2 * int(np.ceil(reach / LIMIT_SPACING_M)) + 1
    rows = [minimum_filter1d(k, size, mode="nearest"), maximum_filter1d(k, size, mode="nearest")]
    if limits.values.size:
        left = np.min(limits.values[[0, 2], : len(grid)], axis=0)
        right = -np.max(limits.values[[1, 3], : len(grid)], axis=0)
        rows = [minimum_filter1d(side, size, mode="nearest") for side in (left, right)] + rows
    else:
        rows = [np.full(len(grid), np.inf)] * 2 + rows
    nearest = np.clip(np.round((s - path.s_first) / LIMIT_SPACING_M).astype(int), 0, len(grid) - 1)
    return np.ascontiguousarray(np.stack(rows)[:, nearest])


def limit_table(road: Road, path: ReferencePath) -> LimitTable:
    """Tabulate the road's limits over the whole extended path; the end values hold beyond the road's ends."""
    if road.limits is None:
        return LimitTable(np.empty((4, 0)), 0.0, LIMIT_SPACING_M)
    s = np.arange(path.s_first, path.s_last + LIMIT_SPACING_M, LIMIT_SPACING_M)
    around = np.mod(s, road.path.length) if road.path.closed else s
    return LimitTable(np.ascontiguousarray(road.limits.table(around)), float(s[0]), LIMIT_SPACING_M)
