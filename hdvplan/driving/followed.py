"""A path of one's own as a drive: the lead unit is where the path says, its trailers follow, and nothing is planned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy  # its subpackages load when they are first used

from hdvplan.arrays import BoolArray, FloatArray
from hdvplan.centring.stationary import CentringTable
from hdvplan.driving.drive import POSE_SPACING_M, Drive, simulate
from hdvplan.driving.given import PLANE_HINT, GivenPath, unit_hint
from hdvplan.driving.start import start_of
from hdvplan.errors import OptionError, PlanError, RoadError
from hdvplan.planning.objectives import Objective
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import stations_of
from hdvplan.road.arcs import wrapped
from hdvplan.road.crs import ELSEWHERE_HINT
from hdvplan.road.passages import Passage
from hdvplan.road.path import ReferencePath, project_many
from hdvplan.road.regions import Side
from hdvplan.road.road import Road, part_of
from hdvplan.vehicle.model import Vehicle

_APART_M = 1e-6  # nearer points are one
_ROOM_M = 20.0  # of line beyond the road, for points before its start and beyond its end
_FAR_M = 50.0  # from the line: such a path is another road's
_BEGINS_M = 10.0  # beyond the limits, and
_UNLIMITED_M = 5.0  # from the line to where they are taken to be where there are none: a path does not begin further away
_ASKEW = 0.1  # that a heading may differ from the direction to the next point [rad]: rounding, and how a curvature changes between them
_LONG_M = 0.2  # distance of points from which such a direction is known in spite of rounding
_STEERED_M = 1.0  # over which the curvature is looked at: points rounded to a millimetre then leave an error of 0.002 1/m
_CURVED = 0.01  # share of the largest curvature, and
_ROUNDED = 2e-3  # curvature [1/m] by which it may be exceeded
_SAME_M = 0.05  # two places of a road are one
_NEWTON = 4  # steps; the first guess is between points that are at most some metres apart
_FORWARD = 0.05  # cosine of the angle to the line, at least
_HINT = "x and y are the middle of the lead unit's rear axle, heading its direction [rad, counter-clockwise from x]"
_UNEVEN = 5.0  # times as far apart as most points: a curve through both swings
_THIN_M = 5.0  # points of a recorded track are as far apart, at least
_RECORDED = "near points count to the millimetre: of a track that was recorded keep one every 5 to 10 m"
_SCATTERED = (
    "give a planned path's points every 0.5 to 1 m; a recorded track scatters too much for this spacing: smooth it, as by a moving mean;"
    " no answer is better than its error"
)


@dataclass(frozen=True)
class Followed:
    """The drive along a given path, and how far the trailers come from where the path has them [rad]."""

    drive: Drive
    apart: float | None  # None where it says nothing of them


def followed(road: Road, vehicle: Vehicle, settings: PlannerSettings, path: GivenPath, objective: Objective) -> Followed:
    """Return the drive of a vehicle along a given path, over the part of the road that it covers; ``objective`` is not asked.

    Between its points, ``filled``, the path is the cubic with their headings; over each ``POSE_SPACING_M`` of road the trailers follow an
    arc with the path's mean curvature there. Where the path says nothing of the trailers, they begin as they stand in a circle of the
    road's curvature.

    Raises:
        RoadError: points or headings that are no path, or that do not run along the road.
        PlanError: a curvature that the vehicle cannot steer, or a motion that leaves the model's domain.

    """
    _refuse_far(road, path.points)
    curve = _Curve.of(path, vehicle)
    line = road.path.extended(_ROOM_M + vehicle.reach_behind, curve.length + _ROOM_M)
    (feet, offsets), step = _feet(line, road.path.length, curve), settings.step
    road = road.passing({number: _side(one, feet, offsets) for number, one in enumerate(road.passages)})
    begins, ends = max(0.0, float(feet[0])), step * np.ceil(road.path.length / step - _APART_M)
    if begins > _APART_M or feet[-1] < ends - _APART_M:
        ends = begins + step * np.floor((min(float(feet[-1]), road.path.length) - begins) / step + _APART_M)
        if ends - begins < vehicle.reach_ahead + vehicle.reach_behind:
            msg = f"the path covers {max(ends - begins, 0.0):.1f} m of the road, less than the {vehicle.name} is long"
            raise RoadError(msg, s_m=begins, hint="judge a longer part of it")
        beyond, whole = vehicle.reach_ahead + vehicle.reach_behind + _ROOM_M, road.path.length
        road, feet = part_of(road, begins, ends, beyond, beyond + settings.horizon), feet - begins
        if ends - begins < whole - step:
            counted = "; arclengths count from its beginning" if begins > 0.0 else ""
            road = replace(road, notes=(*road.notes, f"the path covers s = {begins:z.1f} to {ends:z.1f} m of {whole:.1f} m{counted}"))
    stations = stations_of(road, vehicle, CentringTable.of(vehicle), step=step, horizon=settings.horizon)
    keep = int(np.ceil(step / POSE_SPACING_M))
    count = keep * round(np.ceil(road.path.length / step - _APART_M))
    last = min(float(feet[-1]), road.path.length + vehicle.reach_behind)  # as a plan's last bodies leave the road
    poses_s = step / keep * np.arange(max(count, int(last * keep / step)) + 1, dtype=np.float64)
    at = curve.where(stations.path, poses_s, feet)
    _refuse_sharp(curve, at, vehicle, poses_s + begins)
    z, kappa = _poses(curve, at, stations.path, poses_s, start_of(stations, vehicle).z, vehicle)
    drive = Drive(
        road, vehicle, settings, stations, objective(stations, vehicle), z[: count + 1 : keep], kappa[:count:keep],
        poses_s, z, kappa, (), 0.0,
    )  # fmt: skip
    return Followed(drive, curve.apart(at, z[:, 2 : vehicle.rigid_states]))


@dataclass(frozen=True)
class _Curve:
    """A given path as a curve over its length; ``t`` (n,) [m] is where its points are."""

    t: FloatArray
    points: FloatArray
    position: scipy.interpolate.CubicHermiteSpline
    betas: FloatArray | None
    steering: FloatArray
    named: Callable[[int], str]  # what messages call its points
    hint: str  # where it turns too sharply

    @classmethod
    def of(cls, path: GivenPath, vehicle: Vehicle) -> _Curve:
        """Return the curve through the points of a path."""
        for name, angles, count in (("betas", path.betas, len(vehicle.units) - 1), ("steering", path.steering, len(vehicle.active))):
            if angles is not None and angles.shape[1] != count:
                msg = f"{name} have {angles.shape[1]} columns, the {vehicle.name} {count}"
                raise OptionError(msg)
        given, path = path, path.filled()
        own: BoolArray = np.append(True, np.hypot(*np.diff(path.points, axis=0).T) > _APART_M)[: len(path.points)]
        points, rows = path.points[own], np.flatnonzero(own)

        def named(number: int) -> str:
            return path.named(int(rows[number]))

        if len(points) < 2:  # noqa: PLR2004 - a line has two
            msg = "the path has fewer than two different points"
            raise RoadError(msg, hint=_HINT)
        chords = np.diff(points, axis=0)
        length, usual = np.hypot(*chords.T), float(np.median(given.spacing))
        hint = _SCATTERED if usual > _THIN_M else _RECORDED
        if vehicle.active and path.steering is None:
            msg = "the path has no column steering1 with the angles of the wheels that the vehicle steers by itself"
            raise RoadError(msg, hint=f"{_HINT}; one column for each steered axle")
        steering = np.zeros((len(points), 0)) if path.steering is None else path.steering[own]
        if path.heading is None:
            t = np.append(0.0, np.cumsum(length))
            spline = scipy.interpolate.CubicSpline(t, points)
            heading = np.arctan2(*spline(t, 1).T[::-1])
        else:
            heading = path.heading[own]
        turn = wrapped(np.diff(heading))
        off = np.abs(wrapped(np.arctan2(chords[:, 1], chords[:, 0]) - heading[:-1] - 0.5 * turn))
        askew = np.flatnonzero((off > _ASKEW) & (length > _LONG_M))
        if askew.size:
            row = int(askew[0])
            where = f"at {named(row)} the path"
            if path.heading is None:
                turns = np.degrees(np.abs(wrapped(np.diff(np.arctan2(*chords.T[::-1])))))
                by = f"by {np.max(turns[max(row - 1, 0) : row + 1]):.0f} degrees within {length[row]:.1f} m"
                msg = f"{where} turns too sharply for a curve through its points, {by}"
                longest = int(np.argmax(length))
                gap = f"put its points evenly: most are {usual:.1f} m from the next one, {named(longest)} {length[longest]:.1f} m"
                raise RoadError(msg, hint=gap if length[longest] > _UNEVEN * usual else hint)
            msg = f"{where} goes {np.degrees(off[row]):.0f} degrees off its heading, to a point {length[row]:.1f} m on"
            raise RoadError(msg, hint=f"{_HINT}, heading_deg in degrees; it does not slip, goes forwards, and has a point every 0.5 to 1 m")
        arcs = length / np.sinc(0.5 * turn / np.pi)
        t = np.append(0.0, np.cumsum(arcs))
        position = scipy.interpolate.CubicHermiteSpline(t, points, np.column_stack([np.cos(heading), np.sin(heading)]))
        return cls(t, points, position, None if path.betas is None else path.betas[own], steering, named, hint)

    @property
    def length(self) -> float:
        """Its length [m]."""
        return float(self.t[-1])

    def heading(self, t: FloatArray) -> FloatArray:
        """Return its continuous headings [rad]."""
        dx, dy = self.position(t, 1).T
        return np.asarray(np.unwrap(np.arctan2(dy, dx)))

    def where(self, line: ReferencePath, s: FloatArray, feet: FloatArray) -> FloatArray:
        """Return where on the curve the line's normals at ``s`` [m] meet it, (n,) [m]; ``feet`` are those of its points."""
        t = np.interp(s, feet, self.t)
        for _ in range(_NEWTON):
            x, y = self.position(t).T
            found, offset, cos, sin, curvature = project_many(line, x, y, s)
            dx, dy = self.position(t, 1).T
            along = (dx * cos + dy * sin) / (1.0 - curvature * offset)
            t = t + np.where(along > _FORWARD, (s - found) / np.maximum(along, _FORWARD), np.nan)
        wrong = ~np.isfinite(t)
        if np.any(wrong):
            at = float(s[np.argmax(wrong)])
            msg = f"at s = {at:z.1f} m the path leaves the road-aligned model's domain"
            raise PlanError(msg, s_m=at, hint="a road whose line runs along the path judges it")
        return t

    def apart(self, at: FloatArray, betas: FloatArray) -> float | None:
        """Return how far articulations differ at most from the path's own, of the poses ``at``; None where it has none."""
        if self.betas is None:
            return None
        return float(np.max(np.abs(self.between(at, self.betas) - betas)))

    def between(self, at: FloatArray, values: FloatArray) -> FloatArray:
        """Return what the path says at its points, (n, k), at places between them, (len(at), k)."""
        return np.array([np.interp(at, self.t, column) for column in values.T]).reshape(-1, len(at)).T


