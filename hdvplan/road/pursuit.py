"""A drive along a line that turns more tightly than may be driven: towards a point of it ahead, as far as the steering turns."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from hdvplan.arrays import FloatArray, chord_of

_STEP_M = 0.5
_AHEAD = 0.8  # of the tightest radius, along the line, lies the point that is driven to
_LEAST = 0.1  # of a step, that a drive comes on along the line: so it does not go round a point for ever
_MOST = 2.0  # steps that it comes on: the line may come by again
_BLEND_M = 40.0  # before its end, over which a drive is moved to the end of the line


def pursued(points: FloatArray, curvature: float) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the points of drives (m, 2) [m] along an open line of ``points`` (n, 2) [m], and how far along the line each is (m,) [m].

    A drive swings out behind a hairpin. So the first is the mean of one from either end, which swings out half as far before and behind
    it, and is the same line from either end. It may be too tight where hairpins follow each other closely. The other one drives from the
    start. Each ends where the line does.
    """
    there, back = _drive(points, curvature), _drive(points[::-1], curvature)[::-1]
    back[:, 2] = chord_of(points)[-1] - back[:, 2]
    share = np.linspace(0.0, 1.0, max(len(there), len(back)))
    mean = 0.5 * (_on(there, np.linspace(0.0, 1.0, len(there)), share) + _on(back, np.linspace(0.0, 1.0, len(back)), share))
    for drive in (mean, there):
        yield drive[:, :2], drive[:, 2]


def _drive(points: FloatArray, curvature: float) -> FloatArray:
    """Return the points of a drive from an open line's start, and how far along the line each is, (m, 3) [m].

    It turns with at most ``curvature`` [1/m], but for its last metres, over which it is moved to the end of the line.
    """
    along, ahead = chord_of(points), _AHEAD / curvature
    beyond = points[-1] + 2.0 * ahead * (points[-1] - points[-2]) / np.hypot(*(points[-1] - points[-2]))
    longer, s = np.vstack([points, beyond]), np.append(along, along[-1] + 2.0 * ahead)
    steps = _STEP_M * np.linspace(_LEAST, _MOST, 20)
    place, heading, at = points[0], math.atan2(*(points[1] - points[0])[::-1]), 0.0
    driven, passed = [place], [at]
    while at < along[-1]:
        to = _on(longer, s, at + ahead) - place
        turn = math.remainder(math.atan2(to[1], to[0]) - heading, 2.0 * math.pi)
        bend = 2.0 * math.sin(turn) / max(math.hypot(*to), _STEP_M) if abs(turn) < 0.5 * math.pi else math.copysign(curvature, turn)
        bend = min(max(bend, -curvature), curvature)
        middle = heading + 0.5 * _STEP_M * bend
        place, heading = place + _STEP_M * np.array([math.cos(middle), math.sin(middle)]), heading + _STEP_M * bend
        near = np.argmin(np.hypot(*(_on(longer, s, at + steps) - place).T)) if abs(turn) < 0.5 * math.pi else 0
        at += float(steps[near])
        driven.append(place)
        passed.append(at)
    left = np.clip(_STEP_M * np.arange(len(driven))[::-1] / min(_BLEND_M, 0.5 * _STEP_M * len(driven)), 0.0, 1.0)
    moved = np.array(driven) + (1.0 - left**3 * (10.0 - 15.0 * left + 6.0 * left**2))[:, None] * (points[-1] - driven[-1])
    return np.column_stack([moved, np.minimum(passed, along[-1] - 1e-9 * np.arange(len(passed))[::-1])])


def _on(points: FloatArray, along: FloatArray, at: FloatArray | float) -> FloatArray:
    """Return the columns of ``points`` (n, k), which lie at ``along`` (n,), in between, (..., k)."""
    return np.stack([np.interp(at, along, column) for column in points.T], axis=-1)
