"""A recorded track as a line: smoothed over the time that its points tell, and without what was written while the recorder stood."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy  # its subpackages load when they are first used
import shapely
from numpy.typing import NDArray

from hdvplan.arrays import FloatArray
from hdvplan.texts import counted

_FEWEST = 5  # points of a smoothing spline
_APART_M = 2.0  # at least, from a smoothed point to the next: nearer ones turn by chance
_TOLD_M = 0.02  # of scatter: less is rounding
_STOP_M = 5.0  # from where a recorder begins to stand, within which its points scatter
_SCATTER_M = 2.0  # of a point that it writes, at most


def tracks_of(
    numbers: NDArray[np.int64], columns: Mapping[str, NDArray[Any]], shapes: NDArray[np.object_]
) -> tuple[list[Any], list[FloatArray | None]]:
    """Return the tracks of a GPX file with these ``numbers`` from its points, and when these were recorded [s], None where it is not said.

    Segments of one point are left out: they are no lines. None stands for a track without others.
    """
    track, times = columns["track_fid"], (columns["time"] - columns["time"][:1]) / np.timedelta64(1, "s")
    points = shapely.get_coordinates(shapely.from_wkb(shapes))
    _, rows, counts = np.unique(np.column_stack([track, columns["track_seg_id"]]), axis=0, return_inverse=True, return_counts=True)
    geometries, recorded = list[Any](), list[FloatArray | None]()
    for one in numbers:
        own = (track == one) & (counts[rows] > 1)
        geometries.append(shapely.MultiLineString([points[own & (rows == at)] for at in np.unique(rows[own])]) if np.any(own) else None)
        recorded.append(times[own] if np.any(own) and np.all(np.isfinite(times[own])) else None)
    return geometries, recorded


def smoothed_in_time(points: FloatArray, times: FloatArray, name: str) -> tuple[FloatArray, tuple[str, ...]]:
    """Return a track, shape (n, 2) [m], by the cubic smoothing splines over ``times`` (n,) [s], and a note on how far its points scatter.

    Cross-validation says how smooth (Craven and Wahba 1979). Where times go back it stays as it is.
    """
    if np.any(np.diff(times) < 0.0):
        return points, ()
    times, own = np.unique(times, return_index=True)  # of points at one time the first
    if len(times) < _FEWEST:
        return points, ()
    smooth = np.column_stack([scipy.interpolate.make_smoothing_spline(times, column)(times) for column in points[own].T])
    moved = np.hypot(*(smooth - points[own]).T)
    kept = [0]
    for at, point in enumerate(smooth.tolist()):
        if math.dist(point, smooth[kept[-1]]) >= _APART_M:
            kept.append(at)
    scatter = float(np.sqrt(np.mean(moved**2)))
    if scatter < _TOLD_M:
        return smooth[kept], ()
    told = f"the track is smoothed over its times; its points scatter by {scatter:.2f} m (rms), up to {np.max(moved):.1f} m"
    return smooth[kept], (f"{name}: {told}: no answer is better than that",)


def without_stops(points: FloatArray, name: str) -> tuple[FloatArray, tuple[str, ...]]:
    """Return a recorded track, shape (n, 2) [m], with one point for each place where it stood and went to and fro, and a note on these."""
    left = points[np.append(True, np.any(np.diff(points, axis=0) != 0.0, axis=1))]
    distinct, widest = len(left), 0.0
    while (stop := _stop(left)) is not None:
        first, last = stop
        middle = np.mean(left[first : last + 1], axis=0)
        widest = max(widest, float(np.max(np.hypot(*(left[first : last + 1] - middle).T))))
        left = np.concatenate([left[:first], [middle], left[last + 1 :]])
    if len(left) == distinct:
        return points, ()
    what = counted(distinct - len(left), "point")
    return left, (f"{name}: {what} where the recorder stood left out; they scatter by up to {widest:.1f} m",)


def _stop(points: FloatArray) -> tuple[int, int] | None:
    """Return the first and the last point of a place where a track, shape (n, 2) [m], turns back at least twice; None without any."""
    steps = np.diff(points, axis=0)
    back = 1 + np.flatnonzero(np.sum(steps[1:] * steps[:-1], axis=1) < 0.0)
    for at, first in enumerate(back.tolist()):
        apart = np.hypot(*(points[first:] - points[first]).T)
        stays = int(np.argmax(apart > _STOP_M)) if apart.max() > _STOP_M else len(apart)
        last = int(back[at:][back[at:] < first + stays][-1])
        if last > first:
            middle = np.mean(points[first : last + 1], axis=0)
            apart = np.hypot(*(points - middle).T)
            near = apart <= max(_SCATTER_M, float(np.max(apart[first : last + 1])))
            return first - int(np.argmin(near[:first][::-1])), last + int(np.argmin(near[last + 1 :]))
    return None
