"""Which stretches of a long road deserve an enlargement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.jit import FloatArray
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.result import Result

_LABELS = "ABCD"  # of a long road's enlargements; a shorter one gets the first two
LONG_ROAD_M = 300.0  # beyond it a body is a speck on a map of the whole
FEW_BELOW_M = 1000.0
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
    """Return up to four stretches, two of a road below a kilometre, tightest first.

    Tight is the least clearance to the limits, or the furthest reach without limits.
    """
    envelope, clearance, length = result.envelope, result.clearance, result.drive.road.path.length
    if clearance is None:
        score, kind = np.maximum(envelope.reach_left, -envelope.reach_right), "reach"
    else:
        score, kind = -clearance, "clearance"
    vehicle = result.drive.vehicle
    half = float(np.clip(_LENGTHS * (vehicle.reach_ahead + vehicle.reach_behind), *_HALF_LENGTH_M))
    labels, windows = _LABELS[: 2 if length < FEW_BELOW_M else None], []
    for label, at in zip(labels, peaks(envelope.s, score, 2.0 * half, len(labels)), strict=False):
        s, value = float(envelope.s[at]), float(score[at]) if clearance is None else -float(score[at])
        middle = min(max(s, half), length - half)
        what = f"limit broken by {-value:.2f} m" if value < -KEPT_M else f"{kind} {max(value, 0.0):.2f} m"
        windows.append(Window(middle - half, middle + half, label, f"{what} at s = {s:.0f} m"))
    return tuple(windows)


def peaks(s: FloatArray, score: FloatArray, apart: float, most: int) -> list[int]:
    """Return up to ``most`` samples of the highest scores at least ``apart`` [m] from each other, highest first."""
    left, found = score.copy(), list[int]()
    for _ in range(most):
        at = int(np.argmax(left))
        if not np.isfinite(left[at]):
            break
        found.append(at)
        left[np.abs(s - s[at]) < apart] = -np.inf
    return found
