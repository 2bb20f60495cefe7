"""The tube of a plan: what bodies sweep at most while the driver errs as much as is allowed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import BoolArray
from hdvplan.judging.bodies import united
from hdvplan.judging.result import Result
from hdvplan.judging.straying import SPACING_M, Posed, chain_of
from hdvplan.judging.tracked import BRUSH, Tracked

_TEETH_M = 0.3  # between the outlines of two poses: filled, which shows no less than the bound


def tubes_of(result: Result, stretches: Sequence[tuple[float, float]]) -> list[BaseGeometry]:
    """Return what bodies sweep at most with the largest tracking error, in the plane, for each stretch; nothing where the plan allows none.

    The lead axle is between the two arclengths of a stretch then [m]. Each corner of a body is moved to either side as far as the bound
    lets it.
    """
    tracking = result.tracking
    if tracking is None or not tracking.error > 0.0:
        return []
    chain = chain_of(result.drive)
    tracked = Tracked(chain.vehicle.table(), chain.links, tracking.length)
    s, poses, front = chain.posed
    within: list[BoolArray] = [(s >= s_from) & (s <= s_to) for s_from, s_to in stretches]
    shown = np.flatnonzero(np.any(within, axis=0))  # at fewer poses, what front corners sweep has teeth
    tracked.bounded(tracking.error)
    tracked.follow(front[shown])
    outlines = _outlines(tracked, Posed(s[shown], poses[shown], front[shown]))
    return [united(outlines[one[shown]]).buffer(_TEETH_M).buffer(-_TEETH_M) for one in within]


def _outlines(tracked: Tracked, posed: Posed) -> NDArray[np.object_]:
    """Return the outlines of all bodies at some poses, with what they may stray, (poses, units)."""
    error = float(tracked.record["error"][0])
    found: list[NDArray[np.object_]] = []
    off = tracked.links["axle_off"][np.minimum((posed.front / SPACING_M).astype(int), len(tracked.links) - 1)]
    for number, unit in enumerate(tracked.units):
        pose, corners = posed.poses[:, number], []
        for ahead, side in ((unit["front"], 1.0), (unit["front"], -1.0), (-unit["rear_overhang"], -1.0), (-unit["rear_overhang"], 1.0)):
            brushes = np.zeros(len(pose), BRUSH)
            brushes["at"], brushes["by_axle"], brushes["by_heading"] = posed.front, side * np.cos(off[:, number]), side * ahead
            brushes["second"], brushes["unit"] = unit["half_width"], number
            gain, remainder = tracked.approaches(brushes)
            left = side * (unit["half_width"] + error * gain + remainder)
            corners.append([pose["x"] + ahead * pose["cos"] - left * pose["sin"], pose["y"] + ahead * pose["sin"] + left * pose["cos"]])
        found.append(np.atleast_1d(np.asarray(shapely.polygons(np.moveaxis(np.array(corners), -1, 0)))))
    return np.stack(found, axis=1)
