"""Tight places: the least room beside the line, in the plane, and which stretches of a road deserve an enlargement.

Room counts from the body that is nearest to a kerb or an obstacle or, without either, from the road's centre.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray
from hdvplan.judging.balance import KEPT_M, Breach
from hdvplan.judging.bodies import corners
from hdvplan.judging.clearance import Approach
from hdvplan.judging.result import Result
from hdvplan.report.kerbs import kerb_lines
from hdvplan.road.path import project_many
from hdvplan.vehicle.model import Vehicle

_NEARLY_M = 0.5  # more room than at the tightest place: what is wider is not worth enlarging
_FAR_M = 5.0  # what is further away is not tight, where anything else is: roads without widths are open far out
_FAR_REACHES = 2.0  # limits further out than this many reaches need no place in a drawing
_LABELS = "ABCD"  # of a long road's enlargements; a shorter one gets the first two
LONG_ROAD_M = 300.0  # beyond it a body is a speck on a map of the whole
FEW_BELOW_M = 1000.0
_LENGTHS = 1.5  # vehicle lengths shown on either side
_HALF_LENGTH_M = (25.0, 45.0)  # whatever the vehicle
_OF_SHORT, _SHORT_HALF_M = 0.1, 12.0  # of a short road's length shown on either side, and at least: else it would be the whole again


@dataclass(frozen=True)
class Room:
    """The least room beside arclength ``s`` [m], from a body's point to what it comes near: ``ends`` (2, 2), x, y [m]."""

    s: float
    depth: float  # beyond the edge or inside the obstacle; negative where it is kept; without limits less the reach [m]
    side: str
    unit: int
    ends: FloatArray
    outwards: FloatArray  # (2,), of length 1
    limited: bool
    obstacle: str | None = None  # what users call it, "" without a name; None for the road's edge

    @property
    def broken(self) -> bool:
        """Whether there is a limit and it is broken."""
        return self.limited and self.depth > KEPT_M

    @property
    def near(self) -> bool:
        """Whether it is so little that it may be called tight."""
        return self.depth >= -_FAR_M

    @property
    def beyond(self) -> FloatArray:
        """The end that lies further out, (2,) [m]."""
        out: FloatArray = max(self.ends, key=lambda end: float(end @ self.outwards))
        return out

    @property
    def text(self) -> str:
        """What is lacking or to spare, as few words."""
        if not self.limited:
            return f"reach {-self.depth:.2f} m"
        if self.broken:
            return f"{self.depth:.2f} m beyond" if self.obstacle is None else f"{self.depth:.2f} m into {self.obstacle or 'obstacle'}"
        return f"clearance {max(-self.depth, 0.0):.2f} m"


def tightness(result: Result) -> FloatArray:
    """Return how tight it is at the envelope's arclengths [m], larger is tighter: less the room, or the reach on a road without limits.

    Minus infinity where nothing is near. Obstacles count where they are nearest.
    """
    envelope = result.envelope
    if not result.gaps:
        return np.maximum(envelope.reach_left, -envelope.reach_right)
    score: FloatArray = -np.fmin.reduce(np.concatenate(list(result.gaps.values())), axis=0)
    score = np.where(np.isfinite(score), score, -np.inf)
    for approach in result.approaches:
        at = _sample(result, approach.s)
        score[at] = max(score[at], -approach.distance)
    return np.where(score < -_FAR_M, -np.inf, score) if np.any(score >= -_FAR_M) else score


def shown_reach(result: Result) -> tuple[FloatArray, FloatArray]:
    """Return how far a drawing shows to the left and, negative, to the right at the envelope's arclengths [m].

    It shows the swept area, and limits that are not far from it.
    """
    envelope, limits = result.envelope, result.drive.road.beside
    left, right = envelope.reach_left, envelope.reach_right
    if limits is None:
        return left, right
    far = _FAR_REACHES * max(float(np.max(left)), -float(np.min(right)))
    left_limit, right_limit = limits.table(envelope.s)[2:]
    return (
        np.where(np.abs(left_limit) < far, np.fmax(left_limit, left), left),
        np.where(np.abs(right_limit) < far, np.fmin(right_limit, right), right),
    )


