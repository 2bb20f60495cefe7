"""Everything about road and vehicle that planning needs at the sampled stations of a whole drive.

Stations are ``step`` metres apart from s = 0 to one horizon beyond the road's end, so that the horizon of each planning
step is a slice and nothing about the road is computed twice.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records, running
from hdvplan.centring.stationary import Centring, CentringTable
from hdvplan.planning.bias import NONE, Bias, shifted
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.path import ReferencePath, evaluate_many
from hdvplan.road.pieces import Pieces
from hdvplan.road.regions import OPEN_M
from hdvplan.road.road import Road
from hdvplan.road.street import Street, rooms_of
from hdvplan.vehicle.model import Vehicle

BETWEEN = core.number("HDV_BETWEEN")  # poses of a step that are looked at where a body is near a kerb
_SPACING_M = 0.2  # of the places of the line whose distance from the kerbs is known
ROOM_M = 10.0  # table beyond the vehicle's ends, for bodies that stand askew
_STRAIGHT = 1.15  # road beside a body is at most so many times as long where the road is nearly straight
_CHORD_M = 1.5e-3  # of kerbs, which are polygons to 1 mm, and of rows that follow a motion
_SLACK_M = 1.0  # of rounding to the grid, and of corners of a body askew
_EVERYWHERE = (-np.inf, np.inf, np.inf)  # limits give way there by as much as they do
_STRETCH = 1.25  # a body point moves at most this much further than the lead axle's station, along the road


# What planning knows of the road at one station: the road itself, and what the vehicle can meet anywhere along its length when its lead
# axle is there; hdvplan/core/hdvplan.h has the fields.
STATION = core.record("hdv_station")


@dataclass(frozen=True)
class Stations:
    """The stations of a drive, ``step`` metres apart."""

    path: ReferencePath
    step: float  # [m]
    points: Records  # (n,) of ``STATION``
    centring: Centring
    street: Pieces | None  # the kerbs of what is planned in; None without limits
    bias: FloatArray  # wanted middle of the swept envelope, (n,) [m]; ``centring`` is that of the line there

    @property
    def s(self) -> FloatArray:
        """Arclengths, (n,) [m]."""
        return self.points["s"]

    @property
    def curvature(self) -> FloatArray:
        """The road's curvature, (n,) [1/m]."""
        return self.points["curvature"]

    def giving_way(self, settings: PlannerSettings) -> Stations:
        """Return the stations with what limits give way by at each."""
        points, s = self.points.copy(), self.s
        most = [np.where((s >= first) & (s <= last), depth, 0.0) for first, last, depth in settings.give_way_on or (_EVERYWHERE,)]
        points["give_way"] = np.minimum(settings.give_way, np.max(most, axis=0))
        return replace(self, points=points)

    def ahead(self, values: FloatArray, by: float) -> FloatArray:
        """Return what ``values`` (n,) of the stations are ``by`` further along the line than each of them [m], between them linear."""
        order = np.argsort(self.s, kind="stable")  # those of a leg that is driven backwards come in the opposite order
        return np.asarray(np.interp(self.s + by, self.s[order], values[order]))


def stations_of(road: Road, vehicle: Vehicle, table: CentringTable, *, step: float, horizon: float, bias: Bias = NONE) -> Stations:
    """Sample ``road`` for driving ``vehicle`` along all of it with the given step and horizon [m], balanced about ``bias``.

    Raises:
        OptionError: the bias lies beyond the road's centre of curvature.

    """
    count = int(np.ceil(road.path.length / step - 1e-9)) + round(horizon / step) + 1
    before, after = vehicle.reach_behind + ROOM_M, step * count - road.path.length + vehicle.reach_ahead + ROOM_M
    path = road.path.extended(before, after)
    return sampled(path, road.street, vehicle, table, step=step, count=count, bias=bias)


