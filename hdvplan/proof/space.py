"""The space beside a road that proofs look at: quadrilaterals between neighbouring normals, cut off at the limits, less the obstacles.

Every rounding goes outwards: what is called occupied is occupied. What of it a body at one station can use: hdvplan/core/free_space.c.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.road.path import PathPoint, ReferencePath
from hdvplan.road.regions import OPEN_M, Kind
from hdvplan.road.road import Road

STRIP_M = 0.25  # of road per quadrilateral: limits are judged at these arclengths
BIN_M = core.constant("HDV_BIN_M")  # of u, ahead of the axle
MOST = core.number("HDV_FREE_INTERVALS")  # that are stored for one u; of more, the outermost are joined
_OUTSIDE_M = 60.0  # free beyond the ends of what is looked at: as far as any body reaches
_ARC_M = 1e-3  # a limit between two normals against its chord, at a curvature of 0.1 1/m; and rounding
_JUMP = 0.2  # slope of a limit from which it counts as a jump, which is judged at the arclengths around it alone
_FOLD = 0.999  # of the radius: nothing that is judged lies further inside a bend
_BESIDE = core.record(
    "hdv_beside",
    [
        *((name, core.ADDRESS) for name in ("quads", "s", "blocked", "corners")),
        *((name, np.int64) for name in ("quad_count", "blocked_count", "corner_count")),
    ],
)
_FRAME = core.record("hdv_frame", [*((name, core.ADDRESS) for name in ("s", "x", "y", "heading")), ("stations", np.int64)])
_AROUND = core.record(
    "hdv_around",
    [
        ("beside", core.ADDRESS),
        ("reach", float),
        *((name, np.int64) for name in ("two_regions", "bins")),
        *((name, core.ADDRESS) for name in ("free", "lines", "corners")),
        ("corners_near", np.int64),
        ("near", float, 2),
        *((name, core.ADDRESS) for name in ("quads", "triangles", "met")),
    ],
)
_SHAPE_NEAR = core.record(
    "hdv_shape_near", [("u", float, 4), ("v", float, 4), *((name, float, 2) for name in ("extent", "whole", "first", "last"))]
)


class Beside(NamedTuple):
    """What lies beside a stretch of road in the plane; quadrilaterals in order of s, the first and last reach beyond the stretch.

    ``quads`` (2, n, 4, 2) [m]: for wheels, and for whole bodies; corners right and left at one normal, left and right at the next.
    ``s`` (n + 1,): arclengths of the normals [m]. ``blocked`` (m, 3, 2): triangles of obstacles, ``corners`` (k, 2): their corners.
    """

    quads: FloatArray
    s: FloatArray
    blocked: FloatArray
    corners: FloatArray


class Frame(NamedTuple):
    """The road's points at the stations of a proof: arclength [m], position [m], unwrapped heading [rad], shape (stations,) each."""

    s: FloatArray
    x: FloatArray
    y: FloatArray
    heading: FloatArray


class Around(NamedTuple):
    """What lies around one station after the other, as far as bodies can touch it: memory that the core fills."""

    record: Records  # (1,) of ``_AROUND``
    kept: tuple[object, ...]  # what it points to


def around(space: Beside, reach: float, *, two_regions: bool) -> Around:
    """Return memory for what bodies within ``reach`` [m] of the axle can touch; ``two_regions``: wheels have less room than bodies."""
    bins = bins_for(reach)
    sizes = (len(space.s) - 1, len(space.blocked), len(space.corners))
    beside_ = np.array([(*map(core.address, space), *sizes)], _BESIDE)
    free, lines = np.zeros((2, bins), np.int64), np.empty((2, bins, MOST, 4))
    corners, quads, triangles = np.empty_like(space.corners), np.empty(sizes[0], _SHAPE_NEAR), np.empty(sizes[1], _SHAPE_NEAR)
    met = np.empty(sizes[0], core.ADDRESS)
    kept = (beside_, *space, free, lines, corners, quads, triangles, met)
    of_bins, of_shapes = map(core.address, (free, lines, corners)), map(core.address, (quads, triangles, met))
    record = np.array([(core.address(beside_), reach, two_regions, bins, *of_bins, 0, (0.0, 0.0), *of_shapes)], _AROUND)
    return Around(record, kept)


def frame_record(frame: Frame) -> Records:
    """Return a frame as the core takes it; its arrays must outlive the record."""
    return np.array([(*map(core.address, frame), len(frame.s))], _FRAME)


