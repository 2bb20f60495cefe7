"""Where the wheels of a driven vehicle rolled.

A vehicle's model has one axle for every group of axles, and no track width: an axle's tyres count as far out as its body is wide,
so that a track is that of the outer face of the outer tyre. Wheels further in, and those of a group's other axles, run inside
of what the body sweeps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.driving.drive import Drive
from hdvplan.judging.bodies import placed
from hdvplan.vehicle.model import Vehicle

TRACK_NOTE = "outer faces of the outer tyres, which are taken to be as far apart as the body is wide"


@dataclass(frozen=True)
class Wheel:
    """A wheel on its body: ``ahead`` of the body's axle and ``left`` of its axis [m]."""

    unit: int
    axle: str  # "front" or "rear" of the lead unit, "axle" of a trailer
    side: str  # "left" or "right"
    ahead: float
    left: float


@dataclass(frozen=True)
class WheelTrack:
    """The way of a wheel, shape (n, 2), x, y [m]: one point a simulated pose, at most 0.25 m apart."""

    wheel: Wheel
    points: FloatArray


def wheels_of(vehicle: Vehicle) -> tuple[Wheel, ...]:
    """Return the outer wheels of all axles, from the front, left before right."""
    found = []
    for number, unit in enumerate(vehicle.units):
        axles = {"front": unit.wheelbase, "rear": 0.0} if number == 0 else {"axle": 0.0}
        for axle, ahead in axles.items():
            found += [Wheel(number, axle, side, ahead, half) for side, half in (("left", 0.5 * unit.width), ("right", -0.5 * unit.width))]
    return tuple(found)


def wheel_tracks(drive: Drive) -> tuple[WheelTrack, ...]:
    """Return the track of every outer wheel over the whole drive, in the order of ``wheels_of``."""
    poses = placed(drive, np.arange(len(drive.poses_s)))
    tracks = []
    for wheel in wheels_of(drive.vehicle):
        body = poses[:, wheel.unit]
        x = body["x"] + wheel.ahead * body["cos"] - wheel.left * body["sin"]
        y = body["y"] + wheel.ahead * body["sin"] + wheel.left * body["cos"]
        tracks.append(WheelTrack(wheel, np.column_stack([x, y])))
    return tuple(tracks)
