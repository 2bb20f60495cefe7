"""Everything about road and vehicle that planning needs at the sampled stations of a whole drive.

Stations are ``step`` metres apart from s = 0 to one horizon beyond the road's end, so that the horizon of each planning
step is a slice and nothing about the road is computed twice.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.centring.weights import Centring, CentringTable
from hdvplan.planning.bias import NONE, Bias, shifted
from hdvplan.planning.running import running
from hdvplan.road.path import ReferencePath, evaluate_many
from hdvplan.road.road import Limits, Road
from hdvplan.vehicle.model import Vehicle

LIMIT_SPACING_M = 0.2  # limits are tabulated this finely along s
_FINE_M = 0.05  # and looked up this finely for that
_ROOM_M = 10.0  # table beyond the vehicle's ends, for bodies that stand askew
_STRAIGHT = 1.15  # road beside a body is at most so many times as long where the road is nearly straight
_SLACK_M = 1.0  # of rounding to the grid, and of corners of a body askew
_STRETCH = 1.25  # a body point moves at most this much further than the lead axle's station, along the road


# What planning knows of the road at one station: the road itself, and what the vehicle can meet anywhere along its length when its lead
# axle is there.
STATION = core.record(
    "hdv_station",
    [
        ("s", float),  # [m]
        *((name, float) for name in ("x", "y", "cos", "sin", "curvature")),  # [m, 1/m]
        ("curvature_between", float),  # half-way to the next station [1/m]
        ("room_left", float),  # the narrowest reach that limits leave [m]; infinite without limits
        ("room_right", float),
        ("k_low", float),  # smallest and largest signed curvature [1/m]
        ("k_high", float),
        ("varies", float),  # 1 where limits vary, 0 where they are constant
        ("margin", float),  # what a body may reach beyond the limits between stations when it keeps them at every station [m]
    ],
)


class LimitTable(NamedTuple):
    """Signed limits on a uniform grid: rows left, right, left_sweep, right_sweep; shape (4, n) or (4, 0) without limits.

    Every entry, and every line between two, is the narrowest of the road's limits that a body point can meet between the station
    where it is there and the next one: a sudden narrowing between stations cannot be missed.
    """

    values: FloatArray
    s_first: float  # [m]
    spacing: float  # [m]
    two_regions: bool = False  # overhangs have more room than wheels somewhere


@dataclass(frozen=True)
class Stations:
    """The stations of a drive, ``step`` metres apart."""

    path: ReferencePath
    step: float  # [m]
    points: Records  # (n,) of ``STATION``
    centring: Centring
    limits: LimitTable
    bias: FloatArray  # wanted middle of the swept envelope, (n,) [m]; ``centring`` is that of the line there

    @property
    def s(self) -> FloatArray:
        """Arclengths, (n,) [m]."""
        return self.points["s"]

    @property
    def curvature(self) -> FloatArray:
        """The road's curvature, (n,) [1/m]."""
        return self.points["curvature"]


def stations_of(road: Road, vehicle: Vehicle, table: CentringTable, *, step: float, horizon: float, bias: Bias = NONE) -> Stations:
    """Sample ``road`` for driving ``vehicle`` along all of it with the given step and horizon [m], balanced about ``bias``.

    Raises:
        OptionError: the bias lies beyond the road's centre of curvature.

    """
    count = int(np.ceil(road.path.length / step - 1e-9)) + round(horizon / step) + 1
    last = step * count
    before, after = vehicle.reach_behind + _ROOM_M, last - road.path.length + vehicle.reach_ahead + _ROOM_M
    path = road.path.extended(before, after)
    s = step * np.arange(count, dtype=np.float64)
    points = np.zeros(count, STATION)
    points["s"] = s
    for name, row in zip(("x", "y", "cos", "sin", "curvature"), evaluate_many(path, s), strict=True):
        points[name] = row
    points["curvature_between"] = evaluate_many(path, s + 0.5 * step)[4]
    limits = limit_table(road, path, step)
    for name, row in zip(("room_left", "room_right", "k_low", "k_high", "varies"), _around(path, limits, s, vehicle), strict=True):
        points[name] = row
    points["margin"] = _margin(points, vehicle, step)
    offset, halfway = (bias.at(np.asarray(np.mod(at, road.path.length)) if path.closed else at) for at in (s, s + 0.5 * step))
    balanced = table.at(shifted(points["curvature"], offset, s))
    shifted(points["curvature_between"], halfway, s)  # refused now rather than when the drive is judged
    centring = replace(balanced, e_y=balanced.e_y + offset, e_aux=balanced.e_aux + offset)
    return Stations(path, step, points, centring, limits, offset)


