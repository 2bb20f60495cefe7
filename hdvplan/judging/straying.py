"""A driven plan as a chain of planned tracks, of the front axle and of every unit's axle and coupling behind it, and a driver's errors.

With these: how far bodies stray at most, and which errors close a gap.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records, runs_of
from hdvplan.driving.drive import POSE_SPACING_M, Drive
from hdvplan.road.arcs import wrapped
from hdvplan.road.path import evaluate_many
from hdvplan.vehicle.kinematics import place_many
from hdvplan.vehicle.model import Vehicle

LINK = core.record("hdv_link")  # one unit over one interval: hdvplan/core/tracking.h has the fields
FINER = 5  # poses for every simulated one, where they are looked at closely
SPACING_M = POSE_SPACING_M  # of nodes on the front axle's planned track
_LEAST_M = 1e-3  # way of an axle within an interval below which its direction is that of its body
_states_between = core.function(
    "hdv_states_between", core.POINTER, core.INT, core.INT, core.POINTER, core.INT, core.POINTER, core.POINTER, core.POINTER, core.INT,
    core.POINTER, core.POINTER,
)  # fmt: skip


class Posed(NamedTuple):
    """Poses in a row, and where each is on the planned track of the lead unit's front axle."""

    s: FloatArray  # (poses,), the line's arclengths [m]
    poses: Records  # (poses, units) of ``POSE``
    front: FloatArray  # (poses,), the front axle's way until there [m]


@dataclass(frozen=True)
class Chain:
    """A drive as it was simulated, ``posed``, and its poses ``nodes`` (n, units) every SPACING_M of the front axle's track."""

    drive: Drive
    posed: Posed
    nodes: Records

    @property
    def vehicle(self) -> Vehicle:
        """What is driven."""
        return self.drive.vehicle

    @cached_property
    def links(self) -> Records:
        """The units between two nodes, to first order, (nodes - 1, units) of ``LINK``."""
        return _links(self.vehicle, self.nodes)

    def closely(self, first: int = 0, last: int = -1) -> Posed:
        """Return poses from the simulated one ``first`` to ``last``, FINER for each."""
        s, front = self.posed.s, self.posed.front
        at = np.arange(FINER * (first % len(s)), FINER * (last % len(s)) + 1) / FINER
        number = np.arange(len(s), dtype=np.float64)
        s_at = np.interp(at, number, s)
        return Posed(s_at, _posed(self.drive, s_at), np.interp(at, number, front))


def chain_of(drive: Drive) -> Chain:
    """Return the chain of a drive."""
    s, wheelbase = drive.poses_s, drive.vehicle.lead.wheelbase
    poses = place_many(drive.vehicle.table(), evaluate_many(drive.stations.path, s), drive.poses_z)
    lead = poses[:, 0]
    x, y = lead["x"] + wheelbase * lead["cos"], lead["y"] + wheelbase * lead["sin"]
    front = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    at = np.interp(SPACING_M * np.arange(int(front[-1] / SPACING_M) + 1), front, s)
    return Chain(drive, Posed(s, poses, front), _posed(drive, at))


def _posed(drive: Drive, s: FloatArray) -> Records:
    """Return where a drive's bodies were with the lead axle at arclengths ``s`` (n,), in ascending order, (n, units)."""
    units, path, states = drive.vehicle.table(), drive.stations.path, np.empty((len(s), drive.poses_z.shape[1]))
    arrays = [np.ascontiguousarray(array) for array in (drive.poses_s, drive.poses_z, drive.poses_kappa, s)]
    poses_s, z, kappa, at = (core.address(array) for array in arrays)
    _states_between(
        core.address(units), len(units), states.shape[1], core.address(path.record), len(drive.poses_s), poses_s, z, kappa, len(s), at,
        core.address(states),
    )  # fmt: skip
    return place_many(units, evaluate_many(path, s), states)


