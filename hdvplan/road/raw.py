"""What a road file says, before any smoothing: points in the plane and widths at them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hdvplan.arrays import FloatArray

if TYPE_CHECKING:  # a file is read, and refused, before anything is made of it
    from hdvplan.road.crs import ToLonLat
    from hdvplan.road.regions import Region


@dataclass(frozen=True)
class RawRoad:
    """A road as given: ``points`` of shape (n, 2) are x, y [m], or s [m], kappa [1/m] when ``is_profile``.

    ``reaches`` are the widths at the points, shape (4, n): left, right, left_sweep, right_sweep, all positive [m]. Or
    ``sides`` are the edges left and right of each point, shape (2, n, 2), or ``edges`` lines somewhere beside the road, each of
    shape (m, 2), x, y [m]. ``lines`` are the lines of the points in their file, where it has some; ``notes`` what the reader
    has to say to the user. ``rounded`` are the points moved as little as it takes for a line without gaps and kinks, where
    that is known: it needs no smoothing. ``corners`` says how the points are read, where the file does, see ``Corners``, and
    ``corner_radius`` rounds the kerbs inside sharp ones [m].
    """

    points: FloatArray
    reaches: FloatArray | None = None
    is_profile: bool = False
    to_lonlat: ToLonLat | None = None
    notice: str | None = None
    regions: tuple[Region, ...] = ()
    edges: tuple[FloatArray, ...] = ()
    sides: FloatArray | None = None
    lines: tuple[int, ...] | None = None
    notes: tuple[str, ...] = ()
    rounded: FloatArray | None = None
    corners: str | None = None
    corner_radius: float = 0.0
