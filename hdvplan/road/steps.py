"""Points that lie impossibly far from their neighbours: wrong coordinates, or ones that lost their digits."""

from __future__ import annotations

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError

_RATIO = 1000.0  # of a step to the median of those around it
_SHORTEST_M = 1000.0  # a long straight may well have one step of hundreds of metres between dense bends
_SAME_M = 0.02  # points this close repeat their neighbour
_AROUND = 3  # steps looked at before and after
SPARSE_M = 1000.0  # between the points of a long line, on average: a small file makes no road of a thousand kilometres
MIN_LENGTH_M = 5.0  # of a road
LARGEST_M = 1e8  # beyond it a double's rounding of a position shows in the curvature


def refuse_far(points: FloatArray, name: str) -> None:
    """Refuse points, shape (n, 2) [m], that lie where no map does, or nowhere.

    Raises:
        RoadError: such a point.

    """
    far = np.flatnonzero(~np.all(np.abs(points) <= LARGEST_M, axis=1))
    if far.size:
        x, y = points[far[0]]
        msg = f"{name}: point {far[0] + 1}, at {x:g}, {y:g} m, is too far out for a position"
        raise RoadError(msg, hint="are its coordinates metres? --unit names another unit of a file without a coordinate reference system")


def refuse_outliers(points: FloatArray, lines: tuple[int, ...] | None, name: str) -> None:
    """Refuse a line, shape (n, 2) [m], one of whose steps is thousands of times as long as those around it.

    ``lines`` are the lines of the points in their file, without which the message counts points.

    Raises:
        RoadError: such a step; says between which points.

    """
    steps = np.hypot(*np.diff(points, axis=0).T)
    for at in np.flatnonzero(steps > _SHORTEST_M).tolist():
        around = np.concatenate([steps[max(0, at - _AROUND) : at], steps[at + 1 : at + 1 + _AROUND]])
        around = around[around > _SAME_M]
        usual = float(np.sort(around)[(len(around) - 1) // 2]) if len(around) else np.inf  # the lower median
        if steps[at] > _RATIO * usual:
            first, second = (at + 1, at + 2) if lines is None else (lines[at], lines[at + 1])
            what = "points" if lines is None else "lines"
            msg = (
                f"{name}: {what} {first} and {second} are {steps[at] / 1e3:.3g} km apart,"
                f" {steps[at] / usual:.0f} times the steps around them"
            )
            raise RoadError(msg, hint="correct or remove the point that is wrong; on a long straight, add points between")


def refuse_sparse(points: FloatArray, name: str, long: float) -> None:
    """Refuse a line, shape (n, 2) [m], longer than ``long`` with fewer than one point a kilometre: it would lead straight across a country.

    Raises:
        RoadError: such a line.

    """
    length = float(np.sum(np.hypot(*np.diff(points, axis=0).T)))
    if length > max(long, SPARSE_M * len(points)):
        msg = f"{name}: the line is {length / 1e3:.0f} km long, but has only {len(points)} points"
        raise RoadError(msg, hint=f"a line of more than {long / 1e3:.0f} km needs one a kilometre; are its coordinates right?")
