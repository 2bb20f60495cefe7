"""How far kerbs lie from a road's path, along its normals: for pictures, tables and forecasts. Neither plans nor judgements use it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from hdvplan.arrays import FloatArray
from hdvplan.road.limits import Limits
from hdvplan.road.path import PathPoint, ReferencePath
from hdvplan.road.regions import OPEN_M
from hdvplan.road.street import Kerb

_SPACING_M = 0.1  # of the normals: between two of them a kerb is taken as straight
_BESIDE_M, _WITHIN_M = 1e-6, 1e-3  # that a face is longer than its points, for rounding; from its ends, where walls begin
_FOLD = 0.9  # of the radius of curvature: normals must not reach the centre, where they meet


def limits_beside(path: ReferencePath, kerbs: tuple[Kerb, ...]) -> Limits:
    """Return how far kerbs lie from a path, along its normals."""
    reaches = {}
    for wheels in (False, True):
        own = [kerb for kerb in kerbs if kerb.wheels is wheels]
        if own:
            s, reaches[wheels] = edge_reaches(path, own)
    left, right = reaches[False]
    inner = reaches.get(True, reaches[False])
    return Limits(s, inner[0], -inner[1], np.maximum(left, inner[0]), -np.maximum(right, inner[1]))


def narrowed(path: ReferencePath, limits: Limits, faces: Sequence[Kerb]) -> Limits:
    """Return limits beside a path as the faces of regions narrow them: those of obstacles all of them, others those of wheels."""
    if not faces:
        return limits
    ends = np.array([(np.min(face.s), np.max(face.s)) for face in faces])
    jumps = ends[:, None] + np.array([(-_BESIDE_M, _BESIDE_M), (_WITHIN_M, -_WITHIN_M)])
    s = np.unique(np.concatenate([limits.s, np.clip(jumps.ravel(), 0.0, path.length)]))
    table = limits.table(s)
    for face, (begin, end) in zip(faces, ends, strict=True):
        near = np.flatnonzero((s >= begin - _BESIDE_M) & (s <= end + _BESIDE_M))
        met = offsets_of(path, face, s[near])
        seen = np.isfinite(met) & (s[near] >= begin + _WITHIN_M) & (s[near] <= end - _WITHIN_M)
        if np.any(seen):
            met = np.interp(s[near], s[near][seen], met[seen])
            for row in range(0 if face.left else 1, 2 if face.wheels else 4, 2):
                table[row, near] = np.minimum(table[row, near], met) if face.left else np.maximum(table[row, near], met)
    return Limits(s, *table)


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
    centre, normal = _normals(here)
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


def _normals(here: PathPoint) -> tuple[FloatArray, FloatArray]:
    """Return where normals stand, and their directions to the left, shape (n, 2) each."""
    return np.stack([here.x, here.y], axis=1), np.stack([-np.sin(here.heading), np.cos(here.heading)], axis=1)


def _places(path: ReferencePath) -> FloatArray:
    """Return the arclengths of the normals: on a part of a road that begins at a multiple of their spacing the same ones [m]."""
    return np.append(np.arange(0.0, path.length - 0.5 * _SPACING_M, _SPACING_M), path.length)


def _furthest(curvature: FloatArray) -> FloatArray:
    return np.minimum(OPEN_M, _FOLD / np.maximum(curvature, 1e-9))


def offsets_of(path: ReferencePath, face: Kerb, s: FloatArray) -> FloatArray:
    """Return where the normals at arclengths ``s`` meet a face first, from the side that is driven on; NaN where they do not [m]."""
    here = path.at(s)
    centre, normal = _normals(here)
    left, right = _furthest(here.curvature), _furthest(-here.curvature)
    ends = np.stack([centre + left[:, None] * normal, centre - right[:, None] * normal], axis=1)
    points, owner = shapely.get_coordinates(
        shapely.intersection(np.asarray(shapely.linestrings(ends)), shapely.LineString(face.points)), return_index=True
    )
    offset = np.sum((points - centre[owner]) * normal[owner], axis=1)
    found = np.full(len(s), np.nan)
    (np.fmin if face.left else np.fmax).at(found, owner, offset)
    return found
