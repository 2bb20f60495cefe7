"""What a drawing of a driven manoeuvre holds, layer by layer, in the plane of the manoeuvre."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray
from hdvplan.report.kerbs import simple_line
from hdvplan.report.layers import Drawn, Layer, of_body
from hdvplan.turning.follow import Followed
from hdvplan.turning.swept import chart_of
from hdvplan.turning.turn import Turn
from hdvplan.vehicle.body import corners_at, tracks_at

_RING_SEGMENTS = 128  # a quarter: on a radius of 15 m chords are off by 0.3 mm
_AREA_M = 0.2  # between the poses that a swept area is joined from: short by 0.7 mm at a radius of 7 m
_TRACK_M = 0.25


def turn_features(turn: Turn) -> tuple[Drawn, ...]:
    """Return all features of a manoeuvre's drawing, x, y [m]: path, swept areas, the limits' circles, wheel tracks, a few poses."""
    driven, units = turn.driven, range(len(turn.driven.vehicle.units))
    named = [of_body(driven.vehicle, unit) for unit in units]
    found = [Drawn(Layer.GUIDED_PATH, simple_line(driven.guide[:, :2]), {"point": str(driven.manoeuvre.point)})]
    found += [Drawn(Layer.ENVELOPE, swept_area(driven, unit), named[unit]) for unit in units]
    for limit in turn.circles:
        ring = shapely.Point(chart_of(driven).centre).buffer(limit.value, quad_segs=_RING_SEGMENTS).exterior
        found.append(Drawn(Layer.LIMITS, ring, {"limit": limit.words, "limit_m": limit.value}))
    found += [Drawn(Layer.TRACKS, simple_line(track), named[unit] | {"side": side}) for unit, side, track in wheel_tracks(driven)]
    outlines = corners_at(driven.vehicle, driven.poses[shown_poses(driven)])
    found += [Drawn(Layer.VEHICLES, shapely.Polygon(bodies[unit]), named[unit]) for bodies in outlines for unit in units]
    return tuple(found)


def swept_area(driven: Followed, unit: int) -> BaseGeometry:
    """Return the plane area that a body sweeps [m]. Of a full circle those of its first and last round: the others lie in between."""
    spaced, around = _every(driven, _AREA_M), 2.0 * np.pi * driven.manoeuvre.radius
    corners, s = corners_at(driven.vehicle, driven.poses[spaced])[:, unit], driven.s[spaced]
    if driven.manoeuvre.angle is not None or s[-1] < 2.0 * around:
        return swept_by(corners)
    return shapely.union(swept_by(corners[s < driven.manoeuvre.lead_in + around]), swept_by(corners[s > s[-1] - around]))


def swept_by(corners: FloatArray) -> BaseGeometry:
    """Return the plane area of a body's outlines (n, 4, 2), and what their edges sweep from one to the next [m]."""
    ends = np.roll(corners, -1, axis=1)
    moved = np.stack([corners[:-1], ends[:-1], ends[1:], corners[1:]], axis=2).reshape(-1, 4, 2)
    areas = shapely.make_valid(shapely.polygons(moved))  # an edge that turns about a point of its own sweeps two triangles
    return shapely.union_all(np.concatenate([shapely.polygons(corners), areas]))


def wheel_tracks(driven: Followed) -> list[tuple[int, str, FloatArray]]:
    """Return the tracks of all wheels: unit, side (front left, left, ...), points (n, 2) [m]."""
    tracks = ((track.wheel, track.points) for track in tracks_at(driven.vehicle, driven.poses[_every(driven, _TRACK_M)]))
    return [(wheel.unit, f"front {wheel.side}" if wheel.axle == "front" else wheel.side, points) for wheel, points in tracks]


def shown_poses(driven: Followed) -> list[int]:
    """Return the pose at the begin, the one when the turn ends, and the last."""
    if driven.manoeuvre.angle is None:
        return [0, len(driven.s) - 1]
    out = driven.path.starts[-1] - driven.manoeuvre.lead_out_of(driven.vehicle)
    return [0, int(driven.s.searchsorted(out)), len(driven.s) - 1]


def _every(driven: Followed, spacing: float) -> slice:
    """Return the poses about ``spacing`` apart [m]."""
    return slice(None, None, max(1, round(spacing / float(np.median(np.diff(driven.s))))))
