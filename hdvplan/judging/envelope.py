"""The swept envelope: how far left and right of the road's centre every body reaches at each arclength, as executed.

Outlines of the simulated poses are projected point by point on the road; between neighbouring outline points, and along
each point's track from pose to pose, the offset is interpolated at the envelope's stations. With poses and outline points
at most 0.25 m apart the envelope of a curve of radius 10 m is short by less than 2 mm (chord against arc, twice h^2 / 8R).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hdvplan import core
from hdvplan.arrays import BoolArray, FloatArray, Records, running, runs_of
from hdvplan.driving.drive import Drive
from hdvplan.road.path import ReferencePath

SPACING_M = 0.25  # of outline points and of the envelope's stations

_core_sweep = core.function(
    "hdv_sweep", core.POINTER, core.INT, core.INT, core.POINTER, core.INT, core.POINTER, core.POINTER, core.INT, core.POINTER,
    core.POINTER, core.INT, core.REAL, core.REAL, core.POINTER, core.POINTER,
)  # fmt: skip


@dataclass(frozen=True)
class Envelope:
    """The envelope of an executed drive over 0 <= s <= the road's length, where a closed road has what lies beyond either end.

    It is measured when a reach is first asked for: what only looks for room needs none. A body that reaches beyond the road's centre of
    curvature lies beside no arclength there, and is left out.
    """

    drive: Drive

    @cached_property
    def s(self) -> FloatArray:
        """Arclengths, shape (n,) [m]."""
        return SPACING_M * np.arange(int(np.floor(self.drive.road.path.length / SPACING_M + 1e-9)) + 1, dtype=np.float64)

    @property
    def left(self) -> FloatArray:
        """Reach of every unit, left positive, shape (units, n), NaN where a unit never was [m]."""
        return self._reaches[0]

    @property
    def right(self) -> FloatArray:
        """The same to the right, left positive, too [m]."""
        return self._reaches[1]

    @property
    def reach_left(self) -> FloatArray:
        """Furthest left reach of any body, shape (n,) [m]."""
        return np.asarray(np.fmax.reduce(self.left, axis=0))

    @property
    def reach_right(self) -> FloatArray:
        """Furthest right reach of any body, signed (negative), shape (n,) [m]."""
        return np.asarray(np.fmin.reduce(self.right, axis=0))

    @cached_property
    def _reaches(self) -> tuple[FloatArray, FloatArray]:
        drive, count = self.drive, len(self.s)
        path, units = drive.stations.path, drive.vehicle.table()
        length, closed = drive.road.path.length, drive.road.path.closed
        behind, ahead = drive.vehicle.reach_behind, drive.vehicle.reach_ahead
        before, beyond = (int(np.ceil(reach / SPACING_M)) if closed else 0 for reach in (behind, ahead + behind))
        stations = SPACING_M * np.arange(-before, count + beyond, dtype=np.float64)
        low, high = _sweep(units, _outlines(units), path, drive.poses_s, drive.poses_z, stations)
        left, right = np.where(np.isfinite(high), high, np.nan), np.where(np.isfinite(low), low, np.nan)
        own = slice(before, before + count)
        for reach, pick in ((left, np.fmax), (right, np.fmin)):
            for of_unit in reach:
                laps = [np.interp(stations[own] + lap, stations, of_unit, np.nan, np.nan) for lap in (-length, length)] if closed else []
                of_unit[own] = pick.reduce([of_unit[own], *laps])
        return left[:, own], right[:, own]


def _outlines(units: Records) -> FloatArray:
    """Return closed outlines in body axes, shape (units, points, 2); every body gets as many points as the longest needs."""
    rear, front = units["rear_overhang"], units["front"]
    along = int(np.ceil(np.max(front + rear) / SPACING_M)) + 1
    across = int(np.ceil(2.0 * np.max(units["half_width"]) / SPACING_M)) + 1
    outlines = []
    for behind, ahead, half in zip(rear, front, units["half_width"], strict=True):
        x, y = np.linspace(-behind, ahead, along), np.linspace(half, -half, across)
        left, end = np.column_stack([x, np.full(along, half)]), np.column_stack([np.full(across, ahead), y])
        right, back = np.column_stack([x[::-1], np.full(along, -half)]), np.column_stack([np.full(across, -behind), y[::-1]])
        outlines.append(np.concatenate([left, end[1:], right[1:], back[1:]]))
    return np.stack(outlines)


def _sweep(
    units: Records, outlines: FloatArray, path: ReferencePath, s: FloatArray, z: FloatArray, stations: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return lowest and highest offset per unit and station, infinite where never."""
    s, z = np.ascontiguousarray(s), np.ascontiguousarray(z)
    count, points = outlines.shape[:2]
    low, high = np.full((count, len(stations)), np.inf), np.full((count, len(stations)), -np.inf)
    tracks = np.zeros((count, points, 4))
    _core_sweep(
        core.address(units), count, z.shape[1], core.address(path.record), len(s), core.address(s), core.address(z), points,
        core.address(outlines), core.address(tracks), len(stations), stations[0], SPACING_M, core.address(low), core.address(high),
    )  # fmt: skip
    return low, high


