"""How far kerbs lie from a road's path, along its normals: for pictures, tables and forecasts. Neither plans nor judgements use it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from hdvplan.arrays import FloatArray
from hdvplan.road.path import ReferencePath
from hdvplan.road.regions import OPEN_M
from hdvplan.road.street import Kerb

_SPACING_M = 0.1  # of the normals: between two of them a kerb is taken as straight
_FOLD = 0.9  # of the radius of curvature: normals must not reach the centre, where they meet


def edge_reaches(path: ReferencePath, kerbs: Sequence[Kerb]) -> tuple[FloatArray, FloatArray]:
    """Return arclengths [m] and how far ``path`` may be left there before a kerb, to the left and to the right, shape (2, n) [m].

    Each normal ends at the first kerb that it meets: names of sides do not count, only where kerbs lie, and the arclengths beside
    them, which tell those of another arm of the road. Where none is met within ``OPEN_M``, the road is open so far.
    """
    s = _places(path)
    here = path.at(s)
    segments = np.asarray(shapely.linestrings(np.concatenate([np.stack([one.points[:-1], one.points[1:]], axis=1) for one in kerbs])))
    ends = np.concatenate([np.stack([one.s[:-1], one.s[1:]], axis=1) for one in kerbs])
    middle, half = np.mean(ends, axis=1), 0.5 * np.ptp(ends, axis=1)
    tree = shapely.STRtree(segments)
    centre = np.stack([here.x, here.y], axis=1)
    normal = np.stack([-np.sin(here.heading), np.cos(here.heading)], axis=1)
    reaches = []
    for sign in (1.0, -1.0):
        far = _furthest(sign * here.curvature)
        rays = np.asarray(shapely.linestrings(np.stack([centre, centre + sign * far[:, None] * normal], axis=1)))
        ray, segment = tree.query(rays, predicate="intersects")
        apart = np.abs(s[ray] - middle[segment])
        apart = np.minimum(apart, path.length - apart) if path.closed else apart
        ray, segment = (found[apart <= half[segment] + OPEN_M] for found in (ray, segment))
        met = shapely.intersection(rays[ray], segments[segment])
        reach = np.full(len(s), np.inf)
        np.minimum.at(reach, ray, shapely.distance(shapely.points(centre[ray]), met))
        seen = np.isfinite(reach)
        reaches.append(np.interp(s, s[seen], reach[seen]) if np.any(seen) else far)
    return s, np.stack(reaches)


def _places(path: ReferencePath) -> FloatArray:
    """Return the arclengths of the normals: on a part of a road that begins at a multiple of their spacing the same ones [m]."""
    return np.append(np.arange(0.0, path.length - 0.5 * _SPACING_M, _SPACING_M), path.length)


def _furthest(curvature: FloatArray) -> FloatArray:
    return np.minimum(OPEN_M, _FOLD / np.maximum(curvature, 1e-9))


def offsets_of(path: ReferencePath, face: Kerb, s: FloatArray) -> FloatArray:
    """Return where the normals at arclengths ``s`` meet a face first, from the side that is driven on; NaN where they do not [m]."""
    here = path.at(s)
    centre = np.stack([here.x, here.y], axis=1)
    normal = np.stack([-np.sin(here.heading), np.cos(here.heading)], axis=1)
    left, right = _furthest(here.curvature), _furthest(-here.curvature)
    ends = np.stack([centre + left[:, None] * normal, centre - right[:, None] * normal], axis=1)
    points, owner = shapely.get_coordinates(
        shapely.intersection(np.asarray(shapely.linestrings(ends)), shapely.LineString(face.points)), return_index=True
    )
    offset = np.sum((points - centre[owner]) * normal[owner], axis=1)
    found = np.full(len(s), np.nan)
    (np.fmin if face.left else np.fmax).at(found, owner, offset)
    return found