def _links(vehicle: Vehicle, nodes: Records) -> Records:
    units = vehicle.table()
    wheelbase, hitch = units["wheelbase"], units["hitch_offset"]
    heading = np.unwrap(np.arctan2(nodes["sin"], nodes["cos"]), axis=0)
    turned = np.diff(heading, axis=0)
    middle = 0.5 * (heading[1:] + heading[:-1])
    way = {
        "axle": (np.diff(nodes["x"], axis=0), np.diff(nodes["y"], axis=0)),
        "coupling": (np.diff(nodes["x"] + wheelbase * nodes["cos"], axis=0), np.diff(nodes["y"] + wheelbase * nodes["sin"], axis=0)),
    }
    links = np.zeros(middle.shape, LINK)
    course = {}
    for name, (x, y) in way.items():
        ahead = np.where(x * np.cos(middle) + y * np.sin(middle) < 0.0, -1.0, 1.0)  # an axle may roll backwards
        length = np.hypot(x, y)
        links[f"{name}_speed"] = ahead * length / SPACING_M
        off = np.where(length > _LEAST_M, wrapped(np.arctan2(ahead * y, ahead * x) - middle), 0.0)
        links[f"{name}_off"] = np.where(units["steering_ratio"] == 0.0, 0.0, off) if name == "axle" else off
        course[name] = middle + links[f"{name}_off"]
    links["course"], links["turning"] = course["coupling"], turned / SPACING_M
    bend = np.abs(np.diff(course["axle"], axis=0)) / np.maximum(np.abs(links["axle_speed"][1:]) * SPACING_M, _LEAST_M)
    links["bend"][:-1] = bend
    links["bend"][1:] = np.maximum(links["bend"][1:], bend)
    links["next_off"][:, :-1] = wrapped(course["coupling"][:, 1:] - middle[:, :-1])
    coupling, axle, behind = links["coupling_off"], links["axle_off"], links["next_off"]
    links["by_offset"] = 1.0 / (wheelbase * np.cos(coupling))
    links["by_axle"] = np.cos(coupling - axle) * links["by_offset"]
    links["next_by_axle"], links["next_by_heading"] = np.cos(behind - axle), -hitch * np.cos(behind)
    links["steered"][:, 0], links["steered"][:, 1:] = coupling[:, 0], middle[:, :-1] - middle[:, 1:]
    _add_laws(vehicle, units, links)
    return links


def _add_laws(vehicle: Vehicle, units: Records, links: Records) -> None:
    """Write how wheels follow the articulation, or the front wheels, where no stop holds them; those that the plan steers keep to it."""
    coupling, axle, behind = links["coupling_off"], links["axle_off"], links["next_off"]
    for number, unit in enumerate(vehicle.units):
        if unit.active or unit.steering_ratio == 0.0:
            continue
        own, record = links[:, number], units[number]
        slope = np.where(unit.steering_ratio * np.abs(own["steered"]) < unit.max_steering_angle, -unit.steering_ratio, 0.0)
        along_axle, along_heading = np.sin(coupling[:, number] - axle[:, number]), record["wheelbase"] * np.sin(coupling[:, number])
        if number == 0:
            own["law_by_course"] = slope
            turning = slope * np.gradient(own["course"], SPACING_M)
        else:
            ahead = links[:, number - 1]
            turning = slope * ahead["turning"] / own["coupling_speed"]
            own["law_by_ahead"] = -turning * np.sin(behind[:, number - 1] - axle[:, number - 1])
            own["law_by_turned"] = slope + turning * units[number - 1]["hitch_offset"] * np.sin(behind[:, number - 1])
        own["law_by_axle"], own["law_by_heading"] = turning * along_axle, -slope + turning * along_heading


ROUNDED_M = 1e-4  # an error is found to this
_BEFORE, _BEYOND = int(60.0 / SPACING_M), int(15.0 / SPACING_M)  # intervals from a place, on which errors there depend
_AROUND_M = 15.0  # of a place: others there are looked at together with it
_LITTLE_M = 1e-3  # an error of which nothing of second order counts
_REST, _REST_OF_GAINS = 1e-5, 1e-3  # of an error: what counts less together is not followed further back
_ASIDE = 0.4  # of what the error is found to, from the likeliest one on: the next one is then on the other side of what is sought
_LEAST = 1e-30  # that is divided by
_ROUNDING = 1e-9

TRACKED, STRAY, GAIN, BRUSH, APPROACH = (core.record(f"hdv_{name}") for name in ("tracked", "stray", "gain", "brush", "approach"))
_stray = core.function("hdv_stray", core.POINTER, core.INT, core.INT)
_gains = core.function("hdv_gains", core.POINTER, core.INT, core.INT)
_approach = core.function("hdv_approach", core.POINTER, core.POINTER, core.INT, core.POINTER)


