"""How an obstacle was passed, and what the other side would have cost."""

from __future__ import annotations

from dataclasses import dataclass

from hdvplan.road.regions import Region, Side


@dataclass(frozen=True)
class Trial:
    """What a plan of a stretch of road came to, as simulated [m]."""

    violation: float  # by how much the deepest place misses the clearance wanted; 0 when it is kept; infinite where no plan exists
    harm: float  # the square of what is missing anywhere, over the length of road where it is [m^3]
    clearance: float  # least room to edges and obstacles; negative where one is broken
    off_centre: float  # mean distance of the swept area's middle from where it is wanted
    cost: float  # mean over the stations of its square and of the weighted squared change of curvature, as planning weighs them [m^2]


@dataclass(frozen=True)
class Passed:
    """An obstacle, the side on which it is passed, and the plans of the road around it with either side.

    ``own`` and ``other`` are None where nothing was to be chosen; ``reason`` says why.
    """

    obstacle: Region
    s_from: float  # [m]
    s_to: float
    side: Side
    forced: bool
    own: Trial | None
    other: Trial | None
    reason: str | None
