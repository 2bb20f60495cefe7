"""A part of a road as a separate road."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hdvplan.road.limits import Limits
from hdvplan.road.road import Road
from hdvplan.road.street import Street


def part_of(road: Road, s_from: float, s_to: float, before: float, after: float) -> Road:
    """Return the part of a road from ``s_from`` to ``s_to`` [m]; arclengths count from ``s_from``.

    Path, kerbs and the faces of regions go on for ``before`` and ``after`` [m] beyond its ends as they do on the road.
    """
    first, last = s_from - before, s_to + after
    faces = None if road.faces is None else Street.along(road.path, road.faces).beside(first, last)
    return replace(
        road,
        path=road.path.stretch(s_from, s_to, before, after),
        smoothing=None,
        about=None if road.about is None else road.about.part(s_from, s_to, road.path.length),
        limits=None if road.limits is None else _limits(road, road.limits, s_from, s_to),
        drawn=None if road.given is None else tuple(kerb.shifted(s_from) for kerb in road.given.beside(first, last)),
        faces=None if faces is None else tuple(face.shifted(s_from) for face in faces),
    )


def _limits(road: Road, limits: Limits, s_from: float, s_to: float) -> Limits:
    laps = np.arange(np.floor(s_from / road.path.length), np.ceil(s_to / road.path.length)) if road.path.closed else np.zeros(1)
    columns = (limits.left, limits.right, limits.left_sweep, limits.right_sweep)
    s = np.concatenate([limits.s + lap * road.path.length for lap in laps])
    return Limits(s - s_from, *(np.tile(column, len(laps)) for column in columns))
