"""The figures of a driven manoeuvre, as highway manuals and type approval ask for them. Lengths in metres, angles in radians."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.arrays import BoolArray, FloatArray
from hdvplan.turning.follow import Followed
from hdvplan.turning.swept import Band, Chart, band_of, chart_of, counted, front_track, places


@dataclass(frozen=True)
class Radii:
    """Least and largest distance from the arc's centre [m]; the inside is negative where the part reaches over the centre."""

    inside: float
    outside: float


@dataclass(frozen=True)
class Figures:
    """What a manoeuvre asks for. In a full circle the radii, the width and the off-tracking are those of the steady circle."""

    wheels: Radii  # tracks of all wheels, which run as wide as the body
    bodies: Radii  # the outside between the cross-sections where the turn begins and ends
    band: Band
    swept_width: float  # largest
    off_tracking: tuple[float, ...]  # every unit's axle, how far inside the front axle's track it runs at most
    tail_swing: tuple[float, ...]  # every unit's rear outer corner, beyond the side of the straight vehicle before the turn
    frontal_swing: float | None  # the lead unit's front outer corner, beyond its side in line with the exit; None without one
    articulation: tuple[float, ...]  # largest at every coupling [rad]
    steering: float  # largest angle of the front wheels [rad]


def figures_of(driven: Followed) -> Figures:
    """Return the figures of a driven manoeuvre."""
    chart, units = chart_of(driven), driven.vehicle.units
    poses = counted(driven)
    wheels, bodies = [], []
    for number, unit in enumerate(units):
        half = 0.5 * unit.width
        axles = np.array([0.0, unit.wheelbase] if number == 0 else [0.0])
        wheels.append(_radii(driven, chart, poses, number, axles, axles, half))
        bodies.append(_radii(driven, chart, poses, number, np.array([-unit.rear_overhang, unit.front]), None, half))
    band = band_of(driven)
    return Figures(
        _extreme(wheels),
        _extreme(bodies),
        band,
        float(np.nanmax(band.width)),
        _off_tracking(driven, chart, poses),
        tuple(_tail_swing(driven, number) for number in range(len(units))),
        _frontal_swing(driven),
        tuple(float(angle) for angle in np.abs(driven.beta).max(axis=0)),
        float(np.abs(driven.steering).max()),
    )


def _extreme(radii: list[Radii]) -> Radii:
    return Radii(min(one.inside for one in radii), max(one.outside for one in radii))


def _radii(driven: Followed, chart: Chart, poses: BoolArray, unit: int, outer: FloatArray, inner: FloatArray | None, half: float) -> Radii:
    """Return the radii of points ``outer`` ahead of the axle on the outer side, and of ``inner`` ones, or of the whole inner side."""
    t, e = places(driven, chart, unit, outer, np.full(len(outer), -half))
    apart = np.where(poses[:, None], np.abs(t - chart.within(t)), np.inf)
    outside = float(np.max((chart.radius - e)[apart <= apart.min()]))  # a turn of a step or less: where it comes nearest to it
    centre = chart.centre - driven.axles[:, unit]
    cos, sin = np.cos(driven.headings[:, unit]), np.sin(driven.headings[:, unit])
    ahead, left = centre[:, 0] * cos + centre[:, 1] * sin, centre[:, 1] * cos - centre[:, 0] * sin - half
    nearest = np.clip(ahead, outer.min(), outer.max())[:, None] if inner is None else inner
    distance = np.copysign(np.hypot(ahead[:, None] - nearest, left[:, None]), left[:, None])
    return Radii(float(distance[poses].min()), outside)


def _off_tracking(driven: Followed, chart: Chart, poses: BoolArray) -> tuple[float, ...]:
    zero = np.zeros(1)
    front_t, front_e = front_track(driven, chart)
    found = []
    for unit in range(len(driven.vehicle.units)):
        t, e = places(driven, chart, unit, zero, zero)
        passed = poses & (t[:, 0] >= front_t[0])
        inside = e[passed, 0] - np.interp(t[passed, 0], front_t, front_e)
        found.append(float(inside.max(initial=0.0)))
    return tuple(found)


def _tail_swing(driven: Followed, number: int) -> float:
    """Return how far a unit's rear outer corner swings out; the vehicle stands along x before the turn, which is to the left."""
    unit = driven.vehicle.units[number]
    y = driven.points(number, np.array([-unit.rear_overhang]), np.array([-0.5 * unit.width]))[:, 0, 1]
    swinging = driven.headings[:, number] < 0.5 * np.pi
    return float((y[0] - y[swinging]).max())


def _frontal_swing(driven: Followed) -> float | None:
    """Return how far the front outer corner runs beyond the line of the lead unit's outer side in the exit."""
    if driven.manoeuvre.angle is None:
        return None
    lead, (x, y, heading, _) = driven.vehicle.lead, driven.path.at(driven.path.starts[-1:])[0]
    corner = driven.points(0, np.array([lead.front]), np.array([-0.5 * lead.width]))[:, 0]
    out = np.array([np.sin(heading), -np.cos(heading)])
    turning = driven.headings[:, 0] > heading - 0.5 * np.pi
    side = driven.points(0, np.zeros(1), np.array([-0.5 * lead.width]))[0, 0, 1]  # before the turn: y of the outer side
    begin = driven.guide[0]
    line = np.array([x, y]) @ out + (begin[1] - side)  # the guided point's line, and as far beyond it as the side is
    return float(max(0.0, (corner[turning] @ out - line).max()))
