"""Other ways to drive a drawn line: beside it, and the other way. The road's edges and its regions stay where they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hdvplan.arrays import FloatArray, carried
from hdvplan.errors import RoadError
from hdvplan.road.limits import Limits
from hdvplan.road.path import ReferencePath, from_samples
from hdvplan.road.road import Road

_TIGHTEST = 0.5  # of the moved line [1/m]; at the centre of curvature it would be infinite
_SPACING_M = 0.25  # of the moved line's knots, before stretching


def reversed_road(road: Road) -> Road:
    """Return the road driven the other way: s runs from its end, left and right change sides."""
    path, length = road.path, road.path.length
    s = path.spacing * np.arange(round(length / path.spacing), -1.0, -1.0)
    here = path.at(s)
    turned = from_samples(here.x, here.y, here.heading + np.pi, -here.curvature, path.spacing, closed=path.closed)
    limits, smoothing = road.limits, road.smoothing
    if limits is not None:
        limits = Limits(
            *(column[::-1] for column in (length - limits.s, -limits.right, -limits.left, -limits.right_sweep, -limits.left_sweep))
        )
    if smoothing is not None:
        deviation, curvature = length - smoothing.max_deviation_s, length - smoothing.max_curvature_s
        smoothing = replace(smoothing, max_deviation_s=deviation, max_curvature_s=curvature)
    about = None if road.about is None else road.about.reversed(length)
    drawn = None if road.drawn is None else tuple(kerb.reversed(length) for kerb in road.drawn)
    return replace(road, path=turned, smoothing=smoothing, about=about).within(limits, drawn, road.bridges)


def offset_road(road: Road, offset: float) -> Road:
    """Return the road with its reference moved by ``offset`` [m], left positive; the limits' edges stay in the plane.

    Arclength shrinks on the inside of bends: d s' = (1 - offset k) ds, so s' = s - offset (psi(s) - psi(0)). The moved
    line's curvature, k / (1 - offset k), is as continuous as the drawn one's.

    Raises:
        RoadError: the moved line reaches, or comes within 2 m of, the drawn one's centre of curvature; or a limit that the
            road file gives lies on the wrong side of the moved line.

    """
    path = road.path
    s = np.linspace(0.0, path.length, max(2, int(np.ceil(path.length / _SPACING_M))) + 1)
    here = path.at(s)
    stretch = 1.0 - offset * here.curvature
    bad = (stretch <= 0.0) | (np.abs(here.curvature) > _TIGHTEST * stretch)
    if np.any(bad):
        at = float(s[np.argmin(np.where(bad, stretch, np.inf))])
        radius = 1.0 / abs(float(path.at(at).curvature))
        msg = f"an offset of {offset:g} m comes too near the centre of the bend at s = {at:z.1f} m, whose radius is {radius:.2f} m"
        raise RoadError(msg, s_m=at, hint="choose a smaller --offset, or allow a wider bend with --smooth")
    along = s - offset * (np.unwrap(here.heading) - here.heading[0])
    moved = _moved(path, offset, s, along)
    limits, smoothing = road.limits, road.smoothing
    if limits is not None:
        columns = (limits.left, limits.right, limits.left_sweep, limits.right_sweep)
        nodes = np.union1d(limits.s, s[[0, -1]])  # enough: limits are linear in s, and s' is linear where the road is not bent
        nodes = np.union1d(nodes, s[np.abs(here.curvature) > 0.0]) if _varies(columns) else nodes
        limits = Limits(np.interp(nodes, s, along), *(np.interp(nodes, limits.s, column) - offset for column in columns))
        _refuse_outside(limits, offset)
    if smoothing is not None:
        curvature = np.abs(here.curvature / stretch)
        tightest = int(np.argmax(curvature))
        there = float(np.interp(smoothing.max_deviation_s, s, along))
        smoothing = replace(
            smoothing, max_deviation_s=there, max_curvature=float(curvature[tightest]), max_curvature_s=float(along[tightest])
        )
    about, drawn = road.about, road.drawn
    if about is not None:
        corners = tuple(one._replace(s=float(np.interp(one.s, s, along))) for one in about.corners)
        about = replace(about, s=np.interp(about.s, s, along), offset=about.offset + offset, corners=corners)
    if drawn is not None:
        drawn = tuple(replace(kerb, s=carried(kerb.s, s, along)) for kerb in drawn)
    return replace(road, path=moved, smoothing=smoothing, about=about).within(limits, drawn, road.bridges)


def _refuse_outside(limits: Limits, offset: float) -> None:
    for beyond, side in ((limits.left <= 0.0, "left"), (limits.right >= 0.0, "right")):
        if np.any(beyond):
            at = float(limits.s[np.argmax(beyond)])
            msg = f"an offset of {offset:g} m lies beyond the road's own {side} limit at s = {at:z.1f} m"
            raise RoadError(msg, s_m=at, hint="choose a smaller --offset; left is positive")


def _varies(columns: tuple[FloatArray, ...]) -> bool:
    return any(bool(np.ptp(column) > 0.0) for column in columns)


def _moved(path: ReferencePath, offset: float, s: FloatArray, along: FloatArray) -> ReferencePath:
    """Return the parallel line, with knots at equal arclengths; ``along`` are its arclengths at ``s``."""
    length = float(along[-1])
    knots = np.linspace(0.0, length, max(2, int(np.ceil(length / path.spacing))) + 1)
    at = np.clip(np.interp(knots, along, s), 0.0, path.length)
    turned = np.unwrap(path.at(s).heading)
    for _ in range(3):  # Newton: interpolation is good to 1e-4 m already
        here = path.at(at)
        heading = here.heading + 2.0 * np.pi * np.round((np.interp(at, s, turned) - here.heading) / (2.0 * np.pi))
        at = np.clip(at + (knots - (at - offset * (heading - turned[0]))) / (1.0 - offset * here.curvature), 0.0, path.length)
    here = path.at(at)
    x, y = path.to_plane(at, offset)
    return from_samples(x, y, here.heading, here.curvature / (1.0 - offset * here.curvature), float(knots[1]), closed=path.closed)
