"""How near the driven bodies came to every obstacle, in the plane: a judge that knows nothing of limits along s."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from hdvplan.driving.drive import Drive
from hdvplan.judging.bodies import corners
from hdvplan.road.regions import Kind, Region


@dataclass(frozen=True)
class Approach:
    """Where a drive came nearest to an obstacle."""

    obstacle: Region
    distance: float  # least distance of any body; negative: how deep one was inside [m]
    s: float  # of the lead rear axle then [m]
    unit: int


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
        depths = [_depth(bodies[body], obstacle.polygon) for body in inside]
        nearest = int(inside[np.argmax(depths)]) if depths else int(tree.nearest(obstacle.polygon))
        distance = -max(depths) if depths else float(shapely.distance(bodies[nearest], obstacle.polygon))
        found.append(Approach(obstacle, distance, float(drive.poses_s[nearest // units]), nearest % units))
    return tuple(found)


def _depth(body: shapely.Polygon, obstacle: shapely.Polygon) -> float:
    """Return how far a corner of either outline lies inside the other [m]: corners of the overlap lie on one of the two."""
    points = shapely.points(shapely.get_coordinates(shapely.intersection(body, obstacle)))
    return float(max(np.max(shapely.distance(points, outline.boundary)) for outline in (body, obstacle)))