def frame_of(path: ReferencePath, s: FloatArray) -> Frame:
    """Return the road's points at arclengths ``s`` [m]."""
    point = path.at(s)
    return Frame(s, *map(np.ascontiguousarray, (point.x, point.y, np.unwrap(point.heading))))


def beside(road: Road, s_from: float, s_to: float, *, room: float) -> Beside | None:
    """Return the free space from ``s_from`` to ``s_to`` [m], as far as limits and obstacles count there; None where nothing limits it.

    ``room`` is by how much all limits and obstacles give way [m]; negative: room to keep from them.
    """
    obstacles = [region.polygon for region in road.regions if region.kind is Kind.OBSTACLE]
    limits = road.limits if road.edges is None else road.edges
    if limits is None and not obstacles:
        return None
    length = road.path.length
    first, last = max(0.0, s_from), min(length, s_to)
    s = STRIP_M * np.arange(np.ceil(first / STRIP_M - 1e-9), np.floor(last / STRIP_M + 1e-9) + 1.0)
    table = np.array([OPEN_M, -OPEN_M, OPEN_M, -OPEN_M])[:, None] * np.ones(len(s)) if limits is None else limits.table(s)
    point = road.path.at(s)
    inside = _FOLD / np.maximum(np.abs(point.curvature), 1e-9)
    quads = np.stack([_quads(point, inside, table[2 * region], table[2 * region + 1], room) for region in (0, 1)])
    return Beside(quads, np.concatenate([[s[0] - _OUTSIDE_M], s, [s[-1] + _OUTSIDE_M]]), *_blocked(obstacles, room))


def _quads(point: PathPoint, inside: FloatArray, left: FloatArray, right: FloatArray, room: float) -> FloatArray:
    """Return the quadrilaterals between neighbouring normals, and the two beyond the ends, (n + 1, 4, 2)."""
    tangent = np.stack([np.cos(point.heading), np.sin(point.heading)], axis=1)
    normal, centre = tangent[:, ::-1] * np.array([-1.0, 1.0]), np.stack([point.x, point.y], axis=1)
    corners: list[FloatArray] = []  # of the quadrilaterals' left and right sides, each at both normals
    for value, outwards in ((outwards_of * side, outwards_of) for side, outwards_of in ((left, 1.0), (right, -1.0))):
        jumps = np.abs(np.diff(value)) > _JUMP * STRIP_M
        wide = np.maximum(value[:-1], value[1:])
        folds = np.where(outwards * point.curvature > 0.0, inside, np.inf)
        for at in (slice(None, -1), slice(1, None)):
            reach = np.minimum(np.where(jumps, wide, value[at]) + room + _ARC_M, folds[at])
            corners.append(centre[at] + outwards * reach[:, None] * normal[at])
    strips = np.stack([corners[2], corners[0], corners[1], corners[3]], axis=1)
    aside, ahead = _OUTSIDE_M * normal, _OUTSIDE_M * tangent
    first = [centre[0] - aside[0] - ahead[0], centre[0] + aside[0] - ahead[0], centre[0] + aside[0], centre[0] - aside[0]]
    last = [centre[-1] - aside[-1], centre[-1] + aside[-1], centre[-1] + aside[-1] + ahead[-1], centre[-1] - aside[-1] + ahead[-1]]
    return np.ascontiguousarray(np.concatenate([np.stack(first)[None], strips, np.stack(last)[None]]))


def _blocked(obstacles: list[shapely.Polygon], room: float) -> tuple[FloatArray, FloatArray]:
    """Return triangles and corners of all obstacles, each smaller by ``room`` or, where that is negative, larger; rounded inwards."""
    found, corners = [np.empty((0, 3, 2))], [np.empty((0, 2))]
    for obstacle in obstacles:
        # A chord of an arc lies inside a larger obstacle; corners of a smaller one stay corners.
        moved = obstacle.buffer(-room, quad_segs=16, join_style="mitre" if room > 0.0 else "round")
        triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(moved))
        found += [np.asarray(part.exterior.coords)[None, :3] for part in triangles]
        corners.append(shapely.get_coordinates(moved))
    return np.ascontiguousarray(np.concatenate(found)), np.ascontiguousarray(np.concatenate(corners))


def bins_for(reach: float) -> int:
    """Return how many bins of u hold all points within ``reach`` [m] of the axle."""
    return 2 * int(np.ceil((reach + 3.0 * BIN_M) / BIN_M)) + 2
