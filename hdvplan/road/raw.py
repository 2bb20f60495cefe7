"""What a road file says, before any smoothing: points in the plane and widths at them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hdvplan.jit import FloatArray

if TYPE_CHECKING:  # a file is read, and refused, before anything is made of it
    from hdvplan.road.crs import ToLonLat
    from hdvplan.road.regions import Region


@dataclass(frozen=True)
class RawRoad:
    """A road as given: ``points`` of shape (n, 2) are x, y [m], or s [m], kappa [1/m] when ``is_profile``.

    ``reaches`` are the widths at the points, shape (4, n): left, right, left_sweep, right_sweep, all positive [m].
    """

    points: FloatArray
    reaches: FloatArray | None = None
    is_profile: bool = False
    to_lonlat: ToLonLat | None = None
    notice: str | None = None
    regions: tuple[Region, ...] = ()
