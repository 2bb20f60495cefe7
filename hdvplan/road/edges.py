"""Limits from edges: how far the lines beside a road lie from its reference path, along its normals."""

from __future__ import annotations

import numpy as np
import shapely

from hdvplan.arrays import BoolArray, FloatArray
from hdvplan.road.path import ReferencePath
from hdvplan.road.regions import OPEN_M

_SPACING_M = 0.1  # of the normals: between two of them an edge is taken as straight
_FOLD = 0.9  # of the radius of curvature: normals must not reach the centre, where they meet
_GAP_M = 0.5  # ends of two lines this close are one edge
_BEYOND_M = 5.0  # the ends of the path, for the feet of points there


def edge_reaches(path: ReferencePath, edges: tuple[FloatArray, ...]) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    """Return arclengths [m], the reaches there, shape (4, n), and notes: how far ``path`` may be left before an edge.

    Each normal ends at the first edge that it meets: names of edges do not count, only where they lie. Where none is met
    within ``OPEN_M``, the values around hold, linear between; a note says where. Rows: left, right, left_sweep, right_sweep,
    positive [m].
    """
    s = np.linspace(0.0, path.length, int(np.ceil(path.length / _SPACING_M)) + 1)
    here = path.at(s)
    segments = np.asarray(shapely.linestrings(np.concatenate([np.stack([edge[:-1], edge[1:]], axis=1) for edge in edges])))
    tree = shapely.STRtree(segments)
    centre = np.stack([here.x, here.y], axis=1)
    normal = np.stack([-np.sin(here.heading), np.cos(here.heading)], axis=1)
    reaches, notes = [], []
    for sign, side in ((1.0, "left"), (-1.0, "right")):
        far = np.minimum(OPEN_M, _FOLD / np.maximum(sign * here.curvature, 1e-9))
        rays = np.asarray(shapely.linestrings(np.stack([centre, centre + sign * far[:, None] * normal], axis=1)))
        ray, segment = tree.query(rays, predicate="intersects")
        met = shapely.intersection(rays[ray], segments[segment])
        reach = np.full(len(s), np.inf)
        np.minimum.at(reach, ray, shapely.distance(shapely.points(centre[ray]), met))
        seen = np.isfinite(reach)
        notes += _gaps(s, seen, side)
        reaches.append(np.interp(s, s[seen], reach[seen]) if np.any(seen) else far)
    return s, np.stack([*reaches, *reaches]), tuple(notes)


def side_reaches(path: ReferencePath, s: FloatArray, sides: FloatArray) -> FloatArray:
    """Return the reaches at arclengths ``s`` [m], shape (4, n), between edges given point by point, shape (2, n, 2) [m].

    ``sides[0, i]`` lies left of the path near ``s[i]``, ``sides[1, i]`` right of it. Rows: left, right, left_sweep,
    right_sweep, positive [m].

    Raises:
        ProjectionError: an edge lies beyond the path's centre of curvature.

    """
    longer = path.extended(_BEYOND_M, _BEYOND_M)
    reaches = []
    for sign, points in zip((1.0, -1.0), sides, strict=True):
        feet, offsets = longer.project(points[:, 0], points[:, 1], s)
        order = np.argsort(feet, kind="stable")
        reaches.append(np.maximum(np.interp(s, feet[order], sign * offsets[order]), 0.0))
    return np.stack([*reaches, *reaches])


def _gaps(s: FloatArray, seen: BoolArray, side: str) -> list[str]:
    """Return notes on the stretches without an edge."""
    if not np.any(seen):
        return [f"no edge on the {side}: it is open to {OPEN_M:g} m"]
    ends = np.flatnonzero(np.diff(np.concatenate([[False], ~seen, [False]]).astype(int)))
    stretches = [(float(s[first]), float(s[last - 1])) for first, last in ends.reshape(-1, 2)]
    return [f"no edge on the {side} from s = {lo:.1f} to {hi:.1f} m: the values around hold" for lo, hi in stretches if hi - lo > _GAP_M]
