"""Distances and turns between places that are near each other, from longitude and latitude [deg]."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

Place = tuple[float, float]
Places = Mapping[int, Place]  # of nodes, by their ids

_METRES_PER_DEGREE = 111_195.0  # of a great circle on a sphere of 6371 km


def length_of(nodes: Sequence[int], places: Places) -> float:
    """Return the length of a line of nodes [m]."""
    return sum(distance(places[a], places[b]) for a, b in pairwise(nodes))


def distance(a: Place, b: Place) -> float:
    """Return the distance of two places [m], to half a per cent."""
    return math.hypot(*_from(a, b)) * _METRES_PER_DEGREE


def turn(before: Place, at: Place, after: Place) -> float:
    """Return by how much a line turns at a place [deg], without sign."""
    (x, y), (u, v) = _from(before, at), _from(at, after)
    return abs(math.degrees(math.atan2(x * v - y * u, x * u + y * v)))


def _from(a: Place, b: Place) -> Place:
    """Return the way from a place to one near by, east and north, in degrees of a great circle."""
    east = (b[0] - a[0] + 180.0) % 360.0 - 180.0  # across the antimeridian too
    return east * math.cos(math.radians(0.5 * (a[1] + b[1]))), b[1] - a[1]
