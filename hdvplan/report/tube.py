"""The tube of a plan: what bodies sweep at most while the driver errs as much as is allowed."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hdvplan.judging.result import Result
from hdvplan.judging.straying import SPACING_M, chain_of
from hdvplan.judging.tracking import BRUSH, Tracked


def tube_of(result: Result, s_from: float, s_to: float) -> BaseGeometry | None:
    """Return what bodies sweep at most with the largest tracking error, in the plane; None where the plan allows none.

    The lead axle is between two arclengths then. Each corner of a body is moved to either side as far as the bound lets it.
    """
    tracking = result.tracking
    if tracking is None or not tracking.error > 0.0:
        return None
    chain = chain_of(result.drive)
    tracked = Tracked(chain.vehicle.table(), chain.links, tracking.length)
    tracked.err(tracking.error)
    s, all_poses, all_front = chain.posed
    near = np.flatnonzero((s >= s_from) & (s <= s_to))  # at fewer poses, what front corners sweep has teeth
    poses, front = all_poses[near], all_front[near]
    off = chain.links["axle_off"][np.minimum((front / SPACING_M).astype(int), len(chain.links) - 1)]
    parts: list[NDArray[np.object_]] = []
    for number, unit in enumerate(chain.vehicle.units):
        pose, corners = poses[:, number], []
        for ahead, side in ((unit.front, 1.0), (unit.front, -1.0), (-unit.rear_overhang, -1.0), (-unit.rear_overhang, 1.0)):
            brushes = np.zeros(len(pose), BRUSH)
            brushes["at"], brushes["by_axle"], brushes["by_heading"] = front, side * np.cos(off[:, number]), side * ahead
            brushes["second"], brushes["unit"] = 0.5 * unit.width, number
            gain, remainder = tracked.approaches(brushes)
            left = side * (0.5 * unit.width + tracking.error * gain + remainder)
            corners.append([pose["x"] + ahead * pose["cos"] - left * pose["sin"], pose["y"] + ahead * pose["sin"] + left * pose["cos"]])
        parts.append(np.atleast_1d(np.asarray(shapely.polygons(np.moveaxis(np.array(corners), -1, 0)))))
    tube: BaseGeometry = shapely.union_all(np.concatenate(parts))
    return tube