def sampled(
    path: ReferencePath,
    beside: Street | None,
    vehicle: Vehicle,
    table: CentringTable,
    *,
    step: float,
    count: int,
    first: int = 0,
    bias: Bias = NONE,
) -> Stations:
    """Return ``count`` stations from the ``first`` on, along a ``path`` which reaches beyond them as far as bodies do, in a street.

    Station 0 is at the road's start.

    Raises:
        OptionError: the bias lies beyond the road's centre of curvature.

    """
    s = step * np.arange(first, first + count, dtype=np.float64)
    points = np.zeros(count, STATION)
    points["s"], points["step"] = s, step
    for name, row in zip(("x", "y", "cos", "sin", "curvature"), evaluate_many(path, s), strict=True):
        points[name] = row
    points["curvature_between"] = evaluate_many(path, s + 0.5 * step)[4]
    street = None if beside is None else beside.pieces(path.s_first, path.s_last)
    for name, row in zip(("room_left", "room_right", "k_low", "k_high"), _around(path, street, s, vehicle), strict=True):
        points[name] = row
    points["margin"] = _margin(points, vehicle, step)
    offset, halfway = (bias.at(np.asarray(np.mod(at, path.length)) if path.closed else at) for at in (s, s + 0.5 * step))
    balanced = table.at(shifted(points["curvature"], offset, s))
    shifted(points["curvature_between"], halfway, s)  # refused now rather than when the drive is judged
    centring = replace(balanced, e_y=balanced.e_y + offset, e_aux=balanced.e_aux + offset)
    return Stations(path, step, points, centring, street, offset)


def _margin(points: Records, vehicle: Vehicle, step: float) -> FloatArray:
    """Return how far a point's track can bow out between two poses that are looked at, shape (n,) [m].

    Between stations the curvature is held: a point's track bends no more than the lead axle's, or than wheels turn, and the road
    beside it no more than ``points`` say. Over a chord of length l their difference k bows by k l^2 / 8; and kerbs are polygons.
    """
    turning = max(unit.max_steering_rate for unit in vehicle.units)  # of an actively steered axle's wheels
    bend = vehicle.max_curvature + turning + np.maximum(np.abs(points["k_low"]), np.abs(points["k_high"]))
    return np.asarray(_CHORD_M + bend * (_STRETCH * step / BETWEEN) ** 2 / 8.0)


def _around(path: ReferencePath, street: Pieces | None, s: FloatArray, vehicle: Vehicle) -> FloatArray:
    """Return the extremes of room and curvature over the length of road beside the vehicle: ``STATION`` from room_left to k_high.

    Beside an offset e the road is 1 / (1 - k e) times as long as a body. Screening trusts no more than twice, and needs no more than
    ``_STRAIGHT`` where the road is nearly straight: fewer stations then meet a narrow place.
    """
    grid = np.arange(path.s_first, path.s_last, _SPACING_M)
    x, y, _, _, k = evaluate_many(path, grid)
    rooms = np.full((2, len(grid)), np.inf) if street is None else np.minimum(rooms_of(street, grid, x, y), OPEN_M)
    nearest = np.clip(np.round((s - path.s_first) / _SPACING_M).astype(int), 0, len(grid) - 1)
    bent, straight = (_beside(rooms, k, factor, vehicle)[:, nearest] for factor in (2.0, _STRAIGHT))
    room, bend = np.maximum(straight[0], straight[1]), np.maximum(np.abs(bent[2]), np.abs(bent[3]))
    room[np.isinf(room)] = 0.0  # without limits nothing is screened
    return np.where(bend * room <= 1.0 - 1.0 / _STRAIGHT, straight, bent)


def _beside(rooms: FloatArray, k: FloatArray, factor: float, vehicle: Vehicle) -> FloatArray:
    """Return the rows of ``_around`` on its grid, over ``factor`` times the vehicle's length to both sides of its lead axle."""
    ahead, behind = (int(np.ceil((factor * reach + _SLACK_M) / _SPACING_M)) for reach in (vehicle.reach_ahead, vehicle.reach_behind))
    low, high = (partial(running, pick, behind=behind, ahead=ahead) for pick in (np.minimum, np.maximum))
    return np.stack([low(rooms[0]), low(rooms[1]), low(k), high(k)])
