"""What is followed in a closed loop, and how: the track of a drive's front axle, and the followers of the field."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import minimum_filter1d

from hdvplan import plugins
from hdvplan.arrays import FloatArray
from hdvplan.driving.drive import Drive
from hdvplan.errors import OptionError
from hdvplan.judging.straying import SPACING_M, chain_of
from hdvplan.road.arcs import wrapped

_SLOWING_M = 10.0  # before and beyond a bend, along which it is driven as slowly as there
_AHEAD_S, _UNNOTICED_M = 1.5, 0.1  # the driver: how far ahead an error shall be gone, and how much of it is let pass
_LOOKAHEAD_M, _LOOKAHEAD_S = 3.0, 0.8  # pure pursuit
_BACK_PER_S = 0.8  # Stanley: by how much of the offset it turns back
_BEYOND_M = 15.0  # the drive's end, what there is to pursue: the wheels held as they are there


@dataclass(frozen=True)
class Track:
    """A drive at nodes along its front axle's way, evenly spaced: what is followed, and some way on; in the plane of the road's path."""

    front: CubicSpline  #: the front axle's middle over its way [m]
    rear: FloatArray  #: the rear axle's middle (n, 2) [m]
    course: FloatArray  #: direction in which the front axle moves, without jumps (n,) [rad]
    wheels: FloatArray  #: angle of the front wheels, left positive (n,) [rad]
    speed: FloatArray  #: at which it is driven (n,) [m/s]
    behind: FloatArray  #: the rear axle's way until there (n,) [m]
    wheelbase: float  #: [m]
    most: float  #: largest angle of the wheels [rad]
    rate: float  #: largest change of the curvature along the rear axle's way [1/m2]

    @classmethod
    def of(cls, drive: Drive, speed: float, sideways: float) -> Track:
        """Return the track of a drive at no more than ``speed`` [m/s], in bends at no more than ``sideways`` [m/s2]."""
        chain = chain_of(drive)
        lead, unit = chain.nodes[:, 0], chain.vehicle.lead
        rear = np.stack([lead["x"], lead["y"]], axis=1)
        front = rear + unit.wheelbase * np.stack([lead["cos"], lead["sin"]], axis=1)
        course = np.unwrap(np.arctan2(*np.gradient(front, axis=0).T[::-1]))
        wheels = wrapped(course - np.arctan2(lead["sin"], lead["cos"]))
        further = SPACING_M * np.arange(1.0, int(_BEYOND_M / SPACING_M) + 1.0)
        turning = np.sin(wheels[-1]) / unit.wheelbase
        ahead, wheels = course[-1] + turning * further, np.append(wheels, np.full(len(further), wheels[-1]))
        middle, heading = ahead - 0.5 * turning * SPACING_M, ahead - wheels[-1]
        front = np.vstack([front, front[-1] + SPACING_M * np.cumsum(np.stack([np.cos(middle), np.sin(middle)], axis=1), axis=0)])
        rear = np.vstack([rear, front[-len(further) :] - unit.wheelbase * np.stack([np.cos(heading), np.sin(heading)], axis=1)])
        course = np.append(course, ahead)
        bend = np.abs(np.gradient(course, SPACING_M))
        allowed = np.minimum(speed, np.sqrt(sideways / np.maximum(bend, 1e-6)))
        return cls(
            CubicSpline(SPACING_M * np.arange(len(front)), front),
            rear,
            course,
            wheels,
            minimum_filter1d(allowed, 1 + 2 * int(_SLOWING_M / SPACING_M), mode="nearest"),
            np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(rear, axis=0).T))]),
            unit.wheelbase,
            float(np.arctan(unit.wheelbase * drive.vehicle.max_curvature)),
            drive.vehicle.max_curvature_rate,
        )

    @property
    def length(self) -> float:
        """Length of the part that is followed [m]."""
        return float(self.front.x[-1]) - _BEYOND_M

    def at(self, values: FloatArray, way: FloatArray) -> FloatArray:
        """Return values that are given at nodes, (n,) or (n, 2), at places of the front axle's way (runs,) [m]."""
        place = np.clip(way / SPACING_M, 0.0, len(values) - 1.001)
        low = place.astype(int)
        part = (place - low).reshape(-1, *(1,) * (values.ndim - 1))
        return np.asarray(values[low] + part * (values[low + 1] - values[low]))


