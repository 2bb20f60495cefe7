"""Which stretches of a long road deserve an enlargement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.jit import FloatArray
from hdvplan.report.result import Result

MOST = 2
_LENGTHS = 1.5  # vehicle lengths shown on either side
_HALF_LENGTH_M = (25.0, 45.0)  # whatever the vehicle


@dataclass(frozen=True)
class Window:
    """A stretch of road, with what makes it worth a look."""

    s_from: float  # [m]
    s_to: float  # [m]
    label: str = ""
    reason: str = ""

    @property
    def title(self) -> str:
        """The label and the reason as one line."""
        return f"{self.label}: {self.reason}"


def tightest_windows(result: Result) -> tuple[Window, ...]:
    """Return up to two stretches, tightest first: least clearance to the limits, or furthest reach without limits."""
    envelope, limits, length = result.envelope, result.drive.road.limits, result.drive.road.path.length
    if limits is None:
        score, kind = np.maximum(envelope.reach_left, -envelope.reach_right), "reach"
    else:
        _, _, left, right = limits.table(envelope.s)
        score, kind = -np.minimum(left - envelope.reach_left, envelope.reach_right - right), "clearance"
    vehicle = result.drive.vehicle
    half = float(np.clip(_LENGTHS * (vehicle.reach_ahead + vehicle.reach_behind), *_HALF_LENGTH_M))
    windows = []
    for label, at in zip("AB", _peaks(envelope.s, score, 2.0 * half), strict=False):
        s, value = float(envelope.s[at]), float(score[at]) if limits is None else -float(score[at])
        middle = min(max(s, half), length - half)
        windows.append(Window(middle - half, middle + half, label, f"{kind} {value:.2f} m at s = {s:.0f} m"))
    return tuple(windows)


def _peaks(s: FloatArray, score: FloatArray, apart: float) -> list[int]:
    """Return the samples of the highest scores at least ``apart`` [m] from each other, highest first."""
    left, found = score.copy(), list[int]()
    for _ in range(MOST):
        at = int(np.argmax(left))
        if not np.isfinite(left[at]):
            break
        found.append(at)
        left[np.abs(s - s[at]) < apart] = -np.inf
    return found