def room_at(result: Result, at: int) -> Room:
    """Return the least room at sample ``at`` of the envelope, or the furthest reach on a road without limits."""
    s = float(result.envelope.s[at])
    if not result.gaps:
        return _reach(result, at, s)
    near = [approach for approach in result.approaches if _sample(result, approach.s) == at]
    gaps = {key: gap[:, at] for key, gap in result.gaps.items() if np.any(np.isfinite(gap[:, at]))}
    tightest = min(gaps, key=lambda key: float(np.nanmin(gaps[key])), default=None)
    nearest = min(near, key=lambda approach: approach.distance, default=None)
    if nearest is not None and (tightest is None or nearest.distance <= float(np.nanmin(gaps[tightest]))):
        return _beside(result, nearest, s)
    if tightest is None:
        return _reach(result, at, s)
    side, region = tightest
    gap, unit = float(np.nanmin(gaps[tightest])), int(np.nanargmin(gaps[tightest]))
    touch = result.balance.touches[side, region][unit, at]
    s, body = float(touch["s"]), np.array([touch["x"], touch["y"]])
    kerbs = [one.line for one in kerb_lines(result.drive.road, s - _FAR_M, s + _FAR_M) if one.side == side and one.region == region]
    ends = np.stack([body, _kerb_place(shapely.union_all(kerbs), body, abs(gap))])
    return Room(s, -gap, side, unit, ends, outwards_at(result, s, side), True)


def _kerb_place(kerbs: BaseGeometry, body: FloatArray, apart: float) -> FloatArray:
    """Return the place of kerbs that is ``apart`` from a body's point [m]: the nearest one, or a corner that lies inside the body."""
    nearest: FloatArray = shapely.get_coordinates(shapely.shortest_line(shapely.Point(body), kerbs))[1]
    if abs(float(np.hypot(*(nearest - body))) - apart) < KEPT_M:
        return nearest
    own = shapely.get_coordinates(kerbs)
    corner: FloatArray = own[np.argmin(np.abs(np.hypot(*(own - body).T) - apart))]
    return corner


def pose_touching(result: Result, room: Room) -> int:
    """Return the number of the simulated pose at which a body reached the place of least room."""
    drive = result.drive
    near = np.flatnonzero(np.abs(drive.poses_s - room.s) <= drive.vehicle.reach_ahead + drive.vehicle.reach_behind)
    near = near if len(near) else np.arange(len(drive.poses_s))  # the place of a kerb that is far away may be beside another stretch
    bodies = shapely.polygons(corners(drive, near)[:, room.unit])
    return int(near[int(np.argmin(shapely.distance(shapely.boundary(bodies), shapely.Point(room.ends[0]))))])


def breach_place(result: Result, breach: Breach) -> tuple[float, float]:
    """Return arclength and signed offset [m] of the place that a body reached at a breach's deepest; without a foot there, its distance."""
    path, near = result.drive.stations.path, min(max(breach.s_deepest, 0.0), result.drive.road.path.length)
    x, y = (np.array([value]) for value in breach.place)
    s, offset = project_many(path, x, y, np.array([near]))[:2]
    if np.isfinite(offset[0]):
        return float(s[0]), float(offset[0])
    here = path.at(near)
    distance = float(np.hypot(x[0] - here.x, y[0] - here.y))
    return near, distance if breach.side == "left" else -distance


def approach_of(result: Result, breach: Breach) -> Approach:
    """Return the approach to the obstacle that a breach is about."""
    s, distance = result.approached
    return result.approaches[int(np.argmin(np.abs(s - breach.s_deepest) + np.abs(distance + breach.depth)))]


def shared_with(result: Result, approach: Approach) -> BaseGeometry:
    """Return the area of an obstacle that bodies swept."""
    return shapely.union_all(shapely.intersection(np.array(result.swept), approach.obstacle.polygon))


def _sample(result: Result, s: float) -> int:
    return int(np.argmin(np.abs(result.envelope.s - s)))


def _reach(result: Result, at: int, s: float) -> Room:
    envelope = result.envelope
    left, right = float(envelope.reach_left[at]), float(envelope.reach_right[at])
    side, reach, bodies = ("left", left, envelope.left) if left >= -right else ("right", right, -envelope.right)
    ends = np.column_stack(result.drive.road.path.to_plane(np.full(2, s), np.array([reach, 0.0])))
    return Room(s, -abs(reach), side, int(np.nanargmax(bodies[:, at])), ends, outwards_at(result, s, side), limited=False)


