"""How near the driven bodies came to every obstacle, in the plane: a judge that knows nothing of limits along s."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from hdvplan.driving.drive import Drive
from hdvplan.jit import FloatArray, IntArray
from hdvplan.judging.bodies import corners, placed
from hdvplan.judging.contact import part_named
from hdvplan.road.path import project_many
from hdvplan.road.regions import Kind, Region
from hdvplan.vehicle.body import axles_behind


@dataclass(frozen=True)
class Approach:
    """Where a drive came nearest to an obstacle, or was deepest in it."""

    obstacle: Region
    distance: float  # least distance of any body; negative: how deep one was inside [m]
    s: float  # of the place on the road [m]; before 0 or beyond the road's length where the obstacle lies beside neither
    s_from: float  # the places that a body was inside, or the nearest one [m]
    s_to: float
    x: float  # of the place [m]
    y: float
    unit: int
    side: str  # of the body, "left" or "right"
    part: str  # of the body, see ``contact``


def approaches(drive: Drive) -> tuple[Approach, ...]:
    """Return the nearest approach to each obstacle of the road, at the simulated poses (at most 0.25 m apart)."""
    obstacles = [region for region in drive.road.regions if region.kind is Kind.OBSTACLE]
    if not obstacles:
        return ()
    outlines = corners(drive, np.arange(len(drive.poses_s)))
    units = outlines.shape[1]
    bodies = np.asarray(shapely.polygons(outlines.reshape(-1, 4, 2)))
    tree = shapely.STRtree(bodies)
    found = []
    for obstacle in obstacles:
        inside = tree.query(obstacle.polygon, predicate="intersects")
        if len(inside):
            overlaps = shapely.intersection(bodies[inside], obstacle.polygon)
            within = shapely.point_on_surface(overlaps)  # corners alone would miss a wall that crosses a body from side to side
            points, owner = shapely.get_coordinates(np.concatenate([overlaps, within]), return_index=True)
            owner %= len(overlaps)
            depths = _depths(points, bodies[inside[owner]], obstacle.polygon)
            deepest = int(np.argmax(depths))
            body, distance, place = int(inside[owner[deepest]]), -float(depths[deepest]), points[deepest]
        else:
            body, points, owner = int(tree.nearest(obstacle.polygon)), np.empty((0, 2)), np.empty(0, np.intp)
            line = shapely.shortest_line(bodies[body], obstacle.polygon)
            distance, place = float(shapely.length(line)), shapely.get_coordinates(line)[0]
        pose, unit = np.divmod(np.array([body]), units)
        ahead, across = _on_bodies(drive, pose, unit, place[None])
        s = float(_along(drive, pose, unit, ahead, place[None])[0])
        lap = float(np.floor(s / drive.road.path.length)) * drive.road.path.length if drive.road.path.closed else 0.0
        met = np.divmod(inside[owner], units)
        over = _along(drive, *met, _on_bodies(drive, *met, points)[0], points) if len(points) else np.array([s])
        side, part = "left" if across[0] > 0.0 else "right", part_named(drive.vehicle.units[unit[0]], float(ahead[0]))
        span, (x, y) = (float(np.min(over)) - lap, float(np.max(over)) - lap), (float(place[0]), float(place[1]))
        found.append(Approach(obstacle, distance, s - lap, *span, x, y, int(unit[0]), side, part))
    return tuple(found)


def _depths(points: FloatArray, bodies: NDArray[np.object_], obstacle: shapely.Polygon) -> FloatArray:
    """Return how far points of overlaps lie inside the body or the obstacle, whichever is further [m]."""
    places = shapely.points(points)
    return np.maximum(shapely.distance(places, shapely.boundary(bodies)), shapely.distance(places, obstacle.boundary))


def _on_bodies(drive: Drive, poses: IntArray, units: IntArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far points in the plane, shape (n, 2), lie ahead of a body's axle and left of its middle, shape (n,) each [m]."""
    numbers, row = np.unique(poses, return_inverse=True)
    at = placed(drive, numbers)[row, units]
    x, y = points[:, 0] - at["x"], points[:, 1] - at["y"]
    return x * at["cos"] + y * at["sin"], y * at["cos"] - x * at["sin"]


def _along(drive: Drive, poses: IntArray, units: IntArray, ahead: FloatArray, points: FloatArray) -> FloatArray:
    """Return the arclengths of points (n, 2) that bodies were at; where the road bends too tightly for a foot, those of a straight."""
    near = drive.poses_s[poses] - np.asarray(axles_behind(drive.vehicle))[units] + ahead
    s, offset = project_many(drive.stations.path.curve, points[:, 0].copy(), points[:, 1].copy(), near)
    return np.where(np.isfinite(offset), s, near)
