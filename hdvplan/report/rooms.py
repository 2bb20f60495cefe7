"""The room at a place: between the body that reaches furthest and the limit, or the road's centre."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.bodies import corners
from hdvplan.judging.result import Result


@dataclass(frozen=True)
class Room:
    """Signed offsets from the road's centre at arclength ``s``: what a body reached, and the limit or, without limits, 0 [m]."""

    s: float
    reach: float
    limit: float
    side: str
    unit: int
    limited: bool

    @property
    def depth(self) -> float:
        """How far beyond the limit; negative where it is kept [m]."""
        return self.reach - self.limit if self.side == "left" else self.limit - self.reach

    @property
    def broken(self) -> bool:
        """Whether there is a limit and it is broken."""
        return self.limited and self.depth > KEPT_M

    @property
    def text(self) -> str:
        """What is lacking or to spare, as few words."""
        if not self.limited:
            return f"reach {abs(self.reach):.2f} m"
        return f"{self.depth:.2f} m beyond" if self.broken else f"clearance {max(-self.depth, 0.0):.2f} m"


def room_at(result: Result, at: int) -> Room:
    """Return the least room to a limit at sample ``at`` of the envelope, or the furthest reach on a road without limits."""
    envelope, limits, s = result.envelope, result.drive.road.limits, float(result.envelope.s[at])
    if limits is None:
        left, right = float(envelope.reach_left[at]), float(envelope.reach_right[at])
        side, reach, bodies = ("left", left, envelope.left) if left >= -right else ("right", right, -envelope.right)
        return Room(s, reach, 0.0, side, int(np.nanargmax(bodies[:, at])), limited=False)
    gaps = {key: gap[:, at] for key, gap in result.gaps.items() if np.any(np.isfinite(gap[:, at]))}
    side, region = min(gaps, key=lambda key: float(np.nanmin(gaps[key])))
    gap, unit = float(np.nanmin(gaps[side, region])), int(np.nanargmin(gaps[side, region]))
    limit = float(limits.table(np.array([s]))[("left", "right").index(side) + (2 if region == "sweepable" else 0), 0])
    return Room(s, limit - gap if side == "left" else limit + gap, limit, side, unit, limited=True)


def pose_touching(result: Result, room: Room) -> int:
    """Return the number of the simulated pose at which a body reached the place of least room."""
    drive = result.drive
    place = shapely.Point(*(float(value) for value in drive.road.path.to_plane(room.s, room.reach)))
    near = np.flatnonzero(np.abs(drive.poses_s - room.s) <= drive.vehicle.reach_ahead + drive.vehicle.reach_behind)
    bodies = shapely.polygons(corners(drive, near)[:, room.unit])
    return int(near[int(np.argmin(shapely.distance(shapely.boundary(bodies), place)))])
