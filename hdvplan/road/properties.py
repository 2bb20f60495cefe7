"""What the properties of a line in a file of features say of its road: widths, how to read its corners, and whose it is."""

from __future__ import annotations

from typing import Any

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError
from hdvplan.road.features import Json, is_finite
from hdvplan.road.line import RawRoad
from hdvplan.road.options import Corners
from hdvplan.settings import any_of
from hdvplan.texts import printable

_WIDTHS = ("left_m", "right_m", "width_m")


def with_properties(points: FloatArray, properties: Json, name: str, *, parts: int) -> RawRoad:
    """Return a line of (n, 2) points [m], put together from ``parts``, with what its properties say.

    Raises:
        RoadError: a property that says nothing, widths that do not belong together, or widths point by point of several parts.

    """
    if parts > 1:
        _refuse_lists(properties, name)
    reaches, notice = _reaches(properties, len(points), name), _notice(properties)
    return RawRoad(points, reaches, notice=notice, corners=_corners(properties, name), corner_radius=_corner_radius(properties, name))


def _reaches(properties: Json, count: int, name: str) -> FloatArray | None:
    given = [key for key in _WIDTHS if properties.get(key) is not None]
    if not given:
        return None
    if set(given) not in ({"left_m", "right_m"}, {"width_m"}):
        msg = f"{name}: properties {', '.join(given)} do not give the width: left_m with right_m, or width_m alone"
        raise RoadError(msg)
    columns = [_reach(properties[key], key, count, name) for key in given]
    left, right = (0.5 * columns[0],) * 2 if given == ["width_m"] else columns
    return np.stack([left, right, left, right])


def _reach(value: Any, key: str, count: int, name: str) -> FloatArray:  # noqa: ANN401 - whatever a file says
    """Return a width at each of ``count`` points [m]: one for all of them, or a list of as many."""
    values = value if isinstance(value, list) else [value] * count
    if len(values) != count:
        msg = f"{name}: property {key} has {len(values)} values for a line of {count} points"
        raise RoadError(msg, hint="give one width for the whole line, or one for each of its points")
    bad = [one for one in values if not (is_finite(one) and one > 0.0)]
    if bad:
        msg = f"{name}: property {key} must be a positive number of metres, not {bad[0]!r}"
        raise RoadError(msg)
    return np.array(values, dtype=float)


def _corners(properties: Json, name: str) -> str | None:
    """Return how the points are to be read; None where the file does not say."""
    value = properties.get("corners")
    if value is not None and value not in list(Corners):
        msg = f"{name}: property corners must be {any_of(list(Corners))}, not {value!r}"
        raise RoadError(msg)
    return value


def _corner_radius(properties: Json, name: str) -> float:
    """Return the radius of the kerbs inside corners [m]; 0 where the file does not say."""
    value = properties.get("corner_radius_m", 0.0)
    if not (is_finite(value) and value >= 0.0):
        msg = f"{name}: property corner_radius_m must be a number of metres, not {value!r}"
        raise RoadError(msg)
    return float(value)


def _refuse_lists(properties: Json, name: str) -> None:
    """Refuse widths point by point of a line that is put together from several parts: whose points they are nobody says."""
    listed = next((key for key in _WIDTHS if isinstance(properties.get(key), list)), None)
    if listed is not None:
        msg = f"{name}: property {listed} is a list, and the line has several parts"
        raise RoadError(msg, hint="join the parts to one LineString")


def _notice(properties: Json) -> str | None:
    """Return the short attribution: its first sentence and the licence."""
    attribution = str(properties.get("attribution") or "").split(". ")[0].rstrip(".")
    licence = str(properties.get("licence") or properties.get("license") or "").replace("-", " ")
    return printable(", ".join(part for part in (attribution, licence) if part)) or None
