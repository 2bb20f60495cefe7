"""The swept envelope, where every foot is searched to the end, and its balance: see ``core/sweep.c`` and ``core/balance.c``."""

from dataclasses import dataclass, field

import numpy as np

from hdvplan.arrays import FloatArray, Records
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.balance import Window
from hdvplan.road.path import ReferencePath
from hdvplan.vehicle.model import Vehicle
from tests.core.twins import tracks
from tests.core.twins.kinematics import body_point, evaluate, gradient, places, project


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


def feet(units: Records, outlines: FloatArray, path: ReferencePath, s: FloatArray, z: FloatArray) -> FloatArray:
    """Return arclength and offset of every point of every outline at every pose, shape (poses, units, points, 2)."""
    found = np.empty((len(s), *outlines.shape))
    for i, at in enumerate(s):
        for unit, (x, y, cos, sin) in enumerate(places(units, evaluate(path, at)[:4], z[i])):
            near = at - sum(units["hitch_offset"][:unit]) - sum(units["wheelbase"][1 : unit + 1]) + outlines[unit, 0, 0]
            for point, (ahead, left) in enumerate(outlines[unit]):
                here = project(path, x + ahead * cos - left * sin, y + ahead * sin + left * cos, near)
                found[i, unit, point] = here[:2]
                near = here[0]
    return found


def cover(begin: FloatArray, end: FloatArray, stations: FloatArray, low: FloatArray, high: FloatArray) -> None:
    """Widen an envelope at ``stations`` by a straight piece in the (s, offset) plane."""
    (s_low, e_low), (s_high, e_high) = sorted([tuple(begin), tuple(end)])
    rounding = 1e-6 * (stations[1] - stations[0])
    for j in np.flatnonzero((stations >= s_low - rounding) & (stations <= s_high + rounding)):
        part = np.clip((stations[j] - s_low) / (s_high - s_low), 0.0, 1.0) if s_high > s_low else 0.0
        offset = e_low + part * (e_high - e_low)
        low[j], high[j] = min(low[j], offset), max(high[j], offset if s_high > s_low else e_high)


def sweep(
    units: Records, outlines: FloatArray, path: ReferencePath, s: FloatArray, z: FloatArray, stations: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return lowest and highest offset per unit and station, infinite where never."""
    low, high = np.full((len(units), len(stations)), np.inf), np.full((len(units), len(stations)), -np.inf)
    found = feet(units, outlines, path, s, z)
    for i, unit, point in np.ndindex(found.shape[:3]):
        here = found[i, unit, point]
        if point > 0:
            cover(found[i, unit, point - 1], here, stations, low[unit], high[unit])
        if i > 0:
            cover(found[i - 1, unit, point], here, stations, low[unit], high[unit])
    return low, high
