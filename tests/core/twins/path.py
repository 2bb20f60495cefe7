"""Points and feet of a path, see ``core/path.h``."""

from typing import Any, TypeAlias

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.road.path import LAST_STEP_M, ReferencePath

PLANNING_STEP_M = 1e-3  # as path.h
Record: TypeAlias = Any  # one element of a structured array: NumPy's types know no columns


def evaluate(path: ReferencePath, s: float) -> FloatArray:
    """Return x, y, cos(psi), sin(psi), curvature at arclength ``s``, with the true length of the tangent."""
    index = int(np.clip((s - path.s_first) / path.spacing, 0, len(path.coefficients) - 1))
    u = s - path.s_first - index * path.spacing
    rows, order = path.coefficients[index].reshape(2, 6), np.arange(6)
    x, y = rows @ u**order
    dx, dy = rows[:, 1:] @ (order[1:] * u ** order[:-1])
    ddx, ddy = rows[:, 2:] @ (order[2:] * order[1:-1] * u ** order[:-2])
    length = np.hypot(dx, dy)
    return np.array([x, y, dx / length, dy / length, (dx * ddy - dy * ddx) / length**3])


def project(path: ReferencePath, x: float, y: float, near: float, last_step: float = LAST_STEP_M) -> FloatArray:
    """Return s, offset, cos(psi), sin(psi), curvature at the foot of a point; the offset is NaN without one within 15 m."""
    s = near
    for _ in range(30):
        px, py, cos, sin, curvature = evaluate(path, s)
        ahead, offset = (x - px) * cos + (y - py) * sin, (y - py) * cos - (x - px) * sin
        slope = 1.0 - curvature * offset
        step = np.clip(ahead / (slope if slope >= 0.05 else 1.0), -5.0, 5.0)
        s += step
        if abs(s - near) > 15.0 or not path.s_first - 1e-9 <= s <= path.s_last + 1e-9:
            break
        if abs(step) < last_step:
            if slope <= 0.0:
                break
            turn = curvature * step
            return np.array([s, offset - 0.5 * ahead * turn, cos - sin * turn, sin + cos * turn, curvature])
    return np.array([s, np.nan, 1.0, 0.0, 0.0])