def _side(passage: Passage, feet: FloatArray, offsets: FloatArray) -> Side:
    """Return on which side of an obstacle a path passes; where that lies on both sides of the line there is but the usual one."""
    if passage.around:
        return passage.usual
    offset = np.interp(0.5 * (passage.s_from + passage.s_to), feet, offsets)
    return Side.LEFT if 2.0 * offset > passage.low + passage.high else Side.RIGHT


def _feet(line: ReferencePath, length: float, curve: _Curve) -> FloatArray:
    """Return arclengths, increasing, and offsets of the feet of a path's points, (2, n) [m]; the first is sought along the whole road.

    Raises:
        RoadError: they do not run forwards along the line.

    """
    s, points = np.linspace(0.0, length, int(np.ceil(length)) + 1), curve.points
    there = line.at(s)
    ahead = np.arctan2(*(points[1] - points[0])[::-1])
    apart = np.hypot(there.x - points[0, 0], there.y - points[0, 1])
    away = apart + _FAR_M * (np.cos(there.heading - ahead) < 0.0)
    near = float(s[np.argmax(away < np.min(away) + _SAME_M)])  # the first one: the ends of a closed road are one place
    if np.min(away) > _FAR_M:
        msg = f"the path begins {np.min(apart):.0f} m away from the road, against its direction"
        raise RoadError(msg, hint="--reverse judges it along the road driven the other way")
    feet = np.empty((2, len(points)))
    step = 0.0
    for number, (x, y) in enumerate(points):
        found = project_many(line, np.array([x]), np.array([y]), np.array([near + step]))
        if not np.isfinite(found[1, 0]) or abs(found[1, 0]) > _FAR_M or (number and found[0, 0] <= feet[0, number - 1]):
            msg = f"at {curve.named(number)}, near s = {near:z.1f} m, the path does not go forwards along the road"
            raise RoadError(msg, s_m=near, hint=unit_hint(points, line, length) or "it runs beside the road's line, in its direction")
        feet[:, number], near = found[:2, 0], float(found[0, 0])
        step = float(np.hypot(*(points[number + 1] - points[number]))) if number + 1 < len(points) else 0.0
    return feet


