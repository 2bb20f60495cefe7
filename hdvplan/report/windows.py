"""Which stretches of a long road deserve an enlargement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.judging.result import Result
from hdvplan.report.rooms import room_at, tightness

_LABELS = "ABCD"  # of a long road's enlargements; a shorter one gets the first two
LONG_ROAD_M = 300.0  # beyond it a body is a speck on a map of the whole
FEW_BELOW_M = 1000.0
LENGTHS = 1.5  # vehicle lengths shown on either side
HALF_LENGTH_M = (25.0, 45.0)  # whatever the vehicle
_OF_SHORT, _SHORT_HALF_M = 0.1, 12.0  # of a short road's length shown on either side, and at least: else it would be the whole again


@dataclass(frozen=True)
class Window:
    """A stretch of road, with what makes it worth a look."""

    s_from: float  # [m]
    s_to: float  # [m]
    label: str = ""
    reason: str = ""
    at: int | None = None  # sample of the envelope that makes it worth it

    @property
    def title(self) -> str:
        """The label and the reason as one line."""
        return f"{self.label}: {self.reason}"


def tightest_windows(result: Result) -> tuple[Window, ...]:
    """Return up to four stretches around the tightest places, two of a road below a kilometre, lettered in road order.

    Tight is the least clearance to edges and obstacles, or the furthest reach without limits.
    """
    length = result.drive.road.path.length
    vehicle = result.drive.vehicle
    half = float(np.clip(LENGTHS * (vehicle.reach_ahead + vehicle.reach_behind), *HALF_LENGTH_M))
    if length <= LONG_ROAD_M:
        half = min(half, max(_OF_SHORT * length, _SHORT_HALF_M))
    labels, windows = _LABELS[: 2 if length < FEW_BELOW_M else None], []
    for label, at in zip(labels, sorted(peaks(result.envelope.s, tightness(result), 2.0 * half, len(labels))), strict=False):
        room = room_at(result, at)
        middle = min(max(room.s, half), max(length - half, half))
        what = room.text if not room.broken or room.obstacle is not None else f"limit broken by {room.depth:.2f} m"
        windows.append(Window(middle - half, min(middle + half, length), label, f"{what} at s = {room.s:.0f} m", at))
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