class Tracked:
    """A chain of planned tracks with a driver's errors: how far bodies stray at most.

    ``gains`` (intervals, units), the most that they do to first order, are looked for where ``follow`` is told to.
    """

    def __init__(self, units: Records, links: Records, length: float, gains: Records | None = None) -> None:
        self.units, self.links, self.length = units, np.ascontiguousarray(links), length
        self.strays = np.zeros(links.shape, STRAY)
        self.gains = np.full(links.shape, np.inf, GAIN) if gains is None else gains
        self._followed = np.zeros(len(links), dtype=bool)
        self.levels = int(np.clip(2.0 * length / SPACING_M + _ROUNDING, 1, core.number("HDV_MOST_LEVELS")))
        self.record = np.zeros(1, TRACKED)
        for name, array in (("units", units), ("links", self.links), ("gains", self.gains), ("strays", self.strays)):
            self.record[name] = core.address(array)
        self.record["intervals"], self.record["count"] = links.shape
        self.record["spacing"], self.record["levels"], self.record["rest"] = SPACING_M, self.levels, _REST

    def err(self, error: float) -> None:
        """Bound what bodies stray with errors up to ``error`` [m]."""
        self.record["error"], self.record["slope"] = error, error / self.length
        _stray(core.address(self.record), 0, len(self.links))

    def bounded(self, error: float) -> bool:
        """Bound what bodies stray with errors up to ``error`` [m], following what leads to where none holds; return whether all do."""
        self.err(error)
        while np.any(lost := np.isinf(self.strays["heading"][:, 0])):
            if not self.follow(np.array([SPACING_M * np.argmax(lost)])):
                return False
        return True

    def follow(self, at: FloatArray) -> bool:
        """Bound strays more tightly at places ``at`` (n,) [m], by the gains of what leads there; return whether these are new."""
        wanted = np.zeros(len(self.links), dtype=bool)
        for interval in np.unique((at / SPACING_M).astype(np.int64)):
            wanted[max(interval - _BEFORE, 0) : interval + _BEYOND] = True
        wanted &= ~self._followed
        if not np.any(wanted):
            return False
        for begin, beyond in runs_of(wanted):
            _gains(core.address(self._little.record), begin, beyond)
        self._followed |= wanted
        _stray(core.address(self.record), int(np.argmax(wanted)), len(wanted) - int(np.argmax(wanted[::-1])))
        return True

    @cached_property
    def _little(self) -> Tracked:
        """The same chain with errors so small that nothing of second order counts."""
        little = Tracked(self.units, self.links, self.length, self.gains)
        little.err(_LITTLE_M)
        little.record["rest"] = _REST_OF_GAINS
        return little

    def approaches(self, brushes: Records) -> FloatArray:
        """Return how far brushes (n,) come at most: the gain, and what is added to the error's gain [m], (2, n).

        Of a brush whose gap the errors cannot close it is no more than that: what is returned is less than the gap.
        """
        brushes, found = np.ascontiguousarray(brushes), np.empty(len(brushes), APPROACH)
        _approach(core.address(self.record), core.address(brushes), len(brushes), core.address(found))
        return np.stack([found["gain"], np.nan_to_num(found["remainder"], nan=np.inf)])  # a bound that ends in no number is none

    def closed(self, brushes: Records) -> Records:
        """Return the brushes whose gap the errors may close, that of the least error first."""
        gain, remainder = self.approaches(brushes)
        error = float(self.record["error"][0])
        closed = error * gain + remainder > brushes["gap"]
        gain, remainder, brushes = gain[closed], remainder[closed], brushes[closed]
        return brushes[np.argsort(_closing(brushes["gap"], gain, remainder, error), kind="stable")]

    def solved(self, closed: Records) -> tuple[float, Records]:
        """Return the largest error that does not close the gap of some brushes [m], which the present one closes, and the brush (1,).

        Those count that are near to the first one, so that the same errors move them.
        """
        at = closed["at"][0]
        own = closed[np.abs(closed["at"] - at) < _AROUND_M]
        within = slice(max(int(np.min(own["at"]) / SPACING_M) - _BEFORE, 0), int(np.max(own["at"]) / SPACING_M) + _BEYOND)
        around = Tracked(self.units, self.links[within], self.length, self.gains[within])
        there, high = own.copy(), float(self.record["error"][0])
        there["at"] -= within.start * SPACING_M
        (over, number), low = self._over(own), 0.0
        before, error = high, high - over
        while high - low > ROUNDED_M:
            if not low < error < high:
                error = 0.5 * (low + high)
            around.err(error)
            over_before, (over, number) = over, around._over(there)
            low, high = (low, error) if over > 0.0 else (error, high)
            slope = (over - over_before) / (error - before)  # of the secant; 1 or more
            before, aside = error, _ASIDE * ROUNDED_M  # to the other side of what is sought, where this is near
            error -= over / max(slope, 1.0) + (aside if over > 0.0 else -aside)
        return low, own[number : number + 1]

    def _over(self, brushes: Records) -> tuple[float, int]:
        """Return by how much the present error is more than one that closes a gap [m], exact where that is nothing, and which brush's."""
        whole, error = brushes.copy(), float(self.record["error"][0])
        whole["gap"] = 0.0  # all of their approach is looked at, whether the gap can be closed or not
        gain, remainder = self.approaches(whole)
        closing = _closing(brushes["gap"], gain, remainder, error)
        return error - float(np.min(closing)), int(np.argmin(closing))


def _closing(gap: FloatArray, gain: FloatArray, remainder: FloatArray, error: float) -> FloatArray:
    """Return with which errors gaps [m] may close, (n,) [m]; remainders [m] are those of ``error``, and grow as its square, or nearly."""
    gap, square = np.maximum(gap, 0.0), np.minimum(remainder / error**2, 1.0 / ROUNDED_M**2)
    return np.asarray(2.0 * gap / np.maximum(gain + np.sqrt(gain**2 + 4.0 * square * gap), _LEAST))