def _beside(result: Result, near: Approach, s: float) -> Room:
    body = shapely.Point(near.x, near.y)
    there = shapely.boundary(near.obstacle.polygon) if near.distance < 0.0 else near.obstacle.polygon
    ends = shapely.get_coordinates(shapely.shortest_line(body, there))
    middle, at = np.array(result.drive.road.path.to_plane(s, 0.0)), ends[1]
    outwards = outwards_at(result, s, "left")
    side = "left" if (at - middle) @ outwards > 0.0 else "right"
    return Room(near.s, -near.distance, side, near.unit, ends, outwards if side == "left" else -outwards, True, near.obstacle.label)


def outwards_at(result: Result, s: float, side: str) -> FloatArray:
    """Return the unit vector across the road to one side of it at arclength ``s`` [m], which may lie beyond its ends."""
    path = result.drive.stations.path
    heading = float(path.at(min(max(s, path.s_first), path.s_last)).heading)
    return (1.0 if side == "left" else -1.0) * np.array([-np.sin(heading), np.cos(heading)])


@dataclass(frozen=True)
class Window:
    """A stretch of road, with what makes it worth a look."""

    s_from: float  # [m]
    s_to: float  # [m]
    label: str = ""
    reason: str = ""
    room: Room | None = None  # that makes it worth it

    @property
    def title(self) -> str:
        """The label and the reason as one line."""
        return f"{self.label}: {self.reason}"


def tightest_windows(result: Result) -> tuple[Window, ...]:
    """Return up to four stretches around the tightest places, two of a road below a kilometre, lettered in road order.

    Tight is the least clearance to edges and obstacles, or the furthest reach without limits.
    """
    length = result.drive.road.path.length
    half = half_length(result.drive.vehicle)
    if length <= LONG_ROAD_M:
        half = min(half, max(_OF_SHORT * length, _SHORT_HALF_M))
    labels, windows = _LABELS[: 2 if length < FEW_BELOW_M else None], []
    s, score = result.envelope.s, tightness(result)
    for label, at in zip(labels, sorted(peaks(s, nearly(score), 2.0 * half, len(labels))), strict=False):
        middle = min(max(room_at(result, at).s, half), max(length - half, half))
        shown = np.abs(s - middle) <= half
        room = room_at(result, int(np.argmax(np.where(shown, score, -np.inf))))  # a peak beside another one is not the tightest place there
        what = room.text if not room.broken or room.obstacle is not None else f"limit broken by {room.depth:.2f} m"
        windows.append(Window(middle - half, min(middle + half, length), label, f"{what} at s = {room.s:z.0f} m", room))
    return tuple(windows)


def nearly(score: FloatArray) -> FloatArray:
    """Return the scores of the tightest place and of those nearly as tight; minus infinity for the rest."""
    return np.where(score >= np.max(score) - _NEARLY_M, score, -np.inf)


def joined(windows: Iterable[Window]) -> list[Window]:
    """Return stretches in road order, those that overlap as one, with both labels."""
    found = list[Window]()
    for window in sorted(windows, key=lambda window: window.s_from):
        if found and window.s_from <= found[-1].s_to:
            before = found.pop()
            label = ", ".join(filter(None, (before.label, window.label)))
            found.append(Window(before.s_from, max(before.s_to, window.s_to), label))
        else:
            found.append(window)
    return found


def half_length(vehicle: Vehicle) -> float:
    """Return how much of the road is worth showing on either side of a place [m]."""
    return float(np.clip(_LENGTHS * (vehicle.reach_ahead + vehicle.reach_behind), *_HALF_LENGTH_M))


def peaks(s: FloatArray, score: FloatArray, apart: float, most: int) -> list[int]:
    """Return up to ``most`` samples of the highest scores at least ``apart`` [m] from each other, highest first."""
    left, found = score.copy(), list[int]()
    for _ in range(most):
        at = int(np.argmax(left))
        if not np.isfinite(left[at]):
            break
        found.append(at)
        left[np.abs(s - s[at]) < apart] = -np.inf
    return found