def _refuse_far(road: Road, points: FloatArray) -> None:
    """Refuse a path whose ``points``, (n, 2) [m], begin far from the road, before anything else is found wrong with it.

    Raises:
        RoadError: they do.

    """
    s = np.arange(-_FAR_M, road.path.length + _FAR_M)  # a path may begin before the road does
    there = road.path.extended(_FAR_M, _FAR_M).at(s)
    limits = _UNLIMITED_M if road.limits is None else np.max(np.abs(road.limits.table(s)[:2]), axis=0)
    apart = np.hypot(there.x - points[0, 0], there.y - points[0, 1]) if len(points) else np.zeros(1)
    if np.min(apart - limits) > _BEGINS_M:
        msg = f"the path begins {np.min(apart):.0f} m away from the road's line"
        raise RoadError(msg, hint=unit_hint(points, road.path, road.path.length) or f"{PLANE_HINT}; {ELSEWHERE_HINT}")


def _refuse_sharp(curve: _Curve, at: FloatArray, vehicle: Vehicle, s: FloatArray) -> None:
    """Refuse a path that the vehicle cannot steer; its curvature is looked at over some ``_STEERED_M``.

    Raises:
        PlanError: it is too tight.

    """
    count = max(1, round(_STEERED_M / float(s[1] - s[0])))
    heading = curve.heading(at)
    kappa = (heading[count:] - heading[:-count]) / (at[count:] - at[:-count])
    sharp = np.flatnonzero(np.abs(kappa) > (1.0 + _CURVED) * vehicle.max_curvature + _ROUNDED)
    if sharp.size:
        place = float(s[sharp[0]])
        worst = float(np.max(np.abs(kappa)))
        turns = f"it turns with up to {worst:.3f} 1/m, the {vehicle.name} with {vehicle.max_curvature:.3f}"
        msg = f"from s = {place:z.1f} m on the path is too tight: {turns}"
        raise PlanError(msg, s_m=place, hint=curve.hint)


