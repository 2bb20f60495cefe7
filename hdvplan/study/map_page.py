"""The map of a study: one HTML file that needs no network, with its roads, the ranking's places, and a table that filters."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import shapely

from hdvplan.answers import NO, WORDS, YES
from hdvplan.fileio import write_atomically
from hdvplan.report.html import page_part, page_template, script_json
from hdvplan.texts import encoded
from hdvplan.version import __version__

MOST_PLACES = 5000  # shown, in the ranking's order; the files hold all
MOST_ROADS = 3000
MOST_COURSES = 100_000  # of road, vehicle and width, by which lines are coloured
MOST_CHOICES = 100  # widths, and vehicles, of the table and the filters; others are found by words
_PACKAGE = "hdvplan.study"  # of the page's files
_DIGITS = 5  # of degrees: a metre
_SHOWN = (
    "rank", "worst_rank", "widening_m", "widening_m2", "vehicles", "roads", "half_width_m", "left_m", "right_m", "road", "s_m", "lon",
    "lat", "vehicle", "side", "unit", "part", "obstacle", "which_vehicles", "which_roads",
)  # fmt: skip
_WORDS = (*WORDS, "no answer")  # the best first
_READ = ("road", "vehicle", "half_width_m", "left_m", "right_m", "word", "notice", "geometry")
_AT_ONCE = 4096  # rows in memory

Json = dict[str, Any]


def write_page(path: Path, cells: Path, ranking: pd.DataFrame, date: str) -> None:
    """Write the page about the study whose whole table is ``cells``.

    Raises:
        OSError: the file cannot be written.

    """
    gathered = _gathered(cells)
    placed = list(gathered.lines)
    data = {
        "vehicles": list(gathered.vehicles),
        "widths": list(gathered.widths),
        "words": _WORDS,
        "roads": [{"name": name, "line": gathered.lines[name]} for name in placed],
        "courses": _courses(gathered, {gathered.roads[name]: number for number, name in enumerate(placed)}),
        "places": [_place(row) for row in ranking.head(MOST_PLACES)[list(_SHOWN)].to_dict("records")],
    }
    page = page_template("study.html.j2", _PACKAGE).render(
        version=__version__,
        style=page_part("report.css") + page_part("study.css", _PACKAGE),
        script=page_part("study.js", _PACKAGE),
        data=script_json(data),
        date=date[:10],
        cells=gathered.cells,
        roads=len(gathered.roads),
        vehicles=list(gathered.vehicles)[:MOST_CHOICES],
        widths=list(gathered.widths)[:MOST_CHOICES],
        count=len(gathered.vehicles),
        matrix=_matrix(gathered),
        nowhere=len(gathered.roads) - len(gathered.placed),
        roads_left=len(gathered.placed) - len(placed),
        places_left=max(0, len(ranking) - MOST_PLACES),
        found=len(ranking),
        notices=sorted(gathered.notices),
        unanswered=gathered.unanswered,
    )
    write_atomically(path, encoded(page))


@dataclass
class _Gathered:
    """What the page needs of a study's cells, gathered row by row: names in their order, and the best word of every course."""

    roads: dict[str, int] = field(default_factory=dict)
    vehicles: dict[str, int] = field(default_factory=dict)
    widths: dict[str, int] = field(default_factory=dict)
    placed: set[str] = field(default_factory=set)  # roads that lie on the Earth
    lines: dict[str, list[list[float]]] = field(default_factory=dict)  # longitude and latitude [deg] of those that are shown
    best: dict[tuple[int, int, int], int] = field(default_factory=dict)  # by the numbers of road, vehicle and width
    notices: set[str] = field(default_factory=set)
    cells: int = 0
    unanswered: int = 0

    def add(self, road: str, vehicle: str, width: str, word: str, notice: str | None, line: bytes | None) -> None:
        names = ((self.roads, road), (self.vehicles, vehicle), (self.widths, width))
        number = tuple(known.setdefault(name, len(known)) for known, name in names)
        course = (number[0], number[1], number[2])
        self.best[course] = min(self.best.get(course, len(_WORDS)), _WORDS.index(word))
        self.cells += 1
        self.unanswered += word == _WORDS[-1]
        if notice is not None:
            self.notices.add(notice)
        if line is not None and road not in self.placed:
            self.placed.add(road)
            if len(self.lines) < MOST_ROADS:
                self.lines[road] = np.round(shapely.get_coordinates(shapely.from_wkb(line)), _DIGITS).tolist()


def _gathered(cells: Path) -> _Gathered:
    gathered = _Gathered()
    for batch in pq.ParquetFile(cells).iter_batches(columns=list(_READ), batch_size=_AT_ONCE):
        for road, vehicle, half_width, left, right, word, notice, line in zip(*(batch[name].to_pylist() for name in _READ), strict=True):
            gathered.add(road, vehicle, width_text(half_width, left, right), word or _WORDS[-1], notice, line)
    return gathered


def width_text(half_width: float | None, left: float | None, right: float | None) -> str:
    """Return how a page names limits: at +-M, left and right, or the road's own."""
    if half_width is not None:
        return f"\u00b1 {half_width:g} m"
    return "the road's own" if left is None else f"left {left:g} m, right {right:g} m"


def _matrix(gathered: _Gathered) -> list[Json]:
    """Return for every vehicle and width how many of the roads it fits, by the best plan."""
    counts: dict[tuple[int, int], list[int]] = {}
    for (_, vehicle, width), word in gathered.best.items():
        if word <= _WORDS.index(NO):
            fits = counts.setdefault((vehicle, width), [0, 0])
            fits[0] += word == _WORDS.index(YES)
            fits[1] += 1
    rows = []
    for name, vehicle in list(gathered.vehicles.items())[:MOST_CHOICES]:
        found = [counts.get((vehicle, width)) for width in range(len(gathered.widths))[:MOST_CHOICES]]
        rows.append({"vehicle": name, "cells": ["-" if of is None else f"{of[0]} of {of[1]}" for of in found]})
    return rows


def _courses(gathered: _Gathered, places: dict[int, int]) -> list[list[int]]:
    """Return [road, vehicle, width, word], the road by its number among those that are shown."""
    if len(gathered.best) > MOST_COURSES:
        return []
    return [[places[road], vehicle, width, word] for (road, vehicle, width), word in gathered.best.items() if road in places]


def _place(row: Mapping[Any, Any]) -> Json:
    """Return a place without what is missing; lengths to the centimetre, degrees to the decimetre."""
    there = {name: value for name, value in row.items() if value is not None and value == value}  # noqa: PLR0124 - NaN
    digits = Counter({"lon": 6, "lat": 6, "s_m": 1})
    width = width_text(*(there.pop(name, None) for name in ("half_width_m", "left_m", "right_m")))  # as in the choices, digit by digit
    return {"width": width} | {
        name: round(value, digits[name] or 2) if isinstance(value, float) else value for name, value in there.items()
    }
