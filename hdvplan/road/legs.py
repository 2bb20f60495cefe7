"""Several lines that a vehicle drives one after the other, forwards or rear first: turning heads, docks, three-point turns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.road.arcs import wrapped
from hdvplan.road.regions import Region
from hdvplan.road.road import Road

FORWARD, BACKWARD = "forward", "backward"
SHORTEST_M = 1.0  # of a leg: moves in a narrow place are short
SAME_M = 0.01  # two points this close are one


def direction_of(*, backward: bool) -> str:
    """Return what files and tables call a direction."""
    return BACKWARD if backward else FORWARD


@dataclass(frozen=True)
class Leg:
    """One stretch between two cusps, in its street.

    The line of ``road`` is directed as the vehicle heads, and its s counts along that heading. A ``backward`` leg is driven rear first:
    from the line's end to its beginning.
    """

    road: Road
    backward: bool
    last_axle: tuple[float, float, float] | None = None  #: where its line ends if that was drawn, x and y [m], heading [rad]

    @property
    def direction(self) -> str:
        """What files and tables call the direction."""
        return direction_of(backward=self.backward)

    @property
    def ends(self) -> tuple[float, float]:
        """The arclengths at which the leg is begun and ended, in the order of driving [m]."""
        length = self.road.path.length
        return (length, 0.0) if self.backward else (0.0, length)

    @property
    def aim(self) -> tuple[float, float, float]:
        """Where its line as drawn ends: x and y [m], and the heading there [rad]."""
        if self.last_axle is not None:
            return self.last_axle
        end, row = self.road.path.at(np.array(self.ends[1:])), 0 if self.backward else -1
        x, y = (float(end.x[0]), float(end.y[0])) if self.road.about is None else self.road.about.points[row].tolist()
        return x, y, float(end.heading[0]) - self.turned[1]

    @property
    def turned(self) -> tuple[float, float]:
        """By how much smoothing turned the line where the leg begins and where it ends, left positive [rad]."""
        if self.road.about is None:
            return 0.0, 0.0
        x, y = self.road.about.ends.T
        first, last = wrapped(self.road.path.at(np.array([0.0, self.road.path.length])).heading - np.arctan2(y, x)).tolist()
        return (last, first) if self.backward else (first, last)


@dataclass(frozen=True)
class Legs:
    """All legs of a drive in the order of driving, in one plane; at a cusp neighbours share the point and the heading of their lines."""

    name: str
    legs: tuple[Leg, ...]
    notes: tuple[str, ...] = ()  #: from reading the file
    regions: tuple[Region, ...] = ()  #: as drawn; a leg's own are cut where they lie across the continuation of its line
