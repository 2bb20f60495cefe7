"""The points of a body that must lie in free space, and whether it fits anywhere at all: hdvplan/core/poses.c."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hdvplan import core
from hdvplan.arrays import FloatArray, IntArray, Records
from hdvplan.proof.space import Beside, Frame, around, frame_record
from hdvplan.vehicle.model import Unit

_SAME_M = 1e-9
POINTS_M = 0.4  # between the points of an outline that are looked at: a bend of 8 m of radius reaches 2.5 mm in between
_OUTLINE = core.record(
    "hdv_outline",
    [
        *((name, core.ADDRESS) for name in ("points", "region")),
        ("point_count", np.int64),
        *((name, float) for name in ("rear", "front", "half", "reach")),
    ],
)
_fits = core.function("hdv_fits", core.POINTER, core.POINTER, core.POINTER, returns=core.INT)


class Outline(NamedTuple):
    """Points of one body that must lie in free space: ahead of its axle and left of its middle (n, 2) [m], and by which region (n,)."""

    points: FloatArray
    region: IntArray  # 0: the drivable one, 1: the one for overhangs
    rear: float  # of the body, ahead of the point of reference [m]
    front: float
    half: float  # width [m]
    reach: float  # of the furthest point [m]


def outline_of(unit: Unit, *, two_regions: bool) -> Outline:
    """Return a body's outline; between its axles it keeps to the drivable region where overhangs have a separate one."""
    ends = np.unique([-unit.rear_overhang, 0.0, min(unit.wheelbase, unit.front), unit.front])
    pieces = [np.linspace(a, b, int(np.ceil((b - a) / POINTS_M)) + 1) for a, b in pairwise(ends)]
    ahead = np.unique(np.concatenate(pieces)) if pieces else ends
    half = 0.5 * unit.width
    overhang = (ahead < -_SAME_M) | (ahead > unit.wheelbase + _SAME_M)
    across = np.linspace(-half, half, int(np.ceil(unit.width / POINTS_M)) + 1)[1:-1]
    points = [np.column_stack([ahead, np.full(len(ahead), side)]) for side in (half, -half)]
    points += [np.column_stack([np.full(len(across), end), across]) for end in (ends[-1], ends[0])]
    whole = np.concatenate([overhang, overhang, np.full(2 * len(across), True)])
    # Corners first: they rule out most poses at once.
    order = np.argsort(-np.abs(np.concatenate(points)[:, 0] - 0.5 * (ends[0] + ends[-1])), kind="stable")
    region = np.where(whole, 1, 0) if two_regions else np.ones(len(whole))
    return _outline(np.concatenate(points)[order], region[order])


def seen_from(outline: Outline, ahead: float) -> Outline:
    """Return an outline whose point of reference lies ``ahead`` of the old one [m]."""
    return _outline(outline.points - np.array([ahead, 0.0]), outline.region)


def _outline(points: FloatArray, region: NDArray[np.generic]) -> Outline:
    reach = float(np.max(np.hypot(points[:, 0], points[:, 1])))
    ends = float(np.min(points[:, 0])), float(np.max(points[:, 0])), float(np.max(points[:, 1]))
    return Outline(np.ascontiguousarray(points), np.ascontiguousarray(region.astype(np.int64)), *ends, reach)


def outline_record(outline: Outline) -> Records:
    """Return an outline as the core takes it; its arrays must outlive the record."""
    sizes = (outline.rear, outline.front, outline.half, outline.reach)
    return np.array([(core.address(outline.points), core.address(outline.region), len(outline.region), *sizes)], _OUTLINE)


def fits(outline: Outline, space: Beside, frame: Frame, *, two_regions: bool) -> int:
    """Return the first station at which the body fits in no pose, its axle on the normal there; -1 if there is none."""
    near, body, stations = around(space, outline.reach, two_regions=two_regions), outline_record(outline), frame_record(frame)
    return int(_fits(core.address(body), core.address(stations), core.address(near.record)))
