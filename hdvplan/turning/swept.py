"""Where a driven manoeuvre sweeps, seen along the turn, and its figures, as highway manuals and type approval ask for them.

A point of the plane has a place t and an offset e, positive towards the centre. Beside the straight before and after the turn they are
measured along and across it, in between by angle and radius about the arc's centre: t = radius * angle, e = radius - distance. Both go on
smoothly over the borders, where the cross-sections through the centre lie.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hdvplan.arrays import BoolArray, FloatArray
from hdvplan.errors import TurnError
from hdvplan.turning.follow import Followed

STATION_M = 0.1  # between the cross-sections
_OUTLINE_M = 0.1  # between outline points: a body's straight side is then off its true offset by 0.2 mm at a radius of 6 m
_AT_ONCE = 2000
_JUMP_M = 5.0  # a piece of outline or track this long crosses from one leg of the turn to another


@dataclass(frozen=True)
class Chart:
    """The frame of one turn to the left."""

    centre: FloatArray  # of the arc (2,) [m]
    radius: float  # [m]
    heading: float  # before the turn [rad]
    angle: float | None  # of the turn [rad]; None: a circle without exit

    def seen(self, points: FloatArray, near: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return t and e [m] of ``points`` (..., 2); where the turn crosses itself, those nearest to t = ``near`` [m]."""
        x, y = points[..., 0] - self.centre[0], points[..., 1] - self.centre[1]
        cos, sin = np.cos(self.heading), np.sin(self.heading)
        before, inside = x * cos + y * sin, y * cos - x * sin
        polar = np.arctan2(before, -inside)
        around = self.radius * (polar + 2.0 * np.pi * np.round((near / self.radius - polar) / (2.0 * np.pi)))
        t, e = around, self.radius - np.hypot(x, y)
        unlikely = np.where((around >= 0.0) & (around <= self.length), np.abs(around - near), np.inf)
        candidates = [(before, self.radius + inside, before <= 0.0)]
        if self.angle is not None:
            cos, sin = np.cos(self.heading + self.angle), np.sin(self.heading + self.angle)
            after = x * cos + y * sin
            candidates.append((self.length + after, self.radius + y * cos - x * sin, after >= 0.0))
        for along, across, possible in candidates:
            apart = np.where(possible, np.abs(along - near), np.inf)
            better = apart < unlikely
            t, e, unlikely = np.where(better, along, t), np.where(better, across, e), np.where(better, apart, unlikely)
        return t, e

    @property
    def length(self) -> float:
        """The arc's length [m]: t where the turn ends."""
        return np.inf if self.angle is None else self.radius * self.angle

    def within(self, t: FloatArray) -> FloatArray:
        """Return the nearest places between the cross-sections where the turn begins and ends."""
        return np.asarray(np.clip(t, 0.0, self.length))

    def metres(self, t: FloatArray, share: FloatArray) -> FloatArray:
        """Return ``t`` as metres in the plane at ``share`` radii from the centre: in between, t is the length of the arc itself."""
        inside = self.within(t)
        return t - inside + share * inside


@dataclass(frozen=True)
class Band:
    """Offsets of the swept band's edges over ``t`` (n,), from the arc and its tangents, positive towards the centre [m]; NaN where none."""

    t: FloatArray
    inner: FloatArray
    outer: FloatArray

    @property
    def width(self) -> FloatArray:
        """Swept width (n,) [m]."""
        return np.asarray(self.inner - self.outer)


def chart_of(driven: Followed) -> Chart:
    """Return the frame of a driven manoeuvre: the centre is that of its tightest place."""
    tight = driven.path.starts[int(np.argmax(driven.path.pieces[:, 1] > 0.0))]  # where the arc begins
    if not np.any(driven.path.pieces[:, 1] > 0.0):
        tight = driven.path.starts[-1]  # all ramps
    x, y, heading, _ = driven.path.at(np.array([tight]))[0]
    radius = driven.manoeuvre.radius
    centre = np.array([x - radius * np.sin(heading), y + radius * np.cos(heading)])
    return Chart(centre, radius, driven.path.heading, None if driven.manoeuvre.angle is None else driven.angle)


def counted(driven: Followed) -> BoolArray:
    """Tell which poses the figures are taken from: all, or in a full circle those of the last quarter turn, when it is steady."""
    first = 0.0 if driven.manoeuvre.angle is not None else driven.s[-1] - 0.5 * np.pi * driven.manoeuvre.radius
    return np.asarray(driven.s >= first)


