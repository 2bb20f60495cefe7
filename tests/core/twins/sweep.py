"""The swept envelope, see ``core/sweep.c``: every foot is searched to the end."""

import numpy as np

from hdvplan.arrays import FloatArray, Records
from hdvplan.road.path import ReferencePath
from tests.core.twins.kinematics import places
from tests.core.twins.path import evaluate, project


def feet(units: Records, outlines: FloatArray, path: ReferencePath, s: FloatArray, z: FloatArray) -> FloatArray:
    """Return arclength and offset of every point of every outline at every pose, shape (poses, units, points, 2)."""
    found = np.empty((len(s), *outlines.shape))
    for i, at in enumerate(s):
        for unit, (x, y, cos, sin) in enumerate(places(units, evaluate(path, at)[:4], z[i])):
            near = at - sum(units["hitch_offset"][:unit]) - sum(units["wheelbase"][1 : unit + 1]) + outlines[unit, 0, 0]
            for point, (ahead, left) in enumerate(outlines[unit]):
                here = project(path, x + ahead * cos - left * sin, y + ahead * sin + left * cos, near)
                found[i, unit, point] = here[:2]
                near = here[0]
    return found


def cover(begin: FloatArray, end: FloatArray, stations: FloatArray, low: FloatArray, high: FloatArray) -> None:
    """Widen an envelope at ``stations`` by a straight piece in the (s, offset) plane."""
    (s_low, e_low), (s_high, e_high) = sorted([tuple(begin), tuple(end)])
    rounding = 1e-6 * (stations[1] - stations[0])
    for j in np.flatnonzero((stations >= s_low - rounding) & (stations <= s_high + rounding)):
        part = np.clip((stations[j] - s_low) / (s_high - s_low), 0.0, 1.0) if s_high > s_low else 0.0
        offset = e_low + part * (e_high - e_low)
        low[j], high[j] = min(low[j], offset), max(high[j], offset if s_high > s_low else e_high)


def sweep(
    units: Records, outlines: FloatArray, path: ReferencePath, s: FloatArray, z: FloatArray, stations: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return lowest and highest offset per unit and station, infinite where never."""
    low, high = np.full((len(units), len(stations)), np.inf), np.full((len(units), len(stations)), -np.inf)
    found = feet(units, outlines, path, s, z)
    for i, unit, point in np.ndindex(found.shape[:3]):
        here = found[i, unit, point]
        if point > 0:
            cover(found[i, unit, point - 1], here, stations, low[unit], high[unit])
        if i > 0:
            cover(found[i - 1, unit, point], here, stations, low[unit], high[unit])
    return low, high
