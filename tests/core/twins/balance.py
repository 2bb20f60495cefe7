"""Balancing the swept envelope, see ``core/balance.c``: what is measured, and what it adds to a program."""

from dataclasses import dataclass, field

import numpy as np

from hdvplan.arrays import FloatArray, Records
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.balance import Window
from hdvplan.vehicle.model import Vehicle
from tests.core.twins import tracks
from tests.core.twins.kinematics import body_point, gradient, places


@dataclass
class Balance:
    """The objective over a window of stages and places; ``points`` trace the bodies."""

    vehicle: Vehicle
    stations: Stations
    points: Records
    aim: FloatArray
    rounding: float
    relaxation: float
    window: Window
    reached: Records
    driven: Records
    since: int | None = None
    axles: FloatArray = field(init=False)
    traced: tuple[FloatArray, FloatArray] = field(init=False)

    def begin(self) -> None:
        """Forget what was driven."""
        self.driven["reach"], self.since = -np.inf, None

    def measure(self, first: int, z: FloatArray) -> None:
        """Measure a plan z (N+1, n) that begins at station ``first``."""
        units, stations, (_, swept, before) = self.vehicle.table(), self.stations, self.window
        driven_to = 0 if self.since is None else min(first - self.since, swept) + 1
        if self.since is not None and driven_to > 1:
            driven = (self.traced[0][:driven_to], self.traced[1][:driven_to])
            tracks.cover(stations, units, self.points, self.axles[:driven_to], driven, self.since, self.driven)
        self.since, end = first, swept + before + 1
        road = stations.points[first : first + end]
        self.axles = np.array(
            [places(units, np.array([at["x"], at["y"], at["cos"], at["sin"]]), own) for at, own in zip(road, z, strict=False)]
        )
        self.traced = tracks.trace(stations, self.points, self.axles, first)
        here = slice(max(first - before, 0), first + end)
        self.reached["reach"][:, here], self.reached["stage"][:, here] = self.driven["reach"][:, here], -1
        tracks.cover(stations, units, self.points, self.axles, self.traced, first, self.reached)

    def added(self, first: int, fixed: int, shape: tuple[int, int]) -> tuple[FloatArray, FloatArray, float]:
        """Return Q (N+1, n, n) and q of the imbalance at every stage, and what it costs."""
        count, n = shape
        hessians, gradients, value = np.zeros((count, n, n)), np.zeros((count, n)), 0.0
        units, (last, swept, before) = self.vehicle.table(), self.window
        for m in range(max(first - before, 0), min(first + swept, len(self.aim))):
            left, right = self.reached["reach"][:, m]
            if not np.isfinite([left, right]).all():
                continue
            wrong = left - right - 2.0 * self.aim[m]
            root = np.hypot(1.0, wrong / self.rounding)
            value += 2.0 * self.rounding**2 * (root - 1.0)
            for side, sign in enumerate((1.0, -1.0)):
                place, opposite, at = self.reached[side, m], self.reached[1 - side, m], self.stations.points[m]
                i, unit = int(place["stage"]) - first, int(place["unit"])
                if not 1 <= i <= last:
                    continue
                point = body_point(self.axles[i, unit], place["ahead"], sign * units[unit]["half_width"])
                tangent, normal = np.array([at["cos"], at["sin"]]), np.array([-at["sin"], at["cos"]])
                rise = sign * place["slope"] / (1.0 - sign * place["reach"] * at["curvature"])
                road = self.stations.points[first + i]
                sideways = np.array([-road["sin"], road["cos"]])
                own = gradient(units, self.axles[i], unit, point, sideways, normal - rise * tangent, n)
                share = 0.5 if opposite["stage"] - first > fixed else 1.0
                gradients[i] += 2.0 / root * wrong * own
                hessians[i] += 2.0 / (self.relaxation * root * share) * np.outer(own, own)
        return hessians, gradients, value