def _poses(
    curve: _Curve, at: FloatArray, line: ReferencePath, s: FloatArray, start: FloatArray, vehicle: Vehicle
) -> tuple[FloatArray, FloatArray]:
    """Return the states at all poses, (n, states), and the curvature from each to the next: the lead unit's are the path's.

    Raises:
        PlanError: the trailers leave the model's domain.

    """
    x, y = curve.position(at).T
    road, heading = line.at(s), curve.heading(at)
    _, offset = line.project(x, y, s)
    kappa = np.diff(heading) / np.diff(at)
    rigid, units = vehicle.rigid_states, vehicle.table()
    z = np.empty((len(s), vehicle.states))
    z[:, 0], z[:, 1] = offset, wrapped(heading - road.heading)
    z[:, rigid:] = curve.between(at, curve.steering)
    z[0, 2:rigid] = start[2:rigid] if curve.betas is None else curve.between(at[:1], curve.betas)[0]
    if rigid == 2:  # noqa: PLR2004 - offset and direction: no trailer
        return z, kappa
    for number, curvature in enumerate(kappa):
        moved = simulate(units, line, float(s[number]), float(s[1] - s[0]), z[number], curvature[None], 1, z[number : number + 2, rigid:])
        z[number + 1, 2:rigid] = moved[1, 2:rigid]
    if not np.all(np.isfinite(z)):
        place = float(s[np.argmin(np.all(np.isfinite(z), axis=1))])
        msg = f"at s = {place:z.1f} m the motion leaves the road-aligned model's domain"
        raise PlanError(msg, s_m=place)
    return z, kappa