def places(driven: Followed, chart: Chart, unit: int, ahead: FloatArray, left: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return t and e of body points of ``unit`` at all poses, (n, len(ahead)) each [m]."""
    begun = driven.path.starts[int(np.argmax(np.max(driven.path.pieces[:, 1:], axis=1) > 0.0))]
    near = driven.s[:, None] - begun + ahead - driven.vehicle.behind[unit] - driven.vehicle.lead.wheelbase
    return chart.seen(driven.points(unit, ahead, left), near)


def band_of(driven: Followed) -> Band:
    """Return the swept band of all bodies along the turn, with the tracks between poses as straight lines in (t, e).

    Of a full circle it is the band of the last quarter turn.

    Raises:
        TurnError: no cross-section of a full circle is passed by all of every body: the circle's centre is within one, or nearly so.

    """
    chart, driven = chart_of(driven), _steady_part(driven)
    tracks = []
    for number, unit in enumerate(driven.vehicle.units):
        along = np.linspace(-unit.rear_overhang, unit.front, max(2, int(np.ceil(unit.length / _OUTLINE_M)) + 1))
        half = np.full(len(along), 0.5 * unit.width)
        ring = np.append(along, along[::-1]), np.append(half, -half)
        tracks.append(places(driven, chart, number, *ring))
    ends = [(t.min(), t.max()) for t, _ in tracks]
    begin, end = min(low for low, _ in ends), max(high for _, high in ends)
    if driven.manoeuvre.angle is None:  # what every body has passed
        begin, end = max(t[0].max() for t, _ in tracks), min(t[-1].min() for t, _ in tracks)
        if end <= begin:
            radius, name = driven.manoeuvre.radius, driven.vehicle.name
            msg = f"on a radius of {radius:.2f} m the {name} reaches around the circle's centre: the band that it sweeps has no inner edge"
            raise TurnError(msg, radius_m=radius, hint="choose a larger radius")
    first = np.floor(begin / STATION_M)
    count = int(np.ceil(end / STATION_M) - first) + 1
    stations = STATION_M * (first + np.arange(count))
    inner, outer = np.full(count, -np.inf), np.full(count, np.inf)
    for t, e in tracks:
        closed_t, closed_e = np.append(t, t[:, :1], axis=1), np.append(e, e[:, :1], axis=1)
        for some in range(0, len(t), _AT_ONCE):  # poses: memory
            own, next_ = slice(some, some + _AT_ONCE), slice(some + 1, some + 1 + _AT_ONCE)
            _widen(chart, closed_t[own, :-1], closed_e[own, :-1], closed_t[own, 1:], closed_e[own, 1:], stations, inner, outer)
            last = len(t[next_])
            _widen(chart, t[own][:last], e[own][:last], t[next_], e[next_], stations, inner, outer)
    seen = np.isfinite(inner)
    return Band(stations, np.where(seen, inner, np.nan), np.where(seen, outer, np.nan))


def _steady_part(driven: Followed) -> Followed:
    """Return the drive without the poses before the part of a full circle that counts, or as it is.

    Where bodies are longer than a quarter turn, the part is as much longer.
    """
    if driven.manoeuvre.angle is not None:
        return driven
    length = driven.vehicle.reach_ahead + driven.vehicle.reach_behind
    first = int(driven.s.searchsorted(max(0.0, driven.s[-1] - 0.5 * np.pi * driven.manoeuvre.radius - 1.5 * length)))
    rows = {name: getattr(driven, name)[first:] for name in ("s", "guide", "kappa", "beta", "poses", "headings")}
    return replace(driven, **rows)


def _widen(
    chart: Chart, t_from: FloatArray, e_from: FloatArray, t_to: FloatArray, e_to: FloatArray, stations: FloatArray, inner: FloatArray,
    outer: FloatArray,
) -> None:  # fmt: skip
    """Widen the band by pieces of outlines and tracks, straight in (t, e) and, across the borders of the turn, in the plane."""
    swap = t_to < t_from
    t0, e0 = np.where(swap, t_to, t_from).ravel(), np.where(swap, e_to, e_from).ravel()
    t1, e1 = np.where(swap, t_from, t_to).ravel(), np.where(swap, e_from, e_to).ravel()
    begin = np.maximum(np.ceil((t0 - stations[0]) / STATION_M - 1e-9).astype(np.int64), 0)
    end = np.minimum(np.floor((t1 - stations[0]) / STATION_M + 1e-9).astype(np.int64), len(stations) - 1)
    count = np.where(t1 - t0 > _JUMP_M, 0, np.maximum(end - begin + 1, 0))
    piece = np.repeat(np.arange(len(count)), count)
    station = begin[piece] + np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count)
    share = 1.0 - 0.5 * (e0 + e1)[piece] / chart.radius
    first, last = chart.metres(t0[piece], share), chart.metres(t1[piece], share)
    length = last - first
    part = np.clip((chart.metres(stations[station], share) - first) / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
    offset = e0[piece] + part * (e1[piece] - e0[piece])
    np.maximum.at(inner, station, np.where(length > 0.0, offset, np.maximum(e0, e1)[piece]))
    np.minimum.at(outer, station, np.where(length > 0.0, offset, np.minimum(e0, e1)[piece]))


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
    at = driven.poses[:, unit]
    x, y = chart.centre[0] - at["x"], chart.centre[1] - at["y"]
    ahead, left = x * at["cos"] + y * at["sin"], y * at["cos"] - x * at["sin"] - half
    nearest = np.clip(ahead, outer.min(), outer.max())[:, None] if inner is None else inner
    distance = np.copysign(np.hypot(ahead[:, None] - nearest, left[:, None]), left[:, None])
    return Radii(float(distance[poses].min()), outside)


def _off_tracking(driven: Followed, chart: Chart, poses: BoolArray) -> tuple[float, ...]:
    zero = np.zeros(1)
    front_t, front_e = (row[:, 0] for row in places(driven, chart, 0, np.array([driven.vehicle.lead.wheelbase]), zero))
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
