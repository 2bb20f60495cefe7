"""Limits from drawn edges: how far the lines beside a road lie from its reference path, along its normals."""

from __future__ import annotations

import numpy as np
import shapely

from hdvplan.jit import BoolArray, FloatArray
from hdvplan.road.path import ReferencePath
from hdvplan.road.regions import OPEN_M

_SPACING_M = 0.1  # of the normals: between two of them an edge is taken as straight
_FOLD = 0.9  # of the radius of curvature: normals must not reach the centre, where they meet
_GAP_M = 0.5  # ends of two lines this close are one edge


def edge_reaches(path: ReferencePath, edges: tuple[FloatArray, ...]) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    """Return arclengths [m], the reaches there, shape (4, n), and notes: how far ``path`` may be left on either side.

    Each normal ends at the first edge that it meets, whichever its name. Where none is met within ``OPEN_M``, the value
    before or behind holds, linear between; a note says where. Rows: left, right, left_sweep, right_sweep, positive [m].
    """
    s = np.linspace(0.0, path.length, int(np.ceil(path.length / _SPACING_M)) + 1)
    here = path.at(s)
    lines = shapely.MultiLineString([shapely.LineString(edge) for edge in edges])
    shapely.prepare(lines)
    centre = np.stack([here.x, here.y], axis=1)
    normal = np.stack([-np.sin(here.heading), np.cos(here.heading)], axis=1)
    reaches, notes = [], []
    for sign, side in ((1.0, "left"), (-1.0, "right")):
        far = np.minimum(OPEN_M, _FOLD / np.maximum(sign * here.curvature, 1e-9))
        rays = shapely.linestrings(np.stack([centre, centre + sign * far[:, None] * normal], axis=1))
        met = shapely.intersection(rays, lines)
        reach = np.where(shapely.is_empty(met), np.nan, shapely.distance(shapely.points(centre), met))
        seen = np.isfinite(reach)
        notes += _gaps(s, seen, side)
        reaches.append(np.interp(s, s[seen], reach[seen]) if np.any(seen) else far)
    return s, np.stack([*reaches, *reaches]), tuple(notes)


def _gaps(s: FloatArray, seen: BoolArray, side: str) -> list[str]:
    """Return notes on the stretches without an edge."""
    if not np.any(seen):
        return [f"no edge on the {side}: it is open to {OPEN_M:g} m"]
    ends = np.flatnonzero(np.diff(np.concatenate([[False], ~seen, [False]]).astype(int)))
    stretches = [(float(s[first]), float(s[last - 1])) for first, last in ends.reshape(-1, 2)]
    return [f"no edge on the {side} from s = {lo:.1f} to {hi:.1f} m: its neighbours hold" for lo, hi in stretches if hi - lo > _GAP_M]
