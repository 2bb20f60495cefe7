"""What the lines of a file say of themselves: widths, corners, whose they are; which are legs, and where a table's points turn back."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from hdvplan.arrays import FloatArray, IntArray
from hdvplan.errors import RoadError
from hdvplan.road.columns import folded, is_width
from hdvplan.road.features import Feature, Json, is_finite
from hdvplan.road.legs import BACKWARD, FORWARD, SAME_M, direction_of
from hdvplan.road.line import RawLeg, RawRoad
from hdvplan.road.options import Corners
from hdvplan.settings import any_of
from hdvplan.texts import is_number, printable

_WIDTHS = ("left_m", "right_m", "width_m")


def with_properties(points: FloatArray, properties: Json, name: str, *, parts: int) -> RawRoad:
    """Return a line of (n, 2) points [m], put together from ``parts``, with what its properties say.

    Raises:
        RoadError: a property that says nothing, widths that do not belong together, or widths point by point of several parts.

    """
    if parts > 1:
        _refuse_lists(properties, name)
    reaches, notice = _reaches(properties, len(points), name), _notice(properties)
    like = [key for key, value in properties.items() if key not in _WIDTHS and is_width(key) and is_number(str(value))]
    notes = (f"{name}: {', '.join(like)} not read; widths are called left_m and right_m, or width_m, in metres",) if like else ()
    corners, radius = _corners(properties, name), _corner_radius(properties, name)
    return RawRoad(points, reaches, notice=notice, corners=corners, corner_radius=radius, notes=notes)


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
    value = properties.get("corners")
    if value is not None and value not in list(Corners):
        msg = f"{name}: property corners must be {any_of(list(Corners))}, not {value!r}"
        raise RoadError(msg)
    return value


def _corner_radius(properties: Json, name: str) -> float:
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


_COLUMN = "direction"
_SIGNS = {FORWARD: 1, BACKWARD: -1, "1": 1, "+1": 1, "-1": -1, "1.0": 1, "-1.0": -1}
_NAMED = re.compile(rf"leg_(\d{{1,6}})_({FORWARD}|{BACKWARD})")  # a layer, or a line, that says both
_WRITE = 'give every line the properties "leg": 1, 2, ... and "direction": "forward" or "backward"'


@dataclass(frozen=True)
class _Mark:
    """What a line says of itself: which leg it is, from 1, and how it is driven."""

    number: int
    backward: bool


def legs_among(features: Sequence[Feature], name: str) -> list[tuple[int, bool]]:
    """Return which of several lines are legs, in the order of driving, and whether they are driven backwards; empty where none is one.

    A leg has the properties ``leg`` and ``direction``, or a name or layer such as ``leg 2 backward``.

    Raises:
        RoadError: a number or direction that is missing or unknown, or legs that make no drive of several.

    """
    marks = [_mark_of(feature, name) for feature in features]
    found = {mark.number: (at, mark.backward) for at, mark in enumerate(marks) if mark is not None}
    if not found:
        return []
    numbers = [mark.number for mark in marks if mark is not None]
    twice = next((number for number in numbers if numbers.count(number) > 1), None)
    if twice is not None:
        msg = f"{name}: {numbers.count(twice)} lines are leg {twice}"
        raise RoadError(msg, hint="a leg is one line: join them, or number them in the order of driving")
    missing = next((number for number in range(1, max(numbers)) if number not in found), None)
    if missing is not None or 0 in found:
        msg = f"{name}: legs are numbered 1, 2, ..., and " + ("one is 0" if 0 in found else f"leg {missing} is missing")
        raise RoadError(msg, hint=_WRITE)
    for feature, mark in zip(features, marks, strict=True):
        if mark is None and feature.properties.get(_COLUMN) in {FORWARD, BACKWARD}:
            msg = f"{name}: a line is driven {feature.properties[_COLUMN]}, but has no number"
            raise RoadError(msg, hint=_WRITE)
    ordered = [found[number] for number in sorted(found)]
    _refuse_no_cusps([backward for _, backward in ordered], name)
    return ordered


def _mark_of(feature: Feature, name: str) -> _Mark | None:
    value = feature.properties.get("leg")
    if value is None:
        named = (_NAMED.fullmatch(folded(label)) for label in (*feature.labels, feature.layer))
        found = next((one for one in named if one is not None), None)
        return None if found is None else _Mark(int(found[1]), found[2] == BACKWARD)
    text = f"{value:g}" if is_finite(value) else str(value)
    if not re.fullmatch(r"\d{1,6}", text):
        msg = f"{name}: property leg must be a whole number from 1, not {value!r}"
        raise RoadError(msg, hint=_WRITE)
    direction = feature.properties.get(_COLUMN)
    if direction not in {FORWARD, BACKWARD}:
        what = "no direction" if direction is None else f"the direction {direction!r}"
        msg = f"{name}: leg {text} has {what}; it is {FORWARD} or {BACKWARD}"
        raise RoadError(msg, hint=_WRITE)
    return _Mark(int(text), direction == BACKWARD)


def _refuse_no_cusps(backward: list[bool], name: str) -> None:
    """Refuse legs between which a vehicle would not turn back."""
    if backward == [False]:
        msg = f"{name}: a single leg that is driven forwards is a road"
        raise RoadError(msg, hint="leave leg and direction out")
    for number, (own, other) in enumerate(pairwise(backward), start=1):
        if own is other:
            msg = f"{name}: legs {number} and {number + 1} are both driven {direction_of(backward=own)}s"
            raise RoadError(msg, hint="join them to one line, or correct a direction: at a cusp it changes")


def signs_in(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> tuple[int, IntArray] | None:
    """Return the number of a table's column ``direction`` and its signs, 1 and -1, one a row; None where none says only that."""
    at = next((number for number, title in enumerate(titles) if folded(title) == _COLUMN), None)
    if at is None or not rows or not all(row[at].casefold() in _SIGNS for row in rows):
        return None
    return at, np.array([_SIGNS[row[at].casefold()] for row in rows])