def _margin(points: Records, vehicle: Vehicle, step: float) -> FloatArray:
    """Return how far a point's track can bow out between two stations, shape (n,) [m].

    Between stations the curvature is held: a point's track bends no more than the lead axle's, or than wheels turn, and the road
    beside it no more than ``points`` say. Over a chord of length l their difference k bows by k l^2 / 8; so does the road between
    entries of the table.
    """
    turning = max(unit.max_steering_rate for unit in vehicle.units)  # of an actively steered axle's wheels
    bend = vehicle.max_curvature + turning + np.maximum(np.abs(points["k_low"]), np.abs(points["k_high"]))
    bow: FloatArray = bend * (_STRETCH * step) ** 2 / 8.0
    return bow


def _around(path: ReferencePath, limits: LimitTable, s: FloatArray, vehicle: Vehicle) -> FloatArray:
    """Return the extremes of limits and curvature over the length of road beside the vehicle: ``STATION`` from room_left to varies.

    Beside an offset e the road is 1 / (1 - k e) times as long as a body. Screening trusts no more than twice, and needs no more than
    ``_STRAIGHT`` where the road is nearly straight: fewer stations then meet a narrow place.
    """
    grid = np.arange(path.s_first, path.s_last, LIMIT_SPACING_M)
    k = evaluate_many(path, grid)[4]
    nearest = np.clip(np.round((s - path.s_first) / LIMIT_SPACING_M).astype(int), 0, len(grid) - 1)
    values = limits.values[:, : len(grid)] if limits.values.size else np.tile([[np.inf], [-np.inf]] * 2, len(grid))
    bent, straight = (_beside(values, k, factor, vehicle)[:, nearest] for factor in (2.0, _STRAIGHT))
    room, bend = np.maximum(straight[0], straight[1]), np.maximum(np.abs(bent[2]), np.abs(bent[3]))
    room[np.isinf(room)] = 0.0  # without limits nothing is screened
    return np.where(bend * room <= 1.0 - 1.0 / _STRAIGHT, straight, bent)


def _beside(values: FloatArray, k: FloatArray, factor: float, vehicle: Vehicle) -> FloatArray:
    """Return the rows of ``_around`` on the table's grid, over ``factor`` times the vehicle's length to both sides of its lead axle."""
    ahead, behind = (int(np.ceil((factor * reach + _SLACK_M) / LIMIT_SPACING_M)) for reach in (vehicle.reach_ahead, vehicle.reach_behind))
    low, high = (partial(running, pick, behind=behind, ahead=ahead) for pick in (np.minimum, np.maximum))
    left, right = np.min(values[[0, 2]], axis=0), -np.max(values[[1, 3]], axis=0)
    finite = np.where(np.isfinite(values), values, 0.0)
    varies = np.any(high(finite) > low(finite), axis=0)
    return np.stack([low(left), low(right), low(k), high(k), varies.astype(float)])


def limit_table(road: Road, path: ReferencePath, step: float) -> LimitTable:
    """Tabulate the road's limits over the whole extended path for stations ``step`` [m] apart; ``Limits.along`` says what holds there."""
    if road.limits is None:
        return LimitTable(np.empty((4, 0)), 0.0, LIMIT_SPACING_M)
    every = round(LIMIT_SPACING_M / _FINE_M)
    count = int(np.ceil((path.s_last - path.s_first) / LIMIT_SPACING_M)) + 1
    s = path.s_first + _FINE_M * np.arange(every * count, dtype=np.float64)
    limits = road.limits.along(road.path, float(s[0]), float(s[-1]))
    values = limits.table(s)
    fine = LimitTable(values, float(s[0]), _FINE_M)
    _cover_corners(fine, limits)
    reach = int(np.ceil((_STRETCH * step + LIMIT_SPACING_M) / _FINE_M))
    narrowest = [running(pick, row, reach, reach) for pick, row in zip((np.minimum, np.maximum) * 2, values, strict=True)]
    table = np.ascontiguousarray(np.stack(narrowest)[:, ::every])
    return LimitTable(table, float(s[0]), LIMIT_SPACING_M, road.limits.two_regions)


def _cover_corners(fine: LimitTable, limits: Limits) -> None:
    """Narrow the entries around every corner of the limits down to it: it may lie between two entries."""
    columns, narrower = (limits.left, limits.right, limits.left_sweep, limits.right_sweep), (np.minimum, np.maximum) * 2
    place = (limits.s - fine.s_first) / fine.spacing
    inside = (place >= 0.0) & (place <= fine.values.shape[1] - 1)
    for entry in (np.floor(place[inside]).astype(int), np.ceil(place[inside]).astype(int)):
        for row, column, narrow in zip(fine.values, columns, narrower, strict=True):
            narrow.at(row, entry, column[inside])
