"""Pieces of a line: arcs between points, points on them, and pieces that meet with gaps and kinks rounded to one line."""

from __future__ import annotations

import numpy as np
import scipy  # its subpackages load when they are first used

from hdvplan.arrays import BoolArray, FloatArray, IntArray, counted_up, runs_of

_GAP_M = 2e-3  # within which two points are one place
_KINK = 4e-3  # [rad]
_PER_TURN_M = 20.0  # of rounding to either side for a kink of one radian: adds a curvature of some 0.05 1/m, and
_PER_ROOT_M = 5.4  # for the square root of a gap of one metre: the same
_SHORTEST_M, _LONGEST_M = 0.5, 5.0  # of a rounding to either side
_ROUNDING_M = 1e-9  # shorter pieces are none
_STRAIGHT = 1e-6  # [1/m] below which there is no circle to leave


def rounded(points: FloatArray, heading: FloatArray, curvature: FloatArray) -> FloatArray:
    """Return dense points of a line, shape (n, 2) [m], moved where it has gaps or kinks so that it has none.

    ``heading`` [rad] and ``curvature`` [1/m] are the pieces' own, shape (n,). A quintic joins the points, headings and
    curvatures on both sides of each place; what lies further from it stays exactly where it is.
    """
    chord, change = np.diff(points, axis=0), wrapped(np.diff(heading))
    length = np.hypot(*chord.T)
    middle = heading[:-1] + 0.5 * change
    turn = np.where(length > _GAP_M, np.abs(wrapped(np.arctan2(chord[:, 1], chord[:, 0]) - middle)), 0.0)
    kink = np.abs(change - 0.5 * (curvature[:-1] + curvature[1:]) * length)
    odd = np.flatnonzero((turn > _KINK) | (kink > _KINK))
    if not odd.size:
        return points
    reach = np.clip(_PER_TURN_M * kink + _PER_ROOT_M * np.sqrt(length * np.sin(np.minimum(turn, 0.5 * np.pi))), _SHORTEST_M, _LONGEST_M)
    u = np.concatenate([[0.0], np.cumsum(length)])
    moved = np.zeros(len(points), dtype=bool)
    for at in odd.tolist():
        moved |= (u > u[at] - reach[at]) & (u < u[at + 1] + reach[at])
    state = np.stack([np.cos(heading), np.sin(heading)], axis=1), curvature[:, None] * np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    line = points.copy()
    for first, behind in runs_of(moved).tolist():
        ends = [max(first - 1, 0), min(behind, len(points) - 1)]
        given = np.stack([np.stack([points[end], state[0][end], state[1][end]]) for end in ends])
        line[ends[0] : ends[1] + 1] = scipy.interpolate.BPoly.from_derivatives(u[ends], given)(u[ends[0] : ends[1] + 1])
    return line