def in_legs(raw: RawRoad, signs: IntArray, name: str) -> RawRoad:
    """Return the line of a table, cut where ``signs`` (n,) of its points change; the line itself where it is driven forwards throughout.

    A cusp is the one of the two points at which the line turns back, or both where they are one point.

    Raises:
        RoadError: the line does not turn back there, or a curvature profile.

    """
    if np.all(signs > 0):
        return raw
    if raw.is_profile:
        msg = f"{name}: a curvature profile cannot be driven backwards"
        raise RoadError(msg, hint="give points: columns x,y and direction")
    begin, legs = 0, []
    for last in np.flatnonzero(np.diff(signs)).tolist():
        end, after = _cusp(raw, last, name)
        legs.append(_part(raw, begin, end, name, backward=bool(signs[last] < 0)))
        begin = after
    legs.append(_part(raw, begin, len(signs) - 1, name, backward=bool(signs[-1] < 0)))
    return replace(raw, legs=tuple(legs))


def _cusp(raw: RawRoad, last: int, name: str) -> tuple[int, int]:
    """Return the last point of one leg and the first of the next, where the sign changes behind the point ``last``."""
    points = raw.points[max(0, last - 1) : last + 3]
    here, step = min(last, 1), np.diff(points, axis=0)
    if np.hypot(*step[here]) <= SAME_M:
        return last, last + 1
    turns = {last + i - here: _cosine(step[i - 1], step[i]) for i in (here, here + 1) if 0 < i < len(step)}
    cusp = min(turns, key=lambda at: turns[at], default=last)
    if turns.get(cusp, 1.0) >= 0.0:
        where = "" if raw.lines is None else f", line {raw.lines[last + 1]}"
        msg = f"{name}{where}: the direction changes, but the line does not turn back there"
        raise RoadError(msg, hint="lines are drawn in the order of driving: behind a cusp a line goes back")
    return cusp, cusp


def _cosine(one: FloatArray, other: FloatArray) -> float:
    return float(one @ other / max(float(np.hypot(*one) * np.hypot(*other)), SAME_M**2))


def _part(raw: RawRoad, begin: int, end: int, name: str, *, backward: bool) -> RawLeg:
    if end <= begin:
        msg = f"{name}: a leg has one point alone"
        raise RoadError(msg, hint="the direction changes at cusps only, and a leg between two of them has two points or more")
    own = slice(begin, end + 1)
    reaches, lines = (None if raw.reaches is None else raw.reaches[:, own]), (None if raw.lines is None else raw.lines[own])
    return RawLeg(replace(raw, points=raw.points[own], reaches=reaches, lines=lines, notes=()), backward)
