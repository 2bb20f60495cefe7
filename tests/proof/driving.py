"""The least half width of a road for a rigid vehicle, by optimal control: any start, any curvatures up to the largest, at any rate.

Shares nothing with planning or proving but the road's projection: the rear axle drives a chain of arcs in the plane. Each step linearises
the offsets of all points of both long edges and of the front at every pose, and moves start and curvatures within a trust region by the
linear program that makes the largest offset least. What it finds is a way that fits; that no better one exists it does not say.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # its subpackages load when they are first used

from hdvplan.arrays import FloatArray
from hdvplan.road.path import ReferencePath
from hdvplan.vehicle.model import Vehicle

STEP_M = 0.5  # of the arcs, and between poses
_POINTS_M = 0.5  # of the outline
_BEYOND_M = 40.0  # of path beyond the road's ends


@dataclass(frozen=True)
class Way:
    """Position and heading at the start, then the curvature of every arc [1/m]; and the half width that it takes [m]."""

    given: FloatArray
    half_width: float


def outline(vehicle: Vehicle) -> FloatArray:
    """Return points of the outline, (n, 2): ahead of the axle and left of the middle [m]."""
    unit, half = vehicle.lead, 0.5 * vehicle.width
    ahead = np.unique(
        np.append(np.linspace(-unit.rear_overhang, unit.front, int(np.ceil((unit.front + unit.rear_overhang) / _POINTS_M)) + 1), 0.0)
    )
    return np.concatenate([np.column_stack([ahead, np.full(len(ahead), side)]) for side in (half, -half)])


def poses(given: FloatArray) -> FloatArray:
    """Return x, y, heading at the ends of all arcs, (3, n + 1)."""
    turned = given[3:] * STEP_M
    heading = given[2] + np.concatenate([[0.0], np.cumsum(turned)])
    middle, chord = heading[:-1] + 0.5 * turned, STEP_M * np.sinc(0.5 * turned / np.pi)
    x = given[0] + np.concatenate([[0.0], np.cumsum(chord * np.cos(middle))])
    y = given[1] + np.concatenate([[0.0], np.cumsum(chord * np.sin(middle))])
    return np.stack([x, y, heading])


def least(path: ReferencePath, vehicle: Vehicle, start: FloatArray, *, steps: int = 80) -> Way:
    """Return the narrowest way that a start leads to; only offsets at feet within the road count."""
    longer, body, most = path.extended(_BEYOND_M, _BEYOND_M), outline(vehicle), vehicle.max_curvature
    near = np.zeros(0)

    def offsets(given: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        nonlocal near
        x, y, heading = poses(given)[:, :, None]
        dx, dy = body[:, 0] * np.cos(heading) - body[:, 1] * np.sin(heading), body[:, 0] * np.sin(heading) + body[:, 1] * np.cos(heading)
        if not len(near):
            near = STEP_M * np.arange(len(x))[:, None] + body[:, 0]
        near, offset = longer.project(x + dx, y + dy, near)
        foot = longer.at(near)
        normal = np.stack([-np.sin(foot.heading), np.cos(foot.heading)])
        counts = (near >= 0.0) & (near <= path.length)
        return np.where(counts, offset, 0.0), normal, normal[1] * dx - normal[0] * dy

    given, trust = start, 0.01
    offset, normal, turning = offsets(given)
    worst = float(np.max(np.abs(offset)))
    for _ in range(steps):
        place = poses(given)
        # Curvature j turns all poses after it about the middle of its arc.
        n = place.shape[1]
        middle = 0.5 * (place[:2, :-1] + place[:2, 1:])
        after = np.arange(n)[:, None] > np.arange(n - 1)[None, :]
        by = np.zeros((3, n, n + 2))
        by[0, :, 0] = by[1, :, 1] = by[2, :, 2] = 1.0
        by[0, :, 2], by[1, :, 2] = -(place[1] - place[1, 0]), place[0] - place[0, 0]
        by[0, :, 3:] = np.where(after, -STEP_M * (place[1][:, None] - middle[1]), 0.0)
        by[1, :, 3:] = np.where(after, STEP_M * (place[0][:, None] - middle[0]), 0.0)
        by[2, :, 3:] = np.where(after, STEP_M, 0.0)
        pose, point = np.nonzero(np.abs(offset) > worst - 0.6)  # what is not near the limit stays so
        rows = normal[0, pose, point][:, None] * by[0, pose] + normal[1, pose, point][:, None] * by[1, pose]
        rows += turning[pose, point][:, None] * by[2, pose]
        sign = np.sign(offset[pose, point])[:, None]
        low, high = np.maximum(-trust, -most - given[3:]), np.minimum(trust, most - given[3:])
        bounds = (
            [(-20.0 * trust, 20.0 * trust)] * 2 + [(-trust, trust)] + list(zip(low.tolist(), high.tolist(), strict=True)) + [(0.0, None)]
        )
        found = scipy.optimize.linprog(
            np.append(np.zeros(len(given)), 1.0), np.hstack([sign * rows, -np.ones((len(pose), 1))]), -np.abs(offset[pose, point]),
            bounds=bounds, method="highs",
        )  # fmt: skip
        if found.x is None:
            break
        moved, kept = given + found.x[:-1], near
        moved_offset, moved_normal, moved_turning = offsets(moved)
        value = float(np.max(np.abs(moved_offset)))
        if value < worst - 1e-6:
            given, offset, normal, turning, worst, trust = moved, moved_offset, moved_normal, moved_turning, value, min(1.5 * trust, 0.03)
        else:
            near, trust = kept, 0.4 * trust
        if trust < 1e-5:
            break
    return Way(given, worst)
