"""The room at a place: between the body that reaches furthest and the road's edge, an obstacle or, without either, the centre.

Distances to obstacles are measured in the plane, as everywhere; edges are limits along s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray
from hdvplan.judging.balance import KEPT_M, Breach, edges_of, judged_table
from hdvplan.judging.bodies import corners
from hdvplan.judging.obstacles import Approach
from hdvplan.judging.result import Result

_FAR_M = 5.0  # what is further away is not tight, where anything else is: roads without widths are open far out


@dataclass(frozen=True)
class Room:
    """The least room beside arclength ``s`` [m], from a body's point to what it comes near: ``ends`` (2, 2), x, y [m]."""

    s: float
    depth: float  # beyond the edge or inside the obstacle; negative where it is kept; without limits less the reach [m]
    side: str
    unit: int
    ends: FloatArray
    outwards: FloatArray  # (2,), of length 1, across the road
    limited: bool
    obstacle: str | None = None  # what users call it, "" without a name; None for the road's edge

    @property
    def broken(self) -> bool:
        """Whether there is a limit and it is broken."""
        return self.limited and self.depth > KEPT_M

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
    if not result.edge_gaps:
        return np.maximum(envelope.reach_left, -envelope.reach_right)
    score: FloatArray = -np.fmin.reduce(np.concatenate(list(result.edge_gaps.values())), axis=0)
    score = np.where(np.isfinite(score), score, -np.inf)
    for approach in result.approaches:
        at = _sample(result, approach.s)
        score[at] = max(score[at], -approach.distance)
    return np.where(score < -_FAR_M, -np.inf, score) if np.any(score >= -_FAR_M) else score


def room_at(result: Result, at: int) -> Room:
    """Return the least room at sample ``at`` of the envelope, or the furthest reach on a road without limits."""
    s = float(result.envelope.s[at])
    if not result.edge_gaps:
        return _reach(result, at, s)
    near = [approach for approach in result.approaches if _sample(result, approach.s) == at]
    gaps = {key: gap[:, at] for key, gap in result.edge_gaps.items() if np.any(np.isfinite(gap[:, at]))}
    side, region = min(gaps, key=lambda key: float(np.nanmin(gaps[key])))
    gap, unit = float(np.nanmin(gaps[side, region])), int(np.nanargmin(gaps[side, region]))
    nearest = min(near, key=lambda approach: approach.distance, default=None)
    if nearest is not None and nearest.distance <= gap:
        return _beside(result, nearest, s)
    limit = edge_offset(result, s, side, region)
    return _across(result, s, side, unit, limit - gap if side == "left" else limit + gap, limit, -gap)


def edge_offset(result: Result, s: float, side: str, region: str) -> float:
    """Return the signed offset of the road's own edge [m]."""
    edges = edges_of(result.drive)
    assert edges is not None  # noqa: S101 - without limits there is nothing to be near
    table = judged_table(edges, result.envelope.s)
    return float(table[("left", "right").index(side) + (2 if region == "sweepable" else 0), _sample(result, s)])


def pose_touching(result: Result, room: Room) -> int:
    """Return the number of the simulated pose at which a body reached the place of least room."""
    drive = result.drive
    near = np.flatnonzero(np.abs(drive.poses_s - room.s) <= drive.vehicle.reach_ahead + drive.vehicle.reach_behind)
    bodies = shapely.polygons(corners(drive, near)[:, room.unit])
    return int(near[int(np.argmin(shapely.distance(shapely.boundary(bodies), shapely.Point(room.ends[0]))))])


def breach_place(result: Result, breach: Breach) -> tuple[float, float]:
    """Return arclength and signed offset [m] of the place that a body reached at a breach's deepest."""
    if breach.obstacle is not None:
        approach = approach_of(result, breach)
        _, offset = result.drive.stations.path.project(approach.x, approach.y, approach.s)
        return breach.s_deepest, float(offset)
    limit = edge_offset(result, breach.s_deepest, breach.side, breach.region)
    return breach.s_deepest, limit + breach.depth if breach.side == "left" else limit - breach.depth


def approach_of(result: Result, breach: Breach) -> Approach:
    """Return the approach to the obstacle that a breach is about."""
    s, distance = result.approached
    return result.approaches[int(np.argmin(np.abs(s - breach.s_deepest) + np.abs(distance + breach.depth)))]


def shared_with(result: Result, approach: Approach) -> BaseGeometry:
    """Return the area of an obstacle that bodies entered, at the simulated poses."""
    inside = result.outlines.query(approach.obstacle.polygon, predicate="intersects")
    return shapely.union_all(shapely.intersection(result.outlines.geometries[inside], approach.obstacle.polygon))


def _sample(result: Result, s: float) -> int:
    return int(np.argmin(np.abs(result.envelope.s - s)))


def _reach(result: Result, at: int, s: float) -> Room:
    envelope = result.envelope
    left, right = float(envelope.reach_left[at]), float(envelope.reach_right[at])
    side, reach, bodies = ("left", left, envelope.left) if left >= -right else ("right", right, -envelope.right)
    return _across(result, s, side, int(np.nanargmax(bodies[:, at])), reach, 0.0, -abs(reach), limited=False)


def _across(result: Result, s: float, side: str, unit: int, reach: float, limit: float, depth: float, *, limited: bool = True) -> Room:
    ends = np.column_stack(result.drive.road.path.to_plane(np.full(2, s), np.array([reach, limit])))
    return Room(s, depth, side, unit, ends, _outwards(result, s, side), limited)


def _beside(result: Result, near: Approach, s: float) -> Room:
    body = shapely.Point(near.x, near.y)
    there = shapely.boundary(near.obstacle.polygon) if near.distance < 0.0 else near.obstacle.polygon
    ends = shapely.get_coordinates(shapely.shortest_line(body, there))
    middle, at = np.array(result.drive.road.path.to_plane(s, 0.0)), ends[1]
    outwards = _outwards(result, s, "left")
    side = "left" if (at - middle) @ outwards > 0.0 else "right"
    return Room(s, -near.distance, side, near.unit, ends, outwards if side == "left" else -outwards, True, near.obstacle.label)


def _outwards(result: Result, s: float, side: str) -> FloatArray:
    heading = float(result.drive.road.path.at(s).heading)
    return (1.0 if side == "left" else -1.0) * np.array([-np.sin(heading), np.cos(heading)])
