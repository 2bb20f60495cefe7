"""What a plan sweeps, see ``core/tracks.c``."""

import numpy as np

from hdvplan.arrays import FloatArray, Records
from hdvplan.planning.stations import Stations
from tests.core.twins.kinematics import body_point, project

TIE, SWING, EDGE, FOOTLESS = 1e-4, 1e-4, 1.0, 0.95


def trace(stations: Stations, points: Records, axles: FloatArray, first: int) -> tuple[FloatArray, FloatArray]:
    """Return foot, NaN without one, and offset of every tracing point at stages whose units are at ``axles`` (stages, units, 4)."""
    feet, offsets = np.empty((len(axles), *points.shape)), np.empty((len(axles), *points.shape))
    for i, unit, pair in np.ndindex(len(axles), points.shape[0], points.shape[1] // 2):
        point = points[unit, 2 * pair]
        middle = body_point(axles[i, unit], point["ahead"], 0.0)
        near = int(first + i + point["start"])
        for _ in range(4):
            number = int(np.clip(near, 0, len(stations.points) - 1))
            at = stations.points[number]
            tangent, normal = np.array([at["cos"], at["sin"]]), np.array([-at["sin"], at["cos"]])
            off = middle - [at["x"], at["y"]]
            ahead, beside, k = off @ tangent, off @ normal, at["curvature"]
            if k * beside >= FOOTLESS or abs(ahead) <= 0.75 * stations.step * (1.0 - k * beside):
                break
            near = number + int(np.floor(ahead / (stations.step * (1.0 - k * beside)) + 0.5))
        for side, sign in enumerate((1.0, -1.0)):
            edge = body_point(axles[i, unit], point["ahead"], sign * point["left"]) - [at["x"], at["y"]]
            offset = edge @ normal
            moved = edge @ tangent / (1.0 - k * offset)
            one = i, unit, 2 * pair + side
            feet[one] = number * stations.step + moved if k * offset < FOOTLESS else np.nan
            offsets[one] = offset - 0.5 * k * moved**2 * (1.0 - k * offset)
    return feet, offsets


def widen(
    reached: Records, step: float, begin: tuple[float, float], end: tuple[float, float], who: tuple[float, bool], owner: tuple[int, int]
) -> None:
    """Widen one side's reach (places,) by a piece (s, outwards) that a point so far ahead of its axle draws.

    Along an edge (``who[1]``) the point lies further behind where the place does; a track (not) belongs to its nearer stage.
    """
    rise = (end[1] - begin[1]) / (end[0] - begin[0])
    for m in range(max(0, int(np.ceil(begin[0] / step))), min(len(reached) - 1, int(np.floor(end[0] / step))) + 1):
        reach = begin[1] + rise * (m * step - begin[0])
        if reach > reached[m]["reach"] + TIE:
            (ahead, edge), (stage, unit) = who, owner
            before = not edge and 2.0 * m * step <= begin[0] + end[0]
            reached[m] = reach, rise, ahead - (end[0] - m * step if edge else 0.0), stage - before, unit


def cover(
    stations: Stations,
    units: Records,
    points: Records,
    axles: FloatArray,
    tracks: tuple[FloatArray, FloatArray],
    first: int,
    reached: Records,
) -> None:
    """Widen ``reached`` (2, places) by what is swept from the first of the traced stages to the last."""
    feet, offsets = tracks
    for i in range(1, len(axles)):
        for unit, point in np.ndindex(points.shape):
            one, side = (unit, point), point % 2
            sign, (begin, end) = 1.0 - 2.0 * side, feet[i - 1 : i + 1, unit, point]
            if end > begin:
                pieces = [(foot, sign * offset) for foot, offset in zip((begin, end), offsets[i - 1 : i + 1, unit, point], strict=True)]
                widen(reached[side], stations.step, pieces[0], pieces[1], (float(points["ahead"][one]), False), (first + i, unit))
    heading = np.unwrap(np.arctan2(axles[:, :, 3], axles[:, :, 2]), axis=0)
    turned = np.sin(np.diff(heading, axis=0, prepend=heading[:1]))
    for unit, i in np.ndindex(len(units), len(axles)):
        if i > 0 and turned[i - 1, unit] * turned[i, unit] < 0.0 and abs(turned[i, unit] - turned[i - 1, unit]) > SWING:
            for side in range(2):
                cover_edge(
                    stations, units, axles[i - 1, unit], feet[i - 1, unit, 2], unit, turned[i - 1, unit] > 0.0, side, first + i - 1, reached
                )


def cover_edge(
    stations: Stations, units: Records, axle: FloatArray, foot: float, unit: int, left: bool, side: int, stage: int, reached: Records
) -> None:
    """Widen ``reached`` by an edge of a body that had turned left, or right, and turns back: ahead of the axle or behind it."""
    own, sign = units[unit], 1.0 - 2.0 * side
    begin, end = (0.0, own["front"]) if left == (side == 0) else (-own["rear_overhang"], 0.0)
    pieces, last, near = int(np.ceil((end - begin) / EDGE)), None, foot + begin
    for ahead in np.linspace(begin, end, pieces + 1):
        x, y = body_point(axle, ahead, sign * own["half_width"])
        near, offset = project(stations.path, x, y, near)[:2]
        if np.isnan(offset):
            return
        here = near, sign * offset
        if last is not None and here[0] > last[0]:
            widen(reached[side], stations.step, last, here, (ahead, True), (stage, unit))
        last = here
