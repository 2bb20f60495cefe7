"""Balance the swept envelope itself: at every place of the road its left and right reach, over the whole manoeuvre.

Each place's left and right reach belong to one point of one stage each, see ``tracks``. A step of Gauss and Newton that moves each of
the two by half of the imbalance keeps the program's stages apart: with a + b the change of the imbalance I,
(I + a + b)^2 <= 2 (I/2 + a)^2 + 2 (I/2 + b)^2, with equality at a = b. ``docs/balanced.md`` has the derivation, why it converges, and
what was measured.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from hdvplan.jit import FloatArray, IntArray, Records, compiled
from hdvplan.planning.terms.centring import Centring, CentringPart, Residual
from hdvplan.planning.terms.term import Horizon, Needs, Place, Scene
from hdvplan.planning.terms.tracks import REACH, Bodies, Tracks, cover, empty_tracks, trace, tracing_points
from hdvplan.vehicle.body import axles_behind
from hdvplan.vehicle.kinematics import body_point, point_gradient
from hdvplan.vehicle.model import Vehicle

_ROOM = 2  # places and stages beyond the vehicle's length, for bodies that stand askew


@dataclass(frozen=True)
class EnvelopeBalance:
    """The middle of the swept envelope at every place, measured on the plan; ``aim`` (n,) is where it should lie [m].

    ``beside`` is the stationary residual: all of it where a plan does not yet sweep a place to its end, a small share elsewhere.
    What the defaults gain and cost, and the alternatives, is measured in ``docs/balanced.md``.
    """

    beside: Residual
    aim: FloatArray
    share: float = 0.015  # of ``beside`` where the plan is measured: holds the largest reach down where the two disagree
    rounding: float = 0.05  # an imbalance counts with its square up to about this, with its magnitude beyond [m]
    relaxation: float = 4.0 / 3.0  # of the step that is safe on its own; below 2 no step makes the objective worse
    ahead: float = 50.0  # places as far ahead as this are balanced: those beyond are planned again before they are driven [m]

    def needs(self, vehicle: Vehicle) -> Needs:  # noqa: ARG002 - a protocol's method
        """Return nothing: see ``Term``."""
        return Needs()

    def part(self, scene: Scene, place: Place) -> BalancePart:
        """Return the term in its place: see ``Term``."""
        vehicle, stations, stages = scene.vehicle, scene.stations, scene.settings.stages
        before = int(np.ceil(vehicle.reach_behind / stations.step)) + _ROOM
        after = int(np.ceil(vehicle.reach_ahead / stations.step)) + _ROOM
        swept = min(stages - before, int(min(self.ahead / stations.step, stages)) + after)
        points = tracing_points(vehicle, axles_behind(vehicle), stations.step)
        reached = np.zeros((2, 2, len(stations.s)), REACH)
        reached["reach"], reached["stage"] = -np.inf, -1
        centring = Centring(self.beside).part(scene, place)
        weights = centring.weights.copy()
        weights[1 : max(swept - after, 0) + 1] = self.share
        return BalancePart(
            scene,
            centring,
            replace(centring, weights=weights),
            Bodies(scene.units, points, stations.path.curve, stations.points, stations.step),
            Wish(self.aim, self.rounding, self.relaxation),
            Window(swept - after, swept, before),
            Measured(empty_tracks(vehicle, stages), reached[0], reached[1], np.full(1, -1), np.zeros(1)),
        )


class Wish(NamedTuple):
    """The numbers of ``EnvelopeBalance``."""

    aim: FloatArray
    rounding: float
    relaxation: float


class Window(NamedTuple):
    """Which stages and places of a horizon are balanced."""

    stages: int  # last stage whose objective is the balance
    places: int  # last place, counted from the first stage, that the plan sweeps from end to end
    before: int  # places behind the first stage that the vehicle can still sweep


class Measured(NamedTuple):
    """What the last plan sweeps, and what was swept by driving."""

    tracks: Tracks
    reached: Records  # (2, places) of ``REACH``, with the plan
    driven: Records  # (2, places) of ``REACH``, without
    since: IntArray  # (1,), station of the plan that was last measured, which has been driven from there on; -1: none
    value: FloatArray  # (1,), what the imbalance cost when it was last measured


@dataclass(frozen=True)
class BalancePart:
    """The balance in its place; see ``Part``."""

    scene: Scene
    centring: CentringPart  # of stages that were not measured yet
    beside: CentringPart  # the same, with a share where the plan is measured
    bodies: Bodies
    wish: Wish
    window: Window
    measured: Measured
    violation: float = 0.0

    @property
    def memory(self) -> tuple[FloatArray, ...]:
        """What centring keeps: places do not move with the plan."""
        return self.centring.memory

    def extend(self, horizon: Horizon, begin: int) -> int:
        """See ``Part``. What is known of the motion was measured before; a new one begins a drive, of which nothing is driven."""
        lost = (self.beside if begin == 1 else self.centring).extend(horizon, begin)
        if lost < 0 and begin == 1:
            self.measured.driven["reach"], self.measured.since[0] = -np.inf, -1
            self._balance(horizon)
        return lost

    def linearise(self, horizon: Horizon) -> int:
        """See ``Part``."""
        lost = self.beside.linearise(horizon)
        if lost < 0:
            self._balance(horizon)
        return lost

    def price(self, horizon: Horizon) -> float:
        """Return the objective: the balance's, and the residual's beside it: see ``Part``."""
        return float(self.measured.value[0]) + self.beside.price(horizon)

    def _balance(self, horizon: Horizon) -> None:
        if self.window.stages > 0:
            balance(
                self.bodies, self.wish, self.window, self.measured, self.scene.motion.poses, horizon.first, horizon.fixed,
                self.scene.qp.stages, self.scene.vehicle.states,
            )  # fmt: skip


@compiled
def balance(
    bodies: Bodies, wish: Wish, window: Window, measured: Measured, poses: Records, first: int, fixed: int, stages: Records, n: int
) -> None:
    """Measure a plan's envelope and add Q, q of the imbalance at stages 1 <= i <= ``window.stages``.

    Stages up to ``fixed`` will not change any more: the opposite side must compensate for what they sweep. ``n`` are the vehicle's
    states.
    """
    road, reached, driven = bodies.stations, measured.reached, measured.driven
    end, lowest, places = window.places + window.before + 1, max(first - window.before, 0), reached.shape[1]
    gradient = np.empty(n)
    driven_to = min(first - measured.since[0], window.places) + 1
    if measured.since[0] >= 0 and driven_to > 1:  # the tracks are still those of the last plan
        cover(bodies, measured.tracks, measured.since[0], driven_to, driven)
    measured.since[0] = first
    trace(bodies, poses, first, end, measured.tracks)
    for m in range(lowest, min(first + end, places)):
        for side in range(2):
            reached[side, m].reach, reached[side, m].stage = driven[side, m].reach, -1
    cover(bodies, measured.tracks, first, end, reached)
    value = 0.0
    for m in range(lowest, min(first + window.places, places)):
        wrong = reached[0, m].reach - reached[1, m].reach - 2.0 * wish.aim[m]
        if not np.isfinite(wrong):
            continue
        weight = 1.0 / np.sqrt(1.0 + (wrong / wish.rounding) ** 2)
        value += 2.0 * wish.rounding**2 * (1.0 / weight - 1.0)  # its derivative is 2 weight wrong
        for side in range(2):
            place = reached[side, m]
            i, unit = place.stage - first, place.unit
            if i < 1 or i > window.stages:
                continue
            share = 0.5 if reached[1 - side, m].stage - first > fixed else 1.0
            sign, at = 1.0 - 2.0 * side, road[m]
            x, y = body_point(poses[i, unit], place.ahead, sign * bodies.units[unit].half_width)
            # The place is fixed while the point's foot moves: by the track's slope that changes the reach there.
            rise = sign * place.slope / (1.0 - sign * place.reach * at.curvature)
            point_gradient(poses[i], unit, x, y, road[first + i], -at.sin - rise * at.cos, at.cos - rise * at.sin, gradient)
            for j in range(n):
                stages[i].q[j] += 2.0 * weight * wrong * gradient[j]
                for k in range(n):
                    stages[i].Q[j, k] += 2.0 / wish.relaxation * weight / share * gradient[j] * gradient[k]
    measured.value[0] = value
