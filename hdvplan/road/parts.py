"""One line from the parts of a feature, and what is odd about its points."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely

from hdvplan.arrays import FloatArray, turns_of
from hdvplan.errors import RoadError
from hdvplan.road.checks import BACK, named_point
from hdvplan.road.regions import snapped
from hdvplan.texts import counted

_SNAP_M = 0.01
_PAUSE_M = 25.0  # most of a track
_FIVE = 5  # points: one, and a straight on either side
_STEP_M = 0.5  # shorter ones jitter
_ASIDE_M = 2.0  # of a point that may be a mistake, from a straight through its neighbours,
_LEVEL, _KINK = np.cos(np.deg2rad((10.0, 30.0)))  # which these and theirs keep to, and its own turn
_MOST_PARTS = 5000  # of a line that are joined: a bus route has hundreds, and a country's network takes hours


def one_line(parts: list[FloatArray], name: str, *, directed: bool, recorded: bool = False) -> tuple[FloatArray, tuple[str, ...]]:
    """Return one line from parts that join end to start, in their own direction, or else the first one's, whatever their order; and notes.

    Over pauses, as loggers make them, a line goes on: up to 25 m where it was ``recorded``, else up to a step of the parts.
    """
    gap = max((float(np.hypot(*(after[0] - before[-1]))) for before, after in pairwise(parts)), default=0.0)
    if gap <= _SNAP_M:
        return np.concatenate(parts), ()
    steps = (np.inf if recorded else float(np.max(np.hypot(*np.diff(part, axis=0).T))) for part in parts)
    if directed and gap <= min(_PAUSE_M, *steps):
        return np.concatenate(parts), (f"{name}: the line's {len(parts)} parts are taken as one, over gaps of up to {gap:.1f} m",)
    if len(parts) > _MOST_PARTS:
        msg = f"{name}: the line has {len(parts)} parts out of order; at most {_MOST_PARTS} are joined"
        raise RoadError(msg, hint="is it a network? give its lines as features of their own, and choose one with --id")
    parts = snapped(parts, _SNAP_M)
    merged = shapely.line_merge(shapely.MultiLineString(parts), directed=directed)
    if isinstance(merged, shapely.LineString):
        start, end = (merged.project(shapely.Point(parts[0][row])) for row in (0, -1))
        return np.asarray(merged.coords if directed or start < end else merged.reverse().coords, dtype=float), ()
    pieces = [np.asarray(piece.coords, dtype=float) for piece in merged.geoms]
    starts = np.array([piece[0] for piece in pieces])
    gaps = [float(np.min(np.delete(np.hypot(*(starts - piece[-1]).T), i))) for i, piece in enumerate(pieces)]
    listed = ", ".join(f"{gap:.2f} m" for gap in sorted(gaps)[: len(pieces) - 1][:10])
    msg = f"{name}: the line's {len(parts)} parts do not join to one; from an end to the next start there are gaps of {listed}"
    raise RoadError(msg, hint="join the parts, or turn the ones that run backwards" if directed else "join them, or choose one with --id")


def odd_points(points: FloatArray, lines: tuple[int, ...] | None, name: str) -> tuple[str, ...]:
    """Return notes on the points of a line, shape (n, 2) [m], that may be mistakes: it goes back at them, or they alone lie aside."""
    steps, turns = np.diff(points, axis=0), turns_of(points)
    long = np.hypot(*steps.T) > _STEP_M
    back = 1 + np.flatnonzero((turns < BACK) & long[1:] & long[:-1])

    notes = list[str]()
    if len(back):
        what = f"the line goes back on itself at {counted(len(back), 'point')}, first at {named_point(back[0], lines)}"
        notes.append(f"{name}: {what}: are its points in the right order?")
    if len(points) >= _FIVE:
        before, across, after = steps[:-3], points[3:-1] - points[1:-3], steps[3:]
        length, own = np.hypot(*across.T), points[2:-2] - points[1:-3]
        level = [np.sum(step * across, axis=1) > _LEVEL * np.hypot(*step.T) * length for step in (before, after)]
        apart = np.abs(across[:, 0] * own[:, 1] - across[:, 1] * own[:, 0]) / np.maximum(length, _STEP_M)
        aside = np.flatnonzero(level[0] & level[1] & (turns[1:-1] < _KINK) & (apart > _ASIDE_M))
        if len(aside):
            what = f"{named_point(2 + aside[0], lines)} lies {apart[aside[0]]:.1f} m off the straight of those before and behind it"
            notes.append(f"{name}: {what}: is it a mistake?")
    return tuple(notes)
