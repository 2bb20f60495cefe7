"""Balance the swept envelope itself: at every place of the road its left and right reach, over the whole manoeuvre.

Each place's left and right reach belong to one point of one stage each: see hdvplan/core/balance.c and tracks.c. A step of Gauss and
Newton that moves each of the two by half of the imbalance keeps the program's stages apart: with a + b the change of the imbalance I,
(I + a + b)^2 <= 2 (I/2 + a)^2 + 2 (I/2 + b)^2, with equality at a = b. ``docs/balanced.md`` has the derivation, and why it converges.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.errors import OptionError
from hdvplan.planning.terms.centring import Centring, CentringPart, Residual
from hdvplan.planning.terms.term import Columns, CorePart, Scene, Term, core_functions
from hdvplan.vehicle.kinematics import POSE, axles_behind
from hdvplan.vehicle.model import Vehicle

_POINTS = core.number("HDV_TRACING_POINTS")  # of a body
_ROOM = 2  # places and stages beyond the vehicle's length, for bodies that stand askew
# Of its axle, of its axis [m]; see ``tracing_points``.
_POINT = core.record("hdv_tracing_point")
# Of one point at one stage [m]; the foot is NaN where there is none.
_TRACK = core.record("hdv_track")
_REACHED = core.record("hdv_furthest")
_BODIES = core.record("hdv_bodies")
_TRACKS = core.record("hdv_tracks")
_BALANCE = core.record("hdv_balance", bodies=_BODIES, tracks=_TRACKS)
_FUNCTIONS = core_functions("balance")


@dataclass(frozen=True)
class EnvelopeBalance(Term):
    """The middle of the swept envelope at every place, measured on the plan; ``aim`` (n,) is where it should lie [m].

    ``beside`` is the stationary residual: all of it where a plan does not yet sweep a place to its end, a small share elsewhere.
    What the defaults gain and cost, and the alternatives, is measured in ``results/balanced``.
    """

    beside: Residual
    aim: FloatArray
    share: float = 0.015  # of ``beside`` where the plan is measured: holds the largest reach down where the two disagree
    rounding: float = 0.05  # an imbalance counts with its square up to about this, with its magnitude beyond [m]
    relaxation: float = 4.0 / 3.0  # of the step that is safe on its own; below 2 no step makes the objective worse
    ahead: float = 50.0  # places as far ahead as this are balanced: those beyond are planned again before they are driven [m]

    def part(self, scene: Scene, columns: Columns) -> BalancePart:
        """Return the term as part of the program: see ``Term``."""
        vehicle, stations, stages = scene.vehicle, scene.stations, scene.settings.stages
        if not np.all(np.isfinite(self.aim)):
            msg = "the aim of a balance is not finite"
            raise OptionError(msg, hint="it has one length a station [m]")
        before = int(np.ceil(vehicle.reach_behind / stations.step)) + _ROOM
        after = int(np.ceil(vehicle.reach_ahead / stations.step)) + _ROOM
        swept = min(stages - before, int(min(self.ahead / stations.step, stages)) + after)
        points = tracing_points(vehicle, axles_behind(vehicle), stations.step)
        count, units = len(stations.s), len(vehicle.units)
        measured = Measured(
            np.zeros((stages + 1, units), POSE), np.zeros((stages + 1, *points.shape), _TRACK), np.zeros((2, count), _REACHED),
            np.zeros((2, count), _REACHED),
        )  # fmt: skip
        for reached in (measured.reached, measured.driven):
            reached["reach"], reached["stage"] = -np.inf, -1
        centring = Centring(self.beside).part(scene, columns)
        weights = centring.weights.copy()
        weights[1 : max(swept - after, 0) + 1] = self.share
        beside = centring.weighed(weights)
        window = Window(swept - after, swept, before)
        road = (points, stations.path.record, stations.points)
        bodies = (core.address(scene.units), units, *map(core.address, road), count, stations.step)
        centrings = core.address(centring.data), core.address(beside.data)
        poses, tracks, *reaches = map(core.address, measured)
        own = (
            core.address(self.aim, np.dtype(float), (count,)),
            self.rounding,
            self.relaxation,
            *window,
            *centrings,
            (poses, tracks),
            *reaches,
            -1,
            0.0,
        )
        data = np.array([(bodies, *own)], _BALANCE)
        # places do not move with the plan: it shifts what centring remembers alone
        return BalancePart(scene, _FUNCTIONS, data, centring, beside, window, measured, kept=(*road, self.aim), memory=centring.memory)


class Window(NamedTuple):
    """Which stages and places of a horizon are balanced."""

    stages: int  # last stage whose objective is the balance
    places: int  # last place, counted from the first stage, that the plan sweeps from end to end
    before: int  # places behind the first stage that the vehicle can still sweep


class Measured(NamedTuple):
    """What the last plan sweeps, and what was swept by driving."""

    track_poses: Records  # (N+1, units) of ``POSE``, of the last plan
    track_points: Records  # (N+1, units, 6) of ``_TRACK``
    reached: Records  # (2, places) of ``_REACHED``, with the plan: left and right
    driven: Records  # (2, places) of ``_REACHED``, without


@dataclass(frozen=True)
class BalancePart(CorePart):
    """The balance as part of a program; see ``Part``."""

    centring: CentringPart  # of stages that were not measured yet
    beside: CentringPart  # the same, with a share where the plan is measured
    window: Window
    measured: Measured


def tracing_points(vehicle: Vehicle, behind: FloatArray, step: float) -> Records:
    """Return the points of every body that trace its envelope, shape (units, 6): front, axle and rear, left and right of each.

    ``start`` is how many places a point lies ahead of the lead rear axle on a straight, every axle ``behind`` it by so much [m].
    """
    table = np.zeros((len(vehicle.units), _POINTS), _POINT)
    for row, unit in zip(table, vehicle.units, strict=True):
        row["ahead"] = np.repeat([unit.front, 0.0, -unit.rear_overhang], 2)
        row["left"] = np.tile([0.5 * unit.width, -0.5 * unit.width], 3)
    table["start"] = np.round((table["ahead"] - behind[:, None]) / step)
    return table