NEARLY_ALL = 0.95  # of the steering, or of its rate: a driver has nothing left to correct with
_LOCK = 0.8  # of the steering, on either side: from one to the other is a swing from lock to lock
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Use:
    """The largest share of something limited that a plan uses, and the stretches (from, to) [m] over which it is nearly all."""

    share: float
    s: float  # of the largest share [m]
    stretches: tuple[tuple[float, float], ...]

    def length(self, step: float) -> float:
        """Return the length of the stretches [m], each to the end of its last ``step`` [m]."""
        return sum(last - first + step for first, last in self.stretches)


@dataclass(frozen=True)
class SteeringUse:
    """How hard the lead unit's steering is used, and where (from, to) [m] it goes from lock to lock within the vehicle's length."""

    curvature: Use
    rate: Use
    swings: tuple[tuple[float, float], ...]


def steering_of(drive: Drive) -> SteeringUse:
    """Return how hard a drive steers, from its executed curvatures, each held over a step."""
    vehicle, step, kappa = drive.vehicle, drive.stations.step, drive.kappa
    s = drive.stations.s[: len(kappa)]
    curvature = np.abs(kappa) / vehicle.max_curvature
    rate = np.abs(np.diff(kappa, prepend=kappa[:1])) / (step * vehicle.max_curvature_rate)
    size = max(2, int(np.ceil((vehicle.reach_ahead + vehicle.reach_behind) / step)))
    high, low = (running(pick, kappa, size // 2, size - size // 2 - 1) for pick in (np.maximum, np.minimum))
    lock = _LOCK * vehicle.max_curvature
    return SteeringUse(_use(s, curvature), _use(s, rate), _stretches(s, (high > lock) & (low < -lock)))


def steering_texts(drive: Drive, found: SteeringUse) -> list[str]:
    """Return a sentence for everything that a driver would find too much, naming its first or worst place."""
    texts, what_is = list[str](), "plan" if drive.plans else "path"
    if found.swings:
        first, last = found.swings[0]
        more = f", and at {len(found.swings) - 1} more places" if len(found.swings) > 1 else ""
        texts.append(
            f"the {what_is} swings from lock to lock between s = {first:z.1f} and {last:z.1f} m, within the vehicle's length{more}"
            + (": a larger --curvature-weight steers more calmly" if drive.plans else "")
        )
    for use, what in ((found.curvature, "steering"), (found.rate, "steering rate")):
        if use.stretches:
            uses = f"the {what_is} uses {100.0 * use.share:.0f} % of the {what} at s = {use.s:z.1f} m"
            texts.append(f"{uses}, over 95 % along {use.length(drive.settings.step):.1f} m of road")
    return texts


def _use(s: FloatArray, share: FloatArray) -> Use:
    most = int(np.argmax(share))
    return Use(float(share[most]), float(s[most]), _stretches(s, share > NEARLY_ALL + _ROUNDING))


def _stretches(s: FloatArray, wanted: BoolArray) -> tuple[tuple[float, float], ...]:
    return tuple((float(s[begin]), float(s[end - 1])) for begin, end in runs_of(wanted))
