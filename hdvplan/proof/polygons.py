"""Convex polygons with edges in fixed directions, held by their supports: all points q have d . q <= h for every direction d."""

from __future__ import annotations

import numpy as np

from hdvplan.jit import FloatArray, compiled

SIDES = 16
ROUNDING = 1e-9


@compiled
def box(directions: FloatArray, e_low: float, e_high: float, w_low: float, w_high: float, h: FloatArray) -> None:
    """Write the supports of a rectangle."""
    for d in range(SIDES):
        x, y = directions[d, 0], directions[d, 1]
        h[d] = max(x * e_low, x * e_high) + max(y * w_low, y * w_high)


@compiled
def support(directions: FloatArray, h: FloatArray, x: float, y: float) -> float:
    """Return a bound of (x, y) . q over a polygon: from the supports of the two directions between which (x, y) lies."""
    turn = np.arctan2(y, x) * SIDES / (2.0 * np.pi)
    a = int(np.floor(turn))
    share_a, share_b = a % SIDES, (a + 1) % SIDES
    ax, ay, bx, by = directions[share_a, 0], directions[share_a, 1], directions[share_b, 0], directions[share_b, 1]
    cross = ax * by - ay * bx
    of_a, of_b = max((x * by - y * bx) / cross, 0.0), max((ax * y - ay * x) / cross, 0.0)
    return float(of_a * h[share_a] + of_b * h[share_b])


@compiled
def tight(directions: FloatArray, h: FloatArray) -> bool:
    """Bring every support down to what the others leave of the polygon; return False where nothing is left."""
    half, quarter = SIDES // 2, SIDES // 4
    corners, other = np.empty((2 * SIDES + 4, 2)), np.empty((2 * SIDES + 4, 2))
    if h[0] < -h[half] or h[quarter] < -h[half + quarter]:
        return False
    corners[0, 0], corners[0, 1] = h[0], h[quarter]
    corners[1, 0], corners[1, 1] = -h[half], h[quarter]
    corners[2, 0], corners[2, 1] = -h[half], -h[half + quarter]
    corners[3, 0], corners[3, 1] = h[0], -h[half + quarter]
    number = 4
    for d in range(SIDES):
        if d % quarter == 0:
            continue
        kept = 0
        x, y = directions[d, 0], directions[d, 1]
        former = x * corners[number - 1, 0] + y * corners[number - 1, 1] - h[d]
        for c in range(number):
            now = x * corners[c, 0] + y * corners[c, 1] - h[d]
            if (former > 0.0) != (now > 0.0):
                p = c - 1 if c > 0 else number - 1
                share = former / (former - now)
                other[kept, 0] = corners[p, 0] + share * (corners[c, 0] - corners[p, 0])
                other[kept, 1] = corners[p, 1] + share * (corners[c, 1] - corners[p, 1])
                kept += 1
            if now <= 0.0:
                other[kept, 0], other[kept, 1] = corners[c, 0], corners[c, 1]
                kept += 1
            former = now
        if kept == 0:
            return False
        corners, other, number = other, corners, kept
    for d in range(SIDES):
        most = -np.inf
        for c in range(number):
            most = max(most, directions[d, 0] * corners[c, 0] + directions[d, 1] * corners[c, 1])
        h[d] = min(h[d], most + ROUNDING)
    return True
