"""The stations of a drive of several legs, as one sequence that planning looks ahead along, across the cusps.

A leg's stations count along the line as the vehicle heads. Driven backwards they come in the opposite order, and the step from one to the
next is negative: without slip a motion can be reversed in time, so that dynamics, limits and objective are those of driving forwards. At
a cusp the vehicle stands: there the step is none, the state is handed on, and wheels turn freely (hdvplan/core/standing.h).

All legs' lines lie one after the other in one table, each as far beyond its ends as bodies reach: a foot is searched near where it was,
and never on another leg.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import accumulate
from typing import Any

import numpy as np

from hdvplan.arrays import FloatArray, IntArray
from hdvplan.centring.stationary import Centring, CentringTable
from hdvplan.planning.stations import ROOM_M, Stations, sampled
from hdvplan.road.legs import Leg
from hdvplan.road.path import KNOT_SPACING_M, ReferencePath, from_samples
from hdvplan.road.pieces import PIECE, Pieces, laid_out
from hdvplan.vehicle.model import Vehicle

_FOOT_M = 15.0  # within which feet are searched, beyond the vehicle's ends: LOCAL_M of hdvplan/core/path.h
_ARCLENGTHS = ("s_low", "s_high", "s_begin", "s_end")


@dataclass(frozen=True)
class Way:
    """One leg among the stations of a course: it begins at number ``first`` of them, and has so many ``steps``.

    ``stations`` lie in order of s, ``before`` of them before the line's start: where a plan looks beyond the last leg.
    """

    leg: Leg
    stations: Stations
    first: int
    steps: int
    before: int

    @property
    def step(self) -> float:
        """From a station to the next in the order of driving [m]."""
        return -self.stations.step if self.leg.backward else self.stations.step

    @property
    def own(self) -> Stations:
        """The stations of the line itself, in order of s."""
        part, all_ = slice(self.before, self.before + self.steps + 1), self.stations
        return replace(all_, points=all_.points[part], centring=_picked(all_.centring, part), bias=all_.bias[part])

    @property
    def order(self) -> IntArray:
        """The numbers of its stations in the order of driving."""
        numbers = np.arange(len(self.stations.s))
        return numbers[::-1] if self.leg.backward else numbers

    def s(self, station: int) -> float:
        """Return the arclength on its line of a station of the course [m]."""
        done, all_ = station - self.first, self.stations.s
        return float(all_[len(all_) - 1 - done if self.leg.backward else done])


@dataclass(frozen=True)
class Course:
    """The stations of all legs in the order of driving; the vehicle stands at the first one, and at cusps.

    From ``end`` on the last leg's line is driven on, where nothing limits it: what is planned must not end in a fold.
    """

    stations: Stations
    ways: tuple[Way, ...]
    end: int


def course_of(legs: Sequence[Leg], vehicle: Vehicle, *, step: float, stages: int) -> Course:
    """Sample legs with stations at most ``step`` [m] apart, each with whole steps; a plan looks ahead over ``stages`` of them."""
    table, ways, first = CentringTable.of(vehicle), list[Way](), 1
    for number, leg in enumerate(legs):
        way = _way(leg, vehicle, table, step, first, stages if number + 1 == len(legs) else 0)
        ways.append(way)
        first += way.steps + 1
    order = [way.order for way in ways]
    order[0] = np.append(order[0][0], order[0])
    path, offsets = _joined([way.stations.path for way in ways])
    points = np.concatenate([way.stations.points[own] for way, own in zip(ways, order, strict=True)])
    points["s"] += np.repeat(offsets, [len(own) for own in order])
    points["step"] = ways[-1].step
    for way in ways:
        points["step"][way.first - 1], points["step"][way.first : way.first + way.steps] = 0.0, way.step
    backwards = points["step"] < 0.0
    points["curvature_between"][:-1] = np.where(backwards[:-1], points["curvature_between"][1:], points["curvature_between"][:-1])
    end = ways[-1].first + ways[-1].steps
    points["room_left"][end + 1 :] = points["room_right"][end + 1 :] = np.inf
    centring = _behind_each_other([_picked(way.stations.centring, own) for way, own in zip(ways, order, strict=True)])
    street = _street([way.stations for way in ways], offsets)
    return Course(Stations(path, step, points, centring, street, np.zeros(len(points))), tuple(ways), end)


def _way(leg: Leg, vehicle: Vehicle, table: CentringTable, step: float, first: int, stages: int) -> Way:
    """Return a leg with whole steps; ``stages`` stations lie beyond its end."""
    length, room = leg.road.path.length, vehicle.reach_ahead + vehicle.reach_behind + ROOM_M + _FOOT_M
    steps = max(1, int(np.ceil(length / step - 1e-9)))
    before, beyond = (stages, 0) if leg.backward else (0, stages)
    path = leg.road.path.extended(room + before * step, room + beyond * step)
    count = before + steps + 1 + beyond
    stations = sampled(path, leg.road.street, vehicle, table, step=length / steps, first=-before, count=count)
    return Way(leg, stations, first, steps, before)


def _joined(paths: Sequence[ReferencePath]) -> tuple[ReferencePath, FloatArray]:
    """Return the tables of paths behind each other, and what to add to each one's arclengths (paths,) [m]."""
    counts = [int((path.s_last - path.s_first) / KNOT_SPACING_M) for path in paths]
    begins = KNOT_SPACING_M * np.array([0, *accumulate(counts)], dtype=np.float64)
    tables = []
    for path, count in zip(paths, counts, strict=True):
        at = path.at(path.s_first + KNOT_SPACING_M * np.arange(count + 1, dtype=np.float64))
        tables.append(from_samples(at.x, at.y, at.heading, at.curvature, KNOT_SPACING_M).coefficients)
    whole = ReferencePath(np.vstack(tables), 0.0, KNOT_SPACING_M, float(begins[-1]), closed=False)
    return whole, begins[:-1] - np.array([path.s_first for path in paths])


def _arrays(centring: Centring) -> dict[str, Any]:
    return {field.name: getattr(centring, field.name) for field in fields(centring) if field.name != "axle"}


def _picked(centring: Centring, which: slice | IntArray) -> Centring:
    return replace(centring, **{name: rows[which] for name, rows in _arrays(centring).items()})


def _behind_each_other(parts: Sequence[Centring]) -> Centring:
    rows = [_arrays(part) for part in parts]
    joined: dict[str, Any] = {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}
    return replace(parts[0], **joined)


def _street(legs: Sequence[Stations], offsets: FloatArray) -> Pieces | None:
    """Return the kerbs beside all legs, each leg's at its place in the joined table; None without any."""
    found, kerbs = [np.zeros(0, PIECE)], 0
    for leg, offset in zip(legs, offsets, strict=True):
        if leg.street is None:
            continue
        path, all_ = leg.path, leg.street.pieces
        pieces = all_[(all_["s_high"] >= path.s_first) & (all_["s_low"] <= path.s_last)].copy()
        for name in ("s_low", "s_high"):
            pieces[name] = np.clip(pieces[name], path.s_first, path.s_last)
        for name in _ARCLENGTHS:
            pieces[name] += offset
        pieces["kerb"] += kerbs
        kerbs += int(np.max(all_["kerb"], initial=-1)) + 1
        found.append(pieces)
    pieces = np.concatenate(found)
    return laid_out(pieces) if len(pieces) else None