@dataclass(frozen=True)
class Seen:
    """What a follower knows at one moment, in each of the runs, which are driven side by side; arrays are of shape (runs,)."""

    time: float  #: since the drive began, 0 at the first call [s]
    step: float  #: until the next call [s]
    way: FloatArray  #: of the front axle along its track [m]
    offset: FloatArray  #: to its left, as it is seen [m]
    askew: FloatArray  #: of the body against that of the drive, counter-clockwise, as it is seen [rad]
    speed: FloatArray  #: [m/s]
    wheels: FloatArray  #: angle at which the front wheels stand [rad]
    delay: float  #: until they do what is wanted [s]


#: Returns the angles of the front wheels (runs,) [rad] of a track and what is seen of the place beside it.
Follower = Callable[[Track, Seen], FloatArray]


def driver(track: Track, seen: Seen) -> FloatArray:
    """Return what a driver does who knows the plan: steers as it does once the delay is over, and corrects what is to be seen ahead."""
    ahead = _AHEAD_S * seen.speed
    error = seen.offset + ahead * seen.askew
    noticed = np.sign(error) * np.maximum(np.abs(error) - _UNNOTICED_M, 0.0)
    return track.at(track.wheels, seen.way + seen.delay * seen.speed) - np.arctan(noticed / ahead)


def pure_pursuit(track: Track, seen: Seen) -> FloatArray:
    """Return the wheels' angle of the arc from the rear axle to the point of its track some way ahead (Coulter 1992)."""
    ahead = _LOOKAHEAD_M + _LOOKAHEAD_S * seen.speed
    heading = track.at(track.course, seen.way) - track.at(track.wheels, seen.way) + seen.askew
    left = track.at(track.course, seen.way) + 0.5 * np.pi
    front = track.front(seen.way) + seen.offset[:, None] * np.stack([np.cos(left), np.sin(left)], axis=1)
    goal = track.at(track.rear, np.interp(track.at(track.behind, seen.way) + ahead, track.behind, track.front.x))
    dx, dy = (goal - front + track.wheelbase * np.stack([np.cos(heading), np.sin(heading)], axis=1)).T
    return np.asarray(np.arctan(2.0 * track.wheelbase * (dy * np.cos(heading) - dx * np.sin(heading)) / (dx**2 + dy**2)))


def stanley(track: Track, seen: Seen) -> FloatArray:
    """Return the wheels' angle along the track, and towards it the more the further off the front axle is (Hoffmann et al. 2007)."""
    return track.at(track.wheels, seen.way) - seen.askew - np.arctan(_BACK_PER_S * seen.offset / seen.speed)


FOLLOWERS: dict[str, Follower] = {"driver": driver, "pure-pursuit": pure_pursuit, "stanley": stanley}


def follower_named(name: str | Follower) -> Follower:
    """Return the follower that users call so: one of ``FOLLOWERS``, ``package.module:name``, ``file.py:name``, or such a function itself.

    Raises:
        OptionError: there is none of that name, or it cannot be loaded.

    """
    if not isinstance(name, str):
        return _foreign(plugins.name_of(name), name)
    if name in FOLLOWERS:
        return FOLLOWERS[name]
    found = plugins.load(plugins.FOLLOWER, name)
    if found is None:
        raise plugins.unknown(plugins.FOLLOWER, name, FOLLOWERS)
    return _foreign(name, cast("Follower", found))


def _foreign(name: str, own: Follower) -> Follower:
    """Return a follower from outside hdvplan; what its author's code raises becomes one line."""

    def wheels(track: Track, seen: Seen) -> FloatArray:
        try:
            angles = np.asarray(own(track, seen), dtype=np.float64)
        except Exception as error:
            msg = f"follower {name!r} raises {plugins.error_text(error)}{plugins.raised_at(error)}"
            raise OptionError(msg) from error
        if angles.shape != seen.way.shape or not np.all(np.isfinite(angles)):
            msg = f"follower {name!r} returns {'numbers' if angles.shape == seen.way.shape else 'an array'} that cannot be steered by"
            raise OptionError(msg, hint=f"one finite angle [rad] for each of {len(seen.way)} runs")
        return angles

    return wheels