def wrapped(angle: FloatArray) -> FloatArray:
    """Return angles between -pi and pi."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def biarcs(
    start: FloatArray, direction: FloatArray, c: FloatArray, leaves: FloatArray, enters: FloatArray, beyond: FloatArray
) -> FloatArray:
    """Return biarcs over chords of length ``c`` with tangents at these angles, joined where the curvatures ``beyond`` their ends say."""
    half = 0.5 * c * beyond
    first, second = leaves - half, enters - half
    with np.errstate(divide="ignore", invalid="ignore"):
        joints = np.stack([1.0 - 2.0 * first[0] / (first[0] + second[0]), 2.0 * second[1] / (first[1] + second[1])])
    joint = np.clip(np.mean(np.clip(np.nan_to_num(joints, nan=0.5, posinf=0.5, neginf=0.5), 0.0, 1.0), axis=0), 0.1, 0.9)
    tangent = 0.5 * joint * c
    other = (0.5 * c**2 - tangent * c * np.cos(leaves)) / (c * np.cos(enters) + tangent * (1.0 - np.cos(leaves + enters)))
    x, y = c - other * np.cos(enters) - tangent * np.cos(leaves), tangent * np.sin(leaves) - other * np.sin(enters)
    middle = np.arctan2(y, x)  # the direction at the joint
    halves = 0.5 * (middle + leaves), 0.5 * (enters - middle)
    pieces = np.zeros((len(c), 3, 5))
    mid = direction + middle
    pieces[:, 2, 2] = direction + enters
    along, beside = tangent * np.cos(leaves) + tangent * np.cos(middle), -tangent * np.sin(leaves) + tangent * np.sin(middle)
    pieces[:, 0, :2] = start
    pieces[:, 1, 0] = start[:, 0] + along * np.cos(direction) - beside * np.sin(direction)
    pieces[:, 1, 1] = start[:, 1] + along * np.sin(direction) + beside * np.cos(direction)
    for at, (heading, angle, reach) in enumerate(((direction - leaves, halves[0], tangent), (mid, halves[1], other))):
        pieces[:, at, 2] = heading
        pieces[:, at, 3] = 2.0 * reach / np.sinc(angle / np.pi) * np.cos(angle)
        pieces[:, at, 4] = np.tan(angle) / reach
    return pieces


def arcs_and_tangent(
    start: FloatArray, end: FloatArray, headings: tuple[FloatArray, FloatArray], curvature: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return arc, tangent and arc between points with circles there (curvature 0: only a point), and whether there are such."""
    radius = np.where(np.abs(curvature) > _STRAIGHT, 1.0 / np.where(np.abs(curvature) > _STRAIGHT, curvature, 1.0), 0.0)
    centre = [place + r[:, None] * _left(heading) for place, r, heading in zip((start, end), radius, headings, strict=True)]
    between = centre[1] - centre[0]
    sine = (radius[1] - radius[0]) / np.maximum(np.hypot(*between.T), 1e-9)
    heading = np.arctan2(between[:, 1], between[:, 0]) - np.arcsin(np.clip(sine, -1.0, 1.0))
    touch = [middle - r[:, None] * _left(heading) for middle, r in zip(centre, radius, strict=True)]
    sweep = np.where(radius != 0.0, np.stack([wrapped(heading - headings[0]), wrapped(headings[1] - heading)]), 0.0)
    along = np.sum((touch[1] - touch[0]) * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=1)
    arcs = sweep * radius
    right = (np.abs(sine) <= 1.0) & np.all((arcs >= 0.0) & (np.abs(sweep) < 0.5 * np.pi), axis=0) & (along >= 0.0)
    pieces = np.zeros((len(start), 3, 5))
    pieces[:, 0] = np.column_stack([start, np.where(radius[0] != 0.0, headings[0], heading), arcs[0], curvature[0]])
    pieces[:, 1] = np.column_stack([touch[0], heading, along, np.zeros(len(start))])
    pieces[:, 2] = np.column_stack([touch[1], heading, arcs[1], curvature[1]])
    return pieces, right


def sampled(pieces: FloatArray, sagitta: float) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return points on pieces, shape (n, k, 5), the row of each point, and its share of the row's length; rows' ends are not among them.

    Chords between the points are within ``sagitta`` [m] of the curve.
    """
    length = pieces[..., 3]
    whole = np.maximum(np.sum(length, axis=1), _ROUNDING_M)
    begin = (np.cumsum(length, axis=1) - length) / whole[:, None]
    turn = np.sum(np.abs(pieces[..., 4]) * length, axis=1)
    steps = np.maximum(np.ceil(length * np.sqrt(np.abs(pieces[..., 4]) / (8.0 * sagitta))).astype(int), length > _ROUNDING_M)
    steps[whole * turn < 8.0 * sagitta] = [1] + [0] * (pieces.shape[1] - 1)
    of, step = counted_up(steps.ravel())
    share = step / steps.ravel()[of]
    flat = pieces.reshape(-1, 5)[of]
    s = share * flat[:, 3]
    half = 0.5 * s * flat[:, 4]
    heading = flat[:, 2] + half
    points = flat[:, :2] + (s * np.sinc(half / np.pi))[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    row = of // pieces.shape[1]
    return points, row, begin.ravel()[of] + s / whole[row]


def _left(heading: FloatArray) -> FloatArray:
    """Return unit vectors to the left, shape (n, 2)."""
    return np.stack([-np.sin(heading), np.cos(heading)], axis=1)


def half_angle(curvature: FloatArray, chord: FloatArray) -> FloatArray:
    """Return the angle [rad] between a chord and its circle."""
    return np.arcsin(np.clip(0.5 * curvature * chord, -0.9, 0.9))
